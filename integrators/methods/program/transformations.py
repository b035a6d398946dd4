"""Transformations of programs: scaling of the step, composition, adjoint, rounding to decimals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from integrators.exact.entries import multiply_entries, round_entry
from integrators.methods.program.evaluations import LinearForm
from integrators.methods.program.program import Average, Derivative, Field, Flow, Program

if TYPE_CHECKING:
    from integrators.exact.entries import Entry
    from integrators.methods.program.program import Evaluation


def scaled(program: Program, factor: Entry) -> tuple[tuple[Evaluation, ...], LinearForm]:
    """The evaluations and the end of a step of length factor · h.

    Every k = h f(·) is replaced by factor · k; the time of a flow is multiplied by the factor.
    """
    own = [Fraction(1) if isinstance(evaluation, Flow) else factor for evaluation in program.evaluations]

    def change(form: LinearForm) -> LinearForm:
        return LinearForm.of_entries(form.start, {e: multiply_entries(x, own[e]) for e, x in form.terms.items()})

    def lengthen(evaluation: Evaluation) -> Evaluation:
        if isinstance(evaluation, Flow):
            return evaluation._replace(time=multiply_entries(evaluation.time, factor))
        return evaluation

    return tuple(lengthen(mapped(evaluation, change)) for evaluation in program.evaluations), change(program.result)


def mapped(evaluation: Evaluation, function: Callable[[LinearForm], LinearForm]) -> Evaluation:
    """The evaluation with a function applied to every linear form."""
    match evaluation:
        case Field(part, at):
            return Field(part, function(at))
        case Derivative(part, at, along):
            return Derivative(part, function(at), function(along))
        case Flow(part, at, time, forcing):
            return Flow(part, function(at), time, tuple(map(function, forcing)))
        case Average(part, path, power):
            return Average(part, tuple(map(function, path)), power)


def appended(
    program: Program, factor: Entry, *, first: int, start: LinearForm, parts: Sequence[int]
) -> tuple[list[Evaluation], LinearForm]:
    """A step of length factor · h from `start`: its evaluations, numbered from `first`, and its end."""
    evaluations, end = scaled(program, factor)

    def renumber(form: LinearForm) -> LinearForm:
        return form.substituted(lambda e: LinearForm(0, {first + e: 1}), start)

    def place(evaluation: Evaluation) -> Evaluation:
        moved: Any = mapped(evaluation, renumber)
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
    """The program with floats as exact numbers, of which `digits` digits are correct."""

    def change(evaluation: Evaluation) -> Evaluation:
        changed = mapped(evaluation, exact)
        return changed._replace(time=Fraction(round_entry(changed.time))) if isinstance(changed, Flow) else changed

    def exact(form: LinearForm) -> LinearForm:
        return form.map(lambda x: Fraction(round_entry(x)))

    return program.changed(evaluations=map(change, program.evaluations), result=exact(program.result), digits=digits)
