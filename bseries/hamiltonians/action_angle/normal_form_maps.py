"""The change of variables b = a − ∇_θ S(b, θ), φ = θ + ∇_b S(b, θ) compiled, both ways.

The equation that is implicit, for b or for θ, is solved by Newton's method.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate, chain
from types import ModuleType
from typing import TYPE_CHECKING, TypeAlias

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.sparse_polynomials import exponents
from bseries.hamiltonians.action_angle import normal_form_kernels
from integrators.compile.modules import load_module
from integrators.compile.printer import indented, source_lines

if TYPE_CHECKING:
    import numpy as np

    from bseries.hamiltonians.action_angle.elimination import Elimination
    from bseries.hamiltonians.action_angle.fourier import FourierPolynomial, FourierRing, Mode
    from integrators.scenes.model.blocks import Block

    Rows: TypeAlias = dict[Mode, list[tuple[float, tuple[tuple[int, int], ...]]]]

MODULE = '''\
"""A change of variables by a generating function S(b, theta); see `normal_form_kernels`."""

from math import *

import numpy as np
from foundation.machine_code import cfunc
from numba import njit, types

from bseries.hamiltonians.action_angle.normal_form_kernels import mapping
from integrators.compile.machine import DOUBLES, OPTIONS

ints = np.array({ints}, np.int64)
numbers = np.array({numbers}, np.float64)


@cfunc(types.void(types.float64, DOUBLES, DOUBLES), **OPTIONS)
def generators(eps, b, out):
    """What the coefficients are polynomials in."""
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
"""Stands for ε among the numbers of generators."""


def compiled_maps(elimination: Elimination, layout: Sequence[Block], parameter: str) -> ModuleType:
    """The module with both maps; see `NormalForm.compiled`.

    Raises:
        SeriesError: A parameter of the scene is a symbol.
    """
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
    return load_module(source, helpers=[normal_form_kernels])


def map_states(maps: ModuleType, is_back: bool, states: np.ndarray, eps: float, out: np.ndarray) -> None:
    """Map the rows of `states` to the rows of `out`, by a module that `compiled_maps` has made."""
    function = maps.map_points
    y, image, ints, numbers = (
        array.ctypes.data_as(function.argtypes[k])
        for k, array in ((1, states), (3, out), (6, maps.ints), (8, maps.numbers))
    )
    function(is_back, y, eps, image, len(states), maps.address, ints, maps.ints.size, numbers)


def _rows(fourier: FourierRing, generating: Sequence[FourierPolynomial], i: int | None) -> Rows:
    """The coefficients of S, or of its derivative with respect to the i-th action: their monomials by modes."""
    rows: Rows = defaultdict(list)
    for n, term in enumerate(generating):
        for mode, x in (term if i is None else fourier.along_action(term, i)).items():
            for monomial, number in x.terms.items():
                rows[mode].append((float(number), ((EPS, n), *exponents(monomial))))
    return rows


def _largest_exponents(kinds: Iterable[Rows]) -> dict[int, int]:
    """The largest exponent of every generator that occurs; ε comes first."""
    largest = {EPS: 1}
    for _, powers in (monomial for rows in kinds for row in rows.values() for monomial in row):
        for generator, exponent in powers:
            largest[generator] = max(exponent, largest.get(generator, 0))
    return dict(sorted(largest.items()))


def _generator_lines(fourier: FourierRing, largest: Iterable[int], parameter: str) -> list[str]:
    """Statements for the values of the generators."""
    import sympy

    eps, known = sympy.Symbol(parameter), fourier.coefficients.generators
    formulas = [eps if k == EPS else known[k] for k in largest]
    names = {symbol: f"b[{i}]" for i, symbol in enumerate(fourier.actions)} | {eps: "eps"}
    unknown = sorted({str(symbol) for formula in formulas for symbol in formula.free_symbols - names.keys()})
    if unknown:
        raise SeriesError(f"scene must have numbers for its parameters in compiled maps, but not for {unknown[0]}")
    return source_lines([(f"out[{k}]", formula) for k, formula in enumerate(formulas)], names)


def _tables(kinds: Sequence[Rows], largest: Mapping[int, int], size: int) -> tuple[list[int], list[float]]:
    """What the kernels read, after the offsets."""
    modes = {k: None for rows in kinds for k, _ in rows}
    place = {k: at for at, k in enumerate(modes)}
    first_power = dict(zip(largest, accumulate(largest.values(), initial=0), strict=False))
    rows: list[tuple[int, ...]] = []
    factors: list[list[int]] = []
    numbers: list[float] = []
    for (k, is_sine), monomials in (row for kind in kinds for row in kind.items()):
        rows.append((place[k], int(is_sine), len(numbers), len(numbers) + len(monomials)))
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
