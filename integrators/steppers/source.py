"""From a plan to the source of the compiled function that makes steps.

The state, the points and the stage derivatives are small arrays on the stack, in the order of the state. Each block of
variables is a loop over its entries, which lowering turns into vector operations or, if it is short, unrolls.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from integrators.compile.printer import indented
from integrators.steppers.adaptive import ControlText, control_text
from integrators.steppers.flows import average_lines, flow_lines
from integrators.steppers.functions import diagonal
from integrators.steppers.implicit_stages import SOLVERS, first_values
from integrators.steppers.nodes import Nodes
from integrators.steppers.step_model import Call, Form, Group, Key, Options, Plan
from integrators.steppers.writer import StepWriter, derivative_lines, field_call_lines, resolvent_lines

TEMPLATE = '''\
"""Steps of a method on a scene.

{state}
"""

{imports}
from integrators.compile.lowering.units import lowered
{kernels}

{constants}
'''
KERNELS = {
    "integrators.steppers.kernels": (
        "BITS_OF_INFINITY", "STALLS", "add_product", "add_products", "assemble", "begin_flow", "clear", "end_flow",
        "extrapolate", "factorize", "failed", "falls", "flow_point", "growth", "has_converged", "largest",
        "midpoint_step", "negligible", "next_interval", "solve", "subtract_from_identity", "within_rounding",
    ),
    "integrators.compile.machine": ("STEPS", "bits", "fma", "pointer", "shifted", "stack", "steps_in_c"),
}  # fmt: skip
"""Kernels that generated steps may import, by module."""
SIGNATURE = "source, compensation, m, controls, constants, w, h, steps, fresh"


CALLS = {
    "field": field_call_lines,
    "derivative": derivative_lines,
    "average": average_lines,
    "flow": flow_lines,
    "resolvent": resolvent_lines,
}
"""Writers of calls by the kind of node."""


class StepSource(NamedTuple):
    """The source of a step.

    Attributes:
        text: The text of the module; its function ``advance`` makes steps.
        memory: The number of doubles besides the state that are kept from step to step.
        work: The number of doubles of work arrays that the caller must provide.
        numbers: Functions of h whose values, concatenated, are the numbers that depend on the step size.
        iterates: Whether there are implicit stages that are iterated.
    """

    text: str
    memory: int
    work: int
    numbers: tuple[Callable[[float], np.ndarray], ...]
    iterates: bool


def step_source(nodes: Nodes, plan: Plan, options: Options) -> StepSource:
    """Write the source of a step.

    References:
        Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231–243, doi:10.1007/s10543-008-0170-3 (split coefficients,
        compensation, iteration until stagnation).
    """
    # the first pass finds stage derivatives that are read once, and the second substitutes them where they are read
    once = _Step(StepWriter(nodes, plan, CALLS, options, once=frozenset())).read_once()
    return _Step(StepWriter(nodes, plan, CALLS, options, once)).source()


class _Step:
    """A planned step and the writer of its module."""

    def __init__(self, writer: StepWriter):
        self.writer, self.plan, self.structure, self.forms = writer, writer.plan, writer.structure, writer.forms

    def read_once(self) -> frozenset[Key]:
        """Stage derivatives of diagonal pieces that only the next call reads and that can be substituted there."""
        self._body_lines()
        iterated = {e for group in self.plan.groups for e, _ in group.unknowns}
        found: set[Key] = set()
        for number, (call, following) in enumerate(pairwise(self.writer.written)):
            e, (block, *others) = call.evaluation, call.blocks
            chosen = diagonal(self.structure, call.node.piece, block) if call.node.kind == "field" else None
            if chosen is None or others or e in iterated or (e, block) in self.plan.reused.values():
                continue
            read = {source for point in following.node.points for source, _ in point}
            if self.forms.readers.get(e, set()) <= {number, number + 1} and chosen.source not in read:
                found.add((e, block))
        return frozenset(found)

    def _body_lines(self) -> list[str]:
        """Statements of a step."""
        lines = [line for work in self.plan.computed for line in self._work_lines(work)]
        lines += [line for block, form in self.plan.result.items() for line in self.forms.update(block, form)]
        self.forms.end_step()
        return lines

    def source(self) -> StepSource:
        """Write the module."""
        writer, module = self.writer, self.writer.module
        body = [*self._body_lines(), *self._reuse_lines()]
        first = self._first_lines()
        load, store, memory = self._memory_lines()
        formula = writer.options.control
        control = ControlText() if formula is None else control_text(formula, writer)
        first += self._kick_lines()
        start = ["if fresh:", *indented([*control.fresh, *first])] if control.fresh or memory else []
        start += ["else:", *indented(load)] if memory else []
        loop = ["done = 0", "while done < steps:", *indented([*control.before, *body, *control.after, "done += 1"])]
        steps = [*control.load, *start, *loop, *store, *control.store]
        arrays, work = writer.array_lines()
        lines = [
            *arrays,
            *self._state_lines("y[i] = source[i]", "e[i] = compensation[i]"),
            *steps,
            *self._state_lines("source[i] = y[i]", "compensation[i] = e[i]"),
            *self._unstaggered_lines(),
            "return done",
        ]
        writer.functions.write()
        module.function(f"advance({SIGNATURE})", "Make steps, and count those that succeed.", lines, "@lowered(STEPS)")
        module.function(f"in_c({SIGNATURE})", "The same in C.", [f"return advance({SIGNATURE})"], "@steps_in_c")
        template = TEMPLATE.replace("{kernels}", _kernel_imports(module.bodies))
        text = module.source(self.structure.scene, template)
        return StepSource(text, memory, work, tuple(writer.numbers), bool(self.plan.groups))

    def _work_lines(self, work: Call | Group) -> list[str]:
        if isinstance(work, Call):
            return self.writer.call_lines(work)
        return SOLVERS[self.writer.options.solver](work, self.writer)

    def _first_lines(self) -> list[str]:
        """Statements before the first step, for stage derivatives that each step takes over from the one before."""
        reused = [work for work in self.plan.work if isinstance(work, Call) and self.plan.is_reused(work)]
        lines = [line for work in reused for line in self.writer.call_lines(work)]
        return [*lines, *(line for group in self.plan.groups for line in first_values(group, self.writer))]

    def _kick_lines(self) -> list[str]:
        """Statements for the first kick of a run, where kicks of successive steps are merged."""
        starts = (self.forms.update(block, Form(Fraction(1), kicks)) for block, kicks in self.plan.staggered.items())
        return [line for lines in starts for line in lines]

    def _unstaggered_lines(self) -> list[str]:
        """Statements that undo the first kick of the next step in the state that is returned."""
        lines: list[str] = []
        for block, kicks in self.plan.staggered.items():
            lines += self.forms.loop(block, [f"source[i] = y[i] - h*({self.forms.sum(block, kicks)})"])
        return lines

    def _reuse_lines(self) -> list[str]:
        """Statements that copy stage derivatives for the next step."""
        copies = (
            self.forms.loop(block, [f"k{start}[i] = k{end}[i]"])
            for (start, block), (end, _) in self.plan.reused.items()
        )
        return [line for lines in copies for line in lines]

    def _memory_lines(self) -> tuple[list[str], list[str], int]:
        """Statements that load and store everything that is kept from step to step, and its size."""
        derivatives = (*self.plan.reused, *(key for group in self.plan.groups for key in group.unknowns))
        kept = [(f"k{e}", block) for e, block in derivatives] + [("y", block) for block in self.plan.staggered]
        load: list[str] = []
        store: list[str] = []
        size = 0
        for name, block in kept:
            for a, b in self.structure.blocks[block]:
                index = f"m[i + {size - a}]" if size >= a else f"m[i - {a - size}]"
                load += [f"for i in range({a}, {b}):", f"    {name}[i] = {index}"]
                store += [f"for i in range({a}, {b}):", f"    {index} = {name}[i]"]
                size += b - a
        return load, store, size

    def _state_lines(self, line: str, compensating: str) -> list[str]:
        """Loops over the whole state, one for each block, as in the step itself."""
        lines = [line, *([compensating] * self.writer.options.compensated)]
        return [text for block in range(len(self.structure.blocks)) for text in self.forms.loop(block, lines)]


def _kernel_imports(text: str) -> str:
    """The statements that import the kernels that a text uses."""
    words = set(re.findall(r"\w+", text))
    used = {module: [name for name in names if name in words] for module, names in KERNELS.items()}
    return "\n".join(f"from {module} import {', '.join(x)}" for module, x in used.items() if x)
