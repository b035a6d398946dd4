"""A polynomial in z as text that `parse_expression` reads back, and as LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from .expressions import format_number
from .field_elements import from_element
from .inexact import Inexact


def polynomial_text(coefficients: Sequence[Any], *, latex: bool = False) -> str:
    """The sum of the terms that are not zero, in ascending powers of z.

    Args:
        coefficients: elements of a field (see `integrators.field_elements`), ascending.
        latex: whether to write LaTeX.

    Example:
        >>> polynomial_text([Fraction(1), Fraction(-1), Fraction(0), Fraction(2, 3)])
        '1 - z + 2*z^3/3'
    """
    write = _latex_term if latex else _term
    terms = [write(a if isinstance(a, Inexact) else from_element(a), k) for k, a in enumerate(coefficients) if a]
    return " + ".join(terms).replace("+ -", "- ") or "0"


def _term(value: Any, k: int) -> str:
    power = {0: "", 1: "z"}.get(k, f"z^{k}")
    if isinstance(value, Fraction):
        above = _product(str(abs(value.numerator)), "*", power)
        return "-" * (value < 0) + above + (f"/{value.denominator}" if value.denominator > 1 else "")
    if isinstance(value, Inexact):
        return "-" * (value.value < 0) + _product(value.text.lstrip("-"), "*", power)
    text = format_number(value)
    return _product(f"({text})" if " " in text and power else text, "*", power)


def _product(factor: str, sign: str, power: str) -> str:
    """The product, without a factor 1 of a power."""
    return factor + sign * bool(power) + power if factor != "1" or not power else power


def _latex_term(value: Any, k: int) -> str:
    power = {0: "", 1: "z"}.get(k, f"z^{{{k}}}")
    if isinstance(value, Fraction):
        size = abs(value)
        number = str(size) if size.denominator == 1 else f"\\frac{{{size.numerator}}}{{{size.denominator}}}"
        return "-" * (value < 0) + _product(number, " ", power)
    if isinstance(value, Inexact):
        mantissa, _, exponent = value.text.lstrip("-").partition("e")
        number = f"{mantissa} \\cdot 10^{{{int(exponent)}}}" if exponent else mantissa
        return "-" * (value.value < 0) + _product(number, " ", power)
    import sympy

    number = sympy.latex(value)
    return _product(f"\\left({number}\\right)" if " " in number and power else number, " ", power)
