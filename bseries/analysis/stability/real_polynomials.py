"""Decisions on real polynomials over exact fields: common factors, isolated roots, signs.

Polynomials are those of `integrators.exact.polynomials`, over one field (see `field_elements`). Roots and signs need
`Fraction`s or elements of a real number field; flint isolates the roots.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import reduce
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from bseries.analysis.stability.field_elements import enclose, from_flint, nearest_float, sign, to_flint
from integrators.exact.polynomials import ONE, add, derivative, divide, evaluate, multiply, scale, trim

if TYPE_CHECKING:
    from flint import acb

Coefficients = tuple[Any, ...]

MOST_DENOMINATOR = 10**6
"""Rational roots with denominators up to this are recognised, and then verified."""
BITS = 128
"""Accuracy of roots."""


def subtract(p: Sequence[Any], q: Sequence[Any]) -> Coefficients:
    """The difference p − q."""
    return add(tuple(p), scale(tuple(q), -1))


def reflect(p: Sequence[Any]) -> Coefficients:
    """The polynomial p(−x)."""
    return tuple(-a if k % 2 else a for k, a in enumerate(p))


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
    rest, other = tuple(p), derivative(tuple(p))
    factors = []
    while len(rest) > 1:
        factors.append(monic_gcd(rest, other))  # the first has the multiple roots
        rest, other = divide(rest, factors[-1])[0], divide(other, factors[-1])[0]
        other = subtract(other, derivative(rest))
    return factors[1:]


def roots(p: Sequence[Any], bits: int = BITS) -> list[acb]:
    """Disjoint enclosures of the roots of a square-free polynomial with p(0) ≠ 0, accurate to this number of bits.

    Those of real roots, and no others, have the imaginary part 0.
    """
    from flint import acb, acb_poly, arb, ctx

    if is_rational(p):
        with ctx.workprec(bits):
            return [root for root, _ in _rational(p).complex_roots()]
    precision = bits
    while True:
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


def first_crossing(p: Sequence[Any]) -> Fraction | float:
    """First x ≥ 0 beyond which p becomes negative."""
    p = trim(p[next((k for k, a in enumerate(p) if a), len(p)) :])
    signs = [sign(a) for a in p]
    if -1 not in signs:
        return math.inf
    if signs[0] < 0:
        return Fraction(0)
    odd: Coefficients = reduce(multiply, squarefree_factors(p)[::2], ONE)
    positive = [root.real for root in roots(odd) if root.imag == 0 and root.real > 0]
    if not positive:
        return math.inf
    least = min(positive, key=lambda root: root.mid())
    nearest = from_flint(least.mid().fmpq())
    guess = nearest.limit_denominator(MOST_DENOMINATOR)
    is_root = abs(guess - nearest) <= from_flint(least.rad().fmpq()) and not evaluate(odd, guess)
    return guess if is_root else nearest_float(nearest)


def is_hurwitz(p: Coefficients) -> bool:
    """Whether all roots have negative real parts, by Routh's array: its first column has one sign."""
    above, below = p[::-2], p[-2::-2]
    while below:
        if sign(above[0]) * sign(below[0]) <= 0:
            return False
        ratio = above[0] / below[0]
        rows = zip_longest(above[1:], below[1:], fillvalue=Fraction(0))
        above, below = below, tuple(a - ratio * b for a, b in rows)
    return True
