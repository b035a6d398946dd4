"""The verdict on a method of a source: what is true of it, and which of its claims do not hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from operator import itemgetter
from typing import Any, TypeAlias

from bseries.auditing.claims import Claims
from bseries.auditing.corrections import Correction, corrections, pair_of, reached, residuals
from bseries.auditing.kinds import methods_of, restored
from bseries.auditing.structures import stage_order_of, violated
from bseries.auditing.written import LEAST_DECIMALS, as_decimal, as_written, in_digits
from bseries.exceptions import SeriesError
from integrators import RungeKutta
from integrators.methods.exchange.numbers import Number
from integrators.methods.exchange.records import Record
from integrators.methods.kinds.splitting import NystromSplitting

NEAR = 1e-6
"""Row sums that differ from nodes by more are said."""

Numbers: TypeAlias = Sequence[Number]
Change: TypeAlias = dict[str, str | int]
"""An entry, what it was, what it should be, and its line."""


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
        claims: What is claimed, by name: ``order``, ``embedded_order``, ``stage_order``; structures are True.
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
    def claimed(self) -> str:
        """The claims in a few words."""
        words = {"order": "", "embedded_order": "embedded ", "stage_order": "stage order "}
        return ", ".join(f"{words[key]}{x}" if key in words else key for key, x in self.claims.items())

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


def audited(record: Record, said: Claims) -> Audited:
    """What is true of the method of a record, and which claims do not hold."""
    head = record.name, record.source, record.line, record.kind, said.to_dict()
    if record.kind == "additive":
        return _additive(record, said)
    if record.kind != "runge-kutta":
        return _of_other_kind(record, said)
    tables = record.tables
    method = _tableau(tables, "")
    if said.lower and (not method.embedded or method.stages in (said.order, said.embedded)):
        said = said._replace(order=said.embedded, embedded=None, either=False)  # in RK65 there may be six stages
    most = min(said.order or MOST, MOST)
    order, digits = _order(method, most, is_claimed=said.order is not None)
    rows = [RungeKutta(method.A, b, digits=method.digits, warn=False) for b in method.embedded]
    other = min(MOST, max(most, said.embedded or 0))
    orders = tuple(_order(row, other, is_claimed=said.embedded is not None)[0] for row in rows)
    head = (*head[:4], said.to_dict())
    notes: list[str] = []
    if said.either and said.order is not None and order < said.order and said.order in orders:
        notes.append(f"order {said.order} is that of the second row of weights")
        said = said._replace(order=said.embedded, embedded=said.order)
    findings = list(_findings(method, rows, record, said, order, orders))
    return Audited(*head, order, orders, digits, tuple(findings), (*notes, *_notes(method, findings)))


def _of_other_kind(record: Record, said: Claims) -> Audited:
    """The order of a method that is no tableau: the largest one of what the source may mean."""
    head = record.name, record.source, record.line, record.kind, said.to_dict()
    methods = list(methods_of(record))
    if not methods:
        return Audited(*head, notes=(f"tableaus of the kind {record.kind} are read, but not proved",))
    most = min(said.order or MOST_OF_FLOWS, MOST_OF_FLOWS)
    found = [
        reached(x, most, is_claimed=said.order is not None) for x in methods if not isinstance(x, NystromSplitting)
    ]
    order, digits = max(found, key=itemgetter(0))
    notes: list[str] = []
    findings: list[Finding] = []
    if said.order is not None and order < most:
        special = max((reached(x, most)[0] for x in methods if isinstance(x, NystromSplitting)), default=0)
        if special == most:
            notes.append(f"order {special} for second-order equations q'' = g(q) only")
        else:
            mended = tuple(tuple(_changes(x, record, 0)) for x in restored(record, most))
            findings.append(Finding(f"order {said.order}", f"order {max(order, special)}", mended))
    return Audited(*head, order, (), digits, tuple(findings), tuple(notes))


def _order(method: RungeKutta, most: int, *, is_claimed: bool) -> tuple[int, int | None]:
    """The order up to one, exactly or to some digits; roots may stand beside rounded numbers."""
    found = reached(method, most, is_claimed=is_claimed)
    if found[0] < most and method.domain == "algebraic":
        rounded = reached(_in_decimals(method), most)
        return rounded if rounded[0] > found[0] else found
    return found


MOST = 9
"""Orders are decided to this one: there are 719 trees with up to nine nodes."""
MOST_OF_PAIRS = 5
MOST_OF_FLOWS = 10


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
        None if nodes is None else [x.value if has_roots else as_decimal(x.value) for x in nodes],
        embedded=embedded or None,
        digits=None if has_roots or written < LEAST_DECIMALS else written,
        warn=False,
    )


def _in_decimals(method: RungeKutta) -> RungeKutta:
    """The tableau with its roots as decimals."""
    A, embedded = ([list(map(as_decimal, row)) for row in rows] for rows in (method.A, method.embedded))
    b, c = (list(map(as_decimal, row)) for row in (method.b, method.c))
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
        yield Finding(f"order {said.order}", f"order {order}", _mended(method, record, min(said.order, MOST), others))
    if said.embedded is not None and orders and max(orders) < min(said.embedded, MOST) and order >= (said.order or 0):
        at = orders.index(max(orders))
        own = _mended(rows[at], record, said.embedded, (), weights="embedded", row=at)
        shared = _mended(method, record, said.order or order, others) if at == 0 else ()
        mended = shared or own if _wrong_nodes(method) else own or shared
        yield Finding(f"embedded order {said.embedded}", f"embedded order {max(orders)}", mended)
    if said.stage_order is not None and (found := stage_order_of(method, said.stage_order)) < said.stage_order:
        yield Finding(f"stage order {said.stage_order}", f"stage order {found}")
    for structure in violated(method, said.structure):
        yield Finding(structure, f"the coefficients are not {structure}")


def _wrong_nodes(method: RungeKutta) -> list[int]:
    """The rows whose sums differ from their nodes."""
    plain = method.to_float()
    return [i for i, (row, c) in enumerate(zip(plain.A, plain.c, strict=True)) if abs(sum(row) - c) > NEAR]  # type: ignore[arg-type]


def _notes(method: RungeKutta, findings: Sequence[Finding]) -> Iterator[str]:
    """What is no claim: row sums that differ from nodes."""
    wrong = _wrong_nodes(method)
    if wrong and not any(finding.corrections for finding in findings):
        said = f"row sums differ from the nodes in row{'s' * (len(wrong) > 1)} {', '.join(str(i + 1) for i in wrong)}"
        plain = method.to_float()
        sums, nodes = [sum(plain.A[i]) for i in wrong], [plain.c[i] for i in wrong]  # type: ignore[arg-type]
        first, last = wrong[0], wrong[-1]
        if len(wrong) == 1 and isinstance(method.row_sums[first], Fraction):
            said += f"; c[{first + 1}] = {in_digits(method.row_sums[first])} would agree"  # type: ignore[arg-type]
        elif len(wrong) == 2 and all(abs(x - y) < NEAR for x, y in zip(sums, reversed(nodes), strict=True)):  # type: ignore[operator]
            said += f"; c[{first + 1}] and c[{last + 1}] exchanged would agree"
        yield said


def _mended(
    method: RungeKutta,
    record: Record,
    order: int,
    embedded: tuple[int, ...],
    weights: str = "",
    row: int = 0,
    other: RungeKutta | None = None,
) -> tuple[tuple[Change, ...], ...]:
    """The corrections of a tableau, in the words of the source."""
    try:
        found = corrections(method, order, embedded, weights=weights, other=other)
        if not found and "error" in record.tables:  # other weights that are given as differences change with b
            found = corrections(method, order, weights=weights, other=other)
    except SeriesError:  # roots, or very many stages
        return ()
    return tuple(tuple(_changes(correction, record, row)) for correction in found)


def _changes(correction: Correction, record: Record, row: int) -> Iterator[Change]:
    """Each entry of a correction, with the text of the source and its line."""
    if not correction.was:
        for name, other in zip(correction.entries, reversed(correction.entries), strict=True):
            yield {"entry": name, "was": name, "should_be": other, "line": record.line}
    named: list[Any] = []
    for entry, was, value in zip(correction.entries, correction.was, correction.should_be, strict=False):
        name, _, inside = entry.rstrip("]").partition("[")
        places = [int(k) - 1 for k in inside.split(",")]
        table = "A" if name == "a" and "A" in record.tables else name
        number = record.tables.get(table)
        for k in [row, *places] if table == "embedded" else places:
            number = number[k] if number is not None and k < len(number) else None
        if number is not None and any(number is x for x in named):
            continue  # the weights are the last row
        named.append(number)
        text, line = (number.text, number.line) if number is not None and number.text else (str(was), record.line)
        text = text if was else "0"  # also where zeros fill an array
        digits = max((x.digits for x in record.tables.get("b", ())), default=0)
        yield {"entry": entry, "was": text, "should_be": as_written(value, text, digits), "line": line or record.line}


def _additive(record: Record, said: Claims) -> Audited:
    """The pair of an implicit and an explicit method, and each of them."""
    parts = {"implicit": _tableau(record.tables, ""), "explicit": _tableau(record.tables, "_explicit")}
    most = min(said.order or MOST_OF_PAIRS, MOST_OF_PAIRS)
    order, digits = reached(pair_of(*parts.values()), most)
    findings: list[Finding] = []
    if said.order is not None and order < most:
        for name, method in parts.items():
            own, suffix = reached(method, said.order)[0], "_explicit" if name == "explicit" else ""
            if own < said.order:
                tables = {key.removesuffix(suffix): x for key, x in record.tables.items() if key.endswith(suffix)}
                other = parts["implicit" if suffix else "explicit"]
                mended = _mended(method, replace(record, tables=tables), min(said.order, most), (), other=other)
                findings.append(Finding(f"order {said.order}", f"the {name} part has order {own}", mended))
        if not findings:
            findings.append(Finding(f"order {said.order}", f"the two parts together have order {order}"))
    notes = tuple(f"{name} part: {note}" for name, x in parts.items() for note in _notes(x, findings))
    head = record.name, record.source, record.line, record.kind, said.to_dict()
    return Audited(*head, order, (), digits, tuple(findings), notes)
