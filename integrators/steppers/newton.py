"""Newton's iteration for slopes that depend on one another in stiff systems, until nothing but rounding is left."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from foundation.memory import refuse_beyond_memory
from integrators.compile.particle_loops import indented
from integrators.core.errors import IntegratorError
from integrators.steppers.fixed_point import MOST_SWEEPS, negligible_changes, rounding, start_values
from integrators.steppers.nodes import Key, Node, Point

if TYPE_CHECKING:
    import sympy

    from integrators.steppers.plan import Call, Group
    from integrators.steppers.writer import StepWriter


PATIENCE = 50
"""After so many sweeps the iteration begins anew."""
SLOW = 8
"""Changes that fall by a smaller factor call for a new matrix."""
STALLED = 2
"""Changes that fall by a smaller factor are rounding errors, if they are small: the last bits may creep for long."""


def newton_lines(group: Group, writer: StepWriter) -> list[str]:
    """Sweeps k ← k + (I − G′)⁻¹ (G(k) − k) over a group until the increments stop falling.

    The Jacobians are those at the points that the starting values lead to, and the matrix is kept until the iteration
    slows down. If it diverges, or takes long, it begins anew at k = 0, this time with a new matrix in each sweep.

    References:
        E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, section IV.8.
    """
    forms = writer.forms
    forms.forget()
    matrix = SlopeMatrix(group, writer)
    right = writer.array("right", matrix.size)
    new = {e: writer.array(f"n{k}") for k, e in enumerate(sorted({e for e, _ in group.unknowns}))}
    # the points of the matrix need the slopes that are computed on the way
    inner = (call for call in group.calls if call.evaluation not in new)
    making = [*(line for call in inner for line in writer.call_lines(call)), *matrix.lines()]
    forms.forget()
    sweep = [line for call in group.calls for line in writer.call_lines(call, new.get(call.evaluation))]
    forms.forget()
    for stretch in matrix.stretches:
        e = stretch.evaluation
        sweep += stretch.loop(f"{stretch.entry(right)} = {new[e]}[i] - k{e}[i]")
    sweep.append(f"solve(matrix, pivots, {matrix.size}, {right})")
    cells = sorted({cell for _, cell in group.unknowns})
    sweep += [f"change{cell} = 0" for cell in cells]
    for stretch in matrix.stretches:
        change, x = f"change{stretch.cell}", stretch.entry(right)
        sweep += stretch.loop(f"k{stretch.evaluation}[i] += {x}", f"{change} = max({change}, bits(abs({x})))")
    return [
        *start_values(group, writer),
        *(f"before{cell} = BITS_OF_INFINITY" for cell in cells),
        "settled, again, stale, stalls = False, False, True, 0",
        f"for sweep in range({MOST_SWEEPS}):",
        *indented(["if stale:", *indented(making), *sweep, *_ending(group, writer)]),
        "if not settled:",
        "    break",
    ]


def _ending(group: Group, writer: StepWriter) -> list[str]:
    """Statements that leave the loop over sweeps, or say how it goes on."""
    cells = sorted({cell for _, cell in group.unknowns})
    lines = [f"small{cell} = {' and '.join(negligible_changes(cell, group, writer))}" for cell in cells]
    over = (f"small{c} and (change{c} == 0 or not falls(change{c}, before{c}, {STALLED}))" for c in cells)
    slow = (f"not (small{c} or falls(change{c}, before{c}, {SLOW}))" for c in cells)
    zeros = [line for e, cell in group.unknowns for line in writer.forms.loop(cell, [f"k{e}[i] = 0.0"])]
    falling = " or ".join(f"falls(change{cell}, before{cell}, {STALLED})" for cell in cells)
    return [
        *lines,
        f"stalls += not ({falling})",
        f"if {' and '.join(over)} or stalls >= STALLS and {rounding(cells, writer)}:",
        "    settled = True",
        "    break",
        f"if sweep == {PATIENCE} or {' or '.join(f'failed(change{cell})' for cell in cells)}:",
        "    if again:",
        "        break",
        "    again, stale = True, True",
        *indented(zeros),
        *(f"    before{cell} = BITS_OF_INFINITY" for cell in cells),
        "    continue",
        f"stale = again or {' or '.join(slow)}",
        # the least so far: rounding errors of several cells may come and go in turn for ever
        *(f"before{cell} = min(before{cell}, change{cell})" for cell in cells),
    ]


Factor: TypeAlias = tuple[int, int, int]
"""The number of a Jacobian, and the cells of its rows and columns that are meant."""
Path: TypeAlias = tuple[Factor, ...]
"""A product of Jacobians."""
Tangent: TypeAlias = dict[tuple[Key, Path], Fraction]
"""What a slope's derivative by each unknown is: Σ x h^length path."""


class Jacobian(NamedTuple):
    """The derivative of a piece of the field in some cells; it is needed at a point unless the piece is linear."""

    piece: int
    cells: tuple[int, ...]
    point: Point


class Stretch(NamedTuple):
    """Entries a ≤ i < b of an unknown slope, which stand from `first` on in the vector of all unknowns."""

    evaluation: int
    cell: int
    a: int
    b: int
    first: int

    def entry(self, array: str) -> str:
        """The entry of an array of all unknowns that belongs to the entry i of the slope."""
        shift = self.first - self.a
        return f"{array}[i]" if shift == 0 else f"{array}[i {'+' if shift > 0 else '-'} {abs(shift)}]"

    def loop(self, *lines: str) -> list[str]:
        """A loop over the entries."""
        return [f"for i in range({self.a}, {self.b}):", *indented(lines)]


class SlopeMatrix:
    """The matrix of a group.

    Derivatives of slopes that are computed on the way to others are products of Jacobians. An average has nearly the
    Jacobian at the middle of its path, and a flow nearly that of its piece; the derivative of an F′ is left out.

    Args:
        group: The group.
        writer: The stepper's source.

    Attributes:
        stretches: The order of the unknowns.
        size: The number of unknowns.
    """

    def __init__(self, group: Group, writer: StepWriter):
        self.writer, self.structure = writer, writer.structure
        self.stretches: list[Stretch] = []
        self.size = 0
        for e, cell in group.unknowns:
            for a, b in self.structure.cells[cell]:
                self.stretches.append(Stretch(e, cell, a, b, self.size))
                self.size += b - a
        check_matrix(self.size, self.structure.scene.name)
        self._jacobians: dict[Jacobian, int] = {}
        self._products: dict[Path, int] = {}
        self._unknowns = set(group.unknowns)
        self._tangents: dict[Key, Tangent] = {}
        for call in group.calls:
            number = self._jacobian(call)
            for cell in call.cells:
                self._tangents[call.evaluation, cell] = self._tangent(call.node, number, cell)

    def _jacobian(self, call: Call) -> int:
        """The number of the Jacobian that a call needs."""
        node = call.node
        is_linear = all(self.structure.flow(node.piece, cell).is_linear for cell in call.cells)
        point = () if is_linear else _middle(node.points) if node.kind == "average" else node.points[0]
        return self._jacobians.setdefault(Jacobian(node.piece, call.cells, point), len(self._jacobians))

    def _tangent(self, node: Node, number: int, cell: int) -> Tangent:
        """How a slope in a cell depends on the unknowns."""
        total: Tangent = {}
        for weight, point in _arguments(node):
            for source, form in point:
                if source not in self.structure.flow(node.piece, cell).cells:
                    continue
                for e, x in form.terms:
                    for (unknown, path), y in self._derivative((e, source)).items():
                        key = unknown, ((number, cell, source), *path)
                        total[key] = total.get(key, Fraction(0)) + weight * x * y
        return total

    def _derivative(self, key: Key) -> Tangent:
        """How a slope that a sweep reads depends on the unknowns."""
        return {(key, ()): Fraction(1)} if key in self._unknowns else self._tangents.get(key, {})

    def _entries(self) -> Iterator[tuple[Stretch, Stretch, Path, Fraction]]:
        """The summands of G′: rows, columns, the product of Jacobians and its factor."""
        for row in self.stretches:
            for (unknown, path), factor in self._tangents[row.evaluation, row.cell].items():
                for column in self.stretches:
                    if (column.evaluation, column.cell) == unknown:
                        yield row, column, path, factor

    def lines(self) -> list[str]:
        """Statements that make the matrix and factorize it, in the arrays ``matrix`` and ``pivots``."""
        import sympy

        writer, n = self.writer, self.writer.structure.scene.dimension
        lines: list[str] = []
        for jacobian, number in self._jacobians.items():
            made, at = writer.forms.point(jacobian.point, "z")
            function = writer.functions.jacobian(jacobian.piece, jacobian.cells)
            lines += [*made, f"{function}({at}, {_block(number, n)})"]
        parts: list[int] = []
        factors: list[sympy.Expr] = []
        for row, column, path, factor in self._entries():
            start = self._product(path, lines) * n * n + row.a * n + column.a
            parts += [row.first * self.size + column.first, start, row.b - row.a, column.b - column.a, len(path)]
            factors.append(sympy.Rational(factor.numerator, factor.denominator))
        writer.array("blocks", n * n * (len(self._jacobians) + len(self._products)))
        matrix, pivots = writer.array("matrix", self.size**2), writer.array("pivots", self.size)
        table = f"{writer.module.sites(parts)}, {writer.module.numbers(factors)}"
        return [
            *lines,
            f"assemble({matrix}, {self.size}, blocks, {n}, h, {table})",
            f"factorize({matrix}, {pivots}, {self.size})",
        ]

    def _product(self, path: Path, lines: list[str]) -> int:
        """The number of the block with a product of Jacobians; statements that make it are added to `lines`."""
        (number, rows, inner), *rest = path
        if not rest:
            return number
        if path not in self._products:
            n, cells = self.writer.structure.scene.dimension, self.structure.cells
            other = self._product(tuple(rest), lines)
            self._products[path] = len(self._jacobians) + len(self._products)
            out = _block(self._products[path], n)
            lines.append(f"clear({out}, {n * n})")
            lines += [
                f"add_product({out}, {_block(number, n)}, {_block(other, n)}, {n}, {a}, {b}, {c})"
                for a, b, c in product(cells[rows], cells[inner], cells[path[-1][2]])
            ]
        return self._products[path]


def check_matrix(size: int, scene: str) -> None:
    """Refuse dense matrices that would not fit in memory: one of slopes, and about as much of Jacobians."""
    refuse_beyond_memory(
        16 * size**2, IntegratorError,
        f"scene must be smaller for Newton's method: {size} unknown slopes in a step of {scene}",
    )  # fmt: skip


def _arguments(node: Node) -> Iterator[tuple[Fraction, Point]]:
    """What a node depends on linearly, or nearly so, by its Jacobian: points and their weights."""
    if node.kind == "average":
        for j, point in enumerate(node.points):
            yield Fraction(1, int(node.detail) + j + 1), point
    elif node.kind == "flow":
        yield Fraction(node.detail), node.points[0]
    else:
        yield Fraction(1), node.points[-1]


def _middle(path: tuple[Point, ...]) -> Point:
    """The point of a path at θ = 1/2."""
    forms = dict(path[0])
    for j, point in enumerate(path[1:], 1):
        forms |= {cell: forms[cell].plus(form, Fraction(1, 2**j)) for cell, form in point}
    return tuple(forms.items())


def _block(number: int, n: int) -> str:
    return f"shifted(blocks, {number * n * n})" if number else "blocks"
