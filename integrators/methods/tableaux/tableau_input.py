"""Reading of tableaux and coefficient rows: checks of shapes, sizes, names and numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from integrators.core.arguments import check_digits, items
from integrators.core.errors import IntegratorError
from integrators.exact.entries import Entry, find_domain, read_entry, round_entry
from integrators.exact.expressions import check_names
from integrators.methods.programs.program import MAX_STAGES

EntryRow = tuple[Entry, ...]
Matrix = tuple[EntryRow, ...]


def read_tableau(
    A: Any, b: Any, c: Any, embedded: Any, parameters: Iterable[str], digits: int | None
) -> tuple[tuple[EntryRow, ...], EntryRow, EntryRow | None, tuple[EntryRow, ...]]:
    """The stage matrix, weights, nodes (None if not given) and embedded weights of a tableau, in one domain."""
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


def _check_square(rows: Sequence[Sequence[Any]]) -> None:
    stages = len(rows)
    if stages == 0:
        raise IntegratorError("A must have at least one row, but was empty")
    if stages > MAX_STAGES:
        raise IntegratorError(f"A must have at most {MAX_STAGES} rows, but has {stages}")
    for i, row in enumerate(rows, 1):
        if len(row) != len(rows[0]):
            raise IntegratorError(
                f"A must be square, but row {i} has {_entry_count(len(row))} and row 1 has {len(rows[0])}"
            )
    if len(rows[0]) != stages:
        raise IntegratorError(
            f"A must be square, but has {stages} row{'s' * (stages > 1)} of {_entry_count(len(rows[0]))}"
        )


def _read_row(values: Any, argument: str, stages: int, names: Iterable[str]) -> EntryRow:
    row = items(values, argument)
    if len(row) != stages:
        raise IntegratorError(f"{argument} must have as many entries as A has rows, {stages}, but has {len(row)}")
    return tuple(read_entry(value, f"{argument}[{j}]", names) for j, value in enumerate(row, 1))


def _embedded_rows(embedded: Any) -> list[Any]:
    """A sequence of rows, given as one row or several."""
    rows = [] if embedded is None else items(embedded, "embedded")
    single = rows and (isinstance(rows[0], str) or not isinstance(rows[0], Iterable))
    return [rows] if single else rows


def _in_one_domain(rows: list[EntryRow], digits: int | None) -> list[EntryRow]:
    """The rows; a single float makes all entries floats."""
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


def in_color_order(names: Iterable[str]) -> tuple[str, ...]:
    """Names of parts in the order of their colours: p before q, other names in the given order."""
    given = tuple(names)
    return ("p", "q") if set(given) == {"p", "q"} else given


def read_row(values: Any, argument: str, names: Iterable[str] = (), *, count: int | None = None) -> EntryRow:
    """A row of entries in the symbols `names`: `count` entries, or one or more if None."""
    row = items(values, argument)
    if count is not None and len(row) != count:
        raise IntegratorError(f"{argument} must have {_entry_count(count)}, but has {len(row)}")
    if not 1 <= len(row) <= MAX_STAGES:
        raise IntegratorError(f"{argument} must have from 1 to {MAX_STAGES} entries, but has {len(row)}")
    return tuple(read_entry(value, f"{argument}[{j}]", names) for j, value in enumerate(row, 1))


def read_matrix(values: Any, argument: str, names: Iterable[str] = (), *, rows: int, columns: int) -> Matrix:
    """A matrix of entries, by rows, each read by `read_row`."""
    found = items(values, argument)
    if len(found) != rows:
        raise IntegratorError(f"{argument} must have {rows} row{'s' * (rows > 1)}, but has {len(found)}")
    return tuple(read_row(row, f"{argument}[{i}]", names, count=columns) for i, row in enumerate(found, 1))


def check_triangular(matrix: Matrix, argument: str, *, strictly: bool) -> None:
    """Refuse nonzero entries above the diagonal, or on and above it if `strictly`."""
    for i, row in enumerate(matrix):
        for j in range(i + (not strictly), len(row)):
            if row[j] != 0:
                shape = f"{'strictly ' * strictly}lower triangular"
                raise IntegratorError(
                    f"{argument} must be {shape}, but {argument}[{i + 1}][{j + 1}] was {row[j]!s:.60}"
                )


def _entry_count(count: int) -> str:
    return f"{count} {'entry' if count == 1 else 'entries'}"
