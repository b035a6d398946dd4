"""The recursions on whole tables of trees, in any arithmetic: weights of a method, log, and Lie series.

Each takes and gives raw vectors of an arithmetic, one number per tree. `bseries.exact.domains` turns them into
coefficients.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Any

from bseries.exact import kernels
from bseries.exact.arithmetic import Exact, factorial_weights
from trees.counting import memory_estimate, refuse_table_beyond_memory

if TYPE_CHECKING:
    from trees.table import TreeTable


class Stages:
    """What the recursions need of a method: flat matrices and weights, colour by colour.

    Stage vectors multiply componentwise, or block by block: a block of s components is a polynomial modulo
    z^s + Σ relation_k z^k. With one block, whose polynomial has the nodes as roots, methods with irrational nodes stay
    rational (`integrators.StageAlgebra`); modulo z², a block carries a value and a derivative; modulo a high power of
    z, a polynomial in the time of an exact flow (`bseries.algebra.stages`).
    """

    __slots__ = ("a", "b", "blocks", "longest", "relation", "size")

    def __init__(self, size: int, a: list[Any], b: list[Any], relation: Sequence[Any] = (), blocks: Sequence[int] = ()):
        self.size = size
        self.a = a
        self.b = b
        self.relation = list(relation)
        self.blocks = list(accumulate(blocks, initial=0)) if relation else []
        self.longest = max(blocks, default=1)

    @property
    def sizes(self) -> list[int]:
        """Length of every block."""
        return [last - first for first, last in pairwise(self.blocks)] or [1] * self.size


def elementary_weights(stages: Stages, table: TreeTable, arithmetic: Exact, *, field: bool = False) -> Any:
    """Weights of a method for every tree of the table; `field` scales them as `Wrapped` wants a field."""
    size, top, count = len(table), table.offsets[-2], stages.size
    blocks, start, column, a, b, relation = entries(stages, arithmetic, field)
    _, color, left, right = arithmetic.columns(table)
    weight = arithmetic.zeros(size)
    arithmetic.run(kernels.elementary_weights)(
        0, size, top, table.colors, left, right, color, arithmetic.size(count), blocks, start,
        column, a, b, relation, arithmetic.modulus, arithmetic.zeros(top * count), arithmetic.zeros(top * count),
        weight, arithmetic.scratch(count), arithmetic.scratch(2 * stages.longest),
    )  # fmt: skip
    return weight


@lru_cache(maxsize=1024)
def entries(stages: Stages, arithmetic: Exact, field: bool | None) -> tuple[Any, ...]:
    """The entries of a method in an arithmetic: matrices by rows without zeros.

    Each carries the factor of one node, the weights towards a field's or a flow's values; None: no node's factor.

    Returns:
        The ends of blocks, where each row starts, the columns and values of its entries, the weights, the relation.
    """
    node, last = (
        arithmetic.entry_factors
        if field is None
        else (arithmetic.node_factor(field=False), arithmetic.node_factor(field=field))
    )
    filled = [k for k, entry in enumerate(stages.a) if entry]
    start = [bisect_left(filled, stages.size * row) for row in range(len(stages.a) // stages.size + 1)]
    return (
        arithmetic.sizes(stages.blocks),
        arithmetic.sizes(start),
        arithmetic.sizes([k % stages.size for k in filled]),
        arithmetic.vector([stages.a[k] * node for k in filled]),
        arithmetic.vector([entry * last for entry in stages.b]),
        arithmetic.vector(stages.relation),
    )


def logarithm(target: Any, table: TreeTable, arithmetic: Exact) -> Any:
    """The field b with exp b = target, a flow given with a field's scaling.

    Order by order b = a − Σ_{j≥2} ∂_b^{j−1} b / j!; for bounds the differences become sums.
    """
    field = arithmetic.zeros(len(table))
    weights = factorial_weights(arithmetic, table.max_order, 1, True, negated=True)
    one = arithmetic.vector([1])[0]  # of the type that the others have: the kernel is compiled once for each
    _lie_series(table, arithmetic, True, False, field, arithmetic.zeros(0), one, weights, target)
    return field


def lie_series(
    field: Any,
    base: Any | None,
    base_empty: Any,
    table: TreeTable,
    arithmetic: Exact,
    factor: Any = 1,
    *,
    sparse: bool = False,
) -> Any:
    """Σ_j factor^j/j! · ∂_field^j c: the flow of factor · field, then the series c (see `derivatives`)."""
    factor = abs(factor) if arithmetic.majorant else factor
    weights = factorial_weights(arithmetic, table.max_order, factor, False)
    return derivatives(field, base, base_empty, weights, table, arithmetic, sparse=sparse)


def derivatives(
    field: Any,
    base: Any | None,
    base_empty: Any,
    weights: tuple[Any, Any],
    table: TreeTable,
    arithmetic: Exact,
    *,
    sparse: bool = False,
) -> Any:
    """Σ_j weight_j · ∂_field^j c, with c(τ) = base (None: zero) and c(∅) = base_empty; `sparse`: few b are not 0.

    The weights are `factors` of the arithmetic.
    """
    result = arithmetic.zeros(len(table))
    base = arithmetic.zeros(0) if base is None else base
    empty = arithmetic.vector([base_empty])[0]
    _lie_series(table, arithmetic, False, sparse, field, base, empty, weights, result)
    return result


def _lie_series(
    table: TreeTable, arithmetic: Exact, solve: bool, sparse: bool, field: Any, base: Any, empty: Any,
    weights: tuple[Any, Any], result: Any,
) -> None:  # fmt: skip
    run = arithmetic.run(kernels.lie_series)
    top = table.offsets[-2]
    width = arithmetic.width(table.max_order - 1 + (len(base) > 0))
    rows, terms = arithmetic.zeros(top * int(width)), arithmetic.scratch(int(width) + 1)
    order = arithmetic.columns(table)[0]
    for splits in table.split_chunks():
        run(
            splits.first, splits.last, order, *arithmetic.ids(splits[2:]), width, top, solve, sparse, field, base,
            empty, *weights, arithmetic.modulus, rows, result, terms,
        )  # fmt: skip


def refuse_beyond_memory_of_recursions(sizes: Sequence[int], colors: int) -> None:
    """Refuse series on so many trees of each order, before their table is made, if memory would not do."""
    rows = (len(sizes) + 3) * sum(sizes[:-1])
    needed = memory_estimate(sizes, colors) + 8 * (rows + 3 * sum(sizes))
    refuse_table_beyond_memory(needed, f"a series of {sum(sizes)} trees")
