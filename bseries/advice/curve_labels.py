"""Names of curves beside a diagram, at the heights of their ends as far as they do not hide one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Label(NamedTuple):
    """A name, its colour, and the point where its curve ends."""

    text: str
    colour: str
    x: float
    y: float


def label_ends(panel: Axes, labels: Sequence[Label], *, least: float = 0.036, size: float = 8) -> None:
    """Write names on the right of a panel, with thin lines to the ends of their curves.

    Args:
        panel: The panel, with its curves and scales.
        labels: The names.
        least: The least distance of two of them, in heights of the panel.
        size: The size of the letters, in points.
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
                "relpos": (0, 0.5),  # from the left, so that no line crosses a name
            },
        )


def spread(heights: Sequence[float], least: float) -> list[float]:
    """Ascending heights moved apart to a least distance, each run of close ones about its mean.

    Example:
        >>> [round(height, 2) for height in spread([0.1, 0.5, 0.5, 0.51], 0.1)]
        [0.1, 0.4, 0.5, 0.6]
    """
    groups: list[list[float]] = []
    for height in heights:
        groups.append([height])
        while len(groups) > 1 and _bottom(groups[-1], least) - _top(groups[-2], least) < least:
            last = groups.pop()
            groups[-1] += last
    return [_bottom(group, least) + least * k for group in groups for k in range(len(group))]


def _bottom(group: Sequence[float], least: float) -> float:
    return sum(group) / len(group) - least * (len(group) - 1) / 2


def _top(group: Sequence[float], least: float) -> float:
    return _bottom(group, least) + least * (len(group) - 1)
