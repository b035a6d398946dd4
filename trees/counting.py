"""Counts of trees without enumeration, and the memory of tables."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate
from typing import Any

from bseries_base.child_bounds import GivenBounds, read_child_bounds
from bseries_base.memory import refuse_beyond_memory
from bseries_base.table import Column, Table
from trees.errors import TreeError

MOST_NODES = 60
"""Limit of tables and counts, on which residues and bounds in `bseries` rely; memory is exhausted far below."""

UNBOUNDED = 2**31 - 1
"""More children than any tree in a table has."""

Limits = tuple[tuple[int, ...], ...]
MOST_BITS = 10_000
"""Python does not print much longer integers."""


def check_order(order: object, name: str = "order") -> int:
    """A whole number, 1 or more, as an int."""
    if isinstance(order, bool) or not hasattr(order, "__index__"):
        raise TreeError(f"{name} must be a whole number, but was {order!r:.60}")
    value = order.__index__()  # pyright: ignore[reportAttributeAccessIssue]
    if value.bit_length() > MOST_BITS:
        raise TreeError(f"{name} must be of reasonable size, but had {value.bit_length():,} binary digits")
    if value < 1:
        raise TreeError(f"{name} must be 1 or more, but was {value!s:.60}")
    return value


def check_size(order: object, colors: object) -> tuple[int, int]:
    """The order and number of colours of a table, within the limits, as ints."""
    nodes, kinds = check_order(order), check_order(colors, "colors")
    if nodes > MOST_NODES:
        raise TreeError(f"order must be {MOST_NODES} or less, but was {nodes!s:.60}")
    if kinds > 100:
        raise TreeError(f"colors must be 100 or less, but was {kinds!s:.60}")
    return nodes, kinds


def normal_limits(colors: int, max_children: GivenBounds) -> Limits:
    """The normal form of `max_children`: row c bounds the children of a node of colour c, by colour and in all."""
    rows = read_child_bounds(max_children, colors, TreeError)
    return tuple(tuple(UNBOUNDED if bound is None else min(bound, UNBOUNDED) for bound in row) for row in rows)


def _add_trees(multisets: list[list[int]], nodes: int, trees: int) -> None:
    """Add `trees` trees of `nodes` nodes each to the counts multisets[k][n] of k trees with n nodes in all."""
    size = len(multisets) - 1
    choices = [1]  # multisets of j among the new trees: C(trees + j − 1, j)
    for j in range(1, size // nodes + 1):
        choices.append(choices[-1] * (trees + j - 1) // j)
    for k in range(size, 0, -1):
        for n in range(size, nodes - 1, -1):
            multisets[k][n] = sum(choices[j] * multisets[k - j][n - j * nodes] for j in range(min(k, n // nodes) + 1))


def _forests(size: int, multisets: Sequence[list[list[int]]], limits: Sequence[int]) -> int:
    """The number of multisets of children with `size` nodes in all of a node with these limits."""
    total = limits[-1]
    if total >= size:  # the total is not bounded: count by nodes only
        forests = [1] + [0] * size
        for own, most in zip(multisets, limits, strict=False):
            series = [sum(row[n] for row in own[: min(most, size) + 1]) for n in range(size + 1)]
            forests = [sum(series[i] * forests[n - i] for i in range(n + 1)) for n in range(size + 1)]
        return forests[size]
    table = [[1] + [0] * size] + [[0] * (size + 1) for _ in range(total)]
    for own, most in zip(multisets, limits, strict=False):
        table = [
            [
                sum(own[j][i] * table[k - j][n - i] for j in range(min(k, most) + 1) for i in range(j, n + 1))
                for n in range(size + 1)
            ]
            for k in range(total + 1)
        ]
    return sum(row[size] for row in table)


@lru_cache(maxsize=64)
def count_by_color(order: int, limits: Limits) -> tuple[tuple[int, ...], ...]:
    """counts[n][c]: trees with n nodes and root colour c, n = 0 … order."""
    colors = range(len(limits))
    multisets = [[[1] + [0] * (order - 1)] + [[0] * order for _ in range(order - 1)] for _ in colors]
    counts = [(0,) * len(limits)]
    for n in range(1, order + 1):
        counts.append(tuple(_forests(n - 1, multisets, limits[c]) for c in colors))
        for c in colors:
            _add_trees(multisets[c], n, counts[n][c])
    return tuple(counts)


def count_trees(order: int, colors: int = 1, max_children: GivenBounds = None) -> tuple[int, ...]:
    """The numbers of rooted trees with 1, 2, …, `order` nodes, without enumeration.

    Args:
        order: Largest number of nodes, 1 to 60.
        colors: Number of colours, 1 to 100.
        max_children: Bounds on the number of children, as in `TreeTable`.

    Returns:
        One exact count for each number of nodes.

    Raises:
        TreeError: An argument is out of its range.

    Example:
        >>> import bseries as bs
        >>> bs.trees.count_trees(10)
        (1, 1, 2, 4, 9, 20, 48, 115, 286, 719)
        >>> bs.trees.count_trees(4, colors=2)
        (2, 4, 14, 52)

    References:
        OEIS A000081 (one colour), A000151 (two), A006964 (three).
    """
    order, colors = check_size(order, colors)
    limits = normal_limits(colors, max_children)
    return tuple(sum(row) for row in count_by_color(order, limits)[1:])


def count_table(counts: Sequence[int], colors: int) -> Table:
    """Numbers of trees by their number of nodes."""
    names = ("order", "trees", "total")
    rows = list(zip(range(1, len(counts) + 1), counts, accumulate(counts), strict=True))

    def data() -> dict[str, Any]:
        records = [dict(zip(names, row, strict=True)) for row in rows]
        return {"schema": 1, "kind": "tree-counts", "colors": colors, "counts": records}

    return Table(
        "Numbers of rooted trees",
        (Column("nodes", True), Column("trees", True), Column("so far", True)),
        rows,
        data=data,
        items="counts",
        records=Table("", list(map(Column, names)), rows),
        titled=False,
    )


def memory_estimate(counts: Sequence[int], colors: int, *, splits: bool = False) -> int:
    """Bytes of a table of counts[n−1] trees of each order n, with or without its splits below the top order."""
    top = len(counts)
    columns = sum(counts) * 10
    bases = sum(count * (top - n) * colors * 4 for n, count in enumerate(counts, 1))
    of_splits = sum(count * n * 8 for n, count in enumerate(counts[:-1], 1))  # two ids for each, and where they begin
    return columns + bases + of_splits * splits


def refuse_table_beyond_memory(needed: int, what: str) -> None:
    """Refuse a table that would not fit in memory before work starts."""
    refuse_beyond_memory(needed, TreeError, f"order must be smaller: {what}")
