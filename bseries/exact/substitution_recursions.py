"""Denominators of substituted series: what is proved about them before anything is computed.

(b ★ a)(τ) = Σ over the partitions of τ of a(skeleton) Π b(parts). If D^a_m · a is an integer on trees with m nodes and
D^b_n · b on trees with n nodes, a common denominator on trees with n nodes is the least common multiple of
D^a_m D^b_{n_1} … D^b_{n_m} over all m and all n_1 + … + n_m = n. Here lists of denominators begin with one for ∅.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exact import substitution_kernels as kernels
from bseries.exact.arithmetic import Exact, factorial_weights
from bseries.exact.recursions import Stages, entries
from trees.table import partitions_of

if TYPE_CHECKING:
    from trees.table import TreeTable


@lru_cache(maxsize=64)
def substituted_denominators(skeletons: tuple[int, ...], parts: tuple[int, ...]) -> tuple[int, ...]:
    """Denominators of b ★ a from those of a (skeletons) and of b (parts)."""
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
        found.append(0)  # b(τ) itself is no part of what follows
        _extend(products, n, found)
        several = (skeletons[m] * products[m][n] for m in range(2, n + 1))
        found[n] = divisor * math.lcm(targets[n], *several)
        products[1][n] = found[n]
    return tuple(found)


def _extend(products: list[list[int]], n: int, parts: Sequence[int]) -> None:
    """Enter for n nodes: products[m][n] is the common denominator of m parts with n nodes in all (0: not possible)."""
    products[0].append(0)
    products.append([0] * n)
    for m in range(1, n + 1):
        factors = (products[m - 1][n - k] * parts[k] for k in range(1, n + 1))
        products[m].append(math.lcm(*filter(None, factors)) if n >= m else 0)


class Places(NamedTuple):
    """Which stages do not sit at the start value, and where their components are kept."""

    blocks: list[int]
    live: list[int]
    degrees: list[int]
    moved: int


@lru_cache(maxsize=256)
def places(stages: Stages) -> Places:
    """Blocks whose rows are not all zero get a place; products modulo a power need no higher coefficients."""
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
    return Places(blocks, [moved if at < 0 else at for at in live], degrees, moved)


def into_stages(
    stages: Stages,
    table: TreeTable,
    arithmetic: Exact,
    *,
    field: Any = None,
    target: Any = None,
    inverses: Sequence[Any] = (),
) -> Any:
    """The series of a method applied to `field`, or the field for which it is `target`.

    Args:
        stages: The method.
        table: The trees.
        arithmetic: Any but `Wrapped`.
        field: b at every tree.
        target: The result at every tree, where b is sought.
        inverses: Then, for each colour, 1/B with B the sum of the weights.
    """
    size, top, solve = len(table), table.offsets[-2], field is None
    _, row_start, row_column, a, b, relation = entries(stages, arithmetic, None)
    shape = places(stages)
    field = arithmetic.zeros(size) if solve else field
    result = target if solve else arithmetic.zeros(size)
    width, longest = arithmetic.width(table.max_order), max(shape.degrees)
    kept = top * shape.moved
    rows, logs = (arithmetic.zeros(kept * int(width)) for _ in range(2))
    generators = arithmetic.zeros(kept)
    value, inner = (arithmetic.scratch(stages.size) for _ in range(2))
    terms, log_terms = (arithmetic.scratch(longest * int(width)) for _ in range(2))
    weights = factorial_weights(arithmetic, table.max_order, 1, False)
    negated = factorial_weights(arithmetic, table.max_order, 1, True, negated=True)
    order, color, _, _ = arithmetic.columns(table)
    run = arithmetic.run(kernels.substitute_in_stages)
    for splits in table.split_chunks():
        run(
            splits.first, splits.last, order, color, *arithmetic.ids(splits[2:]), width, top,
            arithmetic.size(stages.size), arithmetic.sizes(shape.blocks), arithmetic.sizes(shape.live), relation,
            arithmetic.sizes(shape.degrees), row_start, row_column, a, b, arithmetic.size(shape.moved), solve,
            _scale(arithmetic, inverses), arithmetic.entry_factors[1], *weights, *negated, arithmetic.modulus, rows,
            logs, generators, field, result,
            value, inner, terms, log_terms,
        )  # fmt: skip
    return field if solve else result


def into_series(
    a: Any, table: TreeTable, arithmetic: Exact, *, field: Any = None, target: Any = None, inverses: Sequence[Any] = ()
) -> Any:
    """b ★ a, or the b for which it is `target`; `inverses` are then 1/a(•), one for each colour.

    Bounds carry a factor per node, of the skeleton as well: so each part has to carry one factor less.
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
    """A field's values with another factor, which is a power of two."""
    return field if factor == 1 else field * float(factor)


def _scale(arithmetic: Exact, inverses: Sequence[Any]) -> Any:
    """1/B and −1/B for each colour."""
    return arithmetic.vector([factor for x in inverses for factor in (x, -x)])
