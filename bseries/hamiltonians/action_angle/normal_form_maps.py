"""Compiled change of variables b = a − ∇_θ S(b, θ), φ = θ + ∇_b S(b, θ), in both directions.

The implicit equation, for b or for θ, is solved by Newton's method. S and its derivatives are Fourier sums with
polynomial coefficients, stored in tables: a row of `rows` is a coefficient of S, or of one of its derivatives in the
actions, with a mode, a flag for sines, and a range of monomials. A monomial is a number times some entries of `powers`,
the powers of ε and of the generators of the coefficients. Only the generators need code of their own, a C function, so
that the kernels are compiled once.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from itertools import accumulate, chain
from math import cos, sin
from types import ModuleType
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numba import carray, types  # pyright: ignore[reportPrivateImportUsage]

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.sparse_polynomials import exponents
from integrators.compile import machine
from integrators.compile.machine import call_observer, pointer
from integrators.compile.modules import load_module
from integrators.compile.printer import indented, source_lines
from integrators.steppers.kernels import linear_algebra
from integrators.steppers.kernels.linear_algebra import factorize, solve
from trees.compiled import float_kernel

if TYPE_CHECKING:
    import numpy as np

    from bseries.hamiltonians.action_angle.elimination import Elimination
    from bseries.hamiltonians.action_angle.fourier import FourierPolynomial, FourierRing, Mode
    from integrators.scenes.model.blocks import Block

    Rows: TypeAlias = dict[Mode, list[tuple[float, tuple[tuple[int, int], ...]]]]


MODULE = '''\
"""A change of variables by a generating function S(b, theta); see `normal_form_maps`."""

from math import *

import numpy as np
from foundation.machine_code import cfunc
from numba import njit, types

from bseries.hamiltonians.action_angle.normal_form_maps import mapping
from integrators.compile.machine import DOUBLES, OPTIONS

ints = np.array({ints}, np.int64)
numbers = np.array({numbers}, np.float64)


@cfunc(types.void(types.float64, DOUBLES, DOUBLES), **OPTIONS)
def generators(eps, b, out):
    """Generators of the coefficients."""
{lines}


map_points, address = mapping(), generators.address


@njit(**OPTIONS)
def to_normal(y, eps, out):
    """From (a, theta) to (b, phi); arrays are contiguous."""
    if y.size != {dimension} or out.size != {dimension}:
        raise ValueError("y and out must have {dimension} entries")
    map_points(0, y.ctypes, eps, out.ctypes, 1, address, ints.ctypes, ints.size, numbers.ctypes)


@njit(**OPTIONS)
def from_normal(y, eps, out):
    """From (b, phi) to (a, theta); arrays are contiguous."""
    if y.size != {dimension} or out.size != {dimension}:
        raise ValueError("y and out must have {dimension} entries")
    map_points(1, y.ctypes, eps, out.ctypes, 1, address, ints.ctypes, ints.size, numbers.ctypes)
'''

EPS = -1
"""The index of ε among the generators."""


def compiled_maps(elimination: Elimination, layout: Sequence[Block], parameter: str) -> ModuleType:
    """The module with both maps; see `NormalForm.compiled`."""
    fourier = elimination.fourier
    size = len(fourier.actions)
    kinds = [_rows(fourier, elimination.generating, i) for i in (None, *range(size))]
    largest = _largest_exponents(kinds)
    ints, numbers = _tables(kinds, largest, size)
    source = MODULE.format(
        ints=[*(block.offset for block in layout), *ints],
        numbers=numbers,
        lines="\n".join(indented(_generator_lines(fourier, largest, parameter))),
        dimension=2 * size,
    )
    return load_module(source, helpers=[__file__])


def map_states(maps: ModuleType, is_back: bool, states: np.ndarray, eps: float, out: np.ndarray) -> None:
    """Map the rows of `states` to the rows of `out`, by a module made by `compiled_maps`."""
    function = maps.map_points
    y, image, ints, numbers = (
        array.ctypes.data_as(function.argtypes[k])
        for k, array in ((1, states), (3, out), (6, maps.ints), (8, maps.numbers))
    )
    function(is_back, y, eps, image, len(states), maps.address, ints, maps.ints.size, numbers)


def _rows(fourier: FourierRing, generating: Sequence[FourierPolynomial], i: int | None) -> Rows:
    """The monomials by mode of S, or of its derivative in the i-th action."""
    rows: Rows = defaultdict(list)
    for n, term in enumerate(generating):
        for mode, x in (term if i is None else fourier.along_action(term, i)).items():
            for monomial, number in x.terms.items():
                rows[mode].append((float(number), ((EPS, n), *exponents(monomial))))
    return rows


def _largest_exponents(kinds: Iterable[Rows]) -> dict[int, int]:
    """The largest exponent of each generator, with ε first."""
    largest = {EPS: 1}
    for _, powers in (monomial for rows in kinds for row in rows.values() for monomial in row):
        for generator, exponent in powers:
            largest[generator] = max(exponent, largest.get(generator, 0))
    return dict(sorted(largest.items()))


def _generator_lines(fourier: FourierRing, largest: Iterable[int], parameter: str) -> list[str]:
    """Statements that compute the generators."""
    import sympy

    eps, known = sympy.Symbol(parameter), fourier.coefficients.generators
    formulas = [eps if k == EPS else known[k] for k in largest]
    names = {symbol: f"b[{i}]" for i, symbol in enumerate(fourier.actions)} | {eps: "eps"}
    unknown = sorted({str(symbol) for formula in formulas for symbol in formula.free_symbols - names.keys()})
    if unknown:
        raise SeriesError(f"scene must have numbers for its parameters in compiled maps, but not for {unknown[0]}")
    return source_lines([(f"out[{k}]", formula) for k, formula in enumerate(formulas)], names)


def _tables(kinds: Sequence[Rows], largest: Mapping[int, int], size: int) -> tuple[list[int], list[float]]:
    """The tables of the kernels, after the offsets."""
    modes = {k: None for rows in kinds for k, _ in rows}
    index = {k: at for at, k in enumerate(modes)}
    first_power = dict(zip(largest, accumulate(largest.values(), initial=0), strict=False))
    rows: list[tuple[int, ...]] = []
    factors: list[list[int]] = []
    numbers: list[float] = []
    for (k, is_sine), monomials in (row for kind in kinds for row in kind.items()):
        rows.append((index[k], int(is_sine), len(numbers), len(numbers) + len(monomials)))
        for number, powers in monomials:
            numbers.append(number)
            factors.append([first_power[generator] + exponent - 1 for generator, exponent in powers])
    tables = [
        [size, len(rows), len(modes), len(largest), len(numbers)],
        accumulate(map(len, kinds), initial=0),
        chain.from_iterable(rows),
        chain.from_iterable(modes),
        accumulate(largest.values(), initial=0),
        accumulate(map(len, factors), initial=0),
        chain.from_iterable(factors),
    ]
    return [*chain.from_iterable(tables)], numbers


COLUMNS = 4
MODE, IS_SINE, FIRST_MONOMIAL, LAST_MONOMIAL = range(COLUMNS)
"""The columns of `rows`."""
HEADER = 7
"""The number of integers before the tables."""

MOST_ITERATIONS = 200
SMALLEST_SHARE = 2.0**-8
"""The smallest step of the continuation in S."""
CONVERGED = 1e-8
"""Newton's method has converged if its step is smaller; it continues until steps no longer decrease."""

solver = partial(float_kernel, sources=(machine, linear_algebra))


@float_kernel
def find_powers(generators, first_power, powers):
    """Compute the powers of every generator, from 1 on; those of the k-th begin at first_power[k]."""
    for k in range(len(generators)):
        x = 1.0
        for at in range(first_power[k], first_power[k + 1]):
            x *= generators[k]
            powers[at] = x


@float_kernel
def find_coefficients(first, last, rows, first_factor, factors, numbers, powers, coefficients):
    """Compute the coefficients of a range of rows."""
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
    """Compute cos k·θ and sin k·θ of all modes."""
    for mode in range(len(modes)):
        phase = 0.0
        for i in range(len(theta)):
            phase += modes[mode, i] * theta[i]
        cosines[mode] = cos(phase)
        sines[mode] = sin(phase)


@float_kernel
def angle_gradient(first_row, rows, modes, coefficients, cosines, sines, out):
    """Compute ∇_θ S from the rows of S."""
    for i in range(len(out)):
        out[i] = 0.0
    for row in range(first_row[0], first_row[1]):
        mode = rows[row, MODE]
        value = coefficients[row] * (cosines[mode] if rows[row, IS_SINE] else -sines[mode])
        for i in range(len(out)):
            out[i] += modes[mode, i] * value


@float_kernel
def action_gradient(first_row, rows, coefficients, cosines, sines, out):
    """Compute ∇_b S from the rows of the derivatives."""
    for i in range(len(out)):
        out[i] = 0.0
        for row in range(first_row[i + 1], first_row[i + 2]):
            mode = rows[row, MODE]
            out[i] += coefficients[row] * (sines[mode] if rows[row, IS_SINE] else cosines[mode])


@float_kernel
def mixed_derivatives(first_row, rows, modes, coefficients, cosines, sines, out):
    """Compute the matrix ∂²S/∂θ_i∂b_j from the rows of the derivatives."""
    size = len(first_row) - 2
    out[:] = 0.0
    for j in range(size):
        for row in range(first_row[j + 1], first_row[j + 2]):
            mode = rows[row, MODE]
            value = coefficients[row] * (cosines[mode] if rows[row, IS_SINE] else -sines[mode])
            for i in range(size):
                out[i, j] += modes[mode, i] * value


@solver
def newton_step(x, origin, share, gradient, matrix, pivots, step):
    """Take a Newton step for x + share · g(x) = origin; returns its size, relative for entries beyond 1.

    Args:
        x: The unknowns, changed in place.
        origin: The solution for the share 0.
        share: A number from 0 to 1.
        gradient: The vector g(x).
        matrix: The matrix g'(x), which is overwritten.
        pivots: Workspace of the size of x.
        step: Workspace of the size of x.
    """
    size = len(x)
    for i in range(size):
        step[i] = x[i] + share * gradient[i] - origin[i]
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
    """Map (a, θ) to (b, φ), or back; the result is nan where Newton's method does not converge.

    The equations have other solutions far away. The wanted solution is the continuation of the identity in a share of S
    from 0 to 1. The increment of the share is halved until each Newton step is at most half of the previous one. If the
    continuation fails, plain Newton steps are tried.

    Args:
        is_back: Whether (b, φ) is given.
        y: The point.
        eps: The value of ε.
        out: The image.
        actions: The offset of the actions in a point.
        angles: The offset of the angles.
        generators: The address of a C function void (double ε, double *b, double *out).
        tables: The tables first_row, rows, modes, first_power, first_factor, factors, numbers.

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
        angle_gradient(first_row, rows, modes, coefficients, cosines, sines, along_angles)
        action_gradient(first_row, rows, coefficients, cosines, sines, along_actions)
        if reached == 1.0:
            break
        mixed_derivatives(first_row, rows, modes, coefficients, cosines, sines, mixed)
        for i in range(size):
            for j in range(size):
                matrix[i, j] = mixed[j, i] if is_back else mixed[i, j]
        gradient, last, share = along_actions if is_back else along_angles, moved, min(1.0, reached + width)
        moved = newton_step(x, origin, share, gradient, matrix, pivots, step)
        if moved == 0.0 or moved >= last < CONVERGED:
            reached, width, moved, known[:] = share, 2.0 * width, np.inf, x
        elif last >= CONVERGED and not moved <= growth * last:
            if width > SMALLEST_SHARE:
                width, x[:] = width / 2.0, known
            else:
                reached, width, growth, x[:], known[:] = 0.0, 1.0, np.inf, origin, origin
            moved = np.inf
    for i in range(size):
        out[actions + i] = b[i] + is_back * along_angles[i] if reached == 1.0 else np.nan
        out[angles + i] = theta[i] + (not is_back) * along_actions[i] if reached == 1.0 else np.nan


@solver
def map_pointers(is_back, y, eps, out, points, generators, ints, length, numbers):
    """Map points given by pointers; `y` and `out` have a row for each point.

    `ints` begins with the offsets of actions and angles, and the numbers of degrees of freedom, rows, modes, generators
    and monomials; then all tables but `numbers` follow.
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
    """The kernel `map_pointers` as a C function."""
    reals, whole = machine.DOUBLES, types.int64
    return map_pointers.c_function(
        types.void(types.int64, reals, types.float64, reals, whole, whole, types.CPointer(whole), whole, reals)
    )
