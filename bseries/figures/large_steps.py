"""Figure 6: the implicit midpoint rule on the pendulum with large steps, and its modified Hamiltonian."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import reduced_angle, set_angle_axis
from foundation.plotting import BLUE, GREEN, GREY, PURPLE, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NUMBER = 6
TITLE = "Pendulum: implicit midpoint rule with large steps, on level curves of its modified Hamiltonian"
CAPTION = (
    "Lecture, figure 6. Four orbits of 20,000 steps, started at the large dots, and the level curves of H + h²H₃ "
    "through these starts. Where the pendulum rotates, the level curves of the opposite rotation are shown as well. "
    "Up to h = 0.7 the orbits stay near the level curves. For h = 1 the third orbit consists of islands, as at a "
    "resonance. None of the four orbits is visibly chaotic before h = 1.3, where the second one is. The larger the "
    "momentum, the smaller the step size from which on H + h²H₃ no longer describes an orbit. The figure chaos-onset "
    "shows all starts."
)
SIZE = (17.0, 12.0)

METHOD = "implicit-midpoint"
STEPS, PIECE = 20_000, 2000
TERMS = 3
"""H + h²H₃."""
STEP_SIZES = (0.3, 0.7, 1.0, 1.3, 1.35, 1.6)
STARTS = ((0.0, -1.5), (0.0, -2.5), (1.5, -pi), (2.5, -pi))
GRID = 241
TOP, BOTTOM = 7.1, -2.8
"""The largest and the least momentum in the picture: for h = 1.35 the fourth orbit reaches 6.9."""


class LargeSteps(NamedTuple):
    """Data of the figure."""

    h: np.ndarray  # step sizes
    states: np.ndarray  # steps, (step sizes, starts, 2, steps + 1), with angles from −π to π
    energies: np.ndarray  # modified Hamiltonian H + h²H₃ along them, (step sizes, starts, steps + 1)
    p: np.ndarray  # momenta of the grid
    q: np.ndarray  # its angles
    levels: np.ndarray  # modified Hamiltonian there, (step sizes, momenta, angles)


def numbers() -> LargeSteps:
    """Runs for all step sizes, and the modified Hamiltonian on a grid."""
    import numpy as np

    p, q = np.linspace(BOTTOM, TOP, GRID), np.linspace(-np.pi, np.pi, GRID)
    grid = np.array([values.ravel() for values in np.meshgrid(p, q, indexing="ij")])
    energy = bs.modified_hamiltonian(bs.method(METHOD), bs.scene("pendulum"), TERMS)
    states = np.array([[orbit(h, start) for start in STARTS] for h in STEP_SIZES])
    energies = [[energy(y, h) for y in runs] for runs, h in zip(states, STEP_SIZES, strict=True)]
    levels = [energy(grid, h).reshape(GRID, GRID) for h in STEP_SIZES]
    return LargeSteps(np.array(STEP_SIZES), states, np.array(energies), p, q, np.array(levels))


def orbit(h: float, start: Sequence[float]) -> np.ndarray:
    """The steps from a start, (2, steps + 1), in pieces: large angles would spoil the force by rounding."""
    import numpy as np

    pieces, y = [np.array(start)[:, None]], np.array(start)
    for _ in range(STEPS // PIECE):
        run = bs.integrate(METHOD, bs.scene("pendulum"), h=h, steps=PIECE, y0=y)
        pieces.append(run.y[:, 1:])
        y = np.array([run.y[0, -1], reduced_angle(run.y[1, -1])])
    p, q = np.hstack(pieces)
    return np.array([p, reduced_angle(q)])


def columns(numbers: LargeSteps) -> dict[str, np.ndarray]:
    """States and modified energies of all runs, and the grid as a table of its points."""
    import numpy as np

    table = {}
    for h, states, energies in zip(numbers.h, numbers.states, numbers.energies, strict=True):
        for k, ((p, q), values) in enumerate(zip(states, energies, strict=True), 1):
            table |= {f"p_{k}_h={h:g}": p, f"q_{k}_h={h:g}": q, f"energy_{k}_h={h:g}": values}
    p, q = np.meshgrid(numbers.p, numbers.q, indexing="ij")
    table |= {"p_grid": p.ravel(), "q_grid": q.ravel()}
    return table | {f"energy_grid_h={h:g}": levels.ravel() for h, levels in zip(numbers.h, numbers.levels, strict=True)}


def draw(numbers: LargeSteps, figure: Figure) -> None:
    """A panel for each step size."""
    panels = figure.subplots(2, len(numbers.h) // 2, sharex=True, sharey=True)
    for k, axes in enumerate(panels.flat):
        _draw_panel(axes, numbers, k)
        axes.set_title(f"$h = {numbers.h[k]:g}$", loc="center")
        axes.set(xlabel="angle $q$", ylabel="momentum $p$")
        axes.label_outer()
    named = [line for line in panels[0, 0].lines if not str(line.get_label()).startswith("_")]
    figure.legend(handles=named, loc="outside lower center", ncols=len(named), columnspacing=1.2)


def _draw_panel(axes: Axes, numbers: LargeSteps, k: int) -> None:
    import numpy as np

    values = np.unique(numbers.energies[k, :, 0])
    axes.contour(numbers.q, numbers.p, numbers.levels[k], values, colors=GREY, linewidths=0.6, linestyles="solid")
    axes.plot([], [], color=GREY, linewidth=0.6, label="level curves")
    colours, names = (BLUE, GREEN, PURPLE, VERMILION), ("0, -1.5", "0, -2.5", r"1.5, -\pi", r"2.5, -\pi")
    for (p, q), colour, name in zip(numbers.states[k], colours, names, strict=True):
        axes.plot(q, p, ".", color=colour, markersize=0.8, markeredgewidth=0, rasterized=True)
        label = f"$(p, q) = ({name})$"
        axes.plot(q[0], p[0], "o", color=colour, markersize=3.5, clip_on=False, zorder=4, label=label)
    axes.set_ylim(BOTTOM, TOP)
    set_angle_axis(axes)
