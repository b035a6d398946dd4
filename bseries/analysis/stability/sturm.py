"""Signs of real polynomials, decided exactly over ordered fields: Sturm chains and Routh's scheme.

A polynomial is a tuple of ascending coefficients without trailing zeros: `Fraction`s or elements of a real number
field (`RealAlgebraic`). Sums, products and divisions work over any field whose elements are false when zero.

References:
    Basu, Pollack, Roy, *Algorithms in Real Algebraic Geometry*, chapters 2 and 9, doi:10.1007/3-540-33099-2.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import pairwise, zip_longest
from math import gcd
from typing import Any

from bseries.analysis.stability.field_elements import nearest_float
from integrators.exact.polynomials import primitive

Coefficients = tuple[Any, ...]

MOST_DENOMINATOR = 10**6
"""Rational roots with denominators up to this are recognised, and then verified."""


def strip(p: Iterable[Any]) -> Coefficients:
    """The polynomial without trailing zeros."""
    values = list(p)
    while values and not values[-1]:
        values.pop()
    return tuple(values)


def combine(p: Sequence[Any], q: Sequence[Any], factor: int) -> list[Any]:
    """Coefficients of p + factor · q."""
    return [a + factor * b for a, b in zip_longest(p, q, fillvalue=Fraction(0))]


def reflect(p: Sequence[Any]) -> Coefficients:
    """The polynomial p(−x)."""
    return tuple(-a if k % 2 else a for k, a in enumerate(p))


def multiply(p: Sequence[Any], q: Sequence[Any]) -> Coefficients:
    """The product p · q."""
    product: list[Any] = [Fraction(0)] * max(0, len(p) + len(q) - 1)
    for i, a in enumerate(p):
        if a:
            for j, b in enumerate(q):
                product[i + j] = product[i + j] + a * b
    return strip(product)


def evaluate(p: Sequence[Any], x: Any) -> Any:
    """The value p(x), by Horner's scheme."""
    value: Any = p[-1] if p else Fraction(0)
    for a in p[-2::-1]:
        value = value * x + a
    return value


def derivative(p: Sequence[Any]) -> Coefficients:
    """The derivative p'."""
    return strip([k * a for k, a in enumerate(p)][1:])


def divide(p: Sequence[Any], q: Sequence[Any]) -> tuple[Coefficients, Coefficients]:
    """Quotient and remainder of p by q."""
    rest = list(p)
    quotient: list[Any] = [Fraction(0)] * max(0, len(p) - len(q) + 1)
    for k in range(len(quotient) - 1, -1, -1):
        factor = quotient[k] = rest[k + len(q) - 1] / q[-1]
        if factor:
            for j, b in enumerate(q):
                rest[k + j] = rest[k + j] - factor * b
    return strip(quotient), strip(rest[: len(q) - 1])


def monic_gcd(p: Sequence[Any], q: Sequence[Any]) -> Coefficients:
    """The monic greatest common divisor of two polynomials, not both zero."""
    last, rest = tuple(p), tuple(q)
    while rest:
        rest = tuple(a / rest[-1] for a in rest)
        last, rest = rest, divide(last, rest)[1]
    return tuple(a / last[-1] for a in last)


def squarefree_factors(p: Sequence[Any]) -> list[Coefficients]:
    """Square-free factors by multiplicity (Yun's algorithm): the k-th has the roots of p of multiplicity k."""
    other = derivative(p)
    common = monic_gcd(p, other)
    rest, other = divide(p, common)[0], divide(other, common)[0]
    factors = []
    while len(rest) > 1:
        other = strip(combine(other, derivative(rest), -1))
        factor = monic_gcd(rest, other)
        factors.append(factor)
        rest, other = divide(rest, factor)[0], divide(other, factor)[0]
    return factors


def first_crossing(p: Sequence[Any]) -> Fraction | float | None:
    """First x ≥ 0 beyond which p becomes negative.

    Returns:
        0 if p is negative immediately right of 0, None if p(x) ≥ 0 for all x > 0, else the smallest positive root of
        odd multiplicity: a `Fraction` if it is recognised as rational (and verified), else the nearest float.

    Example:
        >>> first_crossing((Fraction(4), Fraction(0), Fraction(-1)))
        Fraction(2, 1)
        >>> first_crossing((Fraction(2), Fraction(0), Fraction(-1)))
        1.4142135623730951
    """
    start = next((k for k, a in enumerate(p) if a), len(p))
    p = strip(p[start:])
    if not any(a < 0 for a in p):
        return None
    if p[0] < 0:
        return Fraction(0)
    chain = sturm_chain(p)
    if len(chain[-1]) > 1:
        chain = sturm_chain(_odd_part(p))
    bound = _bound(chain[0])
    return _refine(chain[0], *_isolate(chain, bound)) if count_roots(chain, Fraction(0), bound) else None


def _odd_part(p: Coefficients) -> Coefficients:
    """Square-free polynomial with the roots of odd multiplicity, and the sign of p at 0."""
    odd: Coefficients = (Fraction(1),)
    for factor in squarefree_factors(p)[::2]:
        odd = multiply(odd, factor)
    return odd if (odd[0] > 0) == (p[0] > 0) else tuple(-a for a in odd)


def is_nonnegative(p: Sequence[Any]) -> bool:
    """Whether p(x) ≥ 0 for all x > 0."""
    return not p or (p[-1] > 0 and first_crossing(p) is None)


def sturm_chain(p: Coefficients) -> list[Coefficients]:
    """Sturm chain p, p', −(p mod p'), …, up to positive factors; rational polynomials become primitive integer ones."""
    chain = [_cleared(p), _cleared(derivative(p))]
    while len(chain[-1]) > 1:
        rest, divisor = chain[-2], chain[-1]
        sign = 1 if divisor[-1] > 0 else -1
        while len(rest) >= len(divisor):
            factor = sign * rest[-1]
            shifted = (*(0,) * (len(rest) - len(divisor)), *divisor)
            rest = strip(sign * divisor[-1] * a - factor * b for a, b in zip(rest, shifted, strict=True))
        if not rest:
            break
        chain.append(_cleared(tuple(-a for a in rest)))
    return chain


def count_roots(chain: Sequence[Coefficients], low: Fraction, high: Fraction) -> int:
    """Number of roots of the chain's polynomial in low < x ≤ high."""
    return _variations(chain, low) - _variations(chain, high)


def _variations(chain: Sequence[Coefficients], x: Fraction) -> int:
    """Number of sign changes of the chain at x."""
    signs = [sign for p in chain if (sign := sign_at(p, x))]
    return sum(a != b for a, b in pairwise(signs))


def sign_at(p: Sequence[Any], x: Fraction) -> int:
    """Sign of p(x) without division: that of the homogenised polynomial at the numerator and denominator of x."""
    value: Any = 0
    power = 1
    for a in reversed(p):
        value = value * x.numerator + a * power
        power *= x.denominator
    return (value > 0) - (value < 0)


def _cleared(p: Coefficients) -> Coefficients:
    """A positive multiple of p: primitive with integer coefficients if p is rational, else monic up to sign."""
    if not all(isinstance(a, Fraction | int) for a in p):
        return tuple(a / (p[-1] if p[-1] > 0 else -p[-1]) for a in p)
    whole = primitive(p)
    divisor = gcd(*whole)
    return tuple(a // divisor for a in whole)


def _bound(p: Coefficients) -> Fraction:
    """A power of two above all roots (Cauchy's bound)."""
    bound = Fraction(2)
    lead = -p[-1] if p[-1] < 0 else p[-1]
    for a in p[:-1]:
        while (bound - 1) * lead < a or -a > (bound - 1) * lead:
            bound *= 2
    return bound


def _isolate(chain: Sequence[Coefficients], high: Fraction) -> tuple[Fraction, Fraction]:
    """Interval low < x ≤ high that isolates the smallest positive root."""
    low = Fraction(0)
    while count_roots(chain, low, high) > 1:
        middle = (low + high) / 2
        if count_roots(chain, low, middle):
            high = middle
        else:
            low = middle
    return low, high


def _refine(p: Coefficients, low: Fraction, high: Fraction) -> Fraction | float:
    """The isolated root in low < x ≤ high of a polynomial that is positive left of it, by bisection."""
    while (high - low) * 2**60 > high:
        middle = (low + high) / 2
        if sign_at(p, middle) > 0:
            low = middle
        else:
            high = middle
    nearest = high.limit_denominator(MOST_DENOMINATOR)
    return nearest_float(high) if sign_at(p, nearest) else nearest


def is_hurwitz(p: Sequence[Any]) -> bool:
    """Whether all roots have negative real parts: no sign change and no zero in the first column of Routh's scheme.

    Example:
        >>> is_hurwitz((Fraction(2), Fraction(2), Fraction(1))), is_hurwitz((Fraction(1), Fraction(0), Fraction(1)))
        (True, False)
    """
    first, second = list(p[::-1][::2]), list(p[::-1][1::2])
    for _ in range(len(p) - 1):
        if not second or not second[0] or (second[0] > 0) != (first[0] > 0):
            return False
        factor = first[0] / second[0]
        padded = [*second, *[Fraction(0)] * (len(first) - len(second))]
        first, second = second, [a - factor * b for a, b in zip(first[1:], padded[1:], strict=True)]
    return True
