"""Coefficient domains: the kinds of numbers that coefficients of series can be.

Three domains, from the narrowest to the widest:

- rational numbers (``QQ``): `RationalValues`, integers over common denominators; the docstring of
  `bseries.exact.rationals` says how they are proved;
- a ring of algebraic numbers or of expressions in symbols: `RingValues`, elements of a SymPy domain. A common
  denominator L of the entries of a method is kept apart (coefficient = element / L^n), so that no greatest common
  divisor is computed before a coefficient is read;
- floating-point numbers (``RR``): `FloatValues`, float64, as soon as one operand is a float.

A domain provides three things, which share the name `kind`:

- values: a subclass of `Values`, the coefficients of a series;
- stages: a class in `bseries.algebra.stages`, the entries of a method, with ``load`` as in `Values`: the elementary
  weights, or with ``field=None`` the stages themselves;
- an arithmetic: a subclass of `bseries.exact.arithmetic.Exact` that the recursions run in.

`narrowest` picks the domain of given numbers, `alike` brings operands to the widest of their domains, and `apply`
runs an operation in the arithmetic of its operands; `bseries.algebra.stages` does the first two for methods. A result
that fits into a narrower exact domain is moved there. SymPy's own rational type never leaves this file.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache, partial, reduce
from numbers import Rational, Real
from typing import TYPE_CHECKING, Any, TypeAlias

from bseries.exact import rationals as rational_series
from bseries.exact.arithmetic import Exact, float_lists, floats, rationals
from bseries.exact.number_fields import NoNumberFieldError, domain_of
from bseries.exact.rationals import Operation, RationalValues, Values
from bseries.exceptions import SeriesError
from bseries_base.lowering.flat_kernels import machine_code_pays
from integrators.exact.arithmetic import MOST_DEGREE, degree_bound
from integrators.exact.expressions import nearest_double
from integrators.exact.polynomials import to_flint
from trees.basis import Basis

if TYPE_CHECKING:
    import sympy
    from flint import fmpq_poly

    Coefficient: TypeAlias = Fraction | sympy.Expr | float


def exact_number(value: object, name: str = "coefficient") -> Fraction | float | sympy.Expr:
    """A number in its narrowest domain: a Fraction, a float, or a SymPy expression without floats."""
    if type(value) is int or type(value) is Fraction:  # in less than half the time of what follows
        return Fraction(value)
    if isinstance(value, Decimal) and value.is_finite():
        return Fraction(value)
    if isinstance(value, Rational) and not isinstance(value, bool):  # SymPy's too
        return Fraction(int(value.numerator), int(value.denominator))
    if isinstance(value, Real) and not isinstance(value, bool):
        number = float(value)
        if number - number != 0:
            raise SeriesError(f"{name} must be finite, but was {number}")
        return number
    if type(value).__module__.startswith("sympy."):
        import sympy

        outside = (sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I)
        if (
            isinstance(value, sympy.Expr)
            and not value.has(*outside)
            and value.is_finite is not False
            and value.is_commutative is not False
        ):
            if not value.has(sympy.Float):
                return value
            if value.is_number and value.is_real:
                return float(value)
            raise SeriesError(f"{name} must not mix floats with symbols or complex numbers, but was {value!s:.60}")
    raise SeriesError(f"{name} must be a number or a SymPy expression, but was {value!r:.60}")


class FloatValues(Values):
    """Coefficients in float64."""

    kind = "float"
    name = "RR"

    def __getitem__(self, at: int) -> float:
        return float(self.raw[at])

    def coefficients(self) -> list[float]:
        """All coefficients."""
        return list(self.raw) if isinstance(self.raw, list) else self.raw.tolist()

    def homogeneous(self, *, flow: bool) -> list[float]:
        """The coefficients themselves."""
        return self.coefficients()

    def load(self, basis: Basis, arithmetic: Exact, *, field: bool) -> Any:
        """The values as a vector of their own: recursions write into it."""
        if not arithmetic.compiled:
            return self.coefficients()
        import numpy as np

        return np.array(self.raw, float)


class RingValues(Values):
    """Coefficients in a SymPy domain: `raw` elements divided by step^n for trees with n nodes."""

    kind = "ring"

    def __init__(self, basis: Basis, ring: Any, elements: Sequence[Any], step: Any):
        super().__init__(basis, elements)
        self.ring, self.step = ring, step

    @property
    def name(self) -> str:
        """The domain's name, such as ``QQ<sqrt(3)>`` or ``QQ(gamma)``."""
        return str(self.ring if self.step == self.ring.one else self.ring.get_field())

    def __reduce__(self) -> tuple[Any, ...]:
        return make_values, (self.basis, self.coefficients())

    def __getitem__(self, at: int) -> Fraction | sympy.Expr:
        import sympy

        element, nodes = self.raw[at], self.basis.order_of(at)
        if self.step == self.ring.one:
            value = self.ring.to_sympy(element)
        else:
            field = self.ring.get_field()
            quotient = converted(element, self.ring, field) / converted(self.step, self.ring, field) ** int(nodes)
            value = field.to_sympy(quotient)
        return Fraction(int(value.p), int(value.q)) if isinstance(value, sympy.Rational) else value

    def equals_at(self, other: RingValues, at: int) -> bool:
        """Whether a coefficient is the same in values over the same ring and denominator."""
        return bool(self.raw[at] == other.raw[at])

    def truncated(self, basis: Basis) -> RingValues:
        """The coefficients of the first trees."""
        return RingValues(basis, self.ring, self.raw[: len(basis)], self.step)

    @property
    def reduced(self) -> RingValues:
        """The same values in the field of fractions, without a common denominator."""
        field = self.ring.get_field()
        step = converted(self.step, self.ring, field)
        if field == self.ring and step == field.one:
            return self
        elements = [
            converted(x, self.ring, field) / step ** int(n) for x, n in zip(self.raw, self.basis.orders, strict=True)
        ]
        return RingValues(self.basis, field, elements, field.one)

    def in_ring(self, ring: Any, step: Any) -> RingValues:
        """The same coefficients in a larger ring, over a multiple of the common denominator."""
        if (ring, step) == (self.ring, self.step):
            return self
        ratio = ring.exquo(step, converted(self.step, self.ring, ring))
        elements = [
            converted(element, self.ring, ring) * ratio ** int(nodes)
            for element, nodes in zip(self.raw, self.basis.orders, strict=True)
        ]
        return RingValues(self.basis, ring, elements, step)

    def scaled_step(self, factor: Any) -> RingValues:
        """The values a(τ) factor^|τ|, for an exact factor; products stay in the ring, without common denominators."""
        ring, (numerator,), step = ring_and_elements([factor])
        orders = list(map(int, self.basis.orders))
        mine, powers = alike([self, RingValues(self.basis, ring, [numerator**n for n in orders], step)])
        elements = [x * y for x, y in zip(mine.raw, powers.raw, strict=True)]
        return RingValues(self.basis, mine.ring, elements, mine.step * powers.step)


def ring_and_elements(entries: Sequence[Any]) -> tuple[Any, list[Any], Any]:
    """The smallest SymPy ring for these exact entries: (ring, numerators, common denominator)."""
    import sympy

    expressions = [sympy.Rational(e.numerator, e.denominator) if isinstance(e, Fraction) else e for e in entries]
    domain: Any
    ring: Any
    few = (degree := degree_bound(expressions)) <= MOST_DEGREE
    if not few and any(e.has(sympy.cos, sympy.sin, sympy.tan) for e in expressions):  # SymPy may miss that one is zero
        raise SeriesError(
            f"entries must lie in a number field of degree {MOST_DEGREE} at most if they have cosines, sines or "
            f"tangents, but theirs may have degree {degree}"
        )
    distinct = list(dict.fromkeys(expressions))  # elements of a number field are slow to find
    domain, elements = domain_of(distinct, few=few)
    found = dict(zip(distinct, elements, strict=True))
    elements = [found[e] for e in expressions]
    if not domain.is_Numerical and not domain.is_EX and not all(x.is_Symbol or x.is_number for x in domain.symbols):
        domain, elements = sympy.EX, [sympy.EX(e) for e in expressions]  # x and sqrt(x) are not independent
    if few and domain.is_EX and (mixed := _polynomials_over_algebraic_numbers(expressions)):
        domain, elements = mixed
    if domain.is_FractionField:
        ring = domain.get_ring()
        common = ring.one
        for element in elements:
            common = ring.lcm(common, element.denom)
        numerators = [element.numer * ring.exquo(common, element.denom) for element in elements]
    else:
        ring, numerators, common = domain, list(elements), domain.one  # e.g. ZZ[x], QQ<sqrt(3)>, EX
    # The recursions need 1/j!, hence rational coefficients of polynomials.
    wide: Any = sympy.QQ if ring.is_ZZ else ring
    if ring.is_PolynomialRing and ring.domain.is_ZZ:
        wide = sympy.QQ[ring.symbols]
    return wide, [converted(x, ring, wide) for x in numerators], converted(common, ring, wide)


def converted(element: Any, source: Any, target: Any) -> Any:
    """An element of one SymPy domain in another; of a number field only the generator is converted by SymPy."""
    if source == target:
        return element
    if not source.is_AlgebraicField:
        return target.convert_from(element, source)
    image, total = _image(source, target), target.zero
    for coefficient in element.to_list():
        total = total * image + target.convert_from(coefficient, source.dom)
    return total


@lru_cache(maxsize=64)
def _image(source: Any, target: Any) -> Any:
    return target.convert_from(source.unit, source)


def _polynomials_over_algebraic_numbers(expressions: Sequence[sympy.Expr]) -> tuple[Any, list[Any]] | None:
    """A fraction field over the algebraic numbers in the entries; None if some entry is no rational function."""
    import sympy
    from sympy.polys.polyerrors import BasePolynomialError

    symbols = sorted(set().union(*(e.free_symbols for e in expressions)), key=str)
    parts = [part for e in expressions for part in sympy.fraction(sympy.together(e))]
    try:
        numbers = [c for part in parts for c in sympy.Poly(part, *symbols, domain="EX").coeffs()]
        algebraic, _ = domain_of(numbers, few=True)
        field = algebraic[tuple(symbols)].get_field()
        quotients = [field.from_sympy(a) / field.from_sympy(b) for a, b in zip(parts[::2], parts[1::2], strict=True)]
    except BasePolynomialError:
        return None
    return field, quotients


def narrowest(numbers: Sequence[Any]) -> tuple[str, list[Any], Any, Any]:
    """Results of `exact_number` in the narrowest domain that holds them all: (kind, entries, ring, step).

    In a ring, the numbers are the entries divided by `step`. Numbers in no small field become floats.
    """
    if all(isinstance(number, Fraction) for number in numbers):
        return "rational", list(numbers), None, None
    if not any(isinstance(number, float) for number in numbers):
        try:
            ring, elements, step = ring_and_elements(numbers)  # takes seconds where roots are of high degree
        except NoNumberFieldError:
            pass
        else:
            return "ring", elements, ring, step
    return "float", [to_float(number) for number in numbers], None, None


def make_values(basis: Basis, numbers: Iterable[object]) -> Values:
    """Values from one number for each tree, in the narrowest domain that holds them all."""
    kind, entries, ring, step = narrowest([exact_number(number) for number in numbers])
    if kind == "float":
        return FloatValues(basis, entries)
    if kind == "rational":
        return RationalValues.from_fractions(basis, entries)
    elements = [x * step ** (int(n) - 1) for x, n in zip(entries, basis.orders, strict=True)]
    return RingValues(basis, ring, elements, step)


def to_float(number: Any) -> float:
    """The nearest float."""
    try:
        return nearest_double(number)
    except ArithmeticError:
        raise SeriesError(f"coefficient must stay within the range of floats, but was {number!s:.30}…") from None
    except TypeError as error:
        raise SeriesError(f"coefficient must be a number to become a float, but was {number!s:.60}") from error


def as_floats(values: Values) -> FloatValues:
    """The nearest floats."""
    if isinstance(values, FloatValues):
        return values
    return FloatValues(values.basis, [to_float(number) for number in values.coefficients()])


def alike(operands: Sequence[Values]) -> list[Any]:
    """The operands in the widest of their domains, over one ring and common denominator."""
    if any(isinstance(values, FloatValues) for values in operands):
        return [as_floats(values) for values in operands]
    if all(isinstance(values, RationalValues) for values in operands):
        return list(operands)
    rings = [as_ring(values) for values in operands]
    ring = reduce(lambda ring, other: ring.unify(other), (values.ring for values in rings))
    step = ring.one
    for values in rings:
        step = ring.lcm(step, converted(values.step, values.ring, ring)) if not ring.is_Field else ring.one
    if ring.is_Field:
        rings = [values.reduced for values in rings]
    return [values.in_ring(ring, step) for values in rings]


def as_ring(values: Any) -> RingValues:
    """Exact values as elements of a ring."""
    from sympy import QQ

    if isinstance(values, RingValues):
        return values
    elements = [QQ(x.numerator, x.denominator) for x in values.coefficients()]
    return RingValues(values.basis, QQ, elements, QQ.one)


def apply(basis: Basis, operands: Sequence[Any], operation: Operation) -> Values:
    """Apply an operation to operands of one domain: the stages of a method, or `Values` made `alike`."""
    first = operands[0]
    if first.kind == "rational":
        return rational_series.evaluate(basis, operands, operation)
    pays = first.kind == "float" and machine_code_pays(rational_series.work(basis, operation))
    arithmetic = floats() if pays else interpreted(first)
    raw = operation.expression(arithmetic, *(partial(operand.load, basis, arithmetic) for operand in operands))
    if first.kind == "float":
        return float_values(basis, raw)
    return narrowed(RingValues(basis, first.ring, list(map(arithmetic.element, raw)), first.step))


def float_values(basis: Basis, raw: Any) -> FloatValues:
    """Values in floats, a list or an array, which must be finite."""
    if not all(map(math.isfinite, raw if isinstance(raw, list) else [abs(raw).max()])):
        raise SeriesError("coefficients must stay within the range of floats, but some overflowed")
    return FloatValues(basis, raw)


def narrowed(values: RingValues) -> Values:
    """The values as rational numbers if all are."""
    is_rational = all(isinstance(values[at], Fraction) for at in range(len(values.basis)))
    return RationalValues.from_fractions(values.basis, values.coefficients()) if is_rational else values


def interpreted(operand: Any) -> Exact:
    """The arithmetic in which the interpreter computes with stages, flows or values."""
    if operand.kind == "rational":
        return rationals()
    if operand.kind == "float":
        return float_lists()
    ring = operand.ring
    if ring.is_AlgebraicField:
        return NumberField(ring)
    is_rational = ring.is_PolynomialRing and ring.domain.is_QQ
    return Polynomials(ring) if is_rational else Exact(partial(ring_element, ring))


class NumberField(Exact):
    """Elements of a number field as python-flint's polynomials in its generator.

    They are reduced at the end only: the value of a tree with n nodes is a sum of products of n entries.
    """

    def __init__(self, field: Any):
        super().__init__()
        self.field = field
        self.minimal_polynomial = flint_polynomial(field.mod.to_list())

    @property
    def generator(self) -> sympy.Expr:
        """The root of the minimal polynomial that generates the field, as a formula."""
        return self.field.ext.as_expr()

    def number(self, value: Any) -> Any:
        """A rational number, or an element of the field."""
        return flint_polynomial([value] if isinstance(value, Rational) else value.to_list())

    def element(self, value: Any) -> Any:
        """A polynomial, or an int, as an element of the field."""
        if isinstance(value, int):
            return self.field.convert(value)
        rest = value % self.minimal_polynomial
        return self.field([self.field.dom(int(x.p), int(x.q)) for x in reversed(rest.coeffs())])


class Polynomials(Exact):
    """Polynomials in symbols with rational coefficients, as python-flint's."""

    def __init__(self, ring: Any):
        from flint import fmpq_mpoly_ctx

        super().__init__()
        self.ring = ring
        self._context = fmpq_mpoly_ctx.get(tuple(f"x{k}" for k in range(len(ring.symbols))), "lex")

    def number(self, value: Any) -> Any:
        """A rational number, or a polynomial of the ring."""
        if isinstance(value, Rational):
            return self._context.constant(to_flint(value))
        return self._context.from_dict({powers: to_flint(x) for powers, x in value.items()})

    def element(self, value: Any) -> Any:
        """A polynomial, or an int, as an element of the ring."""
        if isinstance(value, int):
            return self.ring.convert(value)
        rational = self.ring.domain
        terms = {
            tuple(map(int, powers)): rational(
                int(x.p), int(x.q)
            )  # powers as Python's ints: SymPy 1.12 makes floats of flint's
            for powers, x in value.to_dict().items()
        }
        return self.ring.ring.from_dict(terms)


def flint_polynomial(descending: Sequence[Any]) -> fmpq_poly:
    """A polynomial of flint from rational coefficients, the leading one first."""
    from flint import fmpq_poly

    return fmpq_poly([to_flint(x) for x in reversed(descending)])


def ring_element(ring: Any, number: Any) -> Any:
    """A rational number as an element of a ring; elements are returned unchanged."""
    if isinstance(number, Rational):
        from sympy import QQ

        return ring.convert_from(QQ(number.numerator, number.denominator), QQ)
    return number
