"""Shapes of stage matrices and weights: written as a list, by rows below the diagonal, or by names of entries."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from integrators.methods.exchange.numbers import ZERO, Number, combine

MOST_STAGES = 200
NEAR = 1e-6
"""Row sums that differ from nodes by less tell which nodes belong to which rows."""


def plain_name(name: str) -> str:
    """A name without marks that say nothing of its role."""
    head, dot, tail = name.rpartition(".")
    return head + dot + re.sub(r"^_+|(?:_vec|_mat|_matrix|_array)$", "", tail)


def row_and_column(index: tuple[str, ...]) -> tuple[int, ...]:
    """The row and the column in the digits of a name: 21, 101 (10, 1), 1012 or 10_12."""
    if len(index) == 2:
        return int(index[0]), int(index[1])
    digits = index[0]
    half = (len(digits) + 1) // 2
    if len(digits) < 2:
        return (int(digits),)
    return int(digits[:half]), int(digits[half:])


def lower_matrix(entries: dict[tuple[int, ...], Number]) -> list[list[Number]] | None:
    """A square matrix of entries by row and column, from 0 or from 1."""
    first = min(1, *(min(index) for index in entries))
    size = max(max(index) for index in entries) + 1 - first
    if size > MOST_STAGES or first < 0:
        return None
    return [[entries.get((i + first, j + first), ZERO) for j in range(size)] for i in range(size)]


def as_row(values: Any, size: int | None = None) -> list[Any]:
    """A row of entries, also of one, and from a dictionary by stage, from 0 or from 1."""
    if isinstance(values, dict):
        first = min(1, *values)
        size = max(max(values) + 1 - first, size or 0)
        return [values.get(i + first, ZERO) for i in range(size)]
    row = values if isinstance(values, list) else [values]
    if row and all(isinstance(x, list) and len(x) == 1 for x in row):
        row = [x[0] for x in row]
    if len(row) == 1 and isinstance(row[0], list) and size != 1:
        row = row[0]
    return row + [ZERO] * (size - len(row)) if size is not None and 0 < size - len(row) <= 3 else row


def as_square(values: Any, stages: int) -> list[list[Number]] | None:
    """A stage matrix from rows, from rows below the diagonal, or from one long row."""
    if isinstance(values, Number):
        return [[values]] if stages in (0, 1) else None
    if not isinstance(values, list) or not values:
        return None
    if not any(isinstance(row, list) for row in values):
        if not stages or len(values) != stages * stages:
            return [[values[0]]] if len(values) == 1 and stages in (0, 1) else None
        return [values[i * stages : (i + 1) * stages] for i in range(stages)]
    rows = [row if isinstance(row, list) else [row] for row in values]
    if not all(isinstance(x, Number) for row in rows for x in row):
        return None
    widest = max(map(len, rows))
    if [len(row) for row in rows] == list(range(1, len(rows) + 1)) and stages == len(rows) + 1:
        rows = [[], *rows]
    size = stages or max(len(rows), widest)
    if size == len(rows) + 1 and widest == len(rows) and stages:  # the first stage has no row
        rows = [[], *rows]
    if size > MOST_STAGES or len(rows) != size or widest > size:
        return None
    return [row + [ZERO] * (size - len(row)) for row in rows]


def with_diagonal(matrix: list[list[Number]], diagonal: list[Number]) -> list[list[Number]]:
    """The matrix with other diagonal entries."""
    if len(diagonal) != len(matrix):
        return matrix
    return [[*row[:i], diagonal[i], *row[i + 1 :]] for i, row in enumerate(matrix)]


def is_explicit(matrix: list[list[Number]]) -> bool:
    """Whether there is nothing on the diagonal or above it."""
    return not any(near(x) for i, row in enumerate(matrix) for x in row[i:])


def is_pair(one: str, two: str) -> bool:
    """Whether names differ by a mark of a part only, such as A_hat, At or Ai and Ae."""
    marks = r"_?(?:hat|explicit|implicit|exp|imp|ex|im|t|e|i|E|I|F|S)$"
    return re.sub(marks, "", one) == re.sub(marks, "", two) or (one, two) in (("a", "ea"), ("ea", "a"))


def flattened(value: Any) -> Iterator[Any]:
    """All entries of nested lists."""
    if isinstance(value, list):
        for entry in value:
            yield from flattened(entry)
    elif value is not None:
        yield value


def near(x: Any) -> float:
    """A number to some digits, for comparisons that tell roles."""
    return x.near if isinstance(x, Number) else float("nan")


def row_sum(row: list[Number]) -> Number:
    """The sum of a row."""
    total = ZERO
    for x in row:
        total = combine("+", total, x)
    return total


def agree(x: Number, y: Number) -> bool:
    """Whether two numbers are equal to some digits."""
    return abs(near(x) - near(y)) < NEAR
