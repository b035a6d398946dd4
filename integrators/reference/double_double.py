"""Double-double arithmetic: a number as the unevaluated sum of two doubles, with some 31 digits.

A number is a pair (high, low) with |low| at most half a unit in the last place of high. All functions are compiled, for
use in other compiled code. They keep their own strict rules of floating point, whatever their callers allow: a
transformation such as `two_sum` is worthless where its additions are reordered.

References:
    T. J. Dekker, A floating-point technique for extending the available precision, Numer. Math. 18 (1971) 224–242,
    doi:10.1007/BF01397083; M. Joldes, J.-M. Muller, V. Popescu, Tight and rigorous error bounds for basic building
    blocks of double-word arithmetic, ACM Trans. Math. Softw. 44 (2017), doi:10.1145/3121432.
"""

from __future__ import annotations

from fractions import Fraction
from math import isinf, sqrt
from typing import Any

from numba import njit

from integrators.compile.machine import fma

DoubleDouble = tuple[float, float]

strict: Any = njit(nogil=True, error_model="numpy", fastmath=False)
inlined: Any = njit(nogil=True, error_model="numpy", fastmath=False, forceinline=True)


def split(value: Fraction) -> DoubleDouble:
    """The pair nearest to an exact number.

    Raises:
        OverflowError: It is beyond the range of doubles.

    Example:
        >>> split(Fraction(1, 3))
        (0.3333333333333333, 1.850371707708594e-17)
    """
    high = float(value)
    return high, float(value - Fraction(high))


@inlined
def two_sum(x: float, y: float) -> DoubleDouble:
    """The sum of two doubles, and its rounding error."""
    total = x + y
    other = total - x
    return total, (x - (total - other)) + (y - other)


@inlined
def quick_two_sum(x: float, y: float) -> DoubleDouble:
    """`two_sum` for |x| ≥ |y|."""
    total = x + y
    return total, y - (total - x)


@inlined
def two_product(x: float, y: float) -> DoubleDouble:
    """The product of two doubles, and its rounding error."""
    product = x * y
    return product, fma(x, y, -product)


@inlined
def negative(x: DoubleDouble) -> DoubleDouble:
    """−x."""
    return -x[0], -x[1]


@inlined
def add(x: DoubleDouble, y: DoubleDouble) -> DoubleDouble:
    """x + y."""
    high, low = two_sum(x[0], y[0])
    high_of_low, low_of_low = two_sum(x[1], y[1])
    high, low = quick_two_sum(high, low + high_of_low)
    return quick_two_sum(high, low + low_of_low)


@inlined
def subtract(x: DoubleDouble, y: DoubleDouble) -> DoubleDouble:
    """x − y."""
    return add(x, negative(y))


@inlined
def multiply(x: DoubleDouble, y: DoubleDouble) -> DoubleDouble:
    """x·y."""
    high, low = two_product(x[0], y[0])
    return quick_two_sum(high, low + fma(x[1], y[0], fma(x[0], y[1], x[1] * y[1])))


@inlined
def scale(x: DoubleDouble, factor: float) -> DoubleDouble:
    """x times a double."""
    high, low = two_product(x[0], factor)
    return quick_two_sum(high, fma(x[1], factor, low))


@inlined
def divide(x: DoubleDouble, y: DoubleDouble) -> DoubleDouble:
    """x / y: three digits in base 2⁵³ by long division."""
    first = x[0] / y[0]
    if isinf(first) or isinf(y[0]):
        return first, 0.0
    rest = subtract(x, scale(y, first))
    second = rest[0] / y[0]
    rest = subtract(rest, scale(y, second))
    return add(quick_two_sum(first, second), (rest[0] / y[0], 0.0))


@strict
def square_root(x: DoubleDouble) -> DoubleDouble:
    """√x: Newton's step from the root of the high part."""
    if not x[0] > 0 or isinf(x[0]):
        return sqrt(x[0]), 0.0
    root = sqrt(x[0])
    rest = subtract(x, two_product(root, root))
    return quick_two_sum(root, rest[0] / (2 * root))


@strict
def integer_power(x: DoubleDouble, n: int) -> DoubleDouble:
    """x^n for an integer n, by repeated squaring."""
    power, factor, left = (1.0, 0.0), x, abs(n)
    while left:
        if left % 2:
            power = multiply(power, factor)
        left //= 2
        if left:
            factor = multiply(factor, factor)
    return power if n >= 0 else divide((1.0, 0.0), power)
