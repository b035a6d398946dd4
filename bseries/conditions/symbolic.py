"""Conditions as SymPy equations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from bseries.conditions.layout import named_blocks
from bseries.conditions.scalars import Scalars, left_sides

if TYPE_CHECKING:
    from bseries.conditions.program import Argument, Program, System


def symbol_name(argument: Argument, at: Sequence[int], stages: int) -> str:
    """The name of a coefficient: a_21, a__p_21 for the part p, a_10_1 where stages have two digits."""
    part = argument.parts[at[0]] if argument.is_stack else ""
    digits = [str(k + 1) for k in at[argument.is_stack :]]
    return f"{argument.symbol}{'__' if part else ''}{part}_{('_' if stages > 9 else '').join(digits)}"


def equations(system: System, stages: int, blocks: list[list[Any]] | None, *, nodes: bool) -> list[Any]:
    """The equations in given coefficients, or in symbols."""
    import sympy

    program = system.program

    def symbol(argument: Argument, at: tuple[int, ...]) -> Any:
        return sympy.Symbol(symbol_name(argument, at, stages))

    if blocks is None:
        blocks = named_blocks(program, system.structures, stages, symbol)
    else:
        blocks = [[sympy.sympify(entry, strict=True) for entry in block] for block in blocks]
    known, definitions = _nodes(program, Scalars(program, stages, blocks)) if nodes else ({}, [])
    left = left_sides(system, Scalars(program, stages, blocks, nodes=known))
    found = [
        sympy.Eq(sympy.sympify(a, strict=True), sympy.sympify(equation.right, strict=True), evaluate=False)
        for a, equation in zip(left, system.equations, strict=True)
    ]
    return found + definitions


def _nodes(program: Program, machine: Scalars) -> tuple[dict[int, tuple[Any, ...]], list[Any]]:
    """Symbols for the row sums of each stage matrix, and their definitions."""
    import sympy

    known, definitions = {}, []
    for k, operator in enumerate(program.operators):
        name = f"c__{operator.part}" if operator.part else "c"
        symbols = []
        for i, total in enumerate(machine.image(k, machine.one(), of_one=False), 1):
            if total == 0:  # a row without free entries, such as the first of an explicit method
                symbols.append(0)
                continue
            symbols.append(sympy.Symbol(f"{name}_{i}"))
            definitions.append(sympy.Eq(symbols[-1], total, evaluate=False))
        known[k] = tuple(symbols)
    return known, definitions
