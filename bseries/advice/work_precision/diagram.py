"""Work–precision diagram: a panel for each error measure, with CPU time against the error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from foundation.diagrams import MARKERS, draw_legend, line_style
from foundation.plotting import new_figure, print_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

    from bseries.advice.work_precision.sweeps import Curve

WIDTH, HEIGHT = 12.0, 8.0
"""Size of a panel, in centimetres."""
NAME_SIZE = 7
"""Font size of the names of methods, in points: twenty fit beside a panel."""
AXES = {
    "solution": "largest error of the solution, relative to the size of the state",
    "energy": "largest error of the energy, relative to it",
}
SAMPLES = 50
"""Number of errors for which the cheapest method is found: five or more for each power of ten."""
BEYOND = 10.0
"""Factor by which the axis exceeds the errors of interest, on both sides, so that curves do not end at its edges."""


def name_curves(panel: Axes, size: float = NAME_SIZE) -> Legend:
    """Write the names of curves to the right of a panel, in the order in which the curves end there."""
    named = (line for line in panel.lines if not str(line.get_label()).startswith("_"))
    lines = sorted(named, key=lambda line: -float(line.get_ydata()[-1]))  # pyright: ignore[reportArgumentType, reportIndexIssue]
    return draw_legend(panel, lines, fontsize=size)


def draw(curves: Sequence[Curve], errors: tuple[float, float], measures: Sequence[str], title: str) -> Figure:
    """A figure with a panel for each measure that a method has values of; see `draw_panel`."""
    shown = [measure for measure in measures if any(curve.front(measure) for curve in curves)]
    with print_style():
        figure = new_figure((WIDTH, HEIGHT * len(shown)))
        panels = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
        for panel, measure in zip(panels, shown, strict=True):
            draw_panel(panel, curves, errors, measure)
        panels[0].set_title(title)
    return figure


def draw_panel(panel: Axes, curves: Sequence[Curve], errors: tuple[float, float], measure: str) -> None:
    """Draw CPU times against an error: the Pareto front of each method, strong if it is the cheapest for some error."""
    loosest, finest = errors
    limits = min(loosest * BEYOND, 1.0), finest / BEYOND
    panel.set(xscale="log", yscale="log", xlabel=AXES[measure], ylabel="CPU time in seconds", xlim=limits)
    panel.grid(color="#dddddd", linewidth=0.4)
    best = _cheapest(curves, errors, measure)
    for k, curve in enumerate(curves):
        points = [point for point in curve.front(measure) if limits[1] <= point[0] <= limits[0]]
        if points:
            panel.plot(
                *zip(*points, strict=True), label=curve.candidate.name, **_style(k, curve.candidate.name in best)
            )
    legend = name_curves(panel)
    legend.set_title("strong: cheapest\nfor some error")
    legend.get_title().set_fontsize(NAME_SIZE)
    for line in legend.get_lines():
        line.set_linestyle("none")  # beside a panel, lines would look like curves that go on


def _cheapest(curves: Sequence[Curve], errors: tuple[float, float], measure: str) -> set[str]:
    """The methods that are cheapest for some error of interest."""
    loosest, finest = errors
    best = set[str]()
    for k in range(SAMPLES + 1):
        error = loosest * (finest / loosest) ** (k / SAMPLES)
        times = {curve.candidate.name: t for curve in curves if (t := curve.seconds(error, measure)) is not None}
        best |= {min(times, key=times.__getitem__)} if times else set()
    return best


def _style(k: int, strong: bool) -> dict[str, Any]:
    """The plot style of the k-th curve."""
    weight = {"linewidth": 1.8, "markersize": 5.5} if strong else {"linewidth": 0.6, "markersize": 3.2}
    return {**line_style(k), "marker": MARKERS[k % len(MARKERS)], **weight}
