"""Order conditions checked the slow, obvious way: one nested tuple per tree, one elementary weight per tree.

Written for the tests of the catalogue and independent of `trees` and `bseries`. A tree is ``(colour, (child, …))``.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from itertools import combinations_with_replacement
from math import prod


@cache
def trees(order: int, colours: int = 1) -> tuple:
    """All trees with so many nodes: a root above every multiset of smaller trees."""
    forests = [(root, children) for children in _forests(order - 1, colours) for root in range(colours)]
    return tuple(forests)


@cache
def _forests(nodes: int, colours: int) -> tuple:
    def grow(left: int, largest: int) -> list[tuple]:
        if left == 0:
            return [()]
        return [
            chosen + rest
            for size in range(min(left, largest), 0, -1)
            for count in range(1, left // size + 1)
            for chosen in combinations_with_replacement(trees(size, colours), count)
            for rest in grow(left - size * count, size - 1)
        ]

    return tuple(grow(nodes, nodes))


def nodes(tree: tuple) -> int:
    return 1 + sum(map(nodes, tree[1]))


def density(tree: tuple) -> int:
    return nodes(tree) * prod(map(density, tree[1]))


class Tableau:
    """Stage values as tuples of Fractions; one matrix and one row of weights per colour."""

    def __init__(self, *parts: tuple) -> None:
        self.parts = parts
        self.one = tuple(Fraction(1) for _ in parts[0][1])

    def image(self, colour: int, values: tuple) -> tuple:
        return tuple(sum(a * v for a, v in zip(row, values, strict=True)) for row in self.parts[colour][0])

    def weigh(self, colour: int, values: tuple) -> Fraction:
        return sum((b * v for b, v in zip(self.parts[colour][1], values, strict=True)), Fraction(0))

    def times(self, left: tuple, right: tuple) -> tuple:
        return tuple(x * y for x, y in zip(left, right, strict=True))


class Quotient(Tableau):
    """Stage values as polynomials modulo the monic polynomial whose roots are the nodes."""

    def __init__(self, polynomial: list[Fraction], *parts: tuple) -> None:
        super().__init__(*parts)
        self.polynomial = polynomial
        self.one = tuple(Fraction(k == 0) for k in range(len(polynomial) - 1))

    def times(self, left: tuple, right: tuple) -> tuple:
        stages = len(left)
        product = [Fraction(0)] * (2 * stages - 1)
        for i, x in enumerate(left):
            for j, y in enumerate(right):
                product[i + j] += x * y
        for degree in range(2 * stages - 2, stages - 1, -1):
            top = product[degree]
            for k, p in enumerate(self.polynomial):
                product[degree - stages + k] -= top * p
        return tuple(product[:stages])


def residuals(method: Tableau, order: int, colours: int = 1) -> dict[tuple, Fraction]:
    """Φ(τ) − 1/γ(τ) for every tree of one order."""

    @cache
    def stages_above(tree: tuple) -> tuple:
        value = method.one
        for child in tree[1]:
            value = method.times(value, method.image(child[0], stages_above(child)))
        return value

    return {t: method.weigh(t[0], stages_above(t)) - Fraction(1, density(t)) for t in trees(order, colours)}


def order_of(method: Tableau, colours: int = 1, tolerance: Fraction = Fraction(0), limit: int = 12) -> int:
    """The largest p such that every tree with at most p nodes leaves no residual; p + 1 was seen to fail."""
    for order in range(1, limit + 1):
        if any(abs(r) > tolerance for r in residuals(method, order, colours).values()):
            return order - 1
    raise AssertionError(f"no order up to {limit} failed")
