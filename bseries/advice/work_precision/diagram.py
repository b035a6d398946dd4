"""Work–precision diagram: a panel for each error measure, with CPU time against the error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.plotting import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, new_figure, print_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bseries.advice.work_precision.curves import Curve
    from bseries.advice.work_precision.precision_curves import WorkPrecision


class Label(NamedTuple):
    """A name, its colour, and the end of its curve."""

    text: str
    colour: str
    x: float
    y: float


def label_ends(panel: Axes, labels: Sequence[Label], *, least: float = 0.036, size: float = 8) -> None:
    """Write names to the right of a panel, with thin lines to the ends of their curves.

    Args:
        panel: The panel, with its curves and scales set.
        labels: The names.
        least: The least distance of two names, relative to the height of the panel.
        size: The font size in points.
    """
    panel.autoscale_view()
    to_panel = panel.transData + panel.transAxes.inverted()
    heights = [float(to_panel.transform((label.x, label.y))[1]) for label in labels]
    order = sorted(range(len(labels)), key=heights.__getitem__)
    for k, height in zip(order, spread([heights[k] for k in order], least), strict=True):
        label = labels[k]
        panel.annotate(
            label.text,
            xy=(label.x, label.y),
            xytext=(1.02, height),
            textcoords="axes fraction",
            color=label.colour,
            fontsize=size,
            va="center",
            arrowprops={
                "arrowstyle": "-",
                "color": label.colour,
                "lw": 0.4,
                "alpha": 0.6,
                "shrinkA": 2,
                "shrinkB": 2,
                "relpos": (0, 0.5),  # from the left edge of the name
            },
        )


def spread(heights: Sequence[float], least: float) -> list[float]:
    """Ascending heights moved apart to a least distance, each group about its mean.

    Example:
        >>> [round(height, 2) for height in spread([0.1, 0.5, 0.5, 0.51], 0.1)]
        [0.1, 0.4, 0.5, 0.6]
    """
    groups: list[list[float]] = []
    for height in heights:
        groups.append([height])
        while len(groups) > 1 and _bottom(groups[-1], least) - _bottom(groups[-2], least) < least * len(groups[-2]):
            last = groups.pop()
            groups[-1] += last
    return [_bottom(group, least) + least * k for group in groups for k in range(len(group))]


def _bottom(group: Sequence[float], least: float) -> float:
    return sum(group) / len(group) - least * (len(group) - 1) / 2


COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK)
DASHES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "D", "^", "v", "P", "X")
WIDTH, HEIGHT = 15.0, 7.5
"""Size of a panel, in centimetres."""
LABEL_SIZE, LABEL_DISTANCE = 7, 0.055
LEGEND = "strong lines: the cheapest method for some error"
AXES = {
    "solution": "largest error of the solution, relative to the size of the state",
    "energy": "largest error of the energy, relative to it",
    "modified-energy": "largest change of the modified energy, relative to it",
}
SAMPLES = 50
"""Number of errors for which the cheapest method is found."""
BEYOND = 10.0
"""Factor by which the axis exceeds the errors of interest, on both sides."""


def draw(found: WorkPrecision) -> Figure:
    """Draw the measurements.

    Of a method the rows are shown that no other of it beats; methods that are the cheapest for some error are strong.
    """
    measures = [measure for measure in found.measures if any(curve.front(measure) for curve in found.curves)]
    with print_style():
        figure = new_figure((WIDTH, HEIGHT * len(measures)))
        panels = figure.subplots(len(measures), 1, squeeze=False)[:, 0]
        for panel, measure in zip(panels, measures, strict=True):
            _panel(panel, found, measure)
        panels[0].set_title(f"{found.scene.title}, t = 0 to {found.span:g}", loc="left")
        panels[0].set_title(LEGEND, loc="right", fontsize=LABEL_SIZE)
    return figure


def _panel(panel: Axes, found: WorkPrecision, measure: str) -> None:
    loosest, finest = found.errors
    limits = min(loosest * BEYOND, 1.0), finest / BEYOND
    panel.set(xscale="log", yscale="log", xlabel=AXES[measure], ylabel="CPU time in seconds", xlim=limits)
    panel.grid(color="#dddddd", linewidth=0.4)
    shown = [(k, curve, _within(curve, measure, limits)) for k, curve in enumerate(found.curves)]
    best = _cheapest(found, measure)
    labels = []
    for k, curve, points in shown:
        if not points:
            continue
        strong = curve.candidate.name in best
        colour = COLOURS[k % len(COLOURS)]
        panel.plot(*zip(*points, strict=True), **_style(k, colour, strong))
        labels.append(Label(curve.candidate.name, colour, *points[-1]))
    label_ends(panel, labels, least=LABEL_DISTANCE, size=LABEL_SIZE)


def _cheapest(found: WorkPrecision, measure: str) -> set[str]:
    """The methods that are cheapest for some error of interest."""
    loosest, finest = found.errors
    best = set[str]()
    for k in range(SAMPLES + 1):
        error = loosest * (finest / loosest) ** (k / SAMPLES)
        times = {curve.candidate.name: t for curve in found.curves if (t := curve.seconds(error, measure)) is not None}
        best |= {min(times, key=times.__getitem__)} if times else set()
    return best


def _within(curve: Curve, measure: str, limits: tuple[float, float]) -> list[tuple[float, float]]:
    """The points of a curve within the limits."""
    return [(error, seconds) for error, seconds in curve.front(measure) if limits[1] <= error <= limits[0]]


def _style(k: int, colour: str, strong: bool) -> dict[str, Any]:
    """The plot style of the k-th curve."""
    dash, marker = DASHES[k // len(COLOURS) % len(DASHES)], MARKERS[k % len(MARKERS)]
    style = {"color": colour, "linestyle": dash, "marker": marker}
    if strong:
        return {**style, "linewidth": 1.4, "markersize": 3.2}
    return {**style, "linewidth": 0.6, "markersize": 2, "alpha": 0.55}
