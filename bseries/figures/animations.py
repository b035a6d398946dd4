"""Animations as files: frames of a figure, written one by one as GIF or MP4."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from subprocess import CalledProcessError
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.picture_files import check_place
from foundation.extras import optional_module
from integrators.core.text_files import atomic_write, check_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENDINGS = ("gif", "mp4")
PER_SECOND = 15
"""Frames per second."""
DOTS = 110
"""Dots per inch: a width of 17 cm has 736 pixels."""
MOST_FRAMES = 150
"""Figures have at most as many frames, which bounds the time and the size of a file."""


def check_animation(path: Any) -> str:
    """The format of an animation by the ending of its file, checked with all that its writing needs."""
    name = check_path(path, "animate")
    format_ = os.path.splitext(name)[1].removeprefix(".").lower()
    if format_ not in ENDINGS:
        raise SeriesError(f"animate must be a file that ends in .{' or .'.join(ENDINGS)}, but was {name!r:.60}")
    check_place(name, "animate")
    optional_module("matplotlib", "an animation")
    if format_ == "mp4":
        _encoder()
    return format_


def _encoder() -> str:
    """The program that encodes MP4: ffmpeg on the path, or that of the package imageio-ffmpeg."""
    from matplotlib.animation import FFMpegWriter

    if FFMpegWriter.isAvailable():
        return FFMpegWriter.bin_path()
    return optional_module("imageio_ffmpeg", "an MP4, without ffmpeg on the path,").get_ffmpeg_exe()


def save_animation(
    path: Any, figure: Figure, frames: Iterator[tuple[int, int]], progress: Callable[[int, int], None] | None = None
) -> None:
    """Write the frames of a figure; the file appears when it is complete.

    Args:
        path: The file, which ends in .gif or .mp4.
        figure: The figure.
        frames: Changes the figure, and yields the number of each frame, from 1, and of all frames.
        progress: A function that receives these numbers.

    Raises:
        SeriesError: The path has another ending, or the program that encodes MP4 fails.
        ImportError: matplotlib or this program is not installed.
        IntegratorError: The file cannot be written.
    """
    from matplotlib import rc_context
    from matplotlib.animation import FFMpegWriter, PillowWriter

    format_ = check_animation(path)
    encoder: Any = {"animation.ffmpeg_path": _encoder()} if format_ == "mp4" else {}
    with TemporaryDirectory() as folder, rc_context(encoder):
        written = os.path.join(folder, f"animation.{format_}")
        writer: Any = (FFMpegWriter if format_ == "mp4" else PillowWriter)(fps=PER_SECOND)
        try:
            with writer.saving(figure, written, DOTS):
                for frame, count in frames:
                    if frame == 1:  # places stay: labels of other widths would let the axes jump
                        figure.draw_without_rendering()
                        figure.set_layout_engine("none")
                    writer.grab_frame(facecolor="white")
                    if progress is not None:
                        progress(frame, count)
        except (BrokenPipeError, CalledProcessError):
            raise SeriesError(
                f"animate must be a file that ffmpeg can write, but {encoder.get('animation.ffmpeg_path')} failed on "
                f"{str(path)!r:.60}"
            ) from None
        with open(written, "rb") as file:
            atomic_write(path, file.read())
