"""Methods that are no tableaux as pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from foundation.diagrams import draw_listing, listing_size
from foundation.plotting import drawing
from integrators.core.errors import IntegratorError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH = 100
"""Most characters in a line: more do not fit a page."""


def method_picture(self: Any, ax: Axes | None = None) -> Axes:
    """The table of the method as a picture: the flows of a splitting, or the evaluations of a program.

    Args:
        self: The method.
        ax: The axes, whose frame is hidden; None for a new figure of suitable size.

    Returns:
        The axes.

    Raises:
        IntegratorError: `ax` is no axes.
        ImportError: matplotlib is not installed.

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
    with drawing(ax, IntegratorError, listing_size(lines), frame=False) as axes:
        draw_listing(axes, lines)
    return axes
