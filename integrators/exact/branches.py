"""Functions that are not smooth: abs(x), sign(x), and where(x > 0, a, b).

SymPy's own take symbols without assumptions as complex, so that their derivatives are no formulas. Those here are real,
and their derivatives are the ones on either side: abs' = sign, sign' = 0. This module imports SymPy, and is itself
imported where a formula has such a function.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import sympy
from sympy.printing.printer import Printer

from integrators.exact.arithmetic import in_sympy

RELATIONS = (">", "<", ">=", "<=")
SYMPY_NAMES = {sympy.Abs: "abs", sympy.sign: "sign", sympy.Max: "max", sympy.Min: "min"}
"""Names in formulas of SymPy's functions."""


class Branching(sympy.Function):
    """Base class of the functions that are not smooth."""

    is_real = True
    if TYPE_CHECKING:
        args: tuple[sympy.Expr, ...]  # type: ignore[override]

        def __new__(cls, *args: object) -> sympy.Expr: ...  # noqa: D102


class Absolute(Branching):
    """|x|, in text ``abs(x)``.

    Example:
        >>> x = sympy.Symbol("x")
        >>> Absolute(-2 * x), Absolute(-2), Absolute(x**2 - 1).diff(x)
        (abs(2*x), 2, 2*x*sign(x**2 - 1))
    """

    nargs = 1

    @classmethod
    def eval(cls, x: sympy.Expr) -> sympy.Expr | None:  # type: ignore[override]  # noqa: D102 (called by SymPy, as others below)
        if x.is_extended_nonnegative:
            return x
        if x.is_extended_nonpositive or x.could_extract_minus_sign():
            return cls(-x)
        return None

    def fdiff(self, argindex: int = 1) -> sympy.Expr:  # noqa: D102
        return Sign(self.args[0])

    def _sympystr(self, printer: Printer) -> str:
        return f"abs({printer.doprint(self.args[0])})"

    def _latex(self, printer: Printer, exp: str | None = None) -> str:
        text = rf"\left|{{{printer.doprint(self.args[0])}}}\right|"
        return text if exp is None else f"{text}^{{{exp}}}"

    _mpmathcode = _numpycode = _pythoncode = _sympystr


class Sign(Branching):
    """−1, 0 or 1, in text ``sign(x)``."""

    nargs = 1

    @classmethod
    def eval(cls, x: sympy.Expr) -> sympy.Expr | None:  # type: ignore[override]  # noqa: D102
        if x.is_zero:
            return sympy.Integer(0)
        if x.is_extended_positive:
            return sympy.Integer(1)
        if x.is_extended_negative or x.could_extract_minus_sign():
            return -cls(-x)
        return None

    def fdiff(self, argindex: int = 1) -> sympy.Expr:  # noqa: D102
        return sympy.Integer(0)

    def _sympystr(self, printer: Printer) -> str:
        return f"sign({printer.doprint(self.args[0])})"

    def _latex(self, printer: Printer, exp: str | None = None) -> str:
        power = "" if exp is None else f"^{{{exp}}}"
        return rf"\operatorname{{sign}}{power}{{\left({printer.doprint(self.args[0])} \right)}}"

    def _pythoncode(self, printer: Printer) -> str:
        x = printer.doprint(self.args[0])
        return f"(({x} > 0) - ({x} < 0))"

    def _numpycode(self, printer: Printer) -> str:
        return printer.doprint(sympy.sign(self.args[0]))

    _mpmathcode = _pythoncode


class Where(Branching):
    """a if x is positive, otherwise b; in text ``where(x > 0, a, b)``."""

    nargs = 3

    @classmethod
    def eval(cls, x: sympy.Expr, a: sympy.Expr, b: sympy.Expr) -> sympy.Expr | None:  # type: ignore[override]  # noqa: D102
        if a == b or x.is_extended_positive:
            return a
        return b if x.is_extended_nonpositive else None

    def _eval_derivative(self, s: object) -> sympy.Expr:
        x, a, b = self.args
        return Where(x, a.diff(s), b.diff(s))  # not a sum, in which the other branch may be infinite

    def _sympystr(self, printer: Printer) -> str:
        x, a, b = map(printer.doprint, self.args)
        return f"where({x} > 0, {a}, {b})"

    def _latex(self, printer: Printer, exp: str | None = None) -> str:
        x, a, b = map(printer.doprint, self.args)
        text = rf"\begin{{cases}} {a} & \text{{for}}\: {x} > 0 \\ {b} & \text{{otherwise}} \end{{cases}}"
        return text if exp is None else rf"\left({text}\right)^{{{exp}}}"

    def _pythoncode(self, printer: Printer) -> str:
        x, a, b = map(printer.doprint, self.args)
        return f"(({a}) if {x} > 0 else ({b}))"

    def _numpycode(self, printer: Printer) -> str:
        x, a, b = self.args
        return printer.doprint(sympy.Piecewise((a, x > 0), (b, True)))

    _mpmathcode = _pythoncode


def compare(left: sympy.Expr, relation: str, right: sympy.Expr | int, a: object, b: object) -> sympy.Expr:
    """a where the relation ``>``, ``<``, ``>=`` or ``<=`` holds, otherwise b."""
    x, first, second = map(in_sympy, (left - right, a, b))
    positive = x if relation in (">", "<=") else -x
    return Where(positive, first, second) if relation in (">", "<") else Where(positive, second, first)


def extreme(name: str, values: Sequence[sympy.Expr]) -> sympy.Expr:
    """The least (``min``) or largest (``max``) of n values, with n² parts: a comparison repeats what it compares."""
    if len(values) == 1:
        return values[0]
    half = len(values) // 2
    a, b = extreme(name, values[:half]), extreme(name, values[half:])
    return compare(a, ">" if name == "max" else "<", b, a, b)


def from_sympy(formula: Any) -> sympy.Expr:
    """A formula with these functions in place of SymPy's Abs, sign, Heaviside, Max, Min and Piecewise.

    Example:
        >>> x = sympy.Symbol("x")
        >>> from_sympy(sympy.Abs(x) + sympy.Piecewise((x, x < 1), (1, True)))
        abs(x) + where(1 - x > 0, x, 1)
    """
    if not formula.args:
        return formula
    if isinstance(formula, sympy.Piecewise):
        return _chosen(formula.args)
    arguments = [from_sympy(argument) for argument in formula.args]
    if isinstance(formula, sympy.Heaviside):
        return branch("heaviside", "", arguments[:1]) if arguments[1] == sympy.Rational(1, 2) else formula
    name = SYMPY_NAMES.get(formula.func)
    return formula.func(*arguments) if name is None else branch(name, "", arguments)


def _chosen(pairs: Sequence[Any]) -> sympy.Expr:
    """The branches of a `Piecewise` with inequalities, one after the other; the last must hold otherwise."""
    (value, condition), *others = pairs
    if condition == sympy.true or not others:
        return from_sympy(value) if condition == sympy.true else sympy.Piecewise((value, condition))
    relation = getattr(condition, "rel_op", "")
    if relation not in RELATIONS:
        return sympy.Piecewise(*pairs)
    left, right = map(from_sympy, condition.args)
    return compare(left, relation, right, from_sympy(value), _chosen(others))


def branch(name: str, relation: str, values: Sequence[object]) -> sympy.Expr:
    """The function with a name in formulas, applied to values; `relation` is between the first two of ``where``."""
    first, *others = map(in_sympy, values)
    match name:
        case "abs":
            return Absolute(first)
        case "sign":
            return Sign(first)
        case "heaviside":
            return (1 + Sign(first)) / 2
        case "where":
            right, a, b = others
            return compare(first, relation, right, a, b)
        case _:
            return extreme(name, [first, *others])
