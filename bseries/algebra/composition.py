"""The operations on two series, which are Lie derivatives like those on one (idea: HLW, Lemma IX.9.1).

exp b = Σ ∂_b^j id / j!; log solves that order by order; compose(a, c) = Σ ∂_{log a}^j c / j!, because the flow of log a
is a; inverse and powers follow. The cost is n² per tree with n nodes, where sums over subtrees would be exponential.
"""

from __future__ import annotations

from typing import Any

from bseries.algebra.bseries import BSeries, check_field, check_flow, result_of
from bseries.exact import recursions
from bseries.exact.operations import Operation
from bseries.exact.rationals import RationalValues
from bseries.exceptions import SeriesError


def compose(a: BSeries, c: BSeries) -> BSeries:
    """The series of a map followed by another: first a, then c.

    B(compose(a, c), y) = B(c, B(a, y)), which HLW and Butcher write as the product a · c.

    Args:
        a: A flow, applied first.
        c: A flow, or any series (a field c gives c evaluated at the image of a).

    Returns:
        The composition, on the same trees.

    Raises:
        SeriesError: a(∅) is not 1, or the trees differ.

    Example:
        Half a step of the implicit Euler method and half a step of the explicit one are the midpoint rule:

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
    if c.empty not in (0, 1):  # by linearity in c: c = c(∅) ∅ + the rest
        return a * c.empty + compose(a, c.with_empty(0))

    def expression(arithmetic: Any, first: Any, second: Any) -> Any:
        field = recursions.logarithm(first(field=True), a.table, arithmetic)
        return recursions.lie_series(field, second(field=False), c.empty, a.table, arithmetic)

    bounds = None
    if isinstance(a.stored, RationalValues) and isinstance(c.stored, RationalValues):
        # At most 2^n ordered subtrees, and no product exceeds 2^(κ n).
        growth = max(a.stored.growth, c.stored.growth)
        bounds = [(growth + 1) * n for n in range(1, a.order + 1)]
    operation = Operation(expression, lambda n, step: step**n, lambda _, step: step, field=False, bounds=bounds)
    return result_of(operation, c.empty, a, c)


def lie_derivative(b: BSeries, c: BSeries) -> BSeries:
    """∂_b c: the derivative of the series c along the field b.

    (∂_b c)(τ) = c(∅) b(τ) + Σ c(trunk) b(branch), over all ways to cut one edge of τ.

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
