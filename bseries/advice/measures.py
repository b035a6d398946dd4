"""Error measures, durations, and numbers of steps."""

from __future__ import annotations

from math import ceil
from typing import Any

from integrators.core.errors import IntegratorError, shorten

SOLUTION, ENERGY, MODIFIED_ENERGY = "solution", "energy", "modified-energy"
MEASURES = (SOLUTION, ENERGY, MODIFIED_ENERGY)
"""For runs of a method."""
EFFECT_MEASURES = (SOLUTION, ENERGY)
"""For the influence of effects."""


def check_measure(measure: Any, known: tuple[str, ...]) -> str:
    """The name of a measure, with - or _, checked.

    Raises:
        IntegratorError: The name is unknown.

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
"""Relative rounding error of span/h that does not count as a further step."""


def duration(seconds: float, digits: int = 3) -> str:
    """A duration as text, in a suitable unit.

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
    """The number of steps of size h that cover a span.

    Example:
        >>> whole_steps(1.0, 0.1), whole_steps(1.0, -0.3), whole_steps(1e-9, 0.1)
        (10, 4, 1)
    """
    return max(1, ceil(span / abs(h) * (1 - ROUNDING)))
