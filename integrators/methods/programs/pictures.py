"""Methods as pictures: tableaux in mathtext, other methods in a font of fixed width."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from foundation.plotting import BLACK, drawing, fit_picture, in_centimetres
from integrators.core.errors import IntegratorError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FONT, GAP, LINE = 9.0, 7.0, 0.7
"""Font size, gaps around entries and line width of a tableau, in points."""


class Tableau:
    """Rows of formulas, with a line to the right of the first column and below some rows.

    Args:
        rows: The formulas as LaTeX that mathtext knows; shorter rows have empty cells.
        below: The number of rows above the horizontal line.
        title: A name above.
    """

    def __init__(self, rows: Sequence[Sequence[str]], below: int, title: str = ""):
        self._below, self._title = below, title
        self._rows = [[cell and f"${cell}$".replace(r"\frac", r"\dfrac") for cell in row] for row in rows]
        boxes = [[_extent(cell) for cell in row] for row in self._rows]
        columns = range(max(map(len, rows)))
        self._widths = [max(row[k][0] for row in boxes if k < len(row)) + 2 * GAP for k in columns]
        self._heights = [max(box[1] for box in row) + GAP for row in boxes]
        self._top = 2 * FONT if title else 0.0
        self.width, self.height = sum(self._widths), sum(self._heights) + self._top

    def draw(self, ax: Axes, left: float, top: float, scale: float) -> None:
        """Draw with the upper left corner at a point, in points; fonts are scaled."""
        text = {"fontsize": FONT * scale, "ha": "center", "va": "center"}
        if self._title:
            ax.text(left + self.width / 2, top + FONT / 2, self._title, **text)
        y = top + self._top
        for k, (row, height) in enumerate(zip(self._rows, self._heights, strict=True)):
            x = left
            if k == self._below:
                ax.plot([left, left + self.width], [y, y], color=BLACK, linewidth=LINE * scale)
            for cell, width in zip(row, self._widths, strict=False):
                ax.text(x + width / 2, y + height / 2, cell, **text)
                x += width
            y += height
        border = left + self._widths[0]
        ax.plot([border, border], [top + self._top, y], color=BLACK, linewidth=LINE * scale)


def _extent(cell: str) -> tuple[float, float]:
    """Width and height of a formula, in points."""
    from matplotlib.textpath import TextPath

    if not cell:
        return 0.0, FONT
    box = TextPath((0, 0), cell, size=FONT).get_extents()
    return box.width, max(box.height, FONT)


def tableaux_picture(tableaux: Sequence[Tableau], ax: Axes | None) -> Axes:
    """Tableaux side by side, on axes without a frame."""
    size = sum(t.width + 2 * GAP for t in tableaux), max(t.height for t in tableaux) + 2 * GAP
    with drawing(ax, IntegratorError, in_centimetres(size), frame=False) as axes:
        scale, left = fit_picture(axes, size), GAP
        for tableau in tableaux:
            tableau.draw(axes, left, GAP, scale)
            left += tableau.width + 2 * GAP
    return axes


ASPECT, LEADING = 0.602, 1.35
"""Width of a letter of fixed width, and distance of lines, relative to the font size."""


def _listing_size(text: str) -> tuple[float, float]:
    """Width and height in points of lines in a font of fixed width."""
    lines = text.splitlines()
    return FONT * ASPECT * max(map(len, lines)) + 2 * GAP, FONT * LEADING * len(lines) + 2 * GAP


def _draw_listing(ax: Axes, text: str, scale: float) -> None:
    """Draw lines in a font of fixed width."""
    style: Any = {"family": "monospace", "fontsize": FONT * scale, "linespacing": LEADING / 1.2, "parse_math": False}
    ax.text(GAP, GAP, text, va="top", **style)


WIDTH = 100
"""Most characters in a line: more do not fit a page."""


def method_picture(self: Any, ax: Axes | None = None) -> Axes:
    """The table of the method as a picture: the flows of a splitting, or the evaluations of a program.

    Example:
        >>> from integrators import method
        >>> print(method("lie-trotter").plot().texts[0].get_text())
        lie-trotter
        <BLANKLINE>
        step  flow of  coefficient of h
        ────  ───────  ────────────────
           1  a        1
           2  b        1
    """
    lines = self.to_table()._replace(notes=()).to_text(WIDTH)
    size = _listing_size(lines)
    with drawing(ax, IntegratorError, in_centimetres(size), frame=False) as axes:
        _draw_listing(axes, lines, fit_picture(axes, size))
    return axes
