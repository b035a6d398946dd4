"""Grafting products: the pre-Lie product, the Grossman–Larson product, and the Lie bracket of trees.

The first operand is always attached to the second, x ▷ y: F(x ▷ y) is the derivative of F(y) in the direction F(x), and
the trees of the first operand are the branches on the left of the Connes–Kreimer coproduct.
"""

from __future__ import annotations

from collections import Counter
from functools import lru_cache, reduce
from itertools import product
from math import comb, prod
from typing import Any

from trees.hopf.forests import Forest, rooted
from trees.hopf.sums import KEPT, FormalSum, Summand, Terms, Times, add_terms, as_sum, check_work, fold
from trees.tree import Tree


def graft(x: Summand, y: Summand) -> FormalSum:
    """Grafting x ▷ y: the sum over the nodes of y of y with x attached to the node by a new edge.

    On trees this is the free pre-Lie product: (x ▷ y) ▷ z − x ▷ (y ▷ z) is symmetric in x and y. F(x ▷ y) is the
    derivative of F(y) in the direction F(x). The k trees of a forest x are attached to the n nodes of y in all n^k ways
    (symmetric brace).

    Args:
        x: The attached operand: a tree, a forest, a text for one, or a sum of forests; of any colours.
        y: The other operand, likewise.

    Returns:
        A sum of forests with as many trees as y.

    Raises:
        TreeError: If x or y is none of these, or there are too many ways.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.graft("[τ]", "τ"), bs.hopf.graft("τ", "[τ]"), bs.hopf.graft("q", "p[p]")
        ([[τ]], [[τ]] + [τ,τ], p[p[q]] + p[p,q])

    References:
        Chapoton, Livernet (2001), doi:10.1155/S1073792801000198. In the package pybs, ``graft(base, other)`` attaches
        the other to the base: it is graft(other, base) here.
    """
    return _bilinear(x, y, beside=False)


def grossman_larson(x: Summand, y: Summand) -> FormalSum:
    """The Grossman–Larson product x ∗ y: each tree of x is attached to a node of y or placed beside y.

    For trees as vector fields and forests as differential operators, it is the composition of operators, first y, then
    x. With ⟨φ, φ⟩ = σ(φ) it is dual to the Connes–Kreimer coproduct: the coefficient of z in x ∗ y times
    σ(z) is that of x⊗y in Δ(z) times σ(x) σ(y). For x of k trees and y of n nodes there are (n+1)^k ways.

    The arguments and the errors are those of `graft`. The product is associative, and ∅ is its unit.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.grossman_larson("τ", "[τ]"), bs.hopf.grossman_larson("τ^2", "τ")
        (τ·[τ] + [[τ]] + [τ,τ], τ·τ·τ + 2 τ·[τ] + [τ,τ])

    References:
        Grossman, Larson (1989), doi:10.1016/0021-8693(89)90328-1; Oudom, Guin (2008), doi:10.1017/is008001011jkt037.
        Hoffman (2007) multiplies rooted trees: B₊(x) ∘ B₊(y) there is B₊(x ∗ y). In the package kauri,
        ``gl.product(s, t)`` attaches t to s: it is B₊(y ∗ x) for s = B₊(x), t = B₊(y).
    """
    return _bilinear(x, y, beside=True)


def tree_commutator(x: Summand, y: Summand) -> FormalSum:
    """The Lie bracket x ∗ y − y ∗ x; for trees it is [u, v] = u ▷ v − v ▷ u.

    F([u, v]) is the Lie bracket of the vector fields F(u) and F(v): the derivative of F(v) in the direction F(u) minus
    that of F(u) in the direction F(v).

    The arguments and the errors are those of `graft`; of trees, the result is a sum of trees.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.tree_commutator("τ", "[τ]")
        [τ,τ]

    References:
        HLW, section III.5.1 and lemma IX.9.1. The function of the same purpose in the package pybs has the other sign.
    """
    return grossman_larson(x, y) - grossman_larson(y, x)


def _bilinear(x: Summand, y: Summand, *, beside: bool) -> FormalSum:
    first, second = as_sum(x, "x"), as_sum(y, "y")
    check_work(len(first) * len(second))
    total: dict[Any, Any] = {}
    for (attached,), a in first.terms.items():
        for (base,), b in second.terms.items():
            add_terms(total, _graftings(attached, base, beside).terms, a * b)
    return FormalSum.from_terms(total)


@lru_cache(maxsize=KEPT)
def _graftings(attached: Forest, base: Forest, beside: bool) -> FormalSum:
    """The sum over all ways to attach the trees of one forest to the nodes of another, or place them beside it.

    The value of a subtree of the base is a sum over pairs of the numbers of copies attached of each different tree,
    and the result. m copies are distributed to two parts in binom(m, k) ways.
    """
    if base.order == 1 and not beside:
        return FormalSum(rooted(attached, base.trees[0].color))
    kinds = Counter(attached)
    wanted = tuple(kinds.values())
    none = (0,) * len(kinds)
    check_work(prod(copies + 1 for copies in wanted))
    unit = {}
    for received in product(*(range(copies + 1) for copies in wanted)):
        trees = [tree for tree, copies in zip(kinds, received, strict=True) for _ in range(copies)]
        unit[received, Forest.from_sorted(tuple(trees))] = 1

    def multiply(left: Terms, right: Terms) -> Terms:
        total: dict[Any, Any] = {}
        for (a, first), m in left.items():
            for (b, second), n in right.items():
                received = tuple([i + j for i, j in zip(a, b, strict=True)])
                if all(i <= j for i, j in zip(received, wanted, strict=True)):
                    ways = m * n
                    for i, j in zip(received, a, strict=True):
                        ways *= comb(i, j)
                    key = received, first * second
                    total[key] = total.get(key, 0) + ways
        return total

    def lift(subtree: Tree, terms: Terms) -> Terms:
        return {(received, rooted(forest, subtree.color)): ways for (received, forest), ways in terms.items()}

    values = (fold(tree, unit, lift, multiply) for tree in base)
    total = reduce(Times(base.order, multiply), values, unit if beside else {(none, Forest()): 1})
    return FormalSum.from_terms({(forest,): ways for (received, forest), ways in total.items() if received == wanted})
