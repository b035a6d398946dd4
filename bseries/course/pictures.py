"""The package's figures as pictures of the course, and their data."""

from __future__ import annotations

from functools import cache
from typing import Any

from bseries.course.pages import Picture
from bseries.figures.registry import compute, drawn, figure_file
from foundation.plotting import picture

FEWER: dict[str, dict[str, Any]] = {"lennard-jones-drift": {"members": 128}}
"""Options of figures that would take minutes."""
LARGEST = 1_000_000
"""Bytes of a drawing with lines; larger ones are shown as pixels."""


@cache
def figure_data(name: str) -> Any:
    """The data of a figure, computed once: the text quotes some of its numbers.

    Args:
        name: One of `bs.figure_names()`.

    Raises:
        SeriesError: There is no figure of this name.

    Example:
        >>> figure_data("theorem-3").exponents.round()[:3]
        array([1., 2., 3.])
    """
    return compute(figure_file(name), FEWER.get(name, {}))


def drawn_picture(name: str) -> Picture:
    """A figure, drawn with lines unless that were too large.

    Args:
        name: One of `bs.figure_names()`.

    Raises:
        SeriesError: There is no figure of this name.
        MissingPackage: matplotlib is not installed.

    Example:
        >>> drawn_picture("theorem-3").suffix
        'svg'
    """
    figure = drawn(figure_file(name), figure_data(name))
    lines = picture(figure, "svg")
    return Picture(lines, "svg") if len(lines) <= LARGEST else Picture(picture(figure, "png"), "png")
