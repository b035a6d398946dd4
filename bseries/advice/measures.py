"""The errors that runs are judged by: their names, and the check of one that was given."""

from __future__ import annotations

from typing import Any

from integrators.errors import IntegratorError

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
    from integrators.expressions import shorten

    name = measure.replace("_", "-") if isinstance(measure, str) else ""
    if name not in known:
        raise IntegratorError(f"measure must be one of {', '.join(known)}, but was {shorten(repr(measure))}")
    return name
