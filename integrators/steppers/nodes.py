"""A program as nodes: what each evaluation puts into each cell of the state, and the linear forms that it takes.

Coefficients become rational numbers within 10^-40 of the exact ones, so that sums of them are exact and equal points
are known to be equal. What a scene's structure says is used at once: the flow of a piece that does not feel what it
moves is a multiple of its field, the derivative of a linear piece is the piece itself, and evaluations of the same
piece at the same point are one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.core.errors import IntegratorError
from integrators.methods.program.evaluations import Average, Derivative, Evaluation, Field, Flow, operands
from integrators.steppers.structure import Structure

if TYPE_CHECKING:
    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import Method, Program

DECIMALS = 40


class Form(NamedTuple):
    """start · y + h Σ x_e k_e in one cell; k_e is a slope, without the factor h."""

    start: Fraction
    terms: tuple[tuple[int, Fraction], ...]

    @classmethod
    def of(cls, start: Fraction, terms: Mapping[int, Fraction]) -> Form:
        """The form with its terms in order, zeros left out; a start within 10^-30 of a whole number is that."""
        whole = Fraction(round(start))
        start = whole if abs(start - whole) < Fraction(1, 10**30) else start
        return cls(start, tuple(sorted((e, x) for e, x in terms.items() if x)))

    def plus(self, other: Form, factor: Fraction = Fraction(1)) -> Form:
        """The form plus a multiple of another."""
        terms = dict(self.terms)
        for e, x in other.terms:
            terms[e] = terms.get(e, Fraction(0)) + factor * x
        return Form.of(self.start + factor * other.start, terms)

    @property
    def is_start(self) -> bool:
        """Whether the form is y itself."""
        return self == (1, ())


Point = tuple[tuple[int, Form], ...]
"""A form for each cell that matters, in order."""


class Node(NamedTuple):
    """The slopes that an evaluation puts into a cell.

    Attributes:
        kind: ``field`` at one point, ``derivative`` at a point along a vector, ``average`` along a path of points,
            ``flow`` from a point with forcing, ``resolvent`` (I − hγ F′)⁻¹ at a point, of a vector without h.
        piece: The piece of the field.
        points: What it is evaluated at.
        detail: The power of an average, the time of a flow, the number γ of a resolvent.
    """

    kind: str
    piece: int
    points: tuple[Point, ...]
    detail: Fraction | int = 0

    @property
    def reads(self) -> set[tuple[int, int]]:
        """The slopes, as (evaluation, cell), that it needs."""
        return {(e, cell) for point in self.points for cell, form in point for e, _ in form.terms}


Key = tuple[int, int]
"""An evaluation and a cell."""


class Nodes:
    """All nodes of a method on a scene, and the forms of the end of a step.

    Attributes:
        structure: What the pieces of the field are like.
        nodes: The nodes, equal ones once.
        result: The end of the step, for each cell.
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
            for cell in sorted(self._moved(e)):
                node, factor = self._lowered(e, evaluation, cell)
                self.nodes[e, cell], self._factors[e, cell] = node, factor
        self._finish(program)

    def _finish(self, program: Program) -> None:
        """Replace forms in increments by forms in slopes, and merge equal nodes until there are none."""
        cells = range(len(self.structure.cells))
        forms = {(e, cell): node.points for (e, cell), node in self.nodes.items()}
        result = {cell: _rational(program.result) for cell in cells}
        while True:
            scaled = {key: tuple(map(self._scaled_point, points)) for key, points in forms.items()}
            nodes = {key: node._replace(points=scaled[key]) for key, node in self.nodes.items()}
            merged = self._merge(nodes)
            if not merged:
                break
        self.nodes = {key: node for key, node in nodes.items() if key not in self._same}
        self.result = {cell: self._scaled(form, cell) for cell, form in result.items()}
        self._drop_unused()

    def _merge(self, nodes: Mapping[Key, Node]) -> bool:
        first: dict[tuple[int, Node], int] = {}
        merged = False
        for (e, cell), node in nodes.items():
            if (e, cell) in self._same:
                continue
            other = first.setdefault((cell, node), e)
            if other != e:
                self._same[e, cell] = other
                merged = True
        return merged

    def _scaled_point(self, point: Point) -> Point:
        return tuple((cell, self._scaled(form, cell)) for cell, form in point)

    def _scaled(self, form: Form, cell: int) -> Form:
        """The form in slopes: factors of flows multiplied in, merged nodes by their new names, absent ones left out."""
        total: dict[int, Fraction] = {}
        for e, x in form.terms:
            if (e, cell) in self._factors:
                same = self._first_of(e, cell)
                total[same] = total.get(same, Fraction(0)) + x * self._factors[e, cell]
                if e in self._right_sides:
                    for other, y in self._scaled(self._right_sides[e], cell).terms:
                        total[other] = total.get(other, Fraction(0)) - x * y
        return Form.of(form.start, total)

    def _first_of(self, e: int, cell: int) -> int:
        """The evaluation that stands for all that equal this one."""
        while (e, cell) in self._same:
            e = self._same[e, cell]
        return e

    def _drop_unused(self) -> None:
        needed: set[Key] = set()
        waiting = [(e, cell) for cell, form in self.result.items() for e, _ in form.terms]
        while waiting:
            key = waiting.pop()
            if key not in needed:
                needed.add(key)
                waiting += self.nodes[key].reads
        self.nodes = {key: node for key, node in self.nodes.items() if key in needed}

    def abscissa(self, e: int) -> Fraction:
        """The time of an evaluation, in steps: where the point is that y' = 1 reaches."""
        (at, *_) = operands(self._program.evaluations[e])
        for part in range(len(self._program.names)):
            total = sum((fraction(x * self._program.total(other, part)) for other, x in at.terms.items()), Fraction(0))
            if total:
                return total
        return Fraction(0)

    def _piece(self, evaluation: Evaluation) -> int:
        """The number of the piece of an evaluation: the last one is the whole field, if there are several."""
        return len(self.structure.pieces) - 1 if evaluation.part is None else evaluation.part

    def _moved(self, e: int) -> frozenset[int]:
        """The cells in which an evaluation is not zero; a flow also moves what its forcing moves."""
        if e not in self._moves:
            forced = map(self._moved, sorted(self._program.same_order_registers(e)))
            self._moves[e] = frozenset(self.structure.writes(self._piece(self._program.evaluations[e]))).union(*forced)
        return self._moves[e]

    def _resolvent(self, e: int, piece: int, at: LinearForm, along: LinearForm) -> Node:
        """The node of a slope k = h F′(at) Σ x_j k_j with itself in the sum: k = s − r, where r = Σ x_j / γ k_j without
        k, γ is the factor of k, and s = (I − hγ F′)⁻¹ r. What s needs is small where F′ is large, other than k and r.

        References:
            E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, formula (IV.7.25).
        """
        terms = dict(_rational(along).terms)
        own = terms.pop(e)
        self._right_sides[e] = right = Form.of(Fraction(0), {other: x / own for other, x in terms.items()})
        flows = (self.structure.flow(piece, cell) for cell in self.structure.writes(piece))
        felt = frozenset[int]().union(*(flow.cells for flow in flows if not flow.is_linear))
        every = range(len(self.structure.cells))
        return Node("resolvent", piece, (_point(at, felt), tuple((cell, right) for cell in every)), own)

    def _is_linear_system(self, e: int, at: LinearForm, along: LinearForm) -> bool:
        """Whether a derivative is taken along itself, at a point that does not depend on it, and nothing else does."""
        waiting, seen = [*at.terms, *(other for other in along.terms if other != e)], set[int]()
        while waiting:
            other = waiting.pop()
            if other not in seen:
                seen.add(other)
                waiting += [f for form in operands(self._program.evaluations[other]) for f in form.terms]
        return e in along.terms and e not in seen

    def _lowered(self, e: int, evaluation: Evaluation, cell: int) -> tuple[Node, Fraction]:
        """The node of an evaluation in a cell, and the number that its slope is multiplied with."""
        piece, one = self._piece(evaluation), Fraction(1)
        flow = self.structure.flow(piece, cell)
        match evaluation:
            case Field(_, at):
                return Node("field", piece, (_point(at, flow.cells),)), one
            case Derivative(_, at, along):
                if self._is_linear_system(e, at, along):
                    return self._resolvent(e, piece, at, along), one
                if flow.is_linear:
                    return Node("field", piece, (_point(along, flow.cells),)), one
                return Node("derivative", piece, (_point(at, flow.cells), _point(along, flow.cells))), one
            case Average(_, path, power):
                if not flow.cells:
                    return Node("field", piece, ((),)), one / (power + 1)
                if flow.is_linear:
                    return Node("field", piece, (_point(_averaged(path, power), flow.cells),)), one
                return Node("average", piece, tuple(_point(form, flow.cells) for form in path), power), one
            case Flow(_, at, time, forcing):
                duration = fraction(time)
                if not forcing and flow.cells.isdisjoint(self.structure.writes(piece)):
                    return Node("field", piece, (_point(at, flow.cells),)), duration
                needed = self.structure.reach(piece, cell)
                return Node("flow", piece, tuple(_point(form, needed) for form in (at, *forcing)), duration), one
        raise AssertionError(evaluation)


def _point(form: LinearForm, cells: Iterable[int]) -> Point:
    rational = _rational(form)
    return tuple((cell, rational) for cell in sorted(cells))


def _averaged(path: Sequence[LinearForm], power: int) -> LinearForm:
    """∫₀¹ θ^power Σ θ^j path_j dθ."""
    total, *rest = (form.times(Fraction(1, power + 1 + j)) for j, form in enumerate(path))
    return sum(rest, total)


def _rational(form: LinearForm) -> Form:
    return Form.of(fraction(form.start), {e: fraction(x) for e, x in form.terms.items()})


def fraction(number: Any) -> Fraction:
    """A rational number within 10^-40, relatively, of a coefficient."""
    if hasattr(number, "evalf"):
        import sympy

        digits: Any = sympy.Rational(number.evalf(DECIMALS))
        return Fraction(int(digits.p), int(digits.q))
    return Fraction(number)
