"""Figures and their numbers as the content of files, the same bytes each time."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from ..exceptions import SeriesError
from .style import print_style

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure

FORMATS: dict[str, dict[str, Any]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""The formats, and what would differ from one time to the next."""


def check_format(format_: str, argument: str) -> str:
    """The name of a format.

    Raises:
        SeriesError: There is no such format.
    """
    if format_.lower() not in FORMATS:
        raise SeriesError(f"{argument} must be one of {', '.join(FORMATS)}, but was {format_!r:.60}")
    return format_.lower()


def picture_format(path: str, argument: str = "output") -> str:
    """The format that the ending of a path tells.

    Args:
        path: The path.
        argument: What messages call it.

    Raises:
        SeriesError: It tells none.
    """
    return check_format(os.path.splitext(path)[1].removeprefix("."), f"the ending of the {argument} {path!r:.60}")


def check_place(path: str, argument: str) -> None:
    """See to it that a file can be there before much is computed for it.

    Raises:
        SeriesError: It is a folder, or in none.
    """
    if os.path.isdir(path) or not os.path.isdir(os.path.dirname(os.path.abspath(path))):
        raise SeriesError(f"{argument} must be a file in a folder that is there, but was {path!r:.60}")


def picture(figure: Figure, format_: str) -> bytes:
    """A figure as a file of a format."""
    from io import BytesIO

    file = BytesIO()
    with print_style():
        figure.savefig(file, format=format_, metadata=FORMATS[format_])
    return file.getvalue()


def table(columns: Mapping[str, np.ndarray]) -> list[list[str]]:
    """The rows of columns, with all digits of their numbers; shorter ones end in empty cells."""
    return [
        list(row) for row in zip_longest(*(map(repr, column.tolist()) for column in columns.values()), fillvalue="")
    ]
