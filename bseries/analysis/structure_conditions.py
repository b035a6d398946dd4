"""Verdicts on properties up to some order, and linear conditions on coefficients: rows over the trees of a table.

All conditions are linear in the field b = log a: b preserves a structure to order k if and only if the flow does. For
symplecticity the conditions on the flow itself differ by products a(u) a(v) only, and need no logarithm.

Colours have two meanings (see `trees.free_trees`): parts of a sum of fields, each with the structure in question, and
blocks p and q of the variables of one field that has it. A block by itself has no structure, so coefficients must not
depend on the colour of the root; in separable systems, p' = f(q) and q' = g(p), blocks are parts.

On restricted tables, such as that of Nyström systems, moving the root may give trees outside the table. Their
elementary differentials vanish and their coefficients are arbitrary: conditions are listed on all trees and these
coefficients eliminated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from bseries.algebra.bseries import BSeries
from bseries.analysis.stability.field_elements import to_flint
from bseries.exceptions import SeriesError
from foundation.table import Table, as_html, fact_table
from integrators.core.arguments import canonical_names
from trees.counting import normal_limits
from trees.free_trees import grafting, is_separable
from trees.table import tree_table

if TYPE_CHECKING:
    from trees.table import TreeTable
    from trees.tree import Tree

    Coloring = Literal["blocks", "parts"] | None
    Row = tuple[dict[int, int], int, int]

NO_PRODUCT = -1
SEPARABLE = ((0, None), (None, 0))


class StructureConditions:
    """Conditions Σ factor · b(tree) = 0 on a field, or Σ factor · a(tree) = a(u) a(v) on a flow.

    All trees of one condition have the same number of nodes, that of u and v together.

    Args:
        rows: For each condition its factors by tree, and the ids of u and v, both `NO_PRODUCT` if there are none.
    """

    def __init__(self, rows: Iterable[Row]):
        import numpy as np

        starts, trees, factors, pairs = [0], list[int](), list[int](), list[tuple[int, int]]()
        self.breaks: list[int] = []
        """The first tree of each condition."""
        self._norm = 0
        for row, u, v in rows:
            trees += row.keys()
            factors += row.values()
            starts.append(len(trees))
            pairs.append((u, v))
            self.breaks.append(min(row))
            self._norm = max(self._norm, sum(map(abs, row.values())))
        self._start, self._tree, self._factor = (np.array(x, np.int64) for x in (starts, trees, factors))
        self._pairs = np.array(pairs, np.int64).reshape(-1, 2).T

    def residuals(self, values: Any, *, flow: bool) -> list[Any]:
        """Left minus right side of every condition.

        Args:
            values: A coefficient for each tree: numbers in a list, or an int64 array. Arrays, and numbers of a flow,
                may include a factor L^n for n nodes.
            flow: Whether the coefficients are those of a flow.
        """
        import numpy as np

        if not self.breaks:
            return []
        if isinstance(values, list):
            values = np.fromiter(values, object, len(values))
        else:
            largest = max(int(values.max(initial=0)), -int(values.min(initial=0)))
            values = values.astype(object if largest * self._norm + flow * largest**2 >= 2**63 else np.int64)
        sums = np.add.reduceat(values[self._tree] * self._factor, self._start[:-1])
        if flow:
            has_pair = self._pairs[0] >= 0
            first, second = self._pairs[:, has_pair]
            sums[has_pair] -= values[first] * values[second]
        return sums.tolist()


def cached_conditions(
    build: Callable[[TreeTable, bool], Iterator[Row]],
) -> Callable[[TreeTable, bool], StructureConditions]:
    """Decorate a generator of rows as a function that returns the conditions on a table with blocks or parts."""

    @lru_cache(maxsize=8)
    def conditions(table: TreeTable, blocks: bool) -> StructureConditions:
        return StructureConditions(build(table, blocks))

    return conditions


def is_complete(table: TreeTable) -> bool:
    """Whether a table holds all trees up to its order."""
    return table.limits == normal_limits(table.colors, None)


def closure(table: TreeTable, blocks: bool, *, more: int = 0) -> TreeTable:
    """The smallest family of trees that contains a table and is closed under moving the root, to `more` nodes."""
    if blocks and not is_separable(table) and not is_complete(table):
        raise restricted_table_error(table, "all trees up to its order, or trees of separable systems")
    limits = SEPARABLE if is_separable(table) else None
    return tree_table(table.max_order + more, table.colors, limits)


def restricted_table_error(table: TreeTable, needed: str) -> SeriesError:
    """The error for a restricted table."""
    return SeriesError(f"series must be on a table that holds {needed}, but was on {table!r}")


def ids_within(table: TreeTable, whole: TreeTable) -> dict[int, int]:
    """A table's own ids of its trees, by their ids in a larger table."""
    if table.limits == whole.limits:
        return {tree: tree for tree in range(len(table))}
    product, places = grafting(whole), list(range(table.colors))
    for left, right in zip(*table.lists[2:], strict=True):
        if left >= 0:
            places.append(product(places[left], places[right]))
    return {place: tree for tree, place in enumerate(places)}


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

    def __str__(self) -> str:
        return f"holds to order {self.order}, " + (f"violated by {self.breaks}" if self.breaks else "as far as tested")

    def to_dict(self) -> dict[str, Any]:
        """The verdict as plain data."""
        return {"order": self.order, "breaks": self.breaks and str(self.breaks), "tested_to": self.tested_to}

    def to_table(self) -> Table:
        """The verdict as a table."""
        return fact_table(str(self), self.to_dict().items())

    _repr_html_ = as_html


def verdict(table: TreeTable, violating: int | None) -> Verdict:
    """The verdict for a property whose first violating tree has this id."""
    if violating is None:
        return Verdict(table.max_order, None, table.max_order)
    return Verdict(int(table.columns.order[violating]) - 1, table[violating], table.max_order)


def decide(conditions: StructureConditions, samples: Sequence[BSeries], *, flow: bool = False) -> Verdict:
    """Decide conditions on a series, the first of its `samples`."""
    if len(samples) == 1:
        values = [samples[0].stored.homogeneous(flow=flow)]
    else:  # decimals
        values = [list(map(to_flint, s.stored.coefficients())) for s in samples]
    residuals, *nearby = (conditions.residuals(x, flow=flow) for x in values)
    violating = min((conditions.breaks[k] for k in failing(residuals, nearby)), default=None)
    return verdict(samples[0].table, violating)


def failing(residuals: Sequence[Any], nearby: Sequence[Sequence[Any]]) -> Iterator[int]:
    """Indices of nonzero residuals; `nearby` are the residuals of the other samples of a series in decimals."""
    for k, residual in enumerate(residuals):
        if residual and (not nearby or abs(residual) > 3 * max(abs(other[k] - residual) for other in nearby)):
            yield k


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
