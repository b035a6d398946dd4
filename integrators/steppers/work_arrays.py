"""The arrays that a generated stepper computes in, and the numbers that it reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from ..codegen import ModuleText

MOST_STACK = 32_768
"""Doubles of work arrays on the stack: a small thread has twice the room. Beyond, the caller brings an array."""


class WorkArrays:
    """Work arrays, constants, and numbers that depend on the step size.

    Args:
        dimension: The number of variables.
        module: The module that they are for.

    Attributes:
        module: The same.
        numbers: Functions of h that give, one after the other, the numbers that depend on it.
    """

    def __init__(self, dimension: int, module: ModuleText):
        self.module = module
        self.numbers: list[Callable[[float], np.ndarray]] = []
        self._dimension, self._number_count = dimension, 0
        self._sizes: dict[str, int] = {}
        self._constants: dict[str, str] = {}

    def array(self, name: str, size: int | None = None) -> str:
        """The name of a work array; by default it has the size of the state."""
        self._sizes[name] = max(self._sizes.get(name, 0), size or self._dimension)
        return name

    def constants(self, values: Sequence[sympy.Expr]) -> str:
        """A pointer to constants: unlike an array it is not asked whether indices are negative."""
        name = self.module.numbers(values)
        return self._constants.setdefault(name, name.lower())

    def number_array(self, count: int, values: Callable[[float], np.ndarray]) -> str:
        """The beginning of an array of numbers that depend on the step size only, as a pointer.

        Args:
            count: How many there are.
            values: Computes them from h.
        """
        self.numbers.append(values)
        self._number_count += count
        return f"shifted(constants, {self._number_count - count})"

    def array_lines(self) -> tuple[list[str], int]:
        """Statements that make the arrays, and how many doubles the caller must bring.

        LLVM knows of arrays on the stack that they do not overlap, and puts short ones into registers.
        """
        lines = [f"{name} = pointer({array})" for array, name in self._constants.items()]
        total = sum(self._sizes.values())
        if total <= MOST_STACK:
            return [*lines, *(f"{name} = stack({size})" for name, size in self._sizes.items())], 0
        offset = 0
        for name, size in self._sizes.items():
            lines.append(f"{name} = shifted(w, {offset})")
            offset += size
        return lines, total
