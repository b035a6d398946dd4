"""Double-double arithmetic and elementary functions: numbers as unevaluated sums of two doubles, about 31 digits.

A number is a pair (high, low) with |low| at most half a unit in the last place of high. All functions are compiled, for
use in other compiled code, without fast-math whatever their callers allow: `two_sum` fails if additions are reordered.

Exponential and trigonometric functions are Taylor series after argument reduction; their inverses refine the double
from `math` by one third-order Newton step. Near their zeros all functions keep relative precision. Outside their domain
they are nan.

References:
    T. J. Dekker, A floating-point technique for extending the available precision, Numer. Math. 18 (1971) 224–242,
    doi:10.1007/BF01397083; M. Joldes, J.-M. Muller, V. Popescu, Tight and rigorous error bounds for basic building
    blocks of double-word arithmetic, ACM Trans. Math. Softw. 44 (2017), doi:10.1145/3121432; J.-M. Muller, Elementary
    Functions, third edition, Birkhäuser 2016, doi:10.1007/978-1-4899-7983-4 (chapter 11: argument reduction).
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numba import njit

from integrators.compile.machine import fma

DoubleDouble = tuple[float, float]

strict = njit(nogil=True, error_model="numpy", fastmath=False)
inlined = njit(nogil=True, error_model="numpy", fastmath=False, forceinline=True)


def split(value: Fraction) -> DoubleDouble:
    """The pair nearest to an exact number."""
    high = float(value)
    return high, float(value - Fraction(high))


@inlined
def two_sum(x: float, y: float) -> DoubleDouble:
    """The sum of two doubles and its rounding error."""
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
    """The product of two doubles and its rounding error."""
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
    """x / y by long division, three digits in base 2⁵³."""
    first = x[0] / y[0]
    if math.isinf(first) or math.isinf(y[0]):
        return first, 0.0
    rest = subtract(x, scale(y, first))
    second = rest[0] / y[0]
    rest = subtract(rest, scale(y, second))
    return add(quick_two_sum(first, second), (rest[0] / y[0], 0.0))


@strict
def square_root(x: DoubleDouble) -> DoubleDouble:
    """√x by one Newton step from the root of the high part."""
    if not x[0] > 0 or math.isinf(x[0]):
        return math.sqrt(x[0]), 0.0
    root = math.sqrt(x[0])
    rest = subtract(x, two_product(root, root))
    return quick_two_sum(root, rest[0] / (2 * root))


@strict
def integer_power(x: DoubleDouble, n: int) -> DoubleDouble:
    """x^n for an integer n by repeated squaring."""
    power, factor, left = (1.0, 0.0), x, abs(n)
    while left:
        if left % 2:
            power = multiply(power, factor)
        left //= 2
        if left:
            factor = multiply(factor, factor)
    return power if n >= 0 else divide((1.0, 0.0), power)


# π/2 and log 2 as sums of four doubles.
HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33, 5.562271104316826e-50)
LOG_2 = (0.6931471805599453, 2.3190468138462996e-17, 5.707708438416212e-34, -3.5824322106018114e-50)

TWO_BY_ROOT_PI = (1.1283791670955126, 1.533545961316588e-17)

LARGEST_ANGLE = 2.0**50
"""Beyond this, sin and cos are nan."""
LARGEST_EXPONENT = 746.0
"""Beyond this, exp overflows or underflows."""
SERIES_TERMS = 26
"""(log 2 / 2)^26/26! and (π/4)^33/33! are below 2⁻¹¹⁰; sin and cos use every second of twice as many terms."""
INVERSE_FACTORIALS = np.array([split(Fraction(1, math.factorial(n))) for n in range(2 * SERIES_TERMS)])


@strict
def _reduced(x: DoubleDouble, times: float, unit: tuple[float, float, float, float]) -> DoubleDouble:
    """x − times·unit in three doubles, precise even under cancellation of nearly all digits."""
    high, middle, low = x[0], x[1], 0.0
    for part in unit:
        for summand in two_product(-times, part):
            high, rest = two_sum(high, summand)
            middle, rest = two_sum(middle, rest)
            low += rest
    high, middle = two_sum(high, middle)
    middle, low = two_sum(middle, low)
    high, middle = quick_two_sum(high, middle)
    return quick_two_sum(high, middle + low)


@strict
def _series(x: DoubleDouble, first: int, step: int) -> DoubleDouble:
    """Σ_{n ≥ 0} x^n/(first + step·n)!."""
    total = (0.0, 0.0)
    for n in range(first + step * (SERIES_TERMS - first - 1), first - 1, -step):
        total = add(multiply(total, x), (INVERSE_FACTORIALS[n, 0], INVERSE_FACTORIALS[n, 1]))
    return total


@strict
def expm1(x: DoubleDouble) -> DoubleDouble:
    """e^x − 1."""
    if abs(x[0]) < 0.35:
        return add(x, multiply(multiply(x, x), _series(x, 2, 1)))
    return subtract(exp(x), (1.0, 0.0))


@strict
def exp(x: DoubleDouble) -> DoubleDouble:
    """e^x."""
    if not abs(x[0]) < LARGEST_EXPONENT:
        return math.exp(x[0]), 0.0
    times = math.floor(x[0] / LOG_2[0] + 0.5)
    rest = _reduced(x, times, LOG_2)
    power = add((1.0, 0.0), add(rest, multiply(multiply(rest, rest), _series(rest, 2, 1))))
    high = math.ldexp(power[0], int(times))
    return high, 0.0 if math.isinf(high) else math.ldexp(power[1], int(times))


@strict
def log(x: DoubleDouble) -> DoubleDouble:
    """The natural logarithm."""
    if 0.5 < x[0] < 2 or not 0 < x[0] < math.inf:
        return _log(x, subtract(x, (1.0, 0.0)), math.log(x[0]))
    _, exponent = math.frexp(x[0])
    mantissa = (math.ldexp(x[0], -exponent), math.ldexp(x[1], -exponent))
    rest = _log(mantissa, subtract(mantissa, (1.0, 0.0)), math.log(mantissa[0]))
    return add(scale((LOG_2[0], LOG_2[1]), float(exponent)), rest)


@strict
def log1p(x: DoubleDouble) -> DoubleDouble:
    """log(1 + x)."""
    above = add((1.0, 0.0), x)
    return _log(above, x, math.log1p(x[0])) if abs(x[0]) < 0.5 else log(above)


@strict
def _log(x: DoubleDouble, less_one: DoubleDouble, guess: float) -> DoubleDouble:
    """log x = guess + log(1 + z) with z = x e^(−guess) − 1; x − 1 is passed as it may have more digits than x."""
    if math.isinf(guess) or math.isnan(guess):
        return guess, 0.0
    z = add(less_one, multiply(x, expm1((-guess, 0.0))))
    cubic = z[0] * z[0] * (z[0] / 3 - 0.5)
    return add((guess, 0.0), add(z, (cubic, 0.0)))


@strict
def sin_cos(x: DoubleDouble) -> tuple[DoubleDouble, DoubleDouble]:
    """The sine and the cosine."""
    if not abs(x[0]) < LARGEST_ANGLE:
        return (math.nan, math.nan), (math.nan, math.nan)
    times = math.floor(x[0] / HALF_PI[0] + 0.5)
    rest = _reduced(x, times, HALF_PI)
    square = negative(multiply(rest, rest))
    sine = add(rest, multiply(multiply(rest, square), _series(square, 3, 2)))
    cosine = add((1.0, 0.0), multiply(square, _series(square, 2, 2)))
    quadrant = int(times) % 4
    if quadrant % 2:
        sine, cosine = cosine, negative(sine)
    if quadrant >= 2:
        sine, cosine = negative(sine), negative(cosine)
    return sine, cosine


@strict
def sin(x: DoubleDouble) -> DoubleDouble:
    """The sine."""
    return sin_cos(x)[0]


@strict
def cos(x: DoubleDouble) -> DoubleDouble:
    """The cosine."""
    return sin_cos(x)[1]


@strict
def tan(x: DoubleDouble) -> DoubleDouble:
    """The tangent."""
    sine, cosine = sin_cos(x)
    return divide(sine, cosine)


@strict
def atan(x: DoubleDouble) -> DoubleDouble:
    """The inverse tangent: guess + atan z with z = (x cos − sin)/(cos + x sin) of the guess."""
    guess = math.atan(x[0])
    if math.isinf(x[0]):
        return math.copysign(HALF_PI[0], guess), math.copysign(HALF_PI[1], guess)
    sine, cosine = sin_cos((guess, 0.0))
    z = divide(subtract(multiply(x, cosine), sine), add(cosine, multiply(x, sine)))
    return add((guess, 0.0), add(z, (-z[0] * z[0] * z[0] / 3, 0.0)))


@strict
def asin(x: DoubleDouble) -> DoubleDouble:
    """The inverse sine: atan(x/√(1 − x²))."""
    one = (1.0, 0.0)
    return atan(divide(x, square_root(multiply(subtract(one, x), add(one, x)))))


@strict
def acos(x: DoubleDouble) -> DoubleDouble:
    """The inverse cosine: 2 atan √((1 − x)/(1 + x))."""
    one = (1.0, 0.0)
    return scale(atan(square_root(divide(subtract(one, x), add(one, x)))), 2.0)


@strict
def sinh(x: DoubleDouble) -> DoubleDouble:
    """The hyperbolic sine: (u + u/(1 + u))/2 with u = e^x − 1 for x ≥ 0, an odd function."""
    size = x if x[0] >= 0 else negative(x)
    if size[0] > LARGEST_EXPONENT / 2:  # e^−x is negligible; e^x may overflow where e^x/2 does not
        half = exp(scale(size, 0.5))
        value = multiply(scale(half, 0.5), half)
    else:
        u = expm1(size)
        value = scale(add(u, divide(u, add((1.0, 0.0), u))), 0.5)
    return value if x[0] >= 0 else negative(value)


@strict
def cosh(x: DoubleDouble) -> DoubleDouble:
    """The hyperbolic cosine: √(1 + sinh² x), free of cancellation, or sinh |x| where they agree."""
    value = sinh(x)
    if abs(value[0]) > 1e20:
        return value if x[0] >= 0 else negative(value)
    return square_root(add((1.0, 0.0), multiply(value, value)))


@strict
def tanh(x: DoubleDouble) -> DoubleDouble:
    """The hyperbolic tangent: u/(u + 2) with u = e^2x − 1; 1 − tanh x < 2⁻¹¹⁰ for x > 40."""
    if abs(x[0]) > 40:
        return math.copysign(1.0, x[0]), 0.0
    u = expm1(scale(x, 2.0))
    return divide(u, add(u, (2.0, 0.0)))


@strict
def asinh(x: DoubleDouble) -> DoubleDouble:
    """The inverse hyperbolic sine: log(1 + x + x²/(1 + √(1 + x²))) for x ≥ 0, an odd function."""
    size = x if x[0] >= 0 else negative(x)
    if size[0] > 1e20:  # x + √(1 + x²) is 2x
        value = add(log(size), (LOG_2[0], LOG_2[1]))
    else:
        square = multiply(size, size)
        root = square_root(add((1.0, 0.0), square))
        value = log1p(add(size, divide(square, add((1.0, 0.0), root))))
    return value if x[0] >= 0 else negative(value)


@strict
def acosh(x: DoubleDouble) -> DoubleDouble:
    """The inverse hyperbolic cosine: log(1 + v + √(v(v + 2))) with v = x − 1."""
    if x[0] > 1e20:
        return add(log(x), (LOG_2[0], LOG_2[1]))
    v = subtract(x, (1.0, 0.0))
    return log1p(add(v, square_root(multiply(v, add(v, (2.0, 0.0))))))


@strict
def atanh(x: DoubleDouble) -> DoubleDouble:
    """The inverse hyperbolic tangent: log((1 + x)/(1 − x))/2 for x ≥ 0, an odd function."""
    size = x if x[0] >= 0 else negative(x)
    value = scale(log1p(divide(scale(size, 2.0), subtract((1.0, 0.0), size))), 0.5)
    return value if x[0] >= 0 else negative(value)


@strict
def erf(x: DoubleDouble) -> DoubleDouble:
    """The error function: 2/√π x e^(−x²) Σ (2x²)^n/(1·3·5 ⋯ (2n + 1)) below 1, 1 − erfc x above, an odd function."""
    size = x if x[0] >= 0 else negative(x)
    if size[0] > 9:  # erfc x < 2⁻¹¹⁰
        return math.copysign(1.0, x[0]), 0.0
    square = multiply(size, size)
    factor = scale(multiply((TWO_BY_ROOT_PI[0], TWO_BY_ROOT_PI[1]), exp(negative(square))), 0.5)
    if size[0] < 1:
        term = scale(multiply(factor, size), 2.0)
        value, n = term, 1.0
        while abs(term[0]) > 2.0**-112 * abs(value[0]):
            n += 2
            term = divide(multiply(term, scale(square, 2.0)), (n, 0.0))
            value = add(value, term)
    else:  # the continued fraction x + (1/2)/(x + 1/(x + (3/2)/(x + …))), whose error is near e^(−2x √(2n))
        fraction = size
        for n in range(20 + int(1000 / square[0]), 0, -1):
            fraction = add(size, divide((0.5 * n, 0.0), fraction))
        value = subtract((1.0, 0.0), divide(factor, fraction))
    return value if x[0] >= 0 else negative(value)
