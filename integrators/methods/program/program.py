"""Methods as programs: evaluations of the field and linear combinations of them.

Every one-step method with stages is a list of evaluations k_1, k_2, … and a result y₁ = y₀ + Σ b_e k_e. Four kinds of
evaluations suffice; their arguments are linear forms in y₀ and the k_e, including later ones for implicit stages.
Programs are used by the algebra of series, by substitution (with another field in place of f), and by the generator of
steppers.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import check_digits, check_partition_names, read_labels, read_whole
from integrators.core.errors import IntegratorError, shorten, shown
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
"""The largest number of stages of a tableau, and of unknowns in one call."""


class Method(ImmutableValue):
    """A one-step method: the coefficients of its kind, and its `program`.

    A subclass needs only the property `program`, from which all others are derived by default.

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
        """The step as a program, defined by each kind of method."""
        raise NotImplementedError

    @property
    def _data(self) -> tuple[Any, ...]:
        return (self.program,)

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

        Only tableaux on roots of polynomials (see `StageAlgebra`) have such coefficients.

        Args:
            decimals: the approximations are within 10^-decimals.

        Returns:
            The program.

        Example:
            >>> from integrators import method
            >>> print(method("gauss2").rational_program(3).result)
            y + 1/2*k1 + 1/2*k2
        """
        return self.program


class Program(Method):
    """A one-step method as a program, created and explained by `ProgramBuilder`.

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
        labels = read_labels(name, reference)
        check_digits(digits)
        check_form(result, "result", start=1)
        names = tuple(parts)
        self.__dict__.update(
            names=names,
            auxiliary=tuple(part for part in names if part in auxiliary),
            evaluations=tuple(evaluations),
            result=result,
            digits=digits,
            **labels,
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
        remaining = set(range(count))
        while remaining:
            ready = {e for e in remaining if not remaining & self.same_order_registers(e)}
            if not ready:
                raise IntegratorError(
                    f"forcing must not depend on the flow that it drives, but that of k{min(remaining) + 1} does"
                )
            remaining -= ready

    def same_order_registers(self, e: int) -> set[int]:
        """The evaluations on which evaluation e depends without a factor of h."""
        evaluation = self.evaluations[e]
        forms = evaluation.forcing if isinstance(evaluation, Flow) else ()
        return {other for form in forms for other in form.terms}

    @property
    def _data(self) -> tuple[Any, ...]:
        # With the domain, since 0.5 equals Fraction(1, 2) but a method in floats is not exact.
        return self.domain, self.names, self.auxiliary, self.evaluations, self.result, self.digits, self.max_children

    @property
    def program(self) -> Program:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The program itself."""
        return self

    def restricted(self, max_children: Any) -> Program:
        """The same method for fields whose elementary differentials vanish for trees beyond bounds.

        Args:
            max_children: bounds on the children of nodes, as for `ProgramBuilder.program`.

        Returns:
            The program with these bounds in place of its own.

        Raises:
            IntegratorError: `max_children` is not such a bound.

        Example:
            Two steps of the Störmer–Verlet method for p' = g(q), q' = p:

            >>> from integrators import method, repeat
            >>> repeat(method("rkn-verlet"), 2).restricted([[0, None], [1, 0]]).max_children
            ((0, None), (1, 0))
        """
        return self.changed(max_children=max_children)

    def changed(self, **changes: Any) -> Program:
        """The program with some arguments of its constructor changed."""
        arguments = {
            "evaluations": self.evaluations,
            "result": self.result,
            "parts": self.names,
            "auxiliary": self.auxiliary,
            "name": self.name,
            "reference": self.reference,
            "digits": self.digits,
            "max_children": self.max_children,
        }
        return Program(**arguments | changes)

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
        """For each part the sum of its weights, the factor of a constant field."""
        return tuple(
            entries.sum_entries([x * self.total(e, part) for e, x in self.result.terms.items()])
            for part in range(len(self.names))
        )

    def total(self, e: int, part: int) -> Any:
        """The value of k_e / h for a field that is 1 in one part and 0 in the others."""
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


class ProgramBuilder:
    """Builder of programs, evaluation by evaluation.

    `y` is the start value; `field`, `derivative`, `flow` and `average` add an evaluation and return it as a
    `LinearForm`; `program` returns the method. For implicit stages, `unknowns` returns evaluations yet to be defined,
    which the argument `into` then defines.

    Args:
        parts: names of the parts of the field f = Σ f^[part], such as the blocks of a partitioned system.
        auxiliary: the parts that do not belong to the field, such as the matrix of a W-method.

    Raises:
        IntegratorError: a name is invalid, or one of `auxiliary` is not a part.

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
                raise IntegratorError(f"{argument} must be a sequence of names, but was {shown(names)}")
        check_partition_names(parts)
        if len(set(parts)) < len(parts):
            raise IntegratorError(f"parts must have different names, but were {', '.join(parts)}")
        for name in auxiliary:
            if name not in parts:
                raise IntegratorError(f"auxiliary must name parts, but {shown(name)} is none")
        self._parts = tuple(parts) or ("",)
        self._auxiliary = tuple(auxiliary)
        self._evaluations: list[Evaluation | None] = []
        self.y = LinearForm.of_entries(Fraction(1), {}, self)

    def unknowns(self, count: int) -> tuple[LinearForm, ...]:
        """Up to 1,000 evaluations to be defined later."""
        count = read_whole(count, "count", f"from 0 to {MAX_STAGES}", 0, MAX_STAGES)
        first = len(self._evaluations)
        self._evaluations += [None] * count
        return tuple(map(self._register, range(first, first + count)))

    def _register(self, e: int) -> LinearForm:
        return LinearForm.of_entries(Fraction(0), {e: Fraction(1)}, self)

    def _form(self, form: object, argument: str, *, start: int) -> LinearForm:
        """A form of this builder, without its owner."""
        checked = check_form(form, argument, start=start)
        if checked.owner not in (None, self):
            raise IntegratorError(f"{argument} must come from this builder, but {shorten(str(checked))} is another's")
        return LinearForm.of_entries(checked.start, checked.terms)

    def field(self, at: LinearForm, part: str | None = None, *, into: LinearForm | None = None) -> LinearForm:
        """h f^[part](at); the sum of all parts if `part` is None."""
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
            raise IntegratorError(f"path must be a sequence that holds at least its start, but was {shown(path)}")
        power = read_whole(power, "power", "0, 1, 2, …", 0, sys.maxsize)
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
        """The method with a given end of the step.

        Args:
            result: the end of the step.
            name: the name of the method in messages.
            reference: the publication of the method.
            digits: for coefficients published as decimals, the number of correct significant digits.
            max_children: for a method for fields of a special form, bounds on the children of nodes in trees whose
                differentials do not vanish: one number, or for each part a row of bounds on its derivatives with
                respect to each part and optionally, as a last entry, in all; None means unbounded. The series of the
                method then contains no other trees.

        Returns:
            The program.

        Raises:
            IntegratorError: an evaluation is not defined, `result` is not a point, or another argument is invalid.

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
            raise IntegratorError(f"part must be one of {known}, but was {shown(name)}")
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
"""Of published decimals in the text of a program."""


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
