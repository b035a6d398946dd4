"""Recursions over a basis: logarithm and Lie series; over rooted trees also powers of methods, and substitution.

Arguments and results are raw vectors of an arithmetic, one number for each element; `bseries.exact.domains` turns them
into coefficients.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache, partial
from itertools import accumulate, pairwise
from typing import Any

from bseries.exact import kernels, power_kernels
from bseries.exact.arithmetic import Exact, factorial_weights, rationals
from bseries.exact.residues import LARGE, in_threads
from trees.basis import Basis
from trees.table import TreeTable, partitions_of


class Stages:
    """The stage matrices and weights of a method, flat, colour by colour.

    Stage vectors multiply componentwise, or block by block: a block of s components is a polynomial modulo
    z^s + Σ relation_k z^k. With one block, whose polynomial has the nodes as roots, methods with irrational nodes stay
    rational (`integrators.StageAlgebra`); modulo z², a block carries a value and a derivative; modulo a high power of
    z, a polynomial in the time of an exact flow (`bseries.algebra.stages`).
    """

    __slots__ = ("a", "b", "ends", "error", "longest", "relation", "size", "sizes")

    def __init__(
        self,
        size: int,
        a: list[Any],
        b: list[Any],
        relation: Sequence[Any] = (),
        blocks: Sequence[int] = (),
        error: int = 0,
    ):
        self.size = size
        self.a = a
        self.b = b
        self.relation = list(relation) or [0] * size
        self.sizes = list(blocks) or [1] * size
        self.ends = list(accumulate(self.sizes, initial=0))
        self.longest = max(self.sizes, default=1)
        self.error = error  # how far entries may be from those that are meant, in units of 2^−32

    def with_entries(self, a: list[Any], b: list[Any], error: int = 0) -> Stages:
        """Other entries in the same blocks."""
        return Stages(self.size, a, b, self.relation, self.sizes, error)

    def then(self, other: Stages) -> Stages:
        """The stages of the method that takes a step of this one, then one of the other."""
        units, rows, weights = set(other.ends), list[Any](), list[Any]()
        for color in range((len(self.b) + len(other.b)) // max(self.size + other.size, 1)):
            b = self.b[color * self.size : (color + 1) * self.size]
            rows += [x for row in self._rows(color) for x in (*row, *[0] * other.size)]
            rows += [
                x for i, row in enumerate(other._rows(color)) for x in (*(b if i in units else [0] * self.size), *row)
            ]
            weights += [*b, *other.b[color * other.size : (color + 1) * other.size]]
        relation, sizes = self.relation + other.relation, self.sizes + other.sizes
        return Stages(self.size + other.size, rows, weights, relation, sizes, max(self.error, other.error))

    def inverse(self) -> Stages:
        """The stages of the inverse map: A − 1 bᵀ and −b."""
        units, rows = set(self.ends), list[Any]()
        for color in range(len(self.b) // max(self.size, 1)):
            b = self.b[color * self.size : (color + 1) * self.size]
            for i, row in enumerate(self._rows(color)):
                rows += [x - y for x, y in zip(row, b, strict=True)] if i in units else row
        return self.with_entries(rows, [-x for x in self.b], 2 * self.error)

    def scaled(self, factor: Any) -> Stages:
        """The stages of the method with another step size."""
        error = math.ceil(abs(factor) * self.error)
        return self.with_entries([x * factor for x in self.a], [x * factor for x in self.b], error)

    def _rows(self, color: int) -> list[list[Any]]:
        """The rows of the matrix of a colour."""
        first = color * self.size**2
        return [self.a[first + i * self.size : first + (i + 1) * self.size] for i in range(self.size)]


@lru_cache(maxsize=1024)
def entries(stages: Stages, arithmetic: Exact, factors: tuple[Any, Any] = (1, 1)) -> tuple[Any, ...]:
    """Blocks and entries as arguments of kernels; entries of matrices and weights are multiplied by these factors.

    Returns:
        The number of blocks, their ends, the relation, the matrices in compressed sparse rows (starts of rows, columns,
        entries), and the weights.
    """
    filled = [k for k, entry in enumerate(stages.a) if entry]
    start = [bisect_left(filled, stages.size * row) for row in range(len(stages.a) // max(stages.size, 1) + 1)]
    of_matrix, of_weights = factors
    return (
        len(stages.sizes),
        arithmetic.indices(stages.ends),
        arithmetic.vector(stages.relation),
        arithmetic.indices(start),
        arithmetic.indices([k % stages.size for k in filled]),
        arithmetic.vector([stages.a[k] * of_matrix for k in filled]),
        arithmetic.vector([entry * of_weights for entry in stages.b]),
    )


def sum_of_powers(
    table: TreeTable, stages: Stages, step: Any, weights: tuple[tuple[int, ...], ...], arithmetic: Exact
) -> Any:
    """Σ_k weights[n][k−1] a^k, n the number of nodes, for the method with the entries of `stages` times `step`."""
    steps, powers, tails = _weights(weights, arithmetic)
    total, _ = _sum_of_powers(table, stages, step, steps, powers, tails, arithmetic)
    return total


def elementary_weights(table: TreeTable, stages: Stages) -> tuple[list[Fraction], list[list[Fraction]]]:
    """The series of a method with rational entries, and for each component the vectors A g of all but the top order."""
    exact = rationals(len(table))
    total, vectors = _sum_of_powers(table, stages, 1, *_weights(((1,),) * (table.max_order + 1), exact), exact)
    stride = len(vectors) // stages.size
    return total, [vectors[i : i + stride] for i in range(0, len(vectors), stride)]


def _sum_of_powers(
    table: TreeTable, stages: Stages, step: Any, steps: int, powers: Any, tails: Any, arithmetic: Exact
) -> tuple[Any, Any]:
    """The sum, and the vectors G of the last step."""
    zeros, run = arithmetic.zeros, arithmetic.run(power_kernels.sum_of_powers)
    stride = max(table.offsets[-2], table.colors)
    stage, applied, prefix = zeros(stages.size * stride), zeros(stages.size * stride), zeros(stride)
    total = zeros(len(table))
    _, _, left, right = arithmetic.columns(table)
    given = (
        table.max_order, table.colors, arithmetic.indices(table.block), left, right, powers, tails,
        *entries(stages, arithmetic, (step, step)), arithmetic.modulus, stride, stage, applied, prefix,
    )  # fmt: skip

    def add(step: int, last_step: int, first: int, last: int) -> None:
        run(step, last_step, first, last, *given, zeros(stages.longest**2), total)

    if len(table) <= LARGE:
        add(0, steps, 0, len(table))
        return total, applied
    for now in range(steps):
        for first, last in pairwise(table.offsets):
            parts = [*range(first, last, LARGE // 4), last]
            list(in_threads(partial(add, now, now + 1), parts, parts[1:]))
    return total, applied


@lru_cache(maxsize=256)
def _weights(rows: tuple[tuple[int, ...], ...], arithmetic: Exact) -> tuple[int, Any, Any]:
    """The number of steps, and the weights of the powers and of the steps, step by step."""
    steps = max(map(len, rows))
    powers = [row[k] if k < len(row) else 0 for k in range(steps) for row in rows]
    tails = [sum(row[k:]) for k in range(steps) for row in rows]
    return steps, arithmetic.vector(powers), arithmetic.vector(tails)


def logarithm(target: Any, basis: Basis, arithmetic: Exact, weights: Any = None) -> Any:
    """The field b with exp b = target, a flow with the scaling of a field.

    Order by order b = a − Σ_{j≥2} ∂_b^{j−1} b / j!. Other `weights`, factors of the arithmetic, may replace −1/j!.
    """
    field = arithmetic.zeros(len(basis))
    weights = weights or factorial_weights(arithmetic, basis.max_order, 1, True, negated=True)
    _lie_series(basis, arithmetic, True, False, field, None, 1, weights, target)
    return field


def lie_series(
    field: Any, base: Any, base_empty: Any, basis: Basis, arithmetic: Exact, factor: Any = 1, *,
    weights: Any = None, sparse: bool = False,
) -> Any:  # fmt: skip
    """Σ_j factor^j/j! · ∂_field^j c: the flow of factor · field, then the series c.

    c(τ) = base (None: zero) and c(∅) = base_empty. `weights`, `factors` of the arithmetic, may take the place of
    factor^j/j!; `sparse` says that the field vanishes at most elements.
    """
    weights = weights or factorial_weights(arithmetic, basis.max_order, factor, False)
    result = arithmetic.zeros(len(basis))
    _lie_series(basis, arithmetic, False, sparse, field, base, base_empty, weights, result)
    return result


def _lie_series(
    basis: Basis, arithmetic: Exact, solve: bool, sparse: bool, field: Any, base: Any, empty: Any,
    weights: tuple[Any, Any], result: Any,
) -> None:  # fmt: skip
    """Run the kernel over all elements, chunk by chunk."""
    has_base, top = base is not None, basis.offsets[-2]
    width = arithmetic.width(basis.max_order - 1 + has_base)
    rows, terms = arithmetic.zeros(top * width), arithmetic.zeros(width + 1)
    base, order = arithmetic.zeros(0) if base is None else base, arithmetic.orders(basis)
    has_tails = len(weights[1]) > 0
    for cuts in basis.cut_chunks():
        arithmetic.run(kernels.lie_series)(
            cuts.first, cuts.last, order, *arithmetic.cuts(cuts), cuts.multiplicity is not None, width, top, solve,
            sparse, field, base, has_base, arithmetic.vector([empty]), *weights, has_tails, arithmetic.modulus, rows,
            result, terms,
        )  # fmt: skip


@lru_cache(maxsize=256)
def _layout(stages: Stages) -> tuple[list[int], list[int], int]:
    """The blocks of a method: their indices among those that differ from the start value, and the number of these.

    Blocks with a nonzero row get an index. The second list has the numbers of coefficients of a product: those modulo a
    power of z need no higher ones.
    """
    size = stages.size
    live, degrees, moved = [], [], 0
    for first, last in pairwise(stages.ends):
        rows = (row for row in range(len(stages.a) // size) if first <= row % size < last)
        is_moved = any(any(stages.a[row * size : (row + 1) * size]) for row in rows)
        live.append(moved if is_moved else -1)
        moved += (last - first) * is_moved
        is_power = not any(stages.relation[first:last])
        degrees.append(last - first if is_power else 2 * (last - first) - 1)
    return [moved if at < 0 else at for at in live], degrees, moved


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
    blocks, ends, relation, *rows_of_matrix, weights_of_method = entries(stages, arithmetic, arithmetic.entry_factors)
    live, degrees, moved = _layout(stages)
    field = arithmetic.zeros(size) if solve else field
    result = target if solve else arithmetic.zeros(size)
    width, longest = arithmetic.width(table.max_order), max(degrees)
    kept = top * moved
    rows, logs = (arithmetic.zeros(kept * width) for _ in range(2))
    generators = arithmetic.zeros(kept)
    value, inner = (arithmetic.zeros(stages.size) for _ in range(2))
    terms, log_terms = (arithmetic.zeros(longest * width) for _ in range(2))
    weights = factorial_weights(arithmetic, table.max_order, 1, False)
    negated = factorial_weights(arithmetic, table.max_order, 1, True, negated=True)
    order, color, _, _ = arithmetic.columns(table)
    for cuts in table.cut_chunks():
        arithmetic.run(kernels.substitute_in_stages)(
            cuts.first, cuts.last, order, color, *arithmetic.cuts(cuts)[:3], width, top, blocks, ends,
            *map(arithmetic.indices, (live, degrees)), relation, *rows_of_matrix, weights_of_method, moved, solve,
            _scale(arithmetic, inverses), arithmetic.entry_factors[1], *weights, len(weights[1]) > 0, *negated,
            arithmetic.modulus, rows, logs, generators, field, result, value, inner, terms, log_terms,
            arithmetic.zeros(1),
        )  # fmt: skip
    return field if solve else result


def into_series(
    a: Any, table: TreeTable, arithmetic: Exact, *, field: Any = None, target: Any = None, inverses: Sequence[Any] = ()
) -> Any:
    """b ★ a, or the b with b ★ a = `target`; `inverses` are then 1/a(•) for each colour."""
    size, top, solve = len(table), table.offsets[-2], field is None
    partitions = partitions_of(table)
    field = arithmetic.zeros(size) if solve else field
    result = target if solve else arithmetic.zeros(size)
    rests, parts = (arithmetic.zeros(partitions.kept) for _ in range(2))
    arithmetic.run(kernels.substitute_in_series)(
        0, size, top, table.colors, *arithmetic.columns(table), *arithmetic.ids(partitions[:3]), a, solve,
        _scale(arithmetic, inverses), arithmetic.modulus, rests, parts, field, result, arithmetic.zeros(7),
    )  # fmt: skip
    return field if solve else result


def _scale(arithmetic: Exact, inverses: Sequence[Any]) -> Any:
    """1/B and −1/B for each colour."""
    return arithmetic.vector([factor for x in inverses for factor in (x, -x)])
