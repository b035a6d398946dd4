"""The kernel of general linear methods: starting series and modified equation, tree by tree."""

from __future__ import annotations

from bseries.exact.kernels import FEW, add_multiple, add_weighted, reduce_range, weigh
from bseries_base.lowering.flat_kernels import flat_kernel


@flat_kernel
def general_linear(
    first, last, order, left, right, start, trunk, branch, width, top, stages, inputs, a, u, b, solver, preconsistency,
    weights, tails, has_tails, modulus, slopes, points, rows, starting, field, slope, known, found, terms, sums,
):  # fmt: skip
    """The starting series S_i and the field b with GLM∘S = S∘exp b, for the trees first … last−1.

    With the stage series Y = A F + U S and their slopes F, B F + V S = Σ_j ∂_b^j S / j!. At a tree all terms but S and
    u b, in j = 1, are known from smaller trees or are B F. The matrix with the rows (V − I, −u) and (d, 0) maps
    (S, b) to what is known, and 0 (HLW, theorem XV.8.1).

    Args:
        first, last, order, start, trunk, branch, width, top, weights, tails, has_tails, modulus: As for `lie_series`;
            the factors are 1/j!.
        left, right: Columns of the table.
        stages, inputs: The numbers s and r.
        a, u, b: The matrices A, U, B by rows.
        solver: The inverse of the bordered matrix, by rows.
        preconsistency: u, the values of S at the empty tree.
        slopes, points: F and Y for each tree and stage.
        rows: ∂_b^j S_i from j = 0, for each tree and input.
        starting, field: S_i and b for each tree.
        slope, known, found, terms, sums: Scratch of s, r + 1, r + 1, `width` for each input, and 1 entries.
    """
    inverse = 1.0 / modulus if modulus else 0.0
    for tree in range(first, last):
        n = order[tree]
        for i in range(stages):
            slope[i] = 1
            if n > 1:
                slope[i] = slopes[left[tree] * stages + i] * points[right[tree] * stages + i]
        for j in range(inputs * width):
            terms[j] = 0
        begin = start[tree - first]
        for k in range(begin, start[tree - first + 1]):
            for i in range(inputs):
                add_multiple(field[branch[k]], rows, (trunk[k] * inputs + i) * width, width, terms, i * width)
            if modulus and (k - begin) % FEW == FEW - 1:
                reduce_range(terms, 0, inputs * width, modulus, inverse)
        if modulus:
            reduce_range(slope, 0, stages, modulus, inverse)
            reduce_range(terms, 0, inputs * width, modulus, inverse)
        for i in range(inputs):
            weigh(slope, b, i * stages, stages, modulus, inverse, sums)
            known[i] = terms[i * width] - sums[0]
            add_weighted(terms, i * width + 1, weights, tails, has_tails, 2, n - 1, known, i)
        known[inputs] = 0
        if modulus:
            reduce_range(known, 0, inputs, modulus, inverse)
        for i in range(inputs + 1):
            weigh(known, solver, i * (inputs + 1), inputs + 1, modulus, inverse, sums)
            found[i] = sums[0]
        field[tree] = found[inputs]
        for i in range(inputs):
            starting[tree * inputs + i] = found[i]
        if tree < top:
            for i in range(inputs):
                row = (tree * inputs + i) * width
                rows[row] = found[i]
                terms[i * width] += preconsistency[i] * field[tree]
                if modulus:
                    reduce_range(terms, i * width, i * width + 1, modulus, inverse)
                for j in range(width - 1):
                    rows[row + 1 + j] = terms[i * width + j]
            for i in range(stages):
                weigh(slope, a, i * stages, stages, modulus, inverse, sums)
                slopes[tree * stages + i] = slope[i]
                points[tree * stages + i] = sums[0]
                weigh(found, u, i * inputs, inputs, modulus, inverse, sums)
                points[tree * stages + i] += sums[0]
                if modulus:
                    reduce_range(points, tree * stages + i, tree * stages + i + 1, modulus, inverse)
