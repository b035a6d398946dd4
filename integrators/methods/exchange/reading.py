"""Tableaus in anybody's source: the methods among its assignments."""

from __future__ import annotations

from os import PathLike, fspath
from pathlib import PurePath

from integrators.core.errors import IntegratorError
from integrators.core.text_files import read_text
from integrators.methods.exchange.assignments import Assignments
from integrators.methods.exchange.classes import with_orders_of_classes
from integrators.methods.exchange.groups import Group
from integrators.methods.exchange.records import Reading, Record
from integrators.methods.exchange.tokens import LANGUAGES, MOST_UNCLOSED, Source, language_of
from integrators.methods.exchange.typeset import rewritten


def read_tableaus(source: str | PathLike[str], language: str | None = None, name: str | None = None) -> Reading:
    """The methods in a source of any language; text is parsed and never evaluated.

    Args:
        source: The text, or a path to it.
        language: One of c, julia, python, fortran, matlab and mathematica; by default that of the suffix of the path
            or name, or of the brackets in the text. Arrays of LaTeX and rows of CSV are read as tableaus, too.
        name: The name of the source in messages; by default that of the file.

    Returns:
        The methods, and a sentence with source and line for each table that could not be read.

    Raises:
        IntegratorError: The file is no text or too large, or the language is unknown.

    Example:
        >>> found = read_tableaus("A[2, 1] = 2 // 3; b = [1//4, 3//4]; c = [0, 2//3]", "julia").records[0]
        >>> found.kind, str(found.tables["A"][1][0].value), found.tables["A"][1][0].text
        ('runge-kutta', '2/3', '2 // 3')
    """
    path = fspath(source) if isinstance(source, PathLike) else ""
    text = read_text(path)[0] if path else str(source)
    if language is not None and language not in LANGUAGES:
        raise IntegratorError(f"language must be one of {', '.join(LANGUAGES)}, but was {language!r}")
    file = path or name or "text"
    typeset = None if language else rewritten(text, PurePath(file).suffix.lower())
    chosen = LANGUAGES[language] if language else LANGUAGES["julia"] if typeset else language_of(text, file)
    return Finder(Source(typeset or text, chosen, name or file)).reading()


class Finder:
    """Finds methods in the blocks of a source."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.first = source.language.first
        self.records: list[Record] = []
        self.unread: list[str] = []
        self.used: set[tuple[int, ...]] = set()

    def reading(self) -> Reading:
        """All methods, in the order of their lines."""
        if self.source.unclosed > MOST_UNCLOSED:
            return Reading((), (f"{self.source.name}: {self.source.unclosed:,} brackets are not closed",))
        for block in Assignments(self.source).blocks:
            for k, table in enumerate(block.tables):
                if table:
                    count = len(self.records)
                    group = Group(self, block, k)
                    group.find()
                    if len(self.records) == count:
                        group.say_faults()
        if self.source.language is LANGUAGES["python"]:
            self.records = with_orders_of_classes(self.records, self.source.text)
        self.records.sort(key=lambda record: record.line)
        return Reading(tuple(self.records), tuple(self.unread))
