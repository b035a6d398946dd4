"""What was found in a source: methods, and what could not be read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Record:
    """A method that was found in a source.

    Attributes:
        name: Its name: that of the function, block or variable that it is in.
        source: The name of the source.
        line: The line in which its first table starts.
        kind: ``runge-kutta``, ``additive``, ``nystrom``, ``rosenbrock``, ``shu-osher``, ``2n``, ``2s``, ``splitting``,
            ``composition``, ``symmetric-composition`` or ``coupling``.
        tables: Arrays of `Number`s by name: ``A``, ``b``, ``c``, ``embedded`` (rows), ``error`` (rows of differences
            of weights, of either sign); other kinds as they name them.
        claims: What is said nearby, as text: ``order``, ``q``, ``comment`` and others.
    """

    name: str
    source: str
    line: int
    kind: str
    tables: Mapping[str, Any]
    claims: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Reading:
    """What was found in a source: methods, and a sentence for what could not be read."""

    records: tuple[Record, ...]
    unread: tuple[str, ...]
