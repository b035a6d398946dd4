"""The option --plot of verbs whose results have a picture."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from bseries.cli.application import Refusal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class PlotFile(NamedTuple):
    """The file of --plot; None without it."""

    path: str | None

    def save(self, draw: Callable[[], Axes | Figure]) -> None:
        """Draw and write the picture, if one is wanted; the file appears when it is complete."""
        if self.path is not None:
            from bseries.picture_files import save_picture

            drawn: Any = draw()
            save_picture(self.path, getattr(drawn, "figure", None) or drawn)


def takes_plot(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Add --plot FILE to a verb, which receives a `PlotFile` as `plot`."""

    @click.option("--plot", "path_of_plot", metavar="FILE", help="Draw a picture: .png, .svg or .pdf.")
    @functools.wraps(verb)
    def call(*, path_of_plot: str | None, **options: Any) -> Any:
        if path_of_plot is not None:
            from bseries.picture_files import check_picture

            check_picture(path_of_plot)
            if options.get("path") is not None and os.path.realpath(options["path"]) == os.path.realpath(path_of_plot):
                raise Refusal(f"plot must be another file than that of -o, but both were {path_of_plot!r:.60}")
        return verb(plot=PlotFile(path_of_plot), **options)

    return call
