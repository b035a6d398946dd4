"""Recursions over a table of trees, in any arithmetic: elementary weights, logarithm, Lie series, substitution.

Arguments and results are raw vectors of an arithmetic, one number per tree; `bseries.exact.domains` turns them into
coefficients. The denominators of substituted series are here as well.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate, pairwise
from typing import Any

from bseries.exact import kernels
from bseries.exact.arithmetic import Exact, factorial_weights
from trees.table import TreeTable, partitions_of


class Stages:
    """The stage matrices and weights of a method, flat, colour by colour.

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

    def with_entries(self, a: list[Any], b: list[Any]) -> Stages:
        """Other entries in the same blocks."""
        return Stages(self.size, a, b, self.relation, self.sizes if self.relation else ())

    @property
    def sizes(self) -> list[int]:
        """Length of every block."""
        return [last - first for first, last in pairwise(self.blocks)] or [1] * self.size


def elementary_weights(stages: Stages, table: TreeTable, arithmetic: Exact, *, field: bool = False) -> Any:
    """Elementary weights of a method for every tree; `field`: scaled as a field (see `Wrapped`)."""
    size, top, count = len(table), table.offsets[-2], stages.size
    blocks, start, column, a, b, relation = entries(stages, arithmetic, field)
    _, color, left, right = arithmetic.columns(table)
    weight = arithmetic.zeros(size)
    if arithmetic.by_order(table):
        _weights_by_order(
            table, count, stages.longest, (blocks, start, column, a, b, relation), weight, arithmetic.dtype
        )
        return weight
    arithmetic.run(kernels.elementary_weights)(
        0, size, top, table.colors, left, right, color, arithmetic.lengths(count), blocks, start,
        column, a, b, relation, arithmetic.modulus, arithmetic.zeros(top * count), arithmetic.zeros(top * count),
        weight, arithmetic.zeros(count, wide=True), arithmetic.zeros(2 * stages.longest, wide=True),
    )  # fmt: skip
    return weight


@lru_cache(maxsize=1024)
def entries(stages: Stages, arithmetic: Exact, field: bool | None) -> tuple[Any, ...]:
    """The entries of a method in an arithmetic, matrices in compressed sparse rows.

    Entries carry the scaling of one node, weights that of a field or flow; with `field` None, neither does.
    """
    node, last = (
        arithmetic.entry_factors
        if field is None
        else (arithmetic.node_factor(field=False), arithmetic.node_factor(field=field))
    )
    filled = [k for k, entry in enumerate(stages.a) if entry]
    start = [bisect_left(filled, stages.size * row) for row in range(len(stages.a) // stages.size + 1)]
    return (
        arithmetic.lengths(stages.blocks),
        arithmetic.lengths(start),
        arithmetic.lengths([k % stages.size for k in filled]),
        arithmetic.vector([stages.a[k] * node for k in filled]),
        arithmetic.vector([entry * last for entry in stages.b]),
        arithmetic.vector(stages.relation),
    )


def logarithm(target: Any, table: TreeTable, arithmetic: Exact) -> Any:
    """The field b with exp b = target, a flow with the scaling of a field.

    Order by order b = a − Σ_{j≥2} ∂_b^{j−1} b / j!; for bounds the differences become sums.
    """
    field = arithmetic.zeros(len(table))
    weights = factorial_weights(arithmetic, table.max_order, 1, True, negated=True)
    one = arithmetic.vector([1])[0]  # in the type of the vectors: a kernel is compiled once per type
    _lie_series(table, arithmetic, True, False, field, arithmetic.zeros(0), one, weights, target)
    return field


def lie_series(
    field: Any, base: Any, base_empty: Any, table: TreeTable, arithmetic: Exact, factor: Any = 1, *,
    weights: Any = None, sparse: bool = False,
) -> Any:  # fmt: skip
    """Σ_j factor^j/j! · ∂_field^j c: the flow of factor · field, then the series c.

    c(τ) = base (None: zero) and c(∅) = base_empty. `weights`, `factors` of the arithmetic, may take the place of
    factor^j/j!; `sparse` says that the field vanishes at most trees.
    """
    factor = abs(factor) if arithmetic.majorant else factor
    weights = weights or factorial_weights(arithmetic, table.max_order, factor, False)
    result = arithmetic.zeros(len(table))
    base = arithmetic.zeros(0) if base is None else base
    empty = arithmetic.vector([base_empty])[0]
    _lie_series(table, arithmetic, False, sparse, field, base, empty, weights, result)
    return result


def _lie_series(
    table: TreeTable, arithmetic: Exact, solve: bool, sparse: bool, field: Any, base: Any, empty: Any,
    weights: tuple[Any, Any], result: Any,
) -> None:  # fmt: skip
    """Run the kernel over all trees, chunk by chunk."""
    width = arithmetic.width(table.max_order - 1 + (len(base) > 0))
    if arithmetic.by_order(table):
        _lie_series_by_order(table, int(width), solve, field, base, empty, weights, result)
        return
    run = arithmetic.run(kernels.lie_series)
    top = table.offsets[-2]
    rows, terms = arithmetic.zeros(top * int(width)), arithmetic.zeros(int(width) + 1, wide=True)
    order = arithmetic.columns(table)[0]
    for splits in table.split_chunks():
        run(
            splits.first, splits.last, order, *arithmetic.ids(splits[2:]), width, top, solve, sparse, field, base,
            empty, *weights, arithmetic.modulus, rows, result, terms,
        )  # fmt: skip


# Recursions on all trees of an order at once, in NumPy: no machine code, and ten times as fast as the interpreter. They
# do what the kernels do, on int64 modulo 2^64 or float64. Inner functions of the kernels are used as they are, with
# vectors over the trees in place of numbers.


def _weights_by_order(
    table: TreeTable, stages: int, longest: int, entries: tuple[Any, ...], weight: Any, dtype: str
) -> None:
    """Fill in the elementary weights; `entries` are those of `entries`."""
    import numpy as np

    blocks, start, column, a, b, relation = entries
    _, _, left, right = table.arrays
    stage, applied = (np.zeros((stages, len(table)), dtype) for _ in range(2))
    for k, (first, last) in enumerate(pairwise(table.block)):
        ids, row = slice(first, last), k % table.colors * stages
        if k < table.colors:
            g = np.ones((stages, last - first), dtype)
            for inside in (range(int(i) + 1, int(j)) for i, j in pairwise(blocks)):
                g[inside] = 0
        else:
            x, y = stage[:, left[ids]], applied[:, right[ids]]
            g = x * y if len(blocks) == 0 else np.empty_like(x)
            if len(blocks) > 0:
                kernels.multiply_blocks.py_func(blocks, x, 0, y, 0, relation, 0, 0.0, [0] * (2 * longest), g)
        weight[ids] = kernels.weighted_sum.py_func(g, b, row, stages, 0, 0.0)
        stage[:, ids] = g
        for i in range(stages):
            ends = start[row + i], start[row + i + 1]
            applied[i, ids] = kernels.row_sum.py_func(g[0] * 0, g, column, a, *ends, 0, 0.0)


def _lie_series_by_order(
    table: TreeTable, width: int, solve: bool, field: Any, base: Any, empty: Any, weights: tuple[Any, Any], result: Any
) -> None:
    """Fill in the Lie series, or solve for the field; arguments as for the kernel."""
    import numpy as np

    start, trunk, branch = table.split_arrays
    shift = int(len(base) > 0)
    rows = np.zeros((table.offsets[-2], width), field.dtype)
    for n, (first, last) in enumerate(pairwise(table.offsets), 1):
        ids = slice(first, last)
        splits = slice(start[n] + first * (n - 1), start[n] + last * (n - 1))
        trunks, cut = (x[splits].reshape(last - first, n - 1) for x in (trunk, branch))
        terms = np.zeros((last - first, width), field.dtype)
        for k in range(n - 1):
            terms += rows[trunks[:, k]] * field[cut[:, k], None]
        sums = terms.T
        if solve:
            derivative = kernels.weighted_terms.py_func(result[ids].copy(), sums, 0, *weights, 2, n - 1)
            field[ids] = derivative
        else:
            derivative = sums[0] * shift + empty * field[ids]
            total = derivative * weights[0][1]
            if shift:
                total += base[ids] * weights[0][0]
            result[ids] = kernels.weighted_terms.py_func(total, sums, shift, *weights, 2, n - 1)
        if n < table.max_order:
            if shift:
                rows[ids, 0] = base[ids]
            rows[ids, shift] = derivative
            rows[ids, shift + 1 : shift + n] = terms[:, shift : shift + n - 1]


@lru_cache(maxsize=256)
def _layout(stages: Stages) -> tuple[list[int], list[int], list[int], int]:
    """The blocks of a method, their indices among those that differ from the start value, and the number of these.

    Blocks with a nonzero row get an index. The third list has the numbers of coefficients of a product: those modulo a
    power of z need no higher ones.
    """
    size = stages.size
    blocks = stages.blocks or list(range(size + 1))
    live, degrees, moved = [], [], 0
    for first, last in pairwise(blocks):
        rows = (row for row in range(len(stages.a) // size) if first <= row % size < last)
        is_moved = any(any(stages.a[row * size : (row + 1) * size]) for row in rows)
        live.append(moved if is_moved else -1)
        moved += (last - first) * is_moved
        is_power = not any(stages.relation[first:last])
        degrees.append(last - first if is_power else 2 * (last - first) - 1)
    return blocks, [moved if at < 0 else at for at in live], degrees, moved


def into_stages(
    stages: Stages,
    table: TreeTable,
    arithmetic: Exact,
    *,
    field: Any = None,
    target: Any = None,
    inverses: Sequence[Any] = (),
) -> Any:
    """The series of a method applied to `field`, or the field that gives the series `target`."""
    size, top, solve = len(table), table.offsets[-2], field is None
    _, row_start, row_column, a, b, relation = entries(stages, arithmetic, None)
    blocks, live, degrees, moved = _layout(stages)
    field = arithmetic.zeros(size) if solve else field
    result = target if solve else arithmetic.zeros(size)
    width, longest = arithmetic.width(table.max_order), max(degrees)
    kept = top * moved
    rows, logs = (arithmetic.zeros(kept * int(width)) for _ in range(2))
    generators = arithmetic.zeros(kept)
    value, inner = (arithmetic.zeros(stages.size, wide=True) for _ in range(2))
    terms, log_terms = (arithmetic.zeros(longest * int(width), wide=True) for _ in range(2))
    weights = factorial_weights(arithmetic, table.max_order, 1, False)
    negated = factorial_weights(arithmetic, table.max_order, 1, True, negated=True)
    order, color, _, _ = arithmetic.columns(table)
    run = arithmetic.run(kernels.substitute_in_stages)
    for splits in table.split_chunks():
        run(
            splits.first, splits.last, order, color, *arithmetic.ids(splits[2:]), width, top,
            *map(arithmetic.lengths, (stages.size, blocks, live)), relation, arithmetic.lengths(degrees), row_start,
            row_column, a, b, arithmetic.lengths(moved), solve,
            _scale(arithmetic, inverses), arithmetic.entry_factors[1], *weights, *negated, arithmetic.modulus, rows,
            logs, generators, field, result,
            value, inner, terms, log_terms,
        )  # fmt: skip
    return field if solve else result


def into_series(
    a: Any, table: TreeTable, arithmetic: Exact, *, field: Any = None, target: Any = None, inverses: Sequence[Any] = ()
) -> Any:
    """b ★ a, or the b with b ★ a = `target`; `inverses` are then 1/a(•) for each colour.

    Bounds carry a factor per node, also of the skeleton: each part must carry one factor less.
    """
    size, top, solve = len(table), table.offsets[-2], field is None
    partitions = partitions_of(table)
    lift = arithmetic.node_factor(field=False) ** -1 if arithmetic.majorant else 1
    field = arithmetic.zeros(size) if solve else _lifted(field, lift)
    inverses = [x * lift for x in inverses]
    result = target if solve else arithmetic.zeros(size)
    rests, parts = (arithmetic.zeros(partitions.kept) for _ in range(2))
    arithmetic.run(kernels.substitute_in_series)(
        0, size, top, table.colors, *arithmetic.columns(table), *arithmetic.ids(partitions[:3]), a, solve,
        _scale(arithmetic, inverses), arithmetic.modulus, rests, parts, field, result,
    )  # fmt: skip
    return _lifted(field, 1 / lift) if solve else result


def _lifted(field: Any, factor: Any) -> Any:
    """The values times a power of two."""
    return field if factor == 1 else field * float(factor)


def _scale(arithmetic: Exact, inverses: Sequence[Any]) -> Any:
    """1/B and −1/B for each colour."""
    return arithmetic.vector([factor for x in inverses for factor in (x, -x)])


@lru_cache(maxsize=64)
def substituted_denominators(skeletons: tuple[int, ...], parts: tuple[int, ...]) -> tuple[int, ...]:
    """Denominators of b ★ a from those of a (skeletons) and of b (parts); lists begin with one for ∅.

    (b ★ a)(τ) = Σ over the partitions of τ of a(skeleton) Π b(parts). If D^a_m · a is an integer on trees with m nodes
    and D^b_n · b on trees with n nodes, then the least common multiple of D^a_m D^b_{n_1} … D^b_{n_m} over all m and
    n_1 + … + n_m = n is a common denominator on trees with n nodes.
    """
    products = [[1]]
    found = [1]
    for n in range(1, len(skeletons)):
        _extend(products, n, parts)
        found.append(math.lcm(*(skeletons[m] * products[m][n] for m in range(1, n + 1))))
    return tuple(found)


@lru_cache(maxsize=64)
def solved_denominators(skeletons: tuple[int, ...], targets: tuple[int, ...], divisor: int) -> tuple[int, ...]:
    """Denominators of the b with b ★ a = c from those of a and c; `divisor` is the numerator of a(•).

    a(•) b(τ) = c(τ) − Σ over the partitions with two or more parts.
    """
    products: list[list[int]] = [[1]]
    found = [1]
    for n in range(1, len(skeletons)):
        found.append(0)  # excludes b(τ) itself
        _extend(products, n, found)
        several = (skeletons[m] * products[m][n] for m in range(2, n + 1))
        found[n] = divisor * math.lcm(targets[n], *several)
        products[1][n] = found[n]
    return tuple(found)


def _extend(products: list[list[int]], n: int, parts: Sequence[int]) -> None:
    """Fill in products[m][n], the common denominator of m parts with n nodes in all (0: impossible)."""
    products[0].append(0)
    products.append([0] * n)
    for m in range(1, n + 1):
        factors = (products[m - 1][n - k] * parts[k] for k in range(1, n + 1))
        products[m].append(math.lcm(*filter(None, factors)))
