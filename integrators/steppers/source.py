"""A plan of steps as the source of a compiled function.

The state, the slopes and the points lie in small arrays on the stack, in the order of the state; a cell is a loop over
its entries, which LLVM unrolls where it is short.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from ..codegen import ModuleText
from ..site_loops import indented
from .adaptive import ControlText, control_text
from .averages import average_lines
from .derivatives import derivative_lines
from .diagonals import diagonal
from .fixed_point import first_values, fixed_point_lines
from .flows import flow_lines
from .forms import FormWriter, scaled
from .functions import Functions
from .linear_systems import resolvent_lines
from .newton import newton_lines
from .nodes import Form
from .plan import Call, Group, plan
from .registers import allocate

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from .nodes import Key, Nodes

MOST_STACK = 32_768
"""Doubles of work arrays that are put on the stack; beyond, they lie in an array of the caller's."""
MOST_SCALARS = 16
SLOPE = re.compile(r"\bk(\d+)\b")

TEMPLATE = '''\
"""Steps of a method on a scene.

{state}
"""

{imports}
from integrators.steppers.flow_kernels import add_products, begin_flow, end_flow, extrapolate, flow_point
from integrators.steppers.flow_kernels import growth, has_settled, midpoint_step, next_interval
from integrators.steppers.iteration import BITS_OF_INFINITY, failed, falls, negligible
from integrators.steppers.linear_algebra import add_product, assemble, clear, factorize, solve, subtract_from_identity
from integrators.steppers.machine import bits, compiled, fma, inlined, kept, opaque, pointer, shifted, stack
from integrators.steppers.recording import recorded

{constants}
'''
SIGNATURE = "state, carry, memory, control, numbers, work, h, steps, fresh"
RECORD = (
    "state, carry, memory, control, numbers, work, h, t0, first, steps, fresh, "
    "y_every, y_rows, y_times, o_every, observer, o_rows, o_times"
)


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
    arguments = nodes, compensated, split, solver, average_nodes, control
    once = StepperSource(*arguments).read_once()
    return StepperSource(*arguments, once).text()


class StepperSource:
    """Collects the parts of a stepper's module.

    Attributes:
        nodes: The nodes.
        structure: What the pieces of the field are like.
        functions: The pieces of the field as functions.
        forms: Writes points and sums.
        averaged: What the values of the field along a path are of, if they are known.
        known: Arrays of numbers and functions for flows that have been asked for.
        matrices: The names of factorized matrices of this step.
    """

    def __init__(
        self,
        nodes: Nodes,
        compensated: bool,
        split: bool,
        solver: str,
        average_nodes: int | None,
        control: sympy.Expr | None,
        once: frozenset[Key] = frozenset(),
    ):
        self.once = once
        self._log: list[tuple[Call, list[str]]] = []
        self.solver, self.split, self.average_nodes, self.control = solver, split, average_nodes, control
        self.averaged: object = None
        self.known: dict[object, str] = {}
        self.matrices: dict[object, str] = {}
        self.numbers: list[Callable[[float], np.ndarray]] = []
        self.nodes, self.structure, self.plan = nodes, nodes.structure, plan(nodes, stagger=control is None)
        self.module = ModuleText(precise=False, lanes=True)
        self.functions = Functions(self.structure, self.module)
        implicit = any(isinstance(work, Group) for work in self.plan.work)
        self.forms = FormWriter(
            self.structure,
            self.plan.result,
            None if implicit else self._points(),
            compensated,
            split and bool(self._iterated),
        )
        self.compensated = compensated
        self._number_count = 0
        self._constants: dict[str, str] = {}
        self._sizes = dict.fromkeys(["y", "z", "d", *(["e"] * compensated)], self.structure.scene.dimension)

    def array(self, name: str, size: int | None = None) -> str:
        """The name of a work array; by default it has the size of the state."""
        self._sizes[name] = max(self._sizes.get(name, 0), size or self.structure.scene.dimension)
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

    def read_once(self) -> frozenset[Key]:
        """Slopes of diagonal pieces that only the next call reads, so that they can be written as part of its point."""
        pieces = self._pieces([work for work in self.plan.work if not self._is_carried(work)])
        uses = Counter(int(e) for lines in pieces for line in lines for e in SLOPE.findall(line))
        found: set[Key] = set()
        for (call, lines), (following, later) in pairwise(self._log):
            e, cells = call.evaluation, call.cells
            chosen = diagonal(self.structure, call.node.piece, cells[0]) if call.node.kind == "field" else None
            if chosen is None or len(cells) > 1 or {e} & {end for end, _ in self.plan.carried.values()}:
                continue
            own, others = (sum(SLOPE.findall(x).count(str(e)) for x in text) for text in (lines, later))
            read = {cell for point in following.node.points for cell, _ in point}
            if own and uses[e] == own + others and chosen.source not in read:
                found.add((e, cells[0]))
        return frozenset(found)

    def _pieces(self, planned: Sequence[Call | Group]) -> list[list[str]]:
        """The lines of each piece of work, and of the end of the step."""
        pieces = [self._work_lines(work) for work in planned]
        ends = (self.forms.update(cell, form) for cell, form in self.plan.result.items())
        pieces.append([line for lines in ends for line in lines])
        self.forms.forget()
        return pieces

    def text(self) -> Text:
        """The whole module."""
        planned = [work for work in self.plan.work if not self._is_carried(work)]
        pieces = self._pieces(planned)
        first = self._first_lines()
        registers = self._registers(planned, pieces)
        for register in sorted(set(registers.values())):
            self.array(f"k{register}")
        load, store, memory = self._memory_lines()
        body = [*(line for lines in pieces for line in lines), *self._carrying_lines(registers)]
        control = ControlText() if self.control is None else control_text(self.control, self)
        first += self._kick_lines()
        slopes = ["if fresh:", *indented([*control.fresh, *first])] if control.fresh or memory else []
        slopes += ["else:", *indented(load)] if memory else []
        loop = ["done = 0", "while done < steps:", *indented([*control.before, *body, *control.after, "done += 1"])]
        steps = [*control.load, *slopes, *loop, *store, *control.store]
        arrays, work = self._array_lines()
        lines = [*arrays, *self._state_lines("y[i] = source[i]", "e[i] = lost[i]"), *_renamed(steps, registers)]
        lines += [*self._state_lines("source[i] = y[i]", "lost[i] = e[i]"), *_renamed(self._end_lines(), registers)]
        lines.append("return done")
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
        lines = CALLS[call.node.kind](call, target or f"k{call.evaluation}", self)
        self._log.append((call, lines))
        return lines

    def is_inlined(self, call: Call) -> bool:
        """Whether the slope of a call is written as part of the point that needs it."""
        return (call.evaluation, call.cells[0]) in self.once

    def _work_lines(self, work: Call | Group) -> list[str]:
        if isinstance(work, Call):
            return self.call_lines(work)
        return GROUPS[self.solver](work, self)

    @property
    def _iterated(self) -> list[Group]:
        """The groups, which are solved by iteration."""
        return [work for work in self.plan.work if isinstance(work, Group)]

    def _points(self) -> Counter[int]:
        """How often a step makes a point in each cell."""
        calls = [work for work in self.plan.work if isinstance(work, Call) and not self._is_carried(work)]
        return Counter(cell for call in calls for point in call.node.points for cell, _ in point)

    def _is_carried(self, work: Call | Group) -> bool:
        """Whether a call is made by the step before."""
        return isinstance(work, Call) and (work.evaluation, work.cells[0]) in self.plan.carried

    def _first_lines(self) -> list[str]:
        """Slopes at y for those that are kept from step to step."""
        carried = [work for work in self.plan.work if isinstance(work, Call) and self._is_carried(work)]
        lines = [line for work in carried for line in self.call_lines(work)]
        return [*lines, *(line for group in self._iterated for line in first_values(group, self))]

    def _registers(self, planned: Sequence[Call | Group], pieces: Sequence[Sequence[str]]) -> dict[int, int]:
        """The register of each slope, from the lines that use it."""
        kept = [*(e for e, _ in self.plan.carried), *(e for group in self._iterated for e, _ in group.unknowns)]
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

    def _kick_lines(self) -> list[str]:
        """Statements that begin a run whose steps begin after their first kick."""
        lines: list[str] = []
        for cell, kick in self.plan.staggered.items():
            lines += self.forms.update(cell, Form(Fraction(1), (kick,)))
        return lines

    def _end_lines(self) -> list[str]:
        """Statements for the state that others see: that before the first kick of the next step."""
        lines: list[str] = []
        for cell, (e, x) in self.plan.staggered.items():
            lines += self.forms.loop(cell, [f"source[i] = y[i] - h*{scaled(f'k{e}[i]', x)}"])
        return lines

    def _carrying_lines(self, registers: Mapping[int, int]) -> list[str]:
        """Statements that hand slopes at the end of a step to the next one, where they are not in place already."""
        lines: list[str] = []
        for (start, cell), (end, _) in self.plan.carried.items():
            if registers[start] != registers[end]:
                lines += self.forms.loop(cell, [f"k{start}[i] = k{end}[i]"])
        return lines

    def _memory_lines(self) -> tuple[list[str], list[str], int]:
        """Statements that load and store what is kept from step to step, and its size."""
        keys: list[Key] = [*self.plan.carried, *(key for group in self._iterated for key in group.unknowns)]
        load: list[str] = []
        store: list[str] = []
        size = 0
        for e, cell in keys:
            for a, b in self.structure.cells[cell]:
                index = f"m[i + {size - a}]" if size >= a else f"m[i - {a - size}]"
                load += [f"for i in range({a}, {b}):", f"    k{e}[i] = {index}"]
                store += [f"for i in range({a}, {b}):", f"    {index} = k{e}[i]"]
                size += b - a
        for cell in self.plan.staggered:
            for a, b in self.structure.cells[cell]:
                index = f"m[i + {size - a}]" if size >= a else f"m[i - {a - size}]"
                load += [f"for i in range({a}, {b}):", f"    y[i] = {index}"]
                store += [f"for i in range({a}, {b}):", f"    {index} = y[i]"]
                size += b - a
        return load, store, size

    def _state_lines(self, line: str, compensating: str) -> list[str]:
        """A loop over the whole state."""
        lines = [line, *([compensating] * self.compensated)]
        return [f"for i in range({self.structure.scene.dimension}):", *indented(lines)]

    def _is_on_stack(self, total: int) -> bool:
        """Whether work arrays lie on the stack, each by itself.

        LLVM then knows that they do not overlap, as loops need to be vectorised; but of straight-line code it makes
        vector instructions for arrays in one block of memory only, as it would put those on the stack in registers.
        """
        iterated = bool(self._iterated)
        return total <= MOST_STACK and (iterated or self.structure.scene.dimension <= MOST_SCALARS)

    def _array_lines(self) -> tuple[list[str], int]:
        """Work arrays: on the stack, if they are not too large."""
        names = {"source": "state", "lost": "carry", "m": "memory", "constants": "numbers"}
        names |= {name: array for array, name in self._constants.items()}
        lines = [f"{name} = pointer({array})" for name, array in names.items()]
        total = sum(self._sizes.values())
        if self._is_on_stack(total):
            return [*lines, *(f"{name} = stack({size})" for name, size in self._sizes.items())], 0
        lines.append("w = pointer(work)")
        offset = 0
        for name, size in self._sizes.items():
            lines.append(f"{name} = shifted(w, {offset})")
            offset += size
        return lines, total


def _field_lines(call: Call, target: str, writer: StepperSource) -> list[str]:
    """A piece of the field at a point; cells where it only scales are written as loops, or not before they are read."""
    point, piece, forms = call.node.points[0], call.node.piece, writer.forms
    scaling = {cell: diagonal(writer.structure, piece, cell) for cell in call.cells}
    if len(call.cells) == 1 and (call.evaluation, call.cells[0]) in writer.once and forms.in_group:
        chosen = scaling[call.cells[0]]
        assert chosen is not None  # read_once has found it
        text = forms.entry(chosen.source, dict(point)[chosen.source])
        forms.inlined[call.evaluation, call.cells[0]] = chosen.scaled(text, writer)
        return []
    lines, at = forms.point(point, "z")
    others = []
    for cell, chosen in scaling.items():
        if chosen is None:
            others.append(cell)
            continue
        text = chosen.scaled(f"{at}[i]", writer)
        if (call.evaluation, cell) in writer.once:
            forms.inlined[call.evaluation, cell] = text
        else:
            lines += forms.loop(cell, [f"{target}[i] = {text}"])
    if others:
        lines.append(f"{writer.functions.field(piece, others)}({at}, {target})")
    return lines


CALLS = {
    "field": _field_lines,
    "derivative": derivative_lines,
    "average": average_lines,
    "flow": flow_lines,
    "resolvent": resolvent_lines,
}
GROUPS = {"fixed-point": fixed_point_lines, "newton": newton_lines}


def _renamed(lines: Iterable[str], registers: Mapping[int, int]) -> list[str]:
    """The lines with registers in place of slopes."""
    return [SLOPE.sub(lambda found: f"k{registers[int(found[1])]}", line) for line in lines]
