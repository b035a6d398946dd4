"""Numbers and formulas to compute with exactly, numbers with error bounds, and real polynomials over them.

Entries of tableaux become elements of one of four kinds, all of them false where zero: `Fraction`; `RealAlgebraic` for
roots; `Inexact` for decimals and floats; SymPy's field elements for formulas with symbols, and for roots of high
degree. All but the last have signs.

Polynomials are those of `integrators.exact.polynomials`, over one field. Roots and signs need `Fraction`s or elements
of a real number field; flint isolates the roots.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from functools import reduce
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeAlias

from bseries.exact.domains import NumberField
from bseries.exact.number_fields import NoNumberFieldError, domain_of, enclosure
from integrators.exact.arithmetic import MOST_DEGREE, degree_bound
from integrators.exact.polynomials import (
    ONE,
    add,
    derivative,
    divide,
    evaluate,
    from_flint,
    multiply,
    scale,
    to_flint,
    trim,
)

if TYPE_CHECKING:
    import sympy
    from flint import acb, arb, fmpq, fmpq_poly

    from integrators.exact.entries import Entry
    from integrators.methods.tableaux.runge_kutta import RungeKutta

Operand: TypeAlias = "Fraction | int | fmpq | Arithmetic"
Coefficients = tuple[Any, ...]
"""A polynomial: its coefficients, ascending."""
EXACT_DIGITS = 30
"""Digits printed of a number without error."""
FIRST_BITS = 64
"""Working precision at which a sign is tried first."""
MOST_DENOMINATOR = 10**6
"""Rational roots with denominators up to this are recognised, and then verified."""
BITS = 128
"""Accuracy of roots."""


class Element(Protocol):
    """What an element is used for here; results of operations are elements of the same field."""

    def __bool__(self) -> bool: ...
    def __neg__(self) -> Any: ...
    def __add__(self, other: Any, /) -> Any: ...
    def __sub__(self, other: Any, /) -> Any: ...
    def __mul__(self, other: Any, /) -> Any: ...
    def __truediv__(self, other: Any, /) -> Any: ...


Vector: TypeAlias = Sequence[Element]
Rows: TypeAlias = Sequence[Vector]


def nearest_float(value: Any) -> float:
    """The nearest float; infinite beyond the range of floats."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


class Arithmetic:
    """Differences, quotients and reflected operations, from sums, products, negatives and inverses."""

    __slots__ = ()
    __add__: Any
    __mul__: Any
    __neg__: Any
    inverse: Any

    def __radd__(self, other: Operand) -> Self:
        return self + other

    def __sub__(self, other: Operand) -> Self:
        return self + -other

    def __rsub__(self, other: Operand) -> Self:
        return -self + other

    def __rmul__(self, other: Operand) -> Self:
        return self * other

    def __truediv__(self, other: Any) -> Self:
        return self * (other.inverse() if isinstance(other, Arithmetic) else 1 / Fraction(other))

    def __rtruediv__(self, other: Operand) -> Self:
        return self.inverse() * other


@dataclass(slots=True, eq=False)
class Inexact(Arithmetic):
    """A number with an error bound, both rational; it counts as zero where the bound reaches its absolute value.

    Integers and `Fraction`s in mixed operations are exact.
    """

    value: fmpq
    error: fmpq

    @classmethod
    def read(cls, value: Any, precision: Fraction | int = 0) -> Inexact:
        """A rational number with this relative error."""
        if isinstance(value, Inexact):
            return value
        return cls(to_flint(value), to_flint(abs(value) * precision))

    def __bool__(self) -> bool:
        return abs(self.value) > self.error

    def __add__(self, other: Operand) -> Inexact:
        y = self.read(other)
        return Inexact(self.value + y.value, self.error + y.error)

    def __mul__(self, other: Operand) -> Inexact:
        y = self.read(other)
        error = abs(self.value) * y.error + abs(y.value) * self.error + self.error * y.error
        return Inexact(self.value * y.value, error)

    def __neg__(self) -> Inexact:
        return Inexact(-self.value, self.error)

    def inverse(self) -> Inexact:
        """The inverse of a number that does not count as zero."""
        size = abs(self.value)
        return Inexact(1 / self.value, self.error / (size * (size - self.error)))

    @property
    def text(self) -> str:
        """The number to the digits that are certain."""
        if not self:
            return "0"
        digits = EXACT_DIGITS
        if self.error:
            certain = from_flint(abs(self.value) / self.error)
            digits = max(1, math.floor((Decimal(certain.numerator) / certain.denominator).log10()))
        value = from_flint(self.value)
        rounded = Context(prec=digits).divide(Decimal(value.numerator), Decimal(value.denominator)).normalize()
        return f"{rounded:f}" if -4 <= rounded.adjusted() < digits else f"{rounded:e}"


@dataclass(slots=True, eq=False)
class RealAlgebraic(Arithmetic):
    """Element of a real number field: a polynomial in θ, the `residue` modulo the minimal polynomial of θ."""

    field: NumberField
    residue: fmpq_poly

    @staticmethod
    def _lift(other: Operand) -> fmpq | fmpq_poly:
        return other.residue if isinstance(other, RealAlgebraic) else to_flint(other)

    def __bool__(self) -> bool:
        return self.residue != 0

    def __add__(self, other: Operand) -> RealAlgebraic:
        return RealAlgebraic(self.field, self.residue + self._lift(other))

    def __mul__(self, other: Operand) -> RealAlgebraic:
        return RealAlgebraic(self.field, self.residue * self._lift(other) % self.field.minimal_polynomial)

    def __neg__(self) -> RealAlgebraic:
        return RealAlgebraic(self.field, -self.residue)

    def __abs__(self) -> RealAlgebraic:
        return -self if sign(self) < 0 else self

    def __lt__(self, other: Operand) -> bool:
        return sign(self - other) < 0

    def __gt__(self, other: Operand) -> bool:
        return sign(self - other) > 0

    def inverse(self) -> RealAlgebraic:
        """The inverse, by Euclid's algorithm."""
        return RealAlgebraic(self.field, self.residue.xgcd(self.field.minimal_polynomial)[1])

    def to_sympy(self) -> sympy.Expr:
        """The number as a SymPy expression."""
        import sympy

        numbers = (sympy.sympify(from_flint(a), strict=True) for a in self.residue.coeffs())
        return sympy.expand(sympy.Add(*(a * self.field.generator**k for k, a in enumerate(numbers))))


def enclose(element: Fraction | RealAlgebraic, bits: int) -> arb:
    """An enclosure of a number, computed with some precision."""
    from flint import arb, arb_poly, ctx

    with ctx.workprec(bits):
        if isinstance(element, RealAlgebraic):
            return arb_poly(element.residue)(enclosure(element.field.generator, bits))
        return arb(to_flint(element))


def sign(element: Fraction | RealAlgebraic) -> int:
    """Sign of a `Fraction` or a `RealAlgebraic`, from an enclosure that excludes zero."""
    value, bits = element, FIRST_BITS
    if element and isinstance(element, RealAlgebraic):
        while (value := enclose(element, bits)).contains(0):
            bits *= 2
    return (value > 0) - (value < 0) if element else 0


def to_number_field(values: Iterable[Any]) -> list[Fraction | RealAlgebraic] | None:
    """Algebraic numbers as elements of one field, rational ones as `Fraction`s; None if its degree may be too high."""
    import sympy

    numbers = [sympy.sympify(value, strict=True) for value in values]
    try:
        domain, elements = domain_of(numbers, few=degree_bound(numbers) <= MOST_DEGREE)
    except NoNumberFieldError:
        return None
    if not domain.is_AlgebraicField:
        return [from_flint(to_flint(a)) for a in elements] if domain.is_QQ or domain.is_ZZ else None
    return real_algebraic(domain, elements)


def real_algebraic(domain: Any, elements: Any) -> list[Fraction | RealAlgebraic]:
    """Elements of SymPy's number field; rational ones as `Fraction`s."""
    field = NumberField(domain)
    residues = map(field.number, elements)
    return [RealAlgebraic(field, p) if p.degree() > 0 else from_flint(p[0]) for p in residues]


def to_elements(values: Sequence[Any], precision: Fraction | float = 0) -> Coefficients:
    """Convert numbers or formulas to elements of one field; `precision` is the relative error of inexact numbers."""
    if precision:
        return tuple(Inexact.read(Fraction(x), Fraction(precision)) if x else Fraction(0) for x in values)
    if all(isinstance(value, Fraction) for value in values):
        return tuple(values)
    import sympy

    formulas = [sympy.sympify(value, strict=True) for value in values]
    if not any(formula.free_symbols for formula in formulas):
        found = to_number_field(values)
        if found is not None:
            return tuple(found)
    else:
        domain: Any
        elements: Any
        domain, elements = sympy.construct_domain(formulas, field=True)
        # SymPy treats x and sqrt(x), or sqrt(2) and sqrt(3), as independent symbols.
        if domain.is_FractionField and all(x.is_Symbol for x in domain.symbols):
            return tuple(elements)
    return tuple(map(sympy.EX, formulas))


def has_sign(element: object) -> bool:
    """Whether the sign of an element can be decided."""
    return isinstance(element, Fraction | RealAlgebraic | Inexact)


def has_exact_zero_test(element: object) -> bool:
    """Whether an element is zero if and only if it is false: no error bound, no roots that SymPy may not simplify."""
    return isinstance(element, Fraction) or hasattr(element, "field")


def midpoint(element: Element) -> Any:
    """The value of an inexact number, or zero where it counts as zero; other elements unchanged."""
    if isinstance(element, Inexact):
        return from_flint(element.value) if element else Fraction(0)
    return element


def upper(element: Element) -> Any:
    """Upper end of an inexact number, for tests of nonnegativity within the error; other elements unchanged."""
    return from_flint(element.value + element.error) if isinstance(element, Inexact) and element else midpoint(element)


def from_element(element: Any, *, floating: bool = False) -> Entry:
    """Convert an element to a number or formula; an inexact one to a `Fraction`, or to a float if `floating`."""
    if isinstance(element, Fraction | Inexact):
        value: Any = midpoint(element)
        return nearest_float(value) if floating else value
    import sympy

    formula = element.to_sympy() if isinstance(element, RealAlgebraic) else element.as_expr()
    return Fraction(int(formula.p), int(formula.q)) if isinstance(formula, sympy.Rational) else formula


def stage_matrix(method: RungeKutta) -> tuple[Sequence[Coefficients], Coefficients, Coefficients]:
    """Matrix A, linear form b and vector 1 that give b (I − zA)⁻¹ 1.

    For a method given by a stage algebra they refer to the polynomial basis 1, x, … and are rational.
    """
    algebra = method.algebra
    if algebra is not None:
        return algebra.A, algebra.b, tuple(Fraction(k == 0) for k in range(algebra.stages))
    size = method.stages
    elements = to_elements([v for row in (*method.A, method.b) for v in row], method.precision)
    rows = [elements[k : k + size] for k in range(0, len(elements), size)]
    return rows[:-1], rows[-1], (Fraction(1),) * size


def dot(first: Vector, second: Vector) -> Any:
    """Scalar product."""
    return sum((a * b for a, b in zip(first, second, strict=True) if a and b), Fraction(0))


def subtract(p: Iterable[Any], q: Iterable[Any]) -> Coefficients:
    """The difference p − q."""
    return add(tuple(p), scale(tuple(q), -1))


def reflect(p: Vector) -> Coefficients:
    """The polynomial p(−x)."""
    return tuple(-a if k % 2 else a for k, a in enumerate(p))


def monic_gcd(p: Coefficients, q: Coefficients) -> Coefficients:
    """The monic greatest common divisor of two polynomials, not both zero, by Euclid's algorithm."""
    if is_rational((*p, *q)):
        return tuple(map(from_flint, _rational(p).gcd(_rational(q)).coeffs()))
    last, rest = p, q
    while rest:
        rest = tuple(a / rest[-1] for a in rest)
        last, rest = rest, divide(last, rest)[1]
    return tuple(a / last[-1] for a in last)


def is_rational(p: Iterable[object]) -> bool:
    """Whether all coefficients are rational."""
    return all(isinstance(a, Fraction) for a in p)


def _rational(p: Iterable[Fraction]) -> Any:
    from flint import fmpq_poly

    return fmpq_poly(list(map(to_flint, p)))


def squarefree_factors(p: Coefficients) -> list[Coefficients]:
    """Square-free factors by multiplicity (Yun's algorithm): the k-th has the roots of p of multiplicity k."""
    rest, other = p, derivative(p)
    factors = []
    while len(rest) > 1:
        factors.append(monic_gcd(rest, other))  # the first has the multiple roots
        rest, other = divide(rest, factors[-1])[0], divide(other, factors[-1])[0]
        other = subtract(other, derivative(rest))
    return factors[1:]


def roots(p: Coefficients, bits: int = BITS) -> list[acb]:
    """Disjoint enclosures of the roots of a square-free polynomial with p(0) ≠ 0, accurate to this number of bits.

    Those of real roots, and no others, have the imaginary part 0.
    """
    from flint import acb, acb_poly, arb, ctx

    if is_rational(p):
        with ctx.workprec(bits):
            return [root for root, _ in _rational(p).complex_roots()]
    precision = bits
    while True:
        precision *= 2
        with ctx.workprec(precision):
            try:
                found = acb_poly([enclose(a, precision) for a in p]).roots(tol=arb(2) ** (-3 * precision // 4))
            except ValueError:  # the enclosures of the coefficients are too wide
                continue
            # Roots come in conjugate pairs: one is real if no other enclosure meets the conjugate of its own.
            pairs = [[other for other in found if other.overlaps(root.conjugate())] for root in found]
            if all(len(pair) == 1 for pair in pairs) and all(root.rel_accuracy_bits() >= bits for root in found):
                return [acb(a.real) if a is b else a for a, (b,) in zip(found, pairs, strict=True)]


def first_crossing(p: Coefficients) -> Fraction | float:
    """First x ≥ 0 beyond which p becomes negative."""
    p = trim(p[next((k for k, a in enumerate(p) if a), len(p)) :])
    signs = [sign(a) for a in p]
    if -1 not in signs:
        return math.inf
    if signs[0] < 0:
        return Fraction(0)
    odd: Coefficients = reduce(multiply, squarefree_factors(p)[::2], ONE)
    positive = [root.real for root in roots(odd) if root.imag == 0 and root.real > 0]
    if not positive:
        return math.inf
    least = min(positive, key=lambda root: root.mid())
    nearest = from_flint(least.mid().fmpq())
    guess = nearest.limit_denominator(MOST_DENOMINATOR)
    is_root = abs(guess - nearest) <= from_flint(least.rad().fmpq()) and not evaluate(odd, guess)
    return guess if is_root else nearest_float(nearest)


def is_hurwitz(p: Coefficients) -> bool:
    """Whether all roots have negative real parts, by Routh's array: its first column has one sign."""
    above, below = p[::-2], p[-2::-2]
    while below:
        if sign(above[0]) * sign(below[0]) <= 0:
            return False
        ratio = above[0] / below[0]
        rows = zip_longest(above[1:], below[1:], fillvalue=Fraction(0))
        above, below = below, tuple(a - ratio * b for a, b in rows)
    return True
