"""Numerical values of series on scenes: compiled in doubles, or interpreted in any precision.

In doubles a series is evaluated by the kernels of elementary differentials, or as simplified formulas where these are
cheaper. In higher precision the interpreter runs the same kernels on numbers of mpmath, whose precision is one setting
for the whole process: threads must not use different precisions at once.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property, partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import mpmath
import numpy as np
from numpy.typing import ArrayLike, NDArray

from bseries.exact.domains import to_float
from bseries.exceptions import SeriesError
from bseries.fields import differential_kernels as kernels
from bseries.fields.compiled_formulas import CompiledFormulas
from bseries.fields.differential_tables import TableBuilder, find_required_tensors
from bseries.fields.inputs import MpNumber, Numeral, Point, in_threads, read_states, read_step, warn_where_not_finite
from bseries.fields.scene_trees import SeriesOnScene
from bseries_base.errors import BSeriesError
from integrators.reference.plain_steps import Arithmetic

if TYPE_CHECKING:
    from bseries.exact.domains import Coefficient

Array: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.uint64]
N = TypeVar("N")

CHUNK_ROWS = 64  # rows of sites evaluated together when there are many points
MOST_LANES = 40
"""Largest number of rows in a SIMD group: more exceed the first-level cache, fewer have more overhead per row."""
MOST_VARIABLES = 4  # formulas are considered for scenes with up to this number of variables
MOST_MONOMIALS = 150  # formulas with more monomials are abandoned


@cache
def evaluator() -> Callable[..., None]:
    """The evaluation kernel as a C function of pointers."""
    from numba import types

    reals, whole = types.CPointer(types.float64), types.intp
    tables = types.CPointer(types.uint64), whole, reals, whole
    return kernels.evaluate_pointers.c_function(types.void(reals, reals, whole, whole, whole, whole, whole, *tables))


class CompiledSeries:
    """A `SceneSeries` as compiled functions of doubles."""

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
    def tables(self) -> tuple[Ints, Array]:
        """The tables of the kernels."""
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
        """The series as formulas; None if they are too long and the route is not fixed."""
        series, is_fixed = self.series, self._wanted == "symbolic"
        try:
            symbolic = series.symbolic_series(**{} if is_fixed else {"limit": MOST_MONOMIALS})
            terms = [symbolic.term(n, simplify=False) for n in range(1, series.order + 1)]
            series.__dict__.setdefault("formulas", symbolic)  # keeps the terms
            if not series.is_field:
                terms.insert(0, tuple(series.empty * symbol for symbol in series.scene.symbols))
            return CompiledFormulas(series.scene.symbols, list(zip(*terms, strict=True)))
        except BSeriesError:
            if is_fixed:
                raise
            return None

    @cached_property
    def compiled(self) -> Callable[..., None]:
        """The function (y, h, out) of contiguous arrays; it writes the value at y to out."""
        if self.route == "symbolic" and self.formulas is not None:
            return self.formulas.module.compiled
        from numba import njit

        (ints, numbers), evaluate, lanes = self.tables, evaluator(), self._lanes(1)
        order, dimension, is_map = self.series.order, self.series.dimension, not self.series.is_field
        empty, message = to_float(self.series.empty), f"y and out must have {dimension} entries"

        @njit(nogil=True, error_model="numpy", fastmath={"contract"})
        def compiled(y: Array, h: float, out: Array) -> None:
            """Write the value at y to out."""
            if y.size != dimension or out.size != dimension:
                raise ValueError(message)
            terms = np.empty((order, y.size))
            evaluate(
                y.ctypes, terms.ctypes, 1, y.size, order, 1, lanes, ints.ctypes, ints.size, numbers.ctypes, numbers.size
            )
            for i in range(y.size):
                value = terms[order - 1, i]
                for n in range(order - 2, -1, -1):
                    value = value * h + terms[n, i]
                out[i] = value * h + empty * y[i] if is_map else value

        return compiled

    def value(self, y: ArrayLike, h: float, workers: int = 1) -> np.ndarray:
        """The value at one point or many."""
        states, shape = read_states(y, self.series.dimension)
        step = read_step(h)
        if self.route == "symbolic" and self.formulas is not None:
            out = self.formulas.values(states, step, workers)
        else:
            terms = self.terms_at(states, workers)
            out = terms[-1].copy()
            with np.errstate(over="ignore", invalid="ignore"):  # a warning follows
                for term in terms[-2::-1]:
                    out *= step
                    out += term
                if not self.series.is_field:
                    out *= step
                    out += to_float(self.series.empty) * states
        warn_where_not_finite(out.T, f"{self.series.label} on {self.series.scene.name}", step)
        return out.T.reshape(shape)

    def terms(self, y: ArrayLike, workers: int = 1) -> np.ndarray:
        """The terms by order."""
        states, shape = read_states(y, self.series.dimension)
        return self.terms_at(states, workers).transpose(0, 2, 1).reshape(self.series.order, *shape)

    def terms_at(self, states: np.ndarray, workers: int = 1) -> np.ndarray:
        """The terms by order at the rows of `states`, by the kernels."""
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
        """The number of rows of the largest term."""
        return max((term.sites.size for term in self.series.scene.numeric_terms), default=1) or 1

    def _lanes(self, points: int) -> int:
        """The number of rows in a SIMD group: at most MOST_LANES, with the last group nearly full."""
        rows = points * self._rows
        return math.ceil(rows / math.ceil(rows / MOST_LANES))


def _pointer(array: Array | Ints) -> Any:
    """A pointer to a contiguous array of doubles or unsigned integers."""
    kind = ctypes.c_uint64 if array.dtype == np.uint64 else ctypes.c_double
    return array.ctypes.data_as(ctypes.POINTER(kind))


def contractions(ints: Ints) -> int:
    """The number of contractions in the tables."""
    table = kernels.CONTRACTION
    return int(ints[table + 1] - ints[table]) // int(kernels.CONTRACTION_ROW)


def build_tables(
    series: SeriesOnScene, weights: Sequence[Coefficient], convert: Callable[[Coefficient], N]
) -> tuple[Ints, list[N]]:
    """The tables of the kernels, with numbers made by `convert`."""
    trees, scene = series.trees, series.scene
    needs = find_required_tensors(trees.table, [weight != 0 for weight in weights], scene, trees.pieces)
    return TableBuilder(trees.table, needs, weights, scene.dimension, convert).build()


FUNCTIONS = (
    *("sin", "cos", "sinh", "cosh", "exp", "log", "sqrt"),
    *("asin", "acos", "atan", "asinh", "acosh", "atanh", "erf"),
)
CONSTANTS = ("TERM_ROW", "INSTRUCTION_ROW", "CONTRACTION_ROW", "ZERO", "ONE", "TWO")


class PreciseSeries:
    """A `SceneSeries` evaluated with a given number of digits; decimal coefficients count as exact."""

    def __init__(self, series: SeriesOnScene, digits: int):
        self.series, self.arithmetic = series, Arithmetic(digits)
        with self.arithmetic.working():
            values = zip(series.series.coefficients(), series.trees.table.symmetry.tolist(), strict=True)
            number = partial(self.arithmetic.number, argument="coefficient")
            ints, numbers = build_tables(series, [value / sigma for value, sigma in values], number)
            self._empty = number(series.empty)
        self._ints = ints.astype(np.int64)
        self._numbers = np.array([*numbers, None], object)[:-1]
        names: dict[str, object] = {name: getattr(mpmath, name) for name in FUNCTIONS}
        names |= {name: int(getattr(kernels, name)) for name in CONSTANTS}
        names["np"] = SimpleNamespace(uint64=int)
        self._sweep = kernels.sweep.interpreted(**names)
        self._sizes = kernels.workspace.interpreted(**names)(self._ints, 1, 1)

    def terms(self, y: Point) -> list[list[MpNumber]]:
        """The terms by order at one point, as a list of vectors."""
        size, ints = self.series.dimension, self._ints
        groups, places = map(int, self._sizes)
        out = np.zeros((self.series.order, size), object)
        fields = np.zeros((int(ints[kernels.FIELDS]), size), object)
        work = np.zeros(groups, object), np.zeros(places, np.int64)
        with self.arithmetic.working():
            point = self.arithmetic.read(y, "y")
            if len(point) != size:
                raise SeriesError(f"y must have {size} values, but had {len(point)}")
            try:
                self._sweep(np.array([point], object), out, fields, *work, 1, ints, self._numbers, 1)
            except ArithmeticError as error:
                raise SeriesError(f"y must lie in the domain of the field, but there a formula {error}") from None
        if any(isinstance(value, mpmath.mpc) for value in out.ravel()):
            raise SeriesError("y must lie in the domain of the field, but a formula was not real there")
        return out.tolist()

    def __call__(self, y: Point, h: Numeral) -> list[MpNumber]:
        """The value at one point; numbers may be strings, fractions or numbers of mpmath."""
        with self.arithmetic.working():
            point, step = self.arithmetic.read(y, "y"), self.arithmetic.number(h, "h")
            shift = 0 if self.series.is_field else 1
            columns = zip(*self.terms(point), strict=True)
            value = [sum(x * step ** (n + shift) for n, x in enumerate(column)) for column in columns]
            if shift:
                value = [v + self._empty * x for v, x in zip(value, point, strict=True)]
        return list(self.arithmetic.rounded(value))
