"""The recursions on whole tables of trees, in any arithmetic: weights of a method, log, and Lie series.

Each takes and gives raw vectors of an arithmetic, one number per tree. `bseries.domains` turns them into coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from trees.counting import memory_estimate, refuse_beyond_memory

from . import kernels
from .arithmetic import Exact, factorial_weights

if TYPE_CHECKING:
    from collections.abc import Sequence

    from trees.table import TreeTable


@dataclass(frozen=True, eq=False)
class Stages:
    """What the weight recursion needs of a method: flat matrices and weights, colour by colour.

    `relation` is empty for stage vectors that multiply componentwise; otherwise stage vectors are polynomials modulo
    z^s + Σ relation_k z^k (see `kernels.elementary_weights`).
    """

    size: int
    a: list[Any]
    b: list[Any]
    relation: list[Any]


def elementary_weights(stages: Stages, table: TreeTable, arithmetic: Exact, *, field: bool = False) -> Any:
    """Weights of a method for every tree of the table; `field` scales them as `Wrapped` wants a field."""
    size, top, count = len(table), table.offsets[-2], stages.size
    a, b, relation = _entries(stages, arithmetic, field)
    _, color, left, right = arithmetic.columns(table)
    weight = arithmetic.zeros(size)
    arithmetic.run(kernels.elementary_weights)(
        0, size, top, table.colors, left, right, color, arithmetic.size(count),
        a, b, relation, arithmetic.modulus, arithmetic.zeros(top * count), arithmetic.zeros(top * count), weight,
        arithmetic.scratch(count), arithmetic.scratch(2 * count),
    )  # fmt: skip
    return weight


@lru_cache(maxsize=1024)
def _entries(stages: Stages, arithmetic: Exact, field: bool) -> tuple[Any, Any, Any]:
    """The entries of a method as vectors of an arithmetic, each carrying the factor of one node."""
    node, last = arithmetic.node_factor(field=False), arithmetic.node_factor(field=field)
    return (
        arithmetic.vector([entry * node for entry in stages.a]),
        arithmetic.vector([entry * last for entry in stages.b]),
        arithmetic.vector(stages.relation),
    )


def logarithm(target: Any, table: TreeTable, arithmetic: Exact) -> Any:
    """The field b with exp b = target, a flow given with a field's scaling.

    Order by order b = a − Σ_{j≥2} ∂_b^{j−1} b / j!; for bounds the differences become sums.
    """
    field = arithmetic.zeros(len(table))
    weights = factorial_weights(arithmetic, table.max_order, 1, True)
    weights = -weights if arithmetic.majorant else weights
    _lie_series(table, arithmetic, True, field, arithmetic.zeros(0), 1, weights, target)
    return field


def lie_series(
    field: Any, base: Any | None, base_empty: Any, table: TreeTable, arithmetic: Exact, factor: Any = 1
) -> Any:
    """Σ_j factor^j/j! · ∂_field^j c: the flow of factor · field, then the series c (see `derivatives`)."""
    factor = abs(factor) if arithmetic.majorant else factor
    weights = factorial_weights(arithmetic, table.max_order, factor, False)
    return derivatives(field, base, base_empty, weights, table, arithmetic)


def derivatives(
    field: Any, base: Any | None, base_empty: Any, weights: Any, table: TreeTable, arithmetic: Exact
) -> Any:
    """Σ_j weights[j] · ∂_field^j c, with c(τ) = base (None: zero) and c(∅) = base_empty."""
    result = arithmetic.zeros(len(table))
    base = arithmetic.zeros(0) if base is None else base
    empty = arithmetic.vector([base_empty])[0]
    _lie_series(table, arithmetic, False, field, base, empty, weights, result)
    return result


def _lie_series(
    table: TreeTable, arithmetic: Exact, solve: bool, field: Any, base: Any, empty: Any, weights: Any, result: Any
) -> None:
    run = arithmetic.run(kernels.lie_series)
    top = table.offsets[-2]
    width = arithmetic.width(table.max_order - 1 + (len(base) > 0))
    rows, terms = arithmetic.zeros(top * int(width)), arithmetic.scratch(int(width) + 1)
    order = arithmetic.columns(table)[0]
    for splits in table.split_chunks():
        run(
            splits.first, splits.last, order, *arithmetic.splits(splits), width, top, solve, field, base, empty,
            weights, arithmetic.modulus, rows, result, terms,
        )  # fmt: skip


def refuse_beyond_memory_of_recursions(sizes: Sequence[int], colors: int) -> None:
    """Refuse series on so many trees of each order, before their table is made, if memory would not do."""
    rows = (len(sizes) + 3) * sum(sizes[:-1])
    needed = memory_estimate(sizes, colors) + 8 * (rows + 3 * sum(sizes))
    refuse_beyond_memory(needed, f"a series of {sum(sizes)} trees")
