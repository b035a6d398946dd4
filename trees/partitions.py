"""The partitions of all trees of a table, listed once and kept: what substitution into a general series runs over."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

from .counting import normal_limits, refuse_table_beyond_memory
from .errors import TreeError
from .table import TreeTable


class Partitions(NamedTuple):
    """All partitions of the trees of a table; a tree with n nodes has 2^(n−1) from start[n] + tree·2^(n−1) on.

    Attributes:
        start: By number of nodes, where the lists start.
        skeleton: Id of the tree that is left when every part shrinks to a node.
        part: Id of the part that holds the root.
        kept: How many partitions belong to trees below the largest order.
    """

    start: Any
    skeleton: Any
    part: Any
    kept: int


@lru_cache(maxsize=4)
def partitions_of(table: TreeTable) -> Partitions:
    """The partitions of all trees of a table, kept for the next caller (the last four tables are).

    Args:
        table: All trees up to some order; skeletons of a restricted family leave it.

    Raises:
        TreeError: The table is restricted, or the lists would not fit in memory (refused before any work).

    Example:
        >>> partitions = partitions_of(TreeTable(4))
        >>> len(partitions.skeleton)
        43

    References:
        P. Chartier, E. Hairer, G. Vilmart, *Algebraic structures of B-series*, Found. Comput. Math. 10 (2010), §3.2,
        doi:10.1007/s10208-010-9065-1.
    """
    if table.limits != normal_limits(table.colors, None):
        raise TreeError(f"table must hold all trees, since skeletons have any number of children, but was {table!r}")
    sizes = table.sizes
    total = sum(size << n for n, size in enumerate(sizes))
    refuse_table_beyond_memory(24 * total, f"a list of {total} partitions")
    start, begin = [0], 0
    for n in range(1, table.max_order + 1):
        start.append(begin - (table.ids(n).start << (n - 1)))
        begin += sizes[n - 1] << (n - 1)
    starts, skeleton, part = table.column(start), table.column(total, "int32"), table.column(total, "int32")
    table.list_partitions(starts, skeleton, part)
    return Partitions(starts, skeleton, part, total - (sizes[-1] << (table.max_order - 1)))
