"""Checks of arguments: states, step sizes, powers of h, numbers of threads."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeAlias

from bseries.exceptions import SeriesError
from bseries_base.errors import shorten, shown, warn_user
from bseries_base.interrupts import mapped

if TYPE_CHECKING:
    import numpy as np
    import sympy
    from numpy.typing import ArrayLike

Step: TypeAlias = "float | Fraction | sympy.Expr"

Formula: TypeAlias = Any
"""A `sympy.Expr` made by functions of SymPy for which type checkers infer `Basic`, or several types."""

MpNumber: TypeAlias = Any
"""A number of mpmath, whose classes are made at run time, so that type checkers do not know their operations."""

Numeral: TypeAlias = "str | Step | MpNumber"
"""A number of any kind, also as text."""
Point: TypeAlias = "Sequence[Numeral] | np.ndarray"


def read_states(y: ArrayLike, size: int) -> tuple[np.ndarray, tuple[int, ...]]:
    """Read a point (size,) or n points (size, n) as contiguous rows of doubles; returns also the original shape."""
    import numpy as np

    try:
        given = np.asarray(y)
        real = given.dtype.kind in "iuf" or (
            given.dtype.kind == "O" and all(isinstance(x, Real) and not isinstance(x, bool) for x in given.ravel())
        )
        array = given.astype(float) if real else None
    except (TypeError, ValueError, OverflowError):
        array = None
    if array is None:
        raise SeriesError(f"y must be real numbers, but was {shown(y)}")
    if array.ndim not in (1, 2) or array.shape[0] != size:
        raise SeriesError(f"y must have the shape ({size},) or ({size}, n), but had {array.shape}")
    return np.ascontiguousarray(array.reshape(size, -1).T), array.shape


def read_step(h: object, argument: str = "h") -> float:
    """Read a step size or another parameter as a double."""
    if isinstance(h, bool) or not isinstance(h, Real):
        raise SeriesError(f"{argument} must be a real number, but was {h!r:.60}")
    try:
        step = float(h)
    except OverflowError:
        raise SeriesError(f"{argument} must be within the range of floats, but was larger") from None
    if not math.isfinite(step):
        raise SeriesError(f"{argument} must be a finite number, but was {step}")
    return step


def warn_where_not_finite(values: np.ndarray, label: str, h: float) -> None:
    """Warn that a series has no finite value at some points; `values` have the shape (…, points)."""
    import numpy as np

    finite = np.isfinite(values)
    if not finite.all():
        rows = finite.reshape(-1, values.shape[-1]).all(axis=0)
        message = (
            f"{label} must have finite values, but with h = {h:g} had none at {(~rows).sum()} of {rows.size} points"
        )
        warn_user(message, RuntimeWarning)


def read_symbolic_step(h: object, argument: str = "h") -> sympy.Expr:
    """Read a step size or another small parameter as a SymPy expression."""
    import sympy

    if isinstance(h, bool) or not isinstance(h, Real | sympy.Expr):
        raise SeriesError(f"{argument} must be a number or a SymPy expression, but was {h!r:.60}")
    step: Formula = sympy.sympify(h, strict=True)
    return step


def power_sum(terms: Iterable[sympy.Expr], h: Step, argument: str = "h", *, first: int = 0) -> sympy.Expr:
    """Σ h^k · term for a step size or another small parameter, with k counted from `first`."""
    import sympy

    step = read_symbolic_step(h, argument)
    return sympy.Add(*(term * step**k for k, term in enumerate(terms, first)))


def check_power(k: object, last: int, of: str = "h") -> None:
    """Check that k is an exponent from 0 to `last`."""
    if isinstance(k, bool) or not isinstance(k, int) or not 0 <= k <= last:
        raise SeriesError(f"k must be a power of {of} from 0 to {last}, but was {k!r:.60}")


def in_threads(work: Callable[[slice], object], size: int, workers: int) -> None:
    """Run a function on slices of all points in several threads; compiled code releases the GIL."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise SeriesError(f"workers must be a whole number ≥ 1, but was {workers!r:.60}")
    if workers == 1:
        work(slice(0, size))
        return
    from concurrent.futures import ThreadPoolExecutor

    share = max(1, math.ceil(size / workers))
    with ThreadPoolExecutor(workers) as pool:
        list(mapped(pool, work, [slice(k, min(k + share, size)) for k in range(0, size, share)]))


def check_smooth(formula: sympy.Expr) -> None:
    """Refuse compiled functions, and abs, sign or where: a series holds on either side only, and a step may cross."""
    from integrators.exact.branches import Branching
    from integrators.scenes.model.black_boxes import check_formulas

    check_formulas([formula], "a series")
    found = min(map(str, formula.atoms(Branching)), default="")
    if found:
        raise SeriesError(f"field must be smooth for a series, but has {shorten(found)}, whose derivatives jump")
