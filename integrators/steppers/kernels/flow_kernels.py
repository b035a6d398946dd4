"""What flows of pieces of the field cost at run time: products with matrices, growth factors, extrapolation."""

from __future__ import annotations

from math import expm1, inf

from integrators.compile.machine import inlined

TOLERANCE = 2.0**-50
"""The size of the last change, relative to the state."""


@inlined
def add_products(count, rows, starts, columns, heads, tails, x, out):
    """Add A x to out, for a sparse matrix A = heads + tails by rows: the tails are what rounding has taken from A.

    Args:
        count: The number of rows.
        rows: Where each goes.
        starts: Where each begins among the elements, and where the last one ends.
        columns: The column of each element.
        heads: The elements as doubles.
        tails: Their rounding errors, which would have the same effect in every step.
        x: A vector.
        out: Where the products are added.
    """
    for row in range(count):
        total = 0.0
        for k in range(starts[row], starts[row + 1]):
            total += tails[k] * x[columns[k]]
        for k in range(starts[row], starts[row + 1]):  # afterwards: added to the sum of these, tails would be lost
            total += heads[k] * x[columns[k]]
        out[rows[row]] += total


@inlined
def growth(x):
    """φ_1(x) = (e^x − 1)/x."""
    return expm1(x) / x if x != 0.0 else 1.0


@inlined
def begin_flow(count, index, powers, dimension, start, forcing, h, drive, origin, slopes):
    """Note where a flow begins, and what drives it, entry by entry of those that move; no slopes yet."""
    for i in range(count):
        origin[i] = start[index[i]]
        slopes[i] = 0.0
        for j in range(powers):
            drive[j * count + i] = forcing[j * dimension + index[i]] / h


@inlined
def flow_point(count, index, h, first, origin, slopes, before, now, z):
    """The point where the next value of the field is needed."""
    for i in range(count):
        if first:
            before[i] = now[i] = 0.0
        z[index[i]] = origin[i] + h * (slopes[i] + now[i])


@inlined
def midpoint_step(count, index, powers, first, θ, step, time, drive, value, before, now):
    """A step of the explicit midpoint rule, Euler's if it is the first."""
    for i in range(count):
        slope = 0.0
        for j in range(powers - 1, -1, -1):
            slope = slope * θ + drive[j * count + i]
        slope += time * value[index[i]]
        new = before[i] + (step if first else 2.0 * step) * slope
        before[i] = now[i]
        now[i] = new


@inlined
def extrapolate(count, column, h, origin, slopes, now, table):
    """A row of the tableau of Aitken and Neville in powers of 1/n², n = 2, 4, 6, …, over the row before.

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
        size += abs(origin[i] + h * slopes[i]) + abs(h * new)
    return change, size


@inlined
def has_settled(column, change, size):
    """Whether a row of the tableau ends with two numbers that agree; nan does not."""
    return column > 0 and change <= TOLERANCE * size and size < inf


@inlined
def next_interval(position, level):
    """The interval of θ after this one: twice as long, whenever that has not been tried in vain.

    Intervals are [position, position + 1] / 2^level.
    """
    position += 1
    while level > 0 and position % 2 == 0:
        position //= 2
        level -= 1
    return position, level


@inlined
def end_flow(count, index, origin, slopes, start, out):
    """Hand out the slopes, with zeros where nothing moves, and put the start back."""
    for i in range(count):
        start[index[i]] = origin[i]
        out[index[i]] = slopes[i]
