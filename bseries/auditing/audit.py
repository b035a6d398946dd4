"""The audit of sources: for every tableau in them what is claimed, what is true, and the entry that is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bseries.auditing.claims import claims_of
from bseries.auditing.sources import Sources, read_sources
from bseries.auditing.verdicts import Audited, audited
from bseries_base.errors import BSeriesError, shown
from bseries_base.table import Column, Table, as_frame, as_html, as_text
from trees.counting import check_order

MOST_UNREAD = 10
"""Sentences on what was not read, in text."""


@dataclass(frozen=True)
class Audit:
    """The audit of some sources; made by `audit`.

    Attributes:
        methods: The methods found.
        unread: A sentence for each source or table that could not be read.

    Example:
        >>> import bseries as bs
        >>> found = bs.audit({"mine.jl": "# a method of order 3\\nA = [0 0; 1//2 0]; b = [0, 1]; c = [0, 1//2]"})
        >>> found.holds, [str(x) for method in found.methods for x in method.findings]
        (False, ['order 3, but order 2'])
    """

    methods: tuple[Audited, ...]
    unread: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every claim holds."""
        return not any(method.findings for method in self.methods)

    def __repr__(self) -> str:
        wrong = sum(bool(method.findings) for method in self.methods)
        return f"<Audit: {len(self.methods)} methods, {wrong} with claims that do not hold>"

    def to_dict(self) -> dict[str, Any]:
        """The results as JSON-ready data."""
        methods = [method.to_dict() for method in self.methods]
        return {"schema": 1, "kind": "audit", "methods": methods, "unread": list(self.unread)}

    def to_table(self) -> Table:
        """The methods as a table; findings and what was not read are below it."""
        columns = (
            Column("method", get=lambda m: m.name),
            Column("where", get=lambda m: f"{m.source}:{m.line}"),
            Column("claimed", get=lambda m: m.claimed or "-"),
            Column("found", get=lambda m: ", ".join([m.verdict, *(f"embedded {p}" for p in m.embedded_orders)])),
            Column("holds", get=lambda m: "no" if m.findings else "yes" if m.claims else "-"),
        )
        lines = [f"{m.source}:{m.line}: {m.name}: {x}." for m in self.methods for x in (*m.findings, *m.notes)]
        lines += [f"Not read: {sentence}." for sentence in self.unread[:MOST_UNREAD]]
        if len(self.unread) > MOST_UNREAD:
            lines.append(f"{len(self.unread) - MOST_UNREAD} more tables were not read; JSON lists them.")
        return Table(repr(self)[1:-1], columns, self.methods, lines, data=self.to_dict)

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame


def audit(
    sources: Sources,
    *,
    order: int | None = None,
    claims: Mapping[str, int] | None = None,
) -> Audit:
    """Read every tableau in some sources, and prove or refute what is claimed of it.

    Sources are parsed as text and never run. An order is decided exactly; of rounded numbers, "order 5 to 16 digits" is
    what the claim means. What no text claims accuses nobody.

    Args:
        sources: Files and folders, one or several; or texts by name.
        order: An order that every method must have, in place of what the sources say.
        claims: Orders by the names of methods, in place of what the sources say.

    Returns:
        An `Audit`.

    Raises:
        SeriesError: A claim is no order, or there is no such file.

    Example:
        >>> import bseries as bs
        >>> wrong = "order = 4\\nA = [[0,0,0,0],[0.5,0,0,0],[0,-0.5,0,0],[0,0,1,0]]\\nb = [1/6, 1/3, 1/3, 1/6]"
        >>> found = bs.audit({"rk4.py": wrong}).methods[0]
        >>> found.order, str(found.findings[0])
        (1, 'order 4, but order 1: a[3,2] = 0.5 in place of -0.5 (line 2)')
    """
    wanted = None if order is None else check_order(order)
    known = {name: check_order(value) for name, value in (claims or {}).items()}
    methods: list[Audited] = []
    records, unread = read_sources(sources)
    for record in records:
        said = claims_of(record.claims, record.name)
        if wanted is not None or record.name in known:
            said = said._replace(order=known.get(record.name, wanted), either=False, lower=False)
        try:
            methods.append(audited(record, said))
        except BSeriesError as error:
            unread.append(f"{record.source}, line {record.line}: {record.name}: {error}")
    names = {record.name for record in records}
    unread = [f"no method has the name {shown(name)} of a claim" for name in known if name not in names] + unread
    return Audit(tuple(methods), tuple(unread))
