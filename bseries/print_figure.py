"""Figures that a notebook shows, without pyplot and its global state.

Not in `figures`, where every file is a figure of the lecture.
"""

from __future__ import annotations

from matplotlib.figure import Figure

from .figures.saving import picture

PIXELS = 96
"""Pixels of a page to an inch, by the definition of CSS; files have more dots."""


class PrintFigure(Figure):
    """A figure of matplotlib; IPython asks for its picture, and notebooks show it with its caption."""

    caption: str = ""
    """What there is to see."""

    def _repr_png_(self) -> bytes:
        return picture(self, "png")

    def _repr_html_(self) -> str:
        from base64 import b64encode
        from html import escape

        data, width = b64encode(self._repr_png_()).decode(), round(self.get_figwidth() * PIXELS)
        image = f'<img alt="" width="{width}" src="data:image/png;base64,{data}"/>'
        caption = f"<figcaption>{escape(self.caption, quote=False)}</figcaption>" if self.caption else ""
        return f'<figure style="max-width: {width}px">{image}{caption}</figure>'
