"""Analysis of a method on a scene: one node for each evaluation in each block of variables.

Coefficients become rational numbers within 10^-40 of the exact ones, so that sums are exact and equal points compare
equal. Simplifications that follow from the scene are made here: the flow of a piece that does not depend on the
variables it moves is a multiple of its field, the derivative of a linear piece is the piece itself, and evaluations
of the same piece at the same point are merged.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from integrators.core.errors import IntegratorError
from integrators.methods.programs.evaluations import Average, Derivative, Evaluation, Field, Flow, LinearForm, operands
from integrators.methods.programs.program import Method, Program
from integrators.steppers.step_model import DECIMALS, Form, Key, Node, Point, fraction
from integrators.steppers.structure import Structure


class Nodes:
    """The nodes of a method on a scene, and the end of a step.

    Args:
        method: The method.
        structure: The blocks of variables and the pieces of the field.

    Attributes:
        structure: The same.
        nodes: The nodes, without duplicates.
        result: The end of the step, for each block.
    """

    def __init__(self, method: Method, structure: Structure):
        program = method.rational_program(DECIMALS)
        if program.parameters:
            raise IntegratorError(f"parameters must have values before a step, but {program.parameters[0]} had none")
        self.structure = structure
        self._program = program
        self._factors: dict[Key, Fraction] = {}
        self._same: dict[Key, int] = {}
        self._moves: dict[int, frozenset[int]] = {}
        self._right_sides: dict[int, Form] = {}
        self.nodes: dict[Key, Node] = {}
        for e, evaluation in enumerate(program.evaluations):
            for block in sorted(self._moved(e)):
                node, factor = self._node(e, evaluation, block)
                self.nodes[e, block], self._factors[e, block] = node, factor
        self._finish(program)

    def _finish(self, program: Program) -> None:
        """Express all forms in stage derivatives, and merge equal nodes until none are left."""
        blocks = range(len(self.structure.blocks))
        forms = {(e, block): node.points for (e, block), node in self.nodes.items()}
        result = {block: _rational(program.result) for block in blocks}
        while True:
            scaled = {key: tuple(map(self._scaled_point, points)) for key, points in forms.items()}
            nodes = {key: node._replace(points=scaled[key]) for key, node in self.nodes.items()}
            merged = self._merge(nodes)
            if not merged:
                break
        self.nodes = {key: node for key, node in nodes.items() if key not in self._same}
        self.result = {block: self._scaled(form, block) for block, form in result.items()}
        self._drop_unused()

    def _merge(self, nodes: Mapping[Key, Node]) -> bool:
        first: dict[tuple[int, Node], int] = {}
        merged = False
        for (e, block), node in nodes.items():
            if (e, block) in self._same:
                continue
            other = first.setdefault((block, node), e)
            if other != e:
                self._same[e, block] = other
                merged = True
        return merged

    def _scaled_point(self, point: Point) -> Point:
        return tuple((block, self._scaled(form, block)) for block, form in point)

    def _scaled(self, form: Form, block: int) -> Form:
        """The form in stage derivatives, with factors of flows multiplied in and merged nodes replaced."""
        total: dict[int, Fraction] = {}
        for e, x in form.terms:
            if (e, block) in self._factors:
                same = self._first_of(e, block)
                total[same] = total.get(same, Fraction(0)) + x * self._factors[e, block]
                if e in self._right_sides:
                    for other, y in self._scaled(self._right_sides[e], block).terms:
                        total[other] = total.get(other, Fraction(0)) - x * y
        return Form.of(form.start, total)

    def _first_of(self, e: int, block: int) -> int:
        """The representative of an evaluation among its equals."""
        while (e, block) in self._same:
            e = self._same[e, block]
        return e

    def _drop_unused(self) -> None:
        needed: set[Key] = set()
        waiting = [(e, block) for block, form in self.result.items() for e, _ in form.terms]
        while waiting:
            key = waiting.pop()
            if key not in needed:
                needed.add(key)
                waiting += self.nodes[key].reads
        self.nodes = {key: node for key, node in self.nodes.items() if key in needed}

    def abscissa(self, e: int) -> Fraction:
        """The abscissa of an evaluation: its point for y' = 1, y(0) = 0 and h = 1."""
        (at, *_) = operands(self._program.evaluations[e])
        for part in range(len(self._program.names)):
            total = sum((fraction(x * self._program.total(other, part)) for other, x in at.terms.items()), Fraction(0))
            if total:
                return total
        return Fraction(0)

    def _piece(self, evaluation: Evaluation) -> int:
        """The piece of an evaluation; of several pieces the last is the whole field."""
        return len(self.structure.pieces) - 1 if evaluation.part is None else evaluation.part

    def _moved(self, e: int) -> frozenset[int]:
        """The blocks in which an evaluation is not zero, those of the forcing of a flow included."""
        if e not in self._moves:
            forced = map(self._moved, sorted(self._program.same_order_registers(e)))
            self._moves[e] = frozenset(self.structure.writes(self._piece(self._program.evaluations[e]))).union(*forced)
        return self._moves[e]

    def _resolvent(self, e: int, piece: int, at: LinearForm, along: LinearForm) -> Node:
        """The node of k = h F′(at) (γ k + Σ x_j k_j), solved for s = k + r = (I − hγ F′)⁻¹ r with r = Σ x_j / γ k_j.

        Where F′ is large, s is small, unlike k and r.

        References:
            E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, formula (IV.7.25).
        """
        terms = dict(_rational(along).terms)
        own = terms.pop(e)
        self._right_sides[e] = right = Form.of(Fraction(0), {other: x / own for other, x in terms.items()})
        dependences = (self.structure.dependence(piece, block) for block in self.structure.writes(piece))
        needed = frozenset[int]().union(*(dependence.blocks for dependence in dependences if not dependence.is_linear))
        every = range(len(self.structure.blocks))
        return Node("resolvent", piece, (_point(at, needed), tuple((block, right) for block in every)), own)

    def _is_linear_system(self, e: int, at: LinearForm, along: LinearForm) -> bool:
        """Whether k = h F′(at) (γ k + …) is linear in k: neither the point nor the other terms depend on k."""
        waiting, seen = [*at.terms, *(other for other in along.terms if other != e)], set[int]()
        while waiting:
            other = waiting.pop()
            if other not in seen:
                seen.add(other)
                waiting += [f for form in operands(self._program.evaluations[other]) for f in form.terms]
        return e in along.terms and e not in seen

    def _node(self, e: int, evaluation: Evaluation, block: int) -> tuple[Node, Fraction]:
        """The node of an evaluation in a block, and the factor of its stage derivative."""
        piece, one = self._piece(evaluation), Fraction(1)
        dependence = self.structure.dependence(piece, block)
        match evaluation:
            case Field(_, at):
                return Node("field", piece, (_point(at, dependence.blocks),)), one
            case Derivative(_, at, along):
                if self._is_linear_system(e, at, along):
                    return self._resolvent(e, piece, at, along), one
                if dependence.is_linear:
                    return Node("field", piece, (_point(along, dependence.blocks),)), one
                return Node("derivative", piece, (_point(at, dependence.blocks), _point(along, dependence.blocks))), one
            case Average(_, path, power):
                if not dependence.blocks:
                    return Node("field", piece, ((),)), one / (power + 1)
                if dependence.is_linear:
                    return Node("field", piece, (_point(_averaged(path, power), dependence.blocks),)), one
                return Node("average", piece, tuple(_point(form, dependence.blocks) for form in path), power), one
            case Flow(_, at, time, forcing):
                duration = fraction(time)
                if not forcing and dependence.blocks.isdisjoint(self.structure.writes(piece)):
                    return Node("field", piece, (_point(at, dependence.blocks),)), duration
                needed = self.structure.reach(piece, block)
                return Node("flow", piece, tuple(_point(form, needed) for form in (at, *forcing)), duration), one
        raise AssertionError(evaluation)


def _point(form: LinearForm, blocks: Iterable[int]) -> Point:
    rational = _rational(form)
    return tuple((block, rational) for block in sorted(blocks))


def _averaged(path: Sequence[LinearForm], power: int) -> LinearForm:
    """∫₀¹ θ^power Σ θ^j path_j dθ."""
    total, *rest = (form.times(Fraction(1, power + 1 + j)) for j, form in enumerate(path))
    return sum(rest, total)


def _rational(form: LinearForm) -> Form:
    return Form.of(fraction(form.start), {e: fraction(x) for e, x in form.terms.items()})
