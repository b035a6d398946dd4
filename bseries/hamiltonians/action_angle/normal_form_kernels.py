"""Compiled: the change of variables b = a − ∇_θ S(b, θ), φ = θ + ∇_b S(b, θ) by a generating function, both ways.

S and its derivatives are Fourier sums with polynomials for coefficients, and all of them is data, in `tables`: a row of
`rows` is a coefficient of S, or of one of its derivatives with respect to the actions: it has a mode, a flag that tells
sines from cosines, and a range of monomials. A monomial is a number times some entries of `powers`, which holds the
powers of all generators of the coefficients, and of ε. Only the generators are functions of their own: they come as the
address of a C function, so that these kernels are compiled once for all.
"""

from __future__ import annotations

from functools import cache, partial
from math import cos, sin

import numpy as np
from numba import carray, types  # pyright: ignore[reportPrivateImportUsage]

from integrators.compile import machine
from integrators.compile.machine import call_observer, pointer
from integrators.steppers.kernels import linear_algebra
from integrators.steppers.kernels.linear_algebra import factorize, solve
from trees.compiled import float_kernel

COLUMNS = 4
MODE, IS_SINE, FIRST_MONOMIAL, LAST_MONOMIAL = range(COLUMNS)
"""The columns of `rows`."""
HEADER = 7
"""Whole numbers before the tables."""

MOST_ITERATIONS = 200
NARROWEST = 2.0**-8
"""Shares of S are followed in steps down to this one."""
SETTLED = 1e-8
"""Newton's method has converged where it moves by less; it goes on until it comes no nearer."""

solver = partial(float_kernel, sources=(machine, linear_algebra))


@float_kernel
def find_powers(generators, first_power, powers):
    """The powers of every generator, from 1 on; those of the k-th begin at first_power[k]."""
    for k in range(len(generators)):
        x = 1.0
        for at in range(first_power[k], first_power[k + 1]):
            x *= generators[k]
            powers[at] = x


@float_kernel
def find_coefficients(first, last, rows, first_factor, factors, numbers, powers, coefficients):
    """The coefficients of some rows."""
    for row in range(first, last):
        total = 0.0
        for monomial in range(rows[row, FIRST_MONOMIAL], rows[row, LAST_MONOMIAL]):
            x = numbers[monomial]
            for k in range(first_factor[monomial], first_factor[monomial + 1]):
                x *= powers[factors[k]]
            total += x
        coefficients[row] = total


@float_kernel
def find_waves(theta, modes, cosines, sines):
    """cos k·θ and sin k·θ of all modes."""
    for mode in range(len(modes)):
        phase = 0.0
        for i in range(len(theta)):
            phase += modes[mode, i] * theta[i]
        cosines[mode] = cos(phase)
        sines[mode] = sin(phase)


@float_kernel
def slopes_along_angles(first_row, rows, modes, coefficients, cosines, sines, out):
    """∇_θ S, from the rows of S itself."""
    for i in range(len(out)):
        out[i] = 0.0
    for row in range(first_row[0], first_row[1]):
        mode = rows[row, MODE]
        slope = coefficients[row] * (cosines[mode] if rows[row, IS_SINE] else -sines[mode])
        for i in range(len(out)):
            out[i] += modes[mode, i] * slope


@float_kernel
def slopes_along_actions(first_row, rows, coefficients, cosines, sines, out):
    """∇_b S, from the rows of the derivatives."""
    for i in range(len(out)):
        out[i] = 0.0
        for row in range(first_row[i + 1], first_row[i + 2]):
            mode = rows[row, MODE]
            out[i] += coefficients[row] * (sines[mode] if rows[row, IS_SINE] else cosines[mode])


@float_kernel
def mixed_slopes(first_row, rows, modes, coefficients, cosines, sines, out):
    """∂²S/∂θ_i∂b_j in row i and column j, from the rows of the derivatives."""
    size = len(first_row) - 2
    out[:] = 0.0
    for j in range(size):
        for row in range(first_row[j + 1], first_row[j + 2]):
            mode = rows[row, MODE]
            slope = coefficients[row] * (cosines[mode] if rows[row, IS_SINE] else -sines[mode])
            for i in range(size):
                out[i, j] += modes[mode, i] * slope


@solver
def advance(x, origin, share, slope, matrix, pivots, step):
    """A step of Newton's method for x + share · slope(x) = origin; how far it moves x, relative to numbers beyond 1.

    Args:
        x: The unknowns, changed in place.
        origin: What they are where the share is 0.
        share: A number from 0 to 1.
        slope: slope(x).
        matrix: slope'(x); it is destroyed.
        pivots: Room for as many numbers as there are unknowns.
        step: The same.
    """
    size = len(x)
    for i in range(size):
        step[i] = x[i] + share * slope[i] - origin[i]
        for j in range(size):
            matrix[i, j] *= share
        matrix[i, i] += 1.0
    factorize(pointer(matrix), pointer(pivots), size)
    solve(pointer(matrix), pointer(pivots), size, pointer(step))
    moved = 0.0
    for i in range(size):
        x[i] -= step[i]
        moved += abs(step[i]) / (1.0 + abs(x[i]))
    return moved


@solver
def map_point(is_back, y, eps, out, actions, angles, generators, tables):
    """(a, θ) ↦ (b, φ), or back; nan where Newton's method does not find b, or θ.

    Far solutions solve the same equations. What counts is the one that the identity becomes as S grows from nothing:
    the share of S that is aimed at is halved until each step of Newton's method is at most half of the one before. If
    that one ends on the way, plain steps may find another.

    Args:
        is_back: Whether (b, φ) is given.
        y: The point.
        eps: The value of ε.
        out: Where the image goes.
        actions: Where the actions begin in a point.
        angles: Where the angles begin.
        generators: The address of a C function void (double ε, double *b, double *out).
        tables: first_row, rows, modes, first_power, first_factor, factors, numbers.

    References:
        P. Deuflhard, *Newton Methods for Nonlinear Problems*, section 5.1 (continuation with the monotonicity test).
    """
    first_row, rows, modes, first_power, first_factor, factors, numbers = tables
    size = len(y) // 2
    b, theta = y[actions : actions + size].copy(), y[angles : angles + size].copy()
    x = theta if is_back else b
    origin, known = x.copy(), x.copy()
    along_angles, along_actions, step, pivots = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    mixed, matrix = np.empty((size, size)), np.empty((size, size))
    bases, powers, coefficients = np.empty(len(first_power) - 1), np.empty(first_power[-1]), np.empty(len(rows))
    cosines, sines = np.empty(len(modes)), np.empty(len(modes))
    reached, width, moved, growth = 0.0, 1.0, np.inf, 0.5
    for iteration in range(MOST_ITERATIONS):
        if iteration == 0 or not is_back:
            call_observer(generators, eps, pointer(b), pointer(bases))
            find_powers(bases, first_power, powers)
            find_coefficients(0, len(rows), rows, first_factor, factors, numbers, powers, coefficients)
        if iteration == 0 or is_back:
            find_waves(theta, modes, cosines, sines)
        slopes_along_angles(first_row, rows, modes, coefficients, cosines, sines, along_angles)
        slopes_along_actions(first_row, rows, coefficients, cosines, sines, along_actions)
        if reached == 1.0:
            break
        mixed_slopes(first_row, rows, modes, coefficients, cosines, sines, mixed)
        for i in range(size):
            for j in range(size):
                matrix[i, j] = mixed[j, i] if is_back else mixed[i, j]
        slope, last, share = along_actions if is_back else along_angles, moved, min(1.0, reached + width)
        moved = advance(x, origin, share, slope, matrix, pivots, step)
        if moved == 0.0 or moved >= last < SETTLED:
            reached, width, moved, known[:] = share, 2.0 * width, np.inf, x
        elif last >= SETTLED and not moved <= growth * last:
            if width > NARROWEST:
                width, x[:] = width / 2.0, known
            else:
                reached, width, growth, x[:], known[:] = 0.0, 1.0, np.inf, origin, origin
            moved = np.inf
    for i in range(size):
        out[actions + i] = b[i] + is_back * along_angles[i] if reached == 1.0 else np.nan
        out[angles + i] = theta[i] + (not is_back) * along_actions[i] if reached == 1.0 else np.nan


@solver
def map_pointers(is_back, y, eps, out, points, generators, ints, length, numbers):
    """`map_point` on pointers: `y` and `out` have a row for each of the points.

    `ints` begins with the offsets of actions and angles in a point, and with the numbers of degrees of freedom, rows,
    modes, generators and monomials; then come, one after the other, all tables but `numbers`.
    """
    table = carray(ints, (length,))
    actions, angles, size = table[0], table[1], table[2]
    height, waves, bases, monomials = table[3], table[4], table[5], table[6]
    first_row, at = table[HEADER : HEADER + size + 2], HEADER + size + 2
    rows, at = table[at : at + COLUMNS * height].reshape((height, COLUMNS)), at + COLUMNS * height
    modes, at = table[at : at + size * waves].reshape((waves, size)), at + size * waves
    first_power, at = table[at : at + bases + 1], at + bases + 1
    first_factor, factors = table[at : at + monomials + 1], table[at + monomials + 1 :]
    tables = first_row, rows, modes, first_power, first_factor, factors, carray(numbers, (monomials,))
    states, images = carray(y, (points, 2 * size)), carray(out, (points, 2 * size))
    for k in range(points):
        map_point(is_back, states[k], eps, images[k], actions, angles, generators, tables)


@cache
def mapping():
    """The kernel that maps points, as a C function."""
    reals, whole = machine.DOUBLES, types.int64
    return map_pointers.c_function(
        types.void(types.int64, reals, types.float64, reals, whole, whole, types.CPointer(whole), whole, reals)
    )
