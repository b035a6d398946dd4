"""What a row of the tables is."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from .timing import Sampler

GB = 10**9


class Case(NamedTuple):
    """One row of times: `prepare` makes everything that the row takes as given and returns what is to be sampled."""

    name: str
    work: str
    prepare: Callable[[], Sampler]
    bar: float | None = None
    peak_bar: float | None = None
    full: bool = False


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
