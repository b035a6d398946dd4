"""Steps of methods in low-storage and Shu–Osher forms, which hold as few vectors as the form.

Each value of the form takes the array of a value that is not needed any more. A slope that only the next combination
reads is added to it, without an array of its own: in the array of another value, or in that of its own point if the
field reads all variables before it writes one. Where it does not, as with sums over particles, one array more may be
needed.
"""

from __future__ import annotations

from collections.abc import Iterable
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

Terms = Iterable[tuple[int, Coefficient]]
"""Values of a form with their coefficients."""


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
        self.form, self.increments, self.slopes = form, increments, _slope_values(form)
        blocks = range(len(self.structure.blocks))
        self.field, self.updated = (name(0, blocks) for name in (writer.functions.field, writer.functions.update))
        self.in_place = writer.functions.reads_first(0, blocks)
        self.arrays: dict[int, str] = {}
        self.free: list[str] = []

    def body_lines(self) -> list[str]:
        """Statements of a step."""
        self.arrays, lines = {0: "y"}, []
        for v, value in enumerate(self.form.steps):
            if not self.form.last_uses[v]:
                continue
            if isinstance(value, Combination):
                lines += self._combination(v, value)
            elif value is not None and not self._is_added(v):
                lines += self._slope(v, value)
        end = self.arrays[len(self.form.steps) - 1]
        return lines if end == "y" else [*lines, *self._assign("y", Entry(end))]

    def _is_added(self, v: int) -> bool:
        """Whether a slope is added to the next combination, the only one that reads it, without an array of its own."""
        last = self.form.last_uses[v]
        following = self.form.steps[v + 1]
        is_next = last == v + 1 and isinstance(following, Combination) and len(following.terms) > 1
        return is_next and v + 1 not in self.increments

    def _take(self, v: int, ends: Iterable[int]) -> str:
        """The array for a value: that of one of the values that end there, or a free one; the others become free."""
        ended = [self.arrays.pop(u) for u in dict.fromkeys(ends) if u in self.arrays]
        pool = [*ended, *self.free]
        is_last = v == len(self.form.steps) - 1
        array = "y" if is_last and "y" in pool else next(iter(pool), "") or self.writer.array(f"r{len(self.arrays)}")
        self.free = [name for name in pool if name != array]
        self.arrays[v] = array
        return array

    def _slope(self, v: int, value: Slope) -> list[str]:
        """A slope in an array of its own, which is that of its point if possible."""
        at = self.arrays[value.at]
        ends = [value.at] if self.form.last_uses[value.at] == v else []
        array = self._take(v, ends if self.in_place else [])
        self._release(ends)
        return [f"{self.field}({at}, {array})"]

    def _release(self, ends: Iterable[int]) -> None:
        self.free += [self.arrays.pop(u) for u in ends if u in self.arrays]

    def _combination(self, v: int, value: Combination) -> list[str]:
        """A combination of values, with a slope that is added to it."""
        last, previous = self.form.last_uses, self.form.steps[v - 1]
        added = isinstance(previous, Slope) and self._is_added(v - 1)
        terms = dict(value.terms)
        ends = [u for u in terms if last[u] == v and u in self.arrays]
        if v in self.increments:
            (start,) = (u for u in terms if u not in self.slopes)
            total = self._sum((u, x) for u, x in terms.items() if u != start)
            self.arrays[v] = self.arrays.pop(start)
            self._release(u for u in ends if u != start)
            return [line for block in self.plan.result for line in self.forms.increase(block, total)]
        if not (added and isinstance(previous, Slope)):
            total = self._value(v, terms.items())
            return self._assign(self._take(v, ends), total)
        at, factor = previous.at, terms.pop(v - 1)
        point = self.arrays[at]
        others = [u for u in ends if u != at]
        ends_too = last[at] in (v - 1, v)
        values = {u: self.arrays[u] for u in terms}
        if others or self.free or not (ends_too and self.in_place):
            total = self._value(v, terms.items())
            array = self._take(v, others)
            self._release([at] if ends_too else [])
            if list(values.items()) == [(u, array) for u in terms]:
                return [self._add(v, point, array, next(iter(terms.values())), factor)]
            return [*self._assign(array, total), self._add(v, point, array, Fraction(1), factor)]
        own = terms.pop(at, Fraction(0))
        total = self._value(v, terms.items())
        array = self._take(v, [at])
        line = self._add(v, point, array, own, factor)
        return [line, *self._assign(array, Sum((Entry(array), total)))] if terms else [line]

    def _add(self, v: int, point: str, array: str, own: Coefficient, factor: Coefficient) -> str:
        """A statement array ← own · array + factor · slope at a point."""
        x = fraction(factor)
        number = "h" if v not in self.slopes and x == 1 else "h*" * (v not in self.slopes) + repr(round_entry(x))
        return f"{self.updated}({point}, {array}, {round_entry(fraction(own))!r}, {number})"

    def _value(self, v: int, terms: Terms) -> Value:
        """A combination of the arrays of values, in the units of the value v."""
        pairs = list(terms)
        if v in self.slopes:
            return self._sum(pairs)
        states = [self._scaled(u, x) for u, x in pairs if u not in self.slopes]
        slopes = [(u, x) for u, x in pairs if u in self.slopes]
        return Sum((*states, *([Product("h", self._sum(slopes))] if slopes else [])))

    def _sum(self, terms: Terms) -> Sum:
        return Sum(tuple(self._scaled(u, x) for u, x in terms))

    def _scaled(self, u: int, x: Coefficient) -> Value:
        return scaled(Entry(self.arrays[u]), fraction(x))

    def _assign(self, array: str, value: Value) -> list[str]:
        """Loops that assign a value to all entries of an array."""
        blocks = range(len(self.structure.blocks))
        return [line for block in blocks for line in self.forms.assignments(block, [Assign(array, "=", value)])]
