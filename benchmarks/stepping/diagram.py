"""The work-precision diagram: error against CPU time, both logarithmic, a panel for each problem."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from .precision import OURS, Curve, front
from .problems import Problem

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {OURS: "#0072B2", "rebound": "#D55E00", "heyoka": "#009E73", "scipy": "#666666"}
"""Of Okabe and Ito's palette, which people who do not see all colours can tell apart; markers differ as well."""
MARKERS = {OURS: "o", "rebound": "s", "heyoka": "D", "scipy": "^"}
DASHES = ("-", "--", "-.", ":")
ERRORS = (1e-1, 1e-15)
"""What the error's axis shows, from rough to precise."""
LINE = 0.036
"""The least distance between two labels, in heights of a panel."""


def draw(curves: Sequence[Curve], problems: Sequence[Problem]) -> Figure:
    """A panel for each problem; of a curve the points that no other of it beats.

    Curves that are somewhere the best of their package are strong and have their names beside their last points.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5 * len(problems), 7.5))
    room = {"left": 0.15 / len(problems), "right": 1 - 0.35 / len(problems), "wspace": 0.75}  # for names on the right
    panels = figure.subplots(1, len(problems), squeeze=False, gridspec_kw=room)[0]
    for panel, problem in zip(panels, problems, strict=True):
        _panel(panel, [curve for curve in curves if curve.problem == problem.name])
        panel.set(title=problem.title, xlabel="largest relative error of energy", ylabel="CPU time in seconds")
    return figure


def _panel(panel: Axes, curves: Sequence[Curve]) -> None:
    panel.set(xscale="log", yscale="log", xlim=ERRORS)
    panel.grid(color="#dddddd", linewidth=0.5)
    panel.spines[["top", "right"]].set_visible(False)
    ends, drawn = [], Counter()
    fronts = [(curve, [p for p in front(curve.points) if ERRORS[1] < p.error < ERRORS[0]]) for curve in curves]
    shown = [(curve, points) for curve, points in fronts if points]
    best = {
        package: set(front(p for curve, points in shown if curve.package == package for p in points))
        for package in COLOURS
    }
    for curve, points in shown:
        package, colour = curve.package, COLOURS[curve.package]
        xy = [p.error for p in points], [p.seconds for p in points]
        if best[package].isdisjoint(points):
            panel.plot(*xy, color=colour, linewidth=0.7, alpha=0.3)
            continue
        ours = package == OURS
        panel.plot(
            *xy,
            color=colour,
            marker=MARKERS[package],
            linestyle=DASHES[drawn[package] % len(DASHES)],
            markersize=4 if ours else 3,
            linewidth=2 if ours else 1,
        )
        drawn[package] += 1
        ends.append((curve.method if ours else f"{package} {curve.method}", colour, points[-1]))
    _label(panel, ends)


def _label(panel: Axes, ends: Sequence[tuple[str, str, Any]]) -> None:
    """Names beside the panel, at the height of the ends they belong to as far as they do not hide one another."""
    panel.autoscale_view()
    to_panel = panel.transData + panel.transAxes.inverted()
    heights = [float(to_panel.transform((end.error, end.seconds))[1]) for _, _, end in ends]
    order = sorted(range(len(ends)), key=heights.__getitem__)
    placed = _spread([heights[k] for k in order])
    for k, height in zip(order, placed, strict=True):
        label, colour, end = ends[k]
        panel.annotate(
            label,
            xy=(end.error, end.seconds),
            xytext=(1.02, height),
            textcoords="axes fraction",
            color=colour,
            fontsize=8,
            va="center",
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.4, "alpha": 0.6},
        )


def _spread(heights: Sequence[float]) -> list[float]:
    """Ascending heights moved apart to LINE at least, each run of close ones about its mean."""
    groups: list[list[float]] = []
    for height in heights:
        groups.append([height])
        while len(groups) > 1 and _bottom(groups[-1]) - _top(groups[-2]) < LINE:
            last = groups.pop()
            groups[-1] += last
    return [_bottom(group) + LINE * k for group in groups for k in range(len(group))]


def _bottom(group: Sequence[float]) -> float:
    return sum(group) / len(group) - LINE * (len(group) - 1) / 2


def _top(group: Sequence[float]) -> float:
    return _bottom(group) + LINE * (len(group) - 1)
