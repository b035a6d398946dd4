"""A patch of phase space carried along: by two methods, and by the exact and the modified flow."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.exceptions import SeriesError
from bseries.figures.helpers import label_panels, truncated_scene
from bseries.figures.options import read_count, read_methods, read_number, read_start
from bseries.figures.words import column_names, name_of, scientific, short_names, state
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, SKY, VERMILION
from integrators.runs.titles import printed_name
from integrators.scenes.catalogue.registry import as_scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

    from integrators import Method, Scene

NUMBER = None
TITLE = "Area of a patch of phase space under two methods, the exact and the modified flow"
SIZE = (17.0, 14.0)

METHODS = ("explicit-euler", "symplectic-euler-p")
START = (0.0, 1.5)
"""The centre of the patch on the pendulum."""
TREE = ((0, -5), (1, -5), (1, -3), (4, -3), (2, 0), (3, 0), (1, 3), (1.7, 3), (0, 6))
"""Corners of the right half of a fir tree, which shows how it turns and shears."""
TREE_HEIGHT = 11
SIDE = 8
"""Points of the outline on each of its sides."""
FINE = 6
"""Times of the flows per step."""
FLOW = "dop853"
SNAPSHOTS = 4
MOST_STEPS = 24
"""Most steps, which bounds the number of frames by 24 · 6 + 1."""


class Carried(NamedTuple):
    """The outline of the patch under a method and its modified flow."""

    method: Method
    steps: np.ndarray  # the patch after each step, (steps + 1, 2, points)
    modified: np.ndarray  # the same under the modified flow at all fine times


class AreaPatch(NamedTuple):
    """Data of the figure."""

    scene: Scene
    h: float  # step size
    centre: tuple[float, ...]  # the middle of the patch
    terms: int  # number of terms of the modified equations
    t: np.ndarray  # times of the steps
    fine_t: np.ndarray  # times of the flows: those of the steps and between them
    exact: np.ndarray  # the patch under the exact flow, (fine times, 2, points)
    carried: tuple[Carried, ...]  # by method


def numbers(
    *, scene: Scene | str = "pendulum", methods: object = METHODS, y0: object = None, size: object = 1.4,
    h: object = 0.3, steps: object = 15, terms: object = 3,
) -> AreaPatch:  # fmt: skip
    """The patch of a height `size` around y0, by default the start of the scene, after each step."""
    place = as_scene(scene)
    if place.dimension != 2:
        raise SeriesError(f"scene must have two variables, but {place.name} has {place.dimension}")
    h, count = read_number(h, "h", 1e-4, 10), read_count(steps, "steps", SNAPSHOTS, MOST_STEPS)
    chosen, terms = read_methods(methods, 2), read_count(terms, "terms", 1, 6)
    if y0 is None and place.name == "pendulum":
        y0 = START
    elif y0 is None and place.start is None:
        raise SeriesError(f"y0 must be given for {place.name}, which has no start, but was not")
    centre = read_start(place.y0 if y0 is None else y0, place)
    right = np.array(TREE, dtype=float)
    corners = np.vstack([right, [-1, 1] * right[-2:0:-1], right[:1]])
    corners *= read_number(size, "size", 1e-3, 100) / TREE_HEIGHT
    places = np.linspace(0, len(corners) - 1, SIDE * (len(corners) - 1) + 1)
    across, up = (np.interp(places, range(len(corners)), column) for column in corners.T)
    outline = np.array([centre[0] + up, centre[1] + across])
    flows = [(truncated_scene(method, place, terms, h), method) for method in chosen]
    exact = carry(FLOW, place, outline, h / FINE, count * FINE)
    carried = tuple(
        Carried(method, carry(method, place, outline, h, count), carry(FLOW, flow, outline, h / FINE, count * FINE))
        for flow, method in flows
    )
    t = np.arange(count + 1) * h
    return AreaPatch(place, h, centre, terms, t, np.linspace(0, t[-1], count * FINE + 1), exact, carried)


def carry(method: Method | str, scene: Scene, points: np.ndarray, h: float, count: int) -> np.ndarray:
    """Points after 0, 1, … steps, (steps + 1, variables, points).

    Raises:
        StepError: A step fails.
        SeriesError: A point has no finite state.
    """
    steps, moved = bs.stepper(method, scene), np.empty((count + 1, *points.shape))
    moved[0] = points
    for k, point in enumerate(points.T):
        now = steps.start(point, h=h)
        for j in range(1, count + 1):
            steps.advance(now, 1)
            moved[j, :, k] = now.y
    if not np.isfinite(moved).all():
        raise SeriesError(f"size must be such that the patch stays finite for {count} steps of {h:g}, but it does not")
    return moved


def areas(outlines: np.ndarray) -> np.ndarray:
    """The areas in outlines (times, 2, points), by Green's theorem; the last point is the first one.

    Example:
        >>> import numpy as np
        >>> float(areas(np.array([[[0, 1, 1, 0, 0], [0, 0, 2, 2, 0]]]))[0])
        2.0
    """
    x, y = outlines[:, 0], outlines[:, 1]
    return abs((x[:, :-1] * np.diff(y) - y[:, :-1] * np.diff(x)).sum(axis=1)) / 2


def columns(numbers: AreaPatch) -> dict[str, np.ndarray]:
    """The areas over time, and the outlines at the end."""
    table = {"t": numbers.t, "t_flows": numbers.fine_t, "area_exact": areas(numbers.exact)}
    last = {"exact": numbers.exact[-1]}
    names = column_names([found.method for found in numbers.carried])
    for key, found in zip(names, numbers.carried, strict=True):
        table |= {f"area_{key}": areas(found.steps), f"area_modified_{key}": areas(found.modified)}
        last |= {key: found.steps[-1], f"modified_{key}": found.modified[-1]}
    for key, outline in last.items():
        table |= {f"{v}_{key}": row for v, row in zip(numbers.scene.variables, outline, strict=True)}
    return table


def caption(numbers: AreaPatch) -> str:
    """How the area changes."""
    changes = []
    for found in numbers.carried:
        factors = [scientific(float(areas(rows)[-1] / areas(rows)[0])) for rows in (found.steps, found.modified)]
        changes.append(f"{factors[0]} by {name_of(found.method)} and {factors[1]} by its modified flow")
    exact = scientific(float(areas(numbers.exact)[-1] / areas(numbers.exact)[0]))
    names = ", ".join(numbers.scene.variables)
    return (
        f"Beyond the lecture, on its theorem 2. A patch of phase space around ({names}) = {state(numbers.centre)} on "
        f"the scene {printed_name(numbers.scene.name)}, carried along by two methods with h = {numbers.h:g}, by the "
        f"exact flow, and by the flows of the modified equations with {numbers.terms} terms. (a), (b) The patch at "
        f"{SNAPSHOTS} times up to t = {numbers.t[-1]:g}. (c), (d) Its area over that at the start. At the end it is "
        f"multiplied by {exact} by the exact flow, {', '.join(changes)}."
    )


def draw(numbers: AreaPatch, figure: Figure) -> None:
    """A column for each method: the patch at some times, and its area."""
    panels = _panels(numbers, figure)
    shown = [round((len(numbers.t) - 1) * k / (SNAPSHOTS - 1)) for k in range(SNAPSHOTS)]
    for (above, below), found in zip(panels, numbers.carried, strict=True):
        for k in shown:
            _move(_patch(above), numbers, found, k * FINE)
            up, across = found.steps[k]
            above.text(across[up.argmax()], up.max(), f"$t = {numbers.t[k]:.3g}$", fontsize=7, ha="center", va="bottom")
        _draw_areas(below, numbers, found, len(numbers.fine_t))
    _draw_legend(figure, panels)


def _panels(numbers: AreaPatch, figure: Figure) -> list[tuple[Axes, Axes]]:
    """The axes by method, with limits that hold all outlines."""
    panels = figure.subplots(2, 2, height_ratios=(2, 1), sharex="row", sharey="row")
    names = short_names([found.method for found in numbers.carried])
    label_panels(panels.flat, [*(f"{name}, $h = {numbers.h:g}$" for name in names), *(f"area, {n}" for n in names)])
    everything = [numbers.exact, *(rows for found in numbers.carried for rows in (found.steps, found.modified))]
    low = np.min([rows.min(axis=(0, 2)) for rows in everything], axis=0)
    high = np.max([rows.max(axis=(0, 2)) for rows in everything], axis=0)
    room = 0.08 * (high - low)
    first, second = numbers.scene.variables
    panels[0, 0].set(ylim=(low[0] - room[0], high[0] + room[0]), xlim=(low[1] - room[1], high[1] + room[1]))
    ratios = np.concatenate([areas(rows) / areas(rows[:1]) for rows in everything])
    panels[1, 0].set_ylim(min(0.95, 0.95 * ratios.min()), max(1.05, 1.05 * ratios.max()))
    panels[0, 0].set_ylabel(f"${first}$")
    panels[1, 0].set_ylabel("area / area at the start")
    for above, below in panels.T:
        above.set_xlabel(f"${second}$")
        below.set(xlabel="time $t$", xlim=(0, numbers.t[-1]))
    return [(above, below) for above, below in panels.T]


class Patch(NamedTuple):
    """The patch in the picture: under the method, the exact and the modified flow."""

    filled: Polygon
    exact: Line2D
    modified: Line2D


def _patch(axes: Axes) -> Patch:
    """The patch without points yet."""
    (filled,) = axes.fill([], [], facecolor=SKY, edgecolor=BLUE, linewidth=0.8, label="steps of the method")
    (exact,) = axes.plot([], [], color=BLACK, linewidth=0.8, linestyle=(0, (4, 1.5)), label="exact flow")
    (modified,) = axes.plot([], [], color=VERMILION, linewidth=1.2, linestyle=(0, (1, 1)), label="modified flow")
    return Patch(filled, exact, modified)


def _move(patch: Patch, numbers: AreaPatch, found: Carried, k: int) -> None:
    """Let a patch show the method (after its last step), the exact and the modified flow at a fine time."""
    patch.filled.set_xy(found.steps[k // FINE][::-1].T)  # the second variable is to the right
    patch.exact.set_data(numbers.exact[k][::-1])
    patch.modified.set_data(found.modified[k][::-1])


def _draw_areas(axes: Axes, numbers: AreaPatch, found: Carried, count: int) -> list[Line2D]:
    """The areas at the first `count` fine times, and at the steps up to there."""
    steps, exact, modified = (areas(rows) / areas(rows[:1]) for rows in (found.steps, numbers.exact, found.modified))
    t, shown = numbers.fine_t[:count], (count - 1) // FINE + 1
    return [
        *axes.plot(numbers.t[:shown], steps[:shown], "o", color=BLUE),
        *axes.plot(t, exact[:count], color=BLACK, linewidth=0.8, linestyle=(0, (4, 1.5))),
        *axes.plot(t, modified[:count], color=VERMILION, linestyle=(0, (1, 1))),
    ]


def _draw_legend(figure: Figure, panels: list[tuple[Axes, Axes]]) -> None:
    """One key for all panels."""
    above = panels[0][0]
    figure.legend(handles=[above.patches[0], *above.lines[:2]], loc="outside lower center", ncols=3)


def frames(numbers: AreaPatch, figure: Figure) -> Iterator[tuple[int, int]]:
    """The patches move; those of the methods at each step."""
    panels = _panels(numbers, figure)
    artists = [_patch(above) for above, _ in panels]
    _draw_legend(figure, panels)
    traces: list[Line2D] = []
    for k in range(len(numbers.fine_t)):
        while traces:
            traces.pop().remove()
        for (_, below), moving, found in zip(panels, artists, numbers.carried, strict=True):
            _move(moving, numbers, found, k)
            traces += _draw_areas(below, numbers, found, k + 1)
        yield k + 1, len(numbers.fine_t)
