"""Kernels of flows: sparse products, φ_1 of numbers, extrapolation of the midpoint rule."""

from __future__ import annotations

from math import expm1, inf

from integrators.compile.machine import inlined

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
