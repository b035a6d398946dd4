"""Methods as programs: evaluations of the field and linear combinations of them.

Every one-step method with stages is a list of evaluations k_1, k_2, … and a result y₁ = y₀ + Σ b_e k_e. Four kinds of
evaluations suffice; their arguments are linear forms in y₀ and the k_e, including later ones for implicit stages.
Programs are used by series, by substitution (another field for f) and by the generator of steppers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from bseries_base.child_bounds import ChildBounds, read_child_bounds
from bseries_base.errors import shorten
from bseries_base.plotting import Style, drawing, fit_picture, in_centimetres
from bseries_base.table import Column, Document, Table, as_html
from integrators.core.arguments import check_digits, read_labels
from integrators.core.errors import IntegratorError
from integrators.core.immutable import ImmutableValue
from integrators.exact import entries
from integrators.exact.entries import Entry, multiply_entries, round_entry
from integrators.exact.expressions import format_number
from integrators.methods.programs.evaluations import (
    Average,
    Derivative,
    Evaluation,
    Field,
    Flow,
    LinearForm,
    check_form,
    operands,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAX_STAGES = 1000
"""The largest number of stages of a tableau, and of unknowns in one call."""
CHARACTERS = 100
"""The width of the text of a method in a picture: longer lines do not fit a page."""


class Method(ImmutableValue):
    """A one-step method: the coefficients of its kind, and its `program`.

    A subclass needs only the property `program`, from which all others are derived by default.

    Example:
        >>> import bseries as bs
        >>> class Heun(bs.methods.Method):
        ...     @property
        ...     def program(self):
        ...         builder = bs.ProgramBuilder()
        ...         k1 = builder.field(builder.y)
        ...         k2 = builder.field(builder.y + k1)
        ...         return builder.program(builder.y + (k1 + k2) / 2, name="heun")
        >>> Heun().name, Heun().stages, Heun().is_explicit
        ('heun', 2, True)
    """

    @cached_property
    def program(self) -> Program:
        """The step as a program, defined by each kind of method."""
        raise NotImplementedError

    @property
    def _data(self) -> tuple[object, ...]:
        return (self.program,)

    def to_table(self) -> Table:
        """The coefficients: the tableau, the flows of a splitting, or the evaluations of a program."""
        lines = [(line,) for line in program_text(self.program).splitlines()]
        return Table(self.name, [Column("step")], lines, self.remarks, data=self.to_dict)

    def to_dict(self) -> Document:
        """The method as plain data."""
        return {"schema": 1, "kind": "method", "name": self.name, "program": program_text(self.program).splitlines()}

    _repr_html_ = as_html

    def plot(self, ax: Axes | None = None) -> Axes:
        """The table of the method as a picture: the flows of a splitting, or the evaluations of a program.

        Example:
            >>> import bseries as bs
            >>> print(bs.method("lie-trotter").plot().texts[0].get_text())
            lie-trotter
            <BLANKLINE>
            step  flow of  coefficient of h
            ────  ───────  ────────────────
               1  a        1
               2  b        1
        """
        text = self.to_table()._replace(notes=()).to_text(CHARACTERS)
        lines = text.splitlines()
        # Font size, gaps, and width of a letter and distance of lines relative to the font size, in points.
        font, gap, aspect, leading = 9.0, 7.0, 0.602, 1.35
        size = font * aspect * max(map(len, lines)) + 2 * gap, font * leading * len(lines) + 2 * gap
        with drawing(ax, IntegratorError, in_centimetres(size), frame=False) as axes:
            style: Style = {"family": "monospace", "linespacing": leading / 1.2, "parse_math": False}
            axes.text(gap, gap, text, va="top", fontsize=font * fit_picture(axes, size), **style)
        return axes

    @property
    def remarks(self) -> list[str]:
        """Sentences on parameters, digits and source."""
        found = [f"parameters: {', '.join(self.parameters)}"] if self.parameters else []
        if self.digits is not None:
            found.append(f"decimals with {self.digits} correct digits")
        return [*found, f"reference: {self.reference}"] if self.reference else found

    @cached_property
    def name(self) -> str:
        """The name of the method in messages."""
        return self.program.name

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the parts of the field; one part has the name ""."""
        return self.program.names

    @cached_property
    def reference(self) -> str | None:
        """The publication of the method."""
        return self.program.reference

    @cached_property
    def digits(self) -> int | None:
        """The number of correct digits of coefficients published as decimals; None if they are exact."""
        return self.program.digits

    @property
    def labels(self) -> Document:
        """Name, reference and digits, as arguments of a program."""
        return {"name": self.name, "reference": self.reference, "digits": self.digits}

    @cached_property
    def max_children(self) -> ChildBounds | None:
        """Bounds on derivatives of each part with respect to each part, and in all; None if unbounded."""
        return self.program.max_children

    @property
    def stages(self) -> int:
        """The number of stages."""
        return self.program.stages

    @cached_property
    def domain(self) -> str:
        """The smallest domain that contains the coefficients: QQ, decimal, algebraic, symbolic or float."""
        domain = self.program.domain
        return "decimal" if self.digits is not None and domain == "QQ" else domain

    @property
    def precision(self) -> Fraction | float:
        """The relative error of the coefficients: 0 if they are exact."""
        return entries.relative_error(self.domain, self.digits)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in the coefficients, sorted."""
        return self.program.parameters

    @cached_property
    def is_explicit(self) -> bool:
        """Whether every stage depends only on earlier ones."""
        return self.program.is_explicit

    @cached_property
    def issues(self) -> tuple[str, ...]:
        """One sentence for each contradiction in the coefficients, such as weights that do not sum to 1."""
        return self.program.issues

    def rational_program(self, decimals: int) -> Program:
        """The program, with rational approximations of coefficients whose exact form is slow to compute.

        Only tableaux on roots of polynomials (see `StageAlgebra`) have such coefficients; the approximations are within
        10^-decimals.

        Example:
            >>> import bseries as bs
            >>> print(bs.method("gauss2").rational_program(3).result)
            y + 1/2*k1 + 1/2*k2
        """
        return self.program


class Program(Method):
    """A one-step method as a program, created and explained by `ProgramBuilder`.

    Example:
        >>> import bseries as bs
        >>> builder = bs.ProgramBuilder()
        >>> k1 = builder.field(builder.y)
        >>> k2 = builder.field(builder.y + k1 / 2)
        >>> method = builder.program(builder.y + k2, name="explicit-midpoint")
        >>> print(method)
        k1 = h f(y)
        k2 = h f(y + 1/2*k1)
        y1 = y + k2
        >>> method.is_explicit
        True
    """

    auxiliary: tuple[str, ...]
    evaluations: tuple[Evaluation, ...]
    result: LinearForm

    def __init__(
        self, evaluations: Sequence[Evaluation], result: LinearForm, *, parts: Sequence[str] = ("",),
        auxiliary: Sequence[str] = (), name: str | None = None, reference: str | None = None, digits: int | None = None,
        max_children: object = None,
    ) -> None:  # fmt: skip
        labels = read_labels(name, reference)
        check_digits(digits)
        check_form(result, "result", start=1)
        names = tuple(parts)
        self.__dict__.update(names=names, evaluations=tuple(evaluations), result=result, digits=digits, **labels)
        self.__dict__["auxiliary"] = tuple(part for part in names if part in auxiliary)
        self.__dict__["max_children"] = _shortest(read_child_bounds(max_children, len(names), IntegratorError))
        self._check_registers()
        if self.domain == "float" and self.parameters:
            raise IntegratorError(entries.NO_SYMBOLS_AMONG_FLOATS)

    def _check_registers(self) -> None:
        count = len(self.evaluations)
        for form in (*(form for e in self.evaluations for form in operands(e)), self.result):
            if any(e >= count for e in form.terms):
                raise IntegratorError(f"evaluations must all be defined, but k{max(form.terms) + 1} is not")
        try:
            TopologicalSorter({e: self.same_order_registers(e) for e in range(count)}).prepare()
        except CycleError as error:
            e = min(error.args[1])
            raise IntegratorError(
                f"forcing must not depend on the flow that it drives, but that of k{e + 1} does"
            ) from None

    def same_order_registers(self, e: int) -> set[int]:
        """The evaluations on which evaluation e depends without a factor of h."""
        evaluation = self.evaluations[e]
        forms = evaluation.forcing if isinstance(evaluation, Flow) else ()
        return {other for form in forms for other in form.terms}

    @property
    def _data(self) -> tuple[object, ...]:
        # With the domain, since 0.5 equals Fraction(1, 2) but a method in floats is not exact.
        return self.domain, self.names, self.auxiliary, self.evaluations, self.result, self.digits, self.max_children

    @property
    def program(self) -> Program:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The program itself."""
        return self

    def restricted(self, max_children: object) -> Program:
        """The same method with other bounds, as for `ProgramBuilder.program`, on the children of nodes of trees.

        Example:
            Two steps of the Störmer–Verlet method for p' = g(q), q' = p:

            >>> import bseries as bs
            >>> bs.methods.repeat(bs.method("rkn-verlet"), 2).restricted([[0, None], [1, 0]]).max_children
            ((0, None), (1, 0))
        """
        return self.changed(max_children=max_children)

    def changed(self, **changes: Any) -> Program:
        """The program with some arguments of its constructor changed."""
        own = {key: getattr(self, key) for key in ("evaluations", "result", "auxiliary", "max_children")}
        return Program(**own | {"parts": self.names, **self.labels} | changes)

    @property
    def stages(self) -> int:
        """The number of evaluations."""
        return len(self.evaluations)

    @cached_property
    def issues(self) -> tuple[str, ...]:
        """One sentence for each part of the field whose weights do not sum to 1, or to 0 if it is auxiliary."""
        wanted = [0 if name in self.auxiliary else 1 for name in self.names]
        return tuple(
            f"weights of {f'part {name}' if name else 'the evaluations'} sum to {shorten(str(total))}, not {number}: "
            "the method is inconsistent"
            for name, total, number in zip(self.names, self.weight_sums, wanted, strict=True)
            if entries.certainly_differs(total, number, self.precision)
        )

    @cached_property
    def weight_sums(self) -> tuple[Entry, ...]:
        """For each part the sum of its weights, the factor of a constant field."""
        return tuple(
            entries.sum_entries([x * self.total(e, part) for e, x in self.result.terms.items()])
            for part in range(len(self.names))
        )

    def total(self, e: int, part: int) -> Entry:
        """The value of k_e / h for a field that is 1 in one part and 0 in the others."""
        evaluation = self.evaluations[e]
        if isinstance(evaluation, Derivative):
            return 0
        own: Entry = int(evaluation.part in (part, None))
        if isinstance(evaluation, Average):
            return own * entries.read_entry("1", "weight") / (evaluation.power + 1)
        if isinstance(evaluation, Flow):
            own = own * evaluation.time
            for j, form in enumerate(evaluation.forcing):
                own += sum(x * self.total(other, part) for other, x in form.terms.items()) / (j + 1)
        return own

    @cached_property
    def _entries(self) -> tuple[Entry, ...]:
        times = (e.time for e in self.evaluations if isinstance(e, Flow))
        forms = (*(form for e in self.evaluations for form in operands(e)), self.result)
        return (*times, *(x for form in forms for x in form.entries))

    @cached_property
    def domain(self) -> str:
        """The smallest domain that contains the coefficients: QQ, algebraic, symbolic or float."""
        return entries.find_domain(self._entries)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in the program, sorted."""
        return entries.symbol_names(self._entries)

    @cached_property
    def is_explicit(self) -> bool:
        """Whether every evaluation depends only on earlier ones."""
        return all(
            other < e
            for e, evaluation in enumerate(self.evaluations)
            for form in operands(evaluation)
            for other in form.terms
        )

    def __str__(self) -> str:
        return program_text(self)

    def __repr__(self) -> str:
        count = len(self.evaluations)
        restricted = "" if self.max_children is None else f", max_children={self.max_children}"
        return f"<Program {self.name}: {count} evaluation{'s' * (count != 1)}{restricted}>"


DIGITS = 10
"""Of published decimals in the text of a program."""


class RepeatedProgram(Program):
    """Several equal steps as one program, whose evaluations are made when they are read.

    The series of n steps is the n-th power of that of one step, which needs no evaluations.
    """

    step: Program
    count: int  # the number of steps

    def __init__(self, step: Program, count: int, name: str) -> None:
        shared = ("names", "auxiliary", "digits", "max_children", "domain", "parameters", "is_explicit")
        self.__dict__.update({key: getattr(step, key) for key in shared}, step=step, count=count)
        self.__dict__.update(name=name, reference=None)

    @cached_property
    def _composed(self) -> Program:
        evaluations: list[Evaluation] = []
        end = LinearForm(1)
        parts = range(len(self.names))
        for _ in range(self.count):
            added, end = appended(self.step, Fraction(1, self.count), first=len(evaluations), start=end, parts=parts)
            evaluations += added
        return self.step.changed(evaluations=evaluations, result=end, name=self.name, reference=None)

    @property
    def evaluations(self) -> tuple[Evaluation, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The evaluations of all steps."""
        return self._composed.evaluations

    @property
    def result(self) -> LinearForm:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The end of the last step."""
        return self._composed.result

    @property
    def stages(self) -> int:
        """The number of evaluations."""
        return self.count * self.step.stages

    @property
    def weight_sums(self) -> tuple[Entry, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """For each part the sum of the weights of all steps, which is that of one."""
        return self.step.weight_sums


def program_text(program: Program) -> str:
    """The evaluations k1, k2, … and the end of the step y1."""
    show = format_number if program.digits is None else lambda x: f"{round_entry(x):.{DIGITS}g}"
    lines = [f"k{e} = {_text(x, program.names, show)}" for e, x in enumerate(program.evaluations, 1)]
    return "\n".join([*lines, f"y1 = {program.result.text(show)}"])


def _text(evaluation: Evaluation, names: tuple[str, ...], show: Callable[[Entry], str]) -> str:
    """An evaluation as a formula."""
    name = "" if evaluation.part is None else names[evaluation.part]
    f = f"f_{name}" if name else "f"
    match evaluation:
        case Field(_, at):
            return f"h {f}({at.text(show)})"
        case Derivative(_, at, along):
            return f"h {f}'({at.text(show)}) ({along.text(show)})"
        case Flow(_, at, time, forcing):
            factor = "" if time == 1 else f"{show(time)} "
            factor = f"({factor.strip()}) " if " " in factor.strip() else factor
            driven = "".join(f" + {_power(j)}({form.text(show)})" for j, form in enumerate(forcing))
            return f"z(1) - z(0), z' = {factor}h {f}(z){driven}, z(0) = {at.text(show)}"
        case Average(_, path, power):
            start, *further = (form.text(show) for form in path)
            along = " + ".join([start, *(f"{_power(j)}({form})" for j, form in enumerate(further, 1))])
            return f"∫ {_power(power)}h {f}({along}) dθ"


def _power(j: int) -> str:
    return "" if j == 0 else "θ " if j == 1 else f"θ^{j} "


def _shortest(bounds: ChildBounds) -> ChildBounds | None:
    """The bounds without last entries that are none; None if nothing is bounded."""
    rows = tuple(row[:-1] if row[-1] is None else row for row in bounds)
    return rows if any(bound is not None for row in rows for bound in row) else None


def common_bounds(first: ChildBounds | None, second: ChildBounds | None) -> ChildBounds | None:
    """The bounds that hold for the fields of both of two methods."""
    if first is None or second is None:
        return first or second
    rows = (zip_longest(a, b) for a, b in zip(first, second, strict=True))
    return tuple(tuple(min((x for x in pair if x is not None), default=None) for pair in row) for row in rows)


def scaled(program: Program, factor: Entry) -> tuple[tuple[Evaluation, ...], LinearForm]:
    """The evaluations and the end of a step of length factor · h.

    Every k = h f(·) is replaced by factor · k; the time of a flow is multiplied by the factor.
    """
    own = [Fraction(1) if isinstance(evaluation, Flow) else factor for evaluation in program.evaluations]

    def change(form: LinearForm) -> LinearForm:
        return LinearForm.of_entries(form.start, {e: multiply_entries(x, own[e]) for e, x in form.terms.items()})

    return mapped_program(program, change, lambda time: multiply_entries(time, factor))


def mapped_program(
    program: Program, function: Callable[[LinearForm], LinearForm], lengthen: Callable[[Entry], Entry] = lambda t: t
) -> tuple[tuple[Evaluation, ...], LinearForm]:  # fmt: skip
    """The evaluations and the end of a program with functions applied to linear forms and times of flows."""
    return tuple(mapped(e, function, lengthen) for e in program.evaluations), function(program.result)


def mapped(
    evaluation: Evaluation,
    function: Callable[[LinearForm], LinearForm],
    lengthen: Callable[[Entry], Entry] = lambda t: t,
) -> Evaluation:
    """The evaluation with functions applied to every linear form, and to the time of a flow."""
    made = evaluation._make(
        function(x) if isinstance(x, LinearForm) else tuple(map(function, x)) if isinstance(x, tuple) else x
        for x in evaluation
    )
    return made._replace(time=lengthen(made.time)) if isinstance(made, Flow) else made


def appended(
    program: Program, factor: Entry, *, first: int, start: LinearForm, parts: Sequence[int]
) -> tuple[list[Evaluation], LinearForm]:
    """A step of length factor · h from `start`: its evaluations, numbered from `first`, and its end."""
    evaluations, end = scaled(program, factor)

    def renumber(form: LinearForm) -> LinearForm:
        return form.substituted(lambda e: LinearForm(0, {first + e: 1}), start)

    def place(evaluation: Evaluation) -> Evaluation:
        moved = mapped(evaluation, renumber)
        return moved if moved.part is None else moved._replace(part=parts[moved.part])

    return [place(evaluation) for evaluation in evaluations], renumber(end)


def reversed_step(program: Program) -> tuple[tuple[Evaluation, ...], LinearForm]:
    """The adjoint Φ*_h = Φ_(−h)⁻¹: a step of −h from y1 ends at y0.

    The start of the reversed step is replaced by y − (end − start).
    """
    evaluations, end = scaled(program, Fraction(-1))
    start = LinearForm(1) - (end - LinearForm(1))

    def restart(form: LinearForm) -> LinearForm:
        return form.substituted(lambda e: LinearForm(0, {e: 1}), start)

    return tuple(mapped(evaluation, restart) for evaluation in evaluations), start


def as_decimals(program: Program, digits: int) -> Program:
    """The program with floats as decimals, of which `digits` digits are correct."""
    decimal = entries.nearest_decimal
    evaluations, end = mapped_program(program, lambda form: form.map(decimal), decimal)
    return program.changed(evaluations=evaluations, result=end, digits=digits)
