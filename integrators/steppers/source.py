"""A plan of steps as the source of a compiled function.

The state, the slopes and the points lie in small arrays on the stack, in the order of the state; a cell is a loop over
its entries, which LLVM unrolls where it is short.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ..codegen import ModuleText
from ..site_loops import indented
from .averages import average_lines
from .derivatives import derivative_lines
from .fixed_point import first_values, fixed_point_lines
from .flows import flow_lines
from .forms import FormWriter
from .functions import Functions
from .linear_systems import is_linear_system, linear_system_lines
from .newton import newton_lines
from .plan import Call, Group, plan
from .registers import allocate

if TYPE_CHECKING:
    import numpy as np

    from .nodes import Form, Key, Nodes

MOST_STACK = 32_768
"""Doubles of work arrays that are put on the stack; beyond, they lie in an array of the caller's."""
SLOPE = re.compile(r"\bk(\d+)\b")

TEMPLATE = '''\
"""Steps of a method on a scene.

{state}
"""

{imports}
from integrators.steppers.iteration import failed, negligible
from integrators.steppers.machine import bits, compiled, inlined, kept, pointer, shifted, stack
from integrators.steppers.recording import recorded

{constants}
'''
SIGNATURE = "state, carry, memory, numbers, work, h, steps, fresh"
RECORD = "state, carry, memory, numbers, work, h, t0, first, steps, fresh, y_every, y_rows, o_every, observer, o_rows"


class Text(NamedTuple):
    """The source of a stepper.

    Attributes:
        source: The text of the module; its function ``advance`` makes steps, ``record`` also stores some.
        memory: How many doubles are kept from step to step besides the state.
        work: How many doubles of work arrays the caller must bring.
        numbers: Functions of h that give, one after the other, the numbers that depend on it.
    """

    source: str
    memory: int
    work: int
    numbers: tuple[Callable[[float], np.ndarray], ...]


def stepper_text(nodes: Nodes, *, compensated: bool, split: bool, solver: str) -> Text:
    """The source of steps of a method on a scene.

    Args:
        nodes: The nodes of the method on the scene.
        compensated: Whether rounding errors of sums are carried on.
        split: Whether coefficients of implicit methods are split into a short head and a tail, so that their rounding
            errors are as random as all others.
        solver: How slopes that depend on one another are found: ``fixed-point`` or ``newton``.

    References:
        Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231–243, doi:10.1007/s10543-008-0170-3 (split coefficients,
        compensation, iteration until stagnation).
    """
    return StepperSource(nodes, compensated, split, solver).text()


class StepperSource:
    """Collects the parts of a stepper's module.

    Attributes:
        nodes: The nodes.
        structure: What the pieces of the field are like.
        functions: The pieces of the field as functions.
        forms: Writes points and sums.
    """

    def __init__(self, nodes: Nodes, compensated: bool, split: bool, solver: str):
        self.solver = solver
        self.numbers: list[Callable[[float], np.ndarray]] = []
        self.nodes, self.structure, self.plan = nodes, nodes.structure, plan(nodes)
        self.module = ModuleText(precise=False, lanes=True)
        self.functions = Functions(self.structure, self.module)
        implicit = any(isinstance(work, Group) for work in self.plan.work)
        self.forms = FormWriter(self.structure, self._following(), split and implicit)
        self.compensated = compensated
        self._number_count = 0
        self._sizes = dict.fromkeys(["y", "z", "d", *(["e"] * compensated)], self.structure.scene.dimension)

    def array(self, name: str, size: int | None = None) -> str:
        """The name of a work array; by default it has the size of the state."""
        self._sizes[name] = max(self._sizes.get(name, 0), size or self.structure.scene.dimension)
        return name

    def number_array(self, count: int, values: Callable[[float], np.ndarray]) -> str:
        """The beginning of an array of numbers that depend on the step size only, as a pointer.

        Args:
            count: How many there are.
            values: Computes them from h.
        """
        self.numbers.append(values)
        self._number_count += count
        return f"shifted(constants, {self._number_count - count})"

    def text(self) -> Text:
        """The whole module."""
        planned = [work for work in self.plan.work if not self._is_carried(work)]
        pieces = [self._work_lines(work) for work in planned]
        ends = (self.forms.update(cell, form, self.compensated) for cell, form in self.plan.result.items())
        pieces.append([line for lines in ends for line in lines])
        self.forms.forget()
        first = self._first_lines()
        registers = self._registers(planned, pieces)
        for register in sorted(set(registers.values())):
            self.array(f"k{register}")
        load, store, memory = self._memory_lines()
        body = [*(line for lines in pieces for line in lines), *self._carrying_lines(registers), "done += 1"]
        slopes = ["if fresh:", *indented(first), "else:", *indented(load)] if memory else []
        steps = [*slopes, "done = 0", "while done < steps:", *indented(body), *store]
        arrays, work = self._array_lines()
        lines = [*arrays, *self._state_lines("y[i] = source[i]", "e[i] = lost[i]"), *_renamed(steps, registers)]
        lines += [*self._state_lines("source[i] = y[i]", "lost[i] = e[i]"), "return done"]
        self.functions.write()
        self.module.function(f"advance({SIGNATURE})", "Make steps; how many could be made.", lines, "@kept")
        call = f"return recorded(advance, {RECORD})"
        self.module.function(f"record({RECORD})", "Make steps and store some.", [call], "@kept")
        return Text(self.module.source(self.structure.scene, TEMPLATE), memory, work, tuple(self.numbers))

    def call_lines(self, call: Call, target: str | None = None) -> list[str]:
        """The points of a call, and the call.

        Args:
            call: The call.
            target: Where the slopes go; by default where everything else finds them.
        """
        return CALLS[call.node.kind](call, target or f"k{call.evaluation}", self)

    def _work_lines(self, work: Call | Group) -> list[str]:
        if isinstance(work, Call):
            return self.call_lines(work)
        if is_linear_system(work):
            return linear_system_lines(work, self)
        return GROUPS[self.solver](work, self)

    def _following(self) -> dict[int, list[Form]]:
        """The points of each cell in the order in which they are made outside of groups."""
        found: dict[int, list[Form]] = {cell: [] for cell in self.plan.result}
        for work in self.plan.work:
            if isinstance(work, Call) and not self._is_carried(work):
                for point in work.node.points:
                    for cell, form in point:
                        found[cell].append(form)
        for cell, form in self.plan.result.items():
            found[cell].append(form)
        return {cell: [f for k, f in enumerate(forms) if k == 0 or f != forms[k - 1]] for cell, forms in found.items()}

    def _is_carried(self, work: Call | Group) -> bool:
        """Whether a call is made by the step before."""
        return isinstance(work, Call) and (work.evaluation, work.cells[0]) in self.plan.carried

    def _first_lines(self) -> list[str]:
        """Slopes at y for those that are kept from step to step."""
        lines: list[str] = []
        for work in self.plan.work:
            if isinstance(work, Group):
                lines += first_values(work, self)
            elif self._is_carried(work):
                lines += self.call_lines(work)
        return lines

    def _registers(self, planned: Sequence[Call | Group], pieces: Sequence[Sequence[str]]) -> dict[int, int]:
        """The register of each slope, from the lines that use it."""
        kept = [e for e, _ in self.plan.carried]
        reads: list[set[int]] = []
        writes: list[set[int]] = []
        for work, lines in zip([*planned, None], pieces, strict=True):
            used = {int(e) for line in lines for e in SLOPE.findall(line)}
            written = set() if work is None else {work.evaluation} if isinstance(work, Call) else used
            reads.append(used - written if isinstance(work, Call) else used)
            writes.append(written)
            kept += [e for e, _ in work.unknowns] if isinstance(work, Group) else []
        joined = {end[0]: start[0] for start, end in self.plan.carried.items()}
        return allocate(reads, writes, kept, joined)

    def _carrying_lines(self, registers: Mapping[int, int]) -> list[str]:
        """Statements that hand slopes at the end of a step to the next one, where they are not in place already."""
        lines: list[str] = []
        for (start, cell), (end, _) in self.plan.carried.items():
            if registers[start] != registers[end]:
                lines += self.forms.loop(cell, [f"k{start}[i] = k{end}[i]"])
        return lines

    def _memory_lines(self) -> tuple[list[str], list[str], int]:
        """Statements that load and store what is kept from step to step, and its size."""
        keys: list[Key] = [*self.plan.carried]
        for work in self.plan.work:
            if isinstance(work, Group):
                keys += work.unknowns
        load: list[str] = []
        store: list[str] = []
        size = 0
        for e, cell in keys:
            for a, b in self.structure.cells[cell]:
                index = f"m[i + {size - a}]" if size >= a else f"m[i - {a - size}]"
                load += [f"for i in range({a}, {b}):", f"    k{e}[i] = {index}"]
                store += [f"for i in range({a}, {b}):", f"    {index} = k{e}[i]"]
                size += b - a
        return load, store, size

    def _state_lines(self, line: str, compensating: str) -> list[str]:
        """A loop over the whole state."""
        lines = [line, *([compensating] * self.compensated)]
        return [f"for i in range({self.structure.scene.dimension}):", *indented(lines)]

    def _array_lines(self) -> tuple[list[str], int]:
        """Work arrays: on the stack, if they are not too large."""
        names = {"source": "state", "lost": "carry", "m": "memory", "constants": "numbers"}
        lines = [f"{name} = pointer({array})" for name, array in names.items()]
        total = sum(self._sizes.values())
        if total <= MOST_STACK:
            return [*lines, *(f"{name} = stack({size})" for name, size in self._sizes.items())], 0
        lines.append("w = pointer(work)")
        offset = 0
        for name, size in self._sizes.items():
            lines.append(f"{name} = shifted(w, {offset})")
            offset += size
        return lines, total


def _field_lines(call: Call, target: str, writer: StepperSource) -> list[str]:
    """A piece of the field at a point."""
    lines, at = writer.forms.point(call.node.points[0], "z")
    return [*lines, f"{writer.functions.field(call.node.piece, call.cells)}({at}, {target})"]


CALLS = {"field": _field_lines, "derivative": derivative_lines, "average": average_lines, "flow": flow_lines}
GROUPS = {"fixed-point": fixed_point_lines, "newton": newton_lines}


def _renamed(lines: Iterable[str], registers: Mapping[int, int]) -> list[str]:
    """The lines with registers in place of slopes."""
    return [SLOPE.sub(lambda found: f"k{registers[int(found[1])]}", line) for line in lines]
