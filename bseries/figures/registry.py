"""Registry of figures: every file of this folder with a TITLE is one. Pictures and animations of them.

The file of a figure has

- `NUMBER`, that of the figure in the lecture, or None beyond it; `TITLE`, the subject in a line; and `SIZE`, the width
  and height in centimetres;
- ``numbers(**options)``, which computes the data; defaults are the lecture's values;
- ``columns(numbers)``, the data as columns of a table, which may have different lengths;
- ``caption(numbers)``, what there is to see, with the methods, starts and step sizes of these data;
- ``draw(numbers, figure)``, which draws on an empty figure;
- if the figure moves, ``frames(numbers, figure)``: a generator that draws on an empty figure, changes it, and yields
  for each frame its number, from 1, and the number of all frames.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from pkgutil import iter_modules
from subprocess import CalledProcessError
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.picture_files import check_place
from bseries_base.errors import not_one_of
from bseries_base.extras import optional_module
from bseries_base.plotting import new_figure, print_style
from integrators.core.text_files import atomic_write, check_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    class LectureFigure(Figure):
        """A figure of matplotlib with a caption, which may move."""

        caption: str
        animate: Callable[..., None]


PROGRESS = "progress"
"""Option of figures that take long: a function that receives the work done and all work."""
ENDINGS = ("gif", "mp4")
PER_SECOND = 15
"""Frames per second."""
DOTS = 110
"""Dots per inch of animations: a width of 17 cm has 736 pixels."""
MOST_FRAMES = 150
"""Figures have at most as many frames, which bounds the time and the size of a file."""


def figure_names() -> list[str]:
    """The names of all figures: those of the lecture in its order, then the others.

    Example:
        >>> import bseries as bs
        >>> bs.figure_names()[:2]
        ['riccati', 'lotka-volterra']
    """
    files = {name.replace("_", "-"): file for name in _modules() if hasattr(file := _load(name), "TITLE")}
    return sorted(files, key=lambda name: (files[name].NUMBER is None, files[name].NUMBER or 0, name))


def figure_file(name: str) -> ModuleType:
    """The file of a figure."""
    wanted = str(name).lower().replace("-", "_")
    if wanted in _modules() and hasattr(file := _load(wanted), "TITLE"):
        return file
    raise SeriesError(not_one_of(figure_names(), "name", name))


def _modules() -> list[str]:
    return [module.name for module in iter_modules([os.path.dirname(__file__)])]


def _load(module: str) -> Any:
    return import_module(f".{module}", __package__)


def options_of(file: ModuleType) -> dict[str, Any]:
    """The options of a figure with their defaults."""
    return {key: value for key, value in file.numbers.__kwdefaults__.items() if key != PROGRESS}


def takes_progress(file: ModuleType) -> bool:
    """Whether a figure takes long enough to report progress."""
    return PROGRESS in file.numbers.__kwdefaults__


def compute(file: ModuleType, options: Mapping[str, Any]) -> Any:
    """The data of a figure."""
    known = file.numbers.__kwdefaults__
    for option in options:
        if option not in known:
            raise SeriesError(f"option must be one of {', '.join(known)}, but was {option!r:.60}")
    return file.numbers(**options)


def drawn(file: ModuleType, numbers: Any) -> LectureFigure:
    """The picture of a figure's data."""
    optional_module("matplotlib", "a figure")
    with print_style():
        figure: Any = new_figure(file.SIZE, file.caption(numbers))
        file.draw(numbers, figure)
        figure.draw_without_rendering()  # lays out ticks with the current settings
    figure.animate = partial(animate, file, numbers)
    return figure


def animate(file: ModuleType, numbers: Any, path: Any, *, progress: Callable[[int, int], None] | None = None) -> None:
    """Write the figure as an animation, GIF or MP4 by the ending of the path; the file appears when it is complete.

    `progress` receives the number of frames written and of all frames.
    """
    check_moving(file)
    format_ = check_animation(path)
    from matplotlib import rc_context
    from matplotlib.animation import FFMpegWriter, PillowWriter

    class Frames(PillowWriter):
        """Pillow's writer, which writes nothing if it is interrupted before the first frame."""

        _frames: list[Any]

        def finish(self) -> None:
            if self._frames:
                super().finish()

    encoder: Any = {"animation.ffmpeg_path": _encoder()} if format_ == "mp4" else {}
    with TemporaryDirectory() as folder, print_style(), rc_context(encoder):
        figure, written = new_figure(file.SIZE), os.path.join(folder, f"animation.{format_}")
        writer: Any = (FFMpegWriter if format_ == "mp4" else Frames)(fps=PER_SECOND)
        try:
            with writer.saving(figure, written, DOTS):
                for frame, count in file.frames(numbers, figure):
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
        with open(written, "rb") as content:
            atomic_write(path, content.read())


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


def check_moving(file: ModuleType) -> None:
    """Refuse a figure that has no frames."""
    if not hasattr(file, "frames"):
        files = {name: figure_file(name) for name in figure_names()}
        moving = ", ".join(name for name, other in files.items() if hasattr(other, "frames"))
        given = next(name for name, other in files.items() if other is file)
        raise SeriesError(f"name must be a figure that moves, one of {moving}, but was {given!r}")


def figure(name: str, **options: Any) -> LectureFigure:
    """A figure of the lecture (E. Hairer, on backward error analysis) or beyond it, computed and drawn.

    Args:
        name: One of `figure_names`.
        options: The options of the figure; `bseries figure --list` shows them with their defaults. Methods and scenes
            are names or objects, numbers may be text such as ``"1/10"``, and starts are rows or text such as
            ``"2,2"``.

    Returns:
        A figure of matplotlib; notebooks show it with its caption, and its method ``savefig`` saves it. Some figures
        move: their method ``animate`` writes a GIF or MP4.

    Raises:
        SeriesError: The name or an option is unknown, or a value is out of range.
        IntegratorError: A text cannot be read, a step fails, or matplotlib is not installed.

    Example:
        >>> import bseries as bs
        >>> picture = bs.figure("riccati", h="1/25")
        >>> [axes.get_xlabel() for axes in picture.axes]
        ['time $t$']
        >>> picture.caption[:28]
        'Lecture, figure 1 (HLW, figu'
    """
    file = figure_file(name)
    optional_module("matplotlib", "a figure")  # before the work, not after it
    return drawn(file, compute(file, options))
