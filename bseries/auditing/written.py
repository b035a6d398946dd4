"""Numbers in the form in which a source writes them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any

from integrators.methods.exchange.numbers import Number

HEAD = r"(\(*(?:-?\s*[A-Za-z_]\w*\b(?:\b[A-Za-z_]\w*\b|[^\w+.-])*)?)"
TAIL = r"((?:_[A-Za-z]\w*)?\W*)"
FRACTION = re.compile(rf"{HEAD}([+-]?\d+)(\.0*)?(\)?\s*//?\s*(?:[A-Za-z_]\w*\()?)(\d+)(\.0*)?{TAIL}")
DECIMAL = re.compile(rf"{HEAD}([+-]?\d*)\.(\d+)(?:([ed])([+-]?\d+))?{TAIL}", re.I)
WHOLE = re.compile(rf"{HEAD}([+-]?\d+)(\.0*)?{TAIL}")
MOST_CHARACTERS = 500
MOST_DENOMINATOR = 10**9


def as_written(value: Fraction, text: str, digits: int = 17) -> str:
    """A number in the form of a text: with its denominator, or as a decimal with as many digits.

    Casts, macros and the points of C stay, since 3/4 is 0 in C. Text of another form, such as a sum, gives the number:
    a fraction, or a decimal with some digits where that is long.
    """
    text = text.strip()
    if len(text) > MOST_CHARACTERS:
        return in_digits(value, digits)
    if match := FRACTION.fullmatch(text):
        head, _, point, slash, denominator, other_point, tail = (part or "" for part in match.groups())
        head, value = _signed(head, value)
        scaled = value * int(denominator)
        top, bottom = (scaled, denominator) if scaled.denominator == 1 else (value.numerator, value.denominator)
        return f"{head}{top}{point}{slash}{bottom}{other_point}{tail}"
    if match := DECIMAL.fullmatch(text):
        head, _, decimals, letter, exponent, tail = (part or "" for part in match.groups())
        head, value = _signed(head, value)
        unit = 10 ** len(decimals)
        scaled = round(value * unit / Fraction(10) ** int(exponent or 0))
        whole, rest = divmod(abs(scaled), unit)
        return f"{head}{'-' * (scaled < 0)}{whole}.{rest:0{len(decimals)}d}{letter}{exponent}{tail}"
    if (match := WHOLE.fullmatch(text)) and value.denominator == 1:
        head, _, point, tail = (part or "" for part in match.groups())
        head, value = _signed(head, value)
        return f"{head}{value}{point}{tail}"
    return in_digits(value, digits)


def _signed(head: str, value: Fraction) -> tuple[str, Fraction]:
    """A cast and the number in it, where a sign before the cast is needed for negative numbers only."""
    return (head, abs(value)) if "-" in head and value < 0 else (head.replace("-", ""), value)


def in_digits(value: Fraction, digits: int = 17) -> str:
    """A fraction; as a decimal where it is long."""
    if value.denominator < MOST_DENOMINATOR:
        return str(value)
    return str(Context(prec=max(17, digits)).divide(Decimal(value.numerator), Decimal(value.denominator)))


LEAST_DECIMALS = 7
"""Decimals with fewer digits, such as 0.25, are exact."""
ROOT_DIGITS = 40
"""Significant digits of roots in decimals."""


def as_decimal(x: Any) -> Fraction:
    """A number, roots as decimals."""
    import sympy

    return x if isinstance(x, Fraction) else Fraction(str(sympy.N(x, ROOT_DIGITS)))


def digits_of(numbers: Iterable[Number]) -> int | None:
    """The digits of rounded numbers, where roots become decimals; None if all are exact."""
    written = [x.digits if isinstance(x.value, Fraction) else ROOT_DIGITS for x in numbers]
    rounded = [n for n in written if n >= LEAST_DECIMALS]
    return max((n for n in rounded if n != ROOT_DIGITS), default=ROOT_DIGITS) if rounded else None
