"""A plan of steps as the source of a compiled function.

The state, the slopes and the points lie in small arrays on the stack, in the order of the state; a cell is a loop over
its entries, which is written in vectors or, where it is short, unrolled.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from integrators.compile.particle_loops import indented
from integrators.steppers.adaptive import ControlText, control_text
from integrators.steppers.averages import average_lines
from integrators.steppers.fixed_point import first_values, fixed_point_lines
from integrators.steppers.flows import flow_lines
from integrators.steppers.functions import diagonal
from integrators.steppers.newton import newton_lines
from integrators.steppers.nodes import Form
from integrators.steppers.plan import Call, Group, allocate, plan
from integrators.steppers.writer import StepWriter, derivative_lines, field_call_lines, resolvent_lines

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from integrators.steppers.forms import FormWriter
    from integrators.steppers.nodes import Key, Nodes
    from integrators.steppers.plan import Plan
    from integrators.steppers.structure import Structure


def kick_lines(plan: Plan, forms: FormWriter) -> list[str]:
    """Statements that begin a run whose steps begin after their first kick."""
    starts = (forms.update(cell, Form(Fraction(1), kicks)) for cell, kicks in plan.staggered.items())
    return [line for lines in starts for line in lines]


def end_lines(plan: Plan, forms: FormWriter) -> list[str]:
    """Statements for the state that others see: that before the first kick of the next step."""
    lines: list[str] = []
    for cell, kicks in plan.staggered.items():
        lines += forms.loop(cell, [f"source[i] = y[i] - h*({forms.sum(cell, kicks)})"])
    return lines


def carrying_lines(plan: Plan, forms: FormWriter, registers: Mapping[int, int]) -> list[str]:
    """Statements that hand slopes at the end of a step to the next one, where they are not in place already."""
    lines: list[str] = []
    for (start, cell), (end, _) in plan.carried.items():
        if registers[start] != registers[end]:
            lines += forms.loop(cell, [f"k{start}[i] = k{end}[i]"])
    return lines


def memory_lines(plan: Plan, structure: Structure, unknowns: Iterable[Key]) -> tuple[list[str], list[str], int]:
    """Statements that load and store what is kept from step to step, and its size.

    Args:
        plan: The plan.
        structure: The cells.
        unknowns: Slopes from which the next step's are guessed.
    """
    kept = [(f"k{e}", cell) for e, cell in (*plan.carried, *unknowns)] + [("y", cell) for cell in plan.staggered]
    load: list[str] = []
    store: list[str] = []
    size = 0
    for name, cell in kept:
        for a, b in structure.cells[cell]:
            index = f"m[i + {size - a}]" if size >= a else f"m[i - {a - size}]"
            load += [f"for i in range({a}, {b}):", f"    {name}[i] = {index}"]
            store += [f"for i in range({a}, {b}):", f"    {index} = {name}[i]"]
            size += b - a
    return load, store, size


SLOPE = re.compile(r"\bk(\d+)\b")

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
        "add_products", "begin_flow", "end_flow", "extrapolate", "flow_point", "growth", "has_settled",
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
"""What generated steppers call, by the module where it is; they import what they need."""
SIGNATURE = "source, lost, m, controls, constants, w, h, steps, fresh"


CALLS = {
    "field": field_call_lines,
    "derivative": derivative_lines,
    "average": average_lines,
    "flow": flow_lines,
    "resolvent": resolvent_lines,
}
GROUPS = {"fixed-point": fixed_point_lines, "newton": newton_lines}
"""What writes a step: its calls by the kind of their nodes, and its groups by the solver."""


class Text(NamedTuple):
    """The source of a stepper.

    Attributes:
        source: The text of the module; its function ``advance`` makes steps.
        memory: How many doubles are kept from step to step besides the state.
        work: How many doubles of work arrays the caller must bring.
        numbers: Functions of h that give, one after the other, the numbers that depend on it.
        iterates: Whether slopes that depend on one another are found by iteration.
    """

    source: str
    memory: int
    work: int
    numbers: tuple[Callable[[float], np.ndarray], ...]
    iterates: bool


def stepper_text(
    nodes: Nodes,
    *,
    compensated: bool,
    split: bool,
    solver: str,
    average_nodes: int | None = None,
    control: sympy.Expr | None = None,
) -> Text:
    """The source of steps of a method on a scene.

    Args:
        nodes: The nodes of the method on the scene.
        compensated: Whether rounding errors of sums are carried on.
        split: Whether coefficients of implicit methods are split into a short head and a tail, so that their rounding
            errors are as random as all others.
        solver: How slopes that depend on one another are found: ``fixed-point`` or ``newton``.
        average_nodes: The number of nodes for averages of fields that are no polynomials.
        control: The function of step sizes; None if all are the same.

    References:
        Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231–243, doi:10.1007/s10543-008-0170-3 (split coefficients,
        compensation, iteration until stagnation).
    """
    steps = plan(nodes, stagger=control is None)

    def step(once: frozenset[Key]) -> _Step:
        writer = StepWriter(
            nodes,
            steps,
            CALLS,
            compensated=compensated,
            split=split,
            average_nodes=average_nodes,
            varies=control is not None,
            once=once,
        )
        return _Step(writer, solver, control)

    # the first writing shows which slopes are read once, and these are then written where they are read
    return step(once=step(once=frozenset()).read_once()).text()


class _Step:
    """A planned step while it is written as a module."""

    def __init__(self, writer: StepWriter, solver: str, control: sympy.Expr | None):
        self.writer, self.plan, self.structure, self.forms = writer, writer.plan, writer.structure, writer.forms
        self.solver, self.control = solver, control

    def read_once(self) -> frozenset[Key]:
        """Slopes of diagonal pieces that only the next call reads, so that they can be written as part of its point."""
        pieces = self._pieces([work for work in self.plan.work if not self.plan.is_carried(work)])
        uses = Counter(int(e) for lines in pieces for line in lines for e in SLOPE.findall(line))
        found: set[Key] = set()
        for (call, lines), (following, later) in pairwise(self.writer.written):
            e, (cell, *others) = call.evaluation, call.cells
            chosen = diagonal(self.structure, call.node.piece, cell) if call.node.kind == "field" else None
            if chosen is None or others or (e, cell) in self.plan.carried.values():
                continue
            here = sum(SLOPE.findall(line).count(str(e)) for line in (*lines, *later))
            read = {source for point in following.node.points for source, _ in point}
            if uses[e] == here and chosen.source not in read:
                found.add((e, cell))
        return frozenset(found)

    def _pieces(self, planned: Sequence[Call | Group]) -> list[list[str]]:
        """The lines of each piece of work, and of the end of the step."""
        pieces = [self._work_lines(work) for work in planned]
        ends = (self.forms.update(cell, form) for cell, form in self.plan.result.items())
        pieces.append([line for lines in ends for line in lines])
        self.forms.end_step()
        return pieces

    def text(self) -> Text:
        """The whole module."""
        writer, module = self.writer, self.writer.module
        planned = [work for work in self.plan.work if not self.plan.is_carried(work)]
        pieces = self._pieces(planned)
        first = self._first_lines()
        registers = self._registers(planned, pieces)
        for register in sorted(set(registers.values())):
            writer.array(f"k{register}")
        unknowns = [key for group in self.plan.groups for key in group.unknowns]
        load, store, memory = memory_lines(self.plan, self.structure, unknowns)
        body = [*(line for lines in pieces for line in lines), *carrying_lines(self.plan, self.forms, registers)]
        control = ControlText() if self.control is None else control_text(self.control, writer)
        first += kick_lines(self.plan, self.forms)
        slopes = ["if fresh:", *indented([*control.fresh, *first])] if control.fresh or memory else []
        slopes += ["else:", *indented(load)] if memory else []
        loop = ["done = 0", "while done < steps:", *indented([*control.before, *body, *control.after, "done += 1"])]
        steps = [*control.load, *slopes, *loop, *store, *control.store]
        arrays, work = writer.array_lines()
        lines = [*arrays, *self._state_lines("y[i] = source[i]", "e[i] = lost[i]"), *_renamed(steps, registers)]
        lines += [
            *self._state_lines("source[i] = y[i]", "lost[i] = e[i]"),
            *_renamed(end_lines(self.plan, self.forms), registers),
        ]
        lines.append("return done")
        writer.functions.write()
        module.function(f"advance({SIGNATURE})", "Make steps; how many could be made.", lines, "@lowered(STEPS)")
        module.function(f"in_c({SIGNATURE})", "The same in C.", [f"return advance({SIGNATURE})"], "@steps_in_c")
        template = TEMPLATE.replace("{kernels}", _kernel_imports(module.bodies))
        source = module.source(self.structure.scene, template)
        return Text(source, memory, work, tuple(writer.numbers), bool(self.plan.groups))

    def _work_lines(self, work: Call | Group) -> list[str]:
        if isinstance(work, Call):
            return self.writer.call_lines(work)
        return GROUPS[self.solver](work, self.writer)

    def _first_lines(self) -> list[str]:
        """Slopes at y for those that are kept from step to step."""
        carried = [work for work in self.plan.work if isinstance(work, Call) and self.plan.is_carried(work)]
        lines = [line for work in carried for line in self.writer.call_lines(work)]
        return [*lines, *(line for group in self.plan.groups for line in first_values(group, self.writer))]

    def _registers(self, planned: Sequence[Call | Group], pieces: Sequence[Sequence[str]]) -> dict[int, int]:
        """The register of each slope, from the lines that use it."""
        kept = [*(e for e, _ in self.plan.carried), *(e for group in self.plan.groups for e, _ in group.unknowns)]
        reads: list[set[int]] = []
        writes: list[set[int]] = []
        for work, lines in zip([*planned, None], pieces, strict=True):
            used = {int(e) for line in lines for e in SLOPE.findall(line)}
            written = set() if work is None else {work.evaluation} if isinstance(work, Call) else used
            reads.append(used - written if isinstance(work, Call) else used)
            writes.append(written)
            if isinstance(work, Group):  # which reads until it ends
                reads.append(used)
                writes.append(set())
        joined = {end[0]: start[0] for start, end in self.plan.carried.items()}
        return allocate(reads, writes, kept, joined)

    def _state_lines(self, line: str, compensating: str) -> list[str]:
        """Loops over the whole state: cell by cell, so that entries which steps compute apart are not put together."""
        lines = [line, *([compensating] * self.writer.compensated)]
        return [text for cell in range(len(self.structure.cells)) for text in self.forms.loop(cell, lines)]


def _kernel_imports(text: str) -> str:
    """The statements that import what a text calls."""
    words = set(re.findall(r"\w+", text))
    used = {module: [name for name in names if name in words] for module, names in KERNELS.items()}
    return "\n".join(f"from {module} import {', '.join(x)}" for module, x in used.items() if x)


def _renamed(lines: Iterable[str], registers: Mapping[int, int]) -> list[str]:
    """The lines with registers in place of slopes."""
    return [SLOPE.sub(lambda found: f"k{registers[int(found[1])]}", line) for line in lines]
