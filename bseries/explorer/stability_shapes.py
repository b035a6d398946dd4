"""The stability region and the order star of a method, as values on a grid of the complex plane."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from bseries.analysis.stability import linear_stability
from bseries.exceptions import SeriesError
from integrators import RungeKutta
from integrators.core.errors import IntegratorError
from integrators.methods.programs.program import Method

POINTS = 161
"""On each side of the grid."""
LEAST, MOST = 4.0, 60.0
"""Bounds of the half width of the window."""


class StabilityShapes(NamedTuple):
    """Where a method is stable.

    Attributes:
        formula: The stability function R as text.
        axis: Real parts, and imaginary parts, of the grid.
        growth: log |R(z)| at x + iy, (imaginary parts, real parts); not positive in the stability region.
        star: log |R(z) e^(−z)|; positive in the order star.
        poles: The poles of R in the window.
    """

    formula: str
    axis: np.ndarray
    growth: np.ndarray
    star: np.ndarray
    poles: tuple[complex, ...]


def stability_shapes(method: Any) -> StabilityShapes:
    """The values of log |R| and log |R e^(−z)| in a window about the stability region.

    Args:
        method: A Runge–Kutta method without symbols.

    Raises:
        IntegratorError: The method is not given by one tableau.
        SeriesError: The tableau has symbols.

    Example:
        >>> shapes = stability_shapes("implicit-midpoint")
        >>> stable = shapes.growth <= 0
        >>> bool(stable[:, shapes.axis < 0].all()), bool(stable[:, shapes.axis > 0].any()), len(shapes.poles)
        (True, False, 1)

    References:
        G. Wanner, E. Hairer, S. P. Nørsett, Order stars and stability theorems, BIT 18 (1978) 475–489,
        doi:10.1007/BF01932026.
    """
    R = linear_stability.stability_function(method)
    if R.parameters:
        raise SeriesError(f"method must have numbers for {', '.join(R.parameters)} to have a stability region")
    intervals = linear_stability.real_stability_interval(R), linear_stability.imaginary_stability_interval(R)
    ends = [end for end in intervals if end is not None and math.isfinite(end)]
    radius = min(1.2 * max([LEAST, *ends]), MOST)
    axis = np.linspace(-radius, radius, POINTS)
    z = axis + 1j * axis[:, None]
    with np.errstate(divide="ignore"):
        parts = [np.log(abs(np.polyval([float(a) for a in reversed(p)], z))) for p in (R.numerator, R.denominator)]
    growth = np.clip(parts[0] - parts[1], -50, 50)
    poles = tuple(z for z in map(complex, R.poles) if max(abs(z.real), abs(z.imag)) < radius)
    return StabilityShapes(str(R), axis, growth, np.clip(growth - z.real, -50, 50), poles)


def region_of(method: Method) -> StabilityShapes | str:
    """The stability region of a method, or a sentence on why there is none."""
    if not isinstance(method, RungeKutta):
        return f"There is no stability region of {method.name}, which is not given by one tableau."
    try:
        return stability_shapes(method)
    except (IntegratorError, SeriesError) as error:
        return f"There is no stability region: {error}."
