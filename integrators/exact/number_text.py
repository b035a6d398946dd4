"""Exact numbers as Python text: the nearest double, or an expression of any precision."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypeAlias

from integrators.core.errors import IntegratorError, shorten
from integrators.exact.expressions import ELEMENTARY

if TYPE_CHECKING:
    import sympy

    Coefficient: TypeAlias = Fraction | sympy.Expr

SUM, PRODUCT, ATOM = range(3)
"""Precedence of the outermost operation of a text."""


def literal(value: Coefficient) -> str:
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

    Args:
        value: A rational Python number, or a real SymPy number.

    Raises:
        ArithmeticError: It is beyond the range of doubles, or cannot be distinguished from zero.
        TypeError: It is not a real number.

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


def exact_text(value: Coefficient, number: str) -> str:
    """An exact number as an expression of integers, roots and functions.

    Example:
        >>> import sympy
        >>> exact_text(sympy.sqrt(3) / 6 + sympy.pi, "ratio")
        'sqrt(3)*ratio(1, 6) + pi'
    """
    return bound_text(value, number)[0]


def bound_text(value: Any, number: str) -> tuple[str, int]:
    """The text of an exact number, and its precedence."""
    if isinstance(value, Fraction) or value.is_Rational:
        p, q = (value.numerator, value.denominator) if isinstance(value, Fraction) else (value.p, value.q)
        return (str(p), ATOM if p >= 0 else SUM) if q == 1 else (f"{number}({p}, {q})", ATOM)
    name, parts = type(value).__name__, [bound_text(part, number) for part in value.args]
    if name == "Pi":
        return "pi", ATOM
    if name == "Exp1":
        return "exp(1)", ATOM
    if value.is_Add:
        return " + ".join(within(part, SUM) for part in reversed(parts)), SUM
    if value.is_Mul:
        return "*".join(within(part, PRODUCT) for part in reversed(parts)), PRODUCT
    if value.is_Pow and value.exp == Fraction(1, 2):
        return f"sqrt({parts[0][0]})", ATOM
    if value.is_Pow:
        base = (f"{number}({value.base}, 1)", ATOM) if value.base.is_Integer else parts[0]
        return f"{within(base, ATOM)}**{within(parts[1], ATOM)}", PRODUCT
    if name in ELEMENTARY:
        return f"{name}({parts[0][0]})", ATOM
    raise IntegratorError(
        f"formula must have numbers made of integers, roots, pi and functions, but has {shorten(str(value))!r}"
    )


def within(part: tuple[str, int], precedence: int) -> str:
    """A text as an operand of an operation of given precedence."""
    return part[0] if part[1] >= precedence else f"({part[0]})"
