"""Helpers that figures share: checks of options, truncated modified equations as scenes, fits, and axes of angles."""

from __future__ import annotations

from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import bseries as bs
from bseries.exceptions import SeriesError

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes

    from integrators import Scene


def check_number(value: Any, argument: str, least: float, most: float) -> float:
    """A number within bounds, as a double."""
    if not (_is_a(Real, value) and least <= value <= most):
        raise SeriesError(f"{argument} must be a number from {least:g} to {most:g}, but was {value!r:.60}")
    return float(value)


def check_count(value: Any, argument: str, least: int, most: int) -> int:
    """A whole number within bounds."""
    if not (_is_a(Integral, value) and least <= value <= most):
        raise SeriesError(f"{argument} must be a whole number from {least} to {most}, but was {value!r:.60}")
    return int(value)


def _is_a(kind: type, value: Any) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)


def truncated_scene(method: str, scene: Scene, terms: int, h: float) -> Scene:
    """The truncated modified equation y' = f(y) + h f_2(y) + … + h^(N−1) f_N(y) for one step size, as a scene.

    Example:
        >>> truncated_scene("explicit-euler", bs.scene("riccati"), 3, 0.1).field
        (3*y**4/200 - y**3/10 + y**2,)
    """
    import sympy

    f, step = bs.modified_field(bs.method(method), scene, terms), sympy.Symbol("h")
    field = [sum(step**k * f.symbolic(k)[i] for k in range(terms)) for i in range(scene.dimension)]
    return bs.Scene(
        dict.fromkeys(scene.variables, 1),
        field=dict(zip(scene.variables, field, strict=True)),
        parameters={"h": h},
        name=f"{method} on {scene.name}, {terms} terms",
    )


def power_exponent(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The exponent of x in y: the slope of a line fitted in logarithmic scales, for each column of y.

    Example:
        >>> import numpy as np
        >>> round(float(power_exponent(np.array([1.0, 2.0, 4.0]), np.array([3.0, 12.0, 48.0]))), 12)
        2.0
    """
    import numpy as np

    return np.polyfit(np.log(x), np.log(y), 1)[0]


def growth_exponent(t: np.ndarray, values: np.ndarray, first: float, last: float, points: int) -> float:
    """The exponent of t in values, fitted at times between two, equidistant in logarithmic scale."""
    import numpy as np

    times = np.geomspace(first, last, points)
    return float(power_exponent(times, np.interp(times, t, values)))


def fitted_factor(values: np.ndarray, shape: np.ndarray) -> float:
    """The factor c of values ≈ c · shape, fitted in logarithmic scale."""
    import numpy as np

    return float(np.exp(np.mean(np.log(values / shape))))


def logarithmic_indices(count: int, points: int) -> np.ndarray:
    """Indices from 1 to count − 1, about equidistant in logarithmic scale."""
    import numpy as np

    return np.unique(np.geomspace(1, count - 1, points).astype(int))


def reduced_angle(q: Any) -> Any:
    """An angle modulo 2π, from −π on."""
    import numpy as np

    return np.remainder(q + np.pi, 2 * np.pi) - np.pi


def set_angle_axis(axes: Axes) -> None:
    """Let the horizontal axis show an angle from −π to π."""
    from math import pi

    axes.set_xlim(-pi, pi)
    axes.set_xticks([-pi, 0, pi], [r"$-\pi$", "0", r"$\pi$"])
