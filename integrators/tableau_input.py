"""From what a user gives to rows of exact entries: shapes, sizes, names and numbers are checked here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .entries import find_domain, read_entry, round_entry
from .errors import IntegratorError
from .expressions import check_names, shorten

if TYPE_CHECKING:
    from .entries import Entry

    Row = tuple[Entry, ...]

MAX_STAGES = 1000


def read_tableau(
    A: Any, b: Any, c: Any, embedded: Any, parameters: Iterable[str], digits: int | None
) -> tuple[tuple[Row, ...], Row, Row | None, tuple[Row, ...]]:
    """The stage matrix, the weights, the nodes (None if not given) and the embedded weights, in one domain."""
    names = check_names(parameters, "parameters")
    raw = [items(row, f"row {i} of A") for i, row in enumerate(items(A, "A"), 1)]
    _check_square(raw)
    stages = len(raw)
    rows = [_read_row(row, f"A[{i}]", stages, names) for i, row in enumerate(raw, 1)]
    rows.append(_read_row(b, "b", stages, names))
    extra = _embedded_rows(embedded)
    rows += [
        _read_row(row, f"embedded[{k}]" if len(extra) > 1 else "embedded", stages, names)
        for k, row in enumerate(extra, 1)
    ]
    if c is not None:
        rows.append(_read_row(c, "c", stages, names))
    rows = _in_one_domain(rows, digits)
    nodes = None if c is None else rows.pop()
    return tuple(rows[:stages]), rows[stages], nodes, tuple(rows[stages + 1 :])


def items(value: Any, argument: str) -> list[Any]:
    """The entries of a sequence or array."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, str | bytes | Mapping | set | frozenset) or not isinstance(value, Iterable):
        raise IntegratorError(f"{argument} must be a sequence, but was {shorten(repr(value))}")
    return list(value)


def _check_square(rows: Sequence[Sequence[Any]]) -> None:
    stages = len(rows)
    if stages == 0:
        raise IntegratorError("A must have at least one row, but was empty")
    if stages > MAX_STAGES:
        raise IntegratorError(f"A must have at most {MAX_STAGES} rows, but has {stages}")
    for i, row in enumerate(rows, 1):
        if len(row) != len(rows[0]):
            raise IntegratorError(
                f"A must be square, but row {i} has {_entries(row)} and row 1 has {_entries(rows[0], noun='')}"
            )
    if len(rows[0]) != stages:
        raise IntegratorError(f"A must be square, but has {stages} row{'s' * (stages > 1)} of {_entries(rows[0])}")


def _entries(row: Sequence[Any], noun: str = "entries") -> str:
    noun = "entry" if noun and len(row) == 1 else noun
    return f"{len(row)} {noun}".strip()


def _read_row(values: Any, argument: str, stages: int, names: Iterable[str]) -> Row:
    row = items(values, argument)
    if len(row) != stages:
        raise IntegratorError(f"{argument} must have as many entries as A has rows, {stages}, but has {len(row)}")
    return tuple(read_entry(value, f"{argument}[{j}]", names) for j, value in enumerate(row, 1))


def _embedded_rows(embedded: Any) -> list[Any]:
    """One row of weights or several, as several."""
    rows = [] if embedded is None else items(embedded, "embedded")
    single = rows and (isinstance(rows[0], str) or not isinstance(rows[0], Iterable))
    return [rows] if single else rows


def check_digits(digits: object) -> None:
    """Refuse a number of significant digits that is none."""
    if digits is not None and (isinstance(digits, bool) or not isinstance(digits, int) or not 1 <= digits <= 1000):
        raise IntegratorError(f"digits must be an integer from 1 to 1000, but was {shorten(repr(digits))}")


def _in_one_domain(rows: list[Row], digits: int | None) -> list[Row]:
    """The rows as they are if exact; one float makes all of them floats."""
    check_digits(digits)
    values = [value for row in rows for value in row]
    domain = find_domain(values)
    if digits is not None and domain in ("algebraic", "symbolic"):
        raise IntegratorError("digits must be left out for a tableau with roots or symbols, but was " + str(digits))
    if domain != "float":
        return rows
    if find_domain(value for value in values if not isinstance(value, float)) == "symbolic":
        raise IntegratorError("A, b and c must not mix floats and symbols: write the floats as fractions or as text")
    return [tuple(map(round_entry, row)) for row in rows]


def check_label(value: object, argument: str) -> None:
    """Refuse a name or reference that is not text."""
    if value is not None and not isinstance(value, str):
        raise IntegratorError(f"{argument} must be text, but was {shorten(repr(value))}")


def check_partition_names(names: Iterable[Any]) -> None:
    """Refuse names of parts that formulas and trees could not tell apart."""
    for name in names:
        if not isinstance(name, str) or not name.isidentifier() or name[0] == "_" or name == "t" or "τ" in name:
            raise IntegratorError(
                "names of partitions must start with a letter, hold letters, digits and _ only, and not be t or hold "
                f"τ, but one was {shorten(repr(name))}"
            )


def in_color_order(names: Iterable[str]) -> tuple[str, ...]:
    """Names of parts in the order of their colours: the blocks p and q in this order, other names as they come."""
    given = tuple(names)
    return ("p", "q") if set(given) == {"p", "q"} else given
