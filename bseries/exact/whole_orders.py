"""Recursions on all trees of an order at once, in NumPy: no machine code, and ten times as fast as the interpreter.

They do what the kernels of the same names do (`bseries.exact.kernels`), on int64 modulo 2^64 or float64. Inner
functions of the kernels are used as they are, with vectors over the trees in place of numbers.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

from bseries.exact import kernels

if TYPE_CHECKING:
    from trees.table import TreeTable


def elementary_weights(
    table: TreeTable, stages: int, longest: int, entries: tuple[Any, ...], weight: Any, dtype: str
) -> None:
    """Fill in the elementary weights; `entries` are those of `bseries.exact.recursions.entries`."""
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


def lie_series(
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
