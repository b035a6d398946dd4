"""Formulas of scenes: one exact normal form for numbers, text and SymPy expressions."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from itertools import islice
from math import isfinite
from typing import TYPE_CHECKING, Any, NoReturn, cast

from bseries_base.errors import shorten, shown
from bseries_base.formulas import formula_text
from integrators.core.arguments import without_axes
from integrators.core.errors import IntegratorError
from integrators.exact import arithmetic as exact
from integrators.exact.expressions import FUNCTIONS, NOT_FINITE, ROOTS, nearest_double, parse_expression

if TYPE_CHECKING:
    import sympy

KNOWN = frozenset((*FUNCTIONS, *ROOTS, "pi"))
"""All names with a meaning in formulas."""
MAX_FORMS = 10
"""The largest number of write-and-read cycles until a formula is stable; at most two have been observed."""
FORMULA = "formula"
"""Placeholder in messages about a formula whose place is not known yet."""
_WORD = re.compile(r"(?<![\w.])[^\W\d]\w*")


def read_formula(value: object, names: Collection[str], argument: str) -> sympy.Expr:
    """An exact SymPy expression in plain symbols, without floats, equal to the expression parsed from its own text.

    `value` is a number, or a formula in `names` as text or SymPy expression; a float denotes the decimal that it prints
    as. Other values, names and functions are refused.

    Example:
        >>> import sympy
        >>> q = sympy.Symbol("q", real=True)
        >>> read_formula(0.5 * sympy.cos(q), ["q"], "potential") == read_formula("cos(q)/2", ["q"], "potential")
        True
    """
    number = _rational(value, argument)
    import sympy

    if number is not None:
        return exact.in_sympy(number)
    if isinstance(value, str | Decimal):
        return stable_form(_parse(str(value), names, argument), argument)
    if isinstance(value, sympy.Expr):
        return stable_form(_plain(value, names, argument), argument)
    plain = without_axes(value)
    if type(plain) is type(value):
        raise IntegratorError(f"{argument} must be a formula or a number, but was {shown(value)}")
    return read_formula(plain, names, argument)


def read_numbers(values: Iterable[object], argument: str) -> tuple[sympy.Expr, ...]:
    """Exact numbers, each read by `read_formula`."""
    read: dict[object, sympy.Expr] = {}  # large scenes repeat the same numbers

    def number(k: int, value: object) -> sympy.Expr:
        if type(value) not in (int, float):
            return read_formula(value, (), f"{argument}[{k}]")
        if value not in read:
            read[value] = read_formula(value, (), f"{argument}[{k}]")
        return read[value]

    return tuple(number(k, value) for k, value in enumerate(values, 1))


def words(text: str) -> dict[str, None]:
    """The names of symbols and functions in a text, in their order."""
    return dict.fromkeys(_WORD.findall(text))


def as_float(value: sympy.Expr) -> float:
    """The double nearest to an exact number."""
    try:
        return nearest_double(value)
    except ArithmeticError as error:
        what = "in the range of doubles" if isinstance(error, OverflowError) else "told from zero"
        raise IntegratorError(f"numbers must be {what}, but one was {shorten(str(value))}") from None


def stable_form(formula: sympy.Expr, argument: str) -> sympy.Expr:
    """The form of a formula that is parsed from its own text: q/(3*x + 3), but not (q/3)/(x + 1)."""
    if formula.is_Rational or formula.is_Symbol:
        return formula
    from integrators.scenes.model.black_boxes import Entry

    if formula.has(Entry):  # a compiled function has no text
        return formula
    try:
        return _stable_form(formula)
    except IntegratorError as error:
        raise IntegratorError(str(error).replace(FORMULA, argument, 1)) from None


@lru_cache(maxsize=2000)
def _stable_form(formula: sympy.Expr) -> sympy.Expr:
    import sympy

    names = {str(symbol) for symbol in formula.free_symbols}
    for _ in range(MAX_FORMS):
        # Term by term, because the text of a long sum may exceed the parser's limit.
        form = sympy.Add(*(_parse(formula_text(term), names, FORMULA) for term in sympy.Add.make_args(formula)))
        if form == formula:
            break
        formula = form
    return formula


def _parse(text: str, names: Collection[str], argument: str) -> sympy.Expr:
    """The expression of a text; the parser receives only the names in it, out of up to a million."""
    used = words(text)
    for word in used:
        if word not in names and word not in KNOWN and word.lower() not in NOT_FINITE:
            _refuse_name(word, text, names, argument)
    return parse_expression(text, names=[word for word in used if word in names], argument=argument)


def _refuse_name(name: str, text: str, names: Collection[str], argument: str) -> NoReturn:
    if re.search(rf"\b{re.escape(name)}\s*\(", text):
        functions = ", ".join((*FUNCTIONS, *ROOTS))
        raise IntegratorError(f"{argument} must have functions of {functions} only, but has {shorten(name)!r}")
    known = ", ".join(islice(names, 20))
    what = f"a formula in {shorten(known)}" if known else "a number"
    raise IntegratorError(f"{argument} must be {what}, but has the unknown name {shorten(name)!r}")


def _rational(value: Any, argument: str) -> exact.Exact | None:
    """A Python number as a fraction; None for other values."""
    if isinstance(value, float):
        if not isfinite(value):
            raise IntegratorError(f"{argument} must be finite, but was {float(value)!r}")
        return Fraction(*Decimal(float.__repr__(value)).as_integer_ratio())
    moderate = isinstance(value, Decimal) and value.is_finite() and abs(value.adjusted()) < exact.MAX_DIGITS
    if isinstance(value, bool) or not (isinstance(value, int | Fraction) or moderate):
        return None
    try:
        return exact.bounded(Fraction(*value.as_integer_ratio()))
    except ArithmeticError as error:
        raise IntegratorError(f"{argument} must be of reasonable size, but {error}") from None


def _plain(value: sympy.Expr, names: Collection[str], argument: str) -> sympy.Expr:
    """The expression with plain symbols and rational numbers."""
    import sympy

    for symbol in cast("set[sympy.Symbol]", value.free_symbols):
        if not isinstance(symbol, sympy.Symbol) or not symbol.is_commutative:
            raise IntegratorError(f"{argument} must be a formula in plain symbols, but has {shorten(str(symbol))!r}")
        if symbol.name not in names:
            _refuse_name(symbol.name, "", names, argument)
    if value.has(sympy.I):
        raise IntegratorError(f"{argument} must be real, but was {shorten(str(value))}")
    floats = {number: sympy.Rational(_fraction_of(number)) for number in value.atoms(sympy.Float)}
    if value.has(sympy.Abs, sympy.sign, sympy.Heaviside, sympy.Max, sympy.Min, sympy.Piecewise):
        from integrators.exact.branches import from_sympy

        value = from_sympy(value)
    plain = {symbol: sympy.Symbol(symbol.name) for symbol in cast("set[sympy.Symbol]", value.free_symbols)}
    return cast("sympy.Expr", value.xreplace({**floats, **plain}))


def _fraction_of(number: sympy.Float) -> Fraction:
    """The decimal that a SymPy float prints as: shortest form of a double, all digits of other precisions."""
    import sympy

    double = float(number)
    same = isfinite(double) and sympy.Rational(double) == sympy.Rational(number)
    return Fraction(repr(double) if same else str(number))
