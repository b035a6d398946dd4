"""Denominators of substituted series: what is proved about them before anything is computed.

(b ★ a)(τ) = Σ over the partitions of τ of a(skeleton) Π b(parts). If D^a_m · a is an integer on trees with m nodes and
D^b_n · b on trees with n nodes, a common denominator on trees with n nodes is the least common multiple of
D^a_m D^b_{n_1} … D^b_{n_m} over all m and all n_1 + … + n_m = n. Here lists of denominators begin with one for ∅.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache


@lru_cache(maxsize=64)
def substituted_denominators(skeletons: tuple[int, ...], parts: tuple[int, ...]) -> tuple[int, ...]:
    """Denominators of b ★ a from those of a (skeletons) and of b (parts)."""
    products = [[1]]
    found = [1]
    for n in range(1, len(skeletons)):
        _extend(products, n, parts)
        found.append(math.lcm(*(skeletons[m] * products[m][n] for m in range(1, n + 1))))
    return tuple(found)


@lru_cache(maxsize=64)
def solved_denominators(skeletons: tuple[int, ...], targets: tuple[int, ...], divisor: int) -> tuple[int, ...]:
    """Denominators of the b with b ★ a = c from those of a and c; `divisor` is the numerator of a(•).

    a(•) b(τ) = c(τ) − Σ over the partitions with two or more parts.
    """
    products: list[list[int]] = [[1]]
    found = [1]
    for n in range(1, len(skeletons)):
        found.append(0)  # b(τ) itself is no part of what follows
        _extend(products, n, found)
        several = (skeletons[m] * products[m][n] for m in range(2, n + 1))
        found[n] = divisor * math.lcm(targets[n], *several)
        products[1][n] = found[n]
    return tuple(found)


def _extend(products: list[list[int]], n: int, parts: Sequence[int]) -> None:
    """Enter for n nodes: products[m][n] is the common denominator of m parts with n nodes in all (0: not possible)."""
    products[0].append(0)
    products.append([0] * n)
    for m in range(1, n + 1):
        factors = (products[m - 1][n - k] * parts[k] for k in range(1, n + 1))
        products[m].append(math.lcm(*filter(None, factors)) if n >= m else 0)
