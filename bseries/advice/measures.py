"""The errors that runs are judged by: their names, and the check of one that was given."""

from __future__ import annotations

from math import ceil
from typing import Any

from integrators.core.errors import IntegratorError, shorten

SOLUTION, ENERGY, MODIFIED_ENERGY = "solution", "energy", "modified-energy"
MEASURES = (SOLUTION, ENERGY, MODIFIED_ENERGY)
"""Of runs of a method."""
EFFECT_MEASURES = (SOLUTION, ENERGY)
"""Of what effects change."""


def check_measure(measure: Any, known: tuple[str, ...]) -> str:
    """The name of a measure, with - or _.

    Args:
        measure: What was given.
        known: The names that there are.

    Raises:
        IntegratorError: There is none of this name.

    Example:
        >>> check_measure("modified_energy", MEASURES)
        'modified-energy'
    """

    name = measure.replace("_", "-") if isinstance(measure, str) else ""
    if name not in known:
        raise IntegratorError(f"measure must be one of {', '.join(known)}, but was {shorten(repr(measure))}")
    return name


UNITS = ((1e-9, "ns"), (1e-6, "µs"), (1e-3, "ms"), (1.0, "s"))
ROUNDING = 1e-12
"""A step more for a rounding error of span/h would be one too many."""


def duration(seconds: float, digits: int = 3) -> str:
    """Seconds, in a unit that suits them.

    Example:
        >>> [duration(x) for x in (4.567e-5, 0.0123, 9.999, 61.2, 8000.0)]
        ['45.7 µs', '12.3 ms', '10 s', '61.2 s', '2 h 13 min']
    """
    if seconds >= 600:
        minutes = round(seconds / 60)
        return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
    size, unit = next((u for u in UNITS if seconds < 999.5 * u[0]), UNITS[-1])
    return f"{seconds / size:.{digits if seconds < 100 * size else 3}g} {unit}"


def whole_steps(span: float, h: float) -> int:
    """How many steps of size h cover a span: the last one may go beyond, but not for the sake of a rounding error.

    Example:
        >>> whole_steps(1.0, 0.1), whole_steps(1.0, -0.3), whole_steps(1e-9, 0.1)
        (10, 4, 1)
    """
    return max(1, ceil(span / abs(h) * (1 - ROUNDING)))
