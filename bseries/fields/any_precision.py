"""Series on scenes in any precision: the tower kernels run by the interpreter on numbers of mpmath.

mpmath's precision is one setting for the whole process: threads must not compute in different precisions at once.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from bseries.exceptions import SeriesError
from bseries.fields import tower_kernels
from bseries.fields import tower_layout as layout
from bseries.fields.compiled_series import build_tables
from integrators.reference.plain_arithmetic import Arithmetic

if TYPE_CHECKING:
    from bseries.fields.scene_trees import SeriesOnScene

FUNCTIONS = (
    *("sin", "cos", "sinh", "cosh", "exp", "log", "sqrt"),
    *("asin", "acos", "atan", "asinh", "acosh", "atanh"),
)
CONSTANTS = ("TERM_ROW", "TAPE_ROW", "ARGUMENT_ROW", "OUTPUT_ROW", "CONTRACTION_ROW", "SECOND_HALF")


class PreciseSeries:
    """A series on a scene with all constants in so many digits; printed decimals of a method are taken for exact.

    Example:
        >>> import bseries as bs
        >>> f = bs.modified_field(bs.method("explicit-euler"), bs.scene("riccati"), 3)
        >>> PreciseSeries(f, 30)(["1"], "1/10")
        [mpf('0.915')]
    """

    def __init__(self, series: SeriesOnScene, digits: int):
        import mpmath

        self.series, self.arithmetic = series, Arithmetic(digits)
        with self.arithmetic.working():
            values = zip(series.series.coefficients(), series.trees.table.symmetry.tolist(), strict=True)
            ints, numbers = build_tables(series, [value / sigma for value, sigma in values], self._number)
            self._empty = self._number(series.empty)
        self._ints = ints.astype(np.int64)
        self._numbers = np.array([*numbers, None], object)[:-1]
        names: dict[str, Any] = {name: getattr(mpmath, name) for name in FUNCTIONS}
        names |= {name: int(getattr(tower_kernels, name)) for name in (*CONSTANTS, "ZERO", "ONE", "TWO", "ROLES")}
        names["np"] = SimpleNamespace(uint64=int)
        self._sweep = tower_kernels.sweep.interpreted(**names)
        self._sizes = tower_kernels.workspace.interpreted(**names)(self._ints, 1, 1)

    def _number(self, value: Any) -> Any:
        return self.arithmetic.number(value, "coefficient")

    def terms(self, y: Any) -> list[list[Any]]:
        """The terms by order at one point: a list of vectors."""
        with self.arithmetic.working():
            return self._terms(self.arithmetic.read(y, "y"))

    def _terms(self, y: Any) -> list[list[Any]]:
        import mpmath

        size, ints = self.series.dimension, self._ints
        if len(y) != size:
            raise SeriesError(f"y must have {size} values, but had {len(y)}")
        rows, groups, places = map(int, self._sizes)
        out = np.zeros((self.series.order, size), object)
        fields = np.zeros((int(ints[layout.FIELDS]), size), object)
        indices = (np.zeros(count, np.int64) for count in (int(tower_kernels.ROLES) * rows, rows, places))
        work = np.zeros(groups, object)
        try:
            self._sweep(np.array([y], object), out, fields, work, *indices, 1, ints, self._numbers, 1)
        except ArithmeticError as error:
            raise SeriesError(f"y must lie in the domain of the field, but there a formula {error}") from None
        if any(isinstance(value, mpmath.mpc) for value in out.ravel()):
            raise SeriesError("y must lie in the domain of the field, but a formula was not real there")
        return out.tolist()

    def __call__(self, y: Any, h: Any) -> list[Any]:
        """The value at one point; numbers may be text, fractions or numbers of mpmath."""
        with self.arithmetic.working():
            point, step = self.arithmetic.read(y, "y"), self.arithmetic.number(h, "h")
            shift = 0 if self.series.is_field else 1
            columns = zip(*self._terms(point), strict=True)
            value = [sum(x * step ** (n + shift) for n, x in enumerate(column)) for column in columns]
            if shift:
                value = [v + self._empty * x for v, x in zip(value, point, strict=True)]
        return list(self.arithmetic.rounded(np.array([*value, None], object)[:-1]))
