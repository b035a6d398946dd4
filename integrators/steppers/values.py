"""Values in loops over the entries of arrays, as data that is written once the index is known."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple, TypeAlias

from integrators.exact.entries import round_entry
from integrators.exact.expressions import ATOM, PRODUCT, SUM, Part, within

Index: TypeAlias = str | int
"""The variable of a loop, or the only index of a block."""


class Entry(NamedTuple):
    """The entry of an array at the index of a loop plus a shift."""

    array: str
    shift: int = 0


class Product(NamedTuple):
    """A number, as text or in an array of constants, times a value."""

    factor: str | Entry
    value: Value
    negative: bool = False


class Sum(NamedTuple):
    """The sum of some values."""

    terms: tuple[Value, ...]


Value: TypeAlias = Entry | Product | Sum


def entry(array: str, i: Index, shift: int = 0) -> str:
    """The text of the entry i + shift of an array."""
    if isinstance(i, int) or not shift:
        return f"{array}[{i + shift if isinstance(i, int) else i}]"
    return f"{array}[{i} {'+' if shift > 0 else '-'} {abs(shift)}]"


def shifted(value: Value, shift: int) -> Value:
    """The value at another index."""
    match value:
        case Entry():
            return Entry(value.array, value.shift + shift)
        case Product():
            return value._replace(value=shifted(value.value, shift))
        case Sum():
            return Sum(tuple(shifted(term, shift) for term in value.terms))


def scaled(value: Value, x: Fraction) -> Value:
    """A multiple of a value."""
    return value if x == 1 else Product("" if x == -1 else repr(round_entry(abs(x))), value, negative=x < 0)


def written(value: Value, i: Index) -> str:
    """The text of a value at an index.

    Example:
        >>> product = Product("0.5", Entry("k0", 2))
        >>> moved = shifted(Sum((Entry("y"), Product("h", Sum((product, Entry("k1"))), negative=True))), -2)
        >>> written(moved, "i"), written(moved, 2)
        ('y[i - 2] - h*(0.5*k0[i] + k1[i - 2])', 'y[0] - h*(0.5*k0[2] + k1[0])')
    """
    return _part(value, i)[0]


def _part(value: Value, i: Index) -> Part:
    match value:
        case Entry(array, shift):
            return entry(array, i, shift), ATOM
        case Product(factor, inner, negative):
            text = written(factor, i) if isinstance(factor, Entry) else factor
            text = f"{text}*" * bool(text) + within(_part(inner, i), PRODUCT)
            return (f"-{text}", SUM) if negative else (text, PRODUCT)
        case Sum(terms):
            text = ""
            for term in terms:
                minus = isinstance(term, Product) and term.negative
                part = within(_part(term._replace(negative=False) if minus else term, i), PRODUCT)
                text += f" {'-' if minus else '+'} {part}" if text else f"{'-' * minus}{part}"
            return text or "0.0", SUM
