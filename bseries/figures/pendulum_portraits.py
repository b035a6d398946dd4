"""Figure 4: three methods on the pendulum, with the cylinder as phase space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs
from bseries.figures.helpers import reduced_angle, set_angle_axis
from foundation.plotting import BLACK, BLUE, GREEN, GREY, VERMILION, WHITE

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NUMBER = 4
TITLE = "Pendulum: phase portraits of explicit Euler, symplectic Euler and Störmer–Verlet on the cylinder"
CAPTION = (
    "Lecture, figure 4. The angle q is periodic, so the states (p, q) lie on a cylinder. Above: the cylinder from the "
    "front, with its back in pale colours. Below: the cylinder cut open at q = ±π. Grey curves are level curves of "
    "the energy. The explicit Euler method gains energy; the other two methods stay near level curves even with large "
    "steps. The initial values of the lecture for Störmer–Verlet are not known; here they are those of the symplectic "
    "Euler method."
)
SIZE = (17.0, 12.5)

TILT = 0.5
"""Half axis of the ellipse that is the projection of a circle."""
LEVELS = (-0.9, -0.6, -0.2, 0.3, 0.75, 1.0, 1.5, 2.3, 3.2)
"""Energies of the level curves; 1 is that of the separatrix."""
POINTS = 201
BEHIND = 0.35
"""Opacity of the back of the cylinder."""
TOP = 2.9
"""Largest |p| in the picture."""
MOST_DRAWN = 120
"""Most steps in the picture."""


class Portrait(NamedTuple):
    """A method on the pendulum."""

    method: str  # name of the method
    title: str  # its name in the picture
    h: float  # step size
    steps: int  # number of steps
    starts: tuple[tuple[float, float], ...]  # initial states (p, q)


STARTS = ((0.7, 0.0), (1.4, 0.0), (2.1, 0.0))
PORTRAITS = (
    Portrait("explicit-euler", "explicit Euler", 0.2, 50, ((0.0, 0.5),)),
    Portrait("symplectic-euler-p", "symplectic Euler", 0.3, 1000, STARTS),
    Portrait("stormer-verlet", "Störmer–Verlet", 0.6, 1000, STARTS),
)


class PendulumPortraits(NamedTuple):
    """Data of the figure."""

    runs: dict[str, np.ndarray]  # states by method, (starts, 2, steps + 1), with unreduced angles
    energies: dict[str, np.ndarray]  # their energies, (starts, steps + 1)
    levels: np.ndarray  # level curves, (curves, 2, points), with angles from −π to π


def numbers() -> PendulumPortraits:
    """The runs of all methods, and level curves of the energy."""
    import numpy as np

    pendulum = bs.scene("pendulum")
    states, energies = {}, {}
    for method, _, h, steps, starts in PORTRAITS:
        runs = [bs.integrate(method, pendulum, h=h, steps=steps, y0=y0, observe="energy") for y0 in starts]
        states[method] = np.array([run.y for run in runs])
        energies[method] = np.array([run.observed["energy"] for run in runs])
    return PendulumPortraits(states, energies, np.array([curve for level in LEVELS for curve in _level_curves(level)]))


def _level_curves(energy: float) -> list[np.ndarray]:
    """Level curves of p²/2 − cos q: a closed curve, or one for each direction of rotation."""
    import numpy as np

    if energy < 1:
        phase = np.linspace(0, 2 * np.pi, POINTS)
        q = 2 * np.arcsin(np.sqrt((1 + energy) / 2) * np.sin(phase))  # p = √(2(1 + H)) cos(phase)
        return [np.array([np.sqrt(2 * (1 + energy)) * np.cos(phase), q])]
    q = np.linspace(-np.pi, np.pi, POINTS)
    p = np.sqrt(2 * (energy + np.cos(q)).clip(0))
    return [np.array([sign * p, q]) for sign in (1, -1)]


def columns(numbers: PendulumPortraits) -> dict[str, np.ndarray]:
    """States and energies of the runs, and the level curves by number."""
    table = {}
    for method, runs in numbers.runs.items():
        for k, ((p, q), energy) in enumerate(zip(runs, numbers.energies[method], strict=True), 1):
            key = f"{method}_{k}".replace("-", "_")
            table |= {f"p_{key}": p, f"q_{key}": q, f"energy_{key}": energy}
    for k, (p, q) in enumerate(numbers.levels, 1):
        table |= {f"p_level_{k}": p, f"q_level_{k}": q}
    return table


def draw(numbers: PendulumPortraits, figure: Figure) -> None:
    """A column for each method."""
    panels = figure.subplots(2, len(PORTRAITS), height_ratios=(1.25, 1))
    for (above, below), portrait in zip(panels.T, PORTRAITS, strict=True):
        runs = numbers.runs[portrait.method][:, :, :MOST_DRAWN]
        above.set_title(f"{portrait.title}, $h = {portrait.h:g}$", loc="center")
        _draw_cylinder(above, numbers.levels, runs)
        _draw_strip(below, numbers.levels, runs)
    panels[0, 0].set_ylabel(r"$p$ at the sides, $q = \pm\pi/2$")
    panels[1, 0].set_ylabel("momentum $p$")


def _draw_cylinder(axes: Axes, levels: np.ndarray, runs: np.ndarray) -> None:
    """The cylinder from outside, with q = 0 in front."""
    import numpy as np

    for p, q in levels:
        for is_front in (False, True):
            visible = (np.cos(q) >= 0) == is_front
            x, z = _seen(np.where(visible, p, np.nan), q)
            axes.plot(x, z, color=GREY, linewidth=0.8, alpha=1 if is_front else BEHIND)
    edge = {"color": BLACK, "linewidth": 0.7}
    half = np.linspace(-np.pi / 2, np.pi / 2, POINTS)
    for p, q, alpha in ((TOP, half, 1), (TOP, half + np.pi, 1), (-TOP, half, 1), (-TOP, half + np.pi, BEHIND)):
        axes.plot(*_seen(np.full(POINTS, p), q), **edge, alpha=alpha)
    for side in (-np.pi / 2, np.pi / 2):
        axes.plot(*_seen(np.array([-TOP, TOP]), np.full(2, side)), **edge)
    for (p, q), style in zip(runs, _styles(), strict=False):
        for is_front in (False, True):
            visible = (np.cos(q) >= 0) == is_front
            axes.plot(*_seen(p[visible], q[visible]), **style, alpha=1 if is_front else BEHIND)
    background = {"facecolor": WHITE, "edgecolor": "none", "pad": 1}
    axes.text(0, 0.5 - TOP, "$q = 0$ in front", fontsize=7, ha="center", va="top", bbox=background)
    axes.set(xticks=[], yticks=[-2, -1, 0, 1, 2])  # at the sides, where q = ±π/2, the height is p
    axes.spines["left"].set_bounds(-TOP, TOP)
    axes.spines["left"].set_position(("data", -1.15))
    axes.spines["bottom"].set_visible(False)


def _seen(p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The projection of a state to the plane of the picture."""
    import numpy as np

    return np.sin(q), p - TILT * np.cos(q)


def _draw_strip(axes: Axes, levels: np.ndarray, runs: np.ndarray) -> None:
    """The cylinder cut open."""
    for p, q in levels:
        axes.plot(q, p, color=GREY, linewidth=0.8)
    for (p, q), style in zip(runs, _styles(), strict=False):
        axes.plot(reduced_angle(q), p, **style)
    axes.set(xlabel="angle $q$", ylim=(-TOP, TOP))
    set_angle_axis(axes)


def _styles() -> list[dict[str, Any]]:
    """The plot styles of the runs."""
    common = {"linestyle": "none", "markersize": 2.2}
    return [
        {"marker": marker, "color": colour, **common}
        for marker, colour in zip("o^s", (VERMILION, BLUE, GREEN), strict=True)
    ]
