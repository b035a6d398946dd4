"""What goes from one step to the next besides the state, and the beginning and end of runs whose steps are shifted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING

from .forms import FormWriter
from .nodes import Form, Key

if TYPE_CHECKING:
    from .plan import Plan
    from .structure import Structure


def kick_lines(plan: Plan, forms: FormWriter) -> list[str]:
    """Statements that begin a run whose steps begin after their first kick."""
    starts = (forms.update(cell, Form(Fraction(1), kicks)) for cell, kicks in plan.staggered.items())
    return [line for lines in starts for line in lines]


def end_lines(plan: Plan, forms: FormWriter) -> list[str]:
    """Statements for the state that others see: that before the first kick of the next step."""
    lines: list[str] = []
    for cell, kicks in plan.staggered.items():
        lines += forms.loop(cell, [f"source[i] = y[i] - h*({forms.sum(cell, kicks)})"])
    return lines


def carrying_lines(plan: Plan, forms: FormWriter, registers: Mapping[int, int]) -> list[str]:
    """Statements that hand slopes at the end of a step to the next one, where they are not in place already."""
    lines: list[str] = []
    for (start, cell), (end, _) in plan.carried.items():
        if registers[start] != registers[end]:
            lines += forms.loop(cell, [f"k{start}[i] = k{end}[i]"])
    return lines


def memory_lines(plan: Plan, structure: Structure, unknowns: Iterable[Key]) -> tuple[list[str], list[str], int]:
    """Statements that load and store what is kept from step to step, and its size.

    Args:
        plan: The plan.
        structure: The cells.
        unknowns: Slopes from which the next step's are guessed.
    """
    kept = [(f"k{e}", cell) for e, cell in (*plan.carried, *unknowns)] + [("y", cell) for cell in plan.staggered]
    load: list[str] = []
    store: list[str] = []
    size = 0
    for name, cell in kept:
        for a, b in structure.cells[cell]:
            index = f"m[i + {size - a}]" if size >= a else f"m[i - {a - size}]"
            load += [f"for i in range({a}, {b}):", f"    {name}[i] = {index}"]
            store += [f"for i in range({a}, {b}):", f"    {index} = {name}[i]"]
            size += b - a
    return load, store, size
