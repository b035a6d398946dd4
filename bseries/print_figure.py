"""Figures that a notebook shows, without pyplot and its global state.

Not in `figures`, where every file is a figure of the lecture.
"""

from __future__ import annotations

from matplotlib.figure import Figure

from .figures.saving import picture


class PrintFigure(Figure):
    """A figure of matplotlib; IPython asks for its picture."""

    def _repr_png_(self) -> bytes:
        return picture(self, "png")
