"""Derivative towers: from a series and a scene to what the compiled kernels read.

F([τ1, …, τm]) = f^(m)(F(τ1), …, F(τm)). For a formula in few local variables, the *tower* of a forest τ1 … τk of
children is f^(k+r)(F(τ1), …, F(τk), ·, …, ·) for r = 0, 1, …: symmetric tensors, one number for each monomial. Adding a
child is one contraction, T_r(u ∘ v) = T_{r+1}(u) · F(v), and the differential is T_0; for a term of a Hamiltonian, the
gradient T_1. Only what somebody needs is computed: trees with a coefficient, their children, and the ranks from which
these grow; what the formulas let vanish is left out.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bseries.fields import taylor_polynomials as jets
from bseries.fields.differential_kernels import CHAIN, COUNTS, EACH, NUMBERS, PAIRS, RING, TABLE, TABLES
from bseries.fields.taylor_polynomials import jet_size
from integrators.scenes.model.local_terms import VALUE
from integrators.scenes.particles.degrees import Family, Piece, degree, family_of, supports

if TYPE_CHECKING:
    from integrators.scenes.model.local_terms import LocalTerm, Output, Place
    from integrators.scenes.model.system import System
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


SITE_CODES = {"single": EACH, "each": EACH, "chain": CHAIN, "ring": RING, "pairs": PAIRS, "table": TABLE}


class PlanBuilder:
    """Collects the rows of all tables, term by term.

    Args:
        table: The trees.
        needs: What is to be computed.
        weights: The factor of each tree's differential, already in the numbers of the computation.
        convert: Makes such a number of an exact one.
    """

    def __init__(
        self, table: TreeTable, needs: Needs, weights: Sequence[Any], dimension: int, convert: Callable[[Any], Any]
    ):
        self.table, self.needs, self.weights, self.dimension, self.convert = table, needs, weights, dimension, convert
        self.order = table.max_order
        self.rows: dict[str, list[Any]] = defaultdict(list)
        self.known: dict[Any, int] = {}
        self.child_number = {tree: at for at, tree in enumerate(needs.children)}
        self.trees_of: dict[int, list[int]] = defaultdict(list)
        for tree, forest in enumerate(needs.forests.of_tree):
            self.trees_of[forest].append(tree)

    def plan(self) -> tuple[Any, list[Any]]:
        """All tables as the kernels read them: unsigned integers, and numbers."""
        sums = locals_ = largest = 0
        for needs in self.needs.terms:
            tape, degree = self._tape(needs)
            self._add_term(needs, tape, degree)
            variables = len(needs.term.arguments)
            sums = max(sums, sum(map(len, needs.outputs)))
            locals_ = max(locals_, variables + len(needs.term.data))
            largest = max(largest, tape.jets * jets.jet_size(variables, degree))
        work = (sums, sums + locals_, sums + locals_ + largest)
        counts = (self.order, len(self.needs.terms), *work, len(self.needs.children), self.dimension)
        ints = [*counts, *(0,) * (len(TABLES) + len(NUMBERS))]
        numbers: list[Any] = []
        for at, (name, width) in enumerate(TABLES.items(), len(COUNTS)):
            ints[at] = len(ints)
            rows = self.rows[name]
            ints += rows if width == 1 else [entry for row in rows for entry in row]
        for at, name in enumerate(NUMBERS, len(COUNTS) + len(TABLES)):
            ints[at] = len(numbers)
            numbers += map(self.convert, self.rows[name])
        return np.array(ints, np.uint64), numbers

    def _tape(self, needs: TermNeeds) -> tuple[jets.Tape, int]:
        degree = needs.ranks[0] if needs.degree is None else min(needs.ranks[0], needs.degree)
        return jets.record(needs.term.formula, len(needs.term.arguments), degree), degree

    def _add_term(self, needs: TermNeeds, tape: jets.Tape, degree: int) -> None:
        term, rows = needs.term, self.rows
        variables = len(term.arguments)
        arguments, data = len(rows["argument"]), len(rows["datum"])
        for argument in term.arguments:
            minus = argument.minus
            rows["argument"].append((*argument.plus, int(minus is not None), *(minus or argument.plus)))
        for datum in term.data:
            rows["datum"].append((datum.role, len(rows["datum_value"])))
            rows["datum_value"] += datum.values
        first_step = len(rows["tape"])
        self._add_steps(tape, variables, degree)
        ranges = self._add_outputs(needs)
        slots, children = self._add_contractions(needs, ranges)
        shape = jets.shape(variables, degree)
        sites = term.sites
        site_row = len(rows["site"])
        rows["site"] += [(*row, *(0,) * (TABLES["site"] - len(row))) for row in sites.table]
        rows["term"].append(
            (
                *(SITE_CODES[sites.kind], sites.count, site_row, sites.size),
                *(arguments, len(rows["argument"]), data, len(rows["datum"]), first_step, len(rows["tape"])),
                *(tape.result, degree, len(shape.factorials)),
                self._once("raised", shape, shape.raised),
                self._once("factorial", shape, shape.factorials),
                *(slots, slots + len(children) * variables, ranges[0][0], ranges[-1][1]),
                *(len(rows["level"]) - self.order - 1, len(rows["child_level"]) - self.order - 1),
            )
        )

    def _once(self, name: str, key: Any, values: Iterable[Any]) -> int:
        """Where values begin in a table; equal ones are kept once."""
        if (name, key) not in self.known:
            self.known[name, key] = len(self.rows[name])
            self.rows[name] += values
        return self.known[name, key]

    def _add_steps(self, tape: jets.Tape, variables: int, degree: int) -> None:
        for step in tape.steps:
            begin = self._once("product", step.products, step.products)
            factor = len(self.rows["factor"])
            self.rows["factor"] += jets.factors(step, variables, degree)
            operands = (step.operation, step.result, step.first, step.second)
            self.rows["tape"].append((*operands, begin, begin + len(step.products), factor))
            self.rows["constant"].append(0 if step.number is None else step.number)

    def _add_outputs(self, needs: TermNeeds) -> list[tuple[int, int]]:
        """The outputs of each colour, one colour after the other."""
        ranges = []
        for outputs in needs.outputs:
            begin = len(self.rows["output"])
            self.rows["output"] += [_output(output) for output in outputs]
            ranges.append((begin, len(self.rows["output"])))
        return ranges

    def _add_contractions(self, needs: TermNeeds, ranges: list[tuple[int, int]]) -> tuple[int, list[int]]:
        """The contractions by order, the first of each term being none; the groups they fill, and the children."""
        forests, rows = self.needs.forests, self.rows
        wanted = sorted(needs.ranks, key=lambda forest: (forests.order[forest], forest))
        children = sorted({forests.right[forest] for forest in wanted if forest})
        local = {tree: at for at, tree in enumerate(children)}
        orders, colors = self.table.lists[:2]
        directions = [(self._once("direction", chosen, chosen), len(chosen)) for chosen in needs.directions]
        place, slots = self._places(needs, wanted)
        rows["level"].append(len(rows["contraction"]))
        for n in range(1, self.order + 1):
            for forest in (forest for forest in wanted if forests.order[forest] == n):
                uses = len(rows["use"])
                self._add_uses(needs, forest, ranges)
                contraction = 0, 0, 0, 0, 0, 0
                if forest:
                    right = forests.right[forest]
                    first, count = directions[colors[right]]
                    size = needs.size(forests, forest)
                    contraction = place[forests.left[forest]], place[forest], size, local[right], first, first + count
                rows["contraction"].append((*contraction, uses, len(rows["use"])))
            rows["level"].append(len(rows["contraction"]))
        begin = len(rows["child"])
        rows["child"] += [self.child_number[tree] for tree in children]
        rows["child_level"] += [begin + sum(orders[tree] < n for tree in children) for n in range(self.order + 1)]
        return slots, children

    def _places(self, needs: TermNeeds, wanted: list[int]) -> tuple[dict[int, int], int]:
        """Where towers lie in a group, and how many numbers they take; those that nothing grows from share a place."""
        forests = self.needs.forests
        lefts = {0, *(forests.left[forest] for forest in wanted)}
        place, slots, shared = {}, 0, 0
        for forest in wanted:
            size = needs.size(forests, forest)
            if forest in lefts:
                place[forest] = slots
                slots += size
            else:
                shared = max(shared, size)
        return {forest: place.get(forest, slots) for forest in wanted}, slots + shared

    def _add_uses(self, needs: TermNeeds, forest: int, ranges: list[tuple[int, int]]) -> None:
        """Where the differentials of the trees with these children go: into the sum, or to those who need them."""
        colors = self.table.lists[1]
        for tree in self.trees_of[forest]:
            first, last = ranges[colors[tree]]
            if needs.rank_for(self.needs.forests, forest, colors[tree]) is None:
                continue
            if self.weights[tree] != 0:
                self.rows["use"].append((0, first, last))
                self.rows["weight"].append(self.weights[tree])
            if tree in self.child_number:
                self.rows["use"].append((1 + self.child_number[tree], first, last))
                self.rows["weight"].append(0)


def _output(output: Output) -> tuple[int, ...]:
    place: Place = output.place
    return output.derivative + 1, place.role, place.offset, place.stride, int(output.sign > 0)
