"""Numbers and durations as text and as LaTeX."""

from __future__ import annotations

from decimal import Context, Decimal
from fractions import Fraction
from typing import Any


def number_text(value: Any, digits: int | None = None, *, is_zero: bool = False) -> str:
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


def latex_number(value: Any, digits: int | None = None, *, is_zero: bool = False) -> str:
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


UNITS = ((1e-9, "ns"), (1e-6, "µs"), (1e-3, "ms"), (1.0, "s"))


def duration(seconds: float, digits: int = 3) -> str:
    """A duration as text, in a suitable unit.

    Example:
        >>> [duration(x) for x in (4.567e-5, 0.0123, 9.999, 61.2, 8000.0)]
        ['45.7 µs', '12.3 ms', '10 s', '61.2 s', '2 h 13 min']
    """
    if seconds >= 600:
        minutes = round(seconds / 60)
        return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
    size, unit = next((u for u in UNITS if seconds < 999.5 * u[0]), UNITS[-1])  # 999.5 is rounded to 1000
    return f"{seconds / size:.{digits if seconds < 100 * size else 3}g} {unit}"
