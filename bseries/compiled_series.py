"""Series on scenes compiled: by derivative towers, or as simplified formulas where these are shorter."""

from __future__ import annotations

import ctypes
import math
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from integrators import IntegratorError

from . import tower_kernels, tower_layout
from .domains import to_float
from .exceptions import SeriesError
from .states import read_states, read_step
from .tower_plans import PlanBuilder
from .towers import find_needs

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import ModuleType

    from .evaluation import SceneSeries

CHUNK_ROWS = 64
"""Rows of sites that are evaluated at a time when there are many points."""
MOST_LANES = 40
"""Rows of sites in a group; more do not fit into the nearest memory, fewer leave more overhead to each."""
MOST_VARIABLES = 4
"""Formulas are considered for scenes with at most so many variables."""
MOST_MONOMIALS = 150
"""Formulas are given up when one grows beyond so many monomials."""
NANOSECONDS_OF_CONTRACTION = 15
NANOSECONDS_OF_OPERATION = 1
"""What a contraction and an operation of a formula cost, roughly; the route is chosen by these."""

TOWERS = '''\
"""A B-series by derivative towers; the tables are explained in bseries.tower_layout."""

from numba import njit
import numpy as np

from bseries.compiled_series import evaluator

evaluate = evaluator()
ints = np.array({ints}, np.uint64)
numbers = np.array({numbers})


@njit(nogil=True, error_model="numpy", fastmath={{"contract"}})
def compiled(y, h, out):
    """Write the value at y to out; both are contiguous."""
    if y.size != {dimension} or out.size != {dimension}:
        raise ValueError("y and out must have {dimension} entries")
    terms = np.empty(({order}, y.size))
    evaluate(
        y.ctypes, terms.ctypes, 1, y.size, {order}, 1, {lanes}, ints.ctypes, ints.size, numbers.ctypes, numbers.size
    )
    for i in range(y.size):
        value = terms[{order} - 1, i]
        for n in range({order} - 2, -1, -1):
            value = value * h + terms[n, i]
        out[i] = {result}
'''

FORMULAS = '''\
"""A B-series as formulas."""

from math import *

from numba import njit

compiled_with = njit(cache=True, nogil=True, error_model="numpy", fastmath={{"contract"}})


@compiled_with
def value({arguments}, h):
    """The value at one point."""
{lines}
    return {results}


@compiled_with
def compiled(y, h, out):
    """Write the value at y to out."""
    if y.size != {dimension} or out.size != {dimension}:
        raise ValueError("y and out must have {dimension} entries")
    {targets} = value({entries}, h)


@compiled_with
def many(y, h, out):
    """Write the values at the rows of y to the rows of out."""
    for k in range(y.shape[0]):
        {row_targets} = value({row_entries}, h)
'''


@cache
def evaluator() -> Any:
    """The kernel that evaluates terms, as a C function of pointers."""
    from numba import types

    reals, whole = types.CPointer(types.float64), types.intp
    tables = types.CPointer(types.uint64), whole, reals, whole
    return tower_kernels.evaluate_pointers.c_function(
        types.void(reals, reals, whole, whole, whole, whole, whole, *tables)
    )


class CompiledSeries:
    """The numbers behind a `SceneSeries`; see there."""

    def __init__(self, series: SceneSeries, route: str):
        self.series = series
        self._wanted = route
        _ = series.scene.numeric_terms  # refuses symbols
        symbols = sorted({str(x) for weight in series.weights for x in getattr(weight, "free_symbols", ())})
        if symbols:
            raise SeriesError(
                f"method must have numbers for its parameters in compiled code, but has {', '.join(symbols)}"
            )

    @cached_property
    def tables(self) -> tuple[Any, Any]:
        """What the tower kernels read."""
        ints, numbers = build_tables(self.series, self.series.weights, to_float)
        return ints, np.array(numbers, float)

    @cached_property
    def route(self) -> str:
        """``"towers"`` or ``"symbolic"``."""
        if self._wanted != "auto":
            return self._wanted
        if self.series.dimension > MOST_VARIABLES or self._lines is None:
            return "towers"
        from integrators.printer import operation_cost

        ints, table = self.tables[0], tower_layout.CONTRACTION
        contractions = int(ints[table + 1] - ints[table]) // tower_layout.TABLES["contraction"]
        towers = NANOSECONDS_OF_CONTRACTION * contractions
        return "symbolic" if NANOSECONDS_OF_OPERATION * operation_cost(self._lines) < towers else "towers"

    @cached_property
    def _lines(self) -> list[str] | None:
        """The formulas as lines of code; None if they grow too long and nobody insists on them."""
        if self._wanted == "symbolic":
            return self._written_lines()
        try:
            return self._written_lines(limit=MOST_MONOMIALS)
        except (SeriesError, IntegratorError):
            return None

    def _written_lines(self, **limits: int) -> list[str]:
        import sympy

        from integrators.printer import source_lines

        series, h = self.series, sympy.Dummy("h")
        written = series.written(**limits)
        terms = [written.term(n, simplify=False) for n in range(1, series.order + 1)]
        series.__dict__.setdefault("formulas", written)  # all terms are there: nobody need compute them again
        shift = 0 if series.is_field else 1
        sums = [
            sympy.Add(*(h ** (k + shift) * formula for k, formula in enumerate(column)), series.empty * symbol)
            for column, symbol in zip(zip(*terms, strict=True), series.scene.symbols, strict=True)
        ]
        names = {symbol: f"y{i}" for i, symbol in enumerate(series.scene.symbols)}
        return source_lines([(f"f{i}", formula) for i, formula in enumerate(sums)], {**names, h: "h"})

    @cached_property
    def source(self) -> str:
        """The source of the compiled functions."""
        size = self.series.dimension
        if self.route == "towers":
            ints, numbers = self.tables
            result = "value" if self.series.is_field else f"value * h + {to_float(self.series.empty)!r} * y[i]"
            tables = {"ints": _listed(ints.tolist()), "numbers": _listed(numbers.tolist())}
            return TOWERS.format(**tables, order=self.series.order, lanes=self._lanes(1), result=result, dimension=size)

        def row(form: str) -> str:
            return ", ".join(form.format(i) for i in range(size)) + ("," if size == 1 and "=" not in form else "")

        return FORMULAS.format(
            dimension=size,
            arguments=", ".join(f"y{i}" for i in range(size)),
            lines="\n".join(f"    {line}" for line in self._lines or ()),
            results=row("f{}"),
            targets=row("out[{}]"),
            entries=", ".join(f"y[{i}]" for i in range(size)),
            row_targets=row("out[k, {}]"),
            row_entries=", ".join(f"y[k, {i}]" for i in range(size)),
        )

    @cached_property
    def module(self) -> ModuleType:
        """The compiled functions."""
        from integrators.modules import load_module

        return load_module(self.source, keep=self.route == "symbolic")  # numba keeps no code that calls pointers

    @property
    def compiled(self) -> Callable[..., None]:
        """The function (y, h, out)."""
        return self.module.compiled

    def value(self, y: Any, h: float, workers: int = 1) -> np.ndarray:
        """The value at one point or many."""
        states, shape = read_states(y, self.series.dimension)
        step = read_step(h)
        out = np.empty_like(states)
        if self.route == "symbolic":
            _in_threads(lambda k: self.module.many(states[k], step, out[k]), len(states), workers)
            return out.T.reshape(shape)
        terms = self._terms(states, workers)
        out[:] = terms[-1]
        for term in terms[-2::-1]:
            out *= step
            out += term
        if not self.series.is_field:
            out *= step
            out += to_float(self.series.empty) * states
        return out.T.reshape(shape)

    def terms(self, y: Any, workers: int = 1) -> np.ndarray:
        """The terms by order."""
        states, shape = read_states(y, self.series.dimension)
        return self._terms(states, workers).transpose(0, 2, 1).reshape(self.series.order, *shape)

    def _terms(self, states: np.ndarray, workers: int) -> np.ndarray:
        ints, numbers = self.tables
        out = np.empty((self.series.order, *states.shape))
        chunk = max(1, min(len(states), CHUNK_ROWS // self._rows))
        lanes = self._lanes(chunk)
        evaluate = evaluator()

        def work(part: slice) -> None:
            some = np.ascontiguousarray(states[part])
            terms = np.empty((len(out), *some.shape))
            tables = (_pointer(ints), ints.size, _pointer(numbers), numbers.size)
            evaluate(_pointer(some), _pointer(terms), *some.shape, len(out), chunk, lanes, *tables)
            out[:, part] = terms

        _in_threads(work, len(states), workers)
        return out

    @cached_property
    def _rows(self) -> int:
        """The rows of the largest term."""
        return max((term.sites.size for term in self.series.scene.numeric_terms), default=1) or 1

    def _lanes(self, points: int) -> int:
        """How many rows make a group: up to MOST_LANES, and such that the last group is nearly full."""
        rows = points * self._rows
        return math.ceil(rows / math.ceil(rows / MOST_LANES))


def _pointer(array: np.ndarray) -> Any:
    """Where a contiguous array of doubles or unsigned integers begins."""
    kind = ctypes.c_uint64 if array.dtype == np.uint64 else ctypes.c_double
    return array.ctypes.data_as(ctypes.POINTER(kind))


def _in_threads(work: Callable[[slice], Any], size: int, workers: int) -> None:
    """Do the work on slices of all points, in so many threads; compiled code lets them run at the same time."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise SeriesError(f"workers must be a whole number ≥ 1, but was {workers!r:.60}")
    if workers == 1:
        work(slice(0, size))
        return
    from concurrent.futures import ThreadPoolExecutor

    share = max(1, math.ceil(size / workers))
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(work, [slice(k, min(k + share, size)) for k in range(0, size, share)]))


def _listed(values: list[Any]) -> str:
    """A list as text, some entries to a line."""
    rows = [", ".join(map(repr, values[k : k + 16])) for k in range(0, len(values), 16)]
    return "[\n" + "".join(f"    {row},\n" for row in rows) + "]"


def build_tables(series: SceneSeries, weights: Sequence[Any], convert: Callable[[Any], Any]) -> tuple[Any, list[Any]]:
    """The tables of the tower kernels, with numbers of a kind."""
    trees, scene = series.trees, series.scene
    needs = find_needs(trees.table, [weight != 0 for weight in weights], scene, trees.pieces)
    return PlanBuilder(trees.table, needs, weights, scene.dimension, convert).plan()
