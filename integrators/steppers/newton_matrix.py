"""The matrix I − G′ of Newton's method for implicit stages k = G(k)."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from foundation.memory import refuse_beyond_memory
from integrators.compile.printer import indented
from integrators.core.errors import IntegratorError
from integrators.steppers.step_model import Key, Node, Point

if TYPE_CHECKING:
    import sympy

    from integrators.steppers.step_model import Call, Group
    from integrators.steppers.writer import StepWriter


Factor: TypeAlias = tuple[int, int, int]
"""A Jacobian, a block of its rows and a block of its columns."""
Path: TypeAlias = tuple[Factor, ...]
"""A product of Jacobians."""
Tangent: TypeAlias = dict[tuple[Key, Path], Fraction]
"""The derivative of a stage derivative by each unknown, Σ x h^length path."""


class Jacobian(NamedTuple):
    """The derivative of a piece of the field in some blocks, at a point unless the piece is linear."""

    piece: int
    blocks: tuple[int, ...]
    point: Point


class UnknownRange(NamedTuple):
    """Entries a ≤ i < b of an unknown stage derivative, from index `first` on in the vector of all unknowns."""

    evaluation: int
    block: int
    a: int
    b: int
    first: int

    def entry(self, array: str) -> str:
        """Entry i of the stage derivative, in an array of all unknowns."""
        shift = self.first - self.a
        return f"{array}[i]" if shift == 0 else f"{array}[i {'+' if shift > 0 else '-'} {abs(shift)}]"

    def loop(self, *lines: str) -> list[str]:
        """A loop over the entries."""
        return [f"for i in range({self.a}, {self.b}):", *indented(lines)]


class NewtonMatrix:
    """The matrix of an implicit group.

    Intermediate stage derivatives give products of Jacobians. The Jacobian of an average is approximated by that at
    the middle of the path, and that of a flow by that of its piece; second derivatives are neglected.

    Args:
        group: The implicit group.
        writer: The writer of the step.

    Attributes:
        unknowns: The order of the unknowns.
        size: The number of unknowns.
    """

    def __init__(self, group: Group, writer: StepWriter):
        self.writer, self.structure = writer, writer.structure
        self.unknowns: list[UnknownRange] = []
        self.size = 0
        for e, block in group.unknowns:
            for a, b in self.structure.blocks[block]:
                self.unknowns.append(UnknownRange(e, block, a, b, self.size))
                self.size += b - a
        refuse_beyond_memory(
            16 * self.size**2,  # this matrix, and about the same size for Jacobians
            IntegratorError,
            f"scene must be smaller for Newton's method: {self.size} unknown stage derivatives in a step of "
            f"{self.structure.scene.name}",
        )
        self._jacobians: dict[Jacobian, int] = {}
        self._products: dict[Path, int] = {}
        self._keys = set(group.unknowns)
        self._tangents: dict[Key, Tangent] = {}
        for call in group.calls:
            number = self._jacobian(call)
            for block in call.blocks:
                self._tangents[call.evaluation, block] = self._tangent(call.node, number, block)

    def _jacobian(self, call: Call) -> int:
        """The number of the Jacobian of a call."""
        node = call.node
        is_linear = all(self.structure.dependence(node.piece, block).is_linear for block in call.blocks)
        point = () if is_linear else _middle(node.points) if node.kind == "average" else node.points[0]
        return self._jacobians.setdefault(Jacobian(node.piece, call.blocks, point), len(self._jacobians))

    def _tangent(self, node: Node, number: int, block: int) -> Tangent:
        """Derivatives of a node in a block by the unknowns."""
        total: Tangent = {}
        for weight, point in _arguments(node):
            for source, form in point:
                if source not in self.structure.dependence(node.piece, block).blocks:
                    continue
                for e, x in form.terms:
                    for (unknown, path), y in self._derivative((e, source)).items():
                        key = unknown, ((number, block, source), *path)
                        total[key] = total.get(key, Fraction(0)) + weight * x * y
        return total

    def _derivative(self, key: Key) -> Tangent:
        """Derivatives of a stage derivative that is read, by the unknowns."""
        return {(key, ()): Fraction(1)} if key in self._keys else self._tangents.get(key, {})

    def _entries(self) -> Iterator[tuple[UnknownRange, UnknownRange, Path, Fraction]]:
        """The summands of G′: rows, columns, product of Jacobians, factor."""
        for row in self.unknowns:
            for (unknown, path), factor in self._tangents[row.evaluation, row.block].items():
                for column in self.unknowns:
                    if (column.evaluation, column.block) == unknown:
                        yield row, column, path, factor

    def lines(self) -> list[str]:
        """Statements that assemble and factorize the matrix, in the arrays ``matrix`` and ``pivots``."""
        import sympy

        writer, n = self.writer, self.writer.structure.scene.dimension
        lines: list[str] = []
        for jacobian, number in self._jacobians.items():
            made, at = writer.forms.point(jacobian.point, "z")
            function = writer.functions.jacobian(jacobian.piece, jacobian.blocks)
            lines += [*made, f"{function}({at}, {_jacobian_at(number, n)})"]
        parts: list[int] = []
        factors: list[sympy.Expr] = []
        for row, column, path, factor in self._entries():
            start = self._product(path, lines) * n * n + row.a * n + column.a
            parts += [row.first * self.size + column.first, start, row.b - row.a, column.b - column.a, len(path)]
            factors.append(sympy.Rational(factor.numerator, factor.denominator))
        writer.array("jacobians", n * n * (len(self._jacobians) + len(self._products)))
        matrix, pivots = writer.array("matrix", self.size**2), writer.array("pivots", self.size)
        table = f"{writer.module.integers(parts)}, {writer.module.numbers(factors)}"
        return [
            *lines,
            f"assemble({matrix}, {self.size}, jacobians, {n}, h, {table})",
            f"factorize({matrix}, {pivots}, {self.size})",
        ]

    def _product(self, path: Path, lines: list[str]) -> int:
        """The number of the array of a product of Jacobians; the statements that compute it are added to `lines`."""
        (number, rows, inner), *rest = path
        if not rest:
            return number
        if path not in self._products:
            n, blocks = self.writer.structure.scene.dimension, self.structure.blocks
            other = self._product(tuple(rest), lines)
            self._products[path] = len(self._jacobians) + len(self._products)
            out = _jacobian_at(self._products[path], n)
            lines.append(f"clear({out}, {n * n})")
            lines += [
                f"add_product({out}, {_jacobian_at(number, n)}, {_jacobian_at(other, n)}, {n}, {a}, {b}, {c})"
                for a, b, c in product(blocks[rows], blocks[inner], blocks[path[-1][2]])
            ]
        return self._products[path]


def _arguments(node: Node) -> Iterator[tuple[Fraction, Point]]:
    """Points to which the Jacobian of a node applies, with their weights."""
    if node.kind == "average":
        for j, point in enumerate(node.points):
            yield Fraction(1, int(node.detail) + j + 1), point
    elif node.kind == "flow":
        yield Fraction(node.detail), node.points[0]
    else:
        yield Fraction(1), node.points[-1]


def _middle(path: tuple[Point, ...]) -> Point:
    """The middle of a path, θ = 1/2."""
    forms = dict(path[0])
    for j, point in enumerate(path[1:], 1):
        forms |= {block: forms[block].plus(form, Fraction(1, 2**j)) for block, form in point}
    return tuple(forms.items())


def _jacobian_at(number: int, n: int) -> str:
    return f"shifted(jacobians, {number * n * n})" if number else "jacobians"
