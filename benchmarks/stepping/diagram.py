"""The work-precision diagram: error against CPU time, both logarithmic, a panel for each problem."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from bseries.advice.work_precision.precision_curves import name_curves
from bseries.advice.work_precision.sweeps import pareto_front

from .precision import OURS, Curve
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


def draw(curves: Sequence[Curve], problems: Sequence[Problem]) -> Figure:
    """A panel for each problem; of a curve the points that no other of it beats.

    Curves that are somewhere the best of their package are strong and have their names in the legend.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5 * len(problems), 7.5), layout="constrained")
    panels = figure.subplots(1, len(problems), squeeze=False)[0]
    for panel, problem in zip(panels, problems, strict=True):
        _panel(panel, [curve for curve in curves if curve.problem == problem.name])
        panel.set(title=problem.title, xlabel="largest relative error of energy", ylabel="CPU time in seconds")
    return figure


def _panel(panel: Axes, curves: Sequence[Curve]) -> None:
    panel.set(xscale="log", yscale="log", xlim=ERRORS)
    panel.grid(color="#dddddd", linewidth=0.5)
    panel.spines[["top", "right"]].set_visible(False)
    drawn = Counter()
    fronts = [(curve, [p for p in curve.front if ERRORS[1] < p.error < ERRORS[0]]) for curve in curves]
    shown = [(curve, points) for curve, points in fronts if points]
    best = {
        package: set(pareto_front(p for curve, points in shown if curve.package == package for p in points))
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
            label=curve.method if ours else f"{package} {curve.method}",
            color=colour,
            marker=MARKERS[package],
            linestyle=DASHES[drawn[package] % len(DASHES)],
            markersize=4 if ours else 3,
            linewidth=2 if ours else 1,
        )
        drawn[package] += 1
    name_curves(panel, size=8)
