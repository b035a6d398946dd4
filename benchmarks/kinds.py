"""What the tables and pages are made of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from .timing import Sampler

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

GB = 10**9

Row: TypeAlias = dict[str, Any]
"""Plain data for JSON."""


class Case(NamedTuple):
    """One row of times: `prepare` makes everything that the row takes as given and returns what is to be sampled."""

    name: str
    work: str
    prepare: Callable[[], Sampler]
    bar: float | None = None
    peak_bar: float | None = None
    full: bool = False
    interpreted: bool = False
    """Whether it is the interpreter that is timed, as in whole commands, however long it takes."""


class Figure(NamedTuple):
    """One number that is no time of ours alone: a ratio, an error, an amount of memory."""

    work: str
    value: float
    bar: float | None = None
    at_least: bool = False
    """Whether the value must not be below the bar, rather than not above."""
    unit: str = ""


class Measurement(NamedTuple):
    """A measurement that gives several figures at once, and takes its own rounds."""

    name: str
    measure: Callable[[], list[Figure]]
    full: bool = False


class Table(NamedTuple):
    """Cells of text below headings; the first column says what a row is about."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


class Study(NamedTuple):
    """A measurement that is kept as a whole: figures, tables and a picture are made from its rows.

    `measure` is told in which virtual environment other packages are installed.
    """

    name: str
    about: str
    measure: Callable[[Path], list[Row]]
    tables: Callable[[list[Row]], list[Table]]
    figures: Callable[[list[Row]], list[Figure]]
    draw: Callable[[list[Row]], Picture] | None = None
    full: bool = False


class Part(NamedTuple):
    """A section of the page."""

    title: str
    measurements: Callable[[], Sequence[Measurement]] = list
    studies: Sequence[Study] = ()
