"""Composition of series, Lie derivatives and brackets, on any basis.

Two methods are composed stage after stage, other series by Lie derivatives (`bseries.exact.lie`).
"""

from __future__ import annotations

from typing import Any, TypeVar, cast

from bseries.algebra.bseries import BSeries
from bseries.algebra.series import Series, check_field, check_flow, check_series, fewest_digits
from bseries.algebra.stages import RationalStages
from bseries.exact import lie

AnySeries = TypeVar("AnySeries", bound=Series)


def compose(a: AnySeries, c: AnySeries) -> AnySeries:
    """Composition of two maps: first a, then c.

    B(compose(a, c), y) = B(c, B(a, y)), the product a · c of HLW and Butcher.

    Args:
        a: A flow, applied first.
        c: A flow, or any series (a field c gives c evaluated at the image of a).

    Raises:
        SeriesError: a(∅) is not 1, or the bases differ.

    Example:
        Half a step of the implicit and half a step of the explicit Euler method give the midpoint rule:

        >>> import bseries as bs
        >>> from fractions import Fraction
        >>> half = Fraction(1, 2)
        >>> implicit = bs.series(bs.method("implicit-euler"), 5).scale_step(half)
        >>> explicit = bs.series(bs.method("explicit-euler"), 5).scale_step(half)
        >>> bs.compose(implicit, explicit) == bs.series(bs.method("implicit-midpoint"), 5)
        True

    References:
        HLW, theorem III.1.10 (there by ordered subtrees).
    """
    check_flow(a, "a")
    check_series(c, "c")
    if c.empty not in (0, 1):  # by linearity: c = c(∅) ∅ + (c without ∅)
        return a * c.empty + compose(a, c.with_empty(0))

    a.check_same_basis(c)
    digits = fewest_digits(a, c)
    if (both := _composed(a, c)) is not None:
        made: Any = type(a)(a.basis, both.series(cast(BSeries, a).table), 1, names=a.names, digits=digits)
        return made.with_source(both)
    values = lie.composition(a.stored, c.stored, int(c.empty))
    return type(a)(a.basis, values, c.empty, names=a.names, digits=digits)


def _composed(a: Series, c: Series) -> RationalStages | None:
    """The stages of two methods one after another, where a product with them costs less than Lie derivatives."""
    if isinstance(a, BSeries) and isinstance(c, BSeries):
        first, then = a.source, c.source
        if isinstance(first, RationalStages) and isinstance(then, RationalStages):
            return first.then(then) if first.stages.size + then.stages.size <= 2 * a.order else None
    return None


def lie_derivative(b: AnySeries, c: AnySeries) -> AnySeries:
    """Lie derivative ∂_b c of the series c along the field b.

    (∂_b c)(τ) = c(∅) b(τ) + Σ c(trunk) b(branch), summed over the edges of τ, each cut into trunk and branch.

    Args:
        b: A field.
        c: Any series.

    Raises:
        SeriesError: b(∅) is not 0, or the bases differ.

    Example:
        >>> import bseries as bs
        >>> f = bs.BSeries.from_rule(lambda tree: int(tree.order == 1), 3, empty=0)
        >>> second = bs.algebra.lie_derivative(f, f)
        >>> [str(tree) for tree, value in second.items() if value]
        ['[τ]']

    References:
        HLW, lemma IX.9.1.
    """
    check_field(b, "b")
    check_series(c, "c")
    if c.empty not in (0, 1):
        return b * c.empty + lie_derivative(b, c.with_empty(0))

    b.check_same_basis(c)
    values = lie.derivative(b.stored, c.stored, int(c.empty))
    return type(b)(b.basis, values, 0, names=b.names, digits=fewest_digits(b, c))


def bracket(b: AnySeries, c: AnySeries) -> AnySeries:
    """Lie bracket of two fields: ∂_b c − ∂_c b.

    With B and C the vector fields of the series, it is the series of [B, C] = C'B − B'C: the derivative of C along B
    minus that of B along C.

    Raises:
        SeriesError: An argument is no field, or the bases differ.

    Example:
        >>> import bseries as bs
        >>> f = bs.exact_flow(3).log()
        >>> tall = bs.BSeries.from_rule(lambda tree: int(str(tree) == "[τ]"), 3, empty=0)
        >>> [(str(tree), str(value)) for tree, value in bs.algebra.bracket(f, tall).nonzero()]
        [('[τ,τ]', '2')]

    References:
        HLW, section III.5.1 and lemma IX.9.1.
    """
    check_field(b, "b")
    check_field(c, "c")
    return lie_derivative(b, c) - lie_derivative(c, b)
