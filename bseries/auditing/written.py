"""Numbers in the form in which a source writes them."""

from __future__ import annotations

import re
from fractions import Fraction

HEAD = r"(\(*(?:-?\s*[A-Za-z_]\w*\b(?:\b[A-Za-z_]\w*\b|[^\w+.-])*)?)"
TAIL = r"((?:_[A-Za-z]\w*)?\W*)"
FRACTION = re.compile(rf"{HEAD}([+-]?\d+)(\.0*)?(\s*//?\s*)(\d+)(\.0*)?{TAIL}")
DECIMAL = re.compile(rf"{HEAD}([+-]?\d*)\.(\d+)(?:([ed])([+-]?\d+))?{TAIL}", re.I)
WHOLE = re.compile(rf"{HEAD}([+-]?\d+)(\.0*)?{TAIL}")
MOST_CHARACTERS = 500


def as_written(value: Fraction, text: str) -> str:
    """A number in the form of a text: with its denominator, or as a decimal with as many digits.

    Casts, macros and the points of C stay, since 3/4 is 0 in C. Text of another form, such as a sum, gives the number.
    """
    text = text.strip()
    if len(text) > MOST_CHARACTERS:
        return _plain(value)
    if match := FRACTION.fullmatch(text):
        head, _, point, slash, denominator, other_point, tail = (part or "" for part in match.groups())
        value *= _sign(head)
        scaled = value * int(denominator)
        top, bottom = (scaled, denominator) if scaled.denominator == 1 else (value.numerator, value.denominator)
        return f"{head}{top}{point}{slash}{bottom}{other_point}{tail}"
    if match := DECIMAL.fullmatch(text):
        head, _, decimals, letter, exponent, tail = (part or "" for part in match.groups())
        unit = 10 ** len(decimals)
        scaled = round(value * _sign(head) * unit / Fraction(10) ** int(exponent or 0))
        whole, rest = divmod(abs(scaled), unit)
        return f"{head}{'-' * (scaled < 0)}{whole}.{rest:0{len(decimals)}d}{letter}{exponent}{tail}"
    if (match := WHOLE.fullmatch(text)) and value.denominator == 1:
        head, _, point, tail = (part or "" for part in match.groups())
        return f"{head}{value * _sign(head)}{point}{tail}"
    return _plain(value)


def _sign(head: str) -> int:
    """The sign before a cast."""
    return -1 if "-" in head else 1


def _plain(value: Fraction) -> str:
    """A fraction; as a decimal where it is long."""
    return str(value) if value.denominator < 10**9 else f"{float(value):.17g}"
