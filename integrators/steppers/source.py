"""From a plan to the source of the compiled function that makes steps.

The state, the points and the stage derivatives are small arrays on the stack, in the order of the state. Each block of
variables is a loop over its entries, which lowering turns into vector operations or, if it is short, unrolls.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np

from bseries_base.machine_code import MachineCode
from integrators.compile.c_functions import c_function
from integrators.compile.printer import Assign, indented
from integrators.steppers.adaptive import ControlText, control_text
from integrators.steppers.flows import average_lines, flow_lines
from integrators.steppers.implicit_stages import SOLVERS, first_values
from integrators.steppers.step_model import Call, Form, Key, Options, Plan
from integrators.steppers.structure import Structure, diagonal
from integrators.steppers.values import Entry, Product, Sum, entry
from integrators.steppers.writer import StepWriter, derivative_lines, field_call_lines, resolvent_lines

TEMPLATE = '''\
"""Steps of a method on a scene.

{state}
"""

{imports}
{kernels}

{constants}
'''
KERNELS = {
    "integrators.steppers.kernels": (
        "BITS_OF_INFINITY", "STALLS", "add_product", "add_products", "assemble", "begin_flow", "clear", "end_flow",
        "extrapolate", "factorize", "failed", "falls", "flow_point", "growth", "has_converged", "largest",
        "midpoint_step", "negligible", "next_interval", "solve", "subtract_from_identity", "within_rounding",
    ),
    "integrators.compile.c_functions": ("STEPS",),
    "integrators.compile.machine": ("bits", "fma", "in_c", "pointer", "shifted", "stack"),
}  # fmt: skip
"""Kernels that generated steps may import, by module."""


def source_of(module: str) -> Path:
    """The file of a module, which is not imported."""
    return Path(str(find_spec(module).origin))  # pyright: ignore[reportOptionalMemberAccess]


HELPERS = tuple(map(source_of, (*KERNELS, "integrators.steppers.adaptive")))
"""The files on which the machine code of steps depends, besides their text."""
SIGNATURE = "source, compensation, m, controls, constants, w, h, steps, fresh"


CALLS = {
    "field": field_call_lines,
    "derivative": derivative_lines,
    "average": average_lines,
    "flow": flow_lines,
    "resolvent": resolvent_lines,
}
"""Writers of calls by the kind of node."""


@dataclass(frozen=True)
class StepSource:
    """The source of a step and, from its first use, its machine code.

    Attributes:
        text: The text of the module; its function ``advance`` makes steps.
        memory: The number of doubles besides the state that are kept from step to step.
        work: The number of doubles of work arrays that the caller must provide.
        numbers: Functions of h whose values, concatenated, are the numbers that depend on the step size.
        iterates: Whether there are implicit stages that are iterated.
        past: The entries of each vector of the past, which are at the end of the memory.
    """

    text: str
    memory: int
    work: int
    numbers: tuple[Callable[[float], np.ndarray], ...]
    iterates: bool
    past: tuple[int, ...] = ()

    @cached_property
    def code(self) -> MachineCode:
        """The machine code, a C function of type `STEPS`."""
        return c_function(self.text, "advance", helpers=HELPERS)


def step_source(structure: Structure, plan: Plan, options: Options) -> StepSource:
    """Write the source of a step.

    References:
        Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231–243, doi:10.1007/s10543-008-0170-3 (split coefficients,
        compensation, iteration until stagnation).
    """
    # the first pass finds stage derivatives that are read once, and the second substitutes them where they are read
    once = WrittenStep(StepWriter(structure, plan, CALLS, options)).read_once()
    return WrittenStep(StepWriter(structure, plan, CALLS, options, once)).source()


class WrittenStep:
    """A planned step and the writer of its module."""

    def __init__(self, writer: StepWriter):
        self.writer, self.plan, self.structure, self.forms = writer, writer.plan, writer.structure, writer.forms

    def read_once(self) -> frozenset[Key]:
        """Stage derivatives of diagonal pieces that only the next call reads and that can be substituted there."""
        self.body_lines()
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

    def body_lines(self) -> list[str]:
        """Statements of a step."""
        writer, solver = self.writer, SOLVERS[self.writer.options.solver]
        lines: list[str] = []
        for work in self.plan.computed:
            lines += writer.call_lines(work) if isinstance(work, Call) else solver(work, writer)
        lines += [line for block, form in self.plan.result.items() for line in self.forms.update(block, form)]
        for e, terms in self.plan.past:
            target = writer.array(f"k{e}")
            for block in self.plan.moved:
                lines += self.forms.assignments(block, [Assign(target, "=", self.forms.sum(block, terms))])
        self.forms.end_step()
        return lines

    def source(self) -> StepSource:
        """Write the module."""
        writer, forms, module = self.writer, self.forms, self.writer.module
        body = self.body_lines()
        for (e, block), (end, _) in self.plan.reused.items():
            body += forms.assignments(block, [Assign(f"k{e}", "=", Entry(f"k{end}"))])
        first: list[str] = []  # stage derivatives that each later step takes over from the one before
        for work in (work for work in self.plan.work if isinstance(work, Call) and self.plan.is_reused(work)):
            first += writer.call_lines(work)
        for group in self.plan.groups:
            first += first_values(group, writer)
        derivatives = (*self.plan.reused, *(key for group in self.plan.groups for key in group.unknowns))
        kept = [(f"k{e}", block) for e, block in derivatives] + [("y", block) for block in self.plan.staggered]
        load, store, memory = self._memory_lines(kept)
        past = [(f"k{e}", block) for e, _ in self.plan.past for block in self.plan.moved]
        load_past, store_past, size_of_all = self._memory_lines(past, memory)
        formula = writer.options.control
        control = ControlText() if formula is None else control_text(formula, writer)
        last: list[str] = []
        for block, kicks in self.plan.staggered.items():  # kicks of successive steps are merged
            first += forms.update(block, Form(Fraction(1), kicks))
            taken = Product("h", forms.sum(block, kicks), negative=True)
            last += forms.assignments(block, [Assign("source", "=", Sum((Entry("y"), taken)))])
        start = ["if fresh:", *indented([*control.fresh, *first])] if control.fresh or memory else []
        start += ["else:", *indented(load)] if memory else []
        start += load_past
        loop = ["done = 0", "while done < steps:", *indented([*control.before, *body, *control.after, "done += 1"])]
        steps = [*control.load, *start, *loop, *store, *store_past, *control.store]
        arrays, size = writer.array_lines()
        lines = [
            *arrays,
            *self._state_lines(("y", "source"), ("e", "compensation")),
            *steps,
            *self._state_lines(("source", "y"), ("compensation", "e")),
            *last,
            "return done",
        ]
        writer.functions.write()
        module.function(f"advance({SIGNATURE})", "Make steps, and count those that succeed.", lines, "@in_c(STEPS)")
        words = set(re.findall(r"\w+", module.bodies))
        used = {home: [name for name in names if name in words] for home, names in KERNELS.items()}
        kernels = "\n".join(f"from {home} import {', '.join(names)}" for home, names in used.items() if names)
        text = module.source(self.structure.scene, TEMPLATE.replace("{kernels}", kernels))
        moved = [range(a, b) for block in self.plan.moved for a, b in self.structure.blocks[block]]
        entries = tuple(i for part in moved for i in part) if past else ()
        return StepSource(text, size_of_all, size, tuple(writer.numbers), bool(self.plan.groups), entries)

    def _memory_lines(self, kept: list[tuple[str, int]], size: int = 0) -> tuple[list[str], list[str], int]:
        """Statements that load and store arrays that are kept from step to step, and the end of their memory."""
        load: list[str] = []
        store: list[str] = []
        for name, block in kept:
            for a, b in self.structure.blocks[block]:
                kept_at, loop = entry("m", "i", size - a), f"for i in range({a}, {b}):"
                load += [loop, f"    {name}[i] = {kept_at}"]
                store += [loop, f"    {kept_at} = {name}[i]"]
                size += b - a
        return load, store, size

    def _state_lines(self, *copies: tuple[str, str]) -> list[str]:
        """Loops that copy the whole state and its compensation, one for each block."""
        used = copies if self.writer.options.compensated else copies[:1]
        body = [Assign(to, "=", Entry(origin)) for to, origin in used]
        return [text for block in range(len(self.structure.blocks)) for text in self.forms.assignments(block, body)]
