"""Real polynomials over exact fields: arithmetic, isolated roots, and decisions on signs.

A polynomial is a tuple of ascending coefficients without trailing zeros, elements of one field (see `field_elements`).
Sums, products and divisions work over any field whose elements are false when zero. Roots and signs need `Fraction`s or
elements of a real number field; flint isolates the roots.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from bseries.analysis.stability.field_elements import enclose, from_flint, nearest_float, sign, to_flint

if TYPE_CHECKING:
    from flint import acb

Coefficients = tuple[Any, ...]

MOST_DENOMINATOR = 10**6
"""Rational roots with denominators up to this are recognised, and then verified."""
BITS = 128
"""Accuracy of roots."""


def strip(p: Iterable[Any]) -> Coefficients:
    """The polynomial without trailing zeros."""
    values = list(p)
    while values and not values[-1]:
        values.pop()
    return tuple(values)


def combine(p: Sequence[Any], q: Sequence[Any], factor: int) -> Coefficients:
    """The polynomial p + factor · q."""
    return strip(a + factor * b for a, b in zip_longest(p, q, fillvalue=Fraction(0)))


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
    """The monic greatest common divisor of two polynomials, not both zero, by Euclid's algorithm."""
    if is_rational((*p, *q)):
        return tuple(map(from_flint, _rational(p).gcd(_rational(q)).coeffs()))
    last, rest = tuple(p), tuple(q)
    while rest:
        rest = tuple(a / rest[-1] for a in rest)
        last, rest = rest, divide(last, rest)[1]
    return tuple(a / last[-1] for a in last)


def is_rational(p: Iterable[Any]) -> bool:
    """Whether all coefficients are rational."""
    return all(isinstance(a, Fraction) for a in p)


def _rational(p: Iterable[Fraction]) -> Any:
    from flint import fmpq_poly

    return fmpq_poly(list(map(to_flint, p)))


def squarefree_factors(p: Sequence[Any]) -> list[Coefficients]:
    """Square-free factors by multiplicity (Yun's algorithm): the k-th has the roots of p of multiplicity k."""
    other = derivative(p)
    common = monic_gcd(p, other)
    rest, other = divide(p, common)[0], divide(other, common)[0]
    factors = []
    while len(rest) > 1:
        other = combine(other, derivative(rest), -1)
        factor = monic_gcd(rest, other)
        factors.append(factor)
        rest, other = divide(rest, factor)[0], divide(other, factor)[0]
    return factors


def roots(p: Sequence[Any], bits: int = BITS) -> list[acb]:
    """Disjoint enclosures of the roots of a square-free polynomial with p(0) ≠ 0, accurate to this number of bits.

    Those of real roots, and no others, have the imaginary part 0.
    """
    from flint import acb, acb_poly, arb, ctx

    if is_rational(p):
        with ctx.workprec(bits):
            return [root for root, _ in _rational(p).complex_roots()]
    precision = bits
    while len(p) > 1:
        precision *= 2
        with ctx.workprec(precision):
            try:
                found = acb_poly([enclose(a, precision) for a in p]).roots(tol=arb(2) ** (-3 * precision // 4))
            except ValueError:  # the enclosures of the coefficients are too wide
                continue
            # Roots come in conjugate pairs: one is real if no other enclosure meets the conjugate of its own.
            pairs = [[other for other in found if other.overlaps(root.conjugate())] for root in found]
            if all(len(pair) == 1 for pair in pairs) and all(root.rel_accuracy_bits() >= bits for root in found):
                return [acb(a.real) if a is b else a for a, (b,) in zip(found, pairs, strict=True)]
    return []


def first_crossing(p: Sequence[Any]) -> Fraction | float:
    """First x ≥ 0 beyond which p becomes negative.

    Returns:
        0 if p is negative immediately right of 0, ``inf`` if p(x) ≥ 0 for all x > 0, else the smallest positive root of
        odd multiplicity: a `Fraction` if it is recognised as rational (and verified), else the nearest float.
    """
    start = next((k for k, a in enumerate(p) if a), len(p))
    p = strip(p[start:])
    signs = [sign(a) for a in p]
    if -1 not in signs:
        return math.inf
    if signs[0] < 0:
        return Fraction(0)
    odd: Coefficients = (Fraction(1),)
    for factor in squarefree_factors(p)[::2]:
        odd = multiply(odd, factor)
    positive = [root.real for root in roots(odd) if root.imag == 0 and root.real > 0]
    if not positive:
        return math.inf
    least = min(positive, key=lambda root: root.mid())
    nearest = from_flint(least.mid().fmpq())
    guess = nearest.limit_denominator(MOST_DENOMINATOR)
    is_root = abs(guess - nearest) <= from_flint(least.rad().fmpq()) and not evaluate(odd, guess)
    return guess if is_root else nearest_float(nearest)


def is_hurwitz(p: Coefficients) -> bool:
    """Whether all roots have negative real parts."""
    if len(monic_gcd(p, reflect(p))) > 1:  # two roots x and −x
        return False
    simple, bits = divide(p, monic_gcd(p, derivative(p)))[0], BITS
    while True:
        parts = [root.real for root in roots(simple, bits)]
        if not any(part.contains(0) for part in parts):
            return all(part < 0 for part in parts)
        bits *= 2
