"""The underlying one-step method of a linear multistep method, from its generating polynomials.

Φ is the only series with Σ α_j Φ^j = h Σ β_j f∘Φ^j (Kirchgraber 1986). With D = ∂_b and Φ = exp b this is
ρ(e^D) id = σ(e^D) δ, where δ is the field f. Let μ(x) = ρ(e^x)/(x σ(e^x)) = 1 + Σ μ_k x^k; since D id = b,

    b = δ − Σ_{k≥1} μ_k ∂_b^k b          (HLW, section XV.3.1),

which is solved order by order as a logarithm is, with other weights. If ρ'(1) ≠ σ(1), the method is a consistent one
with the step size σ(1)/ρ'(1) · h.

With μ_k d_k an integer, b(τ) D_n is one for n nodes if D_n is a common multiple of all d_k D_{n_0} ⋯ D_{n_k} with
n_0 + … + n_k = n.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cached_property, partial
from typing import Any

from bseries.exact import bounds, denominators, domains, lie, recursions
from bseries.exact.arithmetic import Exact, Wrapped, wrapped_stages
from bseries.exact.bounds import ONE, Bound
from bseries.exact.denominators import twos
from bseries.exact.domains import Values, converted, narrowest, ring_element
from bseries.exact.rationals import Operation
from integrators.methods.kinds.memory import LinearMultistep
from trees.basis import Basis


class MultistepInputs:
    """The numbers μ_k of a consistent multistep method, which its series and the logarithm of that come from."""

    def __init__(self, method: LinearMultistep, order: int):
        count = len(method.alpha)
        self.kind, entries, self.ring, _ = narrowest([*method.alpha, *method.beta])
        self._unit: Any = 1  # L such that L^k μ_k is in the ring
        field = self.ring.get_field() if self.kind == "ring" else None
        number: Any = Fraction if field is None else partial(ring_element, field)
        if field is not None:
            entries = [converted(x, self.ring, field) for x in entries]
        rho, sigma = entries[:count], entries[count:]
        above = [_moment(rho, k + 1, number) for k in range(order + 1)]
        below = [_moment(sigma, k, number) for k in range(order + 1)]
        if field is not None and not self.ring.is_Field:
            first, second = (converted(x[0], field, self.ring) for x in (above, below))
            self._unit = self.ring.lcm(first, second)
        self.mu = [number(Fraction(1))]
        for k in range(1, order + 1):
            rest = sum((below[i] / below[0] * self.mu[k - i] for i in range(1, k + 1)), number(Fraction(0)))
            self.mu.append(above[k] / above[0] - rest)
        if self._unit != 1:
            unit = converted(self._unit, self.ring, field)
            self.mu = [converted(x * unit**k, field, self.ring) for k, x in enumerate(self.mu)]

    @cached_property
    def step(self) -> Any:
        """A number of whose powers the denominators of the μ_k are divisors; in a ring L."""
        if self.kind == "rational":
            return math.lcm(*(x.denominator for x in self.mu))
        return self.ring and self.ring.convert(self._unit)

    @cached_property
    def denominators(self) -> tuple[int, ...]:
        """Those of b by number of nodes."""
        skeletons = (1, *(x.denominator for x in self.mu[:-1]))  # of the term with k + 1 factors b
        found = denominators.solved(skeletons, (1,) * len(skeletons), 1)
        # with all powers of two of the scaling, residues modulo 2^64 are combined with those modulo primes
        return tuple(math.lcm(d, 2 ** self.integers.twos_of(max(n, 1), field=True)) for n, d in enumerate(found))

    @cached_property
    def integers(self) -> Wrapped:
        """The arithmetic modulo 2^64: fields carry 2^(c(n−1)) with 2^(ck) μ_k odd over odd, or even."""
        needed = (-(-twos(x.denominator) // k) for k, x in enumerate(self.mu) if k)
        return wrapped_stages(0, max(1, *needed) - 1)

    def load(self, basis: Basis[Any], arithmetic: Exact, *, field: bool) -> Any:
        """The field f: 1 at single nodes."""
        values = arithmetic.zeros(len(basis))
        values[: basis.colors] = arithmetic.vector([Fraction(1)] * basis.colors)
        return values

    def logarithm(self, basis: Basis[Any]) -> Values:
        """The modified equation."""
        sizes = (Fraction(0), Fraction(1), *map(abs, self.mu[1:])) if self.kind == "rational" else ()
        node = (ONE, ONE, *[0] * (basis.max_order - 1))

        def expression(arithmetic: Exact, target: Any) -> Any:
            weights = [-x * arithmetic.doubling(j, field=True) for j, x in enumerate((0, *self.mu[:-1]))]
            found = recursions.logarithm(target(field=True), basis, arithmetic, arithmetic.factors(weights))
            if self._unit == 1:
                return found
            unit = arithmetic.number(self._unit)  # values carry L^(n−1) so far
            return [unit * x for x in found]

        def bound(known: Bound) -> Bound:
            return bounds.logarithm(basis.growth, node, known, sizes)

        operation = Operation(
            expression,
            bound,
            lambda n, _: self.denominators[n],
            lambda *_: math.lcm(*self.denominators),
            field=True,
            integers=self.integers if self.kind == "rational" else None,
        )
        return domains.apply(basis, [self], operation)

    def series(self, basis: Basis[Any]) -> Values:
        """The series Φ = exp b."""
        return lie.exponential(self.logarithm(basis))


def _moment(coefficients: list[Any], k: int, number: Any) -> Any:
    """Σ_j c_j j^k / k!, the coefficient of x^k in Σ c_j e^(jx)."""
    terms = (x * number(Fraction(j**k, math.factorial(k))) for j, x in enumerate(coefficients))
    return sum(terms, number(Fraction(0)))
