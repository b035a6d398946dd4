"""Exact numbers as Python text: the nearest double."""

from __future__ import annotations

from typing import Any

from integrators.core.errors import IntegratorError, shorten
from integrators.exact.arithmetic import Exact

SUM, PRODUCT, ATOM = range(3)
"""Precedence of the outermost operation of a text."""


def literal(value: Exact) -> str:
    """The nearest double to an exact number, as text.

    Example:
        >>> import sympy
        >>> literal(Fraction(1, 3)), literal(sympy.sqrt(2)), literal(Fraction(4))
        ('0.3333333333333333', '1.4142135623730951', '4.0')
    """
    try:
        return repr(nearest_double(value))
    except ArithmeticError:
        raise IntegratorError(
            f"formula must have numbers that doubles can stand for, but has {shorten(str(value))}"
        ) from None


def nearest_double(value: Any) -> float:
    """The nearest double to an exact number; ties are rounded to even.

    Python rounds fractions this way, SymPy does not. Irrational numbers are rounded to 40 digits first, which matters
    only for numbers that agree with the midpoint of two doubles to 40 digits.

    Example:
        >>> import sympy
        >>> nearest_double(Fraction(1, 3)), nearest_double(1 - sympy.sqrt(2))
        (0.3333333333333333, -0.41421356237309503)
    """
    if not hasattr(value, "evalf"):
        return float(value)
    import sympy

    digits: Any = sympy.Rational(value if value.is_Rational else value.evalf(40, strict=True))
    return int(digits.p) / int(digits.q)


def within(part: tuple[str, int], precedence: int) -> str:
    """A text as an operand of an operation of given precedence."""
    return part[0] if part[1] >= precedence else f"({part[0]})"
