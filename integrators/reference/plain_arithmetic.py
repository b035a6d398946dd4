"""Arithmetic of plain steps: doubles, or mpmath numbers of any precision."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import reduce
from typing import TYPE_CHECKING, Any, TypeAlias

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten
from integrators.exact.entries import is_sympy, read_entry

if TYPE_CHECKING:
    import numpy as np

    Vector: TypeAlias = "np.ndarray[Any, Any]"

GUARD_DIGITS = 10
"""Extra digits of mpmath numbers."""
MOST_DIGITS = 1000
MOST_BITS = 4000
"""mpmath numbers do not overflow, but a value of 2^4000, or 10^1204, has diverged."""


class Arithmetic:
    """Vectors of doubles, or of mpmath numbers: NumPy arrays of floats or of objects.

    Args:
        digits: The number of decimal digits; None for doubles.

    Raises:
        IntegratorError: `digits` is not a number from 1 to 1,000.

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
        if digits is not None and (isinstance(digits, bool) or not isinstance(digits, int)):
            raise IntegratorError(f"digits must be a whole number or None, but was {shorten(repr(digits))}")
        if digits is not None and not 1 <= digits <= MOST_DIGITS:
            raise IntegratorError(f"digits must be from 1 to {MOST_DIGITS}, but was {shorten(str(digits))}")
        self.digits = digits

    @property
    def decimals(self) -> int:
        """The number of working digits."""
        return 16 if self.digits is None else self.digits + GUARD_DIGITS

    @property
    def rounding(self) -> Any:
        """The relative error of one operation."""
        if self.digits is None:
            return 2.0**-52
        import mpmath

        return mpmath.mpf(10) ** -self.decimals

    @contextmanager
    def working(self, factor: int = 1) -> Iterator[None]:
        """A context for computations in this arithmetic, or with `factor` times as many digits."""
        import numpy as np

        with np.errstate(all="ignore"):  # results are checked to be finite
            if self.digits is None:
                yield
            else:
                import mpmath

                with mpmath.workdps(factor * self.decimals):
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
            number = self._convert(value)
        except OverflowError:
            number = math.inf
        if not self.is_finite([number]):
            raise IntegratorError(f"{argument} must be a finite number, but was {shorten(str(value))}")
        return number

    def _convert(self, value: Any) -> Any:
        if self.digits is None:
            return float(value)
        import mpmath

        return +mpmath.mpmathify(value)

    def vector(self, values: Sequence[Any]) -> Vector:
        """A vector of numbers of this arithmetic, or of mpmath numbers of another precision."""
        import numpy as np

        return np.array(values, dtype=float if self.digits is None else object)

    def zeros(self, *shape: int) -> Vector:
        """An array of zeros."""
        import numpy as np

        return np.zeros(shape) if self.digits is None else np.zeros(shape, dtype=int).astype(object)

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
            raise IntegratorError(f"{argument} must give {dimension} numbers, but gave {shorten(repr(values))}")
        return self.vector([self._component(number, argument) for number in numbers])

    def _component(self, value: Any, argument: str) -> Any:
        if isinstance(value, complex) or hasattr(value, "_mpc_"):
            return math.nan
        if self.digits is not None and isinstance(value, float) and math.isfinite(value) and not value.is_integer():
            raise IntegratorError(
                f"{argument} must compute with mpmath for {self.digits} digits, but gave the float {value!r}"
            )
        try:
            return self._convert(value)
        except (TypeError, ValueError):
            raise IntegratorError(f"{argument} must give numbers, but gave {shorten(repr(value))}") from None

    def is_finite(self, *vectors: Iterable[Any]) -> bool:
        """Whether all components are finite, and below `MOST_BITS` bits for mpmath."""
        if self.digits is None:
            return all(math.isfinite(x) for vector in vectors for x in vector)
        import mpmath

        return all(mpmath.mag(x) < MOST_BITS for vector in vectors for x in vector)

    def solve(self, matrix: Vector, right: Vector) -> Vector | None:
        """The solution of a linear system; None if the matrix is singular or not finite."""
        if self.digits is None:
            import numpy as np

            try:
                return np.linalg.solve(matrix, right)
            except np.linalg.LinAlgError:
                return None
        import mpmath

        if not self.is_finite(*matrix):
            return None
        try:
            return self.vector(list(mpmath.lu_solve(mpmath.matrix(matrix.tolist()), mpmath.matrix(right.tolist()))))
        except ZeroDivisionError:
            return None

    def text(self, number: Any) -> str:
        """A number as text, to six digits."""
        if self.digits is None:
            return f"{number:g}"
        import mpmath

        return shorten(str(mpmath.nstr(mpmath.mpmathify(number), 6)))

    def rounded(self, vector: Vector) -> Vector:
        """The vector without guard digits."""
        if self.digits is None:
            return vector
        import mpmath

        with mpmath.workdps(self.digits):
            return self.vector([+mpmath.mpmathify(x) for x in vector])


def add(vectors: Sequence[Vector]) -> Vector:
    """The sum of one vector or more."""
    return reduce(operator.add, vectors)


def size(*vectors: Vector) -> Any:
    """The largest absolute value of a component."""
    return max(abs(x) for vector in vectors for x in vector)
