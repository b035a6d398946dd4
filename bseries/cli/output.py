"""Where an answer goes and in which format: --format, -o, and writing that leaves nothing half done."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

import click

from bseries.cli import table
from bseries.cli.application import Refusal
from bseries.cli.progress import Progress

T = TypeVar("T")

FORMATS = ("table", "json", "csv", "latex", "markdown")
NO_LATEX = ("table", "json", "csv", "markdown")
"""Of verbs that measure: nothing there is a formula."""
SUFFIXES = {"": "table", ".txt": "table", ".json": "json", ".csv": "csv", ".tex": "latex", ".md": "markdown"}

MOST_ROWS = 100_000
"""Beyond so many trees only CSV is written: it streams."""


class Output(NamedTuple):
    """Where an answer goes: a format, a file or None for stdout, and the bar that shows the progress towards it."""

    format: str
    path: str | None
    progress: Progress

    @property
    def on_terminal(self) -> bool:
        """Whether somebody looks at it."""
        return self.path is None and sys.stdout.isatty()

    @property
    def width(self) -> int | None:
        """Columns of the terminal; None where lines may be as long as they are."""
        if not self.on_terminal:
            return None
        from shutil import get_terminal_size

        return get_terminal_size().columns

    def track(self, rows: Iterable[T], total: int) -> Iterator[T]:
        """The rows; each one taken moves the progress bar."""
        for done, row in enumerate(rows):
            if done % 256 == 0:
                self.progress.update(done, total)
            yield row

    def check_rows(self, count: int) -> None:
        """Refuse more rows than a format can hold that is not streamed."""
        if count > MOST_ROWS and self.format != "csv":
            raise Refusal(
                f"order must be smaller, or format csv, to write more than {MOST_ROWS:,} trees, but there are {count:,}"
            )

    def listing(
        self,
        columns: Sequence[table.Column],
        rows: Sequence[table.Row],
        title: str,
        notes: Sequence[str],
        sections: int | None = None,
    ) -> Iterable[str]:
        """A title, a table and notes for readers, in Markdown or plain text.

        In plain text an empty line stands wherever the column number `sections` changes.
        """
        if self.format == "markdown":
            return [table.markdown(columns, rows, title=title, notes=notes)]
        text = table.text(columns, rows if sections is None else table.sections(rows, sections), self.width)
        return [table.paragraphs([title, ""], self.width), text, table.paragraphs(["", *notes], self.width)]

    def write(self, chunks: Iterable[str]) -> None:
        """Write text piece by piece; a file appears when it is complete."""
        if self.path is not None:
            from integrators.core.text_files import atomic_write

            atomic_write(self.path, "".join(chunks))
            return
        for chunk in chunks:
            if self.on_terminal:
                self.progress.close()
            sys.stdout.write(chunk)


class WholeNumber(click.ParamType):
    """An integer; the library says which ones will do."""

    name = "N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Read the text."""
        try:
            return int(value)
        except ValueError:
            name = param.name if param else "number"
            raise Refusal(f"{name} must be a whole number, but was {value!r:.60}") from None


def takes_output(
    verb: Callable[..., Iterable[str]], formats: Sequence[str] = FORMATS, also: Sequence[str] = ()
) -> Callable[..., None]:
    """Give a verb the options --format and -o; it gets an `Output` and returns the text to write.

    Args:
        verb: The verb.
        formats: The formats that it has.
        also: Suffixes of files that are not text and do not come here, for the sentence on wrong ones.
    """

    @click.option("--format", "format_", metavar="FORMAT", help=f"One of {', '.join(formats)}; by default, table.")
    @click.option("-o", "--output", "path", metavar="FILE", help="Write to FILE; its suffix tells the format.")
    @functools.wraps(verb)
    def write(*, format_: str | None, path: str | None, **options: Any) -> None:
        target = None if path == "-" else path
        with Progress() as progress:
            output = Output(_choose_format(format_, target, formats, also), target, progress)
            if target is not None:
                _check_folder(target)
            output.write(verb(output=output, **options))

    return write


def _choose_format(given: str | None, path: str | None, formats: Sequence[str], also: Sequence[str]) -> str:
    if given is not None:
        if given not in formats:
            raise Refusal(f"format must be one of {', '.join(formats)}, but was {given!r:.60}")
        return given
    suffix = os.path.splitext(path or "")[1].lower()
    if SUFFIXES.get(suffix) not in formats:
        known = ", ".join([*(name for name, text in SUFFIXES.items() if name and text in formats), *also])
        raise Refusal(f"output must end in one of {known} where --format is not given, but was {path!r:.60}")
    return SUFFIXES[suffix]


def _check_folder(path: str) -> None:
    """Refuse before the work what is sure to fail after it."""
    folder = os.path.dirname(os.path.abspath(path))
    if os.path.isdir(path) or not os.path.isdir(folder) or not os.access(folder, os.W_OK):
        what = "a folder" if os.path.isdir(path) else f"in {folder!r:.60}, where no file can be made"
        raise Refusal(f"output must be a file that can be written, but was {what}")


def names_or_none(names: Sequence[str]) -> Sequence[str] | None:
    """Names of colours for texts about trees: none where there is one colour."""
    return names if len(names) > 1 else None
