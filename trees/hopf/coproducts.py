"""Coproducts of forests and their counits: admissible cuts, contractions of parts, divisions of forests.

Each coproduct is linear and multiplicative, hence defined by its values on trees.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from trees.hopf.forests import Forest, rooted
from trees.hopf.sums import FormalSum, Summand, as_sum
from trees.hopf.terms import KEPT, Terms, check_work, fold, multiply_terms, work_of
from trees.tree import Tree

_NONE = Forest()


def coproduct(x: Summand) -> FormalSum:
    """The Connes–Kreimer coproduct: all admissible cuts, with the branches left and the trunk with the root right.

    Δ(τ) = τ⊗∅ + Σ branches⊗trunk over all sets of edges without two on one path from the root; the empty set gives ∅⊗τ.
    The value of Δ(τ) for a on the left and c on the right is that of the composition compose(a, c), first a, then c. A
    tree with n nodes has at most 2^(n−1) + 1 terms, counted with multiplicity.

    Args:
        x: A tree, a forest, a text for one, or a sum of forests; of any colours.

    Returns:
        A sum of tensor products of two forests.

    Raises:
        TreeError: If x is none of these, or has too many cuts.

    Example:
        >>> coproduct("[τ,τ]")
        ∅⊗[τ,τ] + 2 τ⊗[τ] + τ·τ⊗τ + [τ,τ]⊗∅

    References:
        Connes, Kreimer (1998), doi:10.1007/s002200050499; for B-series HLW, section III.1.4, and Brouder (2000),
        doi:10.1007/s100529900235. The sides are those of Connes and Kreimer, and of the package kauri.
    """
    return multiplicative(x, _cuts, 2)


@lru_cache(maxsize=KEPT)
def _cuts(tree: Tree) -> FormalSum:
    """Δ(B₊(φ)) = B₊(φ)⊗∅ + (id⊗B₊)Δ(φ)."""

    def lift(subtree: Tree, cuts: Terms) -> Terms:
        lifted = {(branches, rooted(trunks, subtree.color)): count for (branches, trunks), count in cuts.items()}
        lifted[Forest(subtree), _NONE] = 1
        return lifted

    return FormalSum.from_terms(fold(tree, {(_NONE, _NONE): 1}, lift))


def counit(x: Summand) -> Any:
    """The counit of the Connes–Kreimer and of the Grossman–Larson coproduct: the coefficient of the empty forest.

    Args:
        x: A tree, a forest, a text for one, or a sum of forests.

    Returns:
        The coefficient.

    Raises:
        TreeError: If x is none of these.

    Example:
        >>> counit("[τ]"), counit(3 * FormalSum("∅") + Forest("τ"))
        (0, 3)
    """
    return as_sum(x, "x")[_NONE]


def substitution_coproduct(x: Summand) -> FormalSum:
    """The coproduct of Calaque, Ebrahimi-Fard and Manchon: all partitions, with the parts left and the skeleton right.

    Δ(τ) = Σ parts⊗skeleton over all sets of edges: deleting them leaves the parts, contracting all others the skeleton,
    in which the node of a part has the colour of its root. The value of Δ(τ) for a field b on the left and a on the
    right is that of substitute(b, a) = b ★ a. A tree with n nodes has 2^(n−1) terms, counted with multiplicity. Single
    nodes are kept, so this is a bialgebra; see `substitution_antipode`.

    Args:
        x: A tree, a forest, a text for one, or a sum of forests; of any colours.

    Returns:
        A sum of tensor products of two forests.

    Raises:
        TreeError: If x is none of these, or has too many partitions.

    Example:
        >>> substitution_coproduct("[[τ]]")
        τ·τ·τ⊗[[τ]] + 2 τ·[τ]⊗[τ] + [[τ]]⊗τ
        >>> substitution_coproduct("p[q]")
        p·q⊗p[q] + p[q]⊗p

    References:
        Calaque, Ebrahimi-Fard, Manchon (2011), doi:10.1016/j.aam.2009.08.003; for B-series Chartier, Hairer, Vilmart
        (2010), doi:10.1007/s10208-010-9065-1, Tables 1 to 3.
    """
    return multiplicative(x, _partitions, 2)


@lru_cache(maxsize=KEPT)
def _partitions(tree: Tree) -> FormalSum:
    """Partitions as triples for each subtree: root part and skeleton, both without root, and the other parts between.

    If the edge to the parent is kept, root part and skeleton are joined to those of the parent. If it is deleted, both
    are complete, and the first entry is ∅, as at the root of the tree.
    """

    def lift(subtree: Tree, partitions: Terms) -> Terms:
        lifted: dict[Any, Any] = {}
        for (inner, parts, skeletons), count in partitions.items():
            own = rooted(inner, subtree.color)
            lifted[own, parts, skeletons] = count
            complete = (_NONE, parts * own, rooted(skeletons, subtree.color))
            lifted[complete] = lifted.get(complete, 0) + count
        return lifted

    lifted = fold(tree, {(_NONE, _NONE, _NONE): 1}, lift)
    return FormalSum.from_terms({(parts, skeleton): n for (own, parts, skeleton), n in lifted.items() if not own})


def substitution_counit(x: Summand) -> Any:
    """The counit of the substitution coproduct: 1 for a single node of any colour, 0 for larger trees.

    Args:
        x: A tree, a forest, a text for one, or a sum of forests.

    Returns:
        Its value: the sum of the coefficients of ∅ and of the forests of single nodes.

    Raises:
        TreeError: If x is none of these.

    Example:
        >>> substitution_counit("τ"), substitution_counit("τ·[τ]"), substitution_counit("p·q")
        (1, 0, 1)
    """
    return as_sum(x, "x").evaluate(lambda tree: int(tree.order == 1))


def grossman_larson_coproduct(x: Summand) -> FormalSum:
    """The coproduct of the Grossman–Larson algebra: all divisions of a forest into left and right.

    It is multiplicative for both products of forests, the commutative one and `grossman_larson`. For trees as vector
    fields and forests as differential operators, it is the product rule. k different trees have 2^k terms.

    Args:
        x: A tree, a forest, a text for one, or a sum of forests; of any colours.

    Returns:
        A sum of tensor products of two forests.

    Raises:
        TreeError: If x is none of these, or there are too many terms.

    Example:
        >>> grossman_larson_coproduct("τ^2")
        ∅⊗τ·τ + 2 τ⊗τ + τ·τ⊗∅

    References:
        Grossman, Larson (1989), doi:10.1016/0021-8693(89)90328-1; Hoffman (2003), doi:10.1090/S0002-9947-03-03317-8.
    """
    return multiplicative(x, lambda tree: FormalSum({(tree, _NONE): 1, (_NONE, tree): 1}), 2)


def multiplicative(x: Summand, of_tree: Callable[[Tree], FormalSum], factors: int) -> FormalSum:
    """The values of a linear multiplicative map of forests, from its values on trees."""

    def of_forest(forest: Forest) -> FormalSum:
        value: Any = {(_NONE,) * factors: 1}
        work = 0
        for tree in forest:
            image = of_tree(tree).terms
            work += work_of(value, image, forest.order)
            check_work(work)
            value = multiply_terms(value, image)
        return FormalSum.from_terms(value)

    return as_sum(x, "x").map(of_forest)
