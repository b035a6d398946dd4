"""A program as formulas, one line for each evaluation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from .entries import round_entry
from .expressions import format_number
from .program import Average, Derivative, Field, Flow

if TYPE_CHECKING:
    from .entries import Entry
    from .program import Evaluation, Program

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
