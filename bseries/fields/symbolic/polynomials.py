"""Polynomials with rational coefficients in a growing list of generators, modulo relations, by python-flint.

Monomials are ordered lexicographically, the newest generator first. A relation such as s² = 1 − c² rewrites its
leading monomial. The relations are a Gröbner basis, and remainders are a canonical form, if the leading monomials have
no generator in common (Buchberger's first criterion).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cache
from typing import Any, TypeAlias

import flint

from bseries.exceptions import SeriesError

Number: TypeAlias = int | Fraction
Monomial: TypeAlias = tuple[tuple[int, int], ...]
"""Pairs (generator, exponent), the newest generator first; the order of tuples is that of monomials."""

WORD = 8
"""python-flint stores the exponents of eight generators in one word."""

PART = 4
"""Products of more than this multiple of the limit of monomials are computed monomial by monomial."""


class TooLarge(Exception):
    """A polynomial exceeds the limit of monomials, or a power is too large."""


class Element:
    """Element of a `PolynomialRing`, with + − * for elements of the same ring, ints and Fractions."""

    __slots__ = ("polynomial", "ring")

    def __init__(self, ring: PolynomialRing, polynomial: Any):
        self.ring = ring
        self.polynomial = polynomial

    @property
    def size(self) -> int:
        """The number of monomials."""
        return len(self.polynomial)

    @property
    def terms(self) -> dict[Monomial, Fraction]:
        """The coefficients of all monomials, the leading one first."""
        last = self.polynomial.context().nvars() - 1
        return {
            tuple((last - at, int(e)) for at, e in enumerate(monomial) if e): Fraction(int(x.p), int(x.q))
            for monomial, x in self.polynomial.terms()
        }

    @property
    def generators(self) -> list[int]:
        """The indices of the generators that occur, ascending."""
        return [k for k, e in enumerate(reversed(self.polynomial.degrees())) if e > 0]

    def __bool__(self) -> bool:
        return bool(self.polynomial)

    def __add__(self, other: Element | Number) -> Element:
        return self.ring.dot([(1, self), (1, self.ring.coerce(other))])

    __radd__ = __add__

    def __sub__(self, other: Element | Number) -> Element:
        return self.ring.dot([(1, self), (-1, self.ring.coerce(other))])

    def __rsub__(self, other: Number) -> Element:
        return self.ring.coerce(other) - self

    def __neg__(self) -> Element:
        return Element(self.ring, -self.polynomial)

    def __mul__(self, other: Element | Number) -> Element:
        return self.ring.dot([(other, self)])

    __rmul__ = __mul__

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Element | int | Fraction):
            return NotImplemented
        return self.ring.is_zero(self - other)

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __repr__(self) -> str:
        return f"<Element {self.polynomial!s:.60}>"


class PolynomialRing:
    """Polynomials in a growing list of generators with derivatives, modulo relations, with at most `limit` monomials.

    Example:
        >>> ring = PolynomialRing(100)
        >>> c, s = ring.add_generator(lambda i: -ring.generator(s)), ring.add_generator(lambda i: ring.generator(c))
        >>> ring.add_relation(ring.generator(s, 2) + ring.generator(c, 2) - 1)
        >>> ring.derivative(ring.generator(s), 0) * ring.generator(s, 2)
        <Element -g0^3 + g0>
    """

    def __init__(self, limit: int):
        self.limit = limit
        self.size = 0
        self._context = _context(WORD)
        self._relations: list[tuple[Element, dict[int, int]]] = []
        """Polynomials that are zero, and the exponents of their leading monomials, by the place of the generator."""
        self._derivative_rules: list[Callable[[int], Element]] = []
        self._derivatives: dict[tuple[int, int], Element] = {}

    # Elements.

    @property
    def zero(self) -> Element:
        """The element 0."""
        return Element(self, self._context.constant(0))

    def coerce(self, value: Element | Number) -> Element:
        """Convert a number to an element."""
        return value if isinstance(value, Element) else Element(self, self._context.constant(_number(value)))

    def from_terms(self, terms: Mapping[Monomial, Number]) -> Element:
        """The element with these coefficients, not reduced by the relations."""
        last = self._context.nvars() - 1
        rows: dict[tuple[int, ...], Any] = {}
        for monomial, x in terms.items():
            row = [0] * (last + 1)
            for k, e in monomial:
                row[last - k] = e
            rows[tuple(row)] = _number(x)
        return Element(self, self._context.from_dict(rows))

    def generator(self, k: int, exponent: int = 1) -> Element:
        """The k-th generator, or a power of it that no relation reduces."""
        return self.from_terms({((k, exponent),): 1})

    def add_generator(self, derivative: Callable[[int], Element]) -> int:
        """Add a generator; derivative(i) is that with respect to the i-th variable. Returns its index."""
        if self.size == self._context.nvars():
            self._context = _context(self.size + WORD)
        self.size += 1
        self._derivative_rules.append(derivative)
        return self.size - 1

    def add_relation(self, zero: Element) -> None:
        """Add a polynomial that is zero; its leading monomial must have a generator that no other polynomial has."""
        self._relations.append((zero, dict(next(iter(zero.terms)))))

    # Arithmetic.

    def dot(self, pairs: Iterable[tuple[Element | Number, Element]]) -> Element:
        """A sum of products in normal form; a linear combination is left as it is."""
        factors = list(pairs)  # first, since it may add generators
        total, is_linear = self._context.constant(0), True
        for a, b in factors:
            if not isinstance(a, Element):
                total += self._current(b) * _number(a)
                continue
            is_linear = False
            left, right = self._current(a), self._current(b)
            for part in (left,) if len(left) * len(right) <= PART * self.limit else _parts(left):
                total += part * right
                if len(total) > self.limit:
                    raise TooLarge
        return Element(self, total) if is_linear else self._reduced(total)

    def power(self, element: Element, n: int) -> Element:
        """The n-th power, n ≥ 0."""
        result = self.coerce(1)
        for digit in f"{n:b}":
            result = result * result * element if digit == "1" else result * result
        return result

    def derivative(self, element: Element, i: int) -> Element:
        """The derivative with respect to the i-th variable."""
        inner = [(k, d) for k in element.generators if (d := self.generator_derivative(k, i))]
        polynomial, last = self._current(element), self._context.nvars() - 1
        return self.dot((Element(self, polynomial.derivative(last - k)), d) for k, d in inner)

    def generator_derivative(self, k: int, i: int) -> Element:
        """The derivative of a generator."""
        if (k, i) not in self._derivatives:
            self._derivatives[k, i] = self._derivative_rules[k](i)
        return self._derivatives[k, i]

    def divided(self, element: Element, divisor: Element) -> Element | None:
        """The quotient as polynomials; None if there is a remainder."""
        quotient, rest = divmod(self._current(element), self._current(divisor))
        return None if rest else Element(self, quotient)

    def is_zero(self, element: Element) -> bool:
        """Whether an element is zero by the relations."""
        return not element

    def _current(self, element: Element) -> Any:
        """The polynomial of an element of this ring, in the present context."""
        if element.ring is not self:
            raise SeriesError("elements must be of one ring, but one was of another")
        if element.polynomial.context() is not self._context:
            element.polynomial = element.polynomial.project_to_context(self._context)
        return element.polynomial

    def _reduced(self, polynomial: Any) -> Element:
        """The normal form."""
        if len(self._relations) == 1:  # one remainder is the normal form
            polynomial = polynomial % self._current(self._relations[0][0])
        before = polynomial if len(self._relations) < 2 else None
        while polynomial != before:
            if len(polynomial) > self.limit:
                raise TooLarge
            before, degrees = polynomial, polynomial.degrees()[::-1]
            for zero, leading in self._relations:
                if all(degrees[k] >= e for k, e in leading.items()):  # otherwise no monomial is a multiple
                    polynomial = polynomial % self._current(zero)
                    degrees = polynomial.degrees()[::-1]
        if len(polynomial) > self.limit:
            raise TooLarge
        return Element(self, polynomial)


def _parts(polynomial: Any) -> Iterator[Any]:
    """The monomials of a polynomial, for products that may exceed the limit long before they are done."""
    for monomial, x in polynomial.terms():
        yield polynomial.context().from_dict({monomial: x})


@cache
def _context(size: int) -> Any:
    """python-flint's polynomials in some generators, the last one leading."""
    return flint.fmpq_mpoly_ctx.get([f"g{k}" for k in reversed(range(size))], flint.Ordering.lex)


def _number(value: Number) -> Any:
    return value if isinstance(value, int) else flint.fmpq(value.numerator, value.denominator)
