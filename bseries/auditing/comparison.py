"""Two sources side by side: entries that differ in methods of the same name."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from bseries.auditing.sources import Sources, read_sources
from bseries_base.table import Column, Table, as_frame, as_html, as_text
from integrators.methods.exchange.numbers import Number
from integrators.methods.exchange.records import Record

TABLES = ("A", "b", "c", "embedded", "A_explicit", "b_explicit", "c_explicit")


class Difference(NamedTuple):
    """An entry that two sources give as different doubles, or the number of stages.

    Attributes:
        method: The name of the method in the first source.
        entry: Such as ``A[3,2]``, counted from 1.
        first, second: As the sources write it.
        ulps: The distance in units of the last place of a double.
        digits: The digits that agree.

    Example:
        >>> import bseries as bs
        >>> bs.auditing.Difference("heun", "b[2]", "1/2", "0.51").entry
        'b[2]'
    """

    method: str
    entry: str
    first: str
    second: str
    ulps: float | None = None
    digits: int | None = None


@dataclass(frozen=True)
class Comparison:
    """The methods of two sources side by side; made by `compare`.

    Attributes:
        methods: The names, in the first source, of the methods that both have.
        differences: The entries that differ.
        unread: A sentence for each source or table that could not be read.

    Example:
        >>> import bseries as bs
        >>> one = "def heun():\\n    A = [[0, 0], [1, 0]]\\n    b = [1/2, 1/2]\\n"
        >>> two = one.replace("[1/2, 1/2]", "[0.5, 0.51]")
        >>> found = bs.auditing.compare({"one.py": one}, {"two.py": two})
        >>> found.methods, found.differences[0].entry, found.differences[0].digits
        (('heun',), 'b[2]', 1)
    """

    methods: tuple[str, ...]
    differences: tuple[Difference, ...]
    unread: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Comparison: {len(self.methods)} methods in both sources, {len(self.differences)} entries differ>"

    def to_dict(self) -> dict[str, Any]:
        """The comparison as JSON-ready data."""
        differences = [x._asdict() for x in self.differences]
        head = {"schema": 1, "kind": "tableau-comparison", "methods": list(self.methods)}
        return {**head, "differences": differences, "unread": list(self.unread)}

    def to_table(self) -> Table:
        """The entries that differ as a table."""
        columns = (
            *(Column(key, get=lambda x, key=key: getattr(x, key)) for key in ("method", "entry", "first", "second")),
            Column("ulps", True, get=lambda x: "" if x.ulps is None else f"{x.ulps:.3g}"),
            Column("digits", True, get=lambda x: "" if x.digits is None else str(x.digits)),
        )
        return Table(repr(self)[1:-1], columns, self.differences, data=self.to_dict)

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame


def compare(first: Sources, second: Sources) -> Comparison:
    """Compare the methods that two sources have under the same name, whatever its case, hyphens and underscores.

    Entries are the same if they are the same doubles.

    Args:
        first: Files and folders, one or several; or texts by name.
        second: Others.

    Returns:
        A `Comparison`.

    Raises:
        SeriesError: There is no such file.

    Example:
        >>> import bseries as bs
        >>> texts = {"one.py": "def euler():\\n    A = [[0]]\\n    b = [1]\\n"}
        >>> bs.auditing.compare(texts, texts)
        <Comparison: 1 methods in both sources, 0 entries differ>
    """
    (ours, unread), (theirs, more) = read_sources(first), read_sources(second)
    others: dict[str, list[Record]] = defaultdict(list)
    for record in theirs:
        others[_key(record)].append(record)
    pairs = [(record, others[_key(record)].pop(0)) for record in ours if others[_key(record)]]
    differences = tuple(x for one, two in pairs for x in _differences(one, two))
    return Comparison(tuple(one.name for one, _ in pairs), differences, (*unread, *more))


def _key(record: Record) -> str:
    """What the names of a method in two sources share."""
    return record.kind + "".join(x for x in record.name.casefold() if x.isalnum())


def _differences(one: Record, two: Record) -> Iterator[Difference]:
    """The entries of two records that are different doubles."""
    for table in TABLES:
        if table in one.tables and table in two.tables:
            ours, theirs = (dict(_entries(record.tables[table], table)) for record in (one, two))
            if ours.keys() != theirs.keys():
                yield Difference(one.name, f"size of {table}", str(len(ours)), str(len(theirs)))
                continue
            for entry, x in ours.items():
                yield from _difference(one.name, entry, x, theirs[entry])


def _entries(values: Any, name: str) -> Iterator[tuple[str, Number]]:
    """The entries of a row or of rows, with their names."""
    for i, row in enumerate(values, 1):
        if isinstance(row, Number):
            yield f"{name}[{i}]", row
        else:
            yield from ((f"{name}[{i},{j}]", x) for j, x in enumerate(row, 1))


def _difference(method: str, entry: str, x: Number, y: Number) -> Iterator[Difference]:
    """The difference of two numbers, if they are different doubles."""
    values = float(x.value), float(y.value)
    if values[0] == values[1]:
        return
    size, distance = max(map(abs, values)), abs(values[0] - values[1])
    digits = max(0, math.floor(-math.log10(distance / size)))
    yield Difference(method, entry, x.text or str(x.value), y.text or str(y.value), distance / math.ulp(size), digits)
