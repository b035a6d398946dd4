"""Polynomials with rational coefficients in a growing list of generators, modulo relations, by python-flint.

Monomials are ordered lexicographically, the newest generator first. A relation such as s² = 1 − c² rewrites its
leading monomial. The relations are a Gröbner basis, and remainders are a canonical form, if the leading monomials have
no generator in common (Buchberger's first criterion).

| generators | relations | derivatives |
|---|---|---|
| s = sin b, c = cos b | s² = 1 − c² | ds = c db, dc = −s db |
| s = sinh b, c = cosh b | s² = c² − 1 | ds = c db, dc = s db |
| e = exp b | | de = e db |
| w = g^(−1/n), for a denominator or a root | w^n g = 1 | dw = −w^(n+1) dg / n |
| p^(1/n), p a prime | its n-th power is p | 0 |
| any other function | | SymPy's, converted on demand |

The generator w gives all roots of g: g^(k/n) = g^j w^(jn−k). An element is a sum of quotients, each a polynomial
without roots times a product of powers of roots.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cache, lru_cache
from typing import NamedTuple, TypeAlias

import sympy
from flint import Ordering, fmpq, fmpq_mpoly, fmpq_mpoly_ctx

from bseries.exceptions import SeriesError

Number: TypeAlias = int | Fraction
Monomial: TypeAlias = tuple[tuple[int, int], ...]
"""Pairs (generator, exponent), the newest generator first; the order of tuples is that of monomials."""

WORD = 8  # python-flint stores the exponents of eight generators in one word

PART = 4  # products of more than this multiple of the limit of monomials are computed monomial by monomial


MOST_POWER = 1_000
MOST_MONOMIALS_OF_A_POWER = 10_000


class TooLarge(SeriesError):
    """A polynomial exceeds the limit of monomials, or a power is too large."""

    def __init__(self, limit: int):
        super().__init__(f"fields must stay simpler: a formula would have more than {limit} monomials")


class Element:
    """Element of a `GeneratedRing`, with + − * for elements of the same ring, ints and Fractions."""

    __slots__ = ("polynomial", "ring")

    def __init__(self, ring: GeneratedRing, polynomial: fmpq_mpoly):
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


class Root(NamedTuple):
    """g^(−1/degree), for a polynomial g."""

    base: Element
    degree: int


class Pair(NamedTuple):
    """The generators s and c with s² = sign · (1 − c²), and c' = −sign · s."""

    sine: int
    cosine: int
    sign: int


class Quotient(NamedTuple):
    """A polynomial without roots, times powers of roots {number of the generator: exponent}."""

    numerator: Element
    roots: dict[int, int]


class GeneratedRing:
    """Polynomials in functions of some variables, modulo relations, with at most `limit` monomials."""

    def __init__(self, variables: Iterable[sympy.Symbol], limit: int, digits: int | None):
        self.variables, self.limit, self.digits = tuple(variables), limit, digits
        self.generators: list[sympy.Expr] = []  # the expressions of the current generators
        self.pairs: list[Pair] = []
        self.indices: dict[sympy.Expr | int, int] = {}  # the common index of the expected roots of a base
        self._roots: dict[int, Root] = {}
        self._number_roots: dict[int, tuple[int, int]] = {}  # generators p^(1/n), as (p, n)
        self._exponentials: set[int] = set()  # generators e^b
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
        rows: dict[tuple[int, ...], int | fmpq] = {}
        for monomial, x in terms.items():
            row = [0] * (last + 1)
            for k, e in monomial:
                row[last - k] = e
            rows[tuple(row)] = _number(x)
        return Element(self, self._context.from_dict(rows))

    def generator(self, k: int, exponent: int = 1) -> Element:
        """The k-th generator, or a power of it that no relation reduces."""
        return self.from_terms({((k, exponent),): 1})

    def add_function(self, expression: sympy.Expr, derivative: Callable[[int], Element]) -> int:
        """Add a generator; derivative(i) is that with respect to the i-th variable. Returns its index."""
        if len(self.generators) == self._context.nvars():
            self._context = _context(len(self.generators) + WORD)
        self.generators.append(expression)
        self._derivative_rules.append(derivative)
        return len(self.generators) - 1

    def add_relation(self, zero: Element) -> None:
        """Add a polynomial that is zero; its leading monomial must have a generator that no other polynomial has."""
        self._relations.append((zero, dict(next(iter(zero.terms)))))

    # Arithmetic.

    def dot(self, pairs: Iterable[tuple[Element | Number, Element]]) -> Element:
        """A sum of products in normal form; a linear combination is left as it is."""
        factors = list(pairs)  # first, since it may add generators
        total, is_linear = None, True
        for a, b in factors:
            right = self._current(b)
            if isinstance(a, Element):
                left, is_linear = self._current(a), False
                parts = [left] if len(left) * len(right) <= PART * self.limit else _parts(left)
            else:
                parts = [_number(a)]
            for part in parts:
                product = right * part
                total = product if total is None else total + product
                if isinstance(a, Element) and len(total) > self.limit:
                    raise TooLarge(self.limit)
        if total is None:
            return self.zero
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

    def _current(self, element: Element) -> fmpq_mpoly:
        """The polynomial of an element of this ring, in the present context."""
        if element.ring is not self:
            raise SeriesError("elements must be of one ring, but one was of another")
        if element.polynomial.context() is not self._context:
            element.polynomial = element.polynomial.project_to_context(self._context)
        return element.polynomial

    def _reduced(self, polynomial: fmpq_mpoly) -> Element:
        """The normal form."""
        if len(self._relations) == 1:  # one remainder is the normal form
            polynomial = polynomial % self._current(self._relations[0][0])
        before = None
        while len(self._relations) > 1 and polynomial != before:
            if len(polynomial) > self.limit:
                raise TooLarge(self.limit)
            before, degrees = polynomial, polynomial.degrees()[::-1]
            for zero, leading in self._relations:
                if all(degrees[k] >= e for k, e in leading.items()):  # otherwise no monomial is a multiple
                    polynomial = polynomial % self._current(zero)
                    degrees = polynomial.degrees()[::-1]
        if len(polynomial) > self.limit:
            raise TooLarge(self.limit)
        return Element(self, polynomial)

    def expression(self, element: Element) -> sympy.Expr:
        """The SymPy expression of a polynomial, expanded."""
        return sympy.Add(*(
            sympy.Mul(self._number(x), *(self.generators[k] ** e for k, e in monomial))
            for monomial, x in element.terms.items()
        ))  # fmt: skip

    def _number(self, value: Fraction) -> sympy.Expr:
        """A coefficient as a SymPy number, rounded to `digits`."""
        exact = sympy.Rational(value)
        if self.digits is None or (value.denominator == 1 and abs(value) < 10**self.digits):
            return exact
        return exact.evalf(self.digits)

    # New generators.

    def add_exponential(self, expression: sympy.Expr, argument: Element) -> int:
        """Add the generator e^b."""
        e = self.add_function(expression, lambda i: self.generator(e) * self.derivative(argument, i))
        self._exponentials.add(e)
        return e

    def add_pair(self, sine: sympy.Expr, cosine: sympy.Expr, argument: Element, sign: int) -> Pair:
        """Add the generators s, c of an argument b; the sign is −1 for hyperbolic functions."""
        c = self.add_function(cosine, lambda i: -sign * self.generator(s) * self.derivative(argument, i))
        s = self.add_function(sine, lambda i: self.generator(c) * self.derivative(argument, i))
        self.add_relation(self.generator(s, 2) + sign * self.generator(c, 2) - sign)
        self.pairs.append(Pair(s, c, sign))
        return self.pairs[-1]

    def _prime_root(self, prime: int, index: int) -> int:
        """The generator prime^(1/index)."""
        for k, known in self._number_roots.items():
            if known == (prime, index):
                return k
        k = self.add_function(sympy.Integer(prime) ** sympy.Rational(Fraction(1, index)), lambda i: self.zero)
        self._number_roots[k] = prime, index
        self.add_relation(self.generator(k, index) - prime)
        return k

    def _root(self, base: Element, index: int, displayed: sympy.Expr | None = None) -> int:
        """A generator base^(−1/n) for some multiple n of an index; `displayed` is the base in results."""
        for k, known in self._roots.items():
            if known.degree % index == 0 and not known.base - base:
                return k

        def derivative(i: int) -> Element:
            return Fraction(-1, index) * self.generator(w, index + 1) * self.derivative(base, i)

        shown = self.expression(base) if displayed is None else displayed
        w = self.add_function(shown ** sympy.Rational(Fraction(-1, index)), derivative)
        self._roots[w] = Root(base, index)
        self.add_relation(self.generator(w, index) * base - 1)
        return w

    # Common denominators. Powers of w = g^(−1/n) that differ by multiples of n have one.

    def is_zero(self, element: Element) -> bool:
        """Whether an element is zero by the relations of the ring, also with a common denominator."""
        return not any(part.numerator for part in self.quotients(element))

    def quotients(self, element: Element, *, grow: bool = True) -> list[Quotient]:
        """An element as a sum of quotients with different denominators; it is zero if all numerators are.

        With `grow`, denominators are common even if the numerator grows, or if the denominator has e^b.
        """
        parts = [Quotient(element, {})]
        for k in sorted(self._roots, reverse=True):  # the base of a root has earlier generators only
            if grow or self._exponentials.isdisjoint(self._roots[k].base.generators):
                parts = [finer for part in parts for finer in self._over_common_denominators(part, k, grow)]
        return parts

    def _over_common_denominators(self, part: Quotient, k: int, grow: bool) -> list[Quotient]:
        """Raise all powers of the k-th generator, a root, to the highest one of the same residue, and cancel."""
        if k not in part.numerator.generators:
            return [part]
        base, degree = self._roots[k]
        terms: dict[int, dict[Monomial, Number]] = defaultdict(dict)
        for monomial, x in part.numerator.terms.items():
            rest = dict(monomial)
            e = rest.pop(k, 0)
            terms[e][tuple(rest.items())] = x
        by_power = {e: self.from_terms(numerator) for e, numerator in terms.items()}
        found = []
        for residue in {e % degree for e in by_power}:
            group = {e: numerator for e, numerator in by_power.items() if e % degree == residue}
            highest = max(group)
            common = self.dot((numerator, self.power(base, (highest - e) // degree)) for e, numerator in group.items())
            if grow or common.size <= sum(numerator.size for numerator in group.values()):
                group = {highest: common}
            found += [self._cancelled(numerator, k, {**part.roots, k: e}) for e, numerator in group.items()]
        return found

    def _cancelled(self, numerator: Element, k: int, roots: dict[int, int]) -> Quotient:
        """Cancel the base of the k-th generator in a numerator as often as possible."""
        base, degree = self._roots[k]
        while numerator and roots[k] > 0:
            quotient, rest = divmod(self._current(numerator), self._current(base))
            if rest:
                break
            numerator, roots[k] = Element(self, quotient), roots[k] - degree
        return Quotient(numerator, {root: e for root, e in roots.items() if e})

    # Powers.

    def raised(self, element: Element, power: Fraction, index: int = 1, displayed: sympy.Expr | None = None) -> Element:
        """An element to a rational power; `index` is that of expected roots, `displayed` the base in results."""
        index = math.lcm(index, power.denominator)
        if power >= 0 and power.denominator == 1:
            return self._whole_power(element, int(power))
        if not element:
            raise SeriesError("formula must not divide by zero, but a denominator in it vanishes")
        if index == 1:
            parts = self.quotients(element)
            if len(parts) == 1 and (parts[0].roots or parts[0].numerator.size == 1):
                return self._inverse_quotient(parts[0], -int(power))
        content, base = primitive(element, keep_sign=index > 1) if self.digits is None else (Fraction(1), element)
        if not base - 1:
            return self.raised_number(content, power)
        w = self._root(base, index, displayed if content == 1 else None)
        index = self._roots[w].degree
        whole = max(math.ceil(power), 0)
        root = self.generator(w, int((whole - power) * index))
        return self.raised_number(content, power) * self._whole_power(base, whole) * root

    def _inverse_quotient(self, quotient: Quotient, power: int) -> Element:
        """One over a power of a quotient, factor by factor."""
        numerator, roots = quotient
        if numerator.size > 1:
            rest, parts = self.raised(numerator, Fraction(-power)), roots
        else:
            [(monomial, number)] = numerator.terms.items()
            rest, parts = self.coerce(number**-power), {**roots, **dict(reversed(monomial))}
        powers = ((k, e * power) for k, e in parts.items())
        factors = (self._whole_power(self._inverse(k), e) if e > 0 else self.generator(k, -e) for k, e in powers)
        return math.prod(factors, start=rest)

    def _whole_power(self, element: Element, power: int) -> Element:
        if power > MOST_POWER or math.comb(power + element.size - 1, power) > MOST_MONOMIALS_OF_A_POWER:
            raise TooLarge(self.limit)
        return self.power(element, power)

    def _inverse(self, k: int) -> Element:
        """One over a generator."""
        if k in self._roots:
            base, index = self._roots[k]
            return base * self.generator(k, index - 1)
        if k in self._number_roots:
            prime, index = self._number_roots[k]
            return Fraction(1, prime) * self.generator(k, index - 1)
        w = self._root(self.generator(k), self.indices.get(self.generators[k], 1))
        return self.generator(w, self._roots[w].degree)

    def raised_number(self, number: Fraction, power: Fraction) -> Element:
        """A rational power of a positive rational number, or an integer power of any number."""
        if power.denominator == 1:
            return self.coerce(number ** int(power))
        result = self.coerce(1)
        denominators = ((prime, -times) for prime, times in prime_factors(number.denominator))
        for prime, times in (*prime_factors(number.numerator), *denominators):
            whole, part = divmod(times * power, 1)
            result = result * Fraction(prime) ** whole
            if part:
                index = math.lcm(part.denominator, self.indices.get(prime, 1))
                result = result * self.generator(self._prime_root(prime, index), int(part * index))
        return result


def primitive(element: Element, *, keep_sign: bool = False) -> tuple[Fraction, Element]:
    """The content of a polynomial and its primitive part, with coprime integer coefficients.

    The coefficient that leads if the oldest generator comes first becomes positive, unless `keep_sign`.
    """
    monomials, numbers = element.polynomial.monoms(), element.polynomial.coeffs()
    content = Fraction(math.gcd(*(int(x.p) for x in numbers)), math.lcm(*(int(x.q) for x in numbers)))
    if not keep_sign and max(zip(monomials, numbers, strict=True), key=lambda term: term[0][::-1])[1] < 0:
        content = -content
    return content, element * (1 / content)


@lru_cache(maxsize=256)
def prime_factors(number: int) -> tuple[tuple[int, int], ...]:
    """Factors and exponents of a positive integer; factors without small divisors may be composite."""
    return tuple((int(p), int(e)) for p, e in sympy.factorint(number, limit=2**15).items())


def _parts(polynomial: fmpq_mpoly) -> Iterator[fmpq_mpoly]:
    """The monomials of a polynomial, for products that may exceed the limit long before they are done."""
    for monomial, x in polynomial.terms():
        yield polynomial.context().from_dict({monomial: x})


@cache
def _context(size: int) -> fmpq_mpoly_ctx:
    """python-flint's polynomials in some generators, the last one leading."""
    return fmpq_mpoly_ctx.get([f"g{k}" for k in reversed(range(size))], Ordering.lex)


def _number(value: Number) -> int | fmpq:
    return value if isinstance(value, int) else fmpq(value.numerator, value.denominator)
