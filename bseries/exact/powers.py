"""Series of methods, their logarithms and powers, without a single cut.

a^k is the series of k steps. At a tree τ with n nodes it is a polynomial in k of degree at most n that vanishes at
k = 0: a^k = Σ_j binom(k, j) (a − ε)^j, and (a − ε)^j is 0 at trees with fewer than j nodes. So it is known from its
values at k = 1 … n. Its derivative at k = 0 is the logarithm,

    (log a)(τ) = Σ_{k=1..n} c_k a^k(τ),    c_k = (−1)^{k+1} binom(n, k) / k,

and its value at any s is a^s(τ), by Lagrange's formula. k steps are one composite tableau, whose stage vectors are
products along left ∘ right (`bseries.exact.power_kernels`): n · s numbers for a tree and a method with s stages, where
Lie derivatives take n² numbers and a table of all cuts.

If the entries have the common denominator L, then a^k(τ) L^n is an integer; so is the sum, once the weights are
multiplied by their common denominator W_n. Integers are computed as they are for few trees, else from residues.

For floats the sum is unstable, since its weights alternate and grow like 2^n; their logarithms and powers are sums of
Lie derivatives, as are those of series that come from no method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exact import bounds, power_kernels
from bseries.exact.arithmetic import Exact, float_lists, floats, integers, prime_field, wrapped_integers
from bseries.exact.rationals import RationalValues, power_unit, primorial
from bseries.exact.recursions import entries
from bseries.exact.residues import exact_integers
from foundation.lowering.flat_kernels import machine_code_pays

if TYPE_CHECKING:
    from bseries.exact.recursions import Stages
    from bseries.exact.residues import Words
    from trees.table import TreeTable


class PowerWeights(NamedTuple):
    """Weights w_k of a sum Σ_k w_k a^k, which depend on the number n of nodes.

    Attributes:
        numerators: Entry [n][k−1] is the integer w_k W_n.
        denominators: Entry n is W_n.
        unit: A number of which W_n divides the n-th power.
    """

    numerators: tuple[tuple[int, ...], ...]
    denominators: tuple[int, ...]
    unit: int

    @property
    def steps(self) -> int:
        """The number of powers."""
        return max(map(len, self.numerators))

    @property
    def values(self) -> tuple[tuple[Fraction, ...], ...]:
        """Entry [n][k−1] is w_k."""
        rows = zip(self.numerators, self.denominators, strict=True)
        return tuple(tuple(Fraction(w, d) for w in row) for row, d in rows)


def _weights(order: int, weight: Callable[[int, int], Fraction], unit: int) -> PowerWeights:
    rows = [[weight(n, k) for k in range(1, n + 1)] for n in range(order + 1)]
    denominators = [math.lcm(*(w.denominator for w in row)) for row in rows]
    whole = [tuple(int(w * d) for w in row) for row, d in zip(rows, denominators, strict=True)]
    return PowerWeights(tuple(whole), tuple(denominators), unit)


@lru_cache(maxsize=64)
def one_step(order: int) -> PowerWeights:
    """The series itself."""
    return PowerWeights(((), *[(1,)] * order), (1,) * (order + 1), 1)


@lru_cache(maxsize=64)
def logarithm(order: int) -> PowerWeights:
    """The derivative at 0 of the polynomial in k."""
    return _weights(order, lambda n, k: Fraction((-1) ** (k + 1) * math.comb(n, k), k), primorial(order))


@lru_cache(maxsize=64)
def power(order: int, s: Fraction) -> PowerWeights:
    """The polynomial in k at s, by Lagrange's formula: Σ_k binom(s, k) binom(s−k−1, n−k) (−1)^(n−k) a^k."""
    return _weights(order, partial(_lagrange, s), power_unit(order, s))


def _lagrange(s: Fraction, n: int, k: int) -> Fraction:
    """The polynomial of degree n that is 1 at k and 0 at the other numbers from 0 to n, at s."""
    return math.prod((Fraction(s - j) / (k - j) for j in range(n + 1) if j != k), start=Fraction(1))


def rational_sum(
    table: TreeTable, stages: Stages, step: int, sums: tuple[Fraction, Fraction], weights: PowerWeights
) -> RationalValues:
    """Σ_k w_k a^k for a method with rational entries, of which `step` is a common denominator.

    `sums` bound those of |b_i|, and of |a_ij| over j.
    """
    denominators = _denominators(weights, step)
    if machine_code_pays(weights.steps * stages.size * len(table)):
        numerators: Any = exact_integers(
            partial(_residues, table, stages, step, weights),
            table.offsets,
            lambda largest: _bits(weights, step, sums, tuple(largest)),
            [d.bit_length() for d in denominators[1:]],
        )
    else:
        numerators = sum_of_powers(table, stages, step, weights, integers())
    return RationalValues(table, numerators, denominators, step * weights.unit)


def float_series(table: TreeTable, stages: Stages) -> Any:
    """The series of a method in floats: a list for few trees, else an array."""
    pays = machine_code_pays(stages.size * len(table))
    return sum_of_powers(table, stages, 1, one_step(table.max_order), floats() if pays else float_lists())


def _residues(table: TreeTable, stages: Stages, step: int, weights: PowerWeights, modulus: int) -> Words:
    """The integers modulo a prime, or for 0 modulo 2^64."""
    return sum_of_powers(table, stages, step, weights, prime_field(modulus) if modulus else wrapped_integers(0))


@lru_cache(maxsize=256)
def _denominators(weights: PowerWeights, step: int) -> tuple[int, ...]:
    return tuple(w * step**n for n, w in enumerate(weights.denominators))


@lru_cache(maxsize=256)
def _bits(weights: PowerWeights, step: int, sums: tuple[Fraction, Fraction], largest: tuple[int, ...]) -> Sequence[int]:
    """Numbers of bits of the numerators for n = 1, 2, … nodes; `largest` are the largest of the first orders."""
    denominators = _denominators(weights, step)
    order = len(denominators) - 1
    if weights == logarithm(order):
        known = bounds.of_numerators(largest, denominators)
        bound = bounds.logarithm(bounds.geometric(order, *sums), known)
    else:
        bound = bounds.sum_of_powers(weights.values, *sums)
    return bounds.numerator_bits(bound, denominators)


def sum_of_powers(table: TreeTable, stages: Stages, step: Any, weights: PowerWeights, arithmetic: Exact) -> Any:
    """Σ_k w_k a^k W_n in an arithmetic, for the method whose entries are those of `stages` times `step`."""
    size, zeros, kernel = stages.size, arithmetic.zeros, arithmetic.run(power_kernels.sum_of_powers)
    stride = max(table.offsets[-2], table.colors)
    total = zeros(len(table))
    _, _, left, right = arithmetic.columns(table)
    kernel(
        table.max_order, table.colors, arithmetic.indices(table.block), left, right, weights.steps,
        *_vectors(weights, arithmetic), *entries(stages, arithmetic, (step, step)), arithmetic.modulus, stride,
        zeros(size * stride), zeros(size * stride), zeros(stride), zeros(stages.longest**2), total,
    )  # fmt: skip
    return total


@lru_cache(maxsize=256)
def _vectors(weights: PowerWeights, arithmetic: Exact) -> tuple[Any, Any]:
    """The weights of the powers and of the steps, step by step."""
    steps, rows = weights.steps, weights.numerators
    powers = [row[k] if k < len(row) else 0 for k in range(steps) for row in rows]
    tails = [sum(row[k:]) for k in range(steps) for row in rows]
    return arithmetic.vector(powers), arithmetic.vector(tails)
