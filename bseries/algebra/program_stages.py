"""From a program of evaluations to stages that multiply in blocks.

Every evaluation is the field at a point with coefficients in a commutative algebra, its block (see
`bseries.exact.recursions.Stages`), followed by a linear functional:

- Field: the numbers.
- Derivative: dual numbers, ε² = 0. The coefficient of ε in h f(Y + ε v) is h f′(Y) v.
- Flow: polynomials in θ. The path z(θ) = Y + ∫₀^θ (time · h f(z) + forcing) solves the differential equation, so its
  coefficient of θ^(l+1) is time/(l+1) times the coefficient of θ^l of h f(z).
- Average: polynomials in θ along the given path, integrated at the end.

A tree with n nodes needs polynomials of degree at most (n−1)d, d being the degree of the path for one node; so modulo
a power of θ beyond that, nothing is lost.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bseries.exact.arithmetic import MOST_STAGES
from bseries.exceptions import SeriesError
from integrators.exact.entries import multiply_entries, sum_entries
from integrators.methods.program.program import Average, Derivative, Field, Flow
from trees.counting import check_order

if TYPE_CHECKING:
    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import Evaluation, Program

Row = dict[int, Any]
"""A row of a stage matrix: entries by column."""


class StageRows:
    """A program as rows over the components of its stage vectors, exact for trees up to `order` nodes.

    Attributes:
        sizes: length of the block of each evaluation.
        part: for each component the part of the field it belongs to; None: all.
        rows: for each component its row.
        weights: the row of the result.
    """

    def __init__(self, program: Program, order: int):
        self.sizes = [block_size(evaluation, check_order(order)) for evaluation in program.evaluations]
        if sum(self.sizes) > MOST_STAGES:
            raise SeriesError(
                f"method must have at most {MOST_STAGES} stages, those of flows counted as often as this order needs, "
                f"but has {sum(self.sizes)}"
            )
        self._program = program
        self._first = [sum(self.sizes[:e]) for e in range(len(self.sizes))]
        self._registers: list[Row | None] = [None] * len(self.sizes)
        self.part = [e.part for e, size in zip(program.evaluations, self.sizes, strict=True) for _ in range(size)]
        self.rows = [row for e in range(len(self.sizes)) for row in self._block(e)]
        self.weights = self._form(program.result)

    def _block(self, e: int) -> list[Row]:
        """The rows of one evaluation: the path along which it looks at the field, coefficient by coefficient."""
        evaluation, size, first = self._program.evaluations[e], self.sizes[e], self._first[e]
        match evaluation:
            case Field(_, at):
                return [self._form(at)]
            case Derivative(_, at, along):
                return [self._form(at), self._form(along)]
            case Average(_, path):
                return [self._form(form) for form in path[:size]] + [{} for _ in range(size - len(path))]
            case Flow(_, at, time, forcing):
                rows: list[Row] = [self._form(at)]
                for k in range(1, size):
                    row: Row = {first + k - 1: multiply_entries(time, Fraction(1, k))}
                    if k <= len(forcing):
                        _add(row, self._form(forcing[k - 1]), Fraction(1, k))
                    rows.append(row)
                return rows

    def _form(self, form: LinearForm) -> Row:
        row: Row = {}
        for e, x in form.terms.items():
            _add(row, self._register(e), x)
        return row

    def _register(self, e: int) -> Row:
        """The functional that gives k_e."""
        known = self._registers[e]
        if known is not None:
            return known
        evaluation, first, size = self._program.evaluations[e], self._first[e], self.sizes[e]
        row: Row
        match evaluation:
            case Field():
                row = {first: Fraction(1)}
            case Derivative():
                row = {first + 1: Fraction(1)}
            case Average(_, _, power):
                row = {first + k: Fraction(1, k + power + 1) for k in range(size)}
            case Flow(_, _, time, forcing):
                row = {first + k: multiply_entries(time, Fraction(1, k + 1)) for k in range(size)}
                for j, form in enumerate(forcing):
                    _add(row, self._form(form), Fraction(1, j + 1))
        self._registers[e] = row
        return row

    def flat(self, colors: int) -> tuple[list[Any], list[Any]]:
        """Matrices and weights, colour by colour, as `Stages` wants them."""
        size = len(self.rows)
        a: list[Any] = [Fraction(0)] * (colors * size * size)
        b: list[Any] = [Fraction(0)] * (colors * size)
        for color in range(colors):
            for i, row in enumerate(self.rows):
                for j, x in row.items():
                    if self.part[j] in (color, None):
                        a[(color * size + i) * size + j] = x
            for j, x in self.weights.items():
                if self.part[j] in (color, None):
                    b[color * size + j] = x
        return a, b


def block_size(evaluation: Evaluation, order: int) -> int:
    """The number of components that trees up to `order` nodes need."""
    match evaluation:
        case Field():
            return 1
        case Derivative():
            return 2
        case Average(_, path):
            return (order - 1) * (len(path) - 1) + 1
        case Flow(_, _, _, forcing):
            return (order - 1) * max(len(forcing), 1) + 1


def _add(row: Row, other: Row, factor: Any) -> None:
    for j, x in other.items():
        row[j] = sum_entries((row.get(j, Fraction(0)), multiply_entries(factor, x)))
