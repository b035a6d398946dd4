"""What formats have in common: numbers and arrays as text, orders, and tableaus from arrays."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from typing import Any, NamedTuple

from integrators.core.arguments import as_lists
from integrators.core.errors import IntegratorError, shorten
from integrators.exact.entries import Entry, is_sympy, multiply_entries, read_entry, round_entry, sum_entries
from integrators.exact.expressions import decimal_text, format_number
from integrators.methods.exchange.array_text import Language
from integrators.methods.tableaux.elementary_weights import MAX_ORDER, order_of_weights
from integrators.methods.tableaux.runge_kutta import RungeKutta

DOUBLE_DIGITS = 16
"""Decimals with so many significant digits or more count as rounded."""
LARGEST_DENOMINATOR = 10**6
"""Of fractions behind doubles: three of 100,000 random doubles are nearest to such a fraction."""
LITERAL = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


class Format(NamedTuple):
    """The text and the objects of one package.

    Attributes:
        language: The language of the text.
        marks: A pattern of what only text in this format has.
        title: A pattern of the name of the method in the text.
        names: The names of the arrays in the text.
        write: The text of a method.
        tableau: Stage matrix, weights, nodes and rows of embedded weights from the arrays; the nodes may be None.
        prepare: Rewrites text without assignments.
    """

    language: Language
    marks: str
    title: str
    names: Sequence[str]
    write: Callable[[RungeKutta], str]
    tableau: Callable[[Mapping[str, Any]], tuple[Any, Any, Any, Any]]
    prepare: Callable[[str], str] = str


class Numbers(NamedTuple):
    """How a language writes whole numbers, and quotients that it computes exactly or rounds once."""

    whole: str
    quotient: str
    largest: int | None = None

    def text(self, value: Any, digits: int | None) -> str:
        """An entry as text; published decimals keep their digits, roots are those of SymPy."""
        if isinstance(value, float):
            return repr(value)
        if is_sympy(value):
            return re.sub(r"(?<![\w.)])(\d+)/(\d+)", lambda match: self.quotient.format(*match.groups()), str(value))
        if value.denominator == 1 and (self.largest is None or abs(value) < self.largest):
            return self.whole.format(value)
        decimal = format_number(value) if digits is None else decimal_text(value)
        if "/" not in decimal and value.denominator > 1:
            return decimal
        if self.largest is None or max(abs(value.numerator), value.denominator) < self.largest:
            return self.quotient.format(value.numerator, value.denominator)
        return repr(round_entry(value))

    def row(self, values: Iterable[Any], digits: int | None, separator: str = ", ") -> str:
        """Entries, one behind the other."""
        return separator.join(self.text(value, digits) for value in values)


def rounded(method: RungeKutta) -> RungeKutta:
    """The method, in doubles if it has roots."""
    return method.to_float() if method.domain == "algebraic" else method


def header(method: RungeKutta, package: str, *notes: str) -> str:
    """The text of the first comment."""
    return " ".join([f"{printable(method.name)}, a tableau for {package}.", *filter(None, notes)])


def rounding(method: RungeKutta) -> str:
    """A note on roots."""
    return "Roots are rounded to doubles." if method.domain == "algebraic" else ""


def one_row(method: RungeKutta) -> str:
    """A note on embedded weights that do not fit."""
    count = len(method.embedded)
    return f"Only the first of {count} rows of embedded weights is here." if count > 1 else ""


def at_least(order: int) -> str:
    """A note on an order that is not determined."""
    return f"Its order is {MAX_ORDER} or more." if order == MAX_ORDER else ""


def printable(name: str) -> str:
    """A name for comments, which end with the line."""
    return "".join(filter(str.isprintable, name))


def quoted(name: str) -> str:
    """A name in quotes, for Python, Julia and C."""
    return '"' + re.sub(r'([\\"])', r"\\\1", printable(name)) + '"'


def identifier(name: str) -> str:
    """A name of letters, digits and _, which begins with a letter; it may be a keyword."""
    cleaned = re.sub(r"\W", "_", name, flags=re.ASCII).strip("_")
    return cleaned if cleaned[:1].isalpha() else f"method_{cleaned}"


def orders(method: RungeKutta) -> tuple[int, int]:
    """The order of a method, at most `MAX_ORDER`, and that of its first row of embedded weights or 0."""
    import numpy as np

    shown, kind = (method, object) if method.domain == "QQ" else (method.to_float(), float)
    A, b, *embedded = (np.array(rows, dtype=kind) for rows in (shown.A, shown.b, *shown.embedded[:1]))
    return order_of_weights(A, b), order_of_weights(A, embedded[0]) if embedded else 0


def require(method: RungeKutta, package: str, *, holds: bool, what: str) -> None:
    """Refuse a method that a package has no form for."""
    if not holds:
        raise IntegratorError(f"method must be {what} for {package}, but was {shorten(method.name)}")


def require_row_sums(method: RungeKutta, package: str) -> None:
    """Refuse nodes that a package would replace."""
    require(method, package, holds=not method.issues, what="consistent, with nodes that are the row sums,")


def square(values: Any, stages: int) -> Any:
    """A stage matrix given by rows, as one long list, or as a number."""
    if not isinstance(values, list):
        return [[values]]
    if any(isinstance(row, list) for row in values):
        return values
    if len(values) != stages * stages:
        raise IntegratorError(f"A must have {stages}² entries, as many rows as b has entries, but has {len(values)}")
    return [values[i * stages : (i + 1) * stages] for i in range(stages)]


def vector(values: Any) -> Any:
    """A row of entries, also of one."""
    return values if isinstance(values, list) else [values]


def combined(row: Sequence[Entry], other: Sequence[Entry], sign: int) -> list[Entry]:
    """A row plus or minus another."""
    if len(row) != len(other):
        raise IntegratorError(f"rows must have equally many entries, but had {len(row)} and {len(other)}")
    return [sum_entries((x, multiply_entries(Fraction(sign), y))) for x, y in zip(row, other, strict=True)]


class Entries:
    """Entries of arrays, read exactly, and the number of digits that are known of them.

    Formulas are exact, but long decimals in them are rounded numbers; doubles become their shortest decimals. With
    `fractions`, both become the nearest fraction with a small denominator where that rounds to the same double.
    """

    def __init__(self, *, fractions: bool) -> None:
        self.fractions = fractions
        self.known: list[int] = []

    @property
    def digits(self) -> int | None:
        """Known significant digits; None if all entries are exact."""
        return min(self.known, default=None)

    def read(self, values: Any, name: str) -> Any:
        """Nested lists of entries."""
        values = as_lists(values)
        if isinstance(values, list | tuple):
            return [self.read(value, name) for value in values]
        entry = read_entry(values, name)
        if isinstance(entry, float):
            decimal = Fraction(Decimal(repr(entry)))
            return decimal if decimal == entry else self._inexact(decimal, DOUBLE_DIGITS)
        counts = [_significant(literal) for literal in LITERAL.findall(values)] if isinstance(values, str) else []
        if isinstance(entry, Fraction) and max(counts, default=0) >= DOUBLE_DIGITS:
            return self._inexact(entry, max(counts))
        return entry

    def _inexact(self, value: Fraction, digits: int) -> Fraction:
        """A rounded number, or the fraction behind it."""
        nearest = value.limit_denominator(LARGEST_DENOMINATOR)
        if self.fractions and float(nearest) == float(value):
            return nearest
        # The last of 17 digits is that of a double and not of the number.
        self.known.append(digits if digits > DOUBLE_DIGITS + 1 else DOUBLE_DIGITS)
        return value


def _significant(literal: str) -> int:
    """The number of significant digits of a decimal; 0 for an integer."""
    mantissa = literal.lower().partition("e")[0]
    return len(mantissa.replace(".", "").strip("0")) if "." in mantissa else 0
