"""Work–precision diagram: a panel for each error measure, with CPU time against the error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from foundation.plotting import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, new_figure, print_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bseries.advice.work_precision.precision_curves import WorkPrecision

COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK)
DASHES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "D", "^", "v", "P", "X")
WIDTH, HEIGHT = 15.0, 7.5
"""Size of a panel, in centimetres."""
NAME_SIZE = 7
"""Font size of the names of methods, in points: twenty fit beside a panel."""
LEGEND = "strong lines: the cheapest method for some error"
AXES = {
    "solution": "largest error of the solution, relative to the size of the state",
    "energy": "largest error of the energy, relative to it",
}
SAMPLES = 50
"""Number of errors for which the cheapest method is found: five or more for each power of ten."""
BEYOND = 10.0
"""Factor by which the axis exceeds the errors of interest, on both sides, so that curves do not end at its edges."""


def name_curves(panel: Axes, size: float = NAME_SIZE) -> None:
    """Write the names of curves to the right of a panel, in the order in which the curves end there."""
    named = (line for line in panel.lines if not str(line.get_label()).startswith("_"))
    lines = sorted(named, key=lambda line: -float(line.get_ydata()[-1]))  # pyright: ignore[reportArgumentType, reportIndexIssue]
    panel.legend(handles=lines, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=size)


def draw(found: WorkPrecision) -> Figure:
    """Draw the measurements.

    Each curve is the Pareto front of a method; methods that are the cheapest for some error have thick lines.
    """
    measures = [measure for measure in found.measures if any(curve.front(measure) for curve in found.curves)]
    with print_style():
        figure = new_figure((WIDTH, HEIGHT * len(measures)))
        panels = figure.subplots(len(measures), 1, squeeze=False)[:, 0]
        for panel, measure in zip(panels, measures, strict=True):
            _panel(panel, found, measure)
        panels[0].set_title(f"{found.scene.title}, t = 0 to {found.span:g}", loc="left")
        panels[0].set_title(LEGEND, loc="right", fontsize=NAME_SIZE)
    return figure


def _panel(panel: Axes, found: WorkPrecision, measure: str) -> None:
    loosest, finest = found.errors
    limits = min(loosest * BEYOND, 1.0), finest / BEYOND
    panel.set(xscale="log", yscale="log", xlabel=AXES[measure], ylabel="CPU time in seconds", xlim=limits)
    panel.grid(color="#dddddd", linewidth=0.4)
    best = _cheapest(found, measure)
    for k, curve in enumerate(found.curves):
        points = [point for point in curve.front(measure) if limits[1] <= point[0] <= limits[0]]
        if points:
            panel.plot(
                *zip(*points, strict=True), label=curve.candidate.name, **_style(k, curve.candidate.name in best)
            )
    name_curves(panel)


def _cheapest(found: WorkPrecision, measure: str) -> set[str]:
    """The methods that are cheapest for some error of interest."""
    loosest, finest = found.errors
    best = set[str]()
    for k in range(SAMPLES + 1):
        error = loosest * (finest / loosest) ** (k / SAMPLES)
        times = {curve.candidate.name: t for curve in found.curves if (t := curve.seconds(error, measure)) is not None}
        best |= {min(times, key=times.__getitem__)} if times else set()
    return best


def _style(k: int, strong: bool) -> dict[str, Any]:
    """The plot style of the k-th curve."""
    style = {
        "color": COLOURS[k % len(COLOURS)],
        "linestyle": DASHES[k // len(COLOURS) % len(DASHES)],
        "marker": MARKERS[k % len(MARKERS)],
    }
    weight = {"linewidth": 1.4, "markersize": 3.2} if strong else {"linewidth": 0.6, "markersize": 2, "alpha": 0.55}
    return {**style, **weight}
