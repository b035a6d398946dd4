"""Implicit stages: fixed-point iteration and Newton's method, iterated until only rounding errors are left.

Stopping earlier, at a tolerance, would leave errors of one sign in every step, and a drift of the energy.

References:
    HLW, section VIII.6 (starting values); Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231–243,
    doi:10.1007/s10543-008-0170-3 (iteration until stagnation); E. Hairer, G. Wanner, *Solving Ordinary Differential
    Equations II*, section IV.8 (Newton's method).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from bseries_base.memory import refuse_beyond_memory
from integrators.compile.printer import Assign, indented
from integrators.core.errors import IntegratorError
from integrators.steppers.step_model import Group, Key, Node, Point
from integrators.steppers.values import Entry, Index, Sum, Value, entry, scaled, written

if TYPE_CHECKING:
    from integrators.steppers.writer import StepWriter

MAX_ITERATIONS = 100
PATIENCE = 50
"""Newton iterations before a restart from k = 0."""
SLOW = 8
"""Contraction below which Newton's method computes a new matrix."""
STALLED = 2
"""Contraction below which small changes count as rounding errors; the last bits may converge very slowly."""


def fixed_point_lines(group: Group, writer: StepWriter) -> list[str]:
    """Statements for k ← G(k), in which an iteration uses only values of the one before."""
    forms = writer.forms
    forms.forget()
    forms.in_group = True
    new = _new_arrays(group, writer)
    iteration = _fixed_point_iteration(group, new, writer)
    forms.in_group = False
    forms.forget()
    compare = [f"change{block} = 0" for block in group.blocks]
    for block in group.blocks:
        arrays = [(new[e], f"k{e}") for e, b in group.unknowns if b == block]
        compare += forms.loop(block, partial(_comparison, f"change{block}", arrays))
    return [
        *_starting_values(group, writer),
        *(f"before{block} = 0" for block in group.blocks),
        "converged, stalls = False, 0",
        f"for iteration in range({MAX_ITERATIONS}):",
        *indented([*iteration, *compare, *_fixed_point_stop(group, writer)]),
        "if not converged:",
        "    break",
    ]


def _comparison(change: str, arrays: Sequence[tuple[str, str]], i: Index) -> Iterator[str]:
    """The new values of an entry: first over its stages, so that the maximum over entries is a vector operation."""
    yield "most = 0"
    for new, old in arrays:
        k = entry(old, i)
        yield from (f"x = {entry(new, i)}", f"most = max(most, bits(abs(x - {k})))", f"{k} = x")
    yield f"{change} = max({change}, most)"


def _fixed_point_iteration(group: Group, new: Mapping[int, str], writer: StepWriter) -> list[str]:
    """Statements for G(k); points that depend on k alone are computed in one loop, which reads k once."""
    calls = [call for call in group.calls if not writer.is_inlined(call)]
    if any(call.node.kind != "field" or call.evaluation not in new for call in calls):
        return [line for call in group.calls for line in writer.call_lines(call, new.get(call.evaluation))]
    points: dict[int, list[Assign[Value]]] = {}
    fields: list[str] = []
    for call in group.calls:
        if writer.is_inlined(call):
            writer.call_lines(call)
            continue
        array = writer.array(f"z{call.evaluation}")
        for block, form in call.node.points[0]:
            points.setdefault(block, []).append(Assign(array, "=", writer.forms.value(block, form)))
        fields.append(f"{writer.functions.field(call.node.piece, call.blocks)}({array}, {new[call.evaluation]})")
    return [*(line for block, lines in points.items() for line in writer.forms.assignments(block, lines)), *fields]


def _fixed_point_stop(group: Group, writer: StepWriter) -> list[str]:
    """Statements that end the iteration on convergence or failure."""
    blocks = group.blocks
    small = [text for block in blocks for text in _negligible_changes(block, group, writer)]
    return [
        f"if {' and '.join(f'change{block} == 0' for block in blocks)}:",
        "    converged = True",
        "    break",
        f"if {' or '.join(f'failed(change{block})' for block in blocks)}:",
        "    break",
        f"if iteration > 1 and {' and '.join(f'change{block} >= before{block}' for block in blocks)}:",
        "    stalls += 1",
        f"    converged = {' and '.join(small)}",
        "    if stalls >= STALLS:",
        f"        converged |= {rounding(blocks, writer)}",
        "    if converged:",
        "        break",
        # the minimum so far: rounding errors of several blocks may alternate forever
        *(f"before{block} = min(before{block}, change{block}) if iteration > 1 else change{block}" for block in blocks),
    ]


def newton_lines(group: Group, writer: StepWriter) -> list[str]:
    """Statements for k ← k + (I − G′)⁻¹ (G(k) − k).

    G′ is evaluated at the starting values and kept until the iteration slows down. If the iteration diverges or takes
    long, it restarts from k = 0 with a new matrix in each iteration.
    """
    forms = writer.forms
    forms.forget()
    matrix = NewtonMatrix(group, writer)
    right = writer.array("right", matrix.size)
    new = _new_arrays(group, writer)
    inner = (call for call in group.calls if call.evaluation not in new)  # points of the matrix need these
    update = [*(line for call in inner for line in writer.call_lines(call)), *matrix.lines()]
    forms.forget()
    iteration = [line for call in group.calls for line in writer.call_lines(call, new.get(call.evaluation))]
    forms.forget()
    for unknown in matrix.unknowns:
        e = unknown.evaluation
        iteration += unknown.loop(f"{unknown.entry(right)} = {new[e]}[i] - k{e}[i]")
    iteration.append(f"solve(matrix, pivots, {matrix.size}, {right})")
    iteration += [f"change{block} = 0" for block in group.blocks]
    for unknown in matrix.unknowns:
        change, x = f"change{unknown.block}", unknown.entry(right)
        iteration += unknown.loop(f"k{unknown.evaluation}[i] += {x}", f"{change} = max({change}, bits(abs({x})))")
    return [
        *_starting_values(group, writer),
        *(f"before{block} = BITS_OF_INFINITY" for block in group.blocks),
        "converged, restarted, stale, stalls = False, False, True, 0",
        f"for iteration in range({MAX_ITERATIONS}):",
        *indented(["if stale:", *indented(update), *iteration, *_newton_stop(group, writer)]),
        "if not converged:",
        "    break",
    ]


def _newton_stop(group: Group, writer: StepWriter) -> list[str]:
    """Statements that end the iteration, restart it, or request a new matrix."""
    blocks = group.blocks
    small = [f"small{block} = {' and '.join(_negligible_changes(block, group, writer))}" for block in blocks]
    over = (f"small{b} and (change{b} == 0 or not falls(change{b}, before{b}, {STALLED}))" for b in blocks)
    slow = (f"not (small{b} or falls(change{b}, before{b}, {SLOW}))" for b in blocks)
    zero = Sum(())
    zeros = [
        line for e, block in group.unknowns for line in writer.forms.assignments(block, [Assign(f"k{e}", "=", zero)])
    ]
    falling = " or ".join(f"falls(change{block}, before{block}, {STALLED})" for block in blocks)
    return [
        *small,
        f"stalls += not ({falling})",
        f"if {' and '.join(over)} or stalls >= STALLS and {rounding(blocks, writer)}:",
        "    converged = True",
        "    break",
        f"if iteration == {PATIENCE} or {' or '.join(f'failed(change{block})' for block in blocks)}:",
        "    if restarted:",
        "        break",
        "    restarted, stale = True, True",
        *indented(zeros),
        *(f"    before{block} = BITS_OF_INFINITY" for block in blocks),
        "    continue",
        f"stale = restarted or {' or '.join(slow)}",
        *(f"before{block} = min(before{block}, change{block})" for block in blocks),  # see fixed-point iteration
    ]


SOLVERS = {"fixed-point": fixed_point_lines, "newton": newton_lines}
"""Writers of implicit groups by the name of the solver."""


def _new_arrays(group: Group, writer: StepWriter) -> dict[int, str]:
    """Arrays for k, which are named by the evaluation, and for G(k)."""
    evaluations = sorted({e for e, _ in group.unknowns})
    for e in evaluations:
        writer.array(f"k{e}")
    return {e: writer.array(f"n{k}") for k, e in enumerate(evaluations)}


def _negligible_changes(block: int, group: Group, writer: StepWriter) -> Iterator[str]:
    """Conditions that the changes in a block are small."""
    for a, b in writer.structure.blocks[block]:
        sizes = [f"largest(k{e}, {a}, {b})" for e, own in group.unknowns if own == block]
        size = f"max({', '.join(sizes)})" if len(sizes) > 1 else sizes[0]
        yield f"negligible(change{block}, {size}, h, y, {a}, {b})"


def rounding(blocks: Sequence[int], writer: StepWriter) -> str:
    """Condition that rounding errors of the state explain all changes."""
    dimension = writer.structure.scene.dimension
    return " and ".join(f"within_rounding(change{block}, h, y, {dimension})" for block in blocks)


def _starting_values(group: Group, writer: StepWriter) -> list[str]:
    """Statements that extrapolate the stage derivatives of the last step by their interpolation polynomial."""
    lines: list[str] = []
    for block in group.blocks:
        own = [e for e, b in group.unknowns if b == block]
        nodes = [writer.plan.abscissas[e] for e in own]
        if len(own) > 1 and len(set(nodes)) == len(nodes):
            sums = [
                Sum(tuple(scaled(Entry(f"k{e}"), _lagrange(nodes, j, 1 + node)) for j, e in enumerate(own)))
                for node in nodes
            ]
            lines += writer.forms.loop(block, partial(_extrapolation, sums, own))
    return lines


def _extrapolation(sums: Sequence[Sum], own: Sequence[int], i: Index) -> Iterator[str]:
    """New values of an entry of some stage derivatives, all computed before the first is stored."""
    yield from (f"s{k} = {written(total, i)}" for k, total in enumerate(sums))
    yield from (f"{entry(f'k{e}', i)} = s{k}" for k, e in enumerate(own))


def _lagrange(nodes: Sequence[Fraction], j: int, x: Fraction) -> Fraction:
    """The Lagrange basis polynomial of node j at x."""
    value = Fraction(1)
    for k, node in enumerate(nodes):
        if k != j:
            value *= (x - node) / (nodes[j] - node)
    return value


def first_values(group: Group, writer: StepWriter) -> list[str]:
    """Statements for the stage derivatives before the first step: the field at y."""
    lines = []
    for e, block in group.unknowns:
        piece = next(call.node.piece for call in group.calls if call.evaluation == e and block in call.blocks)
        lines.append(f"{writer.functions.field(piece, (block,))}(y, k{e})")
    return lines


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
        return entry(array, "i", self.first - self.a)

    def loop(self, *lines: str) -> list[str]:
        """A loop over the entries."""
        return [f"for i in range({self.a}, {self.b}):", *indented(lines)]


class NewtonMatrix:
    """The matrix of an implicit group.

    Intermediate stage derivatives give products of Jacobians. The Jacobian of an average is approximated by that at
    the middle of the path, and that of a flow by that of its piece; second derivatives are neglected.

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
            node = call.node
            is_linear = all(self.structure.dependence(node.piece, block).is_linear for block in call.blocks)
            point = () if is_linear else _middle(node.points) if node.kind == "average" else node.points[0]
            number = self._jacobians.setdefault(Jacobian(node.piece, call.blocks, point), len(self._jacobians))
            for e, block in call.written:
                self._tangents[e, block] = self._tangent(node, number, block)

    def _tangent(self, node: Node, number: int, block: int) -> Tangent:
        """Derivatives of a node in a block by the unknowns."""
        total: Tangent = {}
        arguments = [(Fraction(1), node.points[-1])]
        if node.kind == "average":
            arguments = [(Fraction(1, int(node.detail) + j + 1), point) for j, point in enumerate(node.points)]
        elif node.kind == "flow":
            arguments = [(Fraction(node.detail), node.points[0])]
        for weight, point in arguments:
            for source, form in point:
                if source not in self.structure.dependence(node.piece, block).blocks:
                    continue
                for e, x in form.terms:
                    read: Tangent = {((e, source), ()): Fraction(1)}
                    if (e, source) not in self._keys:
                        read = self._tangents.get((e, source), {})
                    for (unknown, path), y in read.items():
                        key = unknown, ((number, block, source), *path)
                        total[key] = total.get(key, Fraction(0)) + weight * x * y
        return total

    def _entries(self) -> Iterator[tuple[UnknownRange, UnknownRange, Path, Fraction]]:
        """The summands of G′: rows, columns, product of Jacobians, factor."""
        for row in self.unknowns:
            for (unknown, path), factor in self._tangents[row.evaluation, row.block].items():
                for column in self.unknowns:
                    if (column.evaluation, column.block) == unknown:
                        yield row, column, path, factor

    def lines(self) -> list[str]:
        """Statements that assemble and factorize the matrix, in the arrays ``matrix`` and ``pivots``."""
        writer, n = self.writer, self.writer.structure.scene.dimension
        lines: list[str] = []
        for jacobian, number in self._jacobians.items():
            made, at = writer.forms.point(jacobian.point, "z")
            function = writer.functions.jacobian(jacobian.piece, jacobian.blocks)
            lines += [*made, f"{function}({at}, {_jacobian_at(number, n)})"]
        parts: list[int] = []
        factors: list[Fraction] = []
        for row, column, path, factor in self._entries():
            start = self._product(path, lines) * n * n + row.a * n + column.a
            parts += [row.first * self.size + column.first, start, row.b - row.a, column.b - column.a, len(path)]
            factors.append(factor)
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


def _middle(path: tuple[Point, ...]) -> Point:
    """The middle of a path, θ = 1/2."""
    forms = dict(path[0])
    for j, point in enumerate(path[1:], 1):
        forms |= {block: forms[block].plus(form, Fraction(1, 2**j)) for block, form in point}
    return tuple(forms.items())


def _jacobian_at(number: int, n: int) -> str:
    return f"shifted(jacobians, {number * n * n})" if number else "jacobians"
