"""Whether two formulas are equal as functions, and how they differ.

Different functions differ at random points, where 50 digits are compared. Functions that agree at all of them are
compared exactly, by normal forms in a differential ring. If these do not decide, the agreement at the points counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from random import Random
from typing import Any

import mpmath
import sympy

from bseries.exceptions import SeriesError
from bseries.fields.differential_rings import DifferentialRing

DIGITS, AGREEING = 80, 50
"""Digits of values at a point, and how many of them must agree."""
POINTS, TRIED = 20, 400
"""Number of points at which formulas are compared, and of trials to find points where the second formula is real."""
SPREAD = 10**9 + 7
"""Coordinates are multiples of 1/SPREAD between −2 and 2."""
LARGEST = 1000
"""Largest decimal exponent of a value; mpmath still computes the exponential of such a value quickly."""
MOST_MONOMIALS = 2_000
"""Largest number of monomials in a normal form; answers have fewer."""
MOST_DENOMINATOR = 1_000
"""Largest denominator of a factor that a remark states."""
POWERS = (0, 1, 2, -1, -2)
"""Powers of h in such a factor."""
SMALL_STEP = 4
"""The power of h in a difference is measured from its values at h = 10^(−SMALL_STEP) and at half of that."""

FUNCTIONS = {"Pi": "pi", "Exp1": "e"}
"""Names in mpmath of SymPy's functions and constants, where they differ."""

EXACTLY = "equal exactly"
AT_POINTS = f"equal to {AGREEING} digits at {POINTS} random points"


def equality(first: sympy.Expr, second: sympy.Expr, symbols: Sequence[sympy.Symbol], *, constant: bool = False) -> str:
    """How two formulas were found equal: `EXACTLY` or `AT_POINTS`; empty if they differ.

    Points where the second formula is not real do not count. With `constant`, formulas that differ by a constant count
    as equal.

    Example:
        >>> q = sympy.Symbol("q")
        >>> equality(sympy.cos(2 * q), 1 - 2 * sympy.sin(q) ** 2, [q])
        'equal exactly'
        >>> equality(sympy.log(q**2), 2 * sympy.log(q), [q])
        'equal to 50 digits at 20 random points'
        >>> equality(sympy.sin(q), q, [q]), equality(q + 1, q, [q]), equality(q + 1, q, [q], constant=True)
        ('', '', 'equal exactly')
        >>> equality(1 + sympy.exp(-200), sympy.Integer(1), [])
        ''
    """
    samples = _at_points(first, second, symbols)
    with mpmath.workdps(DIGITS):
        shift = samples[0][1] - samples[0][2] if constant and samples else 0
        if not samples or not all(agree(x - shift, y) for _, x, y in samples):
            return ""
    try:
        ring = DifferentialRing((first, second), symbols, limit=MOST_MONOMIALS)
        difference = ring.elements[0] - ring.elements[1]
        zeros = [ring.derivative(difference, i) for i in range(len(symbols))] if constant else [difference]
        if all(map(ring.is_zero, zeros)):
            return EXACTLY
    except SeriesError:
        pass
    is_small_number = not constant and (first - second).is_zero is False  # digits cannot show this
    return "" if is_small_number else AT_POINTS


def factor_between(
    first: sympy.Expr, second: sympy.Expr, symbols: Sequence[sympy.Symbol], *, constant: bool = False
) -> str:
    """The factor c h^k by which the first formula differs from the second, as text; empty if there is none.

    c is a rational number with a small denominator, and k is one of `POWERS` if h is a symbol. With `constant`, k is 0.

    Example:
        >>> h, p = sympy.symbols("h p")
        >>> factor_between(-h * p / 2, p, [p, h]), factor_between(p + 1, p, [p, h])
        ('-1/2*h', '')
    """
    samples = _at_points(first, second, symbols)
    x0, y0 = samples[0][1:] if constant and samples else (0, 0)
    if not samples or any(y == y0 for _, _, y in samples[1:]):
        return ""
    h = None if constant else next((symbol for symbol in symbols if symbol.name == "h"), None)
    with mpmath.workdps(DIGITS):
        for k in POWERS if h else (0,):
            ratios = [(x - x0) / (y - y0) / (point[h] ** k if h else 1) for point, x, y in samples[1:]]
            factor = Fraction(str(ratios[0])).limit_denominator(MOST_DENOMINATOR)
            exact = mpmath.mpf(factor.numerator) / factor.denominator
            if factor and agree(ratios[0], exact) and all(agree(ratio, ratios[0]) for ratio in ratios):
                power = "h" if k == 1 else f"h^{k}"
                sign = {1: "", -1: "-"}.get(factor, f"{factor}*")  # pyright: ignore[reportCallIssue, reportArgumentType]
                return f"{sign}{power}" if k else str(factor)
    return ""


def first_wrong_power(first: sympy.Expr, second: sympy.Expr, symbols: Sequence[sympy.Symbol]) -> int:
    """The lowest power of h in the difference of two formulas; 0 if there is no h, or the power is unclear.

    Example:
        >>> h, y = sympy.symbols("h y")
        >>> first_wrong_power(y**2 - h * y**3, y**2 - h * y**3 + h**2 * y**4, [y, h])
        2
    """
    h, found = next((symbol for symbol in symbols if symbol.name == "h"), None), set[int]()
    if h is None:
        return 0
    with mpmath.workdps(DIGITS):
        step = mpmath.mpf(10) ** -SMALL_STEP
        runs = [_at_points(first, second, symbols, {h: size}) for size in (step, step / 2)]
        for (_, x, y), (_, u, v) in zip(*runs, strict=False):
            one, half = abs(x - y), abs(u - v)
            found.add(round(float(mpmath.log(one / half, 2))) if one and half else 0)
    return max(found.pop(), 0) if len(found) == 1 else 0


def agreeing_digits(
    first: sympy.Expr, second: sympy.Expr, symbols: Sequence[sympy.Symbol], *, constant: bool = False
) -> int:
    """The number of significant digits of the second formula with which the first one agrees, rounded.

    Differences are measured by the largest value at random points. With `constant`, formulas may differ by a constant.

    Example:
        >>> [agreeing_digits(sympy.Rational(x), sympy.pi, []) for x in ("3.14", "3.1416", "3.15", "-3")]
        [3, 5, 2, 0]
    """
    samples = _at_points(first, second, symbols)
    x0, y0 = samples[0][1:] if constant and samples else (0, 0)
    with mpmath.workdps(DIGITS):
        size = max((abs(y - y0) for _, _, y in samples), default=0)
        error = max((abs((x - x0) - (y - y0)) for _, x, y in samples), default=0)
        if not size or not error:
            return AGREEING if samples and not error else 0
        digits = mpmath.floor(mpmath.log10(size)) + 1 - mpmath.log10(2 * error)
        return min(AGREEING, max(0, int(mpmath.floor(digits))))


def agree(first: Any, second: Any) -> bool:
    """Whether two numbers of mpmath agree to `AGREEING` digits, or to as many decimal places if both are small."""
    return abs(first - second) <= mpmath.mpf(10) ** -AGREEING * max(1, abs(first), abs(second))


def value(formula: Any, point: Mapping[Any, Any]) -> Any:
    """The value of a formula at a point, as a number of mpmath in its present precision.

    Raises:
        ArithmeticError: The value, or that of a part, is not real, not finite or too large.
    """
    if formula.is_Symbol:
        return point[formula]
    parts = [value(part, point) for part in formula.args]
    if formula.is_Rational:
        found = mpmath.mpf(int(formula.p)) / int(formula.q)
    elif formula.is_Add:
        found = mpmath.fsum(parts)
    elif formula.is_Mul:
        found = mpmath.fprod(parts)
    elif formula.is_Pow:
        found = mpmath.power(*parts)
    else:  # a function, or π or e
        found = getattr(mpmath, FUNCTIONS.get(type(formula).__name__, type(formula).__name__))
        found = found(*parts) if parts else +found
    if isinstance(found, mpmath.mpc) or not mpmath.isfinite(found) or abs(found) > mpmath.mpf(10) ** LARGEST:
        raise ArithmeticError(f"is not real, or too large, at {point}")
    return found


def _at_points(
    first: sympy.Expr, second: sympy.Expr, symbols: Sequence[sympy.Symbol], fixed: Mapping[Any, Any] | None = None
) -> list[tuple[dict[sympy.Symbol, Any], Any, Any]]:
    """Random points where the second formula is real, with both values; none if the first is not real at one of them.

    The symbols in `fixed` have given values.
    """
    random, found = Random(1), []
    with mpmath.workdps(DIGITS):
        for _ in range(TRIED):
            drawn = {symbol: mpmath.mpf(random.randint(-2 * SPREAD, 2 * SPREAD)) / SPREAD for symbol in symbols}
            point = {**drawn, **(fixed or {})}
            wanted = _real(second, point)
            if wanted is None:
                continue
            given = _real(first, point)
            if given is None:
                return []
            found.append((point, given, wanted))
            if len(found) == POINTS:
                return found
    raise SeriesError(f"formula must be real at {POINTS} of {TRIED} random points, but was at {len(found)}")


def _real(formula: sympy.Expr, point: Mapping[Any, Any]) -> Any:
    """The value of a formula at a point; None if it is not real there."""
    try:
        return value(formula, point)
    except (ArithmeticError, ValueError):
        return None
