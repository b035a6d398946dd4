"""Series of methods, their logarithms and powers, without a single cut.

a^k is the series of k steps. At a tree τ with n nodes it is a polynomial in k of degree at most n that vanishes at
k = 0: a^k = Σ_j binom(k, j) (a − ε)^j, and (a − ε)^j is 0 at trees with fewer than j nodes. So it is known from its
values at k = 1 … n. Its derivative at k = 0 is the logarithm,

    (log a)(τ) = Σ_{k=1..n} c_k a^k(τ),    c_k = (−1)^{k+1} binom(n, k) / k,

and its value at any s is a^s(τ), by Lagrange's formula. k steps are one composite tableau, whose stage vectors are
products along left ∘ right (`bseries.exact.power_kernels`): n · s numbers for a tree and a method with s stages, where
Lie derivatives take n² numbers and a table of all cuts.

If a^k(τ) has a denominator D_n (`bseries.exact.stage_sizes`), then the sum is whole once the weights are multiplied by
D_n and by their common denominator W_n. Few trees are computed in integers, with L^n for the common denominator L of
the entries; many from residues.

For floats the sum is unstable, since its weights alternate and grow like 2^n; their logarithms and powers are sums of
Lie derivatives, as are those of series that come from no method.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

from bseries.exact import bounds, denominators, recursions, stage_sizes
from bseries.exact.arithmetic import float_lists, floats, integers, prime_field, wrapped_integers
from bseries.exact.denominators import power_unit, primorial
from bseries.exact.rationals import RationalValues, proved
from bseries.exact.residues import WORD
from bseries_base.lowering.flat_kernels import machine_code_pays
from trees.table import TreeTable

if TYPE_CHECKING:
    from bseries.exact.bounds import Bound
    from bseries.exact.recursions import Stages
    from bseries.exact.residues import Words

    Rows = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, eq=False)
class PowerWeights:
    """Weights w_k of a sum Σ_k w_k a^k, which depend on the number n of nodes.

    Attributes:
        numerators: Entry [n][k−1] is the integer w_k W_n.
        denominators: Entry n is W_n.
        unit: A number of which W_n divides the n-th power.
        bound: A bound on the sum, from one on a and one on what is known of the sum at the smallest trees.
    """

    numerators: Rows
    denominators: tuple[int, ...]
    unit: int
    bound: Callable[[Bound, Bound], Bound]

    @property
    def steps(self) -> int:
        """The number of powers."""
        return max(map(len, self.numerators))


def _weights(order: int, weight: Callable[[int, int], Fraction], unit: int) -> PowerWeights:
    rows = [[weight(n, k) for k in range(1, n + 1)] for n in range(order + 1)]
    denominators = [math.lcm(*(w.denominator for w in row)) for row in rows]
    whole = [tuple(int(w * d) for w in row) for row, d in zip(rows, denominators, strict=True)]
    return PowerWeights(tuple(whole), tuple(denominators), unit, lambda flow, _: bounds.sum_of_powers(rows, flow))


@lru_cache(maxsize=64)
def one_step(order: int) -> PowerWeights:
    """The series itself."""
    return PowerWeights(((), *[(1,)] * order), (1,) * (order + 1), 1, lambda flow, known: flow)


@lru_cache(maxsize=64)
def logarithm(order: int) -> PowerWeights:
    """The derivative at 0 of the polynomial in k."""
    made = _weights(order, lambda n, k: Fraction((-1) ** (k + 1) * math.comb(n, k), k), primorial(order))
    return replace(made, bound=partial(bounds.logarithm, TreeTable.growth))


@lru_cache(maxsize=64)
def power(order: int, s: Fraction) -> PowerWeights:
    """The polynomial in k at s, by Lagrange's formula: Σ_k binom(s, k) binom(s−k−1, n−k) (−1)^(n−k) a^k."""
    return _weights(order, partial(_lagrange, s), power_unit(order, s))


def _lagrange(s: Fraction, n: int, k: int) -> Fraction:
    """The polynomial of degree n that is 1 at k and 0 at the other numbers from 0 to n, at s."""
    return math.prod((Fraction(s - j) / (k - j) for j in range(n + 1) if j != k), start=Fraction(1))


def rational_sum(
    table: TreeTable, stages: Stages, step: int, bound: Callable[[int], Bound], weights: PowerWeights
) -> RationalValues:
    """Σ_k w_k a^k for a method with rational entries, of which `step` is a common denominator.

    `bound` gives bounds on a up to an order.
    """
    if not _machine_code_pays(table, stages, weights.steps):
        numerators = recursions.sum_of_powers(table, stages, step, weights.numerators, integers())
        denominators = [w * step**n for n, w in enumerate(weights.denominators)]
        return RationalValues(table, numerators, denominators, step * weights.unit)
    scale, rows, common, wraps = _whole_weights(stages, step, weights)

    def residues(modulus: int) -> Words:
        arithmetic = prime_field(modulus) if modulus else wrapped_integers(0)
        return recursions.sum_of_powers(table, stages, scale, rows, arithmetic)

    bound_of_sum = partial(weights.bound, bound(table.max_order))
    lost = () if wraps else None
    return proved(table, residues, common, step * weights.unit, bound_of_sum, lost=lost, avoid=step)


def _machine_code_pays(table: TreeTable, stages: Stages, steps: int) -> bool:
    """Whether machine code should do the sum: if the work is worth it, or the table is made by it already."""
    return table.compiled or machine_code_pays(steps * stages.size * len(table))


def fits_word(order: int, step: int) -> bool:
    """Whether one run modulo 2^64 is likely to do, so that sharp denominators and bounds need not be found."""
    return step.bit_length() * order < WORD


@lru_cache(maxsize=256)
def _whole_weights(stages: Stages, step: int, weights: PowerWeights) -> tuple[int, Rows, tuple[int, ...], bool]:
    """How the sum becomes whole: a factor on the entries, weights, denominators, and whether 2^64 may be a modulus.

    For that, entries are multiplied by the power of 2 in their common denominator. If that gives trees with n nodes far
    more factors of two than their denominators have, primes alone take fewer runs.
    """
    order = len(weights.denominators) - 1
    if fits_word(order, step):
        flow = tuple(step**n for n in range(order + 1))
    else:
        flow = stage_sizes.denominators(stages, order)
        flow = denominators.of_powers(flow) if weights.steps > 1 else flow
    wraps = denominators.twos(step) * order - denominators.twos(flow[-1]) < WORD // 2
    scale = 2 ** denominators.twos(step) if wraps else 1
    if wraps:
        flow = tuple(d >> denominators.twos(d) for d in flow)
    rows = tuple(tuple(w * d for w in row) for row, d in zip(weights.numerators, flow, strict=True))
    common = tuple(w * d * scale**n for n, (w, d) in enumerate(zip(weights.denominators, flow, strict=True)))
    return scale, rows, common, wraps


def float_series(table: TreeTable, stages: Stages) -> Any:
    """The series of a method in floats: a list for few trees, else an array."""
    rows, pays = one_step(table.max_order).numerators, _machine_code_pays(table, stages, 1)
    return recursions.sum_of_powers(table, stages, 1, rows, floats() if pays else float_lists())
