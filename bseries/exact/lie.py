"""Logarithms, exponentials, powers and compositions of series by Lie derivatives, in any domain.

(∂_b c)(τ) = c(∅) b(τ) + Σ c(trunk) b(branch), summed over the edges of τ, each cut into trunk and branch. Then
exp b = Σ ∂_b^j id / j!, log is solved from it order by order, compose(a, c) = Σ ∂_{log a}^j c / j!, since the flow of
log a is a, and a^s = exp(s log a) (HLW, lemma IX.9.1). The cost is n² for a tree with n nodes; sums over subtrees are
exponential.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from bseries.exact import bounds, recursions
from bseries.exact.bounds import Bound
from bseries.exact.denominators import of_logarithm, power_unit, wider_step
from bseries.exact.domains import RationalValues, Values, alike, apply
from bseries.exact.rationals import Operation


def _bounds(*operands: Values) -> list[Bound]:
    """The bounds of rational values; other domains need none."""
    return [x.bound if isinstance(x, RationalValues) else () for x in operands]


def logarithm(a: Values) -> Values:
    """The field whose exact flow is a."""
    (flow,) = _bounds(a)
    operation = Operation(
        lambda arithmetic, target: recursions.logarithm(target(field=True), a.basis, arithmetic),
        lambda known: bounds.logarithm(a.basis.growth, flow, known),
        of_logarithm,
        wider_step,
        field=True,
    )
    return apply(a.basis, [a], operation)


def exponential(b: Values) -> Values:
    """The exact flow of a field."""
    (field,) = _bounds(b)
    operation = Operation(
        lambda arithmetic, field: recursions.lie_series(field(field=True), None, 1, b.basis, arithmetic),
        lambda known: bounds.exponential(b.basis.growth, field),
        lambda n, step: math.factorial(n) * step**n,
        wider_step,
    )
    return apply(b.basis, [b], operation)


def power(a: Values, s: Fraction) -> Values:
    """a^s = exp(s log a)."""
    factor = power_unit(a.basis.max_order, s)
    (flow,) = _bounds(a)

    def expression(arithmetic: Any, first: Any) -> Any:
        field = recursions.logarithm(first(field=True), a.basis, arithmetic)
        return recursions.lie_series(field, None, 1, a.basis, arithmetic, s)

    def bound(known: Bound) -> Bound:
        first, *others = bounds.logarithm(a.basis.growth, flow)
        scaled = (bounds.scaled(abs(s) * Fraction(x, bounds.ONE)) for x in others)
        return bounds.exponential(a.basis.growth, (first, *scaled))

    operation = Operation(
        expression,
        bound,
        lambda n, step: (factor * step) ** n,
        lambda _, step: factor * step,
        units=s.denominator,
        passes=2,
    )
    return apply(a.basis, [a], operation)


def composition(a: Values, c: Values, empty: int) -> Values:
    """First the flow a, then c with c(∅) = `empty`."""
    a, c = alike([a, c])
    flow, other = _bounds(a, c)

    def expression(arithmetic: Any, first: Any, second: Any) -> Any:
        field = recursions.logarithm(first(field=True), a.basis, arithmetic)
        return recursions.lie_series(field, second(field=False), empty, a.basis, arithmetic)

    operation = Operation(
        expression, lambda known: bounds.composition(a.basis.growth, flow, (empty * bounds.ONE, *other[1:])), passes=2
    )
    return apply(a.basis, [a, c], operation)


def derivative(b: Values, c: Values, empty: int) -> Values:
    """∂_b c for a series c with c(∅) = `empty`."""
    b, c = alike([b, c])
    field, base = _bounds(b, c)

    def expression(arithmetic: Any, field: Any, base: Any) -> Any:
        once = arithmetic.factors([0, 1] + [0] * b.basis.max_order)
        return recursions.lie_series(field(field=True), base(field=False), empty, b.basis, arithmetic, weights=once)

    def bound(known: Bound) -> Bound:
        growth, orders = b.basis.growth, range(1, len(field))
        return (0, *(empty * field[n] + bounds.derivative(growth, field, base, n) for n in orders))

    return apply(b.basis, [b, c], Operation(expression, bound, field=True))
