"""Denominators of coefficients by number of nodes, for proofs that numerators are integers.

A denominator for n nodes is some D_n such that D_n · b(τ) is an integer for every tree τ with n nodes; D_0 = 1. Those
of a result follow from those of the operands.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache


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
