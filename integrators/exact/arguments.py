"""Numbers as arguments: numbers of any type, or text such as ``"1/10"`` and ``"pi/4"``."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bseries_base.errors import shown
from integrators.core.arguments import MOST_STEPS, is_listed, read_array, read_steps
from integrators.core.errors import IntegratorError
from integrators.exact.expressions import parse_constant

if TYPE_CHECKING:
    import numpy as np


def read_number(value: object, argument: str) -> float:
    """A finite number as a double."""
    given = parse_constant(value, argument=argument) if isinstance(value, str) else value
    try:
        number = math.nan if isinstance(given, bool) else float(given)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise IntegratorError(f"{argument} must be a finite number, but was {shown(value)}")
    return number


def read_window(window: Any) -> tuple[float, float, float, float]:
    """The ends (left, right, bottom, top) of axes, checked."""
    try:
        left, right, bottom, top = (read_number(end, "window") for end in window)
    except (TypeError, ValueError):
        left = right = bottom = top = 0.0
    if not (left < right and bottom < top):
        raise IntegratorError(f"window must be four numbers, left < right, bottom < top, but was {shown(window)}")
    return left, right, bottom, top


def read_positive(value: object, argument: str) -> float:
    """A finite positive number as a double."""
    number = read_number(value, argument)
    if number <= 0:
        raise IntegratorError(f"{argument} must be positive, but was {number:g}")
    return number


def read_vector(values: object, argument: str, dimension: int) -> np.ndarray:
    """A vector of finite doubles."""
    import numpy as np

    if is_listed(values) and any(isinstance(value, str) for value in values):
        values = [read_number(value, f"{argument}[{i}]") for i, value in enumerate(values)]
    vector = read_array(values)
    if vector.shape != (dimension,) or not np.isfinite(vector).all():
        raise IntegratorError(f"{argument} must hold {dimension} finite numbers, but was {shown(values)}")
    return vector


def step_count(h: object, steps: object, span: object) -> int:
    """The number of steps of size `h`, given as `steps`, or as the length of time `span` that they cover.

    Floats are the decimals that they print as, so that steps of 0.1 cover 0.3 exactly; else the last step ends later.

    Example:
        >>> step_count(0.1, None, 0.3), step_count("1/3", None, 1), step_count(0.1, 7, None)
        (3, 3, 7)
    """
    if (steps is None) == (span is None):
        raise IntegratorError(f"steps or span must be given, but {'neither was' if steps is None else 'both were'}")
    if steps is not None:
        return read_steps(steps, "steps", 0)
    size, length = _exact(h, "h"), _exact(span, "span")
    if size == 0 or length < 0:
        raise IntegratorError(f"span must be at least 0, and h not 0, but they were {shown(span)} and {shown(h)}")
    count = math.ceil(length / abs(size))
    if count > MOST_STEPS:
        raise IntegratorError(f"span must take from 0 to 2^53 steps of {shown(h)}, but was {shown(span)}")
    return count


def _exact(value: object, argument: str) -> Fraction:
    """A number as a fraction."""
    given = parse_constant(value, argument=argument) if isinstance(value, str) else value
    if isinstance(given, int | Fraction) and not isinstance(given, bool):
        return Fraction(given)
    return Fraction(repr(read_number(given, argument)))
