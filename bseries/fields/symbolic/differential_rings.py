"""Formulas as elements of a differential ring: polynomials in generators closed under differentiation.

With sin q, cos q, 1/g, √g, e^g as generators, derivatives and products of formulas are those of polynomials, and equal
formulas become equal without any search for simplifications.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
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
    """An element of a `DifferentialRing`: supports + − * with elements of the same ring, ints and Fractions."""

    __slots__ = ("ring", "terms")

    def __init__(self, ring: DifferentialRing, terms: Terms):
        self.ring = ring
        self.terms = terms

    @property
    def size(self) -> int:
        """Number of monomials."""
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
    """A ring of functions of some variables that holds given formulas and all their derivatives.

    Zero is recognised at once (`bool(element)` is exact) where no two denominators or roots, and no denominator and
    sin or sinh, share the generator that their relation is solved for; `is_zero` also brings all to a common
    denominator, and is exact if the generators satisfy no relations but the ring's: for rational functions in the
    variables and in functions of independent arguments, and in square roots none of which is another's multiple.

    Args:
        formulas: SymPy formulas; they fix the basic arguments and the indices of roots.
        variables: The symbols to differentiate in; other symbols are parameters.
        limit: Results with more monomials raise `TooLarge`.
        digits: Write numbers as floats of so many digits; None: as they are.

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
        formulas: Sequence[sympy.Expr],
        variables: Sequence[sympy.Symbol],
        *,
        limit: int = MOST_MONOMIALS,
        digits: int | None = None,
    ):
        self.polynomials = FormulaRing(formulas, variables, limit, digits)
        self.elements = tuple(map(self.element, formulas))
        self.zero = Element(self, {})

    @classmethod
    def of(cls, formulas: Iterable[sympy.Expr], variables: Iterable[sympy.Symbol], **options: Any) -> DifferentialRing:
        """The ring of some formulas; they are its `elements`."""
        return cls(tuple(formulas), tuple(variables), **options)

    @property
    def variables(self) -> tuple[sympy.Symbol, ...]:
        """The symbols to differentiate in."""
        return self.polynomials.variables

    @property
    def generators(self) -> tuple[sympy.Expr, ...]:
        """What the generators so far stand for."""
        return tuple(self.polynomials.expressions)

    def element(self, formula: sympy.Expr) -> Element:
        """A formula as an element.

        Raises:
            SeriesError: It divides by zero, or is not finite.
        """
        return Element(self, self.polynomials.read(formula))

    def coerce(self, value: Element | Number) -> Element:
        """A number as an element; elements stay as they are.

        Raises:
            SeriesError: An element of another ring.
        """
        if not isinstance(value, Element):
            return Element(self, constant(Fraction(value)))
        if value.ring is not self:
            raise SeriesError("elements must be of one ring, but one was of another")
        return value

    def load(self, element: Element) -> Element:
        """An element as this ring's arithmetic takes it; see `flint_rings` for another arithmetic."""
        return element

    unload = load

    def derivative(self, element: Element, i: int) -> Element:
        """The derivative with respect to the i-th variable."""
        return Element(self, self.polynomials.slope(element.terms, i))

    def dot(self, pairs: Iterable[tuple[Element, Element]]) -> Element:
        """The sum of products, multiplied out only once."""
        return Element(self, self.polynomials.dot((a.terms, b.terms) for a, b in pairs))

    def denominator(self, elements: Iterable[Element]) -> int:
        """A common denominator: integers multiply faster than fractions."""
        return math.lcm(*(x.denominator for element in elements for x in element.terms.values()))

    def sum(self, parts: Iterable[tuple[Number, Element]]) -> Element:
        """The sum of multiples."""
        return Element(self, total((factor, element.terms) for factor, element in parts))

    def is_zero(self, element: Element) -> bool:
        """Whether an element is zero, as far as the relations tell (see the class)."""
        return not any(part.numerator for part in self.polynomials.quotients(element.terms))

    def to_expression(self, element: Element, *, simplify: bool = True) -> sympy.Expr:
        """The SymPy expression: over common denominators and factored, or expanded as it is."""
        if simplify and self.polynomials.digits is None:
            return factored(self.polynomials, element.terms)
        return self.polynomials.expression(element.terms)


MOST_FACTORED = 60
"""SymPy's factorisation of polynomials with more monomials can take seconds."""


def factored(ring: GeneratedRing, terms: Terms) -> sympy.Expr:
    """The SymPy expression of an element."""
    import sympy

    common = math.lcm(*(x.denominator for x in terms.values()))  # integers multiply faster
    integers: Terms = {m: int(x * common) for m, x in terms.items()}
    return sympy.Add(*(_factored_quotient(ring, part, common) for part in ring.quotients(integers, grow=False)))


def _factored_quotient(ring: GeneratedRing, part: Quotient, divisor: int) -> sympy.Expr:
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
    """The irreducible factors of a primitive polynomial, with their exponents, if they are found fast."""
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
    """Where a polynomial is linear in a generator, a greatest common divisor tells its factors, which is faster."""
    for x, degree in zip(polynomial.ring.gens, polynomial.degrees(), strict=True):
        if degree == 1:
            slope = polynomial.diff(x)
            common = slope.gcd(polynomial - slope * x)
            return [*_factor_list(common), (polynomial.exquo(common), 1)]
    return polynomial.factor_list()[1]
