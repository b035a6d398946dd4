"""Derivative towers: from a series and a scene to what the compiled kernels read.

F([τ1, …, τm]) = f^(m)(F(τ1), …, F(τm)). For a formula in few local variables, the *tower* of a forest τ1 … τk of
children is f^(k+r)(F(τ1), …, F(τk), ·, …, ·) for r = 0, 1, …: symmetric tensors, one number for each monomial. Adding a
child is one contraction, T_r(u ∘ v) = T_{r+1}(u) · F(v), and the differential is T_0; for a term of a Hamiltonian, the
gradient T_1. Only what somebody needs is computed: trees with a coefficient, their children, and the ranks from which
these grow; what the formulas let vanish is left out.
"""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, NamedTuple

from integrators.scenes.degrees import Family, Piece, degree, family_of, supports
from integrators.scenes.local_terms import VALUE

from .jets import jet_size

if TYPE_CHECKING:
    from collections.abc import Sequence

    from integrators.scenes.local_terms import LocalTerm
    from integrators.scenes.system import System
    from trees.table import TreeTable

Forest = int
"""The number of a forest of children; 0 is the empty one."""


class Forests(NamedTuple):
    """The forests of children of the trees of a table; trees with equal children share theirs, whatever their colour.

    Attributes:
        of_tree: The forest of each tree.
        left: Each forest without its largest tree.
        right: The id of that tree.
        order: The number of nodes of a tree with these children.
        children: The number of trees in it.
    """

    of_tree: list[Forest]
    left: list[Forest]
    right: list[int]
    order: list[int]
    children: list[int]


def find_forests(table: TreeTable) -> Forests:
    """The forests of a table's trees, smaller ones first."""
    order, _, left, right = table.lists
    known: dict[tuple[Forest, int], Forest] = {}
    forests = Forests([], [0], [-1], [1], [0])
    for n, u, v in zip(order, left, right, strict=True):
        if u < 0:
            forests.of_tree.append(0)
            continue
        key = (forests.of_tree[u], v)
        if key not in known:
            known[key] = len(forests.order)
            forests.left.append(key[0])
            forests.right.append(v)
            forests.order.append(n)
            forests.children.append(forests.children[key[0]] + 1)
        forests.of_tree.append(known[key])
    return forests


class TermNeeds:
    """What one term has to compute: which forests, and up to which rank."""

    def __init__(self, term: LocalTerm, scene: System, pieces: Sequence[Piece], moved: Sequence[frozenset[Family]]):
        import sympy

        self.term = term
        self.outputs = [piece.outputs(term, scene) for piece in pieces]
        # Where the outputs of a colour are derivatives all are, so that their trees are read from rank 1.
        self.lowest = [int(outputs[0].derivative != VALUE) if outputs else None for outputs in self.outputs]
        variables = [sympy.Symbol(f"x{k}") for k in range(len(term.arguments))]
        self.degree = degree(term.formula, variables)
        self.directions = [
            tuple(k for k, argument in enumerate(term.arguments) if family_of(argument.plus, scene) in families)
            for families in moved
        ]
        self.ranks: dict[Forest, int] = {}

    def alive(self, forests: Forests, forest: Forest, colors: Sequence[int], vanishes: Sequence[bool]) -> bool:
        """Whether the tower of a forest can be other than zero."""
        if self.degree is not None and forests.children[forest] > self.degree:
            return False
        while forest:
            v = forests.right[forest]
            if vanishes[v] or not self.directions[colors[v]]:
                return False
            forest = forests.left[forest]
        return True

    def rank_for(self, forests: Forests, forest: Forest, color: int) -> int | None:
        """The rank that trees of a colour with these children are read from; None if the term adds nothing to them."""
        rank = self.lowest[color]
        beyond = rank is not None and self.degree is not None and forests.children[forest] + rank > self.degree
        return None if beyond else rank

    def need(self, forest: Forest, rank: int) -> None:
        """Ask for the ranks of a tower up to one."""
        self.ranks[forest] = max(self.ranks.get(forest, 0), rank)

    def size(self, forests: Forests, forest: Forest) -> int:
        """The numbers of the tower of a forest; ranks that vanish for a polynomial are left out."""
        rank = self.ranks[forest]
        if self.degree is not None:
            rank = min(rank, self.degree - forests.children[forest])
        return jet_size(len(self.term.arguments), rank)


class Needs(NamedTuple):
    """What is to be computed: by term, and which trees' differentials others are contracted with."""

    terms: list[TermNeeds]
    children: list[int]
    forests: Forests


def find_needs(table: TreeTable, wanted: Sequence[bool], scene: System, pieces: Sequence[Piece]) -> Needs:
    """Which towers the wanted trees need, found from the largest trees down.

    Args:
        table: The trees.
        wanted: For each tree, whether its differential enters the sum.
        scene: The scene.
        pieces: The piece of the field that each colour of the trees stands for.
    """
    forests = find_forests(table)
    _, colors, _, _ = table.lists
    moved = supports(scene, pieces)
    terms = [TermNeeds(term, scene, pieces, moved) for term in scene.numeric_terms]
    alive: list[list[bool]] = []
    vanishes: list[bool] = []
    of_order = defaultdict(list)
    for forest, n in enumerate(forests.order):
        of_order[n].append(forest)
    known = 0
    for tree, forest in enumerate(forests.of_tree):
        while known <= forest:
            alive.append([term.alive(forests, known, colors, vanishes) for term in terms])
            known += 1
        vanishes.append(
            not any(
                a and t.rank_for(forests, forest, colors[tree]) is not None
                for a, t in zip(alive[forest], terms, strict=True)
            )
        )
    is_child = [False] * len(table)
    for n in range(table.max_order, 0, -1):
        for tree in reversed(table.ids(n)):
            if (wanted[tree] or is_child[tree]) and not vanishes[tree]:
                forest = forests.of_tree[tree]
                for term, a in zip(terms, alive[forest], strict=True):
                    rank = term.rank_for(forests, forest, colors[tree])
                    if a and rank is not None:
                        term.need(forest, rank)
        for forest in of_order[n]:
            for term in terms:
                if forest and forest in term.ranks:
                    term.need(forests.left[forest], term.ranks[forest] + 1)
                    is_child[forests.right[forest]] = True
    children = [tree for tree, needed in enumerate(is_child) if needed]
    return Needs([term for term in terms if term.ranks], children, forests)
