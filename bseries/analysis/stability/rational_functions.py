"""Stability functions as values: exact rational functions of z, evaluated and printed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from numbers import Rational
from typing import TYPE_CHECKING, Any, Self

from bseries.analysis.stability import sturm
from bseries.analysis.stability.field_elements import from_element, has_sign, midpoint, tells_zero, to_elements
from bseries.analysis.stability.inexact import Inexact, nearest_float
from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten
from integrators.core.immutable import ImmutableValue
from integrators.exact.entries import FLOAT_PRECISION, is_sympy, read_entry, round_entry, symbol_names
from integrators.exact.expressions import format_number

if TYPE_CHECKING:
    from integrators.exact.entries import Entry


POLE_DIGITS = 20


class StabilityFunction(ImmutableValue):
    """A rational function R(z) = P(z)/Q(z) that a method makes of y' = λy: y_1 = R(hλ) y_0.

    Numerator and denominator have no factor in common, and Q(0) = 1. Floats are kept as they are given: a factor that
    they only nearly have in common stays.

    Args:
        numerator: the coefficients of 1, z, z², …, entries such as a tableau may have.
        denominator: the same for the denominator; 1 if not given.

    Raises:
        IntegratorError: an entry is no number or formula, or the denominator vanishes at 0.

    Example:
        >>> R = StabilityFunction([1, "1/2"], [1, "-1/2"])
        >>> print(R)
        (1 + z/2)/(1 - z/2)
        >>> R(Fraction(1)), R.at_infinity, R.poles
        (Fraction(3, 1), Fraction(-1, 1), ((2+0j),))

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.3.
    """

    # numerator and denominator as elements of one field, see `bseries.analysis.stability.field_elements`
    p: sturm.Coefficients
    q: sturm.Coefficients
    floating: bool
    digits: int | None

    def __init__(self, numerator: Sequence[Any], denominator: Sequence[Any] = (1,)) -> None:
        above = [read_entry(value, f"numerator[{k}]") for k, value in enumerate(items(numerator, "numerator"))]
        below = [read_entry(value, f"denominator[{k}]") for k, value in enumerate(items(denominator, "denominator"))]
        entries = [*above, *below]
        if floating := any(isinstance(value, float) for value in entries):
            if symbol_names(entries):
                raise IntegratorError("numerator and denominator must not mix floats and symbols: write fractions")
            entries = list(map(round_entry, entries))
        elements = to_elements(entries, FLOAT_PRECISION if floating else 0)
        p, q = elements[: len(above)], elements[len(above) :]
        if not q or not q[0]:
            raise IntegratorError(f"denominator must not vanish at z = 0, but was {shorten(str(denominator))}")
        self._set(p, q, floating=floating, digits=None)

    @classmethod
    def from_elements(cls, p: Sequence[Any], q: Sequence[Any], *, floating: bool, digits: int | None) -> Self:
        """The function with these coefficients, elements of one field (see `field_elements`)."""
        function = cls.__new__(cls)
        function._set(p, q, floating=floating, digits=digits)
        return function

    def _set(self, p: Sequence[Any], q: Sequence[Any], *, floating: bool, digits: int | None) -> None:
        p, q = sturm.strip(p), sturm.strip(q)
        if p and all(map(tells_zero, (*p, *q))):
            common = sturm.monic_gcd(p, q)
            p, q = sturm.divide(p, common)[0], sturm.divide(q, common)[0]
        if q[0] != 1:
            p, q = tuple(a / q[0] for a in p), (Fraction(1), *(a / q[0] for a in q[1:]))
        self.__dict__.update(p=p, q=q, floating=floating, digits=digits)

    @cached_property
    def numerator(self) -> tuple[Entry, ...]:
        """The coefficients of 1, z, z², … in the numerator."""
        return tuple(from_element(a, floating=self.floating) for a in self.p)

    @cached_property
    def denominator(self) -> tuple[Entry, ...]:
        """The coefficients of 1, z, z², … in the denominator; the first is 1."""
        return tuple(from_element(a, floating=self.floating) for a in self.q)

    @property
    def _data(self) -> tuple[Any, ...]:
        return self.numerator, self.denominator, self.floating, self.digits

    def __reduce_ex__(self, protocol: Any) -> Any:
        """SymPy cannot pickle rational functions of symbols: they are built again."""
        if self.parameters:
            return StabilityFunction, (self.numerator, self.denominator)
        return super().__reduce_ex__(protocol)

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in the coefficients, sorted."""
        return symbol_names((*self.numerator, *self.denominator))

    @cached_property
    def has_signs(self) -> bool:
        """Whether signs are decided: no symbols, and no roots of so high a degree that this would take too long."""
        return all(map(has_sign, (*self.p, *self.q)))

    @property
    def is_inexact(self) -> bool:
        """Whether the coefficients come from decimals or floats."""
        return any(isinstance(a, Inexact) for a in (*self.p, *self.q))

    @property
    def at_infinity(self) -> Entry:
        """The limit of R(z) for z → ∞; ``inf`` where R grows without bound."""
        if len(self.p) != len(self.q):
            return math.inf if len(self.p) > len(self.q) else Fraction(0)
        return from_element(self.p[-1] / self.q[-1], floating=self.floating)

    @cached_property
    def poles(self) -> tuple[complex, ...]:
        """The poles in double precision, multiple ones repeated, by real and then imaginary part."""
        if not self.has_signs:
            raise IntegratorError(
                f"coefficients must be numbers before poles are found, but Q(z) was {shorten(polynomial_text(self.q))}"
            )
        factors = enumerate(sturm.squarefree_factors(tuple(map(midpoint, self.q))), 1)
        found = [root for times, factor in factors if len(factor) > 1 for root in _roots(factor) * times]
        return tuple(sorted(found, key=lambda root: (root.real, root.imag)))

    def __call__(self, z: Any) -> Any:
        """The value R(z).

        Args:
            z: an integer or fraction, for which the value is exact if the coefficients are; a real or complex number or
                an array of them, evaluated in double precision; or a SymPy expression.

        Returns:
            A number, an array of the shape of `z`, or a SymPy expression.

        Raises:
            IntegratorError: `z` is a pole or no number, or the coefficients have symbols and `z` is a float.
        """
        if is_sympy(z):
            above, below = (sum(a * z**k for k, a in enumerate(p)) for p in (self.numerator, self.denominator))
            return above / below
        if isinstance(z, Rational):
            x = Fraction(int(z.numerator), int(z.denominator))
            below = sturm.evaluate(self.q, x)
            if not below:
                raise IntegratorError(f"z must not be a pole, but was {shorten(str(x))}")
            return from_element(sturm.evaluate(self.p, x) / below, floating=self.floating)
        if self.parameters:
            raise IntegratorError(
                f"z must be exact while {', '.join(self.parameters)} have no values, but was {z!r:.60}"
            )
        p, q = ([_rounded(a) for a in values] or [0.0] for values in (self.numerator, self.denominator))
        return _scalar(p, q, z) if isinstance(z, float | complex) else _array(p, q, z)

    def __str__(self) -> str:
        above, below = polynomial_text(self.p), polynomial_text(self.q)
        return above if len(self.q) == 1 else f"{_bracketed(above)}/({below})"

    def __repr__(self) -> str:
        return f"StabilityFunction({shorten(str(self))})"

    def latex(self) -> str:
        """The function as LaTeX.

        Example:
            >>> print(StabilityFunction([1], [1, -1, "1/2"]).latex())
            \\frac{1}{1 - z + \\frac{1}{2} z^{2}}
        """
        above, below = (polynomial_text(values, latex=True) for values in (self.p, self.q))
        return above if len(self.q) == 1 else f"\\frac{{{above}}}{{{below}}}"

    def _repr_latex_(self) -> str:
        return f"${self.latex()}$"


def _rounded(value: Any) -> float:
    return round_entry(value) if is_sympy(value) else nearest_float(value)


def _bracketed(text: str) -> str:
    return f"({text})" if " " in text else text


def _roots(factor: sturm.Coefficients) -> list[complex]:
    """The roots of a square-free polynomial, none of them 0, by Durand and Kerner's iteration.

    It starts near the unit circle, so the variable is first divided by the roots' geometric mean.
    """
    import mpmath

    ratio = factor[0] / factor[-1]
    size = abs(nearest_float(ratio) if isinstance(ratio, Fraction) else float(ratio)) ** (1 / (len(factor) - 1))
    mean = Fraction(size) if 0 < size < math.inf else Fraction(1)
    digits = POLE_DIGITS
    while True:
        with mpmath.workdps(digits):
            numbers = [a if isinstance(a, Fraction) else a.approximate(2 * digits) for a in factor]
            scaled = [a * mean**k for k, a in enumerate(numbers)]
            coefficients = [mpmath.mpf(a.numerator) / a.denominator for a in reversed(scaled)]
            try:
                found = mpmath.polyroots(coefficients, maxsteps=10 * digits, extraprec=5 * digits)
            except mpmath.mp.NoConvergence:
                digits *= 2
            else:
                return [complex(root * mpmath.mpf(float(mean))) for root in found]


def _scalar(p: Sequence[float], q: Sequence[float], z: Any) -> Any:
    """The value at a number; far from 0 in powers of 1/z, which cannot overflow."""
    try:
        if abs(z) <= 1:
            return sturm.evaluate(p, z) / sturm.evaluate(q, z)
        return z ** (len(p) - len(q)) * (sturm.evaluate(p[::-1], 1 / z) / sturm.evaluate(q[::-1], 1 / z))
    except OverflowError:
        return math.inf
    except ZeroDivisionError:
        raise IntegratorError(f"z must not be a pole, but was {z!r}") from None


def _array(p: Sequence[float], q: Sequence[float], z: Any) -> Any:
    """The values at an array of numbers."""
    import numpy as np

    try:
        points = np.asarray(z) * 1.0
    except (TypeError, ValueError):
        points = np.asarray(None)
    if points.dtype.kind not in "fc":
        raise IntegratorError(f"z must be a number or an array of numbers, but was {shorten(repr(z))}")
    near = abs(points) <= 1
    with np.errstate(all="ignore"):
        inverse = 1 / points
        powers = points ** float(len(p) - len(q))
        inside = sturm.evaluate(p, points) / sturm.evaluate(q, points)
        outside = powers * (sturm.evaluate(p[::-1], inverse) / sturm.evaluate(q[::-1], inverse))
    return np.where(near, inside, outside)


def polynomial_text(coefficients: Sequence[Any], *, latex: bool = False) -> str:
    """The sum of the terms that are not zero, in ascending powers of z.

    Args:
        coefficients: elements of a field (see `bseries.analysis.stability.field_elements`), ascending.
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
