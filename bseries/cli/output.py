"""Output of verbs: --format, -o, --plot, a progress bar, and writing that leaves no incomplete file."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Collection, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from bseries.cli.application import Refusal
from bseries_base.machine_code import is_compiling
from bseries_base.table import FORMATS, LazyRows, Table

if TYPE_CHECKING:
    from threading import Timer

    from click.shell_completion import CompletionItem
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from rich.progress import Progress as Bars
    from rich.progress import Task, TaskID

T = TypeVar("T")


def complete_file(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completions of FILE: the shell's own."""
    from click.shell_completion import CompletionItem

    return [CompletionItem(incomplete, type="file")]


NO_LATEX = tuple(name for name in FORMATS if name != "latex")
"""Formats of verbs that measure, whose results have no formulas."""
SUFFIXES = {suffix: name for name, format_ in FORMATS.items() for suffix in format_.suffixes}

MOST_ROWS = 100_000
"""The most trees of formats that are not streamed."""
PATIENCE = 1.0
"""Seconds before a bar is drawn."""
COMPILING = "compiling for the first time"


class Progress:
    """Draws a progress bar on stderr after `PATIENCE` seconds, if stderr is a terminal, and erases it at the end."""

    def __init__(self) -> None:
        self._timer: Timer | None = None
        self._bar: Bars | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> Progress:
        if sys.stderr.isatty():
            from threading import Timer

            self._timer = Timer(PATIENCE, self._draw)
            self._timer.daemon = True
            self._timer.start()
        return self

    def _draw(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, ProgressColumn, TaskProgressColumn, TimeElapsedColumn
        from rich.progress import Progress as Bars

        class Work(ProgressColumn):
            """What is being done at this moment."""

            def render(self, task: Task) -> str:
                return COMPILING if is_compiling() else task.description

        columns = Work(), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
        bar = Bars(*columns, console=Console(stderr=True), transient=True)
        self._task = bar.add_task("computing", total=None)
        bar.start()
        self._bar = bar

    def update(self, done: int, total: int) -> None:
        """Show the part of the writing that is done; before the first call the bar is indeterminate."""
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, description="writing", completed=done, total=total)

    def say(self, text: str) -> None:
        """A line on stderr, above the bar if there is one."""
        if self._bar is not None:
            self._bar.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            click.echo(text, err=True)

    def close(self) -> None:
        """Erase the bar, or keep it from being drawn."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer.join()
            self._timer = None
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


class Output(NamedTuple):
    """The format of an answer, its file or None for stdout, and the progress bar."""

    format: str
    path: str | None
    progress: Progress

    @property
    def on_terminal(self) -> bool:
        """Whether the output is written to a terminal."""
        return self.path is None and sys.stdout.isatty()

    @property
    def width(self) -> int | None:
        """The width of the terminal; None for output of unlimited width."""
        if not self.on_terminal:
            return None
        from shutil import get_terminal_size

        return get_terminal_size().columns

    @property
    def has_records(self) -> bool:
        """Whether the records of tables are written, without notes."""
        return FORMATS[self.format].streams

    def check_rows(self, count: int) -> None:
        """Refuse too many rows for a format that is not streamed."""
        if count > MOST_ROWS and not self.has_records:
            raise Refusal(
                f"order must be smaller, or format csv, to write more than {MOST_ROWS:,} trees, but there are {count:,}"
            )

    def write(self, answer: Table | str) -> None:
        """Write a table in the format, or text; a file appears when it is complete."""
        pieces = [answer] if isinstance(answer, str) else self._tracked(answer).write(self.format, self.width)
        if self.path is not None:
            from integrators.core.text_files import atomic_write

            atomic_write(self.path, "".join(pieces))
            return
        for piece in pieces:
            if self.on_terminal:
                self.progress.close()
            sys.stdout.write(piece)

    def _tracked(self, table: Table) -> Table:
        """The table with rows that update the progress bar."""

        def track() -> Iterator[object]:
            for done, row in enumerate(table.rows):
                if done % 256 == 0:
                    self.progress.update(done, len(table.rows))
                yield row

        records = table.records and self._tracked(table.records)
        return table._replace(rows=LazyRows(track, len(table.rows)), records=records)


def takes_output(verb: Callable[..., Table | str], formats: Collection[str] = FORMATS) -> Callable[..., None]:
    """Add the options --format and -o to a verb, which receives an `Output` and returns a table or text."""

    @click.option("--format", "format_", metavar="FORMAT", help=f"One of {', '.join(formats)}; by default, table.")
    @click.option(
        "-o", "--output", "path", metavar="FILE", shell_complete=complete_file,
        help="Write to FILE, in the format of its suffix.",
    )  # fmt: skip
    @functools.wraps(verb)
    def write(*, format_: str | None, path: str | None, **options: object) -> None:
        target = None if path == "-" else path
        with Progress() as progress:
            output = Output(_choose_format(format_, target, formats), target, progress)
            if target is not None:  # refuse a file that cannot be written before the computation
                folder = os.path.dirname(os.path.abspath(target))
                if os.path.isdir(target) or not os.path.isdir(folder) or not os.access(folder, os.W_OK):
                    what = "a folder" if os.path.isdir(target) else f"in {folder!r:.60}, where no file can be made"
                    raise Refusal(f"output must be a file that can be written, but was {what}")
            output.write(verb(output=output, **options))

    return write


def takes_text(flag: str, metavar: str, help: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add an option for other text than a table; it allows any suffix of the file and excludes --format."""

    def decorate(write: Callable[..., None]) -> Callable[..., None]:
        @click.option(flag, "language", metavar=metavar, help=help)
        @functools.wraps(write)
        def call(*, language: str | None, format_: str | None, **options: object) -> None:
            if language is not None and format_ is not None:
                raise Refusal(f"format must be left out where {flag} is given, but was {format_!r:.60}")
            write(language=language, format_=format_ if language is None else "table", **options)

        return call

    return decorate


def _choose_format(given: str | None, path: str | None, formats: Collection[str]) -> str:
    if given is not None:
        if given not in formats:
            raise Refusal(f"format must be one of {', '.join(formats)}, but was {given!r:.60}")
        return given
    suffix = os.path.splitext(path or "")[1].lower()
    if SUFFIXES.get(suffix) not in formats:
        known = ", ".join(name for name, text in SUFFIXES.items() if name and text in formats)
        raise Refusal(f"output must end in one of {known} where --format is not given, but was {path!r:.60}")
    return SUFFIXES[suffix]


def make_folder(path: str, argument: str) -> None:
    """Make a folder for several files, or refuse one in which none can be made, before the computation."""
    try:
        os.makedirs(path, exist_ok=True)
    except OSError as error:
        what = f"{path!r:.60} was not: {error.strerror}"
        raise Refusal(f"{argument} must be a folder that can be made, but {what}") from None
    if not os.access(path, os.W_OK):
        raise Refusal(f"{argument} must be a folder that can be written to, but was {path!r:.60}")


class PlotFile(NamedTuple):
    """The file of --plot; None without it."""

    path: str | None

    def save(self, draw: Callable[[], Axes | Figure]) -> None:
        """Draw and write the picture, if one is wanted; the file appears when it is complete."""
        if self.path is not None:
            from bseries.picture_files import save_picture
            from bseries_base.plotting import apart_from_pyplot

            with apart_from_pyplot():
                drawn: Any = draw()
            save_picture(self.path, getattr(drawn, "figure", None) or drawn)


def takes_plot(verb: Callable[..., T]) -> Callable[..., T]:
    """Add --plot FILE to a verb, which receives a `PlotFile` as `plot`."""

    @click.option(
        "--plot", "path_of_plot", metavar="FILE", shell_complete=complete_file,
        help="Draw a picture: .png, .svg or .pdf.",
    )  # fmt: skip
    @functools.wraps(verb)
    def call(*, path_of_plot: str | None, **options: object) -> T:
        if path_of_plot is not None:
            from bseries.picture_files import check_picture

            check_picture(path_of_plot)
            path = options.get("path")
            if isinstance(path, str) and os.path.realpath(path) == os.path.realpath(path_of_plot):
                raise Refusal(f"plot must be another file than that of -o, but both were {path_of_plot!r:.60}")
        return verb(plot=PlotFile(path_of_plot), **options)

    return call
