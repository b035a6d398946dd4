"""Compiled conditions: stage vectors, residuals, and the rows of the Jacobian.

Values of operations lie behind one another, `stages` numbers each;
`reach[m·stages + i]` is the number of entries in row i of the matrix m that may differ from zero. Sizes and columns are
unsigned: without checks for negative indices the inner loops run in vector registers.
"""

from __future__ import annotations

from trees.compiled import kernel

ONE, VECTOR, PRODUCT, IMAGE, PULLBACK = range(5)
"""Kinds of operations: (1, …, 1); a vector of coefficients; x · y by components; A y; Aᵀ y."""


@kernel
def stage_vectors(last, stages, kind, left, right, matrices, reach, vectors, value):
    """The values of the operations 0 … last−1."""
    for k in range(last):
        at = k * stages
        x = left[k] * stages
        y = right[k] * stages
        if kind[k] == PRODUCT:
            for i in range(stages):
                value[at + i] = value[x + i] * value[y + i]
        elif kind[k] == IMAGE:
            for i in range(stages):
                row = (x + i) * stages
                total = 0.0
                for j in range(reach[x + i]):
                    total += matrices[row + j] * value[y + j]
                value[at + i] = total
        elif kind[k] == PULLBACK:
            for i in range(stages):
                value[at + i] = 0.0
            for i in range(stages):
                row = (x + i) * stages
                above = value[y + i]
                for j in range(reach[x + i]):
                    value[at + j] += matrices[row + j] * above
        elif kind[k] == ONE:
            for i in range(stages):
                value[at + i] = 1.0
        else:
            for i in range(stages):
                value[at + i] = vectors[x + i]


@kernel
def sums(stages, starts, factor, block, stage, vectors, value, result):
    """Adds Σ factor · (vector · stage vector) to the result of each equation."""
    for k in range(len(result)):
        total = 0.0
        for term in range(starts[k], starts[k + 1]):
            x = block[term] * stages
            y = stage[term] * stages
            product = 0.0
            for i in range(stages):
                product += vectors[x + i] * value[y + i]
            total += factor[term] * product
        result[k] += total


@kernel
def gradients(stages, starts, factor, left, right, ends, target, rows, reach, value, columns, above, scratch, result):
    """The Jacobian, row by row: slopes are summed over all coefficients, and the free `columns` are kept.

    Slopes factor · x yᵀ with one y follow one another; where `ends` is not 0 the sum of their factor · x is complete.
    If `ends` is 2 its product with y goes to the matrix whose entries begin at `target` and whose `reach` begins at
    `rows`; if 1, the sum itself goes to the vector that begins there. `above` is zero before and after.
    """
    for k in range(len(result)):
        for at in range(len(scratch)):
            scratch[at] = 0.0
        for term in range(starts[k], starts[k + 1]):
            x = left[term] * stages
            for i in range(stages):
                above[i] += factor[term] * value[x + i]
            if ends[term] == 0:
                continue
            y = right[term] * stages
            for i in range(stages):
                slope = above[i]
                above[i] = 0.0
                if ends[term] == 1:
                    scratch[target[term] + i] += slope
                    continue
                at = target[term] + i * stages
                for j in range(reach[rows[term] + i]):
                    scratch[at + j] += slope * value[y + j]
        for column in range(len(columns)):
            result[k, column] = scratch[columns[column]]
