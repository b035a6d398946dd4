"""Rows and matrices of exact entries as users give them, of any shape."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from .entries import read_entry
from .errors import IntegratorError
from .tableau_input import MAX_STAGES, items

if TYPE_CHECKING:
    from .entries import Entry

    Row = tuple[Entry, ...]
    Matrix = tuple[Row, ...]


def read_row(values: Any, argument: str, names: Iterable[str] = (), *, count: int | None = None) -> Row:
    """A row of entries.

    Args:
        values: a sequence or array of what `read_entry` takes.
        argument: what a message calls the row.
        names: symbols that formulas may use.
        count: how many entries it must have; None: one or more.

    Returns:
        The entries.

    Raises:
        IntegratorError: `values` is no sequence, has another length, or holds what is no entry.
    """
    row = items(values, argument)
    if count is not None and len(row) != count:
        raise IntegratorError(f"{argument} must have {_entries(count)}, but has {len(row)}")
    if not 1 <= len(row) <= MAX_STAGES:
        raise IntegratorError(f"{argument} must have from 1 to {MAX_STAGES} entries, but has {len(row)}")
    return tuple(read_entry(value, f"{argument}[{j}]", names) for j, value in enumerate(row, 1))


def read_matrix(values: Any, argument: str, names: Iterable[str] = (), *, rows: int, columns: int) -> Matrix:
    """A matrix of entries, by rows, as `read_row`."""
    found = items(values, argument)
    if len(found) != rows:
        raise IntegratorError(f"{argument} must have {rows} row{'s' * (rows > 1)}, but has {len(found)}")
    return tuple(read_row(row, f"{argument}[{i}]", names, count=columns) for i, row in enumerate(found, 1))


def check_triangular(matrix: Matrix, argument: str, *, strictly: bool) -> None:
    """Refuse entries above the diagonal, and `strictly` those on it."""
    for i, row in enumerate(matrix):
        for j in range(i + (not strictly), len(row)):
            if row[j] != 0:
                shape = f"{'strictly ' * strictly}lower triangular"
                raise IntegratorError(
                    f"{argument} must be {shape}, but {argument}[{i + 1}][{j + 1}] was {row[j]!s:.60}"
                )


def _entries(count: int) -> str:
    return f"{count} {'entry' if count == 1 else 'entries'}"
