"""Exact and approximate numbers to compute in: number fields, numbers with error bounds, formulas.

Entries of tableaux become elements of one of four kinds, all of them false where zero: `Fraction`; `RealAlgebraic` for
roots; `Inexact` for decimals and floats; SymPy's field elements for formulas with symbols, and for roots of high
degree. All but the last have signs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Context, Decimal
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from integrators.exact import polynomials
from integrators.exact.polynomials import Polynomial

if TYPE_CHECKING:
    import sympy

    from integrators.exact.entries import Entry
    from integrators.methods.tableaux.runge_kutta import RungeKutta

GUARD = 20
"""Guard bits: values are rounded to this many bits below the error, which keeps them short."""
SLACK = 1 + 2.0 ** (1 - GUARD)
"""Factor on the error bound of every operation; it covers the rounding errors of the operation itself."""
EXACT_DIGITS = 30
"""Digits printed of a number without error."""

MOST_DEGREE = 16
"""Fields of higher degree take SymPy too long to build."""


def nearest_float(value: Fraction | int) -> float:
    """The nearest float; infinite beyond the range of floats."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


class Inexact:
    """A number with an error bound; it counts as zero where the bound reaches its absolute value.

    Integers and `Fraction`s in mixed operations are exact.

    Example:
        >>> third = Inexact(Fraction("0.333"), 1e-3)
        >>> bool(third * 3 - 1), bool(third * 2 - 1)
        (False, True)
    """

    __slots__ = ("error", "value")

    def __init__(self, value: Fraction, error: float) -> None:
        places = GUARD - math.frexp(error)[1] if error else 0
        self.value = Fraction(round(value * 2**places), 2**places) if places > 0 else value
        self.error = error

    @property
    def upper(self) -> Fraction:
        """Upper end of the enclosure; zero if the number counts as zero."""
        return self.value + Fraction(self.error) if self else Fraction(0)

    def __bool__(self) -> bool:
        return abs(self.value) > self.error

    def __add__(self, other: Any) -> Inexact:
        if isinstance(other, Inexact):
            return Inexact(self.value + other.value, (self.error + other.error) * SLACK)
        return Inexact(self.value + other, self.error * SLACK)

    __radd__ = __add__

    def __neg__(self) -> Inexact:
        return Inexact(-self.value, self.error)

    def __sub__(self, other: Any) -> Inexact:
        return self + -other

    def __rsub__(self, other: Any) -> Inexact:
        return -self + other

    def __mul__(self, other: Any) -> Inexact:
        if isinstance(other, Inexact):
            error = abs(nearest_float(self.value)) * other.error + abs(nearest_float(other.value)) * self.error
            return Inexact(self.value * other.value, (error + self.error * other.error) * SLACK)
        return Inexact(self.value * other, self.error * abs(nearest_float(other)) * SLACK)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Inexact:
        if not isinstance(other, Inexact):
            return self * (1 / Fraction(other))
        quotient = self.value / other.value
        least = nearest_float(abs(other.value) - Fraction(other.error))
        error = (self.error + abs(nearest_float(quotient)) * other.error) / least if least else math.inf
        return Inexact(quotient, error * SLACK)

    def __rtruediv__(self, other: Any) -> Inexact:
        return Inexact(Fraction(other), 0.0) / self

    @property
    def text(self) -> str:
        """The number to the digits that are certain."""
        if not self:
            return "0"
        digits = EXACT_DIGITS
        if self.error:
            digits = max(1, math.floor(-math.log10(self.error / abs(nearest_float(self.value)))))
        quotient = Context(prec=digits).divide(Decimal(self.value.numerator), Decimal(self.value.denominator))
        rounded = quotient.normalize()
        return f"{rounded:f}" if -4 <= rounded.adjusted() < digits else f"{rounded:e}"


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
        """A rational number within 10^-digits of θ, certified by a sign change of the minimal polynomial."""
        working = digits + 10
        while self._digits < digits:
            near = Fraction(str(self.generator.evalf(working)))
            error = Fraction(1, 10**digits)
            if polynomials.evaluate(self.modulus, near - error) * polynomials.evaluate(self.modulus, near + error) < 0:
                self._digits, self._near = digits, near
            working *= 2
        return self._near


class RealAlgebraic:
    """Element of a real number field, a polynomial in θ, with exact arithmetic and comparisons with rationals."""

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
        """The sign, from an enclosure that excludes zero; only the element without coefficients is zero."""
        if not self:
            return 0
        digits = 20
        while True:
            value, error = self._enclose(digits)
            if abs(value) > error:
                return 1 if value > 0 else -1
            digits *= 2

    def _enclose(self, digits: int) -> tuple[Fraction, Fraction]:
        """A rational approximation and its error bound, from θ within 10^-digits."""
        near = self.field.locate(digits)
        # |θ^k − x^k| ≤ k (|x| + 1)^(k−1) |θ − x|
        terms = (abs(a) * k * (abs(near) + 1) ** (k - 1) for k, a in enumerate(self.coefficients) if k)
        return polynomials.evaluate(self.coefficients, near), sum(terms, Fraction(0)) / 10**digits

    def approximate(self, digits: int) -> Fraction:
        """Rational approximation with a relative error of at most 10^-digits."""
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
    """Convert algebraic numbers, given as `Fraction`s and SymPy numbers, to elements of one field.

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

    expressions = _sympy_numbers(values)
    if math.prod(_root_degrees(expressions)) > MOST_DEGREE:
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
    """Degrees of the different roots in some expressions."""
    import sympy

    powers: set[Any] = set().union(*(e.atoms(sympy.Pow) for e in expressions))
    roots: set[Any] = set().union(*(e.atoms(sympy.CRootOf) for e in expressions))
    return [int(p.exp.q) for p in powers if p.exp.is_Rational] + [r.poly.degree() for r in roots]


def to_elements(values: Sequence[Any], precision: Fraction | float = 0) -> list[Any]:
    """Convert numbers or formulas to elements of one field; `precision` is the relative error of inexact numbers."""
    if precision:
        numbers = [Fraction(value) for value in values]
        return [Inexact(x, nearest_float(abs(x) * Fraction(precision)) * SLACK) if x else x for x in numbers]
    if all(isinstance(value, Fraction) for value in values):
        return list(values)
    symbolic = any(not isinstance(value, Fraction) and value.free_symbols for value in values)
    found = None if symbolic else to_number_field(values)
    return _formulas(values, symbolic=symbolic) if found is None else found


def _formulas(values: Sequence[Any], *, symbolic: bool) -> list[Any]:
    """Formulas as rational functions of their symbols, or as expressions that SymPy simplifies at each step."""
    import sympy

    formulas = _sympy_numbers(values)
    if symbolic:
        domain: Any
        domain, elements = sympy.construct_domain(formulas, field=True)
        # SymPy treats x and sqrt(x), or sqrt(2) and sqrt(3), as independent symbols.
        if domain.is_FractionField and all(x.is_Symbol for x in domain.symbols):
            return list(elements)
    return [sympy.EX(formula) for formula in formulas]


def _sympy_numbers(values: Sequence[Any]) -> list[Any]:
    """The values with each `Fraction` as a SymPy number."""
    import sympy

    return [sympy.Rational(v.numerator, v.denominator) if isinstance(v, Fraction) else v for v in values]


def has_sign(element: Any) -> bool:
    """Whether the sign of an element can be decided."""
    return isinstance(element, Fraction | RealAlgebraic | Inexact)


def has_exact_zero_test(element: Any) -> bool:
    """Whether an element is zero if and only if it is false: no error bound, no roots that SymPy may not simplify."""
    return isinstance(element, Fraction) or hasattr(element, "field")


def midpoint(element: Any) -> Any:
    """The value of an inexact number, or zero where it counts as zero; other elements unchanged."""
    if isinstance(element, Inexact):
        return element.value if element else Fraction(0)
    return element


def upper(element: Any) -> Any:
    """Upper end of an inexact number, for tests of nonnegativity within the error; other elements unchanged."""
    return element.upper if isinstance(element, Inexact) else element


def from_element(element: Any, *, floating: bool = False) -> Entry:
    """Convert an element to a number or formula; an inexact one to a `Fraction`, or to a float if `floating`."""
    if isinstance(element, Fraction | Inexact):
        value: Any = midpoint(element)
        return nearest_float(value) if floating else value
    import sympy

    formula = element.to_sympy() if isinstance(element, RealAlgebraic) else element.as_expr()
    return Fraction(int(formula.p), int(formula.q)) if isinstance(formula, sympy.Rational) else formula


def stage_matrix(method: RungeKutta) -> tuple[list[list[Any]], list[Any], list[Any]]:
    """Matrix A, linear form b and vector 1 that give b (I − zA)⁻¹ 1.

    For a method given by a stage algebra they refer to the polynomial basis 1, x, … and are rational.
    """
    algebra = method.algebra
    if algebra is not None:
        ones = [Fraction(k == 0) for k in range(algebra.stages)]
        return [list(row) for row in algebra.A], list(algebra.b), ones
    size = method.stages
    elements = to_elements([v for row in (*method.A, method.b) for v in row], method.precision)
    rows = [elements[k : k + size] for k in range(0, len(elements), size)]
    return rows[:-1], rows[-1], [Fraction(1)] * size


def dot(first: Sequence[Any], second: Sequence[Any]) -> Any:
    """Scalar product."""
    return sum((a * b for a, b in zip(first, second, strict=True) if a and b), Fraction(0))
