"""Compiled evaluation of formulas in a state and a step size, at one point or many."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from types import ModuleType

import numpy as np
import sympy

from bseries.fields.inputs import in_threads
from bseries_base.lowering import SOURCES
from integrators.compile.modules import load_module
from integrators.compile.printer import Assign, operation_cost, source_lines

CONTRACTION_NANOSECONDS = 15
OPERATION_NANOSECONDS = 1
"""Estimated costs of a contraction of derivative tensors and of one operation; they choose the route."""

FORMULAS = '''\
"""A B-series as formulas."""

from math import *

from bseries_base.machine_code import njit
from numba import types

from bseries_base.lowering.units import lowered

compiled_with = njit(nogil=True, error_model="numpy", fastmath={{"contract"}})


@lowered(types.UniTuple(types.float64, {size})(*[types.float64] * {numbers}))
def value({arguments}, h):
    """The value at one point."""
{lines}
    return {results}


@compiled_with
def compiled(y, h, out):
    """Write the value at y to out."""
    if y.size != {dimension} or out.size != {size}:
        raise ValueError("y and out must have {sizes} entries")
    {targets} = value({entries}, h)


@compiled_with
def first(y, h):
    """The first entry of the value at y."""
    if y.size != {dimension}:
        raise ValueError("y must have {dimension} entries")
    return value({entries}, h)[0]


@compiled_with
def many(y, h, out):
    """Write the values at the rows of y to the rows of out."""
    for k in range(y.shape[0]):
        {row_targets} = value({row_entries}, h)
'''


class CompiledFormulas:
    """Sums Σ h^k · formula, compiled as one function that shares common subexpressions.

    Each of `columns` has the formulas of one sum by power of h; `lines` are the statements that compute the sums.
    """

    def __init__(self, symbols: Sequence[sympy.Symbol], columns: Sequence[Sequence[sympy.Expr]]):
        self.symbols, self.columns = tuple(symbols), tuple(map(tuple, columns))
        h = sympy.Dummy("h")
        sums = [sympy.Add(*(h**k * formula for k, formula in enumerate(column))) for column in self.columns]
        names = {symbol: f"y{i}" for i, symbol in enumerate(self.symbols)}
        statements = [Assign(f"f{i}", "=", formula) for i, formula in enumerate(sums)]
        self.lines = source_lines(statements, {**names, h: "h"})

    def is_faster(self, contractions: int) -> bool:
        """Whether the formulas cost less than this number of tensor contractions."""
        return OPERATION_NANOSECONDS * operation_cost(self.lines) < CONTRACTION_NANOSECONDS * contractions

    @cached_property
    def source(self) -> str:
        """The source of the compiled functions."""
        dimension, size = len(self.symbols), len(self.columns)

        def row(form: str) -> str:
            return ", ".join(form.format(i) for i in range(size)) + ("," if size == 1 else "")

        return FORMULAS.format(
            dimension=dimension,
            numbers=dimension + 1,
            size=size,
            sizes=dimension if dimension == size else f"{dimension} and {size}",
            arguments=", ".join(f"y{i}" for i in range(dimension)),
            lines="\n".join(f"    {line}" for line in self.lines),
            results=row("f{}"),
            targets=row("out[{}]"),
            entries=", ".join(f"y[{i}]" for i in range(dimension)),
            row_targets=row("out[k, {}]"),
            row_entries=", ".join(f"y[k, {i}]" for i in range(dimension)),
        )

    @cached_property
    def module(self) -> ModuleType:
        """The compiled functions."""
        return load_module(self.source, helpers=SOURCES)

    def values(self, states: np.ndarray, step: float, workers: int = 1) -> np.ndarray:
        """The sums at the rows of `states`, one row for each state."""
        out = np.empty((len(states), len(self.columns)))
        in_threads(lambda k: self.module.many(states[k], step, out[k]), len(states), workers)
        return out
