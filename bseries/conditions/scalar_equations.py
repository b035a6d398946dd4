"""Order conditions in numbers and symbols: exact values, SymPy equations, scalar code."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bseries.conditions.layout import named_blocks

if TYPE_CHECKING:
    from bseries.conditions.condition_program import (
        CoefficientArray,
        ConditionProgram,
        Equation,
        EquationSystem,
        GradientTerm,
    )


Vector = tuple[Any, ...]


class ScalarInterpreter:
    """Interpreter on stage vectors that are tuples of numbers or expressions.

    Args:
        program: The program to be run.
        stages: The number of stages.
        blocks: The coefficients, block by block.
        keep: Maps every computed number to the one that replaces it, such as the name of a temporary.
        nodes: Known row sums, by operator.
    """

    def __init__(
        self,
        program: ConditionProgram,
        stages: int,
        blocks: Sequence[Sequence[Any]],
        keep: Callable[[Any], Any] = lambda value: value,
        nodes: Mapping[int, Vector] | None = None,
    ):
        self.stages = range(stages)
        self._blocks = blocks
        self._keep = keep
        self._nodes = nodes or {}
        self.matrices = [
            [[self._entry(op.blocks, op.relation, i, j) for j in self.stages] for i in self.stages]
            for op in program.operators
        ]

    def _entry(self, blocks: Sequence[int], relation: str, i: int, j: int) -> Any:
        if relation:
            return int(j < i or (relation == "≤" and j == i))
        return self._keep(_sum(self._blocks[block][i * len(self.stages) + j] for block in blocks))

    def one(self) -> Vector:
        """The vector (1, …, 1)."""
        return (1,) * len(self.stages)

    def vector(self, block: int) -> Vector:
        """A vector of coefficients."""
        return tuple(self._blocks[block])

    def product(self, x: Vector, y: Vector) -> Vector:
        """The product by components."""
        return tuple(self._keep(a * b) for a, b in zip(x, y, strict=True))

    def image(self, operator: int, x: Vector, *, of_one: bool) -> Vector:
        """A x."""
        if of_one and operator in self._nodes:
            return self._nodes[operator]
        return tuple(self._keep(dot(row, x)) for row in self.matrices[operator])

    def pullback(self, operator: int, x: Vector) -> Vector:
        """Aᵀ x."""
        return tuple(self._keep(dot(column, x)) for column in zip(*self.matrices[operator], strict=True))


def _sum(values: Any) -> Any:
    """A sum that skips zeros, to keep expressions small."""
    total: Any = 0
    for value in values:
        if not (isinstance(value, int) and value == 0):
            total = value if isinstance(total, int) and total == 0 else total + value
    return total


def dot(x: Sequence[Any], y: Sequence[Any]) -> Any:
    """Σ x_i y_i."""
    return _sum(a * b for a, b in zip(x, y, strict=True))


def left_sides(system: EquationSystem, interpreter: ScalarInterpreter) -> list[Any]:
    """The left-hand sides of all equations."""
    values = system.program.run(interpreter, system.size)
    return [left_side(equation, interpreter, values) for equation in system.equations]


def left_side(equation: Equation, interpreter: ScalarInterpreter, values: Sequence[Vector]) -> Any:
    """The left-hand side of one equation."""
    return _sum(
        summand.coefficient * dot(interpreter.vector(summand.block), values[summand.value])
        if summand.coefficient != 1
        else dot(interpreter.vector(summand.block), values[summand.value])
        for summand in equation.summands
    )


def gradient(
    program: ConditionProgram, terms: Sequence[GradientTerm], stages: int, values: Sequence[Vector]
) -> list[list[Any]]:
    """Derivatives by all entries of all blocks, each block flat."""
    derivatives: list[list[Any]] = [
        [0] * (stages * stages if block.argument.is_matrix else stages) for block in program.blocks
    ]
    for factor, block, x, y in terms:
        own = derivatives[block]
        for i, u in enumerate(values[x]):
            for at, v in [(i, 1)] if y < 0 else [(i * stages + j, v) for j, v in enumerate(values[y])]:
                term = u * v if factor == 1 else factor * u * v
                own[at] = _sum((own[at], term))
    return derivatives


def symbol_name(argument: CoefficientArray, at: Sequence[int], stages: int) -> str:
    """The name of a coefficient: a_21, a__p_21 for part p, a_10_1 for ten or more stages."""
    part = argument.parts[at[0]] if argument.is_stack else ""
    digits = [str(k + 1) for k in at[argument.is_stack :]]
    return f"{argument.symbol}{'__' if part else ''}{part}_{('_' if stages > 9 else '').join(digits)}"


def equations(system: EquationSystem, stages: int, blocks: list[list[Any]] | None, *, nodes: bool) -> list[Any]:
    """The equations in given coefficients, or in symbols."""
    import sympy

    program = system.program

    def symbol(argument: CoefficientArray, at: tuple[int, ...]) -> Any:
        return sympy.Symbol(symbol_name(argument, at, stages))

    if blocks is None:
        blocks = named_blocks(program, system.structures, stages, symbol)
    else:
        blocks = [[sympy.sympify(entry, strict=True) for entry in block] for block in blocks]
    known, definitions = _nodes(program, ScalarInterpreter(program, stages, blocks)) if nodes else ({}, [])
    left = left_sides(system, ScalarInterpreter(program, stages, blocks, nodes=known))
    found = [
        sympy.Eq(sympy.sympify(a, strict=True), sympy.sympify(equation.right, strict=True), evaluate=False)
        for a, equation in zip(left, system.equations, strict=True)
    ]
    return found + definitions


def _nodes(program: ConditionProgram, interpreter: ScalarInterpreter) -> tuple[dict[int, tuple[Any, ...]], list[Any]]:
    """Symbols for the row sums of each stage matrix, and their definitions."""
    import sympy

    known, definitions = {}, []
    for k, operator in enumerate(program.operators):
        name = f"c__{operator.part}" if operator.part else "c"
        symbols = []
        for i, total in enumerate(interpreter.image(k, interpreter.one(), of_one=False), 1):
            if total == 0:  # a row without free entries, such as the first of an explicit method
                symbols.append(0)
                continue
            symbols.append(sympy.Symbol(f"{name}_{i}"))
            definitions.append(sympy.Eq(symbols[-1], total, evaluate=False))
        known[k] = tuple(symbols)
    return known, definitions
