"""How figures look: sizes for print at their own width, colours that all can tell apart."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

from trees.drawing import PALETTE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLACK, WHITE, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = PALETTE
GREY = "#999999"
"""For what is behind: flows, levels, guides."""

CENTIMETRE = 1 / 2.54
"""In inches, matplotlib's unit."""
DOTS = 300
"""Dots to an inch in print."""

SETTINGS: dict[str, Any] = {
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 8,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "lines.linewidth": 1.2,
    "lines.markersize": 3,
    "patch.linewidth": 0.6,
    "savefig.dpi": DOTS,
    "svg.hashsalt": "bseries",
}


def print_style() -> AbstractContextManager[None]:
    """matplotlib's settings while figures are drawn and saved, whatever the user's own are."""
    from matplotlib import style

    return style.context(["default", SETTINGS])


def new_figure(size: tuple[float, float], caption: str = "") -> Figure:
    """An empty figure, its size in centimetres, with what notebooks write below it."""
    from ..print_figure import PrintFigure

    figure = PrintFigure(figsize=(size[0] * CENTIMETRE, size[1] * CENTIMETRE), layout="constrained")
    figure.caption = caption
    return figure
