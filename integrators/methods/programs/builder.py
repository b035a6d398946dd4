"""Builder of programs, and the base class of the kinds of methods with the readers of their coefficients."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any, TypedDict

from bseries_base.child_bounds import ChildBounds
from bseries_base.errors import shorten, shown
from integrators.core.arguments import check_digits, check_partition_names, items, read_labels, read_whole
from integrators.core.errors import IntegratorError
from integrators.exact.entries import EntryRow, Matrix, read_entry
from integrators.methods.programs.evaluations import (
    Average,
    Derivative,
    Evaluation,
    Field,
    Flow,
    LinearForm,
    check_form,
)
from integrators.methods.programs.program import MAX_STAGES, Method, Program


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

        >>> import bseries as bs
        >>> builder = bs.ProgramBuilder()
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
        self, at: LinearForm, part: str | None = None, *, time: object = 1, forcing: Iterable[LinearForm] = (),
        into: LinearForm | None = None,
    ) -> LinearForm:  # fmt: skip
        """The increment of the exact flow over time · h, with a polynomial forcing in θ (see `Flow`)."""
        forms = tuple(self._form(form, "forcing", start=0) for form in forcing)
        points = self._form(at, "at", start=1), read_entry(time, "time"), forms
        return self._record(Flow(self._part(part), *points), into)

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
        self, result: LinearForm, *, name: str | None = None, reference: str | None = None, digits: int | None = None,
        max_children: object = None,
    ) -> Program:  # fmt: skip
        """The method with a given end of the step.

        Args:
            name, reference: the name of the method in messages, and its publication.
            digits: for coefficients published as decimals, the number of correct significant digits.
            max_children: for a method for fields of a special form, bounds on the children of nodes in trees whose
                differentials do not vanish: one number, or for each part a row of bounds on its derivatives with
                respect to each part and optionally, as a last entry, in all; None means unbounded. The series of the
                method then contains no other trees.

        Raises:
            IntegratorError: an evaluation is not defined, `result` is not a point, or another argument is invalid.

        Example:
            Lawson's Euler method for y' = L y + N(y), L linear:

            >>> import bseries as bs
            >>> builder = bs.ProgramBuilder(["L", "N"])
            >>> at = builder.y + builder.field(builder.y, "N")
            >>> builder.program(at + builder.flow(at, "L"), name="lawson", max_children=[[1, 1, 1], [None, None]])
            <Program lawson: 2 evaluations, max_children=((1, 1, 1), (None, None))>
        """
        evaluations = []
        for e, evaluation in enumerate(self._evaluations, 1):
            if evaluation is None:
                raise IntegratorError(f"evaluations must all be defined, but k{e} is not")
            evaluations.append(evaluation)
        return Program(
            evaluations, self._form(result, "result", start=1), parts=self._parts, auxiliary=self._auxiliary,
            name=name, reference=reference, digits=digits, max_children=max_children,
        )  # fmt: skip

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


SECOND_ORDER: ChildBounds = (0, None), (1, 0)
"""The degree of each part in p and in q for q'' = g(q): g depends on q, and q' = M⁻¹ p is linear in p."""


class Labels(TypedDict, total=False):
    """What every kind of method takes by name."""

    parameters: Iterable[str]
    name: str | None
    reference: str | None
    digits: int | None


class ProgramMethod(Method):
    """A method given by the coefficients of its kind, of which the first has one entry for each stage.

    A kind sets its coefficients by `_set` and records the evaluations of a step in `_lower`.
    """

    def _set(
        self, coefficients: dict[str, object], *, parts: Sequence[str] = (), parameters: Iterable[str] = (),
        name: str | None = None, reference: str | None = None, digits: int | None = None,
    ) -> None:  # fmt: skip
        labels = read_labels(name, reference)
        check_digits(digits)
        data = tuple(coefficients.values())
        self.__dict__.update(coefficients, names=tuple(parts) or ("",), digits=digits, **labels, _coefficients=data)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        """Record the evaluations of a step and return its end."""
        raise NotImplementedError

    @property
    def _data(self) -> tuple[object, ...]:
        return self.names, self.digits, *self.__dict__["_coefficients"]

    @property
    def stages(self) -> int:
        """The number of stages."""
        return len(self.__dict__["_coefficients"][0])

    _auxiliary: tuple[str, ...] = ()
    max_children: ChildBounds | None = None  # type: ignore[assignment]  # not from the program, which reads it here

    @cached_property
    def program(self) -> Program:
        """The step as a program."""
        builder = ProgramBuilder(self.names if self.names != ("",) else (), auxiliary=self._auxiliary)
        return builder.program(self._lower(builder), **self.labels, max_children=self.max_children)

    def __str__(self) -> str:
        return str(self.program)

    def __repr__(self) -> str:
        parts = ", ".join(filter(None, self.names))
        stages = f"{self.stages} stage{'s' * (self.stages != 1)}"
        return f"<{type(self).__name__} {self.name}: {', '.join(filter(None, (parts, stages)))}>"


def read_parts(parts: object, *, count: int | None = None) -> tuple[str, ...]:
    """The names of the parts of a field, checked: `count` different names, or two or more if None."""
    if isinstance(parts, str) or not isinstance(parts, Sequence):
        raise IntegratorError(f"parts must be a sequence of names, but was {shown(parts)}")
    if len(parts) != count if count is not None else len(parts) < 2:
        raise IntegratorError(f"parts must be {count or 'two or more'} names, but were {len(parts)}")
    check_partition_names(parts)
    return tuple(parts)


def in_color_order(names: Iterable[str]) -> tuple[str, ...]:
    """Names of parts in the order of their colours: p before q, other names in the given order."""
    given = tuple(names)
    return ("p", "q") if set(given) == {"p", "q"} else given


def read_row(values: object, argument: str, names: Iterable[str] = (), *, count: int | None = None) -> EntryRow:
    """A row of entries in the symbols `names`: `count` entries, or one or more if None."""
    row = items(values, argument)
    if count is not None and len(row) != count:
        raise IntegratorError(f"{argument} must have {entry_count(count)}, but has {len(row)}")
    if not 1 <= len(row) <= MAX_STAGES:
        raise IntegratorError(f"{argument} must have from 1 to {MAX_STAGES} entries, but has {len(row)}")
    return tuple(read_entry(value, f"{argument}[{j}]", names) for j, value in enumerate(row, 1))


def read_matrix(values: object, argument: str, names: Iterable[str] = (), *, rows: int, columns: int) -> Matrix:
    """A matrix of entries, by rows, each read by `read_row`."""
    found = items(values, argument)
    if len(found) != rows:
        raise IntegratorError(f"{argument} must have {rows} row{'s' * (rows > 1)}, but has {len(found)}")
    return tuple(read_row(row, f"{argument}[{i}]", names, count=columns) for i, row in enumerate(found, 1))


def read_stages(rows: Mapping[str, object], matrices: Mapping[str, object], labels: Labels) -> dict[str, Any]:
    """Rows of one length and square matrices of this size, in the symbols among the labels; a matrix may be None."""
    symbols, stages = tuple(labels.get("parameters", ())), None
    read: dict[str, Any] = {}
    for key, row in rows.items():
        read[key] = read_row(row, key, symbols, count=stages)
        stages = len(read[key])
    for key, A in matrices.items():
        read[key] = None if A is None else read_matrix(A, key, symbols, rows=stages or 0, columns=stages or 0)
    return read


def entry_count(count: int) -> str:
    """A number of entries, for messages."""
    return f"{count} {'entry' if count == 1 else 'entries'}"
