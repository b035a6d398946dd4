"""Tables for the compiled evaluation of elementary differentials, from a series and a scene.

F([τ1, …, τm]) = f^(m)(F(τ1), …, F(τm)). For a formula in few local variables, the *derivative tower* of a forest
τ1 … τk of children consists of the symmetric tensors f^(k+r)(F(τ1), …, F(τk), ·, …, ·) for r = 0, 1, …, with one number
for each monomial. Adding a child is one contraction, T_r(u ∘ v) = T_{r+1}(u) · F(v); the differential is T_0, and the
gradient T_1 for a term of a Hamiltonian. The tables list the tensors for trees with nonzero coefficients and for their
children, without those that vanish for the formulas.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import accumulate, chain
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bseries.fields import differential_kernels as kernels
from bseries.fields import taylor_polynomials
from bseries.fields.taylor_polynomials import InstructionList, monomial_count
from integrators.scenes.model.system import VALUE, LocalTerm, Place, System
from integrators.scenes.particles.parts import Family, Piece, degree, family_of, supports
from trees.table import TreeTable

if TYPE_CHECKING:
    from bseries.exact.domains import Coefficient

N = TypeVar("N")
T = TypeVar("T")

Forest = int  # the index of a forest of children; 0 is the empty forest


class Forests(NamedTuple):
    """The forests of children of the trees of a table, independent of the colours of roots."""

    of_tree: list[Forest]  # the forest of each tree
    left: list[Forest]  # each forest without its largest tree
    right: list[int]  # the id of its largest tree
    order: list[int]  # the number of nodes of a tree with these children
    children: list[int]  # the number of children


def find_forests(table: TreeTable) -> Forests:
    """The forests of children in a table, by size."""
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


class TermTensors:
    """The forests that one term contributes to, with the highest rank of each."""

    def __init__(self, term: LocalTerm, scene: System, pieces: Sequence[Piece], moved: Sequence[frozenset[Family]]):
        import sympy

        self.term = term
        self.outputs = [piece.outputs(term, scene) for piece in pieces]
        # The outputs of a colour are all derivatives, read at rank 1, or all values, read at rank 0.
        self.lowest = [int(outputs[0].derivative != VALUE) if outputs else None for outputs in self.outputs]
        variables = [sympy.Symbol(f"x{k}") for k in range(len(term.arguments))]
        self.degree = degree(term.formula, variables)
        self.directions = [
            tuple(k for k, argument in enumerate(term.arguments) if family_of(argument.plus, scene) in families)
            for families in moved
        ]
        self.ranks: dict[Forest, int] = {}

    def nonzero(self, forests: Forests, forest: Forest, colors: Sequence[int], vanishes: Sequence[bool]) -> bool:
        """Whether the tensors of a forest may be nonzero."""
        if self.degree is not None and forests.children[forest] > self.degree:
            return False
        while forest:
            v = forests.right[forest]
            if vanishes[v] or not self.directions[colors[v]]:
                return False
            forest = forests.left[forest]
        return True

    def rank_for(self, forests: Forests, forest: Forest, color: int) -> int | None:
        """The rank at which trees of a colour with these children are read; None if the term does not contribute."""
        rank = self.lowest[color]
        beyond = rank is not None and self.degree is not None and forests.children[forest] + rank > self.degree
        return None if beyond else rank

    def require(self, forest: Forest, rank: int) -> None:
        """Require the tensors of a forest up to a rank."""
        self.ranks[forest] = max(self.ranks.get(forest, 0), rank)

    def size(self, forests: Forests, forest: Forest) -> int:
        """The number of entries for a forest, without ranks that vanish for a polynomial."""
        rank = self.ranks[forest]
        if self.degree is not None:
            rank = min(rank, self.degree - forests.children[forest])
        return monomial_count(len(self.term.arguments), rank)


class RequiredTensors(NamedTuple):
    """The tensors to compute for each term, and the trees whose differentials are contracted with others."""

    terms: list[TermTensors]
    children: list[int]
    forests: Forests


def find_required_tensors(
    table: TreeTable, wanted: Sequence[bool], scene: System, pieces: Sequence[Piece]
) -> RequiredTensors:
    """Find the tensors that the wanted trees need, from the largest trees down."""
    forests = find_forests(table)
    colors = table.lists.color
    moved = supports(scene, pieces)
    terms = [TermTensors(term, scene, pieces, moved) for term in scene.numeric_terms]
    nonzero: list[list[bool]] = []
    vanishes: list[bool] = []
    of_order = defaultdict(list)
    for forest, n in enumerate(forests.order):
        of_order[n].append(forest)
    known = 0
    for tree, forest in enumerate(forests.of_tree):
        while known <= forest:
            nonzero.append([term.nonzero(forests, known, colors, vanishes) for term in terms])
            known += 1
        vanishes.append(
            not any(
                a and t.rank_for(forests, forest, colors[tree]) is not None
                for a, t in zip(nonzero[forest], terms, strict=True)
            )
        )
    is_child = [False] * len(table)
    for n in range(table.max_order, 0, -1):
        for tree in reversed(table.ids(n)):
            if (wanted[tree] or is_child[tree]) and not vanishes[tree]:
                forest = forests.of_tree[tree]
                for term, a in zip(terms, nonzero[forest], strict=True):
                    rank = term.rank_for(forests, forest, colors[tree])
                    if a and rank is not None:
                        term.require(forest, rank)
        for forest in of_order[n]:
            for term in terms:
                if forest and forest in term.ranks:
                    term.require(forests.left[forest], term.ranks[forest] + 1)
                    is_child[forests.right[forest]] = True
    children = [tree for tree, needed in enumerate(is_child) if needed]
    return RequiredTensors([term for term in terms if term.ranks], children, forests)


class TableBuilder(Generic[N]):
    """Builder of the tables that the kernels read; `convert` makes the numbers of the computation from exact ones."""

    def __init__(
        self,
        table: TreeTable,
        required: RequiredTensors,
        weights: Sequence[Coefficient],
        dimension: int,
        convert: Callable[[Coefficient], N],
    ):
        self.table, self.required, self.weights = table, required, weights
        self.dimension, self.convert = dimension, convert
        self.order = table.max_order
        self.rows: dict[int, list[int | tuple[int, ...]]] = defaultdict(list)
        self.numbers: dict[int, list[Coefficient]] = defaultdict(list)
        self.places = [np.zeros(0, np.uint64)]
        self.known: dict[tuple[int, tuple[object, ...]], int] = {}
        self.child_number = {tree: at for at, tree in enumerate(required.children)}
        self.trees_of: dict[int, list[int]] = defaultdict(list)
        for tree, forest in enumerate(required.forests.of_tree):
            self.trees_of[forest].append(tree)

    def build(self) -> tuple[NDArray[np.uint64], list[N]]:
        """All tables, as unsigned integers and numbers."""
        sums = locals_ = largest = 0
        for tensors in self.required.terms:
            degree = tensors.ranks[0] if tensors.degree is None else min(tensors.ranks[0], tensors.degree)
            variables = len(tensors.term.arguments)
            program = taylor_polynomials.InstructionList(tensors.term.formula, variables, degree)
            self._add_term(tensors, program, degree)
            sums = max(sums, sum(map(len, tensors.outputs)))
            locals_ = max(locals_, variables + len(tensors.term.data))
            largest = max(largest, len(program.supports) * monomial_count(variables, degree))
        work = (sums, sums + locals_, sums + locals_ + largest)
        counts = (self.order, len(self.required.terms), *work, len(self.required.children), self.dimension)
        tables = [np.array(self.rows[table], np.uint64).ravel() for table in kernels.TABLES if table != kernels.PLACE]
        tables.append(np.concatenate(self.places))
        sizes = [len(counts) + len(kernels.TABLES) + len(kernels.NUMBER_TABLES), *map(len, tables)]
        number_sizes = [0, *(len(self.numbers[table]) for table in kernels.NUMBER_TABLES)]
        head = [*counts, *accumulate(sizes[:-1]), *accumulate(number_sizes[:-1])]
        numbers = [self.convert(x) for table in kernels.NUMBER_TABLES for x in self.numbers[table]]
        return np.concatenate([np.array(head, np.uint64), *tables]), numbers

    def _add_term(self, tensors: TermTensors, program: InstructionList, degree: int) -> None:
        term, rows, numbers = tensors.term, self.rows, self.numbers
        variables, first_argument = len(term.arguments), len(rows[kernels.DIFFERENCE])
        rows[kernels.DIFFERENCE] += [int(argument.minus is not None) for argument in term.arguments]
        first_instruction = len(rows[kernels.INSTRUCTION])
        for instruction in program.instructions:
            begin = self._shared_offset(self.rows, kernels.PRODUCT, instruction.products)
            factor = len(numbers[kernels.FACTOR])
            numbers[kernels.FACTOR] += taylor_polynomials.factors(instruction, variables, degree)
            operands = (instruction.operation, instruction.result, instruction.first, instruction.second)
            rows[kernels.INSTRUCTION].append((*operands, begin, begin + len(instruction.products), factor))
            numbers[kernels.NUMBER].append(instruction.number)
        ranges = []  # of outputs, by colour
        for outputs in tensors.outputs:
            begin = len(rows[kernels.OUTPUT])
            rows[kernels.OUTPUT] += [(output.derivative + 1, int(output.sign > 0)) for output in outputs]
            ranges.append((begin, len(rows[kernels.OUTPUT])))
        groups, children = self._add_contractions(tensors, ranges)
        first_place = sum(map(len, self.places))
        self._add_places(tensors)
        rows[kernels.TERM].append(
            (
                *(term.sites.size, first_place, first_argument, len(rows[kernels.DIFFERENCE]), len(term.data)),
                *(first_instruction, len(rows[kernels.INSTRUCTION])),
                *(program.result, degree, monomial_count(variables, degree)),
                self._shared_offset(self.rows, kernels.RAISED, taylor_polynomials.raised_monomials(variables, degree)),
                self._shared_offset(self.numbers, kernels.FACTORIAL, taylor_polynomials.factorials(variables, degree)),
                *(groups, groups + len(children) * variables, ranges[0][0], ranges[-1][1]),
                *(len(rows[kernels.LEVEL]) - self.order - 1, len(rows[kernels.CHILD_LEVEL]) - self.order - 1),
            )
        )

    def _add_places(self, tensors: TermTensors) -> None:
        """Add the places of local variables, outputs and data, for each row of sites."""
        sites, values = tensors.term.sites, self.numbers[kernels.DATUM_VALUE]
        places = [place for plus, minus in tensors.term.arguments for place in (plus, minus or plus)]
        places += [output.place for output in chain(*tensors.outputs)]
        for datum in tensors.term.data:
            places.append(Place(datum.role, len(values), 1))
            values += datum.values
        rows = np.fromiter(chain.from_iterable(sites.rows()), np.int64).reshape(-1, max(1, sites.roles)).T
        columns = [place.offset + place.stride * rows[place.role] for place in places]
        self.places.append(np.stack(columns, axis=1).astype(np.uint64).ravel())

    def _shared_offset(self, tables: dict[int, list[T]], table: int, values: tuple[T, ...]) -> int:
        """The offset of values in a table, where equal values are stored once."""
        if (table, values) not in self.known:
            self.known[table, values] = len(tables[table])
            tables[table] += values
        return self.known[table, values]

    def _add_contractions(self, tensors: TermTensors, ranges: list[tuple[int, int]]) -> tuple[int, list[int]]:
        """Add the contractions by order, none for the single node; returns the numbers of groups and the children."""
        forests, rows = self.required.forests, self.rows
        wanted = sorted(tensors.ranks, key=lambda forest: (forests.order[forest], forest))
        children = sorted({forests.right[forest] for forest in wanted if forest})
        local = {tree: at for at, tree in enumerate(children)}
        orders, colors = self.table.lists[:2]
        directions = [
            (self._shared_offset(self.rows, kernels.DIRECTION, chosen), len(chosen)) for chosen in tensors.directions
        ]
        offset, groups = self._offsets(tensors, wanted)
        rows[kernels.LEVEL].append(len(rows[kernels.CONTRACTION]))
        for n in range(1, self.order + 1):
            for forest in (forest for forest in wanted if forests.order[forest] == n):
                uses = len(rows[kernels.USE])
                self._add_uses(tensors, forest, ranges)
                contraction = 0, 0, 0, 0, 0, 0
                if forest:
                    right = forests.right[forest]
                    first, count = directions[colors[right]]
                    size = tensors.size(forests, forest)
                    contraction = offset[forests.left[forest]], offset[forest], size, local[right], first, first + count
                rows[kernels.CONTRACTION].append((*contraction, uses, len(rows[kernels.USE])))
            rows[kernels.LEVEL].append(len(rows[kernels.CONTRACTION]))
        begin = len(rows[kernels.CHILD])
        rows[kernels.CHILD] += [self.child_number[tree] for tree in children]
        rows[kernels.CHILD_LEVEL] += [begin + sum(orders[tree] < n for tree in children) for n in range(self.order + 1)]
        return groups, children

    def _offsets(self, tensors: TermTensors, wanted: list[int]) -> tuple[dict[int, int], int]:
        """The offset of each forest in a group, and their total size; forests contained in no other share an offset."""
        forests = self.required.forests
        lefts = {0, *(forests.left[forest] for forest in wanted)}
        offset, groups, shared = {}, 0, 0
        for forest in wanted:
            size = tensors.size(forests, forest)
            if forest in lefts:
                offset[forest] = groups
                groups += size
            else:
                shared = max(shared, size)
        return {forest: offset.get(forest, groups) for forest in wanted}, groups + shared

    def _add_uses(self, tensors: TermTensors, forest: int, ranges: list[tuple[int, int]]) -> None:
        """Add the trees with these children to the sum, or to the fields of children."""
        colors = self.table.lists.color
        for tree in self.trees_of[forest]:
            first, last = ranges[colors[tree]]
            if tensors.rank_for(self.required.forests, forest, colors[tree]) is None:
                continue
            if self.weights[tree] != 0:
                self.rows[kernels.USE].append((0, first, last))
                self.numbers[kernels.WEIGHT].append(self.weights[tree])
            if tree in self.child_number:
                self.rows[kernels.USE].append((1 + self.child_number[tree], first, last))
                self.numbers[kernels.WEIGHT].append(0)
