"""Denominators of coefficients by number of nodes, for proofs that numerators are integers.

A denominator for n nodes is some D_n such that D_n · b(τ) is an integer for every tree τ with n nodes; D_0 = 1. Those
of a result follow from those of the operands.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise

from bseries.exact import recursions
from bseries.exact.recursions import Stages
from trees.table import TreeTable


@lru_cache(maxsize=256)
def of_stages(stages: Stages, order: int) -> tuple[int, ...]:
    """Denominators of the elementary weights of a method with rational entries.

    They follow the recursion g(u∘v) = g(u) G(v), G(v) = A g(v), a(τ) = b · g(τ), block by block: D of a product is the
    product, and D of A g is that of entries times that of g. For the smallest trees they are those of the values, since
    simplifying assumptions give sums far smaller denominators than their terms have. For Dormand and Prince's method
    and 12 nodes D has 124 bits; the power L^12 of the common denominator of all entries has 408.
    """
    blocks = [range(*ends) for ends in pairwise(stages.ends)]
    table = TreeTable(min(order, 3), len(stages.b) // stages.size)
    weights, vectors = recursions.elementary_weights(table, stages)
    outer = [1, *(_common(weights[t] for t in table.ids(n)) for n in range(1, table.max_order + 1))]
    inner = [
        [_common(vectors[i][t] for i in block for t in table.ids(n)) for block in blocks]
        for n in range(1, table.max_order)
    ]
    into_blocks, into_weights = _factors(stages)
    products = [[1] * len(blocks)]
    for n in range(2, order + 1):
        if len(inner) < n - 1:
            inner.append([_lcm(factors, products[-1]) for factors in into_blocks])
        parts = range(n - 1)
        products.append([math.lcm(*(products[n - 2 - k][e] * inner[k][e] for k in parts)) for e in range(len(blocks))])
        if len(outer) == n:
            outer.append(_lcm(into_weights, products[-1]))
    return tuple(outer)


def _factors(stages: Stages) -> tuple[list[dict[int, int]], dict[int, int]]:
    """Denominators of the entries between blocks: for each block of rows, and for the weights, by block of columns."""
    block = [e for e, size in enumerate(stages.sizes) for _ in range(size)]
    rows, weights = [dict[int, int]() for _ in stages.sizes], dict[int, int]()
    of_rows = ((rows[block[k // stages.size % stages.size]], k, x) for k, x in enumerate(stages.a) if x)
    for factors, k, entry in (*of_rows, *((weights, k, x) for k, x in enumerate(stages.b) if x)):
        column = block[k % stages.size]
        factors[column] = math.lcm(factors.get(column, 1), entry.denominator)
    return rows, weights


def _lcm(factors: dict[int, int], denominators: Sequence[int]) -> int:
    return math.lcm(*(factor * denominators[at] for at, factor in factors.items()))


def _common(values: Iterable[Fraction]) -> int:
    return math.lcm(*(value.denominator for value in values))


def of_powers(flow: Sequence[int]) -> tuple[int, ...]:
    """Denominators of the powers of a flow: those of products of values at trees with n nodes in all."""
    found = [1]
    for n in range(1, len(flow)):
        found.append(math.lcm(*(found[n - k] * flow[k] for k in range(1, n + 1))))
    return tuple(found)


@lru_cache(maxsize=1024)
def of_logarithm(n: int, step: int) -> int:
    """That of log a for n nodes, as log a = Σ (−1)^{j+1} (a−ε)^j / j with j ≤ n (minimal for n ≤ 12)."""
    return math.lcm(*range(1, n + 1)) * step**n


def wider_step(order: int, step: int) -> int:
    """An L for denominators that divide n! step^n."""
    return step * primorial(order)


def power_unit(order: int, s: Fraction) -> int:
    """A number of whose n-th power the denominator of binom(s, k) is a divisor, for k ≤ n ≤ order.

    With s = p/q it divides q^k times r^(k−1) for every prime r that divides q (from k!).
    """
    q = s.denominator
    return q * math.prod(r for r in primes_up_to(order) if q % r == 0)


@lru_cache(maxsize=64)
def substituted(skeletons: tuple[int, ...], parts: tuple[int, ...]) -> tuple[int, ...]:
    """Denominators of b ★ a from those of a (skeletons) and of b (parts); lists begin with one for ∅.

    (b ★ a)(τ) = Σ over the partitions of τ of a(skeleton) Π b(parts). If D^a_m · a is an integer on trees with m nodes
    and D^b_n · b on trees with n nodes, then the least common multiple of D^a_m D^b_{n_1} … D^b_{n_m} over all m and
    n_1 + … + n_m = n is a common denominator on trees with n nodes.
    """
    products = [[1]]
    found = [1]
    for n in range(1, len(skeletons)):
        _extend(products, n, parts)
        found.append(math.lcm(*(skeletons[m] * products[m][n] for m in range(1, n + 1))))
    return tuple(found)


@lru_cache(maxsize=64)
def solved(skeletons: tuple[int, ...], targets: tuple[int, ...], divisor: int) -> tuple[int, ...]:
    """Denominators of the b with b ★ a = c from those of a and c; `divisor` is the numerator of a(•).

    a(•) b(τ) = c(τ) − Σ over the partitions with two or more parts.
    """
    products: list[list[int]] = [[1]]
    found = [1]
    for n in range(1, len(skeletons)):
        found.append(0)  # excludes b(τ) itself
        _extend(products, n, found)
        several = (skeletons[m] * products[m][n] for m in range(2, n + 1))
        found[n] = divisor * math.lcm(targets[n], *several)
        products[1][n] = found[n]
    return tuple(found)


def _extend(products: list[list[int]], n: int, parts: Sequence[int]) -> None:
    """Fill in products[m][n], the common denominator of m parts with n nodes in all (0: impossible)."""
    products[0].append(0)
    products.append([0] * n)
    for m in range(1, n + 1):
        factors = (products[m - 1][n - k] * parts[k] for k in range(1, n + 1))
        products[m].append(math.lcm(*filter(None, factors)))


def smallest_step(denominators: Sequence[int], step: int) -> int:
    """A small L with denominators[n] dividing L^n: `step`, which has that property, without needless small primes."""
    for prime in (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37):
        while step % prime == 0:
            smaller = step // prime
            if any(smaller**n % d for n, d in enumerate(denominators)):
                break
            step = smaller
    return step


@lru_cache(maxsize=64)
def primes_up_to(n: int) -> tuple[int, ...]:
    """The primes up to n."""
    return tuple(p for p in range(2, n + 1) if all(p % d for d in range(2, math.isqrt(p) + 1)))


def primorial(n: int) -> int:
    """Product of the primes up to n."""
    return math.prod(primes_up_to(n))


def twos(number: int) -> int:
    """The exponent of 2 in a number."""
    return (number & -number).bit_length() - 1
