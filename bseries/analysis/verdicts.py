"""Verdicts on properties up to some order, for exact series and for methods published as decimals.

Exact series are decided exactly. The coefficients of a method published as decimals are known within their
`uncertainty` only: residuals are recomputed with all coefficients perturbed at random within it, and a residual that
changes by about its own size counts as zero.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from bseries.algebra.bseries import BSeries, check_flow
from bseries.algebra.modified import series, series_to
from bseries.algebra.stages import auxiliary_colors, check_method
from bseries.analysis.order import affordable_order, order_of, trusted
from bseries.exact.domains import RingValues, make_values
from bseries.exceptions import SeriesError
from integrators.core.canonical_names import canonical_names

if TYPE_CHECKING:
    from bseries.analysis.structure_conditions import StructureConditions
    from integrators.methods.program.program import Method
    from trees.table import TreeTable
    from trees.tree import Tree

    Coloring = Literal["blocks", "parts"] | None

MOST_STRUCTURE_TREES = 1300
"""Structure is tested on tables up to this size."""

LEAST_NODES = 7
"""Structure is tested to at least this number of nodes, if the table allows it."""


class Verdict(NamedTuple):
    """The order up to which a property holds.

    Attributes:
        order: The largest k ≤ `tested_to` such that no tree with up to k nodes violates the property.
        breaks: The first tree that violates it, or None.
        tested_to: The largest number of nodes tested.

    Example:
        >>> import bseries as bs
        >>> verdict = bs.symplecticity(bs.method("rk4"), 6)
        >>> verdict.order, str(verdict.breaks), verdict.tested_to, verdict.holds
        (4, '[τ,[[τ]]]', 6, False)
    """

    order: int
    breaks: Tree | None
    tested_to: int

    @property
    def holds(self) -> bool:
        """Whether no tree violates the property."""
        return self.breaks is None


def verdict(table: TreeTable, violating: int | None) -> Verdict:
    """The verdict for a property whose first violating tree has this id."""
    if violating is None:
        return Verdict(table.max_order, None, table.max_order)
    return Verdict(int(table.columns.order[violating]) - 1, table[violating], table.max_order)


def decide(conditions: StructureConditions, samples: Sequence[BSeries], *, flow: bool = False) -> Verdict:
    """Decide conditions on a series, the first of its `samples`."""
    values = [_numbers(samples[0], flow)] if len(samples) == 1 else [s.stored.coefficients() for s in samples]
    residuals, *nearby = (conditions.residuals(x, flow=flow) for x in values)
    violating = min((conditions.breaks[k] for k in failing(residuals, nearby)), default=None)
    return verdict(samples[0].table, violating)


def failing(residuals: Sequence[Any], nearby: Sequence[Sequence[Any]]) -> Iterator[int]:
    """Indices of nonzero residuals; `nearby` are the residuals of the other samples of a series in decimals."""
    for k, residual in enumerate(residuals):
        if residual and (not nearby or abs(residual) > 3 * max(abs(other[k] - residual) for other in nearby)):
            yield k


def _numbers(s: BSeries, flow: bool) -> Any:
    """Coefficients times a factor for each number of nodes n; for a flow L^n, so that products have the same factor."""
    values: Any = s.stored
    if isinstance(values, RingValues):
        return list(values.elements)
    factors = [values.step**n // d if flow else 1 for n, d in enumerate(values.denominators)]
    if max(factors) == 1:
        return values.numerators
    order = s.table.lists[0]
    return [int(x) * factors[n] for n, x in zip(order, values.numerators, strict=True)]


def block_names(names: Sequence[str]) -> tuple[str, str] | None:
    """The names of momenta and of positions, if two colours are blocks of them by their names."""
    return canonical_names(names) if len(names) == 2 else None


def has_blocks(s: BSeries, colors_are: Coloring) -> bool:
    """Whether the colours of a series are blocks of variables; by default if their names say so."""
    if colors_are not in (None, "blocks", "parts"):
        raise SeriesError(f"colors_are must be 'blocks' or 'parts', but was {colors_are!r:.60}")
    if colors_are == "blocks" and s.table.colors != 2:
        raise SeriesError(f"colors_are must be 'parts' unless there are two colours, but there are {s.table.colors}")
    return block_names(s.names) is not None if colors_are is None else colors_are == "blocks"


def flows_of(method: Method | BSeries, order: int | None) -> list[BSeries]:
    """The flow of a method with its samples (see `samples_of`)."""
    if isinstance(method, BSeries):
        check_flow(method, "method")
    return samples_of(method, order)


def fields_of(method: Method | BSeries, order: int | None) -> list[BSeries]:
    """The modified equation of a method, or a field itself, with its samples (see `samples_of`)."""
    samples = samples_of(method, order)
    if samples[0].empty == 0:
        return samples
    check_flow(samples[0], "method")
    return [s.log() for s in samples]


def samples_of(method: Method | BSeries, order: int | None) -> list[BSeries]:
    """A series, or that of a method, up to some order; for decimals followed by perturbations within their digits.

    Raises:
        SeriesError: The series is in floats, or in decimals of unknown uncertainty, or `order` is too large.
    """
    s = series_of(method, order)
    if not isinstance(method, BSeries) and auxiliary_colors(method):
        parts = ", ".join(method.names[color] for color in auxiliary_colors(method))
        raise SeriesError(f"method must be made of the field alone to have a structure, but has the extra part {parts}")
    if not s.is_exact:
        raise SeriesError("method must be a method or an exact series, but was a series in floats")
    if s.digits is not None and s.uncertainty is None:
        raise SeriesError("method must be a method or an exact series, but was made of a series in decimals")
    return [s, *_nearby(s)]


def series_of(method: Method | BSeries, order: int | None) -> BSeries:
    """A series, or that of a method, up to some order, with floats taken as decimals."""
    if isinstance(method, BSeries):
        return series_to(method, order)
    check_method(method)
    return series(trusted(method), structure_order(method, order_of(method)) if order is None else order)


def structure_order(method: Method, accuracy: int) -> int:
    """Default number of nodes for structure tests: beyond the order of accuracy, within the limits of cost."""
    most = affordable_order(len(method.names), MOST_STRUCTURE_TREES)
    if method.digits is not None or method.parameters:
        return max(4, min(accuracy + 1, most))
    return min(max(accuracy + 2, LEAST_NODES), most)


def _nearby(s: BSeries) -> Iterator[BSeries]:
    """Four random perturbations of a series in decimals."""
    if s.uncertainty is None:
        return
    source, scale = random.Random(s.digits), 10 ** ((s.digits or 0) + 6)
    ranges = [s.uncertainty(at) * scale for at in range(len(s))]
    for _ in range(4):
        changes = (Fraction(round(source.uniform(-r, r)), scale) for r in ranges)
        changed = make_values(s.table, map(sum, zip(s.stored.coefficients(), changes, strict=True)))
        yield BSeries(s.table, changed, s.empty, names=s.names)
