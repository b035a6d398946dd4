"""Order conditions in exact numbers and symbols: their arrays of coefficients, left-hand sides, and SymPy equations.

Numbers and expressions are entries of NumPy arrays of objects, so that products of matrices and vectors are NumPy's and
every sum and product is one of the entries'.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import reduce
from operator import add
from typing import Any

from bseries.conditions.condition_program import (
    BANDS,
    ONE,
    PRODUCT,
    VECTOR,
    CoefficientBlock,
    ConditionProgram,
    Equation,
)
from bseries.exceptions import SeriesError
from trees.counting import check_order

Blocks = Sequence[Any]

MOST_STAGES = 1000


def check_stages(stages: object) -> int:
    """Check a number of stages."""
    if stages is None:
        raise SeriesError("stages must be given to write the equations out, but was not")
    count = check_order(stages, "stages")
    if count > MOST_STAGES:
        raise SeriesError(f"stages must be {MOST_STAGES} or less, but was {count}")
    return count


def read_arrays(
    program: ConditionProgram, arrays: Sequence[Any], stages: int | None, read: Callable[[Any, str], Any] | None = None
) -> list[Any]:
    """Read arrays of coefficients, by default of exact numbers, for a number of stages or that of the first array."""
    if len(arrays) != len(program.arguments):
        names = ", ".join(argument.name for argument in program.arguments)
        raise SeriesError(f"arguments must be {names}, but were {len(arrays)}")
    found: list[Any] = []
    for argument, given in zip(program.arguments, arrays, strict=True):
        found.append((read or _read_exact)(given, argument.name))
        shape = argument.shape(found[0].shape[-1] if stages is None else stages)
        if found[-1].shape != shape:
            raise SeriesError(f"{argument.name} must have the shape {shape}, but had {found[-1].shape}")
    return found


def read_blocks(program: ConditionProgram, arrays: Sequence[Any], stages: int | None) -> Blocks:
    """Read arrays of exact coefficients, as an array for each block."""
    read = zip(program.arguments, read_arrays(program, arrays, stages), strict=True)
    return [block for argument, array in read for block in (array if argument.is_stack else [array])]


def _read_exact(values: Any, name: str) -> Any:
    """An array of numbers or expressions; decimals become fractions, which mix with other numbers."""
    import numpy as np

    try:
        array = np.array(values, object)
    except ValueError:  # arrays of different shapes
        array = np.array([])
    if array.ndim == 0 and not isinstance(values, str | bytes | dict | set):
        raise SeriesError(f"{name} must be an array, but was {values!r:.60}")
    if not array.size or any(isinstance(entry, list | tuple) for entry in array.flat):
        raise SeriesError(f"{name} must have rows of one length, one at least, but was {values!r:.60}")
    for entry in array.flat:
        if isinstance(entry, str | bytes | dict | set):
            raise SeriesError(f"{name} must hold numbers in lists, tuples or arrays, but had {entry!r:.60}")
        if not hasattr(entry, "__mul__"):
            raise SeriesError(f"{name} must hold numbers or expressions, but had {entry!r:.60}")
    fractions = np.frompyfunc(lambda x: Fraction(x) if isinstance(x, Decimal) and x.is_finite() else x, 1, 1)
    return fractions(array)


def named_blocks(
    program: ConditionProgram, stages: int, name: Callable[[CoefficientBlock, tuple[int, ...]], Any]
) -> Blocks:
    """The entries of every block by their names; 0 where the structure excludes them."""
    import numpy as np

    blocks = [np.zeros(block.argument.part_shape(stages), object) for block in program.blocks]
    for k, at in program.free_entries(stages):
        blocks[k][at] = name(program.blocks[k], at)
    return blocks


def symbols(program: ConditionProgram, stages: int) -> Blocks:
    """The coefficients as symbols: a_21, a__p_21 for part p, a_10_1 for ten or more stages."""
    import sympy

    def symbol(block: CoefficientBlock, at: Sequence[int]) -> sympy.Symbol:
        name = block.argument.name.lower() + (f"__{block.part}" if block.part else "")
        return sympy.Symbol(f"{name}_{('_' if stages > 9 else '').join(str(k + 1) for k in at)}")

    return named_blocks(program, stages, symbol)


def stage_matrices(program: ConditionProgram, blocks: Blocks) -> list[Any]:
    """The stage matrices: sums of blocks, or triangular matrices of ones."""
    import numpy as np

    stages = blocks[0].shape[-1]
    return [
        np.tri(stages, k=BANDS[op.relation] - 1, dtype=int).astype(blocks[0].dtype)
        if op.relation
        else reduce(add, [blocks[k] for k in op.blocks])
        for op in program.operators
    ]


def left_sides(program: ConditionProgram, blocks: Blocks, row_sums: Mapping[int, Any] | None = None) -> list[Any]:
    """The left-hand sides of all equations; row sums of stage matrices may be given as symbols."""
    import numpy as np

    matrices, values = stage_matrices(program, blocks), []
    for kind, x, y in program.operations[: program.size]:
        if kind == ONE:
            values.append(np.ones(blocks[0].shape[-1], int).astype(object))
        elif kind == VECTOR:
            values.append(blocks[x])
        elif kind == PRODUCT:
            values.append(values[x] * values[y])
        else:
            values.append(row_sums[x] if y == ONE and row_sums else matrices[x] @ values[y])

    def left_side(equation: Equation) -> Any:
        products = [(factor, blocks[block] @ values[value]) for factor, block, value in equation.summands]
        return sum(product if factor == 1 else factor * product for factor, product in products)

    return [left_side(equation) for equation in program.equations]


def equations(program: ConditionProgram, blocks: Blocks, *, nodes: bool) -> list[Any]:
    """The equations in given coefficients; with `nodes`, row sums are symbols, which more equations define."""
    import numpy as np
    import sympy

    exact = np.frompyfunc(lambda entry: sympy.sympify(entry, strict=True), 1, 1)
    blocks = [exact(block) for block in blocks]
    known, definitions = _nodes(program, blocks) if nodes else ({}, [])
    found = [
        sympy.Eq(sympy.sympify(left, strict=True), sympy.sympify(equation.right, strict=True), evaluate=False)
        for left, equation in zip(left_sides(program, blocks, known), program.equations, strict=True)
    ]
    return found + definitions


def _nodes(program: ConditionProgram, blocks: Blocks) -> tuple[dict[int, Any], list[Any]]:
    """Symbols for the row sums of each stage matrix, and their definitions."""
    import sympy

    known, definitions = {}, []
    for k, (operator, matrix) in enumerate(zip(program.operators, stage_matrices(program, blocks), strict=True)):
        name = f"c__{operator.part}" if operator.part else "c"
        known[k] = totals = matrix.sum(axis=1)
        for i, total in enumerate(totals):
            if total != 0:  # zero for a row without free entries, such as the first of an explicit method
                totals[i] = sympy.Symbol(f"{name}_{i + 1}")
                definitions.append(sympy.Eq(totals[i], total, evaluate=False))
    return known, definitions
