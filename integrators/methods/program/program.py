"""What a method is: anything with a program, that is with evaluations of the field and linear combinations of them.

Every one-step method made of stages is a list of evaluations k_1, k_2, … and a result y₁ = y₀ + Σ b_e k_e. Four kinds
of evaluation are enough for all of them; each takes linear forms in y₀ and the k_e, of later evaluations too where
stages are implicit. Three readers understand a program: the algebra of series, substitution (with another field in
place of f), and the generator of steppers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import check_digits, check_label, check_partition_names
from integrators.core.errors import IntegratorError, shorten
from integrators.core.immutable import ImmutableValue
from integrators.exact import entries
from integrators.exact.entries import round_entry
from integrators.exact.expressions import format_number
from integrators.methods.program.child_bounds import read_child_bounds
from integrators.methods.program.evaluations import (
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
    from integrators.exact.entries import Entry
    from integrators.methods.program.child_bounds import ChildBounds


MAX_STAGES = 1000
"""The largest number of stages of a tableau, and of unknown evaluations at a time."""


class Method(ImmutableValue):
    """A one-step method: coefficients of its kind, and a `program` that says how it steps.

    A class of one's own needs a property `program` only; by default it answers everything else.

    Example:
        >>> class Heun(Method):
        ...     @property
        ...     def program(self):
        ...         builder = ProgramBuilder()
        ...         k1 = builder.field(builder.y)
        ...         k2 = builder.field(builder.y + k1)
        ...         return builder.program(builder.y + (k1 + k2) / 2, name="heun")
        >>> Heun().name, Heun().stages, Heun().is_explicit
        ('heun', 2, True)
    """

    @cached_property
    def program(self) -> Program:
        """The step as a program; each kind of method makes its own."""
        raise NotImplementedError

    @property
    def _data(self) -> tuple[Any, ...]:
        return (self.program,)

    @cached_property
    def name(self) -> str:
        """The name that messages call the method."""
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

    @cached_property
    def max_children(self) -> ChildBounds | None:
        """How often each part can be differentiated along each part, and in all; None without bound."""
        return self.program.max_children

    @property
    def stages(self) -> int:
        """The number of stages."""
        return self.program.stages

    @cached_property
    def domain(self) -> str:
        """The smallest domain that holds the coefficients: QQ, decimal, algebraic, symbolic or float."""
        domain = self.program.domain
        return "decimal" if self.digits is not None and domain == "QQ" else domain

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in the coefficients, sorted."""
        return self.program.parameters

    @cached_property
    def is_explicit(self) -> bool:
        """Whether every stage needs earlier ones only."""
        return self.program.is_explicit

    @cached_property
    def issues(self) -> tuple[str, ...]:
        """One sentence for each contradiction in the coefficients, such as weights that do not sum to 1."""
        return self.program.issues


class Program(Method):
    """A one-step method as a program; made by a `ProgramBuilder`, which explains its attributes.

    Example:
        >>> builder = ProgramBuilder()
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
        self,
        evaluations: Sequence[Evaluation],
        result: LinearForm,
        *,
        parts: Sequence[str] = ("",),
        auxiliary: Sequence[str] = (),
        name: str | None = None,
        reference: str | None = None,
        digits: int | None = None,
        max_children: Any = None,
    ) -> None:
        check_label(name, "name")
        check_label(reference, "reference")
        check_digits(digits)
        check_form(result, "result", start=1)
        names = tuple(parts)
        self.__dict__.update(
            names=names,
            auxiliary=tuple(part for part in names if part in auxiliary),
            evaluations=tuple(evaluations),
            result=result,
            name="custom" if name is None else name,
            reference=reference,
            digits=digits,
            max_children=read_child_bounds(max_children, len(names)),
        )
        self._check_registers()
        if self.domain == "float" and self.parameters:
            raise IntegratorError(entries.NO_SYMBOLS_AMONG_FLOATS)

    def _check_registers(self) -> None:
        count = len(self.evaluations)
        for form in (*(form for e in self.evaluations for form in operands(e)), self.result):
            if any(e >= count for e in form.terms):
                raise IntegratorError(f"evaluations must all be defined, but k{max(form.terms) + 1} is not")
        unsettled = set(range(count))
        while unsettled:
            settled = {e for e in unsettled if not unsettled & self.same_order_registers(e)}
            if not settled:
                raise IntegratorError(
                    f"forcing must not depend on the flow that it drives, but that of k{min(unsettled) + 1} does"
                )
            unsettled -= settled

    def same_order_registers(self, e: int) -> set[int]:
        """The evaluations that evaluation e depends on without a factor of h."""
        evaluation = self.evaluations[e]
        forms = evaluation.forcing if isinstance(evaluation, Flow) else ()
        return {other for form in forms for other in form.terms}

    @property
    def _data(self) -> tuple[Any, ...]:
        # The domain: 0.5 equals Fraction(1, 2), but a method in floats is no exact one.
        return self.domain, self.names, self.auxiliary, self.evaluations, self.result, self.digits, self.max_children

    @property
    def program(self) -> Program:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The program itself."""
        return self

    def restricted(self, max_children: Any) -> Program:
        """The same method for fields of a special form, on which the differentials of all other trees vanish.

        Args:
            max_children: bounds on the children of nodes, as for `ProgramBuilder.program`.

        Returns:
            The program with these bounds in place of its own.

        Raises:
            IntegratorError: `max_children` is no such bound.

        Example:
            Two steps of the Störmer–Verlet method for p' = g(q), q' = p:

            >>> from integrators import method, repeat
            >>> repeat(method("rkn-verlet"), 2).restricted([[0, None], [1, 0]]).max_children
            ((0, None), (1, 0))
        """
        return Program(
            self.evaluations,
            self.result,
            parts=self.names,
            auxiliary=self.auxiliary,
            name=self.name,
            reference=self.reference,
            digits=self.digits,
            max_children=max_children,
        )

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

    @property
    def precision(self) -> Fraction | float:
        """The relative error of the coefficients: 0 if they are exact."""
        return entries.relative_error(self.domain, self.digits)

    @cached_property
    def weight_sums(self) -> tuple[Entry, ...]:
        """For each part what a constant field would be multiplied with."""
        return tuple(
            entries.sum_entries([x * self.total(e, part) for e, x in self.result.terms.items()])
            for part in range(len(self.names))
        )

    def total(self, e: int, part: int) -> Any:
        """What k_e / h is for a field that is the constant 1 in one part, and zero in the others."""
        evaluation = self.evaluations[e]
        if isinstance(evaluation, Derivative):
            return 0
        own: Any = int(evaluation.part in (part, None))
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
        """The smallest domain that holds the coefficients: QQ, algebraic, symbolic or float."""
        return entries.find_domain(self._entries)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in the program, sorted."""
        return entries.symbol_names(self._entries)

    @cached_property
    def is_explicit(self) -> bool:
        """Whether every evaluation needs earlier ones only."""
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


class ProgramBuilder:
    """Records a method as it is written down.

    `y` is the start value; `field`, `derivative`, `flow` and `average` record an evaluation and give it as a
    `LinearForm` to compute with; `program` ends the record. For implicit stages, `unknowns` gives evaluations before
    they are defined, and `into` says which one is.

    Args:
        parts: names of the parts of the field f = Σ f^[part]; the blocks of a partitioned system are parts, too.
        auxiliary: which of them are no parts of the field, such as the matrix of a W-method.

    Raises:
        IntegratorError: a name is unusable, or `auxiliary` names no part.

    Example:
        The implicit midpoint rule:

        >>> builder = ProgramBuilder()
        >>> (k,) = builder.unknowns(1)
        >>> _ = builder.field(builder.y + k / 2, into=k)
        >>> print(builder.program(builder.y + k))
        k1 = h f(y + 1/2*k1)
        y1 = y + k1
    """

    def __init__(self, parts: Sequence[str] = (), *, auxiliary: Sequence[str] = ()) -> None:
        for argument, names in (("parts", parts), ("auxiliary", auxiliary)):
            if isinstance(names, str) or not isinstance(names, Iterable):
                raise IntegratorError(f"{argument} must be a sequence of names, but was {shorten(repr(names))}")
        check_partition_names(parts)
        if len(set(parts)) < len(parts):
            raise IntegratorError(f"parts must have different names, but were {', '.join(parts)}")
        for name in auxiliary:
            if name not in parts:
                raise IntegratorError(f"auxiliary must name parts, but {shorten(repr(name))} is none")
        self._parts = tuple(parts) or ("",)
        self._auxiliary = tuple(auxiliary)
        self._evaluations: list[Evaluation | None] = []
        self.y = LinearForm.of_entries(Fraction(1), {}, self)

    def unknowns(self, count: int) -> tuple[LinearForm, ...]:
        """Evaluations to be defined later, up to 1,000 at a time."""
        if isinstance(count, bool) or not isinstance(count, int) or not 0 <= count <= MAX_STAGES:
            raise IntegratorError(f"count must be from 0 to {MAX_STAGES}, but was {shorten(repr(count))}")
        first = len(self._evaluations)
        self._evaluations += [None] * count
        return tuple(map(self._register, range(first, first + count)))

    def _register(self, e: int) -> LinearForm:
        return LinearForm.of_entries(Fraction(0), {e: Fraction(1)}, self)

    def _form(self, form: object, argument: str, *, start: int) -> LinearForm:
        """A form of this builder, without its mark."""
        checked = check_form(form, argument, start=start)
        if checked.owner not in (None, self):
            raise IntegratorError(f"{argument} must come from this builder, but {shorten(str(checked))} is another's")
        return LinearForm.of_entries(checked.start, checked.terms)

    def field(self, at: LinearForm, part: str | None = None, *, into: LinearForm | None = None) -> LinearForm:
        """h f^[part](at); all parts if None."""
        return self._record(Field(self._part(part), self._form(at, "at", start=1)), into)

    def derivative(
        self, at: LinearForm, along: LinearForm, part: str | None = None, *, into: LinearForm | None = None
    ) -> LinearForm:
        """h (f^[part])′(at) · along."""
        points = self._form(at, "at", start=1), self._form(along, "along", start=0)
        return self._record(Derivative(self._part(part), *points), into)

    def flow(
        self,
        at: LinearForm,
        part: str | None = None,
        *,
        time: Any = 1,
        forcing: Iterable[LinearForm] = (),
        into: LinearForm | None = None,
    ) -> LinearForm:
        """The increment of the exact flow over time · h, with a polynomial forcing in θ (see `Flow`)."""
        forms = tuple(self._form(form, "forcing", start=0) for form in forcing)
        duration = entries.read_entry(time, "time")
        return self._record(Flow(self._part(part), self._form(at, "at", start=1), duration, forms), into)

    def average(
        self, path: Sequence[LinearForm], part: str | None = None, *, power: int = 0, into: LinearForm | None = None
    ) -> LinearForm:
        """∫₀¹ θ^power h f^[part](Σ θ^j path[j]) dθ."""
        if not isinstance(path, Sequence) or not path:
            raise IntegratorError(
                f"path must be a sequence that holds at least its start, but was {shorten(repr(path))}"
            )
        if isinstance(power, bool) or not isinstance(power, int) or power < 0:
            raise IntegratorError(f"power must be 0, 1, 2, …, but was {shorten(repr(power))}")
        forms = tuple(self._form(form, f"path[{j}]", start=int(j == 0)) for j, form in enumerate(path))
        return self._record(Average(self._part(part), forms, power), into)

    def program(
        self,
        result: LinearForm,
        *,
        name: str | None = None,
        reference: str | None = None,
        digits: int | None = None,
        max_children: Any = None,
    ) -> Program:
        """The method whose step ends at a point.

        Args:
            result: the end of the step.
            name: what messages call the method.
            reference: where the method was published.
            digits: for coefficients published as decimals, how many significant digits are correct.
            max_children: for a method meant for fields of a special form, bounds on the children of nodes in trees
                whose differentials do not vanish there: one number, or for each part a row that says how often it can
                be differentiated along each part and perhaps, as a last entry, in all; None means without bound. The
                series of the method then has no other trees.

        Returns:
            The program.

        Raises:
            IntegratorError: an evaluation is not defined, `result` is no point, or an argument is not as it must be.

        Example:
            Lawson's Euler method for y' = L y + N(y), L linear:

            >>> builder = ProgramBuilder(["L", "N"])
            >>> at = builder.y + builder.field(builder.y, "N")
            >>> builder.program(at + builder.flow(at, "L"), name="lawson", max_children=[[1, 1, 1], [None, None]])
            <Program lawson: 2 evaluations, max_children=((1, 1, 1), (None, None))>
        """
        for e, evaluation in enumerate(self._evaluations, 1):
            if evaluation is None:
                raise IntegratorError(f"evaluations must all be defined, but k{e} is not")
        evaluations: Any = tuple(self._evaluations)
        return Program(
            evaluations,
            self._form(result, "result", start=1),
            parts=self._parts,
            auxiliary=self._auxiliary,
            name=name,
            reference=reference,
            digits=digits,
            max_children=max_children,
        )

    def _part(self, name: str | None) -> int | None:
        if name is None:
            if self._auxiliary:
                raise IntegratorError(f"part must be one of {', '.join(self._parts)}, but was None")
            return None if len(self._parts) > 1 else 0
        if name not in self._parts:
            known = ", ".join(self._parts) if self._parts != ("",) else "None, as there is only one"
            raise IntegratorError(f"part must be one of {known}, but was {shorten(repr(name))}")
        return self._parts.index(name)

    def _record(self, evaluation: Evaluation, into: LinearForm | None) -> LinearForm:
        if into is None:
            self._evaluations.append(evaluation)
            return self._register(len(self._evaluations) - 1)
        known = isinstance(into, LinearForm) and into.start == 0 and len(into.terms) == 1 and 1 in into.terms.values()
        e = next(iter(into.terms)) if known else -1
        if not known or e >= len(self._evaluations) or self._evaluations[e] is not None:
            raise IntegratorError(f"into must be one of the unknowns, not yet defined, but was {shorten(str(into))}")
        self._evaluations[e] = evaluation
        return into


DIGITS = 10
"""Published decimals are shown with so many digits."""


def program_text(program: Program) -> str:
    """The evaluations k1, k2, … and the end of the step y1."""
    show = format_number if program.digits is None else _rounded
    lines = [f"k{e} = {_text(x, program.names, show)}" for e, x in enumerate(program.evaluations, 1)]
    return "\n".join([*lines, f"y1 = {program.result.text(show)}"])


def _rounded(x: Entry) -> str:
    return f"{round_entry(x):.{DIGITS}g}"


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
