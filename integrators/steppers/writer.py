"""Writer of a step: the module under construction, its arrays and functions.

A `StepWriter` provides what every kind of call needs. Calls of the field, its derivative and its resolvent are written
here; averages, flows and implicit stages have files of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

import numpy as np
import sympy

from integrators.compile.operation_graph import simplest
from integrators.compile.printer import ModuleText
from integrators.exact.entries import round_entry
from integrators.exact.expressions import literal
from integrators.steppers.forms import FormWriter, grouped
from integrators.steppers.functions import Diagonal, Functions, diagonal
from integrators.steppers.nodes import Nodes
from integrators.steppers.step_model import Call, Key, Options, Plan

MOST_STACK = 32_768
"""Doubles of work arrays on the stack, half of a small thread's stack. Beyond, the caller provides an array."""


class WorkArrays:
    """Work arrays, constants, and numbers that depend on the step size.

    Attributes:
        module: The same.
        numbers: Functions of h whose values, concatenated, are the numbers that depend on the step size.
    """

    def __init__(self, dimension: int, module: ModuleText):
        self.module = module
        self.numbers: list[Callable[[float], np.ndarray]] = []
        self._dimension, self._number_count = dimension, 0
        self._sizes: dict[str, int] = {}
        self._constants: dict[str, str] = {}

    def array(self, name: str, size: int | None = None) -> str:
        """Declare a work array, by default of the size of the state, and return its name."""
        self._sizes[name] = max(self._sizes.get(name, 0), size or self._dimension)
        return name

    def constants(self, values: Sequence[sympy.Expr]) -> str:
        """A pointer to constants; indices of pointers, unlike those of arrays, are not tested for their sign."""
        name = self.module.numbers(values)
        return self._constants.setdefault(name, name.lower())

    def number_array(self, count: int, values: Callable[[float], np.ndarray]) -> str:
        """A pointer to numbers that depend on the step size only."""
        self.numbers.append(values)
        self._number_count += count
        return f"shifted(constants, {self._number_count - count})"

    def array_lines(self) -> tuple[list[str], int]:
        """Statements that create the arrays, and the number of doubles that the caller must provide.

        Arrays on the stack do not overlap, and LLVM keeps short ones in registers.
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
    """The module of a stepper while its step is written.

    Args:
        nodes: The nodes of the method on the scene.
        plan: The plan of the step.
        calls: The writers of calls, by the kind of node.
        options: The options of the step.
        once: Stage derivatives that only the next call reads, and that are substituted into its point.

    Attributes:
        structure: The blocks of variables and the pieces of the field.
        functions: The pieces of the field as functions.
        forms: The writer of linear combinations.
        averaged: The call whose values along its path are still stored.
        known: Names of arrays and functions that flows have already defined.
        matrices: Names of the matrices factorized in this step.
        written: The calls so far.
    """

    def __init__(
        self, nodes: Nodes, plan: Plan, calls: Mapping[str, CallWriter], options: Options, once: frozenset[Key]
    ):
        structure = nodes.structure
        super().__init__(structure.scene.dimension, ModuleText(lanes=True, plain=True))
        self.structure, self.plan, self.options, self.once = structure, plan, options, once
        self.averaged: object = None
        self.known: dict[object, str] = {}
        self.matrices: dict[object, str] = {}
        self.written: list[Call] = []
        self._calls = calls
        self.functions = Functions(structure, self.module)
        iterates = bool(plan.groups)
        points = None if iterates else plan.points()
        self.forms = FormWriter(structure, plan.result, points, options.compensated, options.split and iterates)
        for name in ("y", "z", "d", *(["e"] * options.compensated)):
            self.array(name)

    def call_lines(self, call: Call, target: str | None = None) -> list[str]:
        """Statements for a call and its points.

        Args:
            call: The call.
            target: The array for the stage derivatives; by default the one from which others read them.
        """
        if target is None and not self.is_inlined(call):
            target = self.array(f"k{call.evaluation}")
        self.forms.reader = len(self.written)
        self.written.append(call)
        lines = self._calls[call.node.kind](call, target or "", self)
        self.forms.reader = None
        return lines

    def is_inlined(self, call: Call) -> bool:
        """Whether the stage derivative of a call is substituted into the point that needs it."""
        return (call.evaluation, call.blocks[0]) in self.once


CallWriter: TypeAlias = Callable[["Call", str, StepWriter], list[str]]
"""Maps a call, the name of an array for its stage derivatives and a writer to statements."""


def field_call_lines(call: Call, target: str, writer: StepWriter) -> list[str]:
    """Statements for a piece of the field at a point; diagonal blocks are written as loops, or where they are read."""
    point, piece, forms = call.node.points[0], call.node.piece, writer.forms
    scaling = {block: diagonal(writer.structure, piece, block) for block in call.blocks}
    if len(call.blocks) == 1 and (call.evaluation, call.blocks[0]) in writer.once and forms.in_group:
        chosen = scaling[call.blocks[0]]
        assert chosen is not None  # ensured by read_once
        text = forms.entry(chosen.source, dict(point)[chosen.source])
        forms.inlined[call.evaluation, call.blocks[0]] = _scaled(chosen, text, writer)
        return []
    lines, at = forms.point(point, "z")
    others = []
    for block, chosen in scaling.items():
        if chosen is None:
            others.append(block)
            continue
        text = _scaled(chosen, f"{at}[i]", writer)
        if (call.evaluation, block) in writer.once:
            forms.inlined[call.evaluation, block] = text
        else:
            lines += forms.loop(block, [f"{target}[i] = {text}"])
    if others:
        lines.append(f"{writer.functions.field(piece, others)}({at}, {target})")
    return lines


def derivative_lines(call: Call, target: str, writer: StepWriter) -> list[str]:
    """Statements for the derivative at a point along a vector; one array holds both."""
    at, along = call.node.points
    dimension = writer.structure.scene.dimension
    tangent = writer.array("tangent", 2 * dimension)
    name = writer.functions.derivative(call.node.piece, call.blocks)
    return [
        *writer.forms.point(at, tangent, copied=True)[0],
        f"along = shifted({tangent}, {dimension})",
        *writer.forms.point(along, "along", copied=True)[0],
        f"{name}({tangent}, {target})",
    ]


def resolvent_lines(call: Call, target: str, writer: StepWriter) -> list[str]:
    """Statements for s = (I − hγ F′)⁻¹ r, in which equal matrices are factorized once per step.

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
    for block, form in right:
        lines += writer.forms.loop(block, [f"{target}[i] = {writer.forms.sum(block, form.terms) or '0.0'}"])
    return [*lines, f"solve({matrix}, {pivots}, {n}, {target})"]


def _scaled(chosen: Diagonal, text: str, writer: StepWriter) -> str:
    """Entry i of a diagonal piece, where the text stands for y[i]."""
    moved = text.replace("[i]", f"[i - {chosen.shift}]" if chosen.shift > 0 else f"[i + {-chosen.shift}]")
    if chosen.factors == (1,):
        return moved
    if len(chosen.factors) == 1:
        return f"{literal(simplest(chosen.factors[0]))}*{grouped(moved)}"
    return f"{writer.constants(chosen.factors)}[i - {chosen.first}]*{grouped(moved)}"
