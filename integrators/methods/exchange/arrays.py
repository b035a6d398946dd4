"""Arrays of numbers as nested lists."""

from __future__ import annotations

from typing import Any

from integrators.methods.exchange.numbers import Number
from integrators.methods.exchange.shapes import flattened


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


def is_constant(value: Any) -> bool:
    """Whether all entries of an array are one number."""
    flat = list(flattened(value)) if isinstance(value, list) else []
    return (
        bool(flat)
        and all(x is flat[0] or x == flat[0] for x in flat)
        and getattr(flat[0], "text", "") in ("zeros", "ones", "Matrix", "Vector", "Array")
    )


def copied(value: Any) -> Any:
    """A copy of nested lists."""
    return type(value)(copied(entry) for entry in value) if isinstance(value, list) else value


def put(array: list[Any], indices: list[Any], value: Any, first: int) -> bool:
    """Put a value at indices of an array; whether there is such a place."""
    index, *rest = indices
    if isinstance(index, tuple):
        start, stop = index
        places = range(*slice(None if start is None else start - first, stop).indices(len(array)))
        values = value if isinstance(value, list) else [value] * len(places)
        if len(values) != len(places) or rest:
            return False
        for place, x in zip(places, values, strict=True):
            array[place] = x
        return True
    place = index - first if index >= 0 else index + len(array)
    if len(array) == 1 and not rest and isinstance(array[0], list) and place == 0 and isinstance(value, Number):
        array[0][0] = value  # a matrix of one entry
        return True
    if not 0 <= place < len(array):
        return False
    if rest:
        return isinstance(array[place], list) and put(array[place], rest, value, first)
    if isinstance(array[place], list) != isinstance(value, list):
        return False
    array[place] = value
    return True
