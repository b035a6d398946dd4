"""Compiled kernels that generated steps call: flows, linear algebra, and stopping criteria of implicit stages.

Linear algebra on pointers has no cost of calls of LAPACK. Changes in stopping criteria are bits of doubles.
"""

from __future__ import annotations

from math import expm1, inf, nan

from integrators.compile.machine import DOUBLE, DOUBLES, TRUTH, WHOLE, bits, compiled, inlined, inlined_as, value_of

TOLERANCE = 2.0**-50
"""Relative size of the last change on convergence."""


@inlined
def add_products(count, rows, starts, columns, heads, tails, x, out):
    """Add A x to out, for a sparse matrix A = heads + tails.

    Args:
        count: The number of rows.
        rows: The index of each row in out.
        starts: The index of the first element of each row, and the number of elements.
        columns: The column of each element.
        heads: The elements as doubles.
        tails: Their rounding errors, which would have the same effect in every step.
        x: A vector.
        out: The vector to which A x is added.
    """
    for row in range(count):
        total = 0.0
        for k in range(starts[row], starts[row + 1]):
            total += tails[k] * x[columns[k]]
        for k in range(starts[row], starts[row + 1]):  # after the tails, which would be lost next to these
            total += heads[k] * x[columns[k]]
        out[rows[row]] += total


@inlined
def growth(x):
    """φ_1(x) = (e^x − 1)/x."""
    return expm1(x) / x if x != 0.0 else 1.0


@inlined
def begin_flow(count, index, powers, dimension, start, forcing, h, drive, origin, means):
    """Gather the start and the forcing of the moving variables, and set the mean derivative to zero."""
    for i in range(count):
        origin[i] = start[index[i]]
        means[i] = 0.0
        for j in range(powers):
            drive[j * count + i] = forcing[j * dimension + index[i]] / h


@inlined
def flow_point(count, index, h, first, origin, means, before, now, z):
    """Compute the point of the next evaluation of the field."""
    for i in range(count):
        if first:
            before[i] = now[i] = 0.0
        z[index[i]] = origin[i] + h * (means[i] + now[i])


@inlined
def midpoint_step(count, index, powers, first, θ, step, time, drive, value, before, now):
    """Make a step of the explicit midpoint rule, or of Euler's method if it is the first."""
    for i in range(count):
        derivative = 0.0
        for j in range(powers - 1, -1, -1):
            derivative = derivative * θ + drive[j * count + i]
        derivative += time * value[index[i]]
        new = before[i] + (step if first else 2.0 * step) * derivative
        before[i] = now[i]
        now[i] = new


@inlined
def extrapolate(count, column, h, origin, means, now, table):
    """Overwrite the row of the Aitken–Neville tableau in powers of 1/n², n = 2, 4, 6, …, by the next one.

    Returns:
        The last change, and the size of the point.
    """
    change = size = 0.0
    for i in range(count):
        new = last = now[i]
        for j in range(column):
            above = table[j * count + i]
            table[j * count + i] = last = new
            new += (new - above) * (column - j) ** 2 / ((column + 1) ** 2 - (column - j) ** 2)
        table[column * count + i] = new
        change = max(change, abs(h * (new - last)))
        size += abs(origin[i] + h * means[i]) + abs(h * new)
    return change, size


@inlined
def has_converged(column, change, size):
    """Whether the last two numbers of a row agree; false for nan."""
    return column > 0 and change <= TOLERANCE * size and size < inf


@inlined
def next_interval(position, level):
    """The next interval [position, position + 1] / 2^level of θ, as long as no failed one contains it."""
    position += 1
    while level > 0 and position % 2 == 0:
        position //= 2
        level -= 1
    return position, level


@inlined
def end_flow(count, index, origin, means, start, out):
    """Scatter the mean derivative to out, and restore the start."""
    for i in range(count):
        start[index[i]] = origin[i]
        out[index[i]] = means[i]


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
