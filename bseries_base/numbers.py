"""Exact and decimal numbers as text and as LaTeX."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Context, Decimal
from fractions import Fraction
from typing import SupportsFloat


def number_text(value: object, digits: int | None = None, *, is_zero: bool = False) -> str:
    """A number as text; a fraction is rounded if `digits` of it are known, and 0 if it is zero within them.

    Example:
        >>> number_text(Fraction(1, 3)), number_text(Fraction(1, 3), 5)
        ('1/3', '0.33333')
    """
    if digits is not None and is_zero:
        return "0"
    if digits is None or not isinstance(value, Fraction):
        return str(value)
    if value.denominator == 1 and abs(value) < 10**digits:
        return str(value)
    rounded = Context(prec=digits).divide(Decimal(value.numerator), Decimal(value.denominator)).normalize()
    return f"{rounded:e}" if rounded.adjusted() < -4 else str(rounded)


def latex_number(value: object, digits: int | None = None, *, is_zero: bool = False) -> str:
    r"""A number or a SymPy expression as LaTeX; see `number_text`.

    Example:
        >>> print(latex_number(Fraction(-1, 3)), latex_number(1e-9))
        -\frac{1}{3} 1 \cdot 10^{-9}
    """
    if isinstance(value, float) or (isinstance(value, Fraction) and digits is not None):
        mantissa, _, exponent = number_text(value, digits, is_zero=is_zero).lower().partition("e")
        return f"{mantissa} \\cdot 10^{{{int(exponent)}}}" if exponent else mantissa
    if isinstance(value, int | Fraction):
        sign, above = "-" if value < 0 else "", abs(value.numerator)
        return f"{sign}\\frac{{{above}}}{{{value.denominator}}}" if value.denominator > 1 else str(value)
    import sympy

    return sympy.latex(value)


LINE = 120
"""The length of lines of LaTeX."""


def broken_sum(summands: Sequence[str]) -> str:
    r"""A sum on as many lines of an align as it takes; summands may begin with a minus sign.

    Example:
        >>> print(broken_sum(["f", "- h g", "h^{2} k"]))
        f - h g + h^{2} k
    """
    lines = list(summands[:1])
    for text in summands[1:]:
        signed = f"- {text.removeprefix('-').lstrip()}" if text.startswith("-") else f"+ {text}"
        if len(lines[-1]) + len(signed) > LINE:
            lines.append(signed)
        else:
            lines[-1] += f" {signed}"
    return " \\\\\n&\\quad ".join(lines)


def finite_or_none(value: SupportsFloat) -> float | None:
    """A number for a table: None if it is not finite, for which JSON has no number."""
    return float(value) if math.isfinite(value) else None
