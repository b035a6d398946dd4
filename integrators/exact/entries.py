"""Tableau entries: `Fraction` if rational, SymPy expression if exact but irrational, or float."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from decimal import Decimal
from fractions import Fraction
from math import floor, fsum, inf, isfinite, log10
from numbers import Rational, Real
from typing import TYPE_CHECKING, Any, SupportsFloat, TypeAlias, TypeGuard

from bseries_base.errors import shorten, shown
from bseries_base.extras import loaded_module
from integrators.core.errors import IntegratorError
from integrators.exact import arithmetic as exact
from integrators.exact.expressions import parse_number

if TYPE_CHECKING:
    import sympy

Entry: TypeAlias = "Fraction | float | sympy.Expr"
EntryRow: TypeAlias = tuple[Entry, ...]
Matrix: TypeAlias = tuple[EntryRow, ...]
FLOAT_PRECISION = 2.0**-50
SHORT_FLOATS = {"float32": 7, "float16": 3, "bfloat16": 2}
"""Significant digits of floats with less than double precision, by the names of their types."""
NO_SYMBOLS_AMONG_FLOATS = "coefficients must not mix floats and symbols: write the floats as fractions or as text"


def read_entry(value: object, argument: str, names: Iterable[str] = ()) -> Entry:
    """Read one entry of a tableau, exactly."""
    if isinstance(value, str | Decimal):
        return parse_number(str(value), names=names, argument=argument)
    if is_sympy(value):
        return _from_sympy(value, argument)
    if isinstance(value, Rational) and not isinstance(value, bool):
        try:
            return exact.bounded(Fraction(int(value.numerator), int(value.denominator)))
        except ArithmeticError as error:
            raise IntegratorError(f"{argument} must be of reasonable size, but {error}") from None
    if isinstance(value, Real) and not isinstance(value, bool):
        number = float(value)
        if not isfinite(number):
            raise IntegratorError(f"{argument} must be a finite number, but was {value}")
        if number != value:
            raise IntegratorError(f"{argument} must fit in a double or be text, but was {shown(value)}")
        return number
    raise IntegratorError(f"{argument} must be a real number or a formula, but was {shown(value)}")


def is_sympy(value: object) -> TypeGuard[sympy.Expr]:
    """Whether a value is a SymPy object; does not import SymPy."""
    sympy = loaded_module("sympy")
    return sympy is not None and isinstance(value, sympy.Basic)


def _from_sympy(value: sympy.Expr, argument: str) -> Entry:
    """Read a SymPy expression through its text, so that one grammar applies and one form is stored."""
    import sympy

    if value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
        raise IntegratorError(f"{argument} must be a finite number, but was {shorten(str(value))}")
    if value.is_number and value.is_real is False:
        raise IntegratorError(f"{argument} must be real, but was {shorten(str(value))}")
    if value.has(sympy.Float):
        if value.free_symbols:
            raise IntegratorError(
                f"{argument} must not mix floats and symbols, but was {shorten(str(value))}: write fractions"
            )
        if isinstance(value, sympy.Float) and sympy.Rational(value) != sympy.Rational(float(value)):
            raise IntegratorError(f"{argument} must fit in a double or be text, but was {shorten(str(value))}")
        return round_entry(value)
    names = sorted(str(symbol) for symbol in value.free_symbols)
    return parse_number(str(value), names=names, argument=argument)


def round_entry(value: SupportsFloat) -> float:
    """The nearest double to a number."""
    try:
        number = float(value.evalf(30)) if is_sympy(value) else float(value)
    except OverflowError:
        number = inf
    if not isfinite(number):
        raise IntegratorError(
            f"numbers must be in the range of doubles to be rounded, but one was {shorten(str(value))}"
        )
    return number


def sum_entries(values: Iterable[Entry]) -> Entry:
    """The sum of entries of one method: exact, or correctly rounded for floats."""
    terms = list(values)
    if any(isinstance(value, float) for value in terms):
        _refuse_symbols_among_floats(terms)
        try:
            return fsum(terms)
        except OverflowError:
            raise IntegratorError(
                f"sums of entries must be finite, but that of {shorten(str(terms))} was not"
            ) from None
    if not any(map(is_sympy, terms)):
        return sum(terms, Fraction(0))
    import sympy

    return exact.simplest(sympy.expand(sympy.Add(*map(exact.in_sympy, terms))))


def multiply_entries(x: Entry, y: Entry) -> Entry:
    """The product of two entries, in a normal form."""
    if not (is_sympy(x) or is_sympy(y)):
        return x * y
    if isinstance(x, float) or isinstance(y, float):
        _refuse_symbols_among_floats((x, y))
        return round_entry(x) * round_entry(y)
    import sympy

    if x == 0 or y == 0:
        return Fraction(0)
    number, other = (x, y) if isinstance(x, Fraction) else (y, x)
    if number == 1 and exact.in_sympy(other).has(sympy.CRootOf):  # already in normal form; expanding roots is slow
        return other
    return exact.simplest(sympy.expand(exact.in_sympy(x) * exact.in_sympy(y)))


def divide_entries(x: Entry, y: Entry) -> Entry:
    """The quotient of two entries, in a normal form with roots in the numerator only."""
    if not (is_sympy(x) or is_sympy(y)):
        return x / y
    import sympy

    return exact.simplest(sympy.radsimp(sympy.cancel(exact.in_sympy(x) / exact.in_sympy(y))))


def flat_entries(value: Any) -> list[Any]:
    """The entries of rows and matrices, nested tuples."""
    return [x for part in value for x in flat_entries(part)] if isinstance(value, tuple) else [value]


def _refuse_symbols_among_floats(values: Iterable[Entry]) -> None:
    if symbol_names(values):
        raise IntegratorError(NO_SYMBOLS_AMONG_FLOATS)


def cancels(terms: Sequence[Entry], precision: Fraction | float) -> bool | None:
    """Whether terms sum to zero: exactly, or within the error of inexact entries."""
    if precision:
        return abs(sum(terms)) <= precision * sum(map(abs, terms))
    if not any(map(is_sympy, terms)):
        return sum(terms) == 0
    import sympy

    total = sympy.expand(sympy.Add(*map(exact.in_sympy, terms)))
    if isinstance(total, sympy.Rational):
        return total == 0
    return False if _differs_from_zero(total) else total.equals(0)


def _differs_from_zero(formula: sympy.Expr) -> bool:
    """Whether a formula is not zero at a sample point, a quick test before SymPy's slow proof."""
    import sympy

    symbols = sorted(formula.free_symbols, key=str)
    value = formula.subs({symbol: sympy.Rational(7919 + k, 6007) for k, symbol in enumerate(symbols)}).evalf(30)
    return bool(value.is_number and value.is_finite and abs(value) > 1e-20)


def certainly_differs(x: Entry, number: int, precision: Fraction | float) -> bool:
    """Whether an entry differs from a number; formulas that agree with it to 20 digits count as equal."""
    return _differs_from_zero(x - number) if is_sympy(x) else cancels((x, -number), precision) is False


def relative_error(domain: str, digits: int | None) -> Fraction | float:
    """The relative error of entries: 0 if exact, else that of the published digits or of doubles."""
    published = Fraction(0) if digits is None else Fraction(10, 10**digits)
    return max(published, FLOAT_PRECISION) if domain == "float" else published


def digits_of(*values: object) -> int | None:
    """The fewest digits of floats with less than double precision in arrays and lists; None if there are none."""
    found = []
    for value in values:
        if isinstance(value, list | tuple):
            found.append(digits_of(*value))
        else:
            found.append(SHORT_FLOATS.get(str(getattr(value, "dtype", "")).removeprefix("torch.")))
    return min(filter(None, found), default=None)


def nearest_decimal(x: SupportsFloat) -> Fraction:
    """The shortest decimal that rounds to the same double."""
    return Fraction(repr(round_entry(x)))


def half_unit(x: Any, digits: int) -> Fraction:
    """Half a unit of the last of the significant digits of a fraction; 0 for zero, which is exact.

    Example:
        >>> str(half_unit(Fraction("0.0123"), 3)), str(half_unit(Fraction(7), 2))
        ('1/20000', '1/20')
    """
    if not x:
        return Fraction(0)
    # That of the first digit; the estimate is at most one too large or one too small.
    exponent = floor((x.numerator.bit_length() - x.denominator.bit_length()) * log10(2))
    exponent += (abs(x) >= Fraction(10) ** (exponent + 1)) - (abs(x) < Fraction(10) ** exponent)
    return 5 * Fraction(10) ** (exponent - digits)


def find_domain(values: Iterable[Entry]) -> str:
    """The smallest of the domains QQ, algebraic, symbolic and float that contains all entries."""
    values = list(values)
    formulas = [value for value in values if is_sympy(value)]
    if any(isinstance(value, float) for value in values):
        return "float"
    if any(value.free_symbols for value in formulas):  # type: ignore[union-attr]
        return "symbolic"
    return "algebraic" if formulas else "QQ"


def symbol_names(values: Iterable[Entry]) -> tuple[str, ...]:
    """The names of the symbols in the entries, sorted."""
    return tuple(sorted({str(symbol) for value in values if is_sympy(value) for symbol in value.free_symbols}))  # type: ignore[union-attr]
