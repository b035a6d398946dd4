"""Denominators of elementary weights and bounds on them, by number of nodes.

Both follow the recursion g(u ∘ v) = g(u) G(v), G(v) = A g(v), a(τ) = b · g(τ), block by block. A *size* of numbers is
their common denominator, or the largest absolute value in units of 2^−32; for the components of a block the sum of
these. The size of a product is at most the product of the sizes, also modulo a power of the variable of a block. That
of A g is at most the sum, over blocks of columns, of the largest sum of a column times the size of g in the block.

For the smallest trees the values themselves are computed. Methods satisfy simplifying assumptions and order conditions,
and sums are far smaller than their terms: for Dormand and Prince's method and 12 nodes the common denominator has 107
bits, where the power L^12 of that of all entries has 408, and |a| ≤ 0.3, where Σ|b_i| (max Σ_j |a_ij|)^11 is 2^52.
"""

from __future__ import annotations

import math
import operator
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import accumulate, pairwise
from typing import NamedTuple

from bseries.exact import bounds, recursions
from bseries.exact.bounds import Bound
from bseries.exact.recursions import Stages
from trees.counting import count_trees
from trees.table import tree_table

HEAD = 60
"""The number of trees whose values are computed at most, in a few milliseconds: with one colour, up to six nodes."""


class Size(NamedTuple):
    """How sizes are computed."""

    one: int
    of: Callable[[Fraction], int]
    largest: Callable[[Iterable[int]], int]  # of one of several numbers
    total: Callable[[Iterable[int]], int]  # of their sum
    product: Callable[[int, int], int]


def _common(sizes: Iterable[int]) -> int:
    return math.lcm(*sizes)


_DENOMINATOR = Size(1, lambda x: x.denominator, _common, _common, operator.mul)


def _absolute(x: Fraction) -> int:
    return (abs(x.numerator) << bounds.FINE) // x.denominator + 1


_ABSOLUTE = Size(bounds.ONE, _absolute, lambda sizes: max(sizes, default=0), sum, bounds.product)


@lru_cache(maxsize=256)
def denominators(stages: Stages, order: int) -> tuple[int, ...]:
    """Denominators of the elementary weights of a method with rational entries."""
    return _by_order(stages, order, _DENOMINATOR)


@lru_cache(maxsize=256)
def bound(stages: Stages, order: int) -> Bound:
    """Bounds on the elementary weights; entries must be exact."""
    return _by_order(stages, order, _ABSOLUTE)


@lru_cache(maxsize=256)
def rough_bound(stages: Stages, order: int) -> Bound:
    """β α^(n−1), where α and β bound the sums of rows and of weights."""
    size, error = max(stages.size, 1), stages.error
    a, b = ([_absolute(x) + error if x else error for x in entries] for entries in (stages.a, stages.b))
    rows, weights = ([sum(x[i : i + size]) for i in range(0, len(x), size)] for x in (a, b))
    ends = accumulate(stages.sizes * len(weights), initial=0)  # rows of a block count together
    found, factor = [bounds.ONE, max(weights, default=0)], max((sum(rows[i:j]) for i, j in pairwise(ends)), default=0)
    for _ in range(order - 1):
        found.append(bounds.product(found[-1], factor))
    return tuple(found)


def _by_order(stages: Stages, order: int, size: Size) -> tuple[int, ...]:
    """The sizes of elementary weights by number of nodes."""
    found, inner = _of_values(stages, order, size)
    blocks = range(len(stages.sizes))
    into_blocks, (into_weights,) = (_factors(stages, x, size) for x in (stages.a, stages.b))
    products = [[size.one] * len(blocks)]

    def total(factors: dict[int, int]) -> int:
        return size.total(size.product(factor, products[-1][e]) for e, factor in factors.items())

    for n in range(1, order + 1):
        if len(found) == n:
            found.append(total(into_weights))
        if len(inner) < n:
            inner.append([total(factors) for factors in into_blocks])
        pairs = [(products[n - 1 - k], inner[k]) for k in range(n)]
        products.append([size.largest(size.product(u[e], v[e]) for u, v in pairs) for e in blocks])
    return tuple(found)


def _of_values(stages: Stages, order: int, size: Size) -> tuple[list[int], list[list[int]]]:
    """The sizes of the values of the smallest trees, and those of A g in each block for trees with fewer nodes."""
    colors = len(stages.b) // stages.size
    head = max(1, bisect_right([*accumulate(count_trees(min(order, 6), colors))], HEAD))
    table = tree_table(head, colors)
    weights, vectors = recursions.elementary_weights(table, stages)
    blocks = [range(*ends) for ends in pairwise(stages.ends)]
    found = [size.one, *(size.largest(size.of(weights[t]) for t in table.ids(n)) for n in range(1, head + 1))]
    inner = [
        [size.largest(size.total(size.of(vectors[i][t]) for i in block) for t in table.ids(n)) for block in blocks]
        for n in range(1, head)
    ]
    return found, inner


def _factors(stages: Stages, entries: Sequence[Fraction], size: Size) -> list[dict[int, int]]:
    """Factors on sizes from block to block, by block of rows and of columns; weights are a single row."""
    of_column = [e for e, count in enumerate(stages.sizes) for _ in range(count)]
    of_row = of_column if entries is stages.a else [0]
    columns: dict[tuple[int, int, int], list[int]] = {}
    for k, x in enumerate(entries):
        if x:
            color, row = divmod(k // stages.size, len(of_row))
            columns.setdefault((color, of_row[row], k % stages.size), []).append(size.of(x))
    sums: list[dict[int, list[int]]] = [{} for _ in range(of_row[-1] + 1 if of_row else 0)]
    for (_, e, column), sizes in columns.items():
        sums[e].setdefault(of_column[column], []).append(size.total(sizes))
    return [{e: size.largest(x) for e, x in row.items()} for row in sums]
