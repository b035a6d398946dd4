"""Vectors of doubles, or of mpmath numbers of any precision, as NumPy arrays."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import mpmath
import numpy as np

from integrators.core.arguments import check_digits, items
from integrators.core.errors import IntegratorError, shorten, shown
from integrators.exact.entries import is_sympy, read_entry

Vector = np.ndarray[Any, Any]

GUARD_DIGITS = 10
"""Extra digits of mpmath numbers."""
MOST_BITS = 4000
"""mpmath numbers do not overflow, but a value of 2^4000, or 10^1204, has diverged."""


class Arithmetic:
    """The numbers to compute with: doubles, or mpmath numbers with guard digits.

    Args:
        digits: The number of decimal digits; None for doubles.

    Raises:
        IntegratorError: `digits` is neither None nor an integer from 1 to 1000.

    Example:
        >>> arithmetic = Arithmetic(30)
        >>> with arithmetic.working():
        ...     third = arithmetic.read(["1/3"], "y")
        >>> print(arithmetic.rounded(third)[0])
        0.333333333333333
        >>> abs(3 * arithmetic.rounded(third)[0] - 1) < 1e-29
        True
    """

    def __init__(self, digits: int | None = None) -> None:
        check_digits(digits)
        self.digits = digits
        self.decimals = 16 if digits is None else digits + GUARD_DIGITS
        self.context: Any = mpmath.fp if digits is None else mpmath.mp
        self._largest: Any = math.inf if digits is None else mpmath.ldexp(1, MOST_BITS)

    @contextmanager
    def working(self) -> Iterator[None]:
        """A context for computations in this arithmetic."""
        with np.errstate(all="ignore"), mpmath.workdps(self.decimals):  # results are checked to be finite
            yield

    def number(self, value: Any, argument: str) -> Any:
        """A finite number: a real number of any kind, or a formula without symbols."""
        if not hasattr(value, "_mpf_") and not is_sympy(value):
            value = read_entry(value, argument)
        if is_sympy(value):
            if value.free_symbols:
                raise IntegratorError(
                    f"{argument} must be a number, but has the symbol {min(map(str, value.free_symbols))}"
                )
            value = value.evalf(self.decimals + GUARD_DIGITS)
        try:
            number = +self.context.convert(value)
        except OverflowError:
            number = math.inf
        if not self.is_finite([number]):
            raise IntegratorError(f"{argument} must be a finite number, but was {shorten(str(value))}")
        return number

    def vector(self, values: Any) -> Vector:
        """A vector of numbers of this arithmetic."""
        return np.array(values, dtype=float if self.digits is None else object)

    def read(self, values: Any, argument: str) -> Vector:
        """A vector from an argument of the user."""
        numbers = items(values, argument)
        if not numbers:
            raise IntegratorError(f"{argument} must hold at least one number, but was empty")
        return self.vector([self.number(value, f"{argument}[{i}]") for i, value in enumerate(numbers, 1)])

    def received(self, values: Any, dimension: int, argument: str) -> Vector:
        """A vector from a function of the user; components that are not real become NaN."""
        numbers = items(values, argument)
        if len(numbers) != dimension:
            raise IntegratorError(f"{argument} must give {dimension} numbers, but gave {shown(values)}")
        return self.vector([self._component(number, argument) for number in numbers])

    def _component(self, value: Any, argument: str) -> Any:
        if self.digits is not None and isinstance(value, float) and math.isfinite(value) and not value.is_integer():
            raise IntegratorError(
                f"{argument} must compute with mpmath for {self.digits} digits, but gave the float {value!r}"
            )
        try:
            number = +self.context.convert(value)
        except (TypeError, ValueError):
            raise IntegratorError(f"{argument} must give numbers, but gave {shown(value)}") from None
        return math.nan if isinstance(number, self.context.mpc) else number

    def is_finite(self, *vectors: Iterable[Any]) -> bool:
        """Whether all components are finite, and below 2^MOST_BITS for mpmath."""
        return all(abs(x) < self._largest for vector in vectors for x in vector)

    def solve(self, matrix: Vector, right: Vector) -> Vector | None:
        """The solution of a linear system; None if the matrix is singular or not finite."""
        context = self.context
        if not self.is_finite(*matrix):
            return None
        try:
            return self.vector(list(context.lu_solve(context.matrix(matrix.tolist()), context.matrix(right.tolist()))))
        except ZeroDivisionError:
            return None

    def rounded(self, vector: Iterable[Any]) -> Vector:
        """The vector without guard digits."""
        if self.digits is None:
            return self.vector(vector)
        with mpmath.workdps(self.digits):
            return self.vector([+mpmath.mpmathify(x) for x in vector])
