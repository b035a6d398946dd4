"""Arrays of numbers as nested lists."""

from __future__ import annotations

from typing import Any

from integrators.methods.exchange.numbers import Number


class Display(list[Any]):
    """A list of Python, whose sums and products are not those of its entries."""


class Slice(list[Any]):
    """A part of an array, whose entries the next index takes."""


def place_of(text: str) -> Any:
    """An index, from the end of the array if negative."""
    if not text:
        return None
    if text.startswith("end"):
        return -1 - int(text[3:].replace("-", "") or 0)
    return int(text)


def constant(shape: list[int], number: Number) -> Any:
    """An array of one number."""
    return [constant(shape[1:], number) for _ in range(shape[0])] if shape else number


def assembled(rows: list[list[Any]]) -> list[Any]:
    """The array of rows: one row or column is a list, and rows in brackets are stacked."""
    if len(rows) == 1:
        return rows[0]
    if all(len(row) == 1 for row in rows):
        return [row[0] for row in rows]
    return rows
