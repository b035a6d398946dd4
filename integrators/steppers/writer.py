"""Writer of a step: the module under construction, its arrays, functions and linear combinations of stage derivatives.

A `StepWriter` provides what every kind of call needs. Calls of the field, its derivative and its resolvent are written
here; averages, flows and implicit stages have files of their own.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

import numpy as np
import sympy

from integrators.compile.operation_graph import is_negative
from integrators.compile.printer import Assign, ModuleText, indented
from integrators.exact.arithmetic import simplest
from integrators.exact.entries import round_entry
from integrators.exact.expressions import literal
from integrators.steppers.step_model import Call, Form, Key, Options, Plan, Point
from integrators.steppers.structure import Diagonal, Functions, Structure, diagonal
from integrators.steppers.values import Entry, Index, Product, Sum, Value, entry, scaled, shifted, written

HEAD_BITS = 10
NOTHING = Fraction(1, 10**30)
"""Below, a coefficient is zero; coefficients are known to 40 digits."""

MOST_STACK = 32_768
"""Doubles of work arrays on the stack, half of a small thread's stack. Beyond, the caller provides an array."""


class FormWriter:
    """Writes linear combinations of y and stage derivatives as loops over blocks, and tracks what arrays contain.

    A point that extends the one before, as in a chain of kicks and drifts, is computed from it, with least rounding.
    With split coefficients the heads are exact, and the tails, whose rounding errors are random, are summed apart.

    Attributes:
        result: The end of the step, for each block.
        in_group: Whether implicit stages are being written, which recompute all points in each iteration.
        inlined: Stage derivatives that are substituted instead of being stored.
        reader: The number of the call that is being written; None for other statements.
        readers: The readers of each evaluation.
    """

    def __init__(self, structure: Structure, plan: Plan, options: Options):
        self.structure, self.result = structure, plan.result
        self.compensated, self.split = options.compensated, options.split and bool(plan.groups)
        self.in_group = False
        self.inlined: dict[Key, Value] = {}
        self.reader: int | None = None
        self.readers: defaultdict[int, set[int | None]] = defaultdict(set)
        self._points = None if plan.groups else plan.points()  # yet to compute; None if y is needed until the end
        self._ended: set[int] = set()
        self._content: dict[tuple[str, int], Form] = {}
        self._sums: dict[int, Form] = {}

    def forget(self) -> None:
        """Discard the known contents of the arrays."""
        self._content.clear()
        self._sums.clear()

    def end_step(self) -> None:
        """End the step: from here on y is the start of the next one."""
        self.forget()
        self._ended.clear()
        self._points = None

    def loop(self, block: int, body: Callable[[Index], Iterable[str]]) -> list[str]:
        """A loop over the entries of a block; a single entry needs none, since loops compile slowly."""
        made: list[str] = []
        for first, end in self.structure.blocks[block]:
            if end - first == 1:
                made += body(first)
            else:
                made += [f"for i in range({first}, {end}):", *indented(body("i"))]
        return made

    def assignments(self, block: int, statements: Iterable[Assign[Value]]) -> list[str]:
        """A loop that assigns values to entries of arrays."""
        made = list(statements)
        return self.loop(block, lambda i: [f"{entry(x.target, i)} {x.op} {written(x.value, i)}" for x in made])

    def point(self, point: Point, array: str, *, copied: bool = False) -> tuple[list[str], str]:
        """Statements that compute a point, and the array that then holds it: the given one unless y does.

        The end of the step overwrites y where y is no longer needed. With `copied` the array is used in any case.
        """
        is_end = self._points is not None
        if self._points is not None:
            for block, _ in point:
                self._points[block] -= 1
            is_end = all(form == self.result[block] and self._points[block] == 0 for block, form in point)
        if not copied and all(form.is_start for _, form in point):
            return [], "y"
        lines: list[str] = []
        if is_end and not copied:
            for block, form in point:
                lines += self.update(block, form)
                self._ended.add(block)
            return lines, "y"
        for block, form in point:
            if self._content.get((array, block)) != form:
                body = [Assign(array, "=", self.value(block, form, array))]
                if self.compensated and form.terms and _rest(form, self.result[block]):  # the end extends this sum
                    body.append(Assign("d", "=", self._extended(block, form)))
                    self._sums[block] = form
                lines += self.assignments(block, body)
                self._content[array, block] = form
        return lines, array

    def update(self, block: int, form: Form) -> list[str]:
        """Statements that overwrite the start of a step by its end.

        With compensation the sum so far is y + e, where y is the sum rounded, and each increment includes e. If e were
        added only once it reaches a unit in the last place of y, rounding would be biased for some step sizes (0.1 or
        0.01, whose binary digits are periodic) and first integrals would drift. So they would if the field were
        evaluated at y + h s without e, or if the increment were rounded before it is added: on Kepler's problem by 20
        to 100 standard errors in 10^7 steps of 0.05 or 0.04.

        References:
            N. J. Higham, *Accuracy and Stability of Numerical Algorithms*, section 4.3; HLW, section VIII.5.
        """
        if form.is_start or block in self._ended:
            return []
        if not self.compensated:
            return self.assignments(block, [Assign("y", "=", self.value(block, form, "z"))])
        known = self._sums.get(block)
        return self.increase(
            block, Entry("d") if known is not None and known.terms == form.terms else self._extended(block, form)
        )

    def increase(self, block: int, total: Value) -> list[str]:
        """Statements that add h times a value to y, with compensation."""

        def body(i: Index) -> list[str]:
            y, e = entry("y", i), entry("e", i)
            return [f"s = {written(total, i)}", f"x = {y} + fma(h, s, {e})", f"{e} += fma(h, s, {y} - x)", f"{y} = x"]

        return self.loop(block, body)

    def value(self, block: int, form: Form, array: str = "") -> Value:
        """An entry of a form, which extends the content of the array if possible."""
        known = self._content.get((array, block))
        if known == form:
            return Entry(array)
        if known is not None and known.start == form.start:
            extended = _rest(known, form)
            if extended:
                return Sum((Entry(array), self._scaled(block, extended)))
        total = (self._scaled(block, form.terms),) if form.terms else ()
        if not form.start:
            return Sum(total)
        head = _head(form.start)
        if not self.split or abs(form.start - head) < NOTHING or not head:
            return Sum((scaled(Entry("y"), form.start), *total))
        return Sum((scaled(Entry("y"), head), Sum((scaled(Entry("y"), form.start - head), *total))))

    def _scaled(self, block: int, terms: Sequence[tuple[int, Fraction]]) -> Value:
        """h Σ x_e k_e; with a single term h x_e is rounded once."""
        if len(terms) == 1 and not self.split:
            e, x = terms[0]
            return Product("h", self._product(block, (e, abs(x))), negative=x < 0)
        return Product("h", self.sum(block, terms))

    def _extended(self, block: int, form: Form) -> Value:
        """Σ x_e k_e, from the content of d if possible."""
        known = self._sums.get(block)
        rest = () if known is None else _rest(known, form)
        return Sum((Entry("d"), *self.sum(block, rest).terms)) if rest else self.sum(block, form.terms)

    def sum(self, block: int, terms: Sequence[tuple[int, Fraction]]) -> Sum:
        """Σ x_e k_e."""
        if not self.split:
            return Sum(tuple(self._product(block, term) for term in terms))
        heads = [(e, _head(x)) for e, x in terms]
        tails = [(e, x - head) for (e, x), (_, head) in zip(terms, heads, strict=True) if abs(x - head) > NOTHING]
        rest = (Sum(tuple(self._product(block, term) for term in tails)),) if tails else ()
        return Sum((*(self._product(block, term) for term in heads if term[1]), *rest))

    def _product(self, block: int, term: tuple[int, Fraction]) -> Value:
        """x_e k_e."""
        e, x = term
        self.readers[e].add(self.reader)
        return scaled(self.inlined.get((e, block), Entry(f"k{e}")), x)


def _rest(known: Form, form: Form) -> tuple[tuple[int, Fraction], ...]:
    """The terms by which a form extends another; empty if it does not."""
    before = dict(known.terms)
    is_extended = before and before.items() < dict(form.terms).items()
    return tuple((e, x) for e, x in form.terms if e not in before) if is_extended else ()


def _head(x: Fraction) -> Fraction:
    """A coefficient rounded to few bits."""
    return Fraction(round(x * 2**HEAD_BITS), 2**HEAD_BITS)


class StepWriter:
    """The module of a stepper while its step is written, with writers of calls by the kind of node.

    Attributes:
        once: Stage derivatives that only the next call reads, and that are substituted into its point.
        numbers: Functions of h whose values, concatenated, are the numbers that depend on the step size.
        averaged: The call whose values along its path are still stored.
        known: Names of arrays and functions that flows have already defined.
        matrices: Names of the matrices factorized in this step.
        written: The calls so far.
    """

    def __init__(
        self, structure: Structure, plan: Plan, calls: Mapping[str, CallWriter], options: Options,
        once: frozenset[Key] = frozenset(), arrays: Iterable[str] = ("y", "z", "d"),
    ):  # fmt: skip
        self.module = ModuleText(lanes=True, plain=True)
        self.numbers: list[Callable[[float], np.ndarray]] = []
        self._number_count = 0
        self._sizes: dict[str, int] = {}
        self._constants: dict[str, str] = {}
        self.structure, self.plan, self.options, self.once = structure, plan, options, once
        self.averaged: object = None
        self.known: dict[object, str] = {}
        self.matrices: dict[object, str] = {}
        self.written: list[Call] = []
        self._calls = calls
        self.functions = Functions(structure, self.module)
        self.forms = FormWriter(structure, plan, options)
        for name in (*arrays, *(["e"] * options.compensated)):
            self.array(name)

    def array(self, name: str, size: int | None = None) -> str:
        """The name of a work array, by default of the size of the state."""
        self._sizes[name] = max(self._sizes.get(name, 0), size or self.structure.scene.dimension)
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

    def call_lines(self, call: Call, target: str | None = None) -> list[str]:
        """Statements for a call and its points; the target is by default the array from which others read."""
        if target is None and not self.is_inlined(call):
            target = self.array(f"k{call.evaluation}")
        self.forms.reader = len(self.written)
        self.written.append(call)
        lines = self._calls[call.node.kind](call, target or "", self)
        self.forms.reader = None
        return lines

    def is_inlined(self, call: Call) -> bool:
        """Whether the stage derivative of a call is substituted into the point that needs it."""
        return call.written[0] in self.once


CallWriter: TypeAlias = Callable[["Call", str, StepWriter], list[str]]
"""Maps a call, the name of an array for its stage derivatives and a writer to statements."""


def field_call_lines(call: Call, target: str, writer: StepWriter) -> list[str]:
    """Statements for a piece of the field at a point; diagonal blocks are written as loops, or where they are read."""
    point, piece, forms = call.node.points[0], call.node.piece, writer.forms
    scaling = {block: diagonal(writer.structure, piece, block) for block in call.blocks}
    if len(call.blocks) == 1 and (call.evaluation, call.blocks[0]) in writer.once and forms.in_group:
        chosen = scaling[call.blocks[0]]
        assert chosen is not None  # ensured by read_once
        value = forms.value(chosen.source, dict(point)[chosen.source])
        forms.inlined[call.evaluation, call.blocks[0]] = _scaled(chosen, value, writer)
        return []
    lines, at = forms.point(point, "z")
    others = []
    for block, chosen in scaling.items():
        if chosen is None:
            others.append(block)
            continue
        value = _scaled(chosen, Entry(at), writer)
        if (call.evaluation, block) in writer.once:
            forms.inlined[call.evaluation, block] = value
        else:
            lines += forms.assignments(block, [Assign(target, "=", value)])
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
        lines += writer.forms.assignments(block, [Assign(target, "=", writer.forms.sum(block, form.terms))])
    return [*lines, f"solve({matrix}, {pivots}, {n}, {target})"]


def _scaled(chosen: Diagonal, value: Value, writer: StepWriter) -> Value:
    """An entry of a diagonal piece, where the value is that of y."""
    moved = shifted(value, -chosen.shift)
    if chosen.factors == (1,):
        return moved
    if len(chosen.factors) == 1:
        number = simplest(chosen.factors[0])
        return Product(literal(abs(number)), moved, negative=is_negative(number))
    return Product(Entry(writer.constants(chosen.factors), -chosen.first), moved)
