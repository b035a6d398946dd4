"""Kinds of diagrams as functions of arrays, for the `plot` methods of results."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bseries_base.plotting import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, Style

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.legend import Legend
    from numpy.typing import ArrayLike

COLOURS = (BLUE, ORANGE, BLACK, VERMILION, SKY, GREEN, PURPLE)
"""Colours of curves; consecutive ones also differ in greyscale."""
DASHES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D", "v", "P", "<", "X", ">", "*", "d")
"""The numbers of colours, dashes and markers are coprime in pairs, so that combinations repeat late."""
SHADE = "#c6dbef"
"""Colour of regions, light enough for lines and text on it."""
MANY = 10_000
"""Curves with more points are stored as images in PDF and SVG."""
OVER_DATA: Style = {"loc": "best", "frameon": True, "framealpha": 0.85, "edgecolor": "none"}
"""Style of a legend inside the axes; curves do not cross its text."""
BAR = 0.6
"""Thickness of a bar, as a fraction of the distance between bars."""


def line_style(k: int) -> Style:
    """Colour and dashes of the k-th curve.

    Example:
        >>> len({tuple(line_style(k).values()) for k in range(28)})
        28
    """
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)]}


def of_line(style: Style, **usual: Any) -> Style:
    """The properties of a line: the usual ones, and those that a user gives by names or short names of matplotlib.

    Example:
        >>> of_line({"lw": 2}, linewidth=1, color="red")
        {'linewidth': 2, 'color': 'red'}
    """
    from matplotlib.cbook import normalize_kwargs
    from matplotlib.lines import Line2D

    return usual | normalize_kwargs(style, Line2D)


def draw_curves(
    ax: Axes,
    x: ArrayLike,
    curves: Mapping[str, Sequence[float] | np.ndarray],
    *,
    first: int = 0,
    points: bool = False,
    **style: Any,
) -> None:
    """Draw curves over x, or only their points, after `first` others; with a legend if there are several."""
    for k, (name, y) in enumerate(curves.items(), first):
        own = line_style(k)
        if points:
            own |= {"linestyle": "none", "marker": MARKERS[k % len(MARKERS)], "markersize": 1.5}
        ax.plot(x, y, **of_line(style, label=name, rasterized=len(y) > MANY, **own))
    if first + len(curves) > 1:
        draw_legend(ax)


GREEK = "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi chi psi omega"
_SYMBOL = re.compile(rf"(?P<letter>[A-Za-z]|{GREEK.replace(' ', '|')})_?(?P<index>[0-9]*)")


def axis_label(name: str, change: bool = False) -> str:
    """The label of an axis for a variable or a quantity, or for its change since the start; symbols are italic.

    Example:
        >>> axis_label("t"), axis_label("q1"), axis_label("theta", change=True), axis_label("energy", change=True)
        ('time $t$', '$q_{1}$', '$\\\\theta - \\\\theta(0)$', 'error of the energy, $H - H_0$')
        >>> axis_label("angular_momentum", change=True)
        'change of angular_momentum since the start'
    """
    if name == "t":
        return "time $t$"
    if name == "energy":
        return "error of the energy, $H - H_0$" if change else "energy $H$"
    found = _SYMBOL.fullmatch(name)
    if found is None:
        return f"change of {name} since the start" if change else name
    letter = found["letter"] if len(found["letter"]) == 1 else f"\\{found['letter']}"
    symbol = letter + (f"_{{{found['index']}}}" if found["index"] else "")
    return f"${symbol} - {symbol}(0)$" if change else f"${symbol}$"


def draw_band(ax: Axes, x: ArrayLike, low: ArrayLike, high: ArrayLike, label: str, color: str = SHADE) -> None:
    """Shade the region between two curves."""
    ax.fill_between(x, low, high, color=color, linewidth=0, label=label, zorder=0)


def draw_legend(ax: Axes, handles: Sequence[Artist] | None = None, **options: Any) -> Legend:
    """Draw a legend to the right of the axes, or inside them if the layout of the figure leaves no room."""
    outside = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5), "frameon": False}
    managed: Any = ax.figure
    place = OVER_DATA if managed.get_layout_engine() is None else outside
    chosen = {} if handles is None else {"handles": handles}
    return ax.legend(**place, **chosen, **options)


def draw_region(ax: Axes, x: np.ndarray, y: np.ndarray, values: np.ndarray) -> None:
    """Draw the region of the plane where values, (len(y), len(x)), are negative, its border and the axes."""
    import numpy as np

    ax.axhline(0, color=GREY, linewidth=0.6, zorder=1.5)
    ax.axvline(0, color=GREY, linewidth=0.6, zorder=1.5)
    bounded = np.clip(values, -1, 1)  # only signs and small values matter
    ax.contourf(x, y, bounded, levels=[-2, 0], colors=[SHADE])
    ax.contour(x, y, bounded, levels=[0], colors=[BLUE], linewidths=1.2)


def draw_levels(ax: Axes, x: np.ndarray, y: np.ndarray, values: np.ndarray, count: int) -> None:
    """Draw `count` level curves of values, (len(y), len(x)), with about equal areas between them."""
    import numpy as np

    finite = np.where(np.isfinite(values), values, np.nan)
    levels = np.unique(np.nanquantile(finite, np.linspace(0, 1, count + 2)[1:-1]))
    ax.contour(x, y, finite, levels=levels, colors=[GREY], linewidths=0.8, linestyles="solid")


def draw_bars(
    ax: Axes, names: Iterable[str], values: Sequence[float], errors: ArrayLike | None = None, **style: Any
) -> None:
    """Draw horizontal bars with their names, the first one on top."""
    places = range(len(values))
    whiskers = {} if errors is None else {"xerr": errors, "error_kw": {"linewidth": 0.8, "capsize": 2}}
    ax.barh(places, values, height=BAR, **{"color": SHADE, "edgecolor": BLUE, "linewidth": 0.8, **whiskers, **style})
    ax.set_yticks(places, list(names))
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(len(values) - 0.5, -0.5)


def bar_height(count: int) -> float:
    """The height in centimetres of a figure with bars."""
    return 2.2 + 0.75 * count
