"""Plans: what derivative towers need, as the columns of numbers that the compiled kernels read."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np

from . import jets
from .tower_layout import CHAIN, COUNTS, EACH, NUMBERS, PAIRS, RING, TABLE, TABLES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from integrators.scenes.local_terms import Output, Place
    from trees.table import TreeTable

    from .towers import Needs, TermNeeds

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
