"""Bounds on the coefficients of a series by number of nodes alone, for proofs that an integer is known from residues.

A bound is a list of integers, entry n a bound on 2^FINE · |value| at all elements with n nodes (entry 0 is that of the
empty one, or unused). How many terms a sum has is the basis' own statement (`trees.basis.Growth`). All are sums and
products of bounds, rounded up, and cost a few hundred operations, whatever the number of elements.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from trees.basis import Growth

FINE = 32
ONE = 1 << FINE

Bound = tuple[int, ...]


def scaled(value: Fraction | int) -> int:
    """A nonnegative number times 2^FINE, rounded up."""
    return -(-(value.numerator << FINE) // value.denominator)


def of_numerators(largest: Sequence[int], denominators: Sequence[int]) -> Bound:
    """The bound given by the largest numerators with 1, 2, … nodes, over these denominators."""
    return (ONE, *(scaled(Fraction(x, d)) for x, d in zip(largest, denominators[1:], strict=False)))


def numerator_bits(bound: Bound, denominators: Sequence[int]) -> list[int]:
    """Numbers of bits of the numerators with 1, 2, … nodes, over these denominators."""
    return [((x * d >> FINE) + 1).bit_length() for x, d in zip(bound[1:], denominators[1:], strict=True)]


def product(x: int, y: int) -> int:
    """A bound on a product."""
    return (x * y >> FINE) + 1


def products(flow: Sequence[int]) -> Bound:
    """The largest products of values at elements with n nodes in all."""
    found = [ONE]
    for n in range(1, len(flow)):
        found.append(max(product(flow[k], found[n - k]) for k in range(1, n + 1)))
    return tuple(found)


def sum_of_powers(weights: Sequence[Sequence[Fraction]], flow: Bound) -> Bound:
    """Σ_k weights[n][k−1] a^k. In a^k each node belongs to one of k steps, and the nodes of a step form trees."""
    sizes = (sum((abs(w) * k**n for k, w in enumerate(row, 1)), Fraction(0)) for n, row in enumerate(weights))
    return tuple(product(scaled(size), x) for size, x in zip(sizes, products(flow), strict=True))


@lru_cache(maxsize=256)
def logarithm(growth: Growth, flow: Bound, known: Bound = (ONE,), weights: tuple[Fraction, ...] = ()) -> Bound:
    """b = log a, which is a − Σ_{j≥2} ∂_b^{j−1} b / j!; `known` bounds |b| at the smallest trees more sharply.

    `weights` may take the place of 1/j!, j = 0, 1, … The bound is large without what is known, and close to the largest
    value with it.
    """
    field, derivatives = list(known), [[0]]
    for n in range(1, len(flow)):
        total = flow[n] + _longer(growth, derivatives, field, n, weights)
        if n == len(field):
            field.append(total)
        derivatives[0].append(field[n])
    return tuple(field)


@lru_cache(maxsize=256)
def exponential(growth: Growth, field: Bound) -> Bound:
    """exp b = Σ_j ∂_b^{j−1} b / j!."""
    derivatives, found = [[0]], [ONE]
    for n in range(1, len(field)):
        found.append(field[n] + _longer(growth, derivatives, field, n))
        derivatives[0].append(field[n])
    return tuple(found)


def _longer(
    growth: Growth, derivatives: list[list[int]], field: Sequence[int], n: int, weights: Sequence[Fraction] = ()
) -> int:
    """Σ_{j≥2} ∂_b^{j−1} b / j! at n nodes, whose terms are added to the derivatives for j = 1, 2, …"""
    total = 0
    for j in range(2, n + 1):
        if len(derivatives) < j:
            derivatives.append([0] * n)
        derivatives[j - 1].append(derivative(growth, field, derivatives[j - 2], n))
        weight = abs(weights[j]) if weights else Fraction(1, math.factorial(j))
        total += derivatives[j - 1][n] * weight.numerator // weight.denominator + 1
    return total


def derivative(growth: Growth, b: Sequence[int], c: Sequence[int], n: int) -> int:
    """Σ c(trunk) b(branch) over the cuts of an element with n nodes, the largest products as often as there may be."""
    total, left = 0, growth.cuts(n)
    for product, k in sorted(((c[n - k] * b[k], k) for k in range(1, n)), reverse=True):
        taken = min(left, growth.branches(n, k))
        total, left = total + taken * product, left - taken
    return (total >> FINE) + 1


@lru_cache(maxsize=256)
def composition(growth: Growth, a: Bound, c: Bound) -> Bound:
    """First a, then c: products of c at what remains and of a at the branches that are cut off."""
    cut_off = products(a)
    largest = (max(product(c[m], cut_off[n - m]) for m in range(n + 1)) for n in range(len(a)))
    return tuple(x * growth.products(n) for n, x in enumerate(largest))


def substitution(skeletons: Bound, parts: Sequence[int], n: int, fewest: int = 1) -> int:
    """Σ a(skeleton) Π b(parts) over the binom(n−1, m−1) partitions of a tree with n nodes into m ≥ `fewest` parts."""
    total, largest = 0, [ONE] + [0] * n  # the largest products of m parts with 0, 1, … nodes in all
    for m in range(1, n + 1):
        largest = [
            max((product(parts[k], largest[i - k]) for k in range(1, i + 1) if k < len(parts)), default=0)
            for i in range(n + 1)
        ]
        if m >= fewest:
            total += math.comb(n - 1, m - 1) * product(skeletons[m], largest[n])
    return total


@lru_cache(maxsize=256)
def substituted(skeletons: Bound, parts: Bound) -> Bound:
    """b ★ a."""
    return (ONE, *(substitution(skeletons, parts, n) for n in range(1, len(parts))))


@lru_cache(maxsize=256)
def solved(skeletons: Bound, target: Bound, inverse: Fraction, known: Bound = (ONE,)) -> Bound:
    """The b with b ★ a = c, where |1/a(•)| ≤ inverse: a(•) b(τ) = c(τ) − Σ over partitions with two or more parts."""
    found = list(known)
    factor = scaled(inverse)
    for n in range(len(found), len(target)):
        found.append(product(factor, target[n] + substitution(skeletons, found, n, 2)))
    return tuple(found)
