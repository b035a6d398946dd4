"""Differential rings: formulas as polynomials in generators closed under differentiation.

With generators such as sin q, cos q, 1/g, √g and e^g, derivatives and products of formulas are those of polynomials,
and equal formulas have equal normal forms without a search for simplifications.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction
from functools import reduce
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.fields.symbolic import flint_polynomials
from bseries.fields.symbolic.formula_rings import FormulaRing
from bseries.fields.symbolic.sparse_polynomials import constant, exponent, generator, generators_of, primitive, total

if TYPE_CHECKING:
    import sympy

    from bseries.fields.symbolic.ring_generators import GeneratedRing, Pair, Quotient
    from bseries.fields.symbolic.sparse_polynomials import Number, Terms


MOST_MONOMIALS = 1_000_000


class Element:
    """Element of a `DifferentialRing`, with + − * for elements of the same ring, ints and Fractions."""

    __slots__ = ("ring", "terms")

    def __init__(self, ring: DifferentialRing, terms: Terms):
        self.ring = ring
        self.terms = terms

    @property
    def size(self) -> int:
        """The number of monomials."""
        return len(self.terms)

    def __bool__(self) -> bool:
        return bool(self.terms)

    def __add__(self, other: Element | Number) -> Element:
        return self.ring.sum([(1, self), (1, self.ring.coerce(other))])

    __radd__ = __add__

    def __sub__(self, other: Element | Number) -> Element:
        return self.ring.sum([(1, self), (-1, self.ring.coerce(other))])

    def __rsub__(self, other: Number) -> Element:
        return self.ring.coerce(other) - self

    def __neg__(self) -> Element:
        return self.ring.sum([(-1, self)])

    def __mul__(self, other: Element | Number) -> Element:
        return self.ring.dot([(self, self.ring.coerce(other))])

    __rmul__ = __mul__

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Element | int | Fraction):
            return NotImplemented
        return self.ring.is_zero(self - other)

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __repr__(self) -> str:
        return f"<Element {self.ring.to_expression(self, simplify=False)!s:.60}>"


class DifferentialRing:
    """A ring of functions of some variables that contains given formulas and all their derivatives.

    `bool(element)` decides exactly whether an element is zero if no two denominators or roots, and no denominator and
    sin or sinh, share the generator for which their relation is solved. `is_zero` also uses a common denominator. It is
    exact if the generators satisfy no other relations than those of the ring: for rational functions of the variables,
    of functions with independent arguments, and of square roots of which none is a multiple of another.

    Args:
        formulas: SymPy expressions; they determine the basic arguments and the indices of roots.
        variables: The symbols to differentiate in; other symbols are parameters.
        limit: Results with more monomials raise `TooLarge`.
        digits: The number of digits of floats in results; None for exact numbers.

    Example:
        >>> import sympy
        >>> x = sympy.Symbol("x")
        >>> ring = DifferentialRing([sympy.sin(2 * x), sympy.cos(x)], [x])
        >>> f, g = ring.elements
        >>> ring.to_expression(ring.derivative(f, 0) - 4 * g * g)
        -2
    """

    def __init__(
        self,
        formulas: Iterable[sympy.Expr],
        variables: Iterable[sympy.Symbol],
        *,
        limit: int = MOST_MONOMIALS,
        digits: int | None = None,
    ):
        formulas = tuple(formulas)
        self.polynomials = FormulaRing(formulas, variables, limit, digits)
        self.elements = tuple(map(self.element, formulas))
        self.zero = Element(self, {})

    @property
    def variables(self) -> tuple[sympy.Symbol, ...]:
        """The symbols to differentiate in."""
        return self.polynomials.variables

    @property
    def generators(self) -> tuple[sympy.Expr, ...]:
        """The expressions of the current generators."""
        return tuple(self.polynomials.expressions)

    def element(self, formula: sympy.Expr) -> Element:
        """Convert a formula to an element."""
        return Element(self, self.polynomials.read(formula))

    def coerce(self, value: Element | Number) -> Element:
        """Convert a number to an element, or check that an element belongs to this ring."""
        if not isinstance(value, Element):
            return Element(self, constant(Fraction(value)))
        if value.ring is not self:
            raise SeriesError("elements must be of one ring, but one was of another")
        return value

    def load(self, element: Element) -> Element:
        """An element in the form of this arithmetic, which is its own; see `flint_rings` for another."""
        return element

    unload = load

    def derivative(self, element: Element, i: int) -> Element:
        """The derivative with respect to the i-th variable."""
        return Element(self, self.polynomials.derivative(element.terms, i))

    def dot(self, pairs: Iterable[tuple[Element, Element]]) -> Element:
        """A sum of products, reduced once."""
        return Element(self, self.polynomials.dot((a.terms, b.terms) for a, b in pairs))

    def denominator(self, elements: Iterable[Element]) -> int:
        """A common denominator, since integers multiply faster than fractions."""
        return math.lcm(*(x.denominator for element in elements for x in element.terms.values()))

    def sum(self, parts: Iterable[tuple[Number, Element]]) -> Element:
        """A linear combination."""
        return Element(self, total((factor, element.terms) for factor, element in parts))

    def is_zero(self, element: Element) -> bool:
        """Whether an element is zero by the relations of the ring (see the class)."""
        return not any(part.numerator for part in self.polynomials.quotients(element.terms))

    def to_expression(self, element: Element, *, simplify: bool = True) -> sympy.Expr:
        """The SymPy expression: with common denominators and factored, or expanded."""
        if simplify and self.polynomials.digits is None:
            return factored(self.polynomials, element.terms)
        return self.polynomials.expression(element.terms)


MOST_FACTORED = 60
"""Polynomials with more monomials are not factored, which can take SymPy seconds."""


def factored(ring: GeneratedRing, terms: Terms) -> sympy.Expr:
    """The SymPy expression of an element, with common denominators and factored."""
    import sympy

    common = math.lcm(*(x.denominator for x in terms.values()))  # integers multiply faster
    integers: Terms = {m: int(x * common) for m, x in terms.items()}
    return sympy.Add(*(_quotient_expression(ring, part, common) for part in ring.quotients(integers, grow=False)))


def _quotient_expression(ring: GeneratedRing, part: Quotient, divisor: int) -> sympy.Expr:
    import sympy

    if not part.numerator:
        return sympy.Integer(0)
    numerator = reduce(_shorter, ring.pairs, part.numerator)
    monomial = sum(generator(k, min(exponent(m, k) for m in numerator)) for k in generators_of(numerator))
    content, rest = primitive({m - monomial: x for m, x in numerator.items()})
    factors = (ring.expression(factor) ** e for factor, e in _factors(rest))
    roots = (ring.expressions[k] ** e for k, e in part.roots.items())
    return sympy.Mul(ring.expression({monomial: content / divisor}), *factors, *roots)


def _shorter(terms: Terms, pair: Pair) -> Terms:
    """A polynomial with cos² replaced by 1 − sin² (or cosh² by 1 + sinh²) where that makes it shorter."""
    replaced = total((x, _without_squares(monomial, pair)) for monomial, x in terms.items())
    return replaced if len(replaced) < len(terms) else terms


def _without_squares(monomial: int, pair: Pair) -> Terms:
    half = exponent(monomial, pair.cosine) // 2
    rest = monomial - generator(pair.cosine, 2 * half)
    return {rest + generator(pair.sine, 2 * j): math.comb(half, j) * (-pair.sign) ** j for j in range(half + 1)}


def _factors(terms: Terms) -> list[tuple[Terms, int]]:
    """The irreducible factors of a primitive polynomial with their exponents, if the polynomial is short."""
    if len(terms) == 1 or len(terms) > MOST_FACTORED:
        return [(terms, 1)]
    integers: Terms = {m: int(x) for m, x in terms.items()}
    by_flint = flint_polynomials.flint() is not None
    found = flint_polynomials.irreducible_factors(integers) if by_flint else _factors_by_sympy(integers)
    return [(primitive(factor)[1], e) for factor, e in found]


def _factors_by_sympy(terms: Terms) -> list[tuple[Terms, int]]:
    import sympy

    present = generators_of(terms)
    polynomials = sympy.ring([f"g{k}" for k in present], sympy.ZZ)[0]
    polynomial = polynomials.from_dict({tuple(exponent(m, k) for k in present): x for m, x in terms.items()})
    return [
        ({sum(map(generator, present, m)): int(x) for m, x in factor.items()}, e)
        for factor, e in _factor_list(polynomial)
    ]


def _factor_list(polynomial: Any) -> list[tuple[Any, int]]:
    """The factors; a polynomial linear in a generator is split by a greatest common divisor, which is faster."""
    for x, degree in zip(polynomial.ring.gens, polynomial.degrees(), strict=True):
        if degree == 1:
            derivative = polynomial.diff(x)
            common = derivative.gcd(polynomial - derivative * x)
            return [*_factor_list(common), (polynomial.exquo(common), 1)]
    return polynomial.factor_list()[1]
