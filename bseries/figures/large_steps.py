"""Figure 6: a symplectic method on the pendulum with large steps, and its modified Hamiltonian."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.exceptions import SeriesError
from bseries.figures.chaos_onset import APART, NEARBY, is_chaotic
from bseries.figures.helpers import growing, label_panels, logarithmic_indices, reduced_angle, set_angle_axis
from bseries.figures.options import read_count, read_method, read_numbers, read_starts
from bseries.figures.words import listed, name_of, power_of_h, scientific, state, subscript
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, GREEN, GREY, PURPLE, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from integrators import Method, Scene

NUMBER = 6
TITLE = "Pendulum: a symplectic method with large steps, on level curves of its modified Hamiltonian"
SIZE = (17.0, 12.0)

METHOD = "implicit-midpoint"
STEPS, PIECE = 20_000, 2000
"""Steps of an orbit, and those between which its angle is reduced: large angles would spoil the force by rounding."""
TERMS = 3
"""H + h²H₃ for methods of order 1 and 2; others have the first term that is not zero."""
STEP_SIZES = (0.3, 0.7, 1.0, 1.3, 1.35, 1.6)
STARTS = "0,-3/2; 0,-5/2; 3/2,-pi; 5/2,-pi"
GRID = 241
TOP, BOTTOM, FARTHEST = 3.5, -2.8, 10.0
"""The picture shows at least these momenta, and others up to the farthest."""
FRAMES, FILM_STEPS, FILM_SIZE = 140, 1000, 1.6
"""Of a film: the most frames, steps, and the size of points."""
COLOURS, MARKERS = (BLUE, GREEN, PURPLE, VERMILION), ("o", "s", "^", "D")


class LargeSteps(NamedTuple):
    """Data of the figure."""

    method: Method
    terms: int  # number of terms of the modified Hamiltonian
    starts: np.ndarray  # (starts, 2)
    h: np.ndarray  # step sizes
    states: np.ndarray  # steps, (step sizes, starts, 2, steps + 1), with angles from −π to π
    energies: np.ndarray  # modified Hamiltonian along them, (step sizes, starts, steps + 1)
    chaotic: np.ndarray  # whether orbits that start next to them lead far away, (step sizes, starts)
    p: np.ndarray  # momenta of the grid
    q: np.ndarray  # its angles
    levels: np.ndarray  # modified Hamiltonian there, (step sizes, momenta, angles)


def numbers(
    *, method: object = METHOD, h: object = STEP_SIZES, y0: object = STARTS, steps: object = STEPS
) -> LargeSteps:
    """Runs for two, four or six step sizes from up to four starts, and the modified Hamiltonian on a grid."""
    chosen, pendulum = read_method(method), bs.scene("pendulum")
    sizes = read_numbers(h, "h", [2, 4, 6], 0.01, 3)
    starts, count = read_starts(y0, pendulum, [1, 2, 3, 4]), read_count(steps, "steps", 100, 100_000)
    energy = _energy(chosen, pendulum)
    states = np.array([[orbit(size, start, chosen, count) for start in starts] for size in sizes])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bs.fields.TruncationWarning)  # where the series ends is what the figure shows
        energies = [[energy(y, size) for y in runs] for runs, size in zip(states, sizes, strict=True)]
    chaotic = [is_chaotic(np.array(starts), size, count * size, chosen) for size in sizes]
    low, high = states[:, :, 0].min(), states[:, :, 0].max()
    p = np.linspace(max(min(BOTTOM, 1.05 * low), -FARTHEST), min(max(TOP, 1.03 * high), FARTHEST), GRID)
    q = np.linspace(-np.pi, np.pi, GRID)
    grid = np.array([values.ravel() for values in np.meshgrid(p, q, indexing="ij")])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bs.fields.TruncationWarning)
        levels = [np.reshape(energy(grid, size), (GRID, GRID)) for size in sizes]
    rest = np.array(sizes), states, np.array(energies), np.array(chaotic), p, q, np.array(levels)
    return LargeSteps(chosen, energy.order, np.array(starts), *rest)


def _energy(method: Method, scene: Scene) -> bs.hamiltonians.ModifiedHamiltonian:
    """The modified Hamiltonian up to its first term beyond H."""
    broken = bs.energy_drift(method, scene).power
    if broken is not None:
        raise SeriesError(
            f"method must have a modified Hamiltonian on the pendulum, but that of {name_of(method)} ends at "
            f"{power_of_h(broken)}"
        )
    return bs.modified_hamiltonian(method, scene, max(TERMS, bs.order_of(method) + 1))


def orbit(h: float, start: Sequence[float], method: Method | str = METHOD, steps: int = STEPS) -> np.ndarray:
    """The steps from a start with angles from −π to π, (2, steps + 1)."""
    pieces, y = [np.array(start)[:, None]], np.array(start)
    for done in range(0, steps, PIECE):
        run = bs.integrate(method, bs.scene("pendulum"), h=h, steps=min(PIECE, steps - done), y0=y)
        pieces.append(run.y[:, 1:])
        y = np.array([run.y[0, -1], reduced_angle(run.y[1, -1])])
    p, q = np.hstack(pieces)
    return np.array([p, reduced_angle(q)])


def columns(numbers: LargeSteps) -> dict[str, np.ndarray]:
    """States and modified energies of all runs, and the grid as a table of its points."""
    table = {}
    for h, states, energies in zip(numbers.h, numbers.states, numbers.energies, strict=True):
        for k, ((p, q), values) in enumerate(zip(states, energies, strict=True), 1):
            table |= {f"p_{k}_h={h:g}": p, f"q_{k}_h={h:g}": q, f"energy_{k}_h={h:g}": values}
    p, q = np.meshgrid(numbers.p, numbers.q, indexing="ij")
    table |= {"p_grid": p.ravel(), "q_grid": q.ravel()}
    return table | {f"energy_grid_h={h:g}": levels.ravel() for h, levels in zip(numbers.h, numbers.levels, strict=True)}


def caption(numbers: LargeSteps) -> str:
    """Where orbits are chaotic, and how far the modified Hamiltonian goes from its values at the starts."""
    largest = abs(numbers.energies - numbers.energies[:, :, :1]).max(axis=(1, 2))
    changes = [f"{scientific(float(c), 2)} for h = {h:g}" for c, h in zip(largest, numbers.h, strict=True)]
    chaotic = [
        f"{listed([state(numbers.starts[k]) for k in np.flatnonzero(row)])} for h = {h:g}"
        for row, h in zip(numbers.chaotic, numbers.h, strict=True)
        if row.any()
    ]
    verdict = f"Chaotic are the orbits from {', from '.join(chaotic)}" if chaotic else "None of these orbits is chaotic"
    first = 2 - bs.order_of(numbers.method) % 2  # only even powers of h for even orders
    terms = "H" + "".join(f" + {power_of_h(k)}H{subscript(k + 1)}" for k in range(first, numbers.terms, first))
    return (
        f"Lecture, figure 6. Orbits of {name_of(numbers.method)} on the pendulum, of {numbers.states.shape[3] - 1:,} "
        f"steps from each marker, and the level curves of {terms} through the starts, in both directions of rotation. "
        f"Along the orbits it changes by at most {listed(changes)}. {verdict}: two orbits that start a relative "
        f"distance {scientific(NEARBY, 1)} apart {'are' if chaotic else 'would be'} more than {APART:g} apart at the "
        "end. Orbits in several pieces are islands of resonances. The figure chaos-onset shows all starts."
    )


def frames(numbers: LargeSteps, figure: Figure) -> Iterator[tuple[int, int]]:
    """The first steps appear on the level curves, more and more at once."""
    moving = draw(numbers, figure)
    counts = logarithmic_indices(min(FILM_STEPS + 1, numbers.states.shape[3]), FRAMES)
    for dots, _ in moving:
        dots.set_markersize(FILM_SIZE)
    return growing(moving, counts)


def draw(numbers: LargeSteps, figure: Figure) -> list[tuple[Line2D, np.ndarray]]:
    """A panel for each step size; returns the dots of each orbit with their coordinates."""
    panels = figure.subplots(2, len(numbers.h) // 2, sharex=True, sharey=True, squeeze=False)
    label_panels(panels.flat, [f"$h = {h:g}$" for h in numbers.h])
    moving = []
    for k, axes in enumerate(panels.flat):
        moving += _draw_panel(axes, numbers, k)
        axes.set(xlabel="angle $q$", ylabel="momentum $p$")
        axes.label_outer()
    named = [line for line in panels[0, 0].lines if not str(line.get_label()).startswith("_")]
    figure.legend(handles=named, loc="outside lower center", ncols=len(named), columnspacing=1.2)
    return moving


def _draw_panel(axes: Axes, numbers: LargeSteps, k: int) -> list[tuple[Line2D, np.ndarray]]:
    """The level curves through the starts, and the orbits, for the k-th step size."""
    values = np.unique(numbers.energies[k, :, 0])
    axes.contour(numbers.q, numbers.p, numbers.levels[k], values, colors=GREY, linewidths=0.6, linestyles="solid")
    axes.plot([], [], color=GREY, linewidth=0.6, label="level curves")
    moving = []
    for (p, q), start, colour, marker in zip(numbers.states[k], numbers.starts, COLOURS, MARKERS, strict=False):
        (dots,) = axes.plot(q, p, ".", color=colour, markersize=0.8, markeredgewidth=0, rasterized=True)
        moving.append((dots, np.array([q, p])))
        key = {"color": colour, "markeredgecolor": BLACK, "markeredgewidth": 0.5, "linestyle": "none"}
        axes.plot(q[0], p[0], marker, **key, markersize=4, clip_on=False, zorder=4, label=f"$(p, q)$ = {state(start)}")
    axes.set_ylim(numbers.p[0], numbers.p[-1])
    set_angle_axis(axes)
    return moving
