"""Kernels that evaluate the terms of a B-series on a scene at several points, by derivative tensors.

The same machine code serves every scene, method and order: `ints` and `numbers` hold all tables, which
`differential_tables` builds. Rows of sites (or points) are computed in SIMD groups of `lanes`, and indices in the
workspace `A` count groups. The interpreter runs the same source on other numbers, with other elementary functions in
place of those of `math`, for any precision.
"""

from __future__ import annotations

from functools import cached_property, partial
from math import acos, acosh, asin, asinh, atan, atanh, cos, cosh, erf, exp, log, sin, sinh, sqrt
from typing import Any

import numpy as np
from numba import carray  # pyright: ignore[reportPrivateImportUsage]

from bseries.fields import taylor_polynomials
from bseries.fields.taylor_polynomials import (
    ADD,
    ARGUMENT,
    CIRCULAR,
    CONSTANT,
    DATUM,
    EXP,
    HYPERBOLIC,
    INTEGRAL,
    MULTIPLY,
    POWER,
    SCALE,
    SHIFT,
)
from bseries_base.kernels import Kernel, float_kernel
from bseries_base.lowering import SOURCES
from bseries_base.lowering.units import lowered

COUNTS = ORDER, TERMS, LOCALS, POLYNOMIALS, TENSORS, FIELDS, DIMENSION = range(7)
"""The first entries of `ints`: sizes, and the offsets of local variables, polynomials and tensors in the workspace."""
TABLES = (
    TERM, DIFFERENCE, INSTRUCTION, PRODUCT, RAISED, LEVEL, CONTRACTION, DIRECTION, USE, CHILD_LEVEL, CHILD, OUTPUT,
    PLACE,
) = range(7, 20)  # fmt: skip
"""The tables in `ints`, whose offsets follow the counts.

- difference: 1 for a local variable that is a difference, 0 for others
- instruction: operation, result, operands, first product, end, first factor
- product: α, β, γ with x^α = x^β x^γ, by |α|; raised: x^α x_l
- level, child_level: offsets of contractions and children by order
- contraction: left, own, size, child, first direction, end, first use, end
- use: 0 or 1 + the child, first output, end
- output: monomial, 0 if negative
- place: for each row of sites the places in the state of the local variables (and of what is subtracted, or the same
  again) and of the outputs, and those of the data in `numbers`
"""
NUMBER_TABLES = DATUM_VALUE, NUMBER, FACTOR, FACTORIAL, WEIGHT = range(20, 25)
"""The tables in `numbers`; their offsets follow in `ints`."""
# The columns of a term: its rows of sites; its ranges in other tables; the polynomial of its formula, with its degree,
# size and offsets of index tables; the numbers of groups of its tensors without and with the fields of children.
TERM_COLUMNS = (
    T_ROWS, T_PLACE, T_ARGUMENT, T_ARGUMENT_END, T_DATA, T_INSTRUCTION, T_INSTRUCTION_END, T_RESULT, T_DEGREE, T_SIZE,
    T_RAISED, T_FACTORIAL, T_SLOTS, T_GROUPS, T_OUTPUT, T_OUTPUT_END, T_LEVEL, T_CHILD,
) = range(18)  # fmt: skip


class LoweredKernel(Kernel):
    """A kernel without a return value, whose callees are lowered kernels too (see `bseries_base.lowering`)."""

    @cached_property
    def compiled(self) -> Any:
        """The kernel as a numba intrinsic."""
        return lowered()(self.py_func)


numba_kernel = partial(float_kernel, sources=(taylor_polynomials, *SOURCES))

ZERO, ONE, TWO = np.uint64(0), np.uint64(1), np.uint64(2)
TERM_ROW, INSTRUCTION_ROW, CONTRACTION_ROW = np.uint64(len(TERM_COLUMNS)), np.uint64(7), np.uint64(8)  # widths of rows


@LoweredKernel
def multiply(A, ints, result, a, b, first, last, lanes):
    """Add the product of two polynomials to a third."""
    product = ints[PRODUCT]
    for k in range(first, last):
        at = product + k + TWO * k
        i, x, y = (result + ints[at]) * lanes, (a + ints[at + ONE]) * lanes, (b + ints[at + TWO]) * lanes
        for w in range(lanes):
            A[i + w] += A[x + w] * A[y + w]


@LoweredKernel
def multiply_scaled(A, ints, numbers, result, a, b, first, last, factor, lanes):
    """Add the product of two polynomials, scaled term by term; b may be the result, whose lower degrees are known."""
    product = ints[PRODUCT]
    for k in range(first, last):
        at = product + k + TWO * k
        i, x, y = (result + ints[at]) * lanes, (a + ints[at + ONE]) * lanes, (b + ints[at + TWO]) * lanes
        scale = numbers[factor + k - first]
        for w in range(lanes):
            A[i + w] += scale * A[x + w] * A[y + w]


@LoweredKernel
def multiply_crosswise(A, ints, numbers, result, pair, a, first, last, factor, sign, lanes):
    """Compute sin and cos, or sinh and cosh, from each other's derivatives."""
    product = ints[PRODUCT]
    for k in range(first, last):
        at = product + k + TWO * k
        i, j = (result + ints[at]) * lanes, (pair + ints[at]) * lanes
        x = (a + ints[at + ONE]) * lanes
        y, z = (result + ints[at + TWO]) * lanes, (pair + ints[at + TWO]) * lanes
        scale = numbers[factor + k - first]
        for w in range(lanes):
            A[i + w] += scale * A[x + w] * A[z + w]
        for w in range(lanes):
            A[j + w] += sign * scale * A[x + w] * A[y + w]


@LoweredKernel
def evaluate_centre(A, operation, number, halves, result, a, pair, lanes):
    """Evaluate a function at the centre of a polynomial; the exponent of a power is `halves`/2 if that is not 0."""
    for w in range(lanes):
        x = A[a * lanes + w]
        at = result * lanes + w
        if operation == POWER and halves != ZERO:
            x = x if halves % TWO == ZERO else sqrt(x)
            power = x
            for _ in range(ONE, halves if halves % TWO != ZERO else halves // TWO):
                power *= x
            A[at] = power if number > 0 else 1 / power
        elif operation == POWER:
            A[at] = x**number
        elif operation == EXP:
            A[at] = exp(x)
        elif operation == CIRCULAR:
            A[at] = sin(x)
            A[pair * lanes + w] = cos(x)
        elif operation == HYPERBOLIC:
            A[at] = sinh(x)
            A[pair * lanes + w] = cosh(x)
        elif number == 0:
            A[at] = log(x)
        elif number == 1:
            A[at] = asin(x)
        elif number == 2:
            A[at] = acos(x)
        elif number == 3:
            A[at] = atan(x)
        elif number == 4:
            A[at] = asinh(x)
        elif number == 5:
            A[at] = acosh(x)
        elif number == 6:
            A[at] = atanh(x)
        else:
            A[at] = erf(x)


@LoweredKernel
def evaluate_function(A, ints, numbers, operation, number, halves, result, a, b, size, first, last, factor, lanes):
    """Evaluate a function of a truncated Taylor polynomial, degree by degree, from its differential equation."""
    pair = result + size
    evaluate_centre(A, operation, number, halves, result, a, pair, lanes)
    if operation == POWER:
        for w in range(lanes):
            A[pair * lanes + w] = 1 / A[a * lanes + w]
        for k in range(ONE, size):
            for w in range(lanes):
                A[(pair + k) * lanes + w] = A[(a + k) * lanes + w] * A[pair * lanes + w]
        multiply_scaled(A, ints, numbers, result, pair, result, first, last, factor, lanes)
    elif operation == EXP:
        multiply_scaled(A, ints, numbers, result, a, result, first, last, factor, lanes)
    elif operation == INTEGRAL:
        multiply_scaled(A, ints, numbers, result, a, b, first, last, factor, lanes)
    else:
        sign = -1 if operation == CIRCULAR else 1
        multiply_crosswise(A, ints, numbers, result, pair, a, first, last, factor, sign, lanes)


@LoweredKernel
def evaluate_polynomials(A, ints, numbers, term, polynomials, x, lanes):
    """Run the instructions of a term's formula; the local variables are at `x`, followed by the data."""
    size, degree = ints[term + T_SIZE], ints[term + T_DEGREE]
    variables = ints[term + T_ARGUMENT_END] - ints[term + T_ARGUMENT]
    length = size * lanes
    for s in range(ints[term + T_INSTRUCTION], ints[term + T_INSTRUCTION_END]):
        row = ints[INSTRUCTION] + s * INSTRUCTION_ROW
        operation, first, number = ints[row], ints[row + TWO], numbers[ints[NUMBER] + s]
        result, a = polynomials + ints[row + ONE] * size, polynomials + first * size
        b = polynomials + ints[row + 3] * size
        begin, end = ints[row + 4], ints[row + 5]
        r, u, v = result * lanes, a * lanes, b * lanes
        if operation == ADD:
            for i in range(length):
                A[r + i] = A[u + i] + A[v + i]
        elif operation == SCALE:
            for i in range(length):
                A[r + i] = number * A[u + i]
        elif operation == SHIFT:
            for i in range(length):
                A[r + i] = A[u + i]
            for w in range(lanes):
                A[r + w] += number
        else:
            for i in range(length + length if operation in (CIRCULAR, HYPERBOLIC) else length):
                A[r + i] = 0
            if operation == CONSTANT:
                for w in range(lanes):
                    A[r + w] = number
            elif operation == DATUM:
                for w in range(lanes):
                    A[r + w] = A[(x + variables + first) * lanes + w]
            elif operation == ARGUMENT:
                for w in range(lanes):
                    A[r + w] = A[(x + first) * lanes + w]
                    if degree != ZERO:
                        A[r + (first + ONE) * lanes + w] = 1
            elif operation == MULTIPLY:
                multiply(A, ints, result, a, b, begin, end, lanes)
            else:
                halves, factor = ints[row + 3], ints[FACTOR] + ints[row + 6]
                evaluate_function(
                    A, ints, numbers, operation, number, halves, result, a, b, size, begin, end, factor, lanes
                )


@LoweredKernel
def list_places(A, ints, numbers, term, points, row, data, places, place, lanes):
    """List the places of a group of rows of all points, beginning with `row`, and gather their data."""
    rows, dimension = ints[term + T_ROWS], ints[DIMENSION]
    count = TWO * (ints[term + T_ARGUMENT_END] - ints[term + T_ARGUMENT])
    count += ints[term + T_OUTPUT_END] - ints[term + T_OUTPUT]
    first, shift, site = ints[PLACE] + ints[term + T_PLACE], row // rows * dimension, row % rows
    for w in range(lanes):
        at = first + site * (count + ints[term + T_DATA])
        for k in range(count):
            places[(place + k) * lanes + w] = shift + ints[at + k]
        for k in range(ints[term + T_DATA]):
            A[(data + k) * lanes + w] = numbers[ints[DATUM_VALUE] + ints[at + count + k]]
        if row + w + ONE < points * rows:  # otherwise the last row fills the group up
            site += ONE
            if site == rows:
                site = ZERO
                shift += dimension


@LoweredKernel
def gather(A, ints, values, vector, to, first, last, places, place, lanes):
    """Gather the local variables of a group of rows from one vector."""
    for k in range(first, last):
        at, plus = (to + k - first) * lanes, (place + TWO * (k - first)) * lanes
        if ints[ints[DIFFERENCE] + k] == ZERO:
            for w in range(lanes):
                A[at + w] = values[vector, places[plus + w]]
        else:
            for w in range(lanes):
                A[at + w] = values[vector, places[plus + w]] - values[vector, places[plus + lanes + w]]


@LoweredKernel
def scatter(A, entry, positive, values, vector, rows, places, place, lanes):
    """Add one output of a tensor, or of a sum of tensors, to one vector."""
    if positive != ZERO:
        for w in range(rows):
            values[vector, places[place * lanes + w]] += A[entry * lanes + w]
    else:
        for w in range(rows):
            values[vector, places[place * lanes + w]] -= A[entry * lanes + w]


@LoweredKernel
def contract(A, ints, left, own, size, child, variables, shape, first, last, lanes):
    """Contract T_r(u ∘ v) = T_{r+1}(u) · F(v) for all stored ranks r, along the variables in the support of F(v)."""
    directions = ints[DIRECTION]
    for k in range(size):
        i, row = (own + k) * lanes, shape + k * variables
        x, y = (left + ints[row + ints[directions + first]]) * lanes, (child + ints[directions + first]) * lanes
        for w in range(lanes):
            A[i + w] = A[x + w] * A[y + w]
        for m in range(first + ONE, last):
            x, y = (left + ints[row + ints[directions + m]]) * lanes, (child + ints[directions + m]) * lanes
            for w in range(lanes):
                A[i + w] += A[x + w] * A[y + w]


@LoweredKernel
def begin_group(A, ints, numbers, term, y, base, points, row, places, place, lanes):
    """Compute the tensors of the single node: all derivatives of the term's formula."""
    x, polynomials, size = ints[LOCALS], ints[POLYNOMIALS], ints[term + T_SIZE]
    first, last = ints[term + T_ARGUMENT], ints[term + T_ARGUMENT_END]
    list_places(A, ints, numbers, term, points, row, x + last - first, places, place, lanes)
    gather(A, ints, y, ZERO, x, first, last, places, place, lanes)
    evaluate_polynomials(A, ints, numbers, term, polynomials, x, lanes)
    result = polynomials + ints[term + T_RESULT] * size
    for k in range(size):
        scale = numbers[ints[FACTORIAL] + ints[term + T_FACTORIAL] + k]
        for w in range(lanes):
            A[(base + k) * lanes + w] = scale * A[(result + k) * lanes + w]


@LoweredKernel
def sweep_group(A, ints, numbers, term, n, out, fields, base, rows, places, place, lanes):
    """Evaluate the trees with n nodes for one group of rows of one term."""
    begin, end = ints[term + T_ARGUMENT], ints[term + T_ARGUMENT_END]
    variables, shape = end - begin, ints[RAISED] + ints[term + T_RAISED]
    children, by_order = base + ints[term + T_SLOTS], ints[CHILD_LEVEL] + ints[term + T_CHILD]
    for c in range(ints[by_order + n - ONE], ints[by_order + n]):
        to = children + (c - ints[by_order]) * variables
        gather(A, ints, fields, ints[ints[CHILD] + c], to, begin, end, places, place, lanes)
    first, stop = ints[term + T_OUTPUT], ints[term + T_OUTPUT_END]
    goal = place + TWO * variables - first
    for i in range((stop - first) * lanes):
        A[i] = 0  # the workspace begins with the sums of tensors, one for each output
    level = ints[LEVEL] + ints[term + T_LEVEL] + n
    for s in range(ints[level - ONE], ints[level]):
        row = ints[CONTRACTION] + CONTRACTION_ROW * s
        left, own, size = base + ints[row], base + ints[row + ONE], ints[row + TWO]
        child = children + ints[row + 3] * variables
        contract(A, ints, left, own, size, child, variables, shape, ints[row + 4], ints[row + 5], lanes)
        for use in range(ints[row + 6], ints[row + 7]):
            at = ints[USE] + use + TWO * use
            target, weight = ints[at], numbers[ints[WEIGHT] + use]
            for output in range(ints[at + ONE], ints[at + TWO]):
                traits = ints[OUTPUT] + TWO * output
                entry = own + ints[traits]
                if target != ZERO:
                    scatter(A, entry, ints[traits + ONE], fields, target - ONE, rows, places, goal + output, lanes)
                else:
                    i, x = (output - first) * lanes, entry * lanes
                    for w in range(lanes):
                        A[i + w] += weight * A[x + w]
    for output in range(first, stop):
        positive = ints[ints[OUTPUT] + TWO * output + ONE]
        scatter(A, output - first, positive, out, n - ONE, rows, places, goal + output, lanes)


@LoweredKernel
def sweep(y, out, fields, A, places, points, ints, numbers, lanes):
    """Add Σ_{|τ|=n} weight(τ) F(τ)(y) to out[n − 1], for n = 1 … order.

    `y` is one row with all points. `fields` has a row for each child and `out` one for each order, both initially
    zero; `places` is filled here.
    """
    for n in range(ONE, ints[ORDER] + ONE):
        base, place = ints[TENSORS], ZERO
        for t in range(ints[TERMS]):
            term = ints[TERM] + TERM_ROW * t
            row, last = ZERO, points * ints[term + T_ROWS]
            while row < last:
                if n == ONE:
                    begin_group(A, ints, numbers, term, y, base, points, row, places, place, lanes)
                sweep_group(A, ints, numbers, term, n, out, fields, base, min(lanes, last - row), places, place, lanes)
                row += lanes
                base += ints[term + T_GROUPS]
                place += TWO * (ints[term + T_ARGUMENT_END] - ints[term + T_ARGUMENT])
                place += ints[term + T_OUTPUT_END] - ints[term + T_OUTPUT]


@numba_kernel
def workspace(ints, points, lanes):
    """Workspace for a number of points: groups of numbers, groups of indices."""
    groups, entries = ints[TENSORS], ZERO
    for t in range(ints[TERMS]):
        term = ints[TERM] + TERM_ROW * t
        count = (points * ints[term + T_ROWS] + lanes - ONE) // lanes
        groups += count * ints[term + T_GROUPS]
        entries += count * (TWO * (ints[term + T_ARGUMENT_END] - ints[term + T_ARGUMENT]))
        entries += count * (ints[term + T_OUTPUT_END] - ints[term + T_OUTPUT])
    return groups, entries


@numba_kernel
def evaluate_many(y, out, chunk, ints, numbers, lanes):
    """Evaluate the terms at many points, in chunks: `y` has a row for each point, `out` for each order and point."""
    dimension, points = y.shape[1], np.uint64(chunk)
    groups, entries = workspace(ints, points, lanes)
    A, places = np.empty(groups * lanes), np.empty(entries * lanes, np.uint64)
    fields = np.empty((ints[FIELDS], chunk * dimension))
    terms, some = np.empty((out.shape[0], chunk * dimension)), np.empty((1, chunk * dimension))
    for first in range(0, y.shape[0], chunk):
        size = min(chunk, y.shape[0] - first)
        fields[:], terms[:] = 0, 0
        for k in range(size * dimension):
            some[0, k] = y[first + k // dimension, k % dimension]
        sweep(some, terms, fields, A, places, np.uint64(size), ints, numbers, lanes)
        for n in range(out.shape[0]):
            for k in range(size * dimension):
                out[n, first + k // dimension, k % dimension] = terms[n, k]


@numba_kernel
def evaluate_pointers(y, out, points, dimension, order, chunk, lanes, ints, size, numbers, length):
    """`evaluate_many` on pointers to contiguous arrays."""
    states, terms = carray(y, (points, dimension)), carray(out, (order, points, dimension))
    evaluate_many(states, terms, chunk, carray(ints, (size,)), carray(numbers, (length,)), np.uint64(lanes))
