"""Figure 2: two methods on the Lotka–Volterra equations, with the exact and the modified flow."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import after_a_turn, growing, label_panels, truncated_scene
from bseries.figures.options import read_methods, read_number, read_starts
from bseries.figures.words import column_names, listed, name_of, power_of_h, short_names, state
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, GREY, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from integrators import Method, Scene

NUMBER = 2
TITLE = "Lotka–Volterra: explicit and symplectic Euler in the exact and in the modified flow"
SIZE = (13.0, 12.5)

METHODS = ("explicit-euler", "symplectic-euler-p")
STARTS = ((2.0, 2.0), (3.5, 2.0))
SPAN = 10.0
REST = (1.0, 2.0)
"""The equilibrium that all solutions go around."""
LEAVES = (5.0, 6.5)
"""The largest p and q in the picture; curves end where they leave it."""
AROUND = (1.25, 1.6, 2.45, 2.95, 4.1, 4.8)
"""Values of p on the line q = 2 at which further curves of a periodic flow start."""
REVOLUTIONS = 3
"""Most revolutions of a spiral, forwards and backwards."""
FLOW, STEP, LONGEST = "dop853", 0.02, 40.0
"""The method for curves, its step size, and the longest time in which they may return."""
CLOSED = 1e-6
"""Relative distance below which a curve has returned to its start."""
MOST_FRAMES = 120


class Curve(NamedTuple):
    """A curve of a flow in the frame of the picture."""

    states: np.ndarray  # (2, points)
    is_closed: bool  # whether it returns to its start
    again: float  # p where it crosses the line from the equilibrium through the start after a revolution, or leaves


class LotkaVolterra(NamedTuple):
    """Data of the figure."""

    h: float  # step size
    methods: tuple[Method, ...]  # both methods
    orders: tuple[int, ...]  # the powers of h in their truncated modified equations
    starts: tuple[tuple[tuple[float, ...], ...], ...]  # starts (p, q) by method
    steps: tuple[np.ndarray, ...]  # numerical solutions by method, (starts, 2, steps + 1)
    exact: list[Curve]  # curves of the exact flow; the first ones go through the starts
    modified: tuple[list[Curve], ...]  # the same of the modified flows, by method


def numbers(*, h: object = 0.1, methods: object = METHODS, y0: object = STARTS) -> LotkaVolterra:
    """Steps of both methods up to t = 10, and the flows around them; spirals are shown from the first start only."""
    h, chosen, scene = read_number(h, "h", 0.005, 0.12), read_methods(methods, 2), bs.scene("lotka-volterra")
    starts = read_starts(y0, scene, [1, 2])
    for start in starts:
        for value, name, most in zip(start, ("p of y0", "q of y0"), LEAVES, strict=True):
            read_number(value, name, 0.01, most)
    orders = tuple(bs.order_of(method) for method in chosen)
    flows = [truncated_scene(method, scene, order + 1, h) for method, order in zip(chosen, orders, strict=True)]
    modified = tuple(_portrait(flow, starts) for flow in flows)
    shown = tuple(starts if curves[0].is_closed else starts[:1] for curves in modified)
    steps = tuple(
        np.array([bs.integrate(method, scene, h=h, steps=round(SPAN / h), y0=start).y for start in few])
        for method, few in zip(chosen, shown, strict=True)
    )
    return LotkaVolterra(h, chosen, orders, shown, steps, _portrait(scene, starts), modified)


def _portrait(flow: Scene, starts: tuple[tuple[float, ...], ...]) -> list[Curve]:
    """Curves of a flow through the starts, and others around them."""
    first = _curve(flow, starts[0])
    if first.is_closed:
        return [first, *(_curve(flow, start) for start in [*starts[1:], *((p, REST[1]) for p in AROUND)])]
    (p, q), rest = starts[0], REST
    middle = ((p - rest[0]) * (first.again - rest[0])) ** 0.5  # half a revolution away, in logarithmic scale
    return [first, _curve(flow, (rest[0] + middle, rest[1] + (q - rest[1]) * middle / (p - rest[0])))]


def _curve(flow: Scene, start: tuple[float, ...]) -> Curve:
    """The curve through a start: one revolution of a closed one, else a spiral in both directions."""
    forwards, angles = _half(flow, start, STEP)
    again, other = after_a_turn(angles, *forwards) or (float(forwards[0, -1]), np.inf)  # if it does not come around
    if abs(again - start[0]) + abs(other - start[1]) < CLOSED * max(start):
        return Curve(np.hstack([forwards[:, angles < 2 * np.pi], forwards[:, :1]]), True, again)
    backwards, _ = _half(flow, start, -STEP)
    return Curve(np.hstack([_within(backwards)[:, :0:-1], _within(forwards)]), False, again)


def _half(flow: Scene, start: tuple[float, ...], step: float) -> tuple[np.ndarray, np.ndarray]:
    """States from a start on, until they have gone around several times, and the angles turned."""
    try:
        states = bs.integrate(FLOW, flow, h=step, steps=round(LONGEST / abs(step)), y0=start).y
    except bs.integrators.StepError as error:
        states = error.trajectory.y
    p, q = states
    angles = np.unwrap(np.arctan2(q - REST[1], p - REST[0]))
    turned = abs(angles - angles[0])
    count = int(np.logical_and.accumulate(turned < 2 * np.pi * REVOLUTIONS).sum())
    return states[:, : count + 1], turned[: count + 1]


def _within(states: np.ndarray) -> np.ndarray:
    """States until they leave the frame."""
    inside = ((states > 0) & (states < np.array(LEAVES)[:, None])).all(axis=0)
    return states[:, : int(np.logical_and.accumulate(inside).sum()) + 1]


def columns(numbers: LotkaVolterra) -> dict[str, np.ndarray]:
    """The states of the numerical solutions and of all curves, by number."""
    names = column_names(numbers.methods)
    sets = dict(zip(names, numbers.steps, strict=True)) | {"exact": [curve.states for curve in numbers.exact]}
    sets |= {f"modified_{n}": [c.states for c in curves] for n, curves in zip(names, numbers.modified, strict=True)}
    table = {}
    for name, curves in sets.items():
        for k, (p, q) in enumerate(curves, 1):
            table |= {f"p_{name}_{k}": p, f"q_{name}_{k}": q}
    return table


def caption(numbers: LotkaVolterra) -> str:
    """Which modified flows are periodic, and where the truncations are."""
    names, rows = [name_of(method) for method in numbers.methods], zip(numbers.orders, numbers.modified, strict=True)
    truncated = [f"the term with {power_of_h(order)}" for order in numbers.orders]
    what = truncated[0] if truncated[0] == truncated[1] else " and ".join(truncated)
    shapes = ["closed to six digits" if curves[0].is_closed else "spirals" for _, curves in rows]
    verdict = f"of {names[0]} are {shapes[0]}, those of {names[1]} are {shapes[1]}"
    if shapes[0] == shapes[1]:
        verdict = f"of both methods are {shapes[0]}"
    starts = dict.fromkeys(start for row in numbers.starts for start in row)
    return (
        "Lecture, figure 2 (HLW, figure IX.1.2). Dots: numerical solutions of the Lotka–Volterra equations with "
        f"h = {numbers.h:g} up to t = {SPAN:g}, from the large dots at (p, q) = {listed(list(map(state, starts)))}. "
        "Left, on curves of the exact flow; right, on those of the flow of the modified equation, truncated after "
        f"{what}. The modified curves {verdict}. The starts of the lecture are not known."
    )


def draw(numbers: LotkaVolterra, figure: Figure) -> list[tuple[Line2D, np.ndarray]]:
    """A row for each method: its steps with the exact and the modified flow. Returns the dots of runs, with states."""
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    names = short_names(numbers.methods)
    label_panels(panels.flat, [f"{name}, {flow} flow" for name in names for flow in ("exact", "modified")])
    moving = []
    for row, runs, modified in zip(panels, numbers.steps, numbers.modified, strict=True):
        for axes, curves in zip(row, (numbers.exact, modified), strict=True):
            moving += _draw_panel(axes, curves, runs)
            axes.label_outer()
    shown = panels[0, 0].lines[-3:]
    figure.legend(handles=shown, loc="outside lower center", ncols=len(shown))
    return moving


def _draw_panel(axes: Axes, curves: list[Curve], runs: np.ndarray) -> list[tuple[Line2D, np.ndarray]]:
    """The curves, and the runs on those through their starts."""
    for curve in curves[len(runs) :]:
        axes.plot(*curve.states, color=GREY, linewidth=0.7)
    moving = []
    for curve, states in zip(curves, runs, strict=False):
        axes.plot(*curve.states, color=BLUE, label="flow through the start")
        (dots,) = axes.plot(*states, "o", color=ORANGE, markeredgecolor=BLACK, markeredgewidth=0.3, markersize=2.8)
        dots.set_label("numerical solution")
        axes.plot(*states[:, 0], "o", color=BLACK, markersize=5, label="start")
        moving.append((dots, states))
    axes.set(xlabel="$p$ (prey)", ylabel="$q$ (predators)", xlim=(0, LEAVES[0]), ylim=(0, LEAVES[1]))
    return moving


def frames(numbers: LotkaVolterra, figure: Figure) -> Iterator[tuple[int, int]]:
    """The steps appear one after the other."""
    moving = draw(numbers, figure)
    last = numbers.steps[0].shape[2] - 1
    counts = np.unique(np.linspace(0, last, min(last, MOST_FRAMES) + 1).astype(int))
    return growing(moving, counts)
