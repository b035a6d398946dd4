"""Plot style for print at full size, with colours that are distinct for all readers, and axes to draw on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from functools import cache, partial
from typing import TYPE_CHECKING, Any, TypeAlias

from bseries_base.extras import loaded_module, optional_module

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Style: TypeAlias = dict[str, Any]  # options of matplotlib, of many types

FORMATS: dict[str, Style] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
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
        """A matplotlib figure that notebooks show with its caption, saved with the settings of this file."""

        __qualname__ = "PrintFigure"  # by which pickle finds the class
        caption: str = ""

        def savefig(self, fname: Any, **options: Any) -> None:
            """Save with fonts that printers accept."""
            with print_style():
                super().savefig(fname, **options)

        def _repr_png_(self) -> bytes | None:
            return picture(self, "png") if self.canvas.manager is None else None  # pyplot shows its own figures

        def _repr_html_(self) -> str | None:
            from base64 import b64encode
            from html import escape

            if (png := self._repr_png_()) is None:
                return None
            data, width = b64encode(png).decode(), round(self.get_figwidth() * PIXELS)
            image = f'<img alt="" width="{width}" src="data:image/png;base64,{data}"/>'
            caption = f"<figcaption>{escape(self.caption, quote=False)}</figcaption>" if self.caption else ""
            return f'<figure style="max-width: {width}px">{image}{caption}</figure>'

    return PrintFigure


@cache
def _print_axes() -> type[Axes]:
    """The class of axes that notebooks show as their figure."""
    from matplotlib.axes import Axes

    class PrintAxes(Axes):
        """Axes of a print figure."""

        __qualname__ = "PrintAxes"

        def _repr_html_(self) -> str | None:
            figure: Any = self.figure
            return figure._repr_html_()

    return PrintAxes


def __getattr__(name: str) -> type[Figure] | type[Axes]:
    """The classes of figures and axes, which are created on first use."""
    make = {"PrintFigure": _print_figure, "PrintAxes": _print_axes}.get(name)
    if make is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return make()


_apart: ContextVar[bool] = ContextVar("apart", default=False)


@contextmanager
def apart_from_pyplot() -> Iterator[None]:
    """Figures that are drawn in this context are new, whatever pyplot's current axes are."""
    token = _apart.set(True)
    try:
        yield
    finally:
        _apart.reset(token)


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

SETTINGS: Style = {
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
    "agg.path.chunksize": 10_000,
    "savefig.dpi": DOTS,
    "pdf.fonttype": 42,
    "svg.hashsalt": "bseries",
}


def print_style() -> AbstractContextManager[None]:
    """matplotlib's settings for drawing and saving, independent of the user's."""
    from matplotlib import style

    return style.context(["default", SETTINGS])


def new_figure(size: tuple[float, float], caption: str = "", pyplot: Any = None) -> Figure:
    """An empty figure with a size in centimetres, and its caption in notebooks; with `pyplot` it is its current one."""
    kind: Any = _print_figure()
    make = kind if pyplot is None else partial(pyplot.figure, FigureClass=kind)
    figure = make(figsize=(size[0] * CENTIMETRE, size[1] * CENTIMETRE), layout="constrained")
    figure.caption = caption
    return figure


SIZE = (12.0, 7.5)
"""Width and height of a plot in centimetres: the text width of a book."""


@contextmanager
def drawing(
    ax: Axes | None, refusal: type[Exception], size: tuple[float, float] = SIZE, *, frame: bool = True
) -> Iterator[Axes]:
    """Axes to draw on: those given, pyplot's current ones, or new ones in print style in a figure of this size.

    Where pyplot is not imported figures are unknown to it. Without a frame new axes have no scales and fill the figure.
    What are no axes is refused with an error of the class `refusal`.

    Example:
        >>> with drawing(None, ValueError) as axes:
        ...     line = axes.plot([0, 1], [0, 1])
        >>> axes.figure.get_size_inches().round(2).tolist()
        [4.72, 2.95]
    """
    axes_of_matplotlib = optional_module("matplotlib.axes", "a plot")
    if ax is not None and not isinstance(ax, axes_of_matplotlib.Axes):
        raise refusal(f"ax must be axes of matplotlib or None, but was {ax!r:.60}")
    pyplot: Any = None if _apart.get() else loaded_module("matplotlib.pyplot")
    if ax is None and pyplot is not None and pyplot.get_fignums():
        ax = pyplot.gca()
    if ax is not None:
        yield ax
        return
    with print_style():
        figure = new_figure(size, pyplot=pyplot)
        place: Style = {"axes_class": _print_axes()}
        if not frame:
            figure.set_layout_engine("none")
        axes = figure.add_subplot(**place) if frame else figure.add_axes((0, 0, 1, 1), **place)
        yield axes
        figure.draw_without_rendering()  # lays out ticks with the current settings


def in_centimetres(size: tuple[float, float]) -> tuple[float, float]:
    """A size in points, of which 72 are an inch, in centimetres."""
    return size[0] / 72 / CENTIMETRE, size[1] / 72 / CENTIMETRE


def fit_picture(ax: Axes, size: tuple[float, float]) -> float:
    """Let axes without a frame show a picture of a size in points, y downwards; the factor of lengths in points."""
    width, height = size
    ax.set(xlim=(0, width), ylim=(height, 0), aspect="equal")
    ax.axis("off")
    extent = ax.get_window_extent()
    return 72 / ax.figure.dpi * min(extent.width / width, extent.height / height)
