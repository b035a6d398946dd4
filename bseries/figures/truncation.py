"""Figure 3: truncations of the modified equation of the Lotka–Volterra equations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs
from bseries.exceptions import SeriesError
from bseries.figures.helpers import after_a_turn, label_panels, truncated_scene
from bseries.figures.options import read_count, read_methods, read_number, read_start
from bseries.figures.words import column_names, listed, name_of, power_of_h, scientific, short_names, state
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, WHITE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from integrators import Method

NUMBER = 3
TITLE = "Lotka–Volterra: the modified equations truncated after h and after h²"
SIZE = (15.0, 17.5)

METHODS = ("explicit-euler", "symplectic-euler-p")
SPAN = 10.0
START = (2.0, 2.0)
REST = (1.0, 2.0)
"""The equilibrium that all solutions go around."""
FINE = 5
"""Points of the curves per step."""
MOST_TERMS = 6
REVOLUTIONS_STEPS = 20_000
"""Steps from which the mean period of a numerical solution is found."""
RETURNED = 1e-5
"""Relative change of the distance from the equilibrium in a revolution below which a solution is periodic."""
ZOOM, FLAT = 5.0, 0.7
"""Half the width of an enlarged window in distances of a step from the curve with two terms; height by width."""
BEFORE_END = 0.9
"""Part of the time from which the window is chosen, so that the curves go through it."""


class Truncation(NamedTuple):
    """Data of the figure."""

    h: float  # step size
    y0: tuple[float, ...]  # start
    methods: tuple[Method, ...]  # both methods
    t: np.ndarray  # times of the steps
    fine_t: np.ndarray  # times of the curves: those of the steps and between them
    steps: tuple[np.ndarray, ...]  # numerical solutions (2, steps + 1) by method
    curves: tuple[np.ndarray, ...]  # solutions of the modified equations by method, (terms, 2, points)
    # periods by method: of the steps, and of the solutions with 1, 2, … terms; nan where they are not periodic
    periods: tuple[np.ndarray, ...]

    def distances(self, k: int) -> np.ndarray:
        """The distances |y_n − y(t_n)| of the steps of the k-th method from the curves, (terms, steps + 1)."""
        return np.linalg.norm(self.curves[k][:, :, ::FINE] - self.steps[k], axis=1)

    def window(self, k: int) -> tuple[tuple[float, float], float]:
        """Centre and half width of the part in which the curves of the k-th method can best be told apart.

        It is around the step that is furthest from the curve with two terms (or one, if there are no others) as a set.
        """
        curve, steps = self.curves[k][min(1, len(self.curves[k]) - 1)], self.steps[k]
        start, side = curve[:, :-1, None], np.diff(curve)[:, :, None]
        along = ((steps[:, None] - start) * side).sum(axis=0) / (side**2).sum(axis=0)
        gaps = np.linalg.norm(steps[:, None] - start - along.clip(0, 1) * side, axis=0).min(axis=0)
        far = int(gaps[: round(BEFORE_END * len(gaps))].argmax())
        return (float(steps[0, far]), float(steps[1, far])), ZOOM * float(gaps[far])


def numbers(*, h: object = 0.1, terms: object = 3, methods: object = METHODS, y0: object = START) -> Truncation:
    """Steps up to t = 10, and the solutions of the equations truncated after 1 term (the exact one), 2, …"""
    h, terms = read_number(h, "h", 0.005, 0.12), read_count(terms, "terms", 1, MOST_TERMS)
    chosen, scene = read_methods(methods, 2), bs.scene("lotka-volterra")
    start = read_start(y0, scene)
    if min(start) <= 0 or np.linalg.norm(np.array(start) - REST) < 0.01:
        raise SeriesError(f"y0 must have positive p and q and must not be the equilibrium (1, 2), but was {y0!r:.60}")
    runs = [bs.integrate(method, scene, h=h, steps=round(SPAN / h), y0=start) for method in chosen]
    fine_t = np.arange((len(runs[0].t) - 1) * FINE + 1) * (h / FINE)

    def curves(method: Method) -> np.ndarray:
        scenes = (truncated_scene(method, scene, k + 1, h) for k in range(terms))
        return np.array([bs.reference_solution(truncated, fine_t, y0=start) for truncated in scenes])

    found = tuple(curves(method) for method in chosen)
    periods = tuple(
        np.array([_mean_period(method, h, start), *(_period(fine_t, curve) for curve in rows)])
        for method, rows in zip(chosen, found, strict=True)
    )
    return Truncation(h, start, chosen, runs[0].t, fine_t, tuple(run.y for run in runs), found, periods)


def _angle_and_radius(states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The angle turned around the equilibrium since the start, and the distance from it."""
    q, p = states[1] - REST[1], states[0] - REST[0]
    angle = np.unwrap(np.arctan2(q, p))
    return abs(angle - angle[0]), np.hypot(p, q)


def _period(t: np.ndarray, states: np.ndarray) -> float:
    """The time of a revolution; not a number if the solution has not returned to its start."""
    angle, radius = _angle_and_radius(states)
    time, back = after_a_turn(angle, t, radius) or (np.nan, np.inf)
    return time if abs(back / radius[0] - 1) < RETURNED else np.nan


def _mean_period(method: Method, h: float, start: tuple[float, ...]) -> float:
    """The mean time of a revolution of the numerical solution; not a number if its distance from rest drifts."""
    try:
        run = bs.integrate(method, "lotka-volterra", h=h, steps=REVOLUTIONS_STEPS, y0=start)
    except bs.integrators.StepError:
        return np.nan
    angle, radius = _angle_and_radius(run.y)
    half = len(radius) // 2
    if abs(radius[half:].max() / radius[:half].max() - 1) > RETURNED:
        return np.nan
    return float(2 * np.pi * run.t[-1] / angle[-1])


def columns(numbers: Truncation) -> dict[str, np.ndarray]:
    """States and distances at the times of the steps, and the curves at theirs."""
    table = {"t": numbers.t, "t_curves": numbers.fine_t}
    for j, key in enumerate(column_names(numbers.methods)):
        table |= dict(zip((f"p_{key}", f"q_{key}"), numbers.steps[j], strict=True))
        for k, (curve, distance) in enumerate(zip(numbers.curves[j], numbers.distances(j), strict=True), 1):
            ending = f"{key}_{k}_terms"
            table |= {f"p_{ending}": curve[0], f"q_{ending}": curve[1], f"distance_{ending}": distance}
        table[f"periods_{key}"] = numbers.periods[j]
    return table


def caption(numbers: Truncation) -> str:
    """The last distances, and the periods where solutions are periodic."""
    names = [name_of(method) for method in numbers.methods]
    ends = [
        f"{listed([scientific(d, 2) for d in numbers.distances(k)[:, -1]])} for {name}" for k, name in enumerate(names)
    ]
    labels = ["the given equations", *(f"the truncation after {power_of_h(k)}" for k in range(1, MOST_TERMS))]
    text = (
        f"Lecture, figure 3 (HLW, figure IX.1.3). Two methods on the Lotka–Volterra equations with h = {numbers.h:g} "
        f"from (p, q) = {state(numbers.y0)}, with the exact solution and the solutions of the modified equations "
        "truncated after h, h², …. (a), (b) Phase plane; (c), (d) the framed parts, enlarged; (e), (f) distances "
        f"from the steps at the same time. At t = {numbers.t[-1]:g} they are {'; '.join(ends)}."
    )
    for name, periods in zip(names, numbers.periods, strict=True):
        if (periods > 0).all():
            of = [f"{t:.3f} for {label}" for t, label in zip(periods, ["the steps", *labels], strict=False)]
            text += f" Distances of {name} grow with the differences of periods: {listed(of)}."
    return text


def draw(numbers: Truncation, figure: Figure) -> None:
    """From above: the curves, a part of them enlarged, and their distances from the steps."""
    from matplotlib.patches import Rectangle

    panels = figure.subplots(3, 2, height_ratios=(1.4, 1.1, 1))
    panels[2, 1].sharey(panels[2, 0])
    names = short_names(numbers.methods)
    label_panels(panels.flat, [*names, "frame in (a)", "frame in (b)", *(f"{name}, distances" for name in names)])
    for k, (above, middle, below) in enumerate(panels.T):
        _draw_curves(above, numbers, k, 2.0)
        _draw_curves(middle, numbers, k, 4.5)
        (p, q), half = numbers.window(k)
        middle.set(xlim=(p - half, p + half), ylim=(q - FLAT * half, q + FLAT * half))
        middle.spines[:].set_visible(True)
        corner, sides = (p - half, q - FLAT * half), (2 * half, 2 * FLAT * half)
        above.add_patch(Rectangle(corner, *sides, fill=False, edgecolor=BLACK, linewidth=0.8, zorder=5))
        for distance, style in zip(numbers.distances(k), _styles(numbers), strict=True):
            below.semilogy(numbers.t[1:], distance[1:], **style)
        below.set(xlabel="time $t$", xlim=(0, SPAN))
    for row, label in zip(panels[:, 0], ("$q$ (predators)", "$q$ (predators)", "distance from the steps"), strict=True):
        row.set_ylabel(label)
    figure.legend(handles=panels[0, 0].lines, loc="outside lower center", ncols=4)


def _draw_curves(axes: Axes, numbers: Truncation, k: int, size: float) -> None:
    """The curves of the k-th method, and its steps as dots of a size."""
    for curve, style in zip(numbers.curves[k], _styles(numbers), strict=True):
        axes.plot(*curve, **style)
    dots = {"color": WHITE, "markeredgecolor": BLACK, "markeredgewidth": 0.6, "markersize": size, "linestyle": "none"}
    axes.plot(*numbers.steps[k], "o", **dots, label=f"numerical solution, $h = {numbers.h:g}$")
    axes.set_xlabel("$p$ (prey)")


def _styles(numbers: Truncation) -> list[dict[str, Any]]:
    """The plot styles of the curves, by the number of terms."""
    labels = ["exact solution", "after $h$", *(f"after $h^{k}$" for k in range(2, MOST_TERMS))]
    colours = GREY, VERMILION, BLUE, GREEN, PURPLE, ORANGE
    dashes = "-", "-.", (0, (1, 1)), "--", (0, (6, 1)), (0, (4, 1, 1, 1, 1, 1))
    styles = list(zip(labels, colours, dashes, strict=True))[: len(numbers.curves[0])]
    return [{"label": label, "color": colour, "linestyle": dash} for label, colour, dash in styles]
