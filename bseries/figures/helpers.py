"""What figures share: truncated modified equations as scenes, fits, panels and axes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import pi
from typing import TYPE_CHECKING

import bseries as bs
from bseries_base.extras import np
from integrators.methods.catalogue.registry import as_method

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from integrators import Method, Scene


def truncated_scene(method: Method | str, scene: Scene, terms: int, h: float) -> Scene:
    """The truncated modified equation y' = f(y) + h f_2(y) + … + h^(N−1) f_N(y) for one step size, as a scene.

    Example:
        >>> truncated_scene("explicit-euler", bs.scene("riccati"), 3, 0.1).field
        (3*y**4/200 - y**3/10 + y**2,)
    """
    import sympy

    method = as_method(method)
    f, step = bs.modified_field(method, scene, terms), sympy.Symbol("h")
    field = [sum(step**k * f.symbolic(k)[i] for k in range(terms)) for i in range(scene.dimension)]
    return bs.Scene(
        dict.fromkeys(scene.variables, 1),
        field=dict(zip(scene.variables, field, strict=True)),
        parameters={"h": h},
        name=f"{method.name} on {scene.name}, {terms} terms",
    )


def power_exponent(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The exponent of x in y: the slope of a line fitted in logarithmic scales, for each column of y.

    Example:
        >>> import numpy as np
        >>> round(float(power_exponent(np.array([1.0, 2.0, 4.0]), np.array([3.0, 12.0, 48.0]))), 12)
        2.0
    """
    return np.polyfit(np.log(x), np.log(y), 1)[0]


def after_a_turn(angles: np.ndarray, *rows: np.ndarray) -> list[float] | None:
    """The values where angles reach 2π, by interpolation of degree 5; None if they do not."""
    end = int(np.searchsorted(angles, 2 * np.pi))
    if end + 3 > len(angles):
        return None
    near = slice(end - 3, end + 3)
    return [float(np.polyval(np.polyfit(angles[near] - 2 * np.pi, row[near], 5), 0)) for row in rows]


def growth_exponent(t: np.ndarray, values: np.ndarray, first: float, last: float, points: int) -> float:
    """The exponent of t in values, fitted at times between two, equidistant in logarithmic scale."""
    times = np.geomspace(first, last, points)
    return float(power_exponent(times, np.interp(times, t, values)))


def fitted_factor(values: np.ndarray, shape: np.ndarray) -> float:
    """The factor c of values ≈ c · shape, fitted in logarithmic scale."""
    return float(np.exp(np.mean(np.log(values / shape))))


def logarithmic_indices(count: int, points: int) -> np.ndarray:
    """Indices from 1 to count − 1, about equidistant in logarithmic scale."""
    return np.unique(np.geomspace(1, count - 1, points).astype(int))


def growing(moving: Sequence[tuple[Line2D, np.ndarray]], counts: np.ndarray) -> Iterator[tuple[int, int]]:
    """Frames of a film in which points (across, upwards) of orbits appear, up to those of each index in `counts`."""
    for frame, count in enumerate(counts, 1):
        for dots, points in moving:
            dots.set_data(*points[:, : count + 1])
        yield frame, len(counts)


def label_panels(panels: Iterable[Axes], titles: Iterable[str]) -> None:
    """Titles of panels, which begin with (a), (b), …"""
    for letter, axes, title in zip("abcdefghi", panels, titles, strict=False):
        axes.set_title(f"({letter}) {title}")


def reduced_angle(q: float | np.ndarray) -> np.ndarray:
    """An angle modulo 2π, from −π on."""
    return np.asarray(np.remainder(q + np.pi, 2 * np.pi) - np.pi)


def set_angle_axis(axes: Axes) -> None:
    """Let the horizontal axis show an angle from −π to π."""
    axes.set_xlim(-pi, pi)
    axes.set_xticks([-pi, 0, pi], [r"$-\pi$", "0", r"$\pi$"])
