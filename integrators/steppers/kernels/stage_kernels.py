"""Kernels of implicit stages: linear algebra on pointers, without the cost of calls of LAPACK, and stopping criteria.

Changes in stopping criteria are bits of doubles.
"""

from __future__ import annotations

from math import inf, nan

from integrators.compile.machine import DOUBLE, DOUBLES, TRUTH, WHOLE, bits, compiled, inlined_as, value_of


@compiled
def factorize(matrix, pivots, n):
    """Overwrite a matrix by its factors L and U, and `pivots` by the row exchanges.

    A singular matrix gives infinity or nan.

    References:
        G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th edition, algorithm 3.4.1 (partial pivoting).
    """
    for k in range(n):
        p, largest = k, abs(matrix[k * n + k])
        for i in range(k + 1, n):
            size = abs(matrix[i * n + k])
            if size > largest:
                p, largest = i, size
        pivots[k] = p
        if p != k:
            for j in range(n):
                matrix[k * n + j], matrix[p * n + j] = matrix[p * n + j], matrix[k * n + j]
        if not largest < inf:  # division by infinity would give 0, a false solution
            matrix[k * n + k] = nan
        inverse = 1.0 / matrix[k * n + k]
        for i in range(k + 1, n):
            factor = matrix[i * n + k] * inverse
            matrix[i * n + k] = factor
            for j in range(k + 1, n):
                matrix[i * n + j] -= factor * matrix[k * n + j]


@compiled
def solve(matrix, pivots, n, x):
    """Overwrite the right-hand side x of a linear system by its solution."""
    for k in range(n):
        p = int(pivots[k])
        x[k], x[p] = x[p], x[k]
    for i in range(n):
        total = x[i]
        for j in range(i):
            total -= matrix[i * n + j] * x[j]
        x[i] = total
    for i in range(n - 1, -1, -1):
        total = x[i]
        for j in range(i + 1, n):
            total -= matrix[i * n + j] * x[j]
        x[i] = total / matrix[i * n + i]


@compiled
def add_product(out, a, b, n, rows, inner, columns):
    """Add a part of the product of two n × n matrices, given by ranges of rows, inner indices and columns."""
    for i in range(rows[0], rows[1]):
        for k in range(inner[0], inner[1]):
            factor = a[i * n + k]
            for j in range(columns[0], columns[1]):
                out[i * n + j] += factor * b[k * n + j]


@compiled
def clear(matrix, size):
    """Set the entries of a matrix to zero."""
    for i in range(size):
        matrix[i] = 0.0


@compiled
def subtract_from_identity(matrix, n, factor):
    """Overwrite a matrix by I − factor · matrix."""
    for i in range(n):
        for j in range(n):
            matrix[i * n + j] *= -factor
        matrix[i * n + i] += 1.0


@compiled
def assemble(matrix, size, jacobians, n, h, parts, factors):
    """Set a matrix to I − Σ factor · h^power · submatrix.

    Args:
        matrix: The matrix.
        size: The number of its rows.
        jacobians: Consecutive matrices with n columns.
        n: The number of columns.
        h: The step size.
        parts: Five numbers for each submatrix: its index in `matrix` and in `jacobians`, its height, its width, and
            the power of h.
        factors: The factor of each submatrix.
    """
    clear(matrix, size * size)
    for i in range(size):
        matrix[i * size + i] = 1.0
    for part in range(len(factors)):
        to, start = parts[5 * part], parts[5 * part + 1]
        factor = factors[part]
        for _ in range(parts[5 * part + 4]):
            factor *= h
        for i in range(parts[5 * part + 2]):
            for j in range(parts[5 * part + 3]):
                matrix[to + i * size + j] -= factor * jacobians[start + i * n + j]


STAGNATION = 2.0**-39
"""Relative change below which an iteration without progress has converged, ε^(3/4)."""
STALLS = 8
"""Iterations without progress after which rounding errors of the state may explain the changes."""
BITS_OF_INFINITY = 0x7FF0000000000000


@inlined_as(TRUTH, WHOLE)
def failed(change):
    """Whether a change is infinite or nan."""
    return change >= BITS_OF_INFINITY


@inlined_as(TRUTH, WHOLE, WHOLE, DOUBLE)
def falls(change, before, factor):
    """Whether a change has fallen by more than a factor."""
    return factor * value_of(change) < value_of(before)


@inlined_as(WHOLE, DOUBLES, WHOLE, WHOLE)
def largest(values, first, end):
    """The bits of the largest absolute value."""
    found = 0
    for i in range(first, end):
        found = max(found, bits(abs(values[i])))
    return found


@inlined_as(TRUTH, WHOLE, WHOLE, DOUBLE, DOUBLES, WHOLE, WHOLE)
def negligible(change, size, h, y, first, end):
    """Whether a change of stage derivatives is small relative to their size or to y / h."""
    scale = max(abs(h) * value_of(size), value_of(largest(y, first, end)))
    return abs(h) * value_of(change) <= STAGNATION * scale


@inlined_as(TRUTH, WHOLE, DOUBLE, DOUBLES, WHOLE)
def within_rounding(change, h, y, end):
    """Whether rounding errors of the whole state explain a change of stage derivatives.

    The last bit of an angle near 10⁴ periods changes derivatives of size 1. As the iteration contracts, h times such a
    change is about the last bit of the state; the bound is the same for all blocks of variables.
    """
    return abs(h) * value_of(change) <= STAGNATION * value_of(largest(y, 0, end))
