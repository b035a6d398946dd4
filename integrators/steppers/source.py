"""From a plan to the source of the compiled function that makes steps.

The state, the points and the stage derivatives are small arrays on the stack, in the order of the state. Each block of
variables is a loop over its entries, which lowering turns into vector operations or, if it is short, unrolls.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from integrators.compile.printer import indented
from integrators.steppers.adaptive import ControlText, control_text
from integrators.steppers.averages import average_lines
from integrators.steppers.flows import flow_lines
from integrators.steppers.functions import diagonal
from integrators.steppers.implicit_stages import first_values, fixed_point_lines, newton_lines
from integrators.steppers.plan import allocate
from integrators.steppers.step_model import Call, Form, Group, Key, Options, Plan
from integrators.steppers.writer import StepWriter, derivative_lines, field_call_lines, resolvent_lines

if TYPE_CHECKING:
    import numpy as np

    from integrators.steppers.nodes import Nodes


STAGE = re.compile(r"\bk(\d+)\b")

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
    "integrators.steppers.kernels.flow_kernels": (
        "add_products", "begin_flow", "end_flow", "extrapolate", "flow_point", "growth", "has_converged",
        "midpoint_step", "next_interval",
    ),
    "integrators.steppers.kernels.iteration": (
        "BITS_OF_INFINITY", "STALLS", "failed", "falls", "largest", "negligible", "within_rounding",
    ),
    "integrators.steppers.kernels.linear_algebra": (
        "add_product", "assemble", "clear", "factorize", "solve", "subtract_from_identity",
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
GROUPS = {"fixed-point": fixed_point_lines, "newton": newton_lines}
"""Writers of calls by the kind of node, and of implicit groups by the solver."""


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
        pieces = self._pieces()
        uses = Counter(int(e) for lines in pieces for line in lines for e in STAGE.findall(line))
        found: set[Key] = set()
        for (call, lines), (following, later) in pairwise(self.writer.written):
            e, (block, *others) = call.evaluation, call.blocks
            chosen = diagonal(self.structure, call.node.piece, block) if call.node.kind == "field" else None
            if chosen is None or others or (e, block) in self.plan.reused.values():
                continue
            here = sum(STAGE.findall(line).count(str(e)) for line in (*lines, *later))
            read = {source for point in following.node.points for source, _ in point}
            if uses[e] == here and chosen.source not in read:
                found.add((e, block))
        return frozenset(found)

    def _pieces(self) -> list[list[str]]:
        """The lines of each piece of work, and of the end of the step."""
        pieces = [self._work_lines(work) for work in self.plan.computed]
        ends = (self.forms.update(block, form) for block, form in self.plan.result.items())
        pieces.append([line for lines in ends for line in lines])
        self.forms.end_step()
        return pieces

    def source(self) -> StepSource:
        """Write the module."""
        writer, module = self.writer, self.writer.module
        pieces = self._pieces()
        first = self._first_lines()
        registers = self._registers(pieces)
        for register in sorted(set(registers.values())):
            writer.array(f"k{register}")
        load, store, memory = self._memory_lines()
        body = [*(line for lines in pieces for line in lines), *self._reuse_lines(registers)]
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
            *_renamed(steps, registers),
            *self._state_lines("source[i] = y[i]", "compensation[i] = e[i]"),
            *_renamed(self._unstaggered_lines(), registers),
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
        return GROUPS[self.writer.options.solver](work, self.writer)

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

    def _reuse_lines(self, registers: Mapping[int, int]) -> list[str]:
        """Statements that copy stage derivatives for the next step, unless they share a register."""
        lines: list[str] = []
        for (start, block), (end, _) in self.plan.reused.items():
            if registers[start] != registers[end]:
                lines += self.forms.loop(block, [f"k{start}[i] = k{end}[i]"])
        return lines

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

    def _registers(self, pieces: Sequence[Sequence[str]]) -> dict[int, int]:
        """The register of each stage derivative, from the lines that use it."""
        kept = [*(e for e, _ in self.plan.reused), *(e for group in self.plan.groups for e, _ in group.unknowns)]
        reads: list[set[int]] = []
        writes: list[set[int]] = []
        for work, lines in zip([*self.plan.computed, None], pieces, strict=True):
            used = {int(e) for line in lines for e in STAGE.findall(line)}
            written = set() if work is None else {work.evaluation} if isinstance(work, Call) else used
            reads.append(used - written if isinstance(work, Call) else used)
            writes.append(written)
            if isinstance(work, Group):  # an iteration reads to its end
                reads.append(used)
                writes.append(set())
        joined = {end[0]: start[0] for start, end in self.plan.reused.items()}
        return allocate(reads, writes, kept, joined)

    def _state_lines(self, line: str, compensating: str) -> list[str]:
        """Loops over the whole state, one for each block, as in the step itself."""
        lines = [line, *([compensating] * self.writer.options.compensated)]
        return [text for block in range(len(self.structure.blocks)) for text in self.forms.loop(block, lines)]


def _kernel_imports(text: str) -> str:
    """The statements that import the kernels that a text uses."""
    words = set(re.findall(r"\w+", text))
    used = {module: [name for name in names if name in words] for module, names in KERNELS.items()}
    return "\n".join(f"from {module} import {', '.join(x)}" for module, x in used.items() if x)


def _renamed(lines: Iterable[str], registers: Mapping[int, int]) -> list[str]:
    """The lines with registers in place of stage derivatives."""
    return [STAGE.sub(lambda found: f"k{registers[int(found[1])]}", line) for line in lines]
