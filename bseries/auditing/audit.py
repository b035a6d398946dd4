"""The audit of sources: for every tableau in them what is claimed, what is true, and the entry that is wrong."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TypeAlias

from bseries.analysis.order import order_of
from bseries.analysis.rounding import hidden_order
from bseries.auditing.claims import Claims, claims_of
from bseries.auditing.corrections import Correction, corrections, reached, residuals
from bseries.exceptions import SeriesError
from bseries_base.errors import BSeriesError, shown
from bseries_base.table import Column, Table, as_frame, as_html, as_text
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.methods.exchange.numbers import Number
from integrators.methods.exchange.reading import read_tableaus
from integrators.methods.exchange.records import Record
from trees.counting import check_order

SUFFIXES = (
    *(".c", ".cc", ".cpp", ".cxx", ".def", ".h", ".hpp", ".jl", ".py", ".f", ".f90", ".f95", ".f03", ".f08", ".for"),
    *(".m", ".wl", ".nb", ".json", ".toml"),
)
"""Files of a folder that are audited."""

NEAR = 1e-6
"""Row sums that differ from nodes by more are said."""


Numbers: TypeAlias = Sequence[Number]
Change: TypeAlias = dict[str, str | int]
"""An entry, what it was, what it should be, and its line."""

MOST_UNREAD = 10
"""Sentences on what was not read, in text."""


@dataclass(frozen=True)
class Finding:
    """A claim that does not hold.

    Attributes:
        claim: What the source claims, such as ``order 4``.
        found: What is true.
        corrections: The changes of entries that make it true: entry, what it was, what it should be, as the source
            writes them, and its line.
    """

    claim: str
    found: str
    corrections: tuple[tuple[Change, ...], ...] = ()

    def __str__(self) -> str:
        text = f"{self.claim}, but {self.found}"
        changes = [
            " and ".join(f"{x['entry']} = {x['should_be']} in place of {x['was']} (line {x['line']})" for x in change)
            for change in self.corrections
        ]
        return f"{text}: {'; or '.join(changes)}" if changes else text


@dataclass(frozen=True)
class Audited:
    """A method of a source.

    Attributes:
        name, source, line, kind: Where it is, and its kind of tableau.
        claims: What is claimed, by name: ``order`` and ``embedded_order``.
        order: Its order, exactly or as that of rounded numbers; None for kinds that are only read.
        embedded_orders: The orders of its other rows of weights.
        digits: The digits to which the order holds; None if exactly.
        findings: The claims that do not hold.
        notes: Sentences on what is no claim.
    """

    name: str
    source: str
    line: int
    kind: str
    claims: dict[str, int] = field(default_factory=dict)
    order: int | None = None
    embedded_orders: tuple[int, ...] = ()
    digits: int | None = None
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """In a few words: the order, and to how many digits."""
        if self.order is None:
            return "read only"
        return f"order {self.order}" + (f" to {self.digits} digits" if self.digits else "")

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data; numbers of tableaus are text."""
        findings = [
            {
                "claim": x.claim,
                "found": x.found,
                "candidates": [list(map(dict, change)) for change in x.corrections],
            }
            for x in self.findings
        ]
        return {
            "name": self.name, "source": self.source, "line": self.line, "tableau": self.kind, "claims": self.claims,
            "order": self.order, "embedded_orders": list(self.embedded_orders), "digits": self.digits,
            "findings": findings, "notes": list(self.notes),
        }  # fmt: skip


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
            Column("claimed", get=lambda m: ", ".join(map(str, m.claims.values())) or "-"),
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
    sources: str | PathLike[str] | Iterable[str | PathLike[str]] | Mapping[str, str],
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
    unread: list[str] = []
    for source, name in _sources(sources):
        try:
            reading = read_tableaus(source, name=name)
        except BSeriesError as error:
            unread.append(f"{name or source}: {error}")
            continue
        unread += reading.unread
        for record in reading.records:
            if len(record.name) == 1:  # a variable such as A
                record = replace(record, name=Path(record.source).stem)
            said = claims_of(record.claims, record.name)
            if wanted is not None or record.name in known:
                said = Claims(known.get(record.name, wanted), said.embedded)
            try:
                methods.append(audited(record, said))
            except BSeriesError as error:
                unread.append(f"{record.source}, line {record.line}: {record.name}: {error}")
    return Audit(tuple(methods), tuple(unread))


def _sources(sources: Any) -> Iterator[tuple[Any, str | None]]:
    """Texts or paths, with their names."""
    if isinstance(sources, Mapping):
        yield from ((text, name) for name, text in sources.items())
        return
    for source in [sources] if isinstance(sources, str | PathLike) else list(sources):
        path = Path(fspath(source))
        if path.is_dir():
            found = (p for p in sorted(path.rglob("*")) if p.suffix.lower() in SUFFIXES and p.is_file())
            yield from ((p, str(p)) for p in found)
        elif path.is_file():
            yield path, str(path)
        else:
            raise SeriesError(f"sources must be files and folders that exist, but was {shown(str(path))}")


def audited(record: Record, said: Claims) -> Audited:
    """What is true of the method of a record, and which claims do not hold."""
    head = record.name, record.source, record.line, record.kind, said.to_dict()
    if record.kind == "additive":
        return _additive(record, said)
    if record.kind != "runge-kutta":
        return Audited(*head, notes=(f"tableaus of the kind {record.kind} are read, but not proved",))
    tables = record.tables
    method, most = _tableau(tables, ""), min(said.order or MOST, MOST)
    order, digits = _order(method, most)
    rows = [RungeKutta(method.A, b, digits=method.digits, warn=False) for b in method.embedded]
    orders = tuple(_order(row, min(MOST, max(most, said.embedded or 0)))[0] for row in rows)
    head = (*head[:4], said.to_dict())
    if said.either and said.order is not None and order < said.order and said.order in orders:
        said = Claims(said.embedded, said.order)  # in names such as RKF45 either row may be the first
    findings = list(_findings(method, rows, record, said, order, orders))
    return Audited(*head, order, orders, digits, tuple(findings), tuple(_notes(method, findings)))


def _order(method: RungeKutta, most: int) -> tuple[int, int | None]:
    """The order up to one, exactly or to some digits; roots may stand beside rounded numbers."""
    found = reached(method, most)
    if found[0] < most and method.domain == "algebraic":
        rounded = reached(_in_decimals(method), most)
        return rounded if rounded[0] > found[0] else found
    return found


MOST = 9
"""Orders are decided to this one: there are 719 trees with up to nine nodes."""
MOST_OF_PAIRS = 5


def _tableau(tables: Mapping[str, Any], suffix: str) -> RungeKutta:
    """A tableau of a record."""
    A, b = tables[f"A{suffix}"], tables[f"b{suffix}"]
    nodes = tables.get(f"c{suffix}")
    embedded = [[x.value for x in row] for row in tables.get("embedded", [])] if not suffix else []
    if not suffix:
        embedded += [_other_weights(A, b, row) for row in tables.get("error", [])]
    entries = [x for row in (*A, b) for x in row]
    written = max((x.digits for x in entries), default=0)
    has_roots = not all(isinstance(x.value, Fraction) for x in entries)
    return RungeKutta(
        [[x.value for x in row] for row in A],
        [x.value for x in b],
        None if nodes is None else [x.value for x in nodes],
        embedded=embedded or None,
        digits=None if has_roots or written < LEAST_DECIMALS else written,
        warn=False,
    )


LEAST_DECIMALS = 7
"""Decimals with fewer digits, such as 0.25, are exact."""


DECIMALS = 40
"""Significant digits of roots in decimals."""


def _in_decimals(method: RungeKutta) -> RungeKutta:
    """The tableau with its roots as decimals."""
    import sympy

    def decimal(x: Any) -> Any:
        return x if isinstance(x, Fraction) else Fraction(str(sympy.N(x, DECIMALS)))

    A, embedded = ([list(map(decimal, row)) for row in rows] for rows in (method.A, method.embedded))
    b, c = (list(map(decimal, row)) for row in (method.b, method.c))
    return RungeKutta(A, b, c, embedded=embedded or None, warn=False)


def _other_weights(A: Sequence[Numbers], b: Numbers, error: Numbers) -> list[Fraction]:
    """The other row of weights, from differences of either sign: that with the smaller residuals."""
    values = [[x.value for x in row if isinstance(x.value, Fraction)] for row in (*A, b, error)]
    if any(len(row) < len(b) for row in values):
        raise SeriesError("entries must be rational where only differences of weights are given")
    *matrix, own, differences = values
    rows = [[x + sign * y for x, y in zip(own, differences, strict=True)] for sign in (-1, 1)]
    floats = [list(map(float, row)) for row in matrix]
    return min(rows, key=lambda row: sum(x * x for x in residuals(floats, list(map(float, row)), MOST)))


def _findings(
    method: RungeKutta, rows: Sequence[RungeKutta], record: Record, said: Claims, order: int, orders: tuple[int, ...]
) -> Iterator[Finding]:
    """The claims that do not hold."""
    others = () if said.embedded is None else (said.embedded,)
    if said.order is not None and order < min(said.order, MOST):
        yield Finding(f"order {said.order}", f"order {order}", _mended(method, record, said.order, others))
    if said.embedded is not None and orders and max(orders) < min(said.embedded, MOST) and order >= (said.order or 0):
        at = orders.index(max(orders))
        mended = _mended(rows[at], record, said.embedded, (), weights="embedded", row=at)
        yield Finding(f"embedded order {said.embedded}", f"embedded order {max(orders)}", mended)


def _wrong_nodes(method: RungeKutta) -> list[int]:
    """The rows whose sums differ from their nodes."""
    plain = method.to_float()
    return [i for i, (row, c) in enumerate(zip(plain.A, plain.c, strict=True)) if abs(sum(row) - c) > NEAR]  # type: ignore[arg-type]


def _notes(method: RungeKutta, findings: Sequence[Finding]) -> Iterator[str]:
    """What is no claim: row sums that differ from nodes."""
    wrong = _wrong_nodes(method)
    if wrong and not any(finding.corrections for finding in findings):
        yield f"row sums differ from the nodes in row{'s' * (len(wrong) > 1)} {', '.join(str(i + 1) for i in wrong)}"


def _mended(
    method: RungeKutta, record: Record, order: int, embedded: tuple[int, ...], weights: str = "", row: int = 0
) -> tuple[tuple[Change, ...], ...]:
    """The corrections of a tableau, in the words of the source."""
    try:
        found = corrections(method, order, embedded, weights=weights)
    except SeriesError:  # roots, or very many stages
        return ()
    return tuple(tuple(_changes(correction, record, row)) for correction in found)


def _changes(correction: Correction, record: Record, row: int) -> Iterator[Change]:
    """Each entry of a correction, with the text of the source and its line."""
    for entry, was, value in zip(correction.entries, correction.was, correction.should_be, strict=True):
        name, _, inside = entry.rstrip("]").partition("[")
        places = [int(k) - 1 for k in inside.split(",")]
        table = {"a": "A", "b": "b", "c": "c", "embedded": "embedded"}[name]
        number = record.tables.get(table)
        for k in [row, *places] if table == "embedded" else places:
            number = number[k] if number is not None and k < len(number) else None
        text, line = (number.text, number.line) if number is not None and number.text else (str(was), record.line)
        yield {"entry": entry, "was": text, "should_be": as_written(value, text), "line": line or record.line}


def as_written(value: Fraction, text: str) -> str:
    """A number in the form of a text: with its denominator, or as a decimal with as many digits."""
    compact = text.replace(" ", "").replace("//", "/")
    numerator, slash, denominator = compact.rpartition("/")
    if slash and numerator.lstrip("+-").isdecimal() and denominator.isdecimal() and int(denominator):
        scaled = value * int(denominator)
        return f"{scaled.numerator}/{denominator}" if scaled.denominator == 1 else str(value)
    decimals = compact.lower().partition("e")[0].partition(".")[2]
    if decimals.isdecimal() and "e" not in compact.lower():
        scaled = round(value * 10 ** len(decimals))
        whole, rest = divmod(abs(scaled), 10 ** len(decimals))
        return f"{'-' * (scaled < 0)}{whole}.{rest:0{len(decimals)}d}"
    return str(value) if value.denominator < 10**9 else f"{float(value):.17g}"


def _additive(record: Record, said: Claims) -> Audited:
    """The pair of an implicit and an explicit method, and each of them."""
    parts = {"implicit": _tableau(record.tables, ""), "explicit": _tableau(record.tables, "_explicit")}
    plain = {name: RungeKutta(x.A, x.b, x.c, digits=x.digits, warn=False) for name, x in parts.items()}
    pair, most = PartitionedRungeKutta(plain, warn=False), min(said.order or MOST_OF_PAIRS, MOST_OF_PAIRS)
    order, digits = order_of(pair, most), None
    if order < most and (hidden := hidden_order(pair, order)):
        order, digits = min(hidden.order, most), hidden.digits
    findings: list[Finding] = []
    if said.order is not None and order < most:
        for name, method in parts.items():
            own, suffix = reached(method, said.order)[0], "_explicit" if name == "explicit" else ""
            if own < said.order:
                tables = {key.removesuffix(suffix): x for key, x in record.tables.items() if key.endswith(suffix)}
                mended = _mended(method, replace(record, tables=tables), said.order, ())
                findings.append(Finding(f"order {said.order}", f"the {name} part has order {own}", mended))
        if not findings:
            findings.append(Finding(f"order {said.order}", f"the two parts together have order {order}"))
    notes = tuple(f"{name} part: {note}" for name, x in parts.items() for note in _notes(x, findings))
    head = record.name, record.source, record.line, record.kind, said.to_dict()
    return Audited(*head, order, (), digits, tuple(findings), notes)
