"""Steps of methods in low-storage and Shu–Osher forms, which hold as few vectors as the form.

Each value of the form takes the array of a value that is not needed any more. A slope that only the next combination
reads is added to it, without an array of its own: in the array of another value, or in that of its own point if the
field reads all variables before it writes one. Where it does not, as with sums over particles, one array more may be
needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction

from integrators.compile.printer import Assign
from integrators.exact.entries import Entry as Coefficient
from integrators.exact.entries import round_entry
from integrators.methods.tableaux.registers import Combination, RegisterForm, Slope, operands_of
from integrators.steppers.source import CALLS, StepSource, WrittenStep
from integrators.steppers.step_model import Form, Options, Plan, fraction
from integrators.steppers.structure import Structure
from integrators.steppers.values import Entry, Product, Sum, Value, scaled
from integrators.steppers.writer import StepWriter


def register_source(structure: Structure, form: RegisterForm, options: Options) -> StepSource:
    """Write the source of a step in a form.

    Sums are compensated if y_{n+1} is y_n plus multiples of slopes one after another, as in the forms 2N and 2R.
    """
    increments = _increments(form) if options.compensated else frozenset()
    plan = Plan((), {block: Form(Fraction(1), ()) for block in range(len(structure.blocks))}, {}, {}, {})
    options = options._replace(compensated=bool(increments))
    return _RegisterStep(StepWriter(structure, plan, CALLS, options, arrays=("y",)), form, increments).source()


def _slope_values(form: RegisterForm) -> frozenset[int]:
    """The values that are combinations of slopes only; their arrays do not contain the factor h."""
    found: set[int] = set()
    for v, value in enumerate(form.steps):
        if isinstance(value, Slope) or (value is not None and found.issuperset(operands_of(value))):
            found.add(v)
    return frozenset(found)


def _increments(form: RegisterForm) -> frozenset[int]:
    """The combinations that lead from y_n to y_{n+1}, if each adds slopes to a value that ends there; else none."""
    slopes, found, v = _slope_values(form), set[int](), len(form.steps) - 1
    while v:
        value = form.steps[v]
        states = [] if not isinstance(value, Combination) else [pair for pair in value.terms if pair[0] not in slopes]
        if len(states) != 1 or states[0][1] != 1 or form.last_uses[states[0][0]] != v:
            return frozenset()
        found.add(v)
        v = states[0][0]
    return frozenset(found)


class _RegisterStep(WrittenStep):
    """A step in a form, and the array of each value that is still needed."""

    def __init__(self, writer: StepWriter, form: RegisterForm, increments: frozenset[int]):
        super().__init__(writer)
        self.values, self.last, self.slopes = form.steps, form.last_uses, _slope_values(form)
        self.increments, self.blocks = increments, range(len(self.structure.blocks))
        self.field, self.updated = (name(0, self.blocks) for name in (writer.functions.field, writer.functions.update))
        self.in_place = writer.functions.reads_first(0, self.blocks)

    def body_lines(self) -> list[str]:
        """Statements of a step."""
        self.arrays: dict[int, str] = {0: "y"}
        self.free: list[str] = []
        lines: list[str] = []
        for v, value in enumerate(self.values):
            if isinstance(value, Combination) and self.last[v]:
                lines += self._combination(v, value)
            elif isinstance(value, Slope) and self.last[v] and not self._is_added(v):
                at = self.arrays[value.at]
                ends = [value.at] if self.last[value.at] == v else []
                lines.append(f"{self.field}({at}, {self._take(v, ends if self.in_place else [])})")
                self._release(ends)
        end = self.arrays[len(self.values) - 1]
        return lines if end == "y" else [*lines, *self._assign("y", Entry(end))]

    def _is_added(self, v: int) -> bool:
        """Whether the next combination, the only one that reads a slope, adds it without an array of its own."""
        following = self.values[v + 1]
        is_next = self.last[v] == v + 1 and isinstance(following, Combination) and len(following.terms) > 1
        return is_next and v + 1 not in self.increments

    def _take(self, v: int, ends: Iterable[int]) -> str:
        """The array for a value: that of one of the values that end there, or a free one; the others become free."""
        self.free[:0] = [self.arrays.pop(u) for u in ends]
        name = "y" if v == len(self.values) - 1 and "y" in self.free else next(iter(self.free), "")
        if name:
            self.free.remove(name)
        self.arrays[v] = name or self.writer.array(f"r{len(self.arrays)}")
        return self.arrays[v]

    def _release(self, ends: Iterable[int]) -> None:
        self.free += [self.arrays.pop(u) for u in ends if u in self.arrays]

    def _combination(self, v: int, value: Combination) -> list[str]:
        """A combination of values; a slope that is added to it comes last, or first where it replaces its point."""
        terms, previous = dict(value.terms), self.values[v - 1]
        ends = [u for u in terms if self.last[u] == v and u in self.arrays]
        if v in self.increments:
            (start,) = terms.keys() - self.slopes
            total = self._sum((u, x) for u, x in terms.items() if u != start)
            self.arrays[v] = self.arrays.pop(start)
            self._release(ends)
            return [line for block in self.blocks for line in self.forms.increase(block, total)]
        if not (isinstance(previous, Slope) and self._is_added(v - 1)):
            total = self._value(v, terms)
            return self._assign(self._take(v, ends), total)
        at, point, x = previous.at, self.arrays[previous.at], fraction(terms.pop(v - 1))
        factor = "h*" * (v not in self.slopes) + repr(round_entry(x))
        others, point_ends = [u for u in ends if u != at], self.last[at] in (v - 1, v)
        if others or self.free or not (point_ends and self.in_place):
            total, array = self._value(v, terms), self._take(v, others)
            self._release([at] if point_ends else [])
            return [*self._assign(array, total), f"{self.updated}({point}, {array}, 1.0, {factor})"]
        own = round_entry(fraction(terms.pop(at, Fraction(0))))
        total, array = Sum((Entry(point), self._value(v, terms))), self._take(v, [at])
        line = f"{self.updated}({point}, {array}, {own!r}, {factor})"
        return [line, *self._assign(array, total)] if terms else [line]

    def _value(self, v: int, terms: Mapping[int, Coefficient]) -> Value:
        """A combination of the arrays of values, in the units of the value v."""
        if v in self.slopes:
            return self._sum(terms.items())
        slopes = [pair for pair in terms.items() if pair[0] in self.slopes]
        states = self._sum(pair for pair in terms.items() if pair[0] not in self.slopes)
        return Sum((*states.terms, *([Product("h", self._sum(slopes))] if slopes else [])))

    def _sum(self, terms: Iterable[tuple[int, Coefficient]]) -> Sum:
        return Sum(tuple(scaled(Entry(self.arrays[u]), fraction(x)) for u, x in terms))

    def _assign(self, array: str, value: Value) -> list[str]:
        """Loops that assign a value to all entries of an array."""
        return [line for block in self.blocks for line in self.forms.assignments(block, [Assign(array, "=", value)])]
