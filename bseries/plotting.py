"""Plot style for print at full size, with colours that are distinct for all readers; picture files and tables."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import AbstractContextManager
from functools import cache
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from trees.drawing import PALETTE

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure


FORMATS: dict[str, dict[str, Any]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Formats, with the metadata to remove so that files are reproducible."""


def check_format(format_: str, argument: str) -> str:
    """The name of a format, checked."""
    if format_.lower() not in FORMATS:
        raise SeriesError(f"{argument} must be one of {', '.join(FORMATS)}, but was {format_!r:.60}")
    return format_.lower()


def picture_format(path: str, argument: str = "output") -> str:
    """The format by the extension of a path.

    Args:
        path: The path.
        argument: The name of the path in messages.
    """
    return check_format(os.path.splitext(path)[1].removeprefix("."), f"the ending of the {argument} {path!r:.60}")


def check_place(path: str, argument: str) -> None:
    """Check that a file can be written, before the computation."""
    if os.path.isdir(path) or not os.path.isdir(os.path.dirname(os.path.abspath(path))):
        raise SeriesError(f"{argument} must be a file in a folder that is there, but was {path!r:.60}")


def picture(figure: Figure, format_: str) -> bytes:
    """A figure as the contents of a file."""
    from io import BytesIO

    file = BytesIO()
    with print_style():
        figure.savefig(file, format=format_, metadata=FORMATS[format_])
    return file.getvalue()


def table(columns: Mapping[str, np.ndarray]) -> list[list[str]]:
    """The rows of columns, with all digits of numbers; shorter columns are padded with empty cells."""
    return [
        list(row) for row in zip_longest(*(map(repr, column.tolist()) for column in columns.values()), fillvalue="")
    ]


PIXELS = 96
"""Pixels per inch of web pages, by CSS; files have more."""


@cache
def _print_figure() -> type[Figure]:
    """The class of figures, created on first use: matplotlib takes half a second to load."""
    from matplotlib.figure import Figure

    class PrintFigure(Figure):
        """A matplotlib figure that notebooks show with its caption."""

        caption: str = ""

        def _repr_png_(self) -> bytes:
            return picture(self, "png")

        def _repr_html_(self) -> str:
            from base64 import b64encode
            from html import escape

            data, width = b64encode(self._repr_png_()).decode(), round(self.get_figwidth() * PIXELS)
            image = f'<img alt="" width="{width}" src="data:image/png;base64,{data}"/>'
            caption = f"<figcaption>{escape(self.caption, quote=False)}</figcaption>" if self.caption else ""
            return f'<figure style="max-width: {width}px">{image}{caption}</figure>'

    return PrintFigure


BLACK, WHITE, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = PALETTE
GREY = "#999999"
"""For backgrounds: flows, level curves, guides."""

CENTIMETRE = 1 / 2.54
"""In inches, matplotlib's unit."""
DOTS = 300
"""Dots per inch in print."""

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
    """matplotlib's settings for drawing and saving, independent of the user's."""
    from matplotlib import style

    return style.context(["default", SETTINGS])


def new_figure(size: tuple[float, float], caption: str = "") -> Figure:
    """An empty figure with a size in centimetres, and its caption in notebooks."""
    figure: Any = _print_figure()(figsize=(size[0] * CENTIMETRE, size[1] * CENTIMETRE), layout="constrained")
    figure.caption = caption
    return figure
