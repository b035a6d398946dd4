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
from integrators.compile.lowering import SOURCES
from integrators.compile.lowering.units import lowered
from trees.compiled import Kernel, float_kernel

EACH, PAIRS, TABLE = range(3)  # kinds of sites: of a particle and its successor, if any; of pairs; from a table

COUNTS = ORDER, TERMS, LOCALS, POLYNOMIALS, TENSORS, FIELDS, DIMENSION = range(7)
"""The first entries of `ints`: sizes, and the offsets of local variables, polynomials and tensors in the workspace."""
TABLES = (
    TERM, SITE, ARGUMENT_ROWS, DATUM_ROWS, INSTRUCTION, PRODUCT, RAISED, LEVEL, CONTRACTION, DIRECTION, USE,
    CHILD_LEVEL, CHILD, OUTPUT,
) = range(7, 21)  # fmt: skip
"""The tables in `ints`, whose offsets follow the counts.

- argument: role, offset, stride, 1 if a difference, role, offset, stride
- datum: role, first number
- instruction: operation, result, operands, first product, end, first factor
- product: α, β, γ with x^α = x^β x^γ, by |α|; raised: x^α x_l
- level, child_level: offsets of contractions and children by order
- contraction: left, own, size, child, first direction, end, first use, end
- use: 0 or 1 + the child, first output, end
- output: monomial, role, offset, stride, 0 if negative
"""
WIDTHS = dict(zip(TABLES, (21, 4, 7, 2, 7, 3, 1, 1, 8, 1, 3, 1, 1, 5), strict=True))
"""The width of a row in each table."""
NUMBER_TABLES = DATUM_VALUE, NUMBER, FACTOR, FACTORIAL, WEIGHT = range(21, 26)
"""The tables in `numbers`; their offsets follow in `ints`."""
# The columns of a term: its sites; its ranges in other tables; the polynomial of its formula, with its degree, size and
# offsets of index tables; the numbers of groups of its tensors without and with the fields of children.
(
    T_KIND, T_COUNT, T_SITE, T_ROWS, T_ARGUMENT, T_ARGUMENT_END, T_DATUM, T_DATUM_END, T_INSTRUCTION, T_INSTRUCTION_END,
    T_RESULT, T_DEGREE, T_SIZE, T_RAISED, T_FACTORIAL, T_SLOTS, T_GROUPS, T_OUTPUT, T_OUTPUT_END, T_LEVEL, T_CHILD,
) = range(WIDTHS[TERM])  # fmt: skip


class LoweredKernel(Kernel):
    """A kernel without a return value, whose callees are lowered kernels too (see `integrators.compile.lowering`)."""

    @cached_property
    def compiled(self) -> Any:
        """The kernel as a numba intrinsic."""
        return lowered()(self.py_func)


numba_kernel = partial(float_kernel, sources=(taylor_polynomials, *SOURCES))

ZERO, ONE, TWO = np.uint64(0), np.uint64(1), np.uint64(2)
ROLES = np.uint64(4)
# Widths of rows, and the offset of the second half of a difference.
TERM_ROW, INSTRUCTION_ROW, ARGUMENT_ROW, OUTPUT_ROW, CONTRACTION_ROW = (
    np.uint64(WIDTHS[table]) for table in (TERM, INSTRUCTION, ARGUMENT_ROWS, OUTPUT, CONTRACTION)
)
SECOND_HALF = np.uint64(4)


@LoweredKernel
def list_sites(ints, term, points, lane, sites, point, lanes):
    """List the site and the point of every row of a term, point by point."""
    kind, count, rows = ints[term + T_KIND], ints[term + T_COUNT], ints[term + T_ROWS]
    for p in range(points):
        i = ZERO
        j = ONE
        for row in range(rows):
            at = lane * ROLES
            point[lane] = p
            lane += ONE
            if kind == TABLE:
                for role in range(ROLES):
                    sites[at + role] = ints[ints[SITE] + (ints[term + T_SITE] + row) * ROLES + role]
            elif kind == PAIRS:
                sites[at] = i
                sites[at + ONE] = j
                j += ONE
                if j == count:
                    i += ONE
                    j = i + ONE
            else:
                sites[at] = row
                sites[at + ONE] = ZERO if row + ONE == count else row + ONE
    # Pad the last group with copies of its last row, whose results are not used.
    while lane % lanes != ZERO:
        point[lane] = point[lane - ONE]
        for role in range(ROLES):
            sites[lane * ROLES + role] = sites[(lane - ONE) * ROLES + role]
        lane += ONE


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
def list_places(ints, term, place, lane, sites, point, places, lanes):
    """List the indices of the local variables and outputs of a group of rows in a vector of all points."""
    dimension = ints[DIMENSION]
    at = place * lanes
    for k in range(ints[term + T_ARGUMENT], ints[term + T_ARGUMENT_END]):
        for half in range(TWO):
            row = ints[ARGUMENT_ROWS] + k * ARGUMENT_ROW + half * SECOND_HALF
            for w in range(lanes):
                site = sites[(lane + w) * ROLES + ints[row]]
                places[at] = point[lane + w] * dimension + ints[row + ONE] + ints[row + TWO] * site
                at += ONE
    for output in range(ints[term + T_OUTPUT], ints[term + T_OUTPUT_END]):
        row = ints[OUTPUT] + OUTPUT_ROW * output + ONE
        for w in range(lanes):
            site = sites[(lane + w) * ROLES + ints[row]]
            places[at] = point[lane + w] * dimension + ints[row + ONE] + ints[row + TWO] * site
            at += ONE


@LoweredKernel
def gather(A, ints, values, vector, to, first, last, places, place, lanes):
    """Gather the local variables of a group of rows from one vector."""
    for k in range(first, last):
        at, plus = (to + k - first) * lanes, (place + TWO * (k - first)) * lanes
        if ints[ints[ARGUMENT_ROWS] + k * ARGUMENT_ROW + 3] == ZERO:
            for w in range(lanes):
                A[at + w] = values[vector, places[plus + w]]
        else:
            for w in range(lanes):
                A[at + w] = values[vector, places[plus + w]] - values[vector, places[plus + lanes + w]]


@LoweredKernel
def gather_data(A, ints, numbers, term, to, lane, sites, lanes):
    """Gather the data of the sites of a group of rows."""
    begin = ints[term + T_DATUM]
    for k in range(begin, ints[term + T_DATUM_END]):
        row = ints[DATUM_ROWS] + TWO * k
        first = ints[DATUM_VALUE] + ints[row + ONE]
        for w in range(lanes):
            A[(to + k - begin) * lanes + w] = numbers[first + sites[(lane + w) * ROLES + ints[row]]]


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
def begin_group(A, ints, numbers, term, y, base, lane, sites, point, places, place, lanes):
    """Compute the tensors of the single node: all derivatives of the term's formula."""
    x, polynomials, size = ints[LOCALS], ints[POLYNOMIALS], ints[term + T_SIZE]
    first, last = ints[term + T_ARGUMENT], ints[term + T_ARGUMENT_END]
    list_places(ints, term, place, lane, sites, point, places, lanes)
    gather(A, ints, y, ZERO, x, first, last, places, place, lanes)
    gather_data(A, ints, numbers, term, x + last - first, lane, sites, lanes)
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
                traits = ints[OUTPUT] + OUTPUT_ROW * output
                entry = own + ints[traits]
                if target != ZERO:
                    scatter(A, entry, ints[traits + 4], fields, target - ONE, rows, places, goal + output, lanes)
                else:
                    i, x = (output - first) * lanes, entry * lanes
                    for w in range(lanes):
                        A[i + w] += weight * A[x + w]
    for output in range(first, stop):
        positive = ints[ints[OUTPUT] + OUTPUT_ROW * output + 4]
        scatter(A, output - first, positive, out, n - ONE, rows, places, goal + output, lanes)


@LoweredKernel
def sweep(y, out, fields, A, sites, point, places, points, ints, numbers, lanes):
    """Add Σ_{|τ|=n} weight(τ) F(τ)(y) to out[n − 1], for n = 1 … order.

    `y` is one row with all points. `fields` has a row for each child and `out` one for each order, both initially
    zero; `sites`, `point` and `places` are filled here.
    """
    for n in range(ONE, ints[ORDER] + ONE):
        lane, base, place = ZERO, ints[TENSORS], ZERO
        for t in range(ints[TERMS]):
            term = ints[TERM] + TERM_ROW * t
            if n == ONE:
                list_sites(ints, term, points, lane, sites, point, lanes)
            last = lane + points * ints[term + T_ROWS]
            while lane < last:
                if n == ONE:
                    begin_group(A, ints, numbers, term, y, base, lane, sites, point, places, place, lanes)
                sweep_group(A, ints, numbers, term, n, out, fields, base, min(lanes, last - lane), places, place, lanes)
                lane += lanes
                base += ints[term + T_GROUPS]
                place += TWO * (ints[term + T_ARGUMENT_END] - ints[term + T_ARGUMENT])
                place += ints[term + T_OUTPUT_END] - ints[term + T_OUTPUT]


@numba_kernel
def workspace(ints, points, lanes):
    """Workspace for a number of points: rows of sites, groups of numbers, groups of indices."""
    rows, groups, entries = ZERO, ints[TENSORS], ZERO
    for t in range(ints[TERMS]):
        term = ints[TERM] + TERM_ROW * t
        count = (points * ints[term + T_ROWS] + lanes - ONE) // lanes
        rows += count * lanes
        groups += count * ints[term + T_GROUPS]
        entries += count * (TWO * (ints[term + T_ARGUMENT_END] - ints[term + T_ARGUMENT]))
        entries += count * (ints[term + T_OUTPUT_END] - ints[term + T_OUTPUT])
    return rows, groups, entries


@numba_kernel
def evaluate_many(y, out, chunk, ints, numbers, lanes):
    """Evaluate the terms at many points, in chunks: `y` has a row for each point, `out` for each order and point."""
    dimension, points = y.shape[1], np.uint64(chunk)
    rows, groups, entries = workspace(ints, points, lanes)
    A, places = np.empty(groups * lanes), np.empty(entries * lanes, np.uint64)
    sites, point = np.empty(rows * ROLES, np.uint64), np.empty(rows, np.uint64)
    fields = np.empty((ints[FIELDS], chunk * dimension))
    terms, some = np.empty((out.shape[0], chunk * dimension)), np.empty((1, chunk * dimension))
    for first in range(0, y.shape[0], chunk):
        size = min(chunk, y.shape[0] - first)
        fields[:], terms[:] = 0, 0
        for k in range(size * dimension):
            some[0, k] = y[first + k // dimension, k % dimension]
        sweep(some, terms, fields, A, sites, point, places, np.uint64(size), ints, numbers, lanes)
        for n in range(out.shape[0]):
            for k in range(size * dimension):
                out[n, first + k // dimension, k % dimension] = terms[n, k]


@numba_kernel
def evaluate_pointers(y, out, points, dimension, order, chunk, lanes, ints, size, numbers, length):
    """`evaluate_many` on pointers to contiguous arrays."""
    states, terms = carray(y, (points, dimension)), carray(out, (order, points, dimension))
    evaluate_many(states, terms, chunk, carray(ints, (size,)), carray(numbers, (length,)), np.uint64(lanes))
