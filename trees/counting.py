"""Counting trees without enumerating them, and what a table of them will cost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from numbers import Real

from foundation.memory import refuse_beyond_memory
from trees.errors import TreeError

MOST_NODES = 60
"""No table and no count goes further: residues and bounds in `bseries` rely on it, and memory ends long before."""

UNBOUNDED = 2**31 - 1
"""A number of children that no tree in a table reaches."""

Limits = tuple[tuple[int, ...], ...]


MOST_BITS = 10_000
"""Python prints no integers that are much longer."""


def check_order(order: object, name: str = "order") -> int:
    """`order` as an int, or a TreeError: it must be a whole number, 1 or more."""
    if isinstance(order, bool) or not hasattr(order, "__index__"):
        raise TreeError(f"{name} must be a whole number, but was {order!r:.60}")
    value = order.__index__()  # pyright: ignore[reportAttributeAccessIssue]
    if value.bit_length() > MOST_BITS:
        raise TreeError(f"{name} must be of reasonable size, but had {value.bit_length():,} binary digits")
    if value < 1:
        raise TreeError(f"{name} must be 1 or more, but was {value!s:.60}")
    return value


def check_size(order: object, colors: object) -> tuple[int, int]:
    """Order and number of colours as ints within what tables can have, or a TreeError."""
    nodes, kinds = check_order(order), check_order(colors, "colors")
    if nodes > MOST_NODES:
        raise TreeError(f"order must be {MOST_NODES} or less, but was {nodes!s:.60}")
    if kinds > 100:
        raise TreeError(f"colors must be 100 or less, but was {kinds!s:.60}")
    return nodes, kinds


def normal_limits(colors: int, max_children: Iterable[Iterable[float | None]] | float | None) -> Limits:
    """`max_children` in its normal form: row c bounds the children of a node of colour c, by colour and in all.

    Args:
        colors: Number of colours K.
        max_children: None (no bound), one number (bounds the children of every node), or K rows of K bounds, each with
            a bound on the total as an optional entry K. None and ``inf`` mean unbounded.

    Raises:
        TreeError: A bound is not a whole number, 0 or more, or a row has a wrong length.
    """
    if max_children is None or not hasattr(max_children, "__iter__"):
        bound = _bound(max_children)  # pyright: ignore[reportArgumentType]
        return tuple((UNBOUNDED,) * colors + (bound,) for _ in range(colors))
    listed = list(max_children)  # pyright: ignore[reportArgumentType]
    if any(isinstance(row, str) or not hasattr(row, "__iter__") for row in listed):
        raise TreeError(f"max_children must be one bound or rows of bounds, but was {max_children!r:.60}")
    rows = [tuple(_bound(entry) for entry in row) for row in listed]
    if len(rows) != colors or any(len(row) not in (colors, colors + 1) for row in rows):
        shape = [len(row) for row in rows]
        raise TreeError(
            f"max_children must have {colors} rows of {colors} or {colors + 1} bounds, but had rows of lengths {shape}"
        )
    return tuple(row if len(row) > colors else (*row, UNBOUNDED) for row in rows)


def _bound(entry: float | None) -> int:
    if entry is None or entry == float("inf"):
        return UNBOUNDED
    if isinstance(entry, bool) or not isinstance(entry, Real) or entry != entry or entry < 0 or int(entry) != entry:
        raise TreeError(f"max_children must hold whole numbers, 0 or more, or None, but had {entry!r:.60}")
    return min(int(entry), UNBOUNDED)


def _add_trees(multisets: list[list[int]], nodes: int, trees: int) -> None:
    """Let `trees` more trees of `nodes` nodes each join multisets[k][n]: k trees with n nodes in all."""
    size = len(multisets) - 1
    choices = [1]  # multisets of j among the new trees: C(trees + j − 1, j)
    for j in range(1, size // nodes + 1):
        choices.append(choices[-1] * (trees + j - 1) // j)
    for k in range(size, 0, -1):
        for n in range(size, nodes - 1, -1):
            multisets[k][n] = sum(choices[j] * multisets[k - j][n - j * nodes] for j in range(min(k, n // nodes) + 1))


def _forests(size: int, multisets: Sequence[list[list[int]]], limits: Sequence[int]) -> int:
    """Multisets of trees with `size` nodes in all that a node with these limits may carry."""
    total = limits[-1]
    if total >= size:  # the total bounds nothing: only the number of nodes needs keeping
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


def count_trees(
    order: int, colors: int = 1, max_children: Iterable[Iterable[float | None]] | float | None = None
) -> tuple[int, ...]:
    """How many rooted trees there are with 1, 2, …, `order` nodes, without listing them.

    Args:
        order: Largest number of nodes, 1 to 60.
        colors: Number of colours, 1 to 100.
        max_children: Bounds on the number of children, as in `TreeTable`.

    Returns:
        One exact count for each number of nodes.

    Raises:
        TreeError: An argument is out of its range.

    Example:
        >>> count_trees(10)
        (1, 1, 2, 4, 9, 20, 48, 115, 286, 719)
        >>> count_trees(4, colors=2)
        (2, 4, 14, 52)

    References:
        OEIS A000081 (one colour), A000151 (two), A006964 (three).
    """
    order, colors = check_size(order, colors)
    limits = normal_limits(colors, max_children)
    return tuple(sum(row) for row in count_by_color(order, limits)[1:])


def memory_estimate(counts: Sequence[int], colors: int) -> int:
    """Bytes that a table of counts[n−1] trees of each order n takes, its splits below the top order included."""
    top = len(counts)
    columns = sum(counts) * 10
    bases = sum(count * (top - n) * colors * 4 for n, count in enumerate(counts, 1))
    splits = sum(count * (n - 1) * 8 for n, count in enumerate(counts[:-1], 1))
    return columns + bases + splits


def refuse_table_beyond_memory(needed: int, what: str) -> None:
    """Raise a TreeError before work is started that would not fit in the memory of this process."""
    refuse_beyond_memory(needed, TreeError, f"order must be smaller: {what}")
