"""What the options of figures may be."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any

from bseries.exceptions import SeriesError


def check_number(value: Any, argument: str, least: float, most: float) -> float:
    """A number within bounds, as a double.

    Raises:
        SeriesError: It is none.
    """
    if not (_is_a(Real, value) and least <= value <= most):
        raise SeriesError(f"{argument} must be a number from {least:g} to {most:g}, but was {value!r:.60}")
    return float(value)


def check_count(value: Any, argument: str, least: int, most: int) -> int:
    """A whole number within bounds.

    Raises:
        SeriesError: It is none.
    """
    if not (_is_a(Integral, value) and least <= value <= most):
        raise SeriesError(f"{argument} must be a whole number from {least} to {most}, but was {value!r:.60}")
    return int(value)


def _is_a(kind: type, value: Any) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)
