"""Antipodes: inverses of the identity under convolution; they give the series of inverse maps."""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from math import factorial, prod
from typing import Any

from trees.counting import MOST_NODES
from trees.errors import TreeError
from trees.hopf.coproducts import grossman_larson_coproduct, multiplicative, substitution_coproduct
from trees.hopf.forests import Forest, rooted
from trees.hopf.products import graft
from trees.hopf.sums import FormalSum, Summand, as_sum
from trees.hopf.terms import KEPT, Terms, add_terms, check_work, fold, multiply_terms
from trees.tree import Tree

_NONE = Forest()


def antipode(x: Summand) -> FormalSum:
    """The antipode of the Connes–Kreimer Hopf algebra.

    S(τ) = Σ (−1)^k τ₁ · … · τ_k over all sets of edges whose deletion leaves the k parts τ₁, …, τ_k. The value of S(τ)
    for a series a is that of a.inverse() at τ. A tree with n nodes has 2^(n−1) terms, counted with multiplicity.

    Args:
        x: A tree, a forest, a text for one, or a sum of forests; of any colours.

    Returns:
        A sum of forests.

    Raises:
        TreeError: If x is none of these, or there are too many terms.

    Example:
        >>> antipode("[τ,τ]")
        -τ·τ·τ + 2 τ·[τ] - [τ,τ]

    References:
        Connes, Kreimer (1998), doi:10.1007/s002200050499.
    """
    return multiplicative(x, _signed_partitions, 1)


@lru_cache(maxsize=KEPT)
def _signed_partitions(tree: Tree) -> FormalSum:
    """As `_partitions` in `trees.hopf.coproducts`, without the skeleton, with a sign for each part."""

    def lift(subtree: Tree, partitions: Terms) -> Terms:
        lifted: dict[Any, Any] = {}
        for (inner, parts), count in partitions.items():
            own = rooted(inner, subtree.color)
            lifted[own, parts] = count
            complete = (_NONE, parts * own)
            lifted[complete] = lifted.get(complete, 0) - count
        return lifted

    lifted = fold(tree, {(_NONE, _NONE): 1}, lift)
    return FormalSum.from_terms({(parts,): count for (own, parts), count in lifted.items() if not own})


def substitution_antipode(x: Summand) -> FormalSum:
    """The antipode of the Hopf algebra of substitution, in which the single node of each colour is the unit ∅.

    The bialgebra of `substitution_coproduct` has no antipode, since a single node has the coproduct τ⊗τ. Following
    Calaque, Ebrahimi-Fard and Manchon, single nodes of all colours are identified with ∅, so none occurs in the result.
    The value of S(τ) for a field b with coefficient 1 of all single nodes is that of its inverse c for ★, with
    b ★ c = c ★ b = f. The work grows two- to threefold with each node; trees of more than 60 nodes are refused.

    Args:
        x: A tree, a forest, a text for one, or a sum of forests; of any colours.

    Returns:
        A sum of forests without single nodes.

    Raises:
        TreeError: If x is none of these, or there are too many terms.

    Example:
        >>> substitution_antipode("[[τ]]"), substitution_antipode("τ")
        (-[[τ]] + 2 [τ]·[τ], ∅)

    References:
        Calaque, Ebrahimi-Fard, Manchon (2011), doi:10.1016/j.aam.2009.08.003, section 4.
    """
    return multiplicative(x, _substitution_inverse, 1)


@lru_cache(maxsize=KEPT)
def _substitution_inverse(tree: Tree) -> FormalSum:
    """S(τ) = −Σ parts · S(skeleton) over all skeletons with fewer nodes than τ."""
    if tree.order > MOST_NODES:
        raise TreeError(f"x must have trees of at most {MOST_NODES} nodes, but has one of {tree.order}")
    if tree.order == 1:
        return FormalSum(_NONE)
    contractions: dict[Tree, dict[Any, Any]] = {}  # the parts of each skeleton, without single nodes
    for (parts, skeleton), count in substitution_coproduct(tree).terms.items():
        if skeleton.order < tree.order:
            larger = Forest.from_sorted(tuple([part for part in parts if part.order > 1]))
            add_terms(contractions.setdefault(skeleton.trees[0], {}), {(larger,): count})
    total: dict[Any, Any] = {}
    for skeleton, parts in contractions.items():
        add_terms(total, multiply_terms(parts, _substitution_inverse(skeleton).terms), -1)
    return FormalSum.from_terms(total)


def grossman_larson_antipode(x: Summand) -> FormalSum:
    """The antipode of the Grossman–Larson Hopf algebra, dual to that of Connes and Kreimer.

    S(τ₁ · … · τ_k) is (−1)^k times the sum of all forests obtained by attaching some of the k trees to nodes of others,
    in (n+1)^(k−1) ways for n nodes in total.

    Args:
        x: A tree, a forest, a text for one, or a sum of forests; of any colours.

    Returns:
        A sum of forests.

    Raises:
        TreeError: If x is none of these, or there are too many ways.

    Example:
        >>> grossman_larson_antipode("τ"), grossman_larson_antipode("τ·[τ]")
        (-τ, τ·[τ] + 2 [[τ]] + [τ,τ])

    References:
        Grossman, Larson (1989), doi:10.1016/0021-8693(89)90328-1.
    """
    return as_sum(x, "x").map(lambda forest: (-1) ** len(forest) * _assemblies(forest))


@lru_cache(maxsize=KEPT)
def _assemblies(forest: Forest) -> FormalSum:
    """The sum of all forests obtained by attaching some of the trees to nodes of others.

    The first tree forms one tree with some of the others; the remaining ones are independent of it.
    """
    if not forest:
        return FormalSum(forest)
    ways = (forest.order + 1) ** (len(forest) - 1)
    check_work(ways // prod(factorial(copies) for copies in Counter(forest).values()))  # at most this many are equal
    first, rest = forest.trees[0], Forest.from_sorted(forest.trees[1:])
    total: dict[Any, Any] = {}
    for (joined, others), count in grossman_larson_coproduct(rest).terms.items():
        add_terms(total, multiply_terms(_connected(joined * first).terms, _assemblies(others).terms), count)
    return FormalSum.from_terms(total)


@lru_cache(maxsize=KEPT)
def _connected(forest: Forest) -> FormalSum:
    """The assemblies that are one tree: each tree in turn, with assemblies of all others attached."""
    total: dict[Any, Any] = {}
    for root, copies in Counter(forest).items():
        at = forest.trees.index(root)
        others = Forest.from_sorted(forest.trees[:at] + forest.trees[at + 1 :])
        add_terms(total, graft(_assemblies(others), root).terms, copies)
    return FormalSum.from_terms(total)
