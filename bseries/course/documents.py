"""The documents of the course: formulas are computed, figures drawn, and pages written."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from itertools import count
from pathlib import Path
from typing import NamedTuple, TypeVar

from bseries.course.computed import computed, figure_data, filled, places
from bseries.course.pages import Picture, html_page, parsed, pdf_pages, without
from bseries.exceptions import SeriesError
from bseries.figures.registry import drawn, figure_file
from foundation.extras import optional_module
from foundation.plotting import picture
from integrators.core.errors import not_one_of
from integrators.core.text_files import atomic_write


class Document(NamedTuple):
    """A document of the course.

    Attributes:
        source: The Markdown file beside this one.
        title: The title.
        layout: The templates of its pages: slides or sheets.
        left_out: The class of blocks that are left out.
    """

    source: str
    title: str
    layout: str
    left_out: str = ""


LARGEST = 1_000_000
"""Bytes of a drawing with lines; larger ones are shown as pixels."""
DOCUMENTS = {
    "slides": Document("slides.md", "Backward error analysis", "slides"),
    "handout": Document("proofs.md", "Backward error analysis: the theorems with their proofs", "sheets"),
    "exercises": Document("exercises.md", "Backward error analysis: exercises", "sheets", "solution"),
    "solutions": Document("exercises.md", "Backward error analysis: exercises with solutions", "sheets"),
}
"""All documents by name."""
FORMATS = {"html": html_page, "pdf": pdf_pages}
"""Formats by name, and what makes a file of a document."""
HERE = Path(__file__).parent
FIGURE = re.compile(r"\]\(figure:([\w-]+)\)")
"""A figure of the package in the text."""

Item = TypeVar("Item")


def make_course(
    folder: str | os.PathLike[str],
    documents: Collection[str] = tuple(DOCUMENTS),
    formats: Collection[str] = tuple(FORMATS),
    *,
    progress: Callable[[int, int], object] | None = None,
) -> list[Path]:
    """Write documents of the course to a folder: their formulas are computed and their figures drawn anew.

    Args:
        folder: A folder that is there.
        documents: Names of documents: slides, handout, exercises (without solutions), solutions (with them).
        formats: html, pdf, or both.
        progress: Called with the work done and all work.

    Returns:
        The files, such as ``slides.html``. Each replaces an older one when it is complete.

    Raises:
        SeriesError: There is no document or format of a name.
        IntegratorError: A file cannot be written.
        MissingPackage: matplotlib, pandoc or typst is not installed.

    Example:
        >>> from tempfile import mkdtemp
        >>> [path.name for path in make_course(mkdtemp(), ["handout"], ["html"])]
        ['handout.html']
    """
    chosen = {name: _known(name, DOCUMENTS, "document") for name in documents}
    makers = {name: _known(name, FORMATS, "format") for name in formats}
    texts = {file: (HERE / file).read_text(encoding="utf-8") for file in {part.source for part in chosen.values()}}
    whole = "\n".join(texts.values())
    formulas, figures = dict.fromkeys(places(whole)), dict.fromkeys(FIGURE.findall(whole))
    files = [(name, kind) for name in chosen for kind in makers]
    for package in ("pypandoc", *(["typst"] if "pdf" in makers else []), *(["matplotlib"] if figures else [])):
        optional_module(package, "the course")  # before the work, not after it
    done, total = count(), len(formulas) + len(figures) + len(files)

    def each(items: Iterable[Item]) -> Iterator[Item]:
        for item in items:
            if progress is not None:
                progress(next(done), total)
            yield item

    values = {name: computed(name) for name in each(formulas)}
    pictures = {name: drawn_picture(name) for name in each(figures)}
    contents = {name: parsed(filled(text, values)) for name, text in texts.items()}
    for name, kind in each(files):
        document = chosen[name]
        content = without(contents[document.source], document.left_out)
        atomic_write(Path(folder, f"{name}.{kind}"), makers[kind](content, document.title, document.layout, pictures))
    return [Path(folder, f"{name}.{kind}") for name, kind in files]


def _known(name: str, known: dict[str, Item], argument: str) -> Item:
    """The value of a name."""
    if name not in known:
        raise SeriesError(not_one_of(known, argument, name))
    return known[name]


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
