"""Order conditions as numba source: a table of operations, and loops that execute it.

The loops compile in a few seconds for any number of conditions; as straight-line code, 17 conditions take half a
minute.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bseries.conditions.kinds import DIAGONALLY_IMPLICIT, EXPLICIT

if TYPE_CHECKING:
    from bseries.conditions.condition_program import EquationSystem

LOOPS = '''

@njit
def run(count, matrices, vectors):
    """The stage vectors that the first operations (kind, x, y) give."""
    s = vectors.shape[1]
    v = np.zeros((count, s))
    for k in range(count):
        kind, x, y = OPERATIONS[k, 0], OPERATIONS[k, 1], OPERATIONS[k, 2]
        for i in range(s):
            if kind == 0:
                v[k, i] = 1.0
            elif kind == 1:
                v[k, i] = vectors[x, i]
            elif kind == 2:
                v[k, i] = v[x, i] * v[y, i]
            elif kind == 3:
                for j in range(s):
                    v[k, i] += matrices[x, i, j] * v[y, j]
            else:
                for j in range(s):
                    v[k, j] += matrices[x, i, j] * v[y, i]
    return v
'''

RESIDUAL = """    v = run(FORWARD, matrices, vectors)
    r = -RIGHT
    for term in range(len(SUMS)):
        k, block, y = SUMS[term, 0], SUMS[term, 1], SUMS[term, 2]
        for i in range(s):
            r[k] += SUM_FACTORS[term] * vectors[block, i] * v[y, i]
    return r"""

JACOBIAN = """    v = run(len(OPERATIONS), matrices, vectors)
    for term in range(len(SLOPES)):
        k, block, x, y = SLOPES[term, 0], SLOPES[term, 1], SLOPES[term, 2], SLOPES[term, 3]
        for i in range(s):
            slope = SLOPE_FACTORS[term] * v[x, i]
            if y < 0:
                J[k, first[block] + i] += slope
            else:
                for j in range(s):
                    J[k, first[block] + i * s + j] += slope * v[y, j]"""


def numba_source(system: EquationSystem, jacobian: bool) -> list[str]:
    """The lines of residual and Jacobian."""
    terms = [(k, term) for k, equation in enumerate(system.equations) for term in equation.summands]
    slopes = [(k, slope) for k, row in enumerate(system.gradients if jacobian else []) for slope in row]
    lines = ["import numpy as np", "from numba import njit", ""]
    lines += ["# (kind, x, y): (1, …, 1); a vector; v[x] v[y]; the matrix x times v[y]; its transpose times v[y]"]
    lines += _table("OPERATIONS", [f"({kind}, {x}, {y})" for kind, x, y in system.program.operations])
    lines += [f"FORWARD = {system.size}", "# Σ factor · vector · v[y] for condition k: (k, vector, y)"]
    lines += _table("SUMS", [f"({k}, {term.block}, {term.value})" for k, term in terms])
    lines += _table("SUM_FACTORS", [_float(str(term.coefficient)) for _, term in terms])
    lines += _table("RIGHT", [_float(str(equation.right)) for equation in system.equations])
    if jacobian:
        lines += [
            "# derivatives of condition k by an argument: factor · v[x] v[y]', or v[x] if y < 0: (k, argument, x, y)"
        ]
        lines += _table("SLOPES", [f"({k}, {slope.block}, {slope.x}, {slope.y})" for k, slope in slopes])
        lines += _table("SLOPE_FACTORS", [_float(str(slope.factor)) for _, slope in slopes])
    lines += LOOPS.split("\n")
    lines += ["", *_header(system, "residual", "Left-hand sides minus right-hand sides."), *RESIDUAL.split("\n")]
    return [*lines, "", "", *_jacobian(system)] if jacobian else lines


def _table(name: str, rows: Sequence[str]) -> list[str]:
    """An array, several rows to a line."""
    return [f"{name} = np.array([", *(f"    {', '.join(rows[k : k + 8])}," for k in range(0, len(rows), 8)), "])"]


def _float(number: str) -> str:
    return number if "/" in number else f"{number}.0"


def _header(system: EquationSystem, name: str, what: str) -> list[str]:
    """First lines of a function, with all matrices and vectors in two arrays."""
    program = system.program
    lines = ["@njit", f"def {name}({', '.join(system.arguments)}):", f'    """{what}"""']
    lines.append(f"    s = {program.arguments[0].name}.shape[-1]")
    lines.append(f"    matrices = np.zeros(({len(program.operators)}, s, s))")
    lines.append(f"    vectors = np.zeros(({len(program.blocks)}, s))")
    lines.append("    for i in range(s):")
    for k, block in enumerate(program.blocks):
        if not block.argument.is_matrix:
            lines.append(f"        vectors[{k}, i] = {block.code('i')}")
    lines.append("        for j in range(s):")
    relations = {"<": "j < i", "≤": "j <= i"}
    for k, op in enumerate(program.operators):
        value = relations.get(op.relation) or " + ".join(program.blocks[k].code("i, j") for k in op.blocks)
        lines.append(f"            matrices[{k}, i, j] = {value}")
    return lines


def _jacobian(system: EquationSystem) -> list[str]:
    what = "Derivatives of the residual by the free coefficients, row by row."
    sizes = ["s * s" if argument.is_matrix else "s" for argument, _ in system.program.blocks]
    lines = _header(system, "jacobian", what)
    lines.append(f"    first = np.cumsum(np.array([0, {', '.join(sizes)}]))")
    lines.append(f"    J = np.zeros(({len(system.equations)}, first[-1]))")
    return [*lines, *JACOBIAN.split("\n"), *_selection(system)]


def _selection(system: EquationSystem) -> list[str]:
    """Lines that move the columns of free coefficients to the front and return them."""
    lines = ["    free = 0"]
    structures = iter(system.structures)
    for block, (argument, _) in enumerate(system.program.blocks):
        lines.append("    for i in range(s):")
        source, indent = f"first[{block}] + i", " " * 8
        if argument.is_matrix:
            stop = {EXPLICIT: "i", DIAGONALLY_IMPLICIT: "i + 1"}.get(next(structures), "s")
            lines.append(f"        for j in range({stop}):")
            source, indent = f"first[{block}] + i * s + j", " " * 12
        lines += [
            f"{indent}for k in range(len(J)):",
            f"{indent}    J[k, free] = J[k, {source}]",
            f"{indent}free += 1",
        ]
    return [*lines, "    return J[:, :free]"]
