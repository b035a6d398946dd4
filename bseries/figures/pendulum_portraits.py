"""Figure 4: three methods on the pendulum, with the cylinder as phase space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs
from bseries.figures.helpers import label_panels, reduced_angle, set_angle_axis
from bseries.figures.options import read_methods, read_numbers, read_starts
from bseries.figures.words import column_names, listed, name_of, scientific, short_names, state
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, GREEN, GREY, PURPLE, VERMILION, WHITE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from integrators import Method

NUMBER = 4
TITLE = "Pendulum: phase portraits of explicit Euler, symplectic Euler and Störmer–Verlet on the cylinder"
SIZE = (17.0, 13.0)

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


METHODS, STEP_SIZES = ("explicit-euler", "symplectic-euler-p", "stormer-verlet"), (0.2, 0.3, 0.6)
LECTURE = (((0.0, 0.5),), *2 * (((0.7, 0.0), (1.4, 0.0), (2.1, 0.0)),))
"""The starts by method, if none are given."""
FEW, STEPS = 50, 1000
"""Steps of methods that are not symplectic on the pendulum, and of the others."""


class Portrait(NamedTuple):
    """A method on the pendulum."""

    method: Method
    h: float  # step size
    starts: tuple[tuple[float, ...], ...]  # initial states (p, q)
    runs: np.ndarray  # states, (starts, 2, steps + 1), with unreduced angles
    energies: np.ndarray  # their energies, (starts, steps + 1)


class PendulumPortraits(NamedTuple):
    """Data of the figure."""

    portraits: tuple[Portrait, ...]  # by method
    levels: np.ndarray  # level curves, (curves, 2, points), with angles from −π to π

    @property
    def starts(self) -> list[tuple[float, ...]]:
        """All starts; each has a marker of its own."""
        return list(dict.fromkeys(start for portrait in self.portraits for start in portrait.starts))


def numbers(*, methods: object = METHODS, h: object = STEP_SIZES, y0: object = None) -> PendulumPortraits:
    """The runs of three methods with a step size each, and level curves of the energy; starts are for all methods."""
    pendulum, chosen = bs.scene("pendulum"), read_methods(methods, 3)
    sizes = read_numbers(h, "h", [3], 0.001, 2)
    starts = LECTURE if y0 is None else 3 * (read_starts(y0, pendulum, [1, 2, 3]),)
    portraits = tuple(map(_portrait, chosen, sizes, starts))
    return PendulumPortraits(portraits, np.array([curve for level in LEVELS for curve in _level_curves(level)]))


def _portrait(method: Method, h: float, starts: tuple[tuple[float, ...], ...]) -> Portrait:
    """The runs of a method."""
    pendulum = bs.scene("pendulum")
    steps = STEPS if bs.energy_drift(method, pendulum).power is None else FEW
    runs = [bs.integrate(method, pendulum, h=h, steps=steps, y0=y0, observe="energy") for y0 in starts]
    energies = np.array([run.observed["energy"] for run in runs])
    return Portrait(method, h, starts, np.array([run.y for run in runs]), energies)


def _level_curves(energy: float) -> list[np.ndarray]:
    """Level curves of p²/2 − cos q: a closed curve, or one for each direction of rotation."""
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
    names = column_names([portrait.method for portrait in numbers.portraits])
    for name, (_, _, _, runs, energies) in zip(names, numbers.portraits, strict=True):
        for k, ((p, q), energy) in enumerate(zip(runs, energies, strict=True), 1):
            table |= {f"p_{name}_{k}": p, f"q_{name}_{k}": q, f"energy_{name}_{k}": energy}
    for k, (p, q) in enumerate(numbers.levels, 1):
        table |= {f"p_level_{k}": p, f"q_level_{k}": q}
    return table


def caption(numbers: PendulumPortraits) -> str:
    """The starts and the step sizes, and how far the energies go from their values at the start."""
    changes = []
    for method, h, starts, runs, energies in numbers.portraits:
        largest, steps = scientific(float(abs(energies - energies[:, :1]).max()), 2), runs.shape[2] - 1
        about = f"{name_of(method)} with h = {h:g} from {listed(list(map(state, starts)))}"
        changes.append(f"{about}: at most {largest} in {steps} steps")
    unknown = " The initial values of the lecture for Störmer–Verlet are not known."
    is_lecture = tuple(portrait.starts for portrait in numbers.portraits) == LECTURE
    return (
        "Lecture, figure 4. The angle q is periodic, so the states (p, q) lie on a cylinder. Above: the cylinder "
        "from the front, with its back in pale colours. Below: the cylinder cut open at q = ±π. Markers: the first "
        f"{MOST_DRAWN} steps; grey: level curves of the energy. The energy changes by: "
        f"{'; '.join(changes)}." + unknown * is_lecture
    )


def draw(numbers: PendulumPortraits, figure: Figure) -> None:
    """A column for each method."""
    panels = figure.subplots(2, len(numbers.portraits), height_ratios=(1.25, 1))
    names = short_names([portrait.method for portrait in numbers.portraits])
    titles = [f"{name}, $h = {p.h:g}$" for name, p in zip(names, numbers.portraits, strict=True)]
    label_panels(panels.flat, [*titles, *("cut open" for _ in titles)])
    markers = zip(numbers.starts, ("D", "o", "^", "s"), (PURPLE, VERMILION, BLUE, GREEN), strict=False)
    common = {"linestyle": "none", "markersize": 2.2}
    styles = {start: {"marker": marker, "color": colour, **common} for start, marker, colour in markers}
    for (above, below), portrait in zip(panels.T, numbers.portraits, strict=True):
        runs = portrait.runs[:, :, : MOST_DRAWN + 1]
        chosen = [styles[start] for start in portrait.starts]
        _draw_cylinder(above, numbers.levels, runs, chosen)
        for p, q in numbers.levels:
            below.plot(q, p, color=GREY, linewidth=0.8)
        for (p, q), style in zip(runs, chosen, strict=True):
            below.plot(reduced_angle(q), p, **style)
        below.set(xlabel="angle $q$", ylim=(-TOP, TOP))
        set_angle_axis(below)
    panels[0, 0].set_ylabel(r"$p$ at the sides, $q = \pm\pi/2$")
    panels[1, 0].set_ylabel("momentum $p$")
    keys = [panels[0, 0].plot([], [], label=state(start), **style)[0] for start, style in styles.items()]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), title="steps from the start $(p, q)$")


def _draw_cylinder(axes: Axes, levels: np.ndarray, runs: np.ndarray, styles: list[dict[str, Any]]) -> None:
    """The cylinder from outside, with q = 0 in front."""
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
    for (p, q), style in zip(runs, styles, strict=True):
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
    return np.sin(q), p - TILT * np.cos(q)
