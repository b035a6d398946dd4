"""Composition and Lie derivatives of series (HLW, lemma IX.9.1).

exp b = Σ ∂_b^j id / j!, and log is solved from it order by order. compose(a, c) = Σ ∂_{log a}^j c / j!, since the flow
of log a is a; inverse and powers follow. The cost is n² per tree with n nodes; sums over subtrees are exponential.
"""

from __future__ import annotations

from typing import Any

from bseries.algebra.bseries import BSeries, check_field, check_flow, result_of
from bseries.exact import recursions
from bseries.exact.operations import Operation
from bseries.exact.rationals import RationalValues
from bseries.exceptions import SeriesError


def compose(a: BSeries, c: BSeries) -> BSeries:
    """Composition of two maps: first a, then c.

    B(compose(a, c), y) = B(c, B(a, y)), the product a · c of HLW and Butcher.

    Args:
        a: A flow, applied first.
        c: A flow, or any series (a field c gives c evaluated at the image of a).

    Returns:
        The composition, on the same trees.

    Raises:
        SeriesError: a(∅) is not 1, or the trees differ.

    Example:
        Half a step of the implicit and half a step of the explicit Euler method give the midpoint rule:

        >>> import bseries as bs
        >>> from fractions import Fraction
        >>> half = Fraction(1, 2)
        >>> implicit = bs.series(bs.method("implicit-euler"), 5).scale_step(half)
        >>> explicit = bs.series(bs.method("explicit-euler"), 5).scale_step(half)
        >>> compose(implicit, explicit) == bs.series(bs.method("implicit-midpoint"), 5)
        True

    References:
        HLW, theorem III.1.10 (there by ordered subtrees).
    """
    check_flow(a, "a")
    if not isinstance(c, BSeries):
        raise SeriesError(f"c must be a BSeries, but was {c!r:.60}")
    if c.empty not in (0, 1):  # by linearity: c = c(∅) ∅ + (c without ∅)
        return a * c.empty + compose(a, c.with_empty(0))

    def expression(arithmetic: Any, first: Any, second: Any) -> Any:
        field = recursions.logarithm(first(field=True), a.table, arithmetic)
        return recursions.lie_series(field, second(field=False), c.empty, a.table, arithmetic)

    bounds = None
    if isinstance(a.stored, RationalValues) and isinstance(c.stored, RationalValues):
        # At most 2^n ordered subtrees, each with a product of at most 2^(κ n).
        growth = max(a.stored.growth, c.stored.growth)
        bounds = [(growth + 1) * n for n in range(1, a.order + 1)]
    operation = Operation(expression, lambda n, step: step**n, lambda _, step: step, field=False, bounds=bounds)
    return result_of(operation, c.empty, a, c)


def lie_derivative(b: BSeries, c: BSeries) -> BSeries:
    """Lie derivative ∂_b c of the series c along the field b.

    (∂_b c)(τ) = c(∅) b(τ) + Σ c(trunk) b(branch), summed over the edges of τ, each cut into trunk and branch.

    Args:
        b: A field.
        c: Any series.

    Returns:
        A field (its coefficient of the empty tree is 0).

    Raises:
        SeriesError: b(∅) is not 0, or the trees differ.

    Example:
        >>> import bseries as bs
        >>> f = bs.BSeries.from_rule(lambda tree: int(tree.order == 1), 3, empty=0)
        >>> second = lie_derivative(f, f)
        >>> [str(tree) for tree, value in second.items() if value]
        ['[τ]']

    References:
        HLW, lemma IX.9.1.
    """
    check_field(b, "b")
    if not isinstance(c, BSeries):
        raise SeriesError(f"c must be a BSeries, but was {c!r:.60}")
    if c.empty not in (0, 1):
        return b * c.empty + lie_derivative(b, c.with_empty(0))

    def expression(arithmetic: Any, field: Any, base: Any) -> Any:
        once = arithmetic.factors([0, 1] + [0] * b.order)
        return recursions.derivatives(field(field=True), base(field=False), c.empty, once, b.table, arithmetic)

    operation = Operation(expression, lambda n, step: step**n, lambda _, step: step, field=True)
    return result_of(operation, 0, b, c)
