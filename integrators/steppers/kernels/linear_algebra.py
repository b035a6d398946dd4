"""Dense linear algebra on raw pointers, for matrices that are small: there are no calls of LAPACK to pay for."""

from __future__ import annotations

from math import inf, nan

from integrators.compile.machine import compiled


@compiled
def factorize(matrix, pivots, n):
    """Put the factors L and U of a matrix, with rows exchanged, in its place; `pivots` says with which row each was.

    A matrix that has none leads to infinite or undefined numbers.

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
        if not largest < inf:  # what is divided by infinity would be 0, and look like an answer
            matrix[k * n + k] = nan
        inverse = 1.0 / matrix[k * n + k]
        for i in range(k + 1, n):
            factor = matrix[i * n + k] * inverse
            matrix[i * n + k] = factor
            for j in range(k + 1, n):
                matrix[i * n + j] -= factor * matrix[k * n + j]


@compiled
def solve(matrix, pivots, n, x):
    """Put the solution of a linear system in place of its right-hand side x.

    Args:
        matrix: The factors of the matrix.
        pivots: The exchanges of rows.
        n: The number of unknowns.
        x: The right-hand side.
    """
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
    """Add blocks of the product of two n × n matrices: rows, inner indices and columns are ranges."""
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
    """Put I − factor · matrix in place of a matrix."""
    for i in range(n):
        for j in range(n):
            matrix[i * n + j] *= -factor
        matrix[i * n + i] += 1.0


@compiled
def assemble(matrix, size, blocks, n, h, parts, factors):
    """Put I − Σ factor · h^power · block in a matrix.

    Args:
        matrix: The matrix.
        size: The number of its rows.
        blocks: Matrices with n columns, one after the other.
        n: The number of columns.
        h: The step size.
        parts: Five numbers for each summand: where it begins in `matrix` and in `blocks`, its height, its width, and
            the power of h.
        factors: The factor of each summand.
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
                matrix[to + i * size + j] -= factor * blocks[start + i * n + j]
