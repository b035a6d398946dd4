"""Coproducts of forests, their counits and antipodes: admissible cuts, contractions of parts, divisions of forests.

Each coproduct is linear and multiplicative, hence defined by its values on trees. Antipodes are inverses of the
identity under convolution; they give the series of inverse maps.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from functools import lru_cache, partial, reduce
from math import factorial, prod
from typing import Any

from trees.counting import MOST_NODES
from trees.errors import TreeError
from trees.hopf.forests import Forest, rooted
from trees.hopf.products import graft
from trees.hopf.sums import KEPT, FormalSum, Summand, Terms, Times, add_terms, as_sum, check_work, fold, multiply_terms
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
        >>> import bseries as bs
        >>> bs.hopf.coproduct("[τ,τ]")
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

    The argument and the errors are those of `coproduct`.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.counit("[τ]"), bs.hopf.counit(3 * bs.hopf.FormalSum("∅") + bs.hopf.Forest("τ"))
        (0, 3)
    """
    return as_sum(x, "x")[_NONE]


def substitution_coproduct(x: Summand) -> FormalSum:
    """The coproduct of Calaque, Ebrahimi-Fard and Manchon: all partitions, with the parts left and the skeleton right.

    Δ(τ) = Σ parts⊗skeleton over all sets of edges: deleting them leaves the parts, contracting all others the skeleton,
    in which the node of a part has the colour of its root. The value of Δ(τ) for a field b on the left and a on the
    right is that of substitute(b, a) = b ★ a. A tree with n nodes has 2^(n−1) terms, counted with multiplicity. Single
    nodes are kept, so this is a bialgebra; see `substitution_antipode`.

    The argument, the kind of result and the errors are those of `coproduct`.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.substitution_coproduct("[[τ]]")
        τ·τ·τ⊗[[τ]] + 2 τ·[τ]⊗[τ] + [[τ]]⊗τ
        >>> bs.hopf.substitution_coproduct("p[q]")
        p·q⊗p[q] + p[q]⊗p

    References:
        Calaque, Ebrahimi-Fard, Manchon (2011), doi:10.1016/j.aam.2009.08.003; for B-series Chartier, Hairer, Vilmart
        (2010), doi:10.1007/s10208-010-9065-1, Tables 1 to 3.
    """
    return multiplicative(x, _partitions, 2)


@lru_cache(maxsize=KEPT)
def _partitions(tree: Tree, skeletons: int = 1, sign: int = 1) -> FormalSum:
    """The parts of all partitions, with a sign for each part, tensor the skeletons, if wanted.

    Subtrees have triples: root part and skeleton, both without root, and the other parts between. If the edge to the
    parent is kept, root part and skeleton are joined to those of the parent. If it is deleted, both are complete, and
    the first entry is ∅, as at the root of the tree.
    """

    def lift(subtree: Tree, partitions: Terms) -> Terms:
        lifted: dict[Any, Any] = {}
        for (inner, parts, *skeleton), count in partitions.items():
            own = rooted(inner, subtree.color)
            lifted[own, parts, *skeleton] = count
            complete = (_NONE, parts * own, *[rooted(rest, subtree.color) for rest in skeleton])
            lifted[complete] = lifted.get(complete, 0) + sign * count
        return lifted

    lifted = fold(tree, {(_NONE,) * (2 + skeletons): 1}, lift)
    return FormalSum.from_terms({tuple(factors): n for (own, *factors), n in lifted.items() if not own})


def substitution_counit(x: Summand) -> Any:
    """The counit of the substitution coproduct: 1 for a single node of any colour, 0 for larger trees.

    On a sum it is the sum of the coefficients of ∅ and of the forests of single nodes. The argument and the errors are
    those of `coproduct`.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.substitution_counit("τ"), bs.hopf.substitution_counit("τ·[τ]"), bs.hopf.substitution_counit("p·q")
        (1, 0, 1)
    """
    return as_sum(x, "x").evaluate(lambda tree: int(tree.order == 1))


def grossman_larson_coproduct(x: Summand) -> FormalSum:
    """The coproduct of the Grossman–Larson algebra: all divisions of a forest into left and right.

    It is multiplicative for both products of forests, the commutative one and `grossman_larson`. For trees as vector
    fields and forests as differential operators, it is the product rule. k different trees have 2^k terms.

    The argument, the kind of result and the errors are those of `coproduct`.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.grossman_larson_coproduct("τ^2")
        ∅⊗τ·τ + 2 τ⊗τ + τ·τ⊗∅

    References:
        Grossman, Larson (1989), doi:10.1016/0021-8693(89)90328-1; Hoffman (2003), doi:10.1090/S0002-9947-03-03317-8.
    """
    return multiplicative(x, lambda tree: FormalSum({(tree, _NONE): 1, (_NONE, tree): 1}), 2)


def multiplicative(x: Summand, of_tree: Callable[[Tree], FormalSum], factors: int) -> FormalSum:
    """The values of a linear multiplicative map of forests, from its values on trees."""

    unit: Terms = {(_NONE,) * factors: 1}

    def of_forest(forest: Forest) -> FormalSum:
        images = (of_tree(tree).terms for tree in forest)
        return FormalSum.from_terms(reduce(Times(forest.order), images, unit))

    return as_sum(x, "x").map(of_forest)


def antipode(x: Summand) -> FormalSum:
    """The antipode of the Connes–Kreimer Hopf algebra.

    S(τ) = Σ (−1)^k τ₁ · … · τ_k over all sets of edges whose deletion leaves the k parts τ₁, …, τ_k. The value of S(τ)
    for a series a is that of a.inverse() at τ. A tree with n nodes has 2^(n−1) terms, counted with multiplicity.

    Returns a sum of forests. The argument and the errors are those of `coproduct`.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.antipode("[τ,τ]")
        -τ·τ·τ + 2 τ·[τ] - [τ,τ]

    References:
        Connes, Kreimer (1998), doi:10.1007/s002200050499.
    """
    return multiplicative(x, partial(_partitions, skeletons=0, sign=-1), 1)


def substitution_antipode(x: Summand) -> FormalSum:
    """The antipode of the Hopf algebra of substitution, in which the single node of each colour is the unit ∅.

    The bialgebra of `substitution_coproduct` has no antipode, since a single node has the coproduct τ⊗τ. Following
    Calaque, Ebrahimi-Fard and Manchon, single nodes of all colours are identified with ∅, so none occurs in the result.
    The value of S(τ) for a field b with coefficient 1 of all single nodes is that of its inverse c for ★, with
    b ★ c = c ★ b = f. The work grows two- to threefold with each node; trees of more than 60 nodes are refused.

    Returns a sum of forests without single nodes. The argument and the errors are those of `coproduct`.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.substitution_antipode("[[τ]]"), bs.hopf.substitution_antipode("τ")
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
    coproduct = (
        ((Forest.from_sorted(tuple([part for part in parts if part.order > 1])), skeleton), count)
        for (parts, skeleton), count in _partitions(tree).terms.items()
    )
    return FormalSum.from_terms(convolution_inverse(tree, coproduct, lambda x: _substitution_inverse(x.trees[0]).terms))


def convolution_inverse(
    x: Any,
    coproduct: Iterable[tuple[Any, Any]],
    inverse: Callable[[Any], Terms],
    multiply: Callable[[Terms, Terms], Terms] = multiply_terms,
) -> dict[Any, Any]:
    """S(x) = −Σ left · S(right) over the terms of the coproduct of x whose right factor is smaller than x.

    This is the recursion for the antipode of any graded connected bialgebra, from the values of S at smaller elements.
    """
    lefts: dict[Any, dict[Any, Any]] = {}
    for (left, right), count in coproduct:
        if right.order < x.order:
            add_terms(lefts.setdefault(right, {}), {(left,): count})
    total: dict[Any, Any] = {}
    for right, terms in lefts.items():
        add_terms(total, multiply(terms, inverse(right)), -1)
    return total


def grossman_larson_antipode(x: Summand) -> FormalSum:
    """The antipode of the Grossman–Larson Hopf algebra, dual to that of Connes and Kreimer.

    S(τ₁ · … · τ_k) is (−1)^k times the sum of all forests obtained by attaching some of the k trees to nodes of others,
    in (n+1)^(k−1) ways for n nodes in total.

    Returns a sum of forests. The argument and the errors are those of `coproduct`.

    Example:
        >>> import bseries as bs
        >>> bs.hopf.grossman_larson_antipode("τ"), bs.hopf.grossman_larson_antipode("τ·[τ]")
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
