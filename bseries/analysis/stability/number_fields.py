"""Real algebraic numbers with exact arithmetic and exact signs: elements of a number field Q(θ), θ real."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import prod
from typing import TYPE_CHECKING, Any

from integrators.exact import polynomials
from integrators.exact.polynomials import Polynomial

if TYPE_CHECKING:
    import sympy

MOST_DEGREE = 16
"""Fields of higher degree take SymPy too long to build."""


class NumberField:
    """The field Q(θ) of a real root θ of an irreducible polynomial.

    Args:
        modulus: the minimal polynomial of θ, monic.
        generator: θ as a SymPy number.
    """

    def __init__(self, modulus: Polynomial, generator: sympy.Expr) -> None:
        self.modulus = modulus
        self.generator = generator
        self._digits = 0
        self._near = Fraction(0)

    def locate(self, digits: int) -> Fraction:
        """A number within 10^-digits of θ, proved by a change of sign of the minimal polynomial."""
        working = digits + 10
        while self._digits < digits:
            near = Fraction(str(self.generator.evalf(working)))
            error = Fraction(1, 10**digits)
            if polynomials.evaluate(self.modulus, near - error) * polynomials.evaluate(self.modulus, near + error) < 0:
                self._digits, self._near = digits, near
            working *= 2
        return self._near


class RealAlgebraic:
    """An element of a number field: a polynomial in θ. Arithmetic is exact, and so are comparisons with rationals."""

    __slots__ = ("coefficients", "field")

    def __init__(self, field: NumberField, coefficients: Polynomial) -> None:
        self.field = field
        self.coefficients = coefficients

    def _lift(self, other: Any) -> Polynomial:
        return other.coefficients if isinstance(other, RealAlgebraic) else polynomials.trim([other])

    def __bool__(self) -> bool:
        return bool(self.coefficients)

    def __add__(self, other: Any) -> RealAlgebraic:
        return RealAlgebraic(self.field, polynomials.add(self.coefficients, self._lift(other)))

    __radd__ = __add__

    def __neg__(self) -> RealAlgebraic:
        return RealAlgebraic(self.field, polynomials.scale(self.coefficients, -1))

    def __sub__(self, other: Any) -> RealAlgebraic:
        return self + -other

    def __rsub__(self, other: Any) -> RealAlgebraic:
        return -self + other

    def __mul__(self, other: Any) -> RealAlgebraic:
        product = polynomials.multiply(self.coefficients, self._lift(other))
        return RealAlgebraic(self.field, polynomials.remainder(product, self.field.modulus))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> RealAlgebraic:
        return self * RealAlgebraic(self.field, polynomials.invert(self._lift(other), self.field.modulus))

    def __rtruediv__(self, other: Any) -> RealAlgebraic:
        return RealAlgebraic(self.field, self._lift(other)) / self

    def __lt__(self, other: Any) -> bool:
        return (self - other).sign < 0

    def __gt__(self, other: Any) -> bool:
        return (self - other).sign > 0

    @property
    def sign(self) -> int:
        """The sign, by an enclosure narrow enough to exclude zero: it exists, since zero has no coefficients."""
        if not self:
            return 0
        digits = 20
        while True:
            value, error = self._enclose(digits)
            if abs(value) > error:
                return 1 if value > 0 else -1
            digits *= 2

    def _enclose(self, digits: int) -> tuple[Fraction, Fraction]:
        """A rational number and how far it may be from this one, given θ within 10^-digits."""
        near = self.field.locate(digits)
        # |θ^k − x^k| ≤ k (|x| + 1)^(k−1) |θ − x|
        slope = sum(
            (abs(a) * k * (abs(near) + 1) ** (k - 1) for k, a in enumerate(self.coefficients) if k), Fraction(0)
        )
        return polynomials.evaluate(self.coefficients, near), slope / 10**digits

    def approximate(self, digits: int) -> Fraction:
        """A rational number within a relative error of 10^-digits."""
        working = digits + 10
        while True:
            value, error = self._enclose(working)
            if error * 10**digits <= abs(value) or not self:
                return value
            working *= 2

    def __float__(self) -> float:
        return float(self.approximate(25))

    def to_sympy(self) -> sympy.Expr:
        """The number as a SymPy expression."""
        import sympy

        theta = self.field.generator
        terms = [sympy.Rational(a.numerator, a.denominator) * theta**k for k, a in enumerate(self.coefficients)]
        return sympy.expand(sympy.Add(*terms))


def to_number_field(values: Sequence[Any]) -> list[Fraction | RealAlgebraic] | None:
    """Algebraic numbers, given as `Fraction`s and SymPy numbers, as elements of one field.

    Returns:
        The elements in the order of the values, rational ones as `Fraction`s; None if the degree of the field may
        exceed `MOST_DEGREE`.

    Example:
        >>> import sympy
        >>> two, root = to_number_field([Fraction(2), sympy.sqrt(2)])
        >>> two, root * root - 2 < 0, bool(root * root - 2), 5 * root > 7
        (Fraction(2, 1), False, False, True)
    """
    import sympy

    expressions = [sympy.Rational(v.numerator, v.denominator) if isinstance(v, Fraction) else v for v in values]
    if prod(_root_degrees(expressions)) > MOST_DEGREE:
        return None
    domain: Any
    domain, elements = sympy.construct_domain(expressions, extension=True, field=True)
    if not domain.is_AlgebraicField:
        return [Fraction(int(a.numerator), int(a.denominator)) for a in elements] if domain.is_QQ else None
    descending = domain.ext.minpoly.all_coeffs()
    modulus = polynomials.trim([Fraction(int(a.p), int(a.q)) for a in reversed(descending)])
    field = NumberField(polynomials.scale(modulus, 1 / modulus[-1]), domain.ext.as_expr())
    found = (
        polynomials.trim([Fraction(int(a.numerator), int(a.denominator)) for a in reversed(element.to_list())])
        for element in elements
    )
    return [RealAlgebraic(field, p) if len(p) > 1 else sum(p, Fraction(0)) for p in found]


def _root_degrees(expressions: Sequence[sympy.Expr]) -> list[int]:
    """The degrees of the roots in these expressions, each root once."""
    import sympy

    powers: set[Any] = set().union(*(e.atoms(sympy.Pow) for e in expressions))
    roots: set[Any] = set().union(*(e.atoms(sympy.CRootOf) for e in expressions))
    return [int(p.exp.q) for p in powers if p.exp.is_Rational] + [r.poly.degree() for r in roots]
