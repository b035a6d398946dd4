"""What a row of the table is."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from .timing import Sampler

GB = 10**9


class Case(NamedTuple):
    """One row: `prepare` makes everything that the row takes as given and returns what is to be sampled."""

    name: str
    work: str
    prepare: Callable[[], Sampler]
    bar: float | None = None
    peak_bar: float | None = None
    full: bool = False
