"""The coefficients of formal sums: exact numbers, and how they are written."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from numbers import Rational
from typing import Any

from trees.errors import TreeError


def exact_coefficient(value: Any) -> Any:
    """A coefficient in its narrowest exact kind: int, Fraction, or an expanded SymPy expression.

    Raises:
        TreeError: If it is a float, or no number at all.

    Example:
        >>> exact_coefficient(Fraction(4, 2)), exact_coefficient(Fraction(1, 2))
        (2, Fraction(1, 2))
    """
    if type(value) is int:
        return value
    if isinstance(value, Rational) and not isinstance(value, bool):
        numerator, denominator = int(value.numerator), int(value.denominator)
        return numerator if denominator == 1 else Fraction(numerator, denominator)
    if type(value).__module__.startswith("sympy."):
        import sympy

        usable = isinstance(value, sympy.Expr) and value.is_finite is not False and value.is_commutative is not False
        if usable and not value.has(sympy.Float, sympy.nan):
            expanded = sympy.expand(value)
            if isinstance(expanded, sympy.Rational):
                return exact_coefficient(Fraction(int(expanded.p), int(expanded.q)))
            return 0 if expanded.equals(0) else expanded
    raise TreeError(f"coefficient must be an int, a Fraction or an exact SymPy expression, but was {value!r:.60}")


def latex_number(value: Any) -> str:
    """An exact coefficient as LaTeX."""
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Fraction):
        return f"{'-' if value < 0 else ''}\\frac{{{abs(value.numerator)}}}{{{value.denominator}}}"
    import sympy

    return sympy.latex(value)


def write_sum(terms: Iterable[tuple[Any, str]], number: Callable[[Any], str] = str) -> str:
    """A sum with signs between its terms, each a coefficient and the text of what it multiplies.

    Example:
        >>> write_sum([(-1, "x"), (2, "y"), (Fraction(-1, 2), "z")]), write_sum([])
        ('-x + 2 y - 1/2 z', '0')
    """
    parts = []
    for coefficient, text in terms:
        scale = number(coefficient)
        if getattr(coefficient, "is_Add", False):
            scale = f"({scale})"
        parts.append("-" if scale.startswith("-") else "+")
        scale = scale.removeprefix("-").lstrip()
        parts.append(text if scale == "1" else f"{scale} {text}")
    if not parts:
        return "0"
    return ("-" if parts[0] == "-" else "") + " ".join(parts[1:])
