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
from collections.abc import Callable, Iterable
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.sparse_polynomials import (
    ONE,
    RewritingRing,
    TooLarge,
    constant,
    divided,
    exponent,
    exponents,
    generator,
    generators_of,
    narrowed,
    partial,
    primitive,
    total,
)

if TYPE_CHECKING:
    import sympy

    from bseries.fields.symbolic.sparse_polynomials import Number, Terms

MOST_POWER = 1_000
MOST_MONOMIALS_OF_A_POWER = 10_000


class Root(NamedTuple):
    """g^(−1/degree), for a polynomial g."""

    base: Terms
    degree: int


class Pair(NamedTuple):
    """The generators s and c with s² = sign · (1 − c²), and c' = −sign · s."""

    sine: int
    cosine: int
    sign: int


class Quotient(NamedTuple):
    """A polynomial without roots, times powers of roots {number of the generator: exponent}."""

    numerator: Terms
    roots: dict[int, int]


class GeneratedRing(RewritingRing):
    """Polynomials in functions of some variables, with a derivation."""

    def __init__(self, variables: Iterable[sympy.Symbol], limit: int, digits: int | None):
        super().__init__(limit)
        self.variables = tuple(variables)
        self.digits = digits
        self.expressions: list[sympy.Expr] = []
        self.roots: dict[int, Root] = {}
        self.pairs: list[Pair] = []
        self.number_roots: dict[int, tuple[int, int]] = {}
        """Generators p^(1/n), as (p, n)."""
        self.exponentials: set[int] = set()
        """Monomials of the generators e^b."""
        self.indices: dict[Any, int] = {}
        """The common index of the expected roots of a base."""
        self._derivative_rules: list[Callable[[int], Terms]] = []
        self._derivatives: dict[tuple[int, int], Terms] = {}

    def product(self, factors: Iterable[Terms]) -> Terms:
        """The product of polynomials."""
        result = constant(1)
        for factor in factors:
            result = self.dot([(result, factor)])
        return result

    def derivative(self, terms: Terms, i: int) -> Terms:
        """The derivative with respect to the i-th variable."""
        pairs = [(partial(terms, k), inner) for k in generators_of(terms) if (inner := self.generator_derivative(k, i))]
        return self.dot(pairs) if pairs else {}

    def generator_derivative(self, k: int, i: int) -> Terms:
        """The derivative of a generator."""
        found = self._derivatives.get((k, i))
        if found is None:
            found = self._derivatives[k, i] = total([(1, self._derivative_rules[k](i))])  # as integers where possible
        return found

    def expression(self, terms: Terms) -> sympy.Expr:
        """The SymPy expression of a polynomial, expanded."""
        import sympy

        return sympy.Add(*(
            sympy.Mul(self.number(x), *(self.expressions[k] ** e for k, e in exponents(monomial)))
            for monomial, x in terms.items()
        ))  # fmt: skip

    def number(self, value: Number) -> sympy.Expr:
        """A coefficient as a SymPy number, rounded to `digits`."""
        exact = rational(value)
        if self.digits is None or (value.denominator == 1 and abs(value) < 10**self.digits):
            return exact
        return exact.evalf(self.digits)

    # New generators.

    def add_function(self, expression: sympy.Expr, derivative: Callable[[int], Terms]) -> int:
        """Add a generator without relations; derivative(i) is taken with respect to the i-th variable."""
        self.expressions.append(expression)
        self._derivative_rules.append(derivative)
        return self.new_generator()

    def add_exponential(self, expression: sympy.Expr, argument: Terms) -> int:
        """Add the generator e^b."""

        def derivative(i: int) -> Terms:
            return self.dot([({generator(e): 1}, self.derivative(argument, i))])

        e = self.add_function(expression, derivative)
        self.exponentials.add(generator(e))
        return e

    def add_pair(self, sine: sympy.Expr, cosine: sympy.Expr, argument: Terms, sign: int) -> Pair:
        """Add the generators s, c of an argument b; the sign is −1 for hyperbolic functions."""

        def sine_derivative(i: int) -> Terms:
            return self.dot([({generator(c): 1}, self.derivative(argument, i))])

        def cosine_derivative(i: int) -> Terms:
            return self.dot([({generator(s): -sign}, self.derivative(argument, i))])

        c = self.add_function(cosine, cosine_derivative)
        s = self.add_function(sine, sine_derivative)
        self.add_rule(generator(s, 2), {ONE: sign, generator(c, 2): -sign})
        self.pairs.append(Pair(s, c, sign))
        return self.pairs[-1]

    def prime_root(self, prime: int, index: int) -> int:
        """The generator prime^(1/index)."""
        import sympy

        for k, known in self.number_roots.items():
            if known == (prime, index):
                return k
        k = self.add_function(sympy.Integer(prime) ** rational(Fraction(1, index)), lambda i: {})
        self.number_roots[k] = prime, index
        self.add_rule(generator(k, index), constant(prime))
        return k

    def root(self, base: Terms, index: int, displayed: sympy.Expr | None = None) -> int:
        """A generator base^(−1/n) for some multiple n of an index; `displayed` is the base in results."""
        for k, known in self.roots.items():
            if known.base == base and known.degree % index == 0:
                return k

        def derivative(i: int) -> Terms:
            return self.dot([({generator(w, index + 1): narrowed(Fraction(-1, index))}, self.derivative(base, i))])

        shown = self.expression(base) if displayed is None else displayed
        w = self.add_function(shown ** rational(Fraction(-1, index)), derivative)
        self.roots[w] = Root(base, index)
        # The relation w^n g = 1, solved for the leading monomial.
        leading, step = max(base), generator(w, index)
        tail = {ONE: Fraction(1), **{m + step: Fraction(-x) for m, x in base.items() if m != leading}}
        self.add_rule(leading + step, {m: narrowed(x / base[leading]) for m, x in tail.items()})
        return w

    # Common denominators. Powers of w = g^(−1/n) that differ by multiples of n have one.

    def quotients(self, terms: Terms, *, grow: bool = True) -> list[Quotient]:
        """An element as a sum of quotients with different denominators; it is zero if all numerators are.

        Args:
            terms: The element.
            grow: Whether to use a common denominator even if the numerator grows, or if the denominator has e^b.
        """
        parts = [Quotient(terms, {})]
        for k in sorted(self.roots, reverse=True):  # the base of a root has earlier generators only
            if grow or self.exponentials.isdisjoint(self.roots[k].base):
                parts = [finer for part in parts for finer in self._over_common_denominators(part, k, grow)]
        return parts

    def _over_common_denominators(self, part: Quotient, k: int, grow: bool) -> list[Quotient]:
        """Raise all powers of the k-th generator, a root, to the highest one of the same residue, and cancel."""
        base, degree = self.roots[k]
        by_power: dict[int, Terms] = {}
        for monomial, x in part.numerator.items():
            e = exponent(monomial, k)
            by_power.setdefault(e, {})[monomial - generator(k, e)] = x
        found = []
        for residue in {e % degree for e in by_power}:
            group = {e: numerator for e, numerator in by_power.items() if e % degree == residue}
            highest = max(group)
            powers = ((numerator, self.power(base, (highest - e) // degree)) for e, numerator in group.items())
            common = self.dot(powers)
            if grow or len(common) <= sum(map(len, group.values())):
                group = {highest: common}
            found += [_cancelled(numerator, base, {**part.roots, k: e}, k, degree) for e, numerator in group.items()]
        return found

    # Powers.

    def raised(self, terms: Terms, power: Fraction, index: int = 1, displayed: sympy.Expr | None = None) -> Terms:
        """A polynomial to a rational power; `index` is that of expected roots, `displayed` the base in results."""
        index = math.lcm(index, power.denominator)
        if power >= 0 and power.denominator == 1:
            return self._whole_power(terms, int(power))
        if not terms:
            raise SeriesError("formula must not divide by zero, but a denominator in it vanishes")
        if index == 1:
            parts = self.quotients(terms)
            if len(parts) == 1 and (parts[0].roots or len(parts[0].numerator) == 1):
                return self._inverse_quotient(parts[0], -int(power))
        content, base = primitive(terms, keep_sign=index > 1) if self.digits is None else (Fraction(1), terms)
        if base == {ONE: 1}:
            return self.raised_number(content, power)
        w = self.root(base, index, displayed if base == terms else None)
        index = self.roots[w].degree
        whole = max(math.ceil(power), 0)
        root: Terms = {generator(w, int((whole - power) * index)): 1}
        return self.product([self.raised_number(content, power), self._whole_power(base, whole), root])

    def _inverse_quotient(self, quotient: Quotient, power: int) -> Terms:
        """One over a power of a quotient, factor by factor."""
        numerator, roots = quotient
        if len(numerator) > 1:
            rest, parts = self.raised(numerator, Fraction(-power)), roots
        else:
            [(monomial, number)] = numerator.items()
            rest, parts = constant(Fraction(number) ** -power), {**roots, **dict(exponents(monomial))}
        return self.product([rest, *(self._inverse_power(k, e * power) for k, e in parts.items())])

    def _inverse_power(self, k: int, power: int) -> Terms:
        """One over a power of a generator."""
        return self._whole_power(self._inverse(k), power) if power > 0 else {generator(k, -power): 1}

    def _whole_power(self, terms: Terms, power: int) -> Terms:
        if power > MOST_POWER or math.comb(power + len(terms) - 1, power) > MOST_MONOMIALS_OF_A_POWER:
            raise TooLarge
        return self.power(terms, power)

    def _inverse(self, k: int) -> Terms:
        """One over a generator."""
        if k in self.roots:
            base, index = self.roots[k]
            return self.dot([(base, {generator(k, index - 1): 1})])
        if k in self.number_roots:
            prime, index = self.number_roots[k]
            return {generator(k, index - 1): Fraction(1, prime)}
        w = self.root({generator(k): 1}, self.indices.get(self.expressions[k], 1))
        return {generator(w, self.roots[w].degree): 1}

    def raised_number(self, number: Fraction, power: Fraction) -> Terms:
        """A rational power of a positive rational number, or an integer power of any number."""
        if power.denominator == 1:
            return constant(number ** int(power))
        result = constant(1)
        denominators = ((prime, -times) for prime, times in prime_factors(number.denominator))
        for prime, times in (*prime_factors(number.numerator), *denominators):
            whole, part = divmod(times * power, 1)
            factor = constant(Fraction(prime) ** whole)
            if part:
                index = math.lcm(part.denominator, self.indices.get(prime, 1))
                factor = {generator(self.prime_root(prime, index), int(part * index)): factor[ONE]}
            result = self.dot([(result, factor)])
        return result


def _cancelled(numerator: Terms, base: Terms, roots: dict[int, int], k: int, degree: int) -> Quotient:
    """Cancel the base of the k-th generator in a numerator as often as possible."""
    while numerator and roots[k] > 0 and (quotient := divided(numerator, base)) is not None:
        numerator, roots[k] = quotient, roots[k] - degree
    return Quotient(numerator, {root: e for root, e in roots.items() if e})


@lru_cache(maxsize=256)
def prime_factors(number: int) -> tuple[tuple[int, int], ...]:
    """Factors and exponents of a positive integer; factors without small divisors may be composite."""
    import sympy

    return tuple((int(p), int(e)) for p, e in sympy.factorint(number, limit=2**15).items())


def rational(number: Number) -> Any:
    """Convert a number to a SymPy rational."""
    import sympy

    return sympy.Rational(number.numerator, number.denominator)
