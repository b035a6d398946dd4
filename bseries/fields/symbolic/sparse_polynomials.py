"""Sparse polynomials with rational coefficients, modulo rewriting rules.

A polynomial is a dictionary {monomial: coefficient}. A monomial is an integer with `WIDTH` bits for the exponent of
each generator, so that monomials multiply by one addition and new generators use higher bits. The order of integers is
the lexicographic order of monomials, the newest generator first. Coefficients are ints where possible, else Fractions.

A rule such as s² = 1 − c² rewrites a monomial as smaller ones. The rules are a Gröbner basis, and remainders are a
canonical form, if the leading monomials have no generator in common (Buchberger's first criterion).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

if TYPE_CHECKING:
    Number: TypeAlias = int | Fraction
    Terms: TypeAlias = dict[int, Number]

WIDTH = 24
GUARD = 1 << (WIDTH - 1)
"""The highest bit of an exponent, clear in every monomial; it detects overflow and borrowing."""

ONE = 0
"""The monomial 1."""


class TooLarge(Exception):
    """A polynomial exceeds the limit of monomials, or of exponents."""


class Rule(NamedTuple):
    """Rewriting rule: `monomial` equals the sum of `tail`; `guards` marks its generators."""

    monomial: int
    guards: int
    tail: tuple[tuple[int, Number], ...]

    @classmethod
    def of(cls, monomial: int, tail: Terms) -> Rule:
        """The rule monomial = tail."""
        return cls(monomial, sum(_guard(k) for k, _ in exponents(monomial)), tuple(tail.items()))

    def divides(self, monomial: int) -> bool:
        """Whether the monomial of this rule divides another."""
        return ((monomial | self.guards) - self.monomial) & self.guards == self.guards


def generator(k: int, exponent: int = 1) -> int:
    """The monomial of the k-th generator to a power."""
    if exponent >= GUARD:
        raise TooLarge
    return exponent << (WIDTH * k)


def _guard(k: int) -> int:
    return GUARD << (WIDTH * k)


def exponent(monomial: int, k: int) -> int:
    """The exponent of the k-th generator."""
    return (monomial >> (WIDTH * k)) & (GUARD - 1)


def exponents(monomial: int) -> Iterator[tuple[int, int]]:
    """Pairs (k, exponent) of the generators in a monomial."""
    k = 0
    while monomial:
        if e := monomial & (GUARD - 1):
            yield k, e
        monomial >>= WIDTH
        k += 1


def constant(number: Number) -> Terms:
    """A constant polynomial."""
    return {ONE: narrowed(number)} if number else {}


def narrowed(number: Number) -> Number:
    """The number as an int if it is whole."""
    return number.numerator if number.denominator == 1 else number


def partial(terms: Terms, k: int) -> Terms:
    """The derivative with respect to the k-th generator."""
    step = generator(k)
    return {m - step: x * e for m, x in terms.items() if (e := exponent(m, k))}


def generators_of(terms: Iterable[int]) -> list[int]:
    """The indices of the generators in a polynomial, ascending."""
    union = 0
    for monomial in terms:
        union |= monomial
    return [k for k, _ in exponents(union)]


def total(parts: Iterable[tuple[Number, Terms]]) -> Terms:
    """A linear combination of polynomials."""
    found: Terms = {}
    for factor, terms in parts:
        for m, x in terms.items():
            found[m] = found.get(m, 0) + factor * x
    return {m: narrowed(x) for m, x in found.items() if x}


class RewritingRing:
    """Polynomials in a growing list of generators, modulo the rules added so far, with at most `limit` monomials."""

    def __init__(self, limit: int):
        self.limit = limit
        self.size = 0
        self.rules: list[Rule] = []
        self._overflow = 0

    def new_generator(self) -> int:
        """Add a generator; returns its index."""
        self._overflow |= _guard(self.size)
        self.size += 1
        return self.size - 1

    def add_rule(self, monomial: int, tail: Terms) -> None:
        """Add a rule for multiples of a monomial, which must contain a generator not yet used in any polynomial."""
        self.rules.append(Rule.of(monomial, tail))

    def dot(self, pairs: Iterable[tuple[Terms, Terms]]) -> Terms:
        """A sum of products a·b in normal form."""
        found: Terms = {}
        get = found.get
        for a, b in pairs:
            if len(a) > len(b):
                a, b = b, a
            others = b.items()
            for m, x in a.items():
                for n, y in others:
                    product = m + n
                    found[product] = get(product, 0) + x * y
                if len(found) > self.limit:
                    raise TooLarge
        return self.reduced(found)

    def power(self, terms: Terms, n: int) -> Terms:
        """The n-th power, n ≥ 0."""
        result = constant(1)
        while n:
            if n & 1:
                result = self.dot([(result, terms)])
            n >>= 1
            if n:
                terms = self.dot([(terms, terms)])
        return result

    def reduced(self, terms: Terms) -> Terms:
        """The normal form; the argument is modified."""
        while True:
            union = 0
            for monomial in terms:
                union |= monomial
            if union & self._overflow or len(terms) > self.limit:
                raise TooLarge
            changed = False
            for rule in self.rules:
                if rule.divides(union):  # necessary: exponents are at most those of `union`
                    changed |= _rewrite(terms, rule)
            if not changed:
                return {m: x for m, x in terms.items() if x}


def _rewrite(terms: Terms, rule: Rule) -> bool:
    """Apply a rule once to every multiple of its monomial; returns whether there was one."""
    leading, guards, tail = rule
    hits = [m for m in terms if ((m | guards) - leading) & guards == guards]
    for m in hits:
        x = terms.pop(m)
        if x:
            for n, y in tail:
                product = m - leading + n
                terms[product] = terms.get(product, 0) + x * y
    return bool(hits)


def divided(terms: Terms, divisor: Terms) -> Terms | None:
    """The quotient of polynomials; None if there is a remainder."""
    leading = max(divisor)
    rule = Rule.of(leading, divisor)
    rest, quotient = dict(terms), {}
    while rest:
        monomial = max(rest)
        if not rule.divides(monomial):
            return None
        step, factor = monomial - leading, narrowed(Fraction(rest[monomial]) / divisor[leading])
        quotient[step] = factor
        for m, x in divisor.items():
            rest[m + step] = rest.get(m + step, 0) - factor * x
            if not rest[m + step]:
                del rest[m + step]
    return quotient


def primitive(terms: Terms, *, keep_sign: bool = False) -> tuple[Fraction, Terms]:
    """The content of a polynomial and its primitive part, with coprime integer coefficients.

    The leading coefficient (first variables first) becomes positive, unless `keep_sign`.
    """
    denominator = math.lcm(*(x.denominator for x in terms.values()))
    content = Fraction(math.gcd(*(int(x * denominator) for x in terms.values())), denominator)
    if not keep_sign and _leading_coefficient(terms) < 0:
        content = -content
    return content, {m: narrowed(x / content) for m, x in terms.items()}


def _leading_coefficient(terms: Terms) -> Number:
    present = generators_of(terms)
    return terms[max(terms, key=lambda m: [exponent(m, k) for k in present])]
