"""Order conditions as NumPy source: one line for each stage vector, for any number of stages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from bseries.conditions.kinds import FULL

if TYPE_CHECKING:
    from bseries.conditions.condition_program import ConditionProgram, EquationSystem, EquationTerm, GradientTerm


class NumpyWriter:
    """Interpreter that writes a line for each operation; its values are names."""

    def __init__(self, program: ConditionProgram):
        self._program = program
        self.lines: list[str] = []
        self.operators = [
            program.blocks[op.blocks[0]].code() if len(op.blocks) == 1 else f"matrix{k}"
            for k, op in enumerate(program.operators)
        ]

    def _line(self, letter: str, value: str) -> str:
        name = f"{letter}{len(self.lines) + 1}"
        self.lines.append(f"{name} = {value}")
        return name

    def one(self) -> str:
        """The vector (1, …, 1)."""
        return "one"

    def vector(self, block: int) -> str:
        """A vector of coefficients."""
        return self._program.blocks[block].code()

    def product(self, x: str, y: str) -> str:
        """The product by components."""
        return self._line("g", f"{x} * {y}")

    def image(self, operator: int, x: str, *, of_one: bool) -> str:
        """A x."""
        return self._line("h", f"{self.operators[operator]} @ {x}")

    def pullback(self, operator: int, x: str) -> str:
        """Aᵀ x."""
        return self._line("v", f"{x} @ {self.operators[operator]}")


def numpy_source(system: EquationSystem, labels: Iterable[str], jacobian: bool) -> list[str]:
    """The lines of residual and Jacobian; a label for each equation goes into a comment."""
    lines = ["import numpy as np", "", "", *_residual(system, labels)]
    return [*lines, "", "", *_jacobian(system)] if jacobian else lines


def _header(system: EquationSystem, writer: NumpyWriter, name: str, what: str) -> list[str]:
    """First lines of a function: constant matrices, sums of matrices, and the stage vectors."""
    program = system.program
    lines = [f"def {name}({', '.join(system.arguments)}):", f'    """{what}"""']
    lines.append(f"    s = {program.arguments[0].name}.shape[-1]")
    lines.append("    one = np.ones(s)")
    for own, op in zip(writer.operators, program.operators, strict=True):
        if op.relation:
            lines.append(f"    {own} = np.tri(s, s, {0 if op.relation == '≤' else -1})")
        elif len(op.blocks) > 1:
            lines.append(f"    {own} = {' + '.join(program.blocks[k].code() for k in op.blocks)}")
    return lines + [f"    {line}" for line in writer.lines]


def _residual(system: EquationSystem, labels: Iterable[str]) -> list[str]:
    writer = NumpyWriter(system.program)
    values = system.program.run(writer, system.size)
    lines = _header(system, writer, "residual", "Left-hand sides minus right-hand sides.")
    lines.append("    return np.array([")
    for label, (summands, right) in zip(labels, system.equations, strict=True):
        total = " + ".join(_summand(system.program, summand, values) for summand in summands)
        lines.append(f"        {total} - {right},  # {label}")
    return [*lines, "    ])"]


def _summand(program: ConditionProgram, summand: EquationTerm, values: Sequence[str]) -> str:
    return _times(summand.coefficient, f"{program.blocks[summand.block].code()} @ {values[summand.value]}")


def _times(factor: Fraction, value: str) -> str:
    if factor == 1:
        return value
    return f"{factor} * {f'({value})' if ' @ ' in value else value}"


def _jacobian(system: EquationSystem) -> list[str]:
    gradients = system.gradients
    writer = NumpyWriter(system.program)
    values = system.program.run(writer)
    what = "Derivatives of the residual by the free coefficients, row by row."
    lines = _header(system, writer, "jacobian", what)
    count = len(system.equations)
    for block, (argument, part) in enumerate(system.program.blocks):
        sizes = "s, s" if argument.is_matrix else "s"
        lines.append(f"    d{block} = np.zeros(({count}, {sizes}))  # by {argument.name} {part}".rstrip())
    for k, terms in enumerate(gradients):
        by_block: dict[int, list[GradientTerm]] = {}
        for term in terms:
            by_block.setdefault(term.block, []).append(term)
        for block, own in sorted(by_block.items()):
            lines.append(f"    d{block}[{k}] = {' + '.join(_derivative(term, values) for term in own)}")
    rows = ", ".join(f"d{block}.reshape({count}, -1)" for block in range(len(system.program.blocks)))
    lines.append(f"    J = np.concatenate([{rows}], axis=1)")
    return [*lines, *_selection(system)]


def _derivative(term: GradientTerm, values: Sequence[str]) -> str:
    own = values[term.x] if term.y < 0 else f"np.outer({values[term.x]}, {values[term.y]})"
    return _times(term.factor, own)


def _selection(system: EquationSystem) -> list[str]:
    """Lines that select the columns of free coefficients."""
    structures = system.structures
    if all(structure == FULL for structure in structures):
        return ["    return J"]
    masks = []
    own = iter(structures)
    for argument, _ in system.program.blocks:
        offset = {"explicit": -1, "diagonally-implicit": 0}.get(next(own)) if argument.is_matrix else None
        shape = "s * s" if argument.is_matrix else "s"
        masks.append(f"np.ones({shape})" if offset is None else f"np.tri(s, s, {offset}).ravel()")
    return [f"    free = np.flatnonzero(np.concatenate(({', '.join(masks)},)))", "    return J[:, free]"]
