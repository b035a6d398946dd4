"""Numbers that users give."""

from __future__ import annotations

import math
from numbers import Real
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError

if TYPE_CHECKING:
    import numpy as np


def finite_number(value: Any, argument: str) -> float:
    """A number as a double.

    Raises:
        SeriesError: It is none, or too large for one.
    """
    try:
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise SeriesError(f"{argument} must be a finite number, but was {value!r:.60}")
    return number


def box_edges(period: Any, dimension: int) -> np.ndarray | None:
    """The edges of a periodic box, one for each coordinate; None if there is no box.

    Raises:
        SeriesError: They are not positive, or their number does not divide that of coordinates.
    """
    if period is None:
        return None
    import numpy as np

    try:
        edges = np.asarray(period, dtype=float).reshape(-1)
    except (TypeError, ValueError, OverflowError):
        raise SeriesError(f"period must be numbers, but was {period!r:.60}") from None
    if not len(edges) or dimension % len(edges) or not (np.all(edges > 0) and np.all(np.isfinite(edges))):
        raise SeriesError(
            f"period must be a positive number, or one for each dimension or coordinate, but was {period!r:.60}"
        )
    return np.tile(edges, dimension // len(edges))
