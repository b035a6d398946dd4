"""A program as nodes: what each evaluation puts into each cell of the state, and the linear forms that it takes.

Coefficients become rational numbers within 10^-40 of the exact ones, so that sums of them are exact and equal points
are known to be equal. What a scene's structure says is used at once: the flow of a piece that does not feel what it
moves is a multiple of its field, the derivative of a linear piece is the piece itself, and evaluations of the same
piece at the same point are one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import IntegratorError
from ..evaluations import Average, Derivative, Evaluation, Field, Flow, operands
from ..plain_stepper import rational_program
from .structure import Structure

if TYPE_CHECKING:
    from ..linear_forms import LinearForm
    from ..program import Program
    from ..program_method import Method

DECIMALS = 40


class Form(NamedTuple):
    """start · y + h Σ x_e k_e in one cell; k_e is a slope, without the factor h."""

    start: Fraction
    terms: tuple[tuple[int, Fraction], ...]

    @classmethod
    def of(cls, start: Fraction, terms: Mapping[int, Fraction]) -> Form:
        """The form with its terms in order, zeros left out."""
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
            ``flow`` from a point with forcing.
        piece: The piece of the field.
        points: What it is evaluated at.
        detail: The power of an average, the time of a flow.
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
        program = rational_program(method, DECIMALS)
        if program.parameters:
            raise IntegratorError(f"parameters must have values before a step, but {program.parameters[0]} had none")
        self.structure = structure
        self._program = program
        self._factors: dict[Key, Fraction] = {}
        self._same: dict[Key, int] = {}
        self.nodes: dict[Key, Node] = {}
        for e, evaluation in enumerate(program.evaluations):
            for cell in structure.writes(self._piece(evaluation)):
                node, factor = self._lowered(evaluation, cell)
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
            total = sum((_fraction(x * self._program.total(other, part)) for other, x in at.terms.items()), Fraction(0))
            if total:
                return total
        return Fraction(0)

    def _piece(self, evaluation: Evaluation) -> int:
        """The number of the piece of an evaluation: the last one is the whole field, if there are several."""
        return len(self.structure.pieces) - 1 if evaluation.part is None else evaluation.part

    def _lowered(self, evaluation: Evaluation, cell: int) -> tuple[Node, Fraction]:
        """The node of an evaluation in a cell, and the number that its slope is multiplied with."""
        piece, one = self._piece(evaluation), Fraction(1)
        flow = self.structure.flow(piece, cell)
        match evaluation:
            case Field(_, at):
                return Node("field", piece, (_point(at, flow.cells),)), one
            case Derivative(_, at, along):
                if flow.is_linear:
                    return Node("field", piece, (_point(along, flow.cells),)), one
                return Node("derivative", piece, (_point(at, flow.cells), _point(along, flow.cells))), one
            case Average(_, path, power):
                if not flow.cells:
                    return Node("field", piece, ((),)), one / (power + 1)
                return Node("average", piece, tuple(_point(form, flow.cells) for form in path), power), one
            case Flow(_, at, time, forcing):
                duration = _fraction(time)
                if not forcing and flow.cells.isdisjoint(self.structure.writes(piece)):
                    return Node("field", piece, (_point(at, flow.cells),)), duration
                every = frozenset(range(len(self.structure.cells)))
                return Node("flow", piece, tuple(_point(form, every) for form in (at, *forcing)), duration), one
        raise AssertionError(evaluation)


def _point(form: LinearForm, cells: Iterable[int]) -> Point:
    rational = _rational(form)
    return tuple((cell, rational) for cell in sorted(cells))


def _rational(form: LinearForm) -> Form:
    return Form.of(_fraction(form.start), {e: _fraction(x) for e, x in form.terms.items()})


def _fraction(number: Any) -> Fraction:
    """A rational number within 10^-40, relatively, of a coefficient."""
    if hasattr(number, "evalf"):
        import sympy

        digits: Any = sympy.Rational(number.evalf(DECIMALS))
        return Fraction(int(digits.p), int(digits.q))
    return Fraction(number)
