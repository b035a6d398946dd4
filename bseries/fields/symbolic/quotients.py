"""Elements of a ring with roots w = g^(−1/n) over common denominators.

Powers of w that differ by multiples of n have a common denominator, so an element is a sum of a few quotients, each a
polynomial without roots times a product of powers of roots.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from bseries.fields.symbolic.sparse_polynomials import Rule, exponent, generator, generators_of, narrowed

if TYPE_CHECKING:
    from bseries.fields.symbolic.ring_generators import GeneratedRing
    from bseries.fields.symbolic.sparse_polynomials import Number, Terms


class Quotient(NamedTuple):
    """A polynomial without roots, times powers of roots {number of the generator: exponent}."""

    numerator: Terms
    roots: dict[int, int]


def fractions(ring: GeneratedRing, terms: Terms, *, grow: bool = True) -> list[Quotient]:
    """An element as a sum of quotients, none of which have a common denominator; it is zero if all numerators are.

    Args:
        ring: The ring it is of.
        terms: The element.
        grow: Whether to bring terms over a common denominator even if that makes more of them, or if it is e^b.
    """
    parts = [Quotient(terms, {})]
    for k in sorted(ring.roots, reverse=True):  # a root's base holds earlier generators only
        if grow or ring.exponentials.isdisjoint(ring.roots[k].base):
            parts = [finer for part in parts for finer in _over_common_denominators(ring, part, k, grow)]
    return parts


def _over_common_denominators(ring: GeneratedRing, part: Quotient, k: int, grow: bool) -> list[Quotient]:
    """Bring all powers of the k-th generator, a root, to the highest one of the same residue, and cancel."""
    base, degree = ring.roots[k]
    by_power: dict[int, Terms] = {}
    for monomial, x in part.numerator.items():
        e = exponent(monomial, k)
        by_power.setdefault(e, {})[monomial - generator(k, e)] = x
    found = []
    for residue in {e % degree for e in by_power}:
        group = {e: numerator for e, numerator in by_power.items() if e % degree == residue}
        highest = max(group)
        common = ring.dot((numerator, ring.power(base, (highest - e) // degree)) for e, numerator in group.items())
        if grow or len(common) <= sum(map(len, group.values())):
            group = {highest: common}
        found += [_cancelled(numerator, base, {**part.roots, k: e}, k, degree) for e, numerator in group.items()]
    return found


def _cancelled(numerator: Terms, base: Terms, roots: dict[int, int], k: int, degree: int) -> Quotient:
    """Take the base of the k-th generator off a numerator as often as its power allows."""
    while numerator and roots[k] > 0 and (quotient := divided(numerator, base)) is not None:
        numerator, roots[k] = quotient, roots[k] - degree
    return Quotient(numerator, {root: e for root, e in roots.items() if e})


def divided(terms: Terms, divisor: Terms) -> Terms | None:
    """The quotient of polynomials, if the division leaves nothing."""
    leading = max(divisor)
    rule = Rule.of(leading, divisor)
    rest, quotient = dict(terms), {}
    while rest:
        monomial = max(rest)
        if not rule.divides(monomial):
            return None
        step, factor = monomial - leading, narrowed(Fraction(rest[monomial]) / divisor[leading])
        quotient[step] = factor
        for m, x in divisor.items():
            rest[m + step] = rest.get(m + step, 0) - factor * x
            if not rest[m + step]:
                del rest[m + step]
    return quotient


def primitive(terms: Terms, *, keep_sign: bool = False) -> tuple[Fraction, Terms]:
    """A number and a polynomial with coprime integer coefficients whose product it is.

    The coefficient that leads, the first variables before the others, becomes positive, unless `keep_sign`.
    """
    denominator = math.lcm(*(x.denominator for x in terms.values()))
    content = Fraction(math.gcd(*(int(x * denominator) for x in terms.values())), denominator)
    if not keep_sign and _leading_coefficient(terms) < 0:
        content = -content
    return content, {m: narrowed(x / content) for m, x in terms.items()}


def _leading_coefficient(terms: Terms) -> Number:
    present = generators_of(terms)
    return terms[max(terms, key=lambda m: [exponent(m, k) for k in present])]
