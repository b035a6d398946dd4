"""Elementary functions of double-double numbers, to nearly all of their digits.

Exponentials and trigonometric functions are Taylor series after a reduction of the argument; their inverses take the
double that `math` gives and one step of Newton's method of third order. Near their zeros all functions keep relative
precision. Outside their domain they give nan.

References:
    J.-M. Muller, Elementary Functions, third edition, Birkhäuser 2016, doi:10.1007/978-1-4899-7983-4 (chapter 11:
    reduction of the argument).
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from integrators.reference.double_double import (
    DoubleDouble,
    add,
    divide,
    multiply,
    negative,
    quick_two_sum,
    scale,
    split,
    square_root,
    strict,
    subtract,
    two_product,
    two_sum,
)

# π/2 and log 2 as sums of four doubles.
HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33, 5.562271104316826e-50)
LOG_2 = (0.6931471805599453, 2.3190468138462996e-17, 5.707708438416212e-34, -3.5824322106018114e-50)

LARGEST_ANGLE = 2.0**50
"""Beyond, sin and cos give nan."""
LARGEST_EXPONENT = 746.0
"""Beyond, exp is infinite or zero in doubles."""
SERIES_TERMS = 26
"""(log 2 / 2)^26/26! and (π/4)^33/33! are below 2⁻¹¹⁰; those of sin and cos are every second of twice as many."""
INVERSE_FACTORIALS = np.array([split(Fraction(1, math.factorial(n))) for n in range(2 * SERIES_TERMS)])


@strict
def _reduced(x: DoubleDouble, times: float, unit: tuple[float, float, float, float]) -> DoubleDouble:
    """x − times·unit, precise even where nearly all digits cancel: summed up in three doubles."""
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
    """log x = guess + log(1 + z), where z = x e^(−guess) − 1 is tiny; x − 1 is given as it may say more than x."""
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
    if size[0] > LARGEST_EXPONENT / 2:  # e^−x is nothing beside e^x, which may overflow where its half does not
        half = exp(scale(size, 0.5))
        value = multiply(scale(half, 0.5), half)
    else:
        u = expm1(size)
        value = scale(add(u, divide(u, add((1.0, 0.0), u))), 0.5)
    return value if x[0] >= 0 else negative(value)


@strict
def cosh(x: DoubleDouble) -> DoubleDouble:
    """The hyperbolic cosine: √(1 + sinh² x), which loses nothing, or sinh |x| where they are equal."""
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
