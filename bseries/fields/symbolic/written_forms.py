"""Elements of a ring of functions as people write them: over common denominators, and factored."""

from __future__ import annotations

import math
from functools import reduce
from typing import TYPE_CHECKING, Any

from bseries.fields.symbolic import flint_polynomials
from bseries.fields.symbolic.sparse_polynomials import exponent, generator, generators_of, primitive, total

if TYPE_CHECKING:
    import sympy

    from bseries.fields.symbolic.ring_generators import GeneratedRing, Pair, Quotient
    from bseries.fields.symbolic.sparse_polynomials import Terms

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
