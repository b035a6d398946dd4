"""Generators of a ring of functions, with their derivatives and relations.

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
from collections.abc import Callable, Iterable
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import sympy

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.polynomials import Element, Monomial, Number, PolynomialRing, TooLarge
from integrators.core.errors import shorten

MOST_POWER = 1_000
MOST_MONOMIALS_OF_A_POWER = 10_000


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


class GeneratedRing(PolynomialRing):
    """Polynomials in functions of some variables."""

    def __init__(self, variables: Iterable[sympy.Symbol], limit: int, digits: int | None):
        super().__init__(limit)
        self.variables = tuple(variables)
        self.digits = digits
        self.generators: list[sympy.Expr] = []
        """The expressions of the current generators."""
        self.pairs: list[Pair] = []
        self._roots: dict[int, Root] = {}
        self._number_roots: dict[int, tuple[int, int]] = {}
        """Generators p^(1/n), as (p, n)."""
        self._exponentials: set[int] = set()
        """Generators e^b."""
        self.indices: dict[Any, int] = {}
        """The common index of the expected roots of a base."""

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

    def add_function(self, expression: sympy.Expr, derivative: Callable[[int], Element]) -> int:
        """Add a generator without relations; derivative(i) is taken with respect to the i-th variable."""
        self.generators.append(expression)
        return self.add_generator(derivative)

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
        while numerator and roots[k] > 0 and (quotient := self.divided(numerator, base)) is not None:
            numerator, roots[k] = quotient, roots[k] - degree
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
        return math.prod((self._inverse_power(k, e * power) for k, e in parts.items()), start=rest)

    def _inverse_power(self, k: int, power: int) -> Element:
        """One over a power of a generator."""
        return self._whole_power(self._inverse(k), power) if power > 0 else self.generator(k, -power)

    def _whole_power(self, element: Element, power: int) -> Element:
        if power > MOST_POWER or math.comb(power + element.size - 1, power) > MOST_MONOMIALS_OF_A_POWER:
            raise TooLarge
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


def check_smooth(formula: sympy.Expr) -> None:
    """Refuse compiled functions, and abs, sign or where: a series holds on either side only, and a step may cross."""
    from integrators.exact.branches import Branching
    from integrators.scenes.model.black_boxes import check_formulas

    check_formulas([formula], "a series")
    found = min(map(str, formula.atoms(Branching)), default="")
    if found:
        raise SeriesError(f"field must be smooth for a series, but has {shorten(found)}, whose derivatives jump")
