"""Series on scenes in any precision: the tower kernels run by the interpreter on numbers of mpmath."""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from . import tower_kernels
from . import tower_layout as layout
from .compiled_series import build_tables
from .exceptions import SeriesError

if TYPE_CHECKING:
    from collections.abc import Callable

    from .evaluation import SceneSeries

GUARD_DIGITS = 15
"""Digits more than asked for, which sums of many terms of either sign use up."""
FUNCTIONS = (
    *("sin", "cos", "sinh", "cosh", "exp", "log", "sqrt"),
    *("asin", "acos", "atan", "asinh", "acosh", "atanh"),
)


class PreciseSeries:
    """A `SceneSeries` with all constants in so many digits.

    Example:
        >>> import bseries as bs
        >>> f = bs.modified_field(bs.method("explicit-euler"), bs.scene("riccati"), 3)
        >>> PreciseSeries(f, 30)(["1"], "1/10")
        [mpf('0.915')]
    """

    def __init__(self, series: SceneSeries, digits: int):
        if isinstance(digits, bool) or not isinstance(digits, int) or not 1 <= digits <= 10_000:
            raise SeriesError(f"digits must be a whole number from 1 to 10000, but was {digits!r:.60}")
        import mpmath

        self.series, self.digits = series, digits
        with mpmath.workdps(digits + GUARD_DIGITS):
            ints, numbers = build_tables(series, _convert)
            self._empty = _convert(series.empty)
        self._ints = ints.astype(np.int64)
        self._numbers = np.array([*numbers, None], object)[:-1]
        names: dict[str, Any] = {name: getattr(mpmath, name) for name in FUNCTIONS}
        names |= {"ZERO": 0, "ONE": 1, "TWO": 2, "ROLES": 4, "np": SimpleNamespace(uint64=int)}
        self._sweep: Callable[..., None] = tower_kernels.sweep.interpreted(**names)

    def terms(self, y: Any) -> list[list[Any]]:
        """The terms by order at one point: a list of vectors."""
        import mpmath

        size = self.series.dimension
        if len(y) != size:
            raise SeriesError(f"y must have {size} values, but had {len(y)}")
        with mpmath.workdps(self.digits + GUARD_DIGITS):
            return self._terms([_convert(value) for value in y])

    def _terms(self, y: list[Any]) -> list[list[Any]]:
        size, ints = self.series.dimension, self._ints
        lanes, groups, places = layout.sizes(ints)
        out = np.zeros((self.series.order, size), object)
        fields = np.zeros((int(ints[layout.FIELDS]), size), object)
        work = np.zeros(groups, object)
        indices = (np.zeros(count, np.int64) for count in (4 * lanes, lanes, places))
        self._sweep(np.array([y], object), out, fields, work, *indices, 1, ints, self._numbers, 1)
        return out.tolist()

    def __call__(self, y: Any, h: Any) -> list[Any]:
        """The value at one point; numbers may be text, fractions or numbers of mpmath."""
        import mpmath

        terms = self.terms(y)
        with mpmath.workdps(self.digits + GUARD_DIGITS):
            step, shift = _convert(h), 0 if self.series.is_field else 1
            value = [sum(x * step ** (n + shift) for n, x in enumerate(column)) for column in zip(*terms, strict=True)]
            if shift:
                value = [v + self._empty * _convert(x) for v, x in zip(value, y, strict=True)]
        with mpmath.workdps(self.digits):
            return [+v for v in value]


def _convert(value: Any) -> Any:
    """An exact number, or a number of mpmath or text, in the current precision."""
    import mpmath
    import sympy

    if isinstance(value, str):
        value = Fraction(value)
    if isinstance(value, Fraction):
        return mpmath.mpf(value.numerator) / value.denominator
    if isinstance(value, sympy.Basic):
        value = sympy.N(value, mpmath.mp.dps + GUARD_DIGITS)
    return mpmath.mpf(value)
