"""Series on scenes compiled: by derivative towers, or as simplified formulas where these are shorter."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from bseries.exact.domains import to_float
from bseries.exceptions import SeriesError
from bseries.fields import tower_kernels, tower_layout
from bseries.fields.compiled_formulas import CompiledFormulas
from bseries.fields.inputs import in_threads, read_states, read_step, warn_where_not_finite
from bseries.fields.towers import PlanBuilder, find_needs
from integrators import IntegratorError
from integrators.compile.modules import load_module

if TYPE_CHECKING:
    from bseries.fields.scene_trees import SeriesOnScene

CHUNK_ROWS = 64
"""Rows of sites that are evaluated at a time when there are many points."""
MOST_LANES = 40
"""Rows of sites in a group; more do not fit into the nearest memory, fewer leave more overhead to each."""
MOST_VARIABLES = 4
"""Formulas are considered for scenes with at most so many variables."""
MOST_MONOMIALS = 150
"""Formulas are given up when one grows beyond so many monomials."""

TOWERS = '''\
"""A B-series by derivative towers; the tables are explained in bseries.fields.tower_layout."""

from numba import njit
import numpy as np

from bseries.fields.compiled_series import evaluator

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
    """A series on a scene as compiled functions of floats."""

    def __init__(self, series: SeriesOnScene, route: str):
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
        if self.series.dimension > MOST_VARIABLES or self.formulas is None:
            return "towers"
        return "symbolic" if self.formulas.is_faster(contractions(self.tables[0])) else "towers"

    @cached_property
    def formulas(self) -> CompiledFormulas | None:
        """The series as formulas; None if they grow too long and nobody insists on them."""
        if self._wanted == "symbolic":
            return self._written_formulas()
        try:
            return self._written_formulas(limit=MOST_MONOMIALS)
        except (SeriesError, IntegratorError):
            return None

    def _written_formulas(self, **limits: int) -> CompiledFormulas:
        series = self.series
        written = series.written(**limits)
        terms = [written.term(n, simplify=False) for n in range(1, series.order + 1)]
        series.__dict__.setdefault("formulas", written)  # all terms are there: nobody need compute them again
        columns = list(zip(*terms, strict=True))
        if not series.is_field:
            columns = [
                (series.empty * symbol, *column) for symbol, column in zip(series.scene.symbols, columns, strict=True)
            ]
        return CompiledFormulas(series.scene.symbols, columns)

    @cached_property
    def source(self) -> str:
        """The source of the compiled functions."""
        if self.route == "symbolic" and self.formulas is not None:
            return self.formulas.source
        ints, numbers = self.tables
        result = "value" if self.series.is_field else f"value * h + {to_float(self.series.empty)!r} * y[i]"
        tables = {"ints": _listed(ints.tolist()), "numbers": _listed(numbers.tolist())}
        sizes = {"order": self.series.order, "lanes": self._lanes(1), "dimension": self.series.dimension}
        return TOWERS.format(**tables, **sizes, result=result)

    @cached_property
    def module(self) -> ModuleType:
        """The compiled functions."""

        return load_module(self.source, keep=self.route == "symbolic")  # no code that calls pointers is kept on disk

    @property
    def compiled(self) -> Callable[..., None]:
        """The function (y, h, out)."""
        return self.module.compiled

    def value(self, y: Any, h: float, workers: int = 1) -> np.ndarray:
        """The value at one point or many."""
        states, shape = read_states(y, self.series.dimension)
        step = read_step(h)
        if self.route == "symbolic" and self.formulas is not None:
            out = self.formulas.values(states, step, workers)
        else:
            out = self._sums(states, step, workers)
        warn_where_not_finite(out.T, f"{self.series.label} on {self.series.scene.name}", step, stacklevel=4)
        return out.T.reshape(shape)

    def _sums(self, states: np.ndarray, step: float, workers: int) -> np.ndarray:
        """The values at the rows of `states`, from towers."""
        terms = self.terms_at(states, workers)
        out = terms[-1].copy()
        with np.errstate(over="ignore", invalid="ignore"):  # one sentence will say so
            for term in terms[-2::-1]:
                out *= step
                out += term
            if not self.series.is_field:
                out *= step
                out += to_float(self.series.empty) * states
        return out

    def terms(self, y: Any, workers: int = 1) -> np.ndarray:
        """The terms by order."""
        states, shape = read_states(y, self.series.dimension)
        return self.terms_at(states, workers).transpose(0, 2, 1).reshape(self.series.order, *shape)

    def terms_at(self, states: np.ndarray, workers: int = 1) -> np.ndarray:
        """The terms by order at the rows of `states`, from towers."""
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

        in_threads(work, len(states), workers)
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


def _listed(values: list[Any]) -> str:
    """A list as text, some entries to a line."""
    rows = [", ".join(map(repr, values[k : k + 16])) for k in range(0, len(values), 16)]
    return "[\n" + "".join(f"    {row},\n" for row in rows) + "]"


def contractions(ints: Any) -> int:
    """How many contractions the tables of the tower kernels list."""
    table = tower_layout.CONTRACTION
    return int(ints[table + 1] - ints[table]) // tower_layout.TABLES["contraction"]


def build_tables(series: SeriesOnScene, weights: Sequence[Any], convert: Callable[[Any], Any]) -> tuple[Any, list[Any]]:
    """The tables of the tower kernels, with numbers of a kind."""
    trees, scene = series.trees, series.scene
    needs = find_needs(trees.table, [weight != 0 for weight in weights], scene, trees.pieces)
    return PlanBuilder(trees.table, needs, weights, scene.dimension, convert).plan()
