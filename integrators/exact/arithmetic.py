"""Arithmetic on exact numbers and formulas of limited size: `Fraction`s if rational, else SymPy expressions.

Operations refuse their arguments by an `ArithmeticError` with the predicate of a sentence, such as "divides by zero".
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from math import comb, lcm, prod
from typing import TYPE_CHECKING, Any, TypeAlias, cast

if TYPE_CHECKING:
    import sympy

Exact: TypeAlias = "Fraction | sympy.Expr"

MAX_DIGITS = 4000
"""Largest number of digits, below Python's limit of 4300 for conversion to and from text."""
MAX_BITS = MAX_DIGITS * 3322 // 1000
MAX_ROOT = 100
MAX_EXPONENT = 100
"""Largest exponent in a formula, since powers may have to be expanded; powers of rationals are limited by digits."""
MAX_RADICAND_BITS = 400
"""SymPy factors radicands, which is slow beyond some hundreds of digits."""
MAX_ARGUMENT = 10_000
LARGEST_NUMBER = 10**1000
"""Largest number whose power, exponential or sine is formed where numbers are put for symbols, or computed in many
digits: beyond it these take longer and longer, and then all memory, as sin(exp(exp(30))) does."""
HYPERBOLIC = {"sinh", "cosh", "tanh"}
MOST_PARTS = 2_000
"""Largest number of terms, times the degree, of a power with real and imaginary parts in a hyperbolic function."""
MAX_NESTING = 6
"""Largest nesting depth of powers and functions, since SymPy takes exponential time to determine signs."""
MOST_DEGREE = 16
"""Largest degree of a field of algebraic numbers; SymPy takes half a minute to build one of degree 32."""
FLOATS = f"the tableau holds floats, or roots within roots of a degree above {MOST_DEGREE}"
"""Why results may be floats."""
LARGEST_ORDER = 10_000
"""Largest order n of roots of unity whose φ(n) is computed: n with many digits are hard to factor, and for larger n
φ(n) exceeds 2 · `MOST_DEGREE` anyway."""


def simplest(value: Any) -> Any:
    """A rational number of SymPy as a `Fraction`; anything else unchanged."""
    return Fraction(int(value.p), int(value.q)) if getattr(value, "is_Rational", False) else value


def in_sympy(value: object) -> sympy.Expr:
    """A number or a formula as an expression of SymPy; text is refused."""
    import sympy

    return cast("sympy.Expr", sympy.sympify(value, strict=True))


def renamed(formula: sympy.Expr, names: Mapping[Any, sympy.Basic]) -> sympy.Expr:
    """A formula with others in place of symbols."""
    return cast("sympy.Expr", formula.xreplace(names))


def bounded(value: Exact) -> Exact:
    """The value, checked to be finite, real and of limited size; SymPy rationals become `Fraction`s."""
    if isinstance(value, Fraction):
        if _bits(value) > MAX_BITS:
            raise ArithmeticError(f"has a number of more than {MAX_DIGITS} digits")
        return value
    import sympy

    if isinstance(value, sympy.Rational):
        return bounded(simplest(value))
    if value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
        raise ArithmeticError("is not finite")
    if _bits(value) > MAX_BITS:
        raise ArithmeticError(f"has a number of more than {MAX_DIGITS} digits")
    exponents = [power.exp for power in value.atoms(sympy.Pow) if isinstance(power.exp, sympy.Rational)]
    if any(abs(exponent) > MAX_EXPONENT or exponent.q > MAX_ROOT for exponent in exponents):
        raise ArithmeticError(f"has an exponent beyond {MAX_EXPONENT} or a root beyond the {MAX_ROOT}th")
    if _nesting(value) > MAX_NESTING:
        raise ArithmeticError(f"has more than {MAX_NESTING} roots, powers or functions within each other")
    if value.is_number and value.is_real is False:
        raise ArithmeticError("is not real")
    return value


def _bits(value: Exact) -> int:
    """The bit length of the largest integer in a value."""
    if isinstance(value, Fraction):
        return max(value.numerator.bit_length(), value.denominator.bit_length())
    import sympy

    return max((max(int(a.p).bit_length(), int(a.q).bit_length()) for a in value.atoms(sympy.Rational)), default=1)


def _nesting(value: sympy.Basic) -> int:
    """The nesting depth of powers and functions of formulas, in bases and exponents."""
    inner = max(map(_nesting, value.args), default=0)
    applied = (value.is_Pow or value.is_Function) and any(argument.args for argument in value.args)
    return inner + 1 if applied else inner


def add(terms: Sequence[Exact]) -> Exact:
    """The sum of one or more terms."""
    return _combined(terms, operator.add, "Add")


def multiply(factors: Sequence[Exact]) -> Exact:
    """The product of one or more factors."""
    return _combined(factors, operator.mul, "Mul")


def _combined(values: Sequence[Exact], operation: Callable[[Fraction, Fraction], Fraction], name: str) -> Exact:
    """A sum or product; SymPy forms it in one operation, since its products depend on the grouping of factors."""
    total = values[0]
    for value in values[1:]:
        if not (isinstance(total, Fraction) and isinstance(value, Fraction)):
            import sympy

            return bounded(getattr(sympy, name)(*values))
        total = bounded(operation(total, value))
    return total


def invert(value: Exact) -> Exact:
    """The inverse 1 / value."""
    if isinstance(value, Fraction):
        if value == 0:
            raise ArithmeticError("divides by zero")
        return 1 / value
    if value.is_number and value.is_zero is not False:
        raise ArithmeticError("divides by a number that cannot be told from zero")
    return bounded(1 / value)


def power(base: Exact, exponent: Exact) -> Exact:
    """The power base^exponent for a rational exponent, without roots of negative numbers."""
    if not isinstance(exponent, Fraction):
        raise ArithmeticError("has an exponent that is not rational")
    if exponent < 0:
        base, exponent = invert(base), -exponent
    if exponent.denominator > 1:
        return _fractional_power(base, exponent)
    times = exponent.numerator
    if times * (_bits(base) - 1) > MAX_BITS:
        raise ArithmeticError(f"has a power of more than {MAX_DIGITS} digits")
    return bounded(base**times)


def _fractional_power(base: Exact, exponent: Fraction) -> Exact:
    if _sign(base) < 0:
        raise ArithmeticError("has a fractional power of a negative number (an odd root is written root(x, n))")
    if isinstance(base, Fraction):
        numerator, denominator = (_integer_root(part, exponent.denominator) for part in base.as_integer_ratio())
        if numerator is not None and denominator is not None:
            return power(Fraction(numerator, denominator), Fraction(exponent.numerator))
    if exponent * (_bits(base) - 1) > MAX_BITS:
        raise ArithmeticError(f"has a power of more than {MAX_DIGITS} digits")
    if _bits(base) > MAX_RADICAND_BITS:
        raise ArithmeticError(f"has a root of a number of more than {MAX_RADICAND_BITS} bits")
    return bounded(in_sympy(base) ** in_sympy(exponent))


def root(value: Exact, degree: Exact) -> Exact:
    """The real root of a degree; odd roots of negative numbers are negative."""
    if not isinstance(degree, Fraction) or degree.denominator > 1 or not 2 <= degree <= MAX_ROOT:
        raise ArithmeticError(f"has a root whose degree is not an integer from 2 to {MAX_ROOT}")
    if _sign(value) < 0:
        if degree % 2 == 0:
            raise ArithmeticError("has an even root of a negative number")
        return multiply([Fraction(-1), root(multiply([Fraction(-1), value]), degree)])
    return _fractional_power(value, 1 / degree)


def _sign(value: Exact) -> int:
    """The sign of a number; 1 for a formula with symbols."""
    if isinstance(value, Fraction):
        return (value > 0) - (value < 0)
    if not value.is_number:
        return 1
    if value.is_negative is None:
        raise ArithmeticError("has a root of a number whose sign cannot be decided")
    return -1 if value.is_negative else 1


def _integer_root(value: int, degree: int) -> int | None:
    """The root of a natural number; None if it is irrational."""
    import flint

    found = int(flint.fmpz(value).root(degree))
    return found if found**degree == value else None


def transcendental_power(base: Exact, exponent: sympy.Expr) -> Exact:
    """The power base^exponent of a positive base, where the exponent is a formula."""
    if _sign(base) <= 0:
        raise ArithmeticError("has a formula as exponent of a number that is not positive")
    return bounded(in_sympy(base) ** _limited_argument(exponent))


def apply(name: str, argument: Exact) -> Exact:
    """The elementary function with this name, applied to an argument."""
    import sympy

    x = _limited_argument(in_sympy(argument))
    if name in HYPERBOLIC and any(map(_expands_widely, x.atoms(sympy.Pow))):
        raise ArithmeticError(f"has a power that is too large within {name}")
    inverses = sympy.asin, sympy.acos, sympy.atan, sympy.asinh, sympy.acosh, sympy.atanh
    if x.has(*inverses) and _bits(x) > MAX_RADICAND_BITS // 2:  # SymPy writes sin(atan(x)) with √(1 + x²)
        raise ArithmeticError(f"has a root of a number of more than {MAX_RADICAND_BITS} bits")
    return bounded(getattr(sympy, name)(x))


def _expands_widely(power: sympy.Pow) -> bool:
    """Whether a power is too large for SymPy, which expands imaginary parts to find out whether cosh(x) is real."""
    if not power.exp.is_Rational or not power.free_symbols:
        return False
    degree, others = int(abs(power.exp)), 2 * len(power.base.as_ordered_terms()) - 1
    return comb(degree + others, others) * degree > MOST_PARTS


def _limited_argument(argument: sympy.Expr) -> sympy.Expr:
    """The argument of a function; a number is refused if its exponential would be too large."""
    if argument.is_number and not abs(argument.evalf(5)) < MAX_ARGUMENT:
        raise ArithmeticError(f"has a function of a number beyond {MAX_ARGUMENT}")
    return argument


def substituted(formula: sympy.Expr, numbers: Mapping[Any, sympy.Expr]) -> sympy.Expr:
    """A formula with numbers for some symbols; powers and functions are refused before SymPy computes huge ones.

    As in `root`, odd roots of negative numbers are negative.
    """
    if formula in numbers:
        return numbers[formula]
    if formula.free_symbols.isdisjoint(numbers):
        return formula
    parts = [substituted(cast("sympy.Expr", part), numbers) for part in formula.args]
    if (formula.is_Pow or formula.is_Function) and all(part.is_number for part in parts):
        if not all(abs(part.evalf(5)) <= LARGEST_NUMBER for part in parts[formula.is_Pow :]):
            raise ArithmeticError("has a power or function of a number beyond 10^1000")
        if formula.is_Pow:
            return _number_power(*parts)
    return cast("sympy.Expr", formula.func(*parts))


def _number_power(base: sympy.Expr, exponent: Any) -> sympy.Expr:
    if base.is_Rational and exponent.is_Integer and abs(exponent) * (_bits(base) - 1) > MAX_BITS:
        raise ArithmeticError(f"has a power of more than {MAX_DIGITS} digits")
    if exponent.is_Rational and not exponent.is_Integer and _bits(base) > MAX_RADICAND_BITS:
        raise ArithmeticError(f"has a root of a number of more than {MAX_RADICAND_BITS} bits")
    if exponent.is_Rational and exponent.q > 1 and exponent.q % 2 and base.is_negative:
        return (-1) ** exponent.p * (-base) ** exponent
    return base**exponent


def algebraic(value: Exact) -> Exact:
    """The value, refused unless its numbers are algebraic: cosines, sines and tangents of rational multiples of pi."""
    if isinstance(value, Fraction):
        return value
    import sympy

    cosines = _cosines([value])
    if not all((cosine.args[0] / sympy.pi).is_Rational for cosine in cosines):
        raise ArithmeticError("has a cosine, sine or tangent of something else than a rational multiple of pi")
    rest = value.xreplace({cosine: sympy.Dummy(positive=True) for cosine in cosines})
    if rest.has(sympy.pi):
        raise ArithmeticError("has pi outside a cosine, sine or tangent")
    if not all(power.exp.is_Rational for power in rest.atoms(sympy.Pow)):
        raise ArithmeticError("has an exponent that is not rational")
    if _cosine_degree(cosines) > MOST_DEGREE:
        raise ArithmeticError(f"has cosines, sines or tangents of a degree above {MOST_DEGREE} over the rationals")
    return value


def degree_bound(values: Iterable[sympy.Expr]) -> int:
    """A bound on the degree of the smallest field that holds the roots, cosines, sines and tangents in some formulas.

    Example:
        >>> import sympy
        >>> degree_bound([sympy.sqrt(2) + sympy.sqrt(3), sympy.cos(sympy.pi / 18)])
        24
    """
    import sympy

    formulas = list(values)
    powers: set[sympy.Pow] = set().union(*(formula.atoms(sympy.Pow) for formula in formulas))
    roots: dict[sympy.Expr, int] = {}  # x^(1/2) and x^(-1/3) are powers of one root
    for power in powers:
        if power.is_number and isinstance(power.exp, sympy.Rational):
            roots[power.base] = lcm(roots.get(power.base, 1), int(power.exp.q))
    others: set[sympy.CRootOf] = set().union(*(formula.atoms(sympy.CRootOf) for formula in formulas))
    return prod((*roots.values(), *(x.poly.degree() for x in others))) * _cosine_degree(_cosines(formulas))


def _cosines(formulas: Iterable[sympy.Expr]) -> set[sympy.Basic]:
    import sympy

    return set().union(*(formula.atoms(sympy.cos, sympy.sin, sympy.tan) for formula in formulas))


def _cosine_degree(cosines: Iterable[sympy.Basic]) -> int:
    """The degree of the field of cos 2π/n, φ(n)/2, for the least n whose field has all values; n/2 for large n.

    Cosines of other arguments than rational multiples of π are not algebraic, and count as symbols do.
    """
    import sympy

    n = 1
    for cosine in cosines:
        ratio = cosine.args[0] / (2 * sympy.pi)
        if not ratio.is_Rational:
            continue
        if not isinstance(cosine, sympy.sin):
            n = lcm(n, int(ratio.q))
        if not isinstance(cosine, sympy.cos):  # sin x = cos(π/2 − x)
            n = lcm(n, int((sympy.Rational(1, 4) - ratio).q))
    return max(1, int(n if n > LARGEST_ORDER else sympy.totient(n)) // 2)
