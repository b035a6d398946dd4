"""What one step is written into: the module, its arrays and functions, and what is known of them so far.

A `StepWriter` has the parts that every kind of call needs; the calls of the field, its derivative and resolvent are
written here. Averages, flows and the iterations of implicit slopes have files of their own, which take a writer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

from integrators.compile.operation_graph import simplest
from integrators.compile.scene_source import ModuleText
from integrators.exact.entries import round_entry
from integrators.exact.number_text import literal
from integrators.steppers.forms import FormWriter, grouped
from integrators.steppers.functions import Functions, diagonal

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from integrators.steppers.functions import Diagonal
    from integrators.steppers.nodes import Key, Nodes
    from integrators.steppers.plan import Call, Plan


MOST_STACK = 32_768
"""Doubles of work arrays on the stack: a small thread has twice the room. Beyond, the caller brings an array."""


class WorkArrays:
    """Work arrays, constants, and numbers that depend on the step size.

    Args:
        dimension: The number of variables.
        module: The module that they are for.

    Attributes:
        module: The same.
        numbers: Functions of h that give, one after the other, the numbers that depend on it.
    """

    def __init__(self, dimension: int, module: ModuleText):
        self.module = module
        self.numbers: list[Callable[[float], np.ndarray]] = []
        self._dimension, self._number_count = dimension, 0
        self._sizes: dict[str, int] = {}
        self._constants: dict[str, str] = {}

    def array(self, name: str, size: int | None = None) -> str:
        """The name of a work array; by default it has the size of the state."""
        self._sizes[name] = max(self._sizes.get(name, 0), size or self._dimension)
        return name

    def constants(self, values: Sequence[sympy.Expr]) -> str:
        """A pointer to constants: unlike an array it is not asked whether indices are negative."""
        name = self.module.numbers(values)
        return self._constants.setdefault(name, name.lower())

    def number_array(self, count: int, values: Callable[[float], np.ndarray]) -> str:
        """The beginning of an array of numbers that depend on the step size only, as a pointer.

        Args:
            count: How many there are.
            values: Computes them from h.
        """
        self.numbers.append(values)
        self._number_count += count
        return f"shifted(constants, {self._number_count - count})"

    def array_lines(self) -> tuple[list[str], int]:
        """Statements that make the arrays, and how many doubles the caller must bring.

        LLVM knows of arrays on the stack that they do not overlap, and puts short ones into registers.
        """
        lines = [f"{name} = pointer({array})" for array, name in self._constants.items()]
        total = sum(self._sizes.values())
        if total <= MOST_STACK:
            return [*lines, *(f"{name} = stack({size})" for name, size in self._sizes.items())], 0
        offset = 0
        for name, size in self._sizes.items():
            lines.append(f"{name} = shifted(w, {offset})")
            offset += size
        return lines, total


class StepWriter(WorkArrays):
    """The parts of a stepper's module while its step is written.

    Args:
        nodes: The nodes.
        plan: The step.
        calls: What writes a call, by the kind of its node.
        compensated: Whether rounding errors of sums are carried on.
        split: Whether coefficients of implicit methods are split.
        average_nodes: The number of nodes for averages of fields that are no polynomials.
        varies: Whether the step size varies.
        once: Slopes that only the next call reads, so that they can be written as part of its point.

    Attributes:
        structure: What the pieces of the field are like.
        functions: The pieces of the field as functions.
        forms: Writes points and sums.
        averaged: What the values of the field along a path are of, if they are known.
        known: Arrays of numbers and functions for flows that have been asked for.
        matrices: The names of factorized matrices of this step.
        written: The calls so far, with their lines.
    """

    def __init__(
        self,
        nodes: Nodes,
        plan: Plan,
        calls: Mapping[str, CallWriter],
        *,
        compensated: bool,
        split: bool,
        average_nodes: int | None,
        varies: bool,
        once: frozenset[Key],
    ):
        structure = nodes.structure
        super().__init__(structure.scene.dimension, ModuleText(precise=False, lanes=True, plain=True))
        self.nodes, self.structure, self.plan = nodes, structure, plan
        self.average_nodes, self.varies, self.once = average_nodes, varies, once
        self.compensated = compensated
        self.averaged: object = None
        self.known: dict[object, str] = {}
        self.matrices: dict[object, str] = {}
        self.written: list[tuple[Call, list[str]]] = []
        self._calls = calls
        self.functions = Functions(structure, self.module)
        iterates = bool(plan.groups)
        points = None if iterates else plan.points()
        self.forms = FormWriter(structure, plan.result, points, compensated, split and iterates)
        for name in ("y", "z", "d", *(["e"] * compensated)):
            self.array(name)

    def call_lines(self, call: Call, target: str | None = None) -> list[str]:
        """The points of a call, and the call.

        Args:
            call: The call.
            target: Where the slopes go; by default where everything else finds them.
        """
        lines = self._calls[call.node.kind](call, target or f"k{call.evaluation}", self)
        self.written.append((call, lines))
        return lines

    def is_inlined(self, call: Call) -> bool:
        """Whether the slope of a call is written as part of the point that needs it."""
        return (call.evaluation, call.cells[0]) in self.once


CallWriter: TypeAlias = Callable[["Call", str, StepWriter], list[str]]
"""Gives the statements that put the slopes of a call into the array of a name."""


def field_call_lines(call: Call, target: str, writer: StepWriter) -> list[str]:
    """A piece of the field at a point; cells where it only scales are written as loops, or not before they are read."""
    point, piece, forms = call.node.points[0], call.node.piece, writer.forms
    scaling = {cell: diagonal(writer.structure, piece, cell) for cell in call.cells}
    if len(call.cells) == 1 and (call.evaluation, call.cells[0]) in writer.once and forms.in_group:
        chosen = scaling[call.cells[0]]
        assert chosen is not None  # read_once has found it
        text = forms.entry(chosen.source, dict(point)[chosen.source])
        forms.inlined[call.evaluation, call.cells[0]] = _scaled(chosen, text, writer)
        return []
    lines, at = forms.point(point, "z")
    others = []
    for cell, chosen in scaling.items():
        if chosen is None:
            others.append(cell)
            continue
        text = _scaled(chosen, f"{at}[i]", writer)
        if (call.evaluation, cell) in writer.once:
            forms.inlined[call.evaluation, cell] = text
        else:
            lines += forms.loop(cell, [f"{target}[i] = {text}"])
    if others:
        lines.append(f"{writer.functions.field(piece, others)}({at}, {target})")
    return lines


def derivative_lines(call: Call, target: str, writer: StepWriter) -> list[str]:
    """Statements for the derivative at a point along a vector, which lie one behind the other in one array."""
    at, along = call.node.points
    dimension = writer.structure.scene.dimension
    tangent = writer.array("tangent", 2 * dimension)
    name = writer.functions.derivative(call.node.piece, call.cells)
    return [
        *writer.forms.point(at, tangent, copied=True)[0],
        f"along = shifted({tangent}, {dimension})",
        *writer.forms.point(along, "along", copied=True)[0],
        f"{name}({tangent}, {target})",
    ]


def resolvent_lines(call: Call, target: str, writer: StepWriter) -> list[str]:
    """Statements for s = (I − hγ F′)⁻¹ r. Equal matrices are factorized once in a step.

    References:
        E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, section IV.7.
    """
    at, right = call.node.points
    n, piece, own = writer.structure.scene.dimension, call.node.piece, call.node.detail
    key = piece, at, own
    is_new = key not in writer.matrices
    name = writer.matrices.setdefault(key, str(len(writer.matrices)))
    matrix, pivots = writer.array(f"matrix{name}", n * n), writer.array(f"pivots{name}", n)
    lines: list[str] = []
    if is_new:
        lines, point = writer.forms.point(at, "z")
        jacobian = writer.functions.jacobian(piece, writer.structure.writes(piece))
        lines.append(f"{jacobian}({point}, {matrix})")
        lines.append(f"subtract_from_identity({matrix}, {n}, h*{round_entry(own)!r})")
        lines.append(f"factorize({matrix}, {pivots}, {n})")
    for cell, form in right:
        lines += writer.forms.loop(cell, [f"{target}[i] = {writer.forms.sum(cell, form.terms) or '0.0'}"])
    return [*lines, f"solve({matrix}, {pivots}, {n}, {target})"]


def _scaled(chosen: Diagonal, text: str, writer: StepWriter) -> str:
    """The entry i of a diagonal piece, if the text is that of y[i]."""
    moved = text.replace("[i]", f"[i - {chosen.shift}]" if chosen.shift > 0 else f"[i + {-chosen.shift}]")
    if chosen.factors == (1,):
        return moved
    if len(chosen.factors) == 1:
        return f"{literal(simplest(chosen.factors[0]))}*{grouped(moved)}"
    return f"{writer.constants(chosen.factors)}[i - {chosen.first}]*{grouped(moved)}"
