"""Exact numbers of source text: fractions, and formulas of roots as text, with the digits and the place they have."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

from integrators.exact import arithmetic as exact
from integrators.exact.expressions import MAX_LENGTH

COSINES = ("cos", "sin", "tan")
FUNCTIONS = {
    **dict.fromkeys(("sqrt", "Sqrt", "SUNRsqrt", "PetscSqrtReal", "sqrtl", "dsqrt", "√"), "sqrt"),
    **dict.fromkeys(("cbrt", "CubeRoot", "Cbrt"), "cbrt"),
    **{name: name for name in COSINES},
    **{name.capitalize(): name for name in COSINES},
    **dict.fromkeys(("inv", "abs", "Abs", "fabs"), "inv"),
}
"""Functions of one number, as parsers of formulas name them."""
POWERS = ("pow", "powl", "SUNRpowerR", "PetscPowReal", "power", "Power")
QUOTIENTS = ("Rational", "Fraction", "mpq", "QQ")
CIRCLE = ("pi", "π", "PI", "M_PI", "Pi")
MOST_EXPONENT = 10_000


class Number(NamedTuple):
    """A number, and how it was written."""

    value: Fraction | str
    """A formula of roots is text that `parse_number` reads."""
    digits: int = 0
    """The largest number of significant digits of the decimals in it."""
    is_whole: bool = False
    """Whether it is an integer for languages whose integers have integer quotients."""
    text: str = "0"
    line: int = 0
    estimate: float = 0.0
    """Of a formula, for comparisons that tell what a number is; it enters no result."""

    @property
    def near(self) -> float:
        """The number to some digits, for comparisons that tell what it is."""
        try:
            return float(self.value) if isinstance(self.value, Fraction) else self.estimate
        except OverflowError:
            return math.inf


Value: TypeAlias = "Number | list[Any]"
"""A number or nested lists of numbers."""


class Struct(NamedTuple):
    """Memory for tables of this many stages."""

    stages: int


ZERO = Number(Fraction(0))
ONE = Number(Fraction(1))
NEUTRAL = {"+": ZERO.value, "*": ONE.value}


def literal(text: str) -> Number:
    """The number of a literal, of any language."""
    plain = re.sub(r"_[A-Za-z]\w*$|`[\d.]*$|_|(?<=[\d.])(?!0x)[fFlLuUqQ]+$", "", text.strip())
    match = re.fullmatch(r"([-+]?)(\d*)(?:\.(\d*))?(?:(?:[eEdDqQf]|\*\^)([-+]?\d+))?", plain)
    if match is None or not (match[2] or match[3]):
        raise ValueError(text)
    sign, whole, decimals, exponent = match.groups()
    if len(whole) + len(decimals or "") > exact.MAX_DIGITS:
        raise ValueError(text)
    power = int(exponent[:12]) if exponent else 0
    if abs(power) > MOST_EXPONENT:
        raise ArithmeticError(f"has a number of more than {exact.MAX_DIGITS} digits")
    value = Fraction(int(sign + whole + (decimals or ""))) * Fraction(10) ** (power - len(decimals or ""))
    is_decimal = decimals is not None
    digits = len((whole + (decimals or "")).strip("0")) if is_decimal else 0
    bounded: Any = exact.bounded(value)
    return Number(bounded, digits, not is_decimal and exponent is None)


def combine(sign: str, x: Number, y: Number) -> Number:
    """The sum, difference, product, quotient or power of two numbers."""
    a, b = x.value, y.value
    digits, is_whole = max(x.digits, y.digits), x.is_whole and y.is_whole
    if sign in NEUTRAL and NEUTRAL[sign] in (a, b):  # the other number keeps its text and its place
        other = x if b == NEUTRAL[sign] else y
        return other._replace(is_whole=is_whole)
    if isinstance(a, Fraction) and isinstance(b, Fraction):
        result = _rational(sign, a, b)
        if result is not None:
            return Number(result, digits, is_whole)
    return Number(_formula(sign, a, b), digits, is_whole, estimate=_estimate(sign, x.near, y.near))


def _rational(sign: str, a: Fraction, b: Fraction) -> Any:
    """The result on fractions; None if it is no fraction."""
    if sign == "+":
        return exact.bounded(a + b)
    if sign == "-":
        return exact.bounded(a - b)
    if sign == "*":
        return exact.bounded(a * b)
    if sign == "/":
        return exact.bounded(a * exact.invert(b))
    if b.denominator > 1:
        return None
    power: Any = exact.power(a, b)
    return power


def _estimate(name: str, *arguments: float) -> float:
    """The value of an operation or a function of floats; not a number if it has none."""
    operations: dict[str, Callable[..., float]] = {
        "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "^": math.pow,
        "sqrt": math.sqrt, "cbrt": math.cbrt, "cos": math.cos, "sin": math.sin, "tan": math.tan,
    }  # fmt: skip
    try:
        return operations[name](*arguments)
    except (ArithmeticError, ValueError):
        return math.nan


def _formula(sign: str, a: Fraction | str, b: Fraction | str) -> str:
    text = f"({a}){sign}({b})"
    if len(text) > MAX_LENGTH:
        raise ArithmeticError(f"has a formula of more than {MAX_LENGTH} characters")
    return text


def negative(x: Number) -> Number:
    """The number with the other sign."""
    value = -x.value if isinstance(x.value, Fraction) else f"-({x.value})"
    return x._replace(value=value, estimate=-x.estimate)


def apply(name: str, arguments: Sequence[Number]) -> Number:
    """The value of a function of numbers."""
    if name in POWERS and len(arguments) == 2:
        return combine("^", *arguments)
    if name in QUOTIENTS and len(arguments) == 2:
        return combine("/", *arguments)
    function = FUNCTIONS[name]
    (x,) = arguments
    if name.lower() in ("abs", "fabs"):
        if not isinstance(x.value, Fraction):
            raise ArithmeticError("has the absolute value of a root")
        return x._replace(value=abs(x.value))
    if function == "inv":
        return combine("/", ONE, x)
    if function == "sqrt" and isinstance(x.value, Fraction):
        if x.value < 0:
            raise ArithmeticError("has an even root of a negative number")
        root = Fraction(*map(math.isqrt, x.value.as_integer_ratio()))
        if root**2 == x.value:
            return x._replace(value=root, is_whole=False)
    estimate = _estimate(function, x.near)
    return x._replace(value=f"{function}({x.value})", is_whole=False, estimate=estimate)


def elementwise(operation: Callable[[Number, Number], Number], x: Value, y: Value) -> Value:
    """An operation on numbers, or on arrays and numbers entry by entry."""
    if isinstance(x, list) and isinstance(y, list):
        if len(x) != len(y):
            raise ArithmeticError(f"has arrays of {len(x)} and {len(y)} entries")
        return [elementwise(operation, a, b) for a, b in zip(x, y, strict=True)]
    if isinstance(x, list):
        return [elementwise(operation, a, y) for a in x]
    if isinstance(y, list):
        return [elementwise(operation, x, b) for b in y]
    return operation(x, y)


def each(operation: Callable[[Number], Number], x: Value) -> Value:
    """An operation on a number or on all entries of an array."""
    return [each(operation, entry) for entry in x] if isinstance(x, list) else operation(x)
