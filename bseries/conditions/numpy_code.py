"""Order conditions as NumPy source: one line for each stage vector, whatever the number of stages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from bseries.conditions.kinds import FULL

if TYPE_CHECKING:
    from bseries.conditions.program import Program, Slope, Summand, System


def _block_name(program: Program, block: int) -> str:
    """A block as a part of an argument."""
    argument, part = program.blocks[block]
    return f"{argument.name}[{argument.parts.index(part)}]" if argument.is_stack else argument.name


class Writer:
    """A machine whose values are names, and which writes a line for each operation."""

    def __init__(self, program: Program):
        self._program = program
        self.lines: list[str] = []
        self.operators = [
            _block_name(program, op.blocks[0]) if len(op.blocks) == 1 else f"matrix{k}"
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
        return _block_name(self._program, block)

    def product(self, x: str, y: str) -> str:
        """The product by components."""
        return self._line("g", f"{x} * {y}")

    def image(self, operator: int, x: str, *, of_one: bool) -> str:
        """A x."""
        return self._line("h", f"{self.operators[operator]} @ {x}")

    def pullback(self, operator: int, x: str) -> str:
        """Aᵀ x."""
        return self._line("v", f"{x} @ {self.operators[operator]}")


def numpy_source(system: System, labels: Iterable[str], jacobian: bool) -> list[str]:
    """The lines of residual and Jacobian; a label for each equation goes into a comment."""
    lines = ["import numpy as np", "", "", *_residual(system, labels)]
    return [*lines, "", "", *_jacobian(system)] if jacobian else lines


def _header(system: System, writer: Writer, name: str, what: str) -> list[str]:
    """The beginning of a function: constant matrices, sums of matrices, and the stage vectors."""
    program = system.program
    lines = [f"def {name}({', '.join(system.arguments)}):", f'    """{what}"""']
    lines.append(f"    s = {program.arguments[0].name}.shape[-1]")
    lines.append("    one = np.ones(s)")
    for own, op in zip(writer.operators, program.operators, strict=True):
        if op.relation:
            lines.append(f"    {own} = np.tri(s, s, {0 if op.relation == '≤' else -1})")
        elif len(op.blocks) > 1:
            lines.append(f"    {own} = {' + '.join(_block_name(program, block) for block in op.blocks)}")
    return lines + [f"    {line}" for line in writer.lines]


def _residual(system: System, labels: Iterable[str]) -> list[str]:
    writer = Writer(system.program)
    values = system.program.run(writer, system.size)
    lines = _header(system, writer, "residual", "Left-hand sides minus right-hand sides.")
    lines.append("    return np.array([")
    for label, (summands, right) in zip(labels, system.equations, strict=True):
        total = " + ".join(_summand(system.program, summand, values) for summand in summands)
        lines.append(f"        {total} - {right},  # {label}")
    return [*lines, "    ])"]


def _summand(program: Program, summand: Summand, values: Sequence[str]) -> str:
    return _times(summand.coefficient, f"{_block_name(program, summand.block)} @ {values[summand.value]}")


def _times(factor: Fraction, value: str) -> str:
    if factor == 1:
        return value
    return f"{factor} * {f'({value})' if ' @ ' in value else value}"


def _jacobian(system: System) -> list[str]:
    gradients = system.gradients
    writer = Writer(system.program)
    values = system.program.run(writer)
    what = "Derivatives of the residual by the free coefficients, row by row."
    lines = _header(system, writer, "jacobian", what)
    count = len(system.equations)
    for block, (argument, part) in enumerate(system.program.blocks):
        sizes = "s, s" if argument.is_matrix else "s"
        lines.append(f"    d{block} = np.zeros(({count}, {sizes}))  # by {argument.name} {part}".rstrip())
    for k, slopes in enumerate(gradients):
        by_block: dict[int, list[Slope]] = {}
        for slope in slopes:
            by_block.setdefault(slope.block, []).append(slope)
        for block, own in sorted(by_block.items()):
            lines.append(f"    d{block}[{k}] = {' + '.join(_slope(slope, values) for slope in own)}")
    rows = ", ".join(f"d{block}.reshape({count}, -1)" for block in range(len(system.program.blocks)))
    lines.append(f"    J = np.concatenate([{rows}], axis=1)")
    return [*lines, *_selection(system)]


def _slope(slope: Slope, values: Sequence[str]) -> str:
    own = values[slope.x] if slope.y < 0 else f"np.outer({values[slope.x]}, {values[slope.y]})"
    return _times(slope.factor, own)


def _selection(system: System) -> list[str]:
    """The lines that keep the columns of free coefficients."""
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
