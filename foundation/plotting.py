"""Plot style for print at full size, with colours that are distinct for all readers."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FORMATS: dict[str, dict[str, Any]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Formats, with the metadata to remove so that files are reproducible."""


def picture(figure: Figure, format_: str) -> bytes:
    """A figure as the contents of a file."""
    from io import BytesIO

    file = BytesIO()
    with print_style():
        figure.savefig(file, format=format_, metadata=FORMATS[format_])
    return file.getvalue()


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


PALETTE = ("#000000", "#ffffff", "#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7")
"""Fill of colours 0, 1, …, repeated beyond the last: black and white as in the literature on partitioned methods, then
the colours of Okabe and Ito (2008), distinguishable by the colour-blind."""
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
