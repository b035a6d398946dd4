"""Checked names and formats of picture files, and the data of figures as rows."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries_base.extras import optional_module
from bseries_base.plotting import FORMATS, picture
from integrators.core.text_files import atomic_write, check_path

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure


def check_format(format_: str, argument: str) -> str:
    """The name of a format, checked."""
    if format_.lower() not in FORMATS:
        raise SeriesError(f"{argument} must be one of {', '.join(FORMATS)}, but was {format_!r:.60}")
    return format_.lower()


def picture_format(path: str, argument: str = "output") -> str:
    """The format by the extension of a path."""
    return check_format(os.path.splitext(path)[1].removeprefix("."), f"the ending of the {argument} {path!r:.60}")


def check_place(path: str, argument: str) -> None:
    """Check that a file can be written, before the computation."""
    if os.path.isdir(path) or not os.path.isdir(os.path.dirname(os.path.abspath(path))):
        raise SeriesError(f"{argument} must be a file in a folder that is there, but was {path!r:.60}")


def check_picture(path: Any) -> str:
    """Check the path of a picture before the computation, and return its format."""
    name = check_path(path, "plot")
    kind = picture_format(name, "plot")
    check_place(name, "plot")
    optional_module("matplotlib", "a picture")
    return kind


def save_picture(path: Any, figure: Figure) -> None:
    """Write a figure in the format of the path's extension; the file appears when it is complete."""
    atomic_write(path, picture(figure, check_picture(path)))


def data_rows(columns: Mapping[str, np.ndarray]) -> list[list[str]]:
    """The rows of columns, with all digits of numbers; shorter columns are padded with empty cells."""
    return [
        list(row) for row in zip_longest(*(map(repr, column.tolist()) for column in columns.values()), fillvalue="")
    ]
