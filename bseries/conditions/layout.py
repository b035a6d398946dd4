"""Storage order of the coefficients of a method: by argument, part, and row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import Decimal
from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.conditions.kinds import DIAGONALLY_IMPLICIT, FULL
from bseries.exceptions import SeriesError
from trees.counting import check_order

if TYPE_CHECKING:
    from bseries.conditions.condition_program import CoefficientArray, ConditionProgram


MOST_STAGES = 1000


class CoefficientEntry(NamedTuple):
    """One coefficient: its argument and index (from 0), its block and place in it, and whether it is free."""

    argument: CoefficientArray
    at: tuple[int, ...]
    block: int
    place: int
    is_free: bool


def layout(program: ConditionProgram, structures: Sequence[str], stages: int) -> list[CoefficientEntry]:
    """All entries of all arguments; those excluded by the structure of their matrix are not free."""
    found = []
    structure = iter(structures)
    for block, (argument, part) in enumerate(program.blocks):
        stack = (argument.parts.index(part),) if argument.is_stack else ()
        own = next(structure) if argument.is_matrix else FULL
        for place, at in enumerate(product(range(stages), repeat=1 + argument.is_matrix)):
            found.append(CoefficientEntry(argument, (*stack, *at), block, place, own == FULL or _is_inside(own, *at)))
    return found


def _is_inside(structure: str, row: int, column: int) -> bool:
    """Whether a triangular structure allows an entry."""
    return column < row or (structure == DIAGONALLY_IMPLICIT and column == row)


def named_blocks(
    program: ConditionProgram,
    structures: Sequence[str],
    stages: int,
    name: Callable[[CoefficientArray, tuple[int, ...]], Any],
) -> list[list[Any]]:
    """The entries of every block as symbols; 0 where not free."""
    blocks: list[list[Any]] = [[] for _ in program.blocks]
    for entry in layout(program, structures, stages):
        blocks[entry.block].append(name(entry.argument, entry.at) if entry.is_free else 0)
    return blocks


def check_stages(stages: object) -> int:
    """Check a number of stages."""
    count = check_order(stages, "stages")
    if count > MOST_STAGES:
        raise SeriesError(f"stages must be {MOST_STAGES} or less, but was {count}")
    return count


def known_stages(stages: int | None) -> int:
    """Check a number of stages that must be given."""
    if stages is None:
        raise SeriesError("stages must be given to write the equations out, but was not")
    return check_stages(stages)


def read_arrays(program: ConditionProgram, arrays: Sequence[Any], stages: int | None) -> tuple[int, list[list[Any]]]:
    """Read arrays of coefficients: the number of stages, and the entries of each block.

    Raises:
        SeriesError: The number of arrays or a shape is wrong.
    """
    names = [argument.name for argument in program.arguments]
    if len(arrays) != len(names):
        raise SeriesError(f"arguments must be {', '.join(names)}, but were {len(arrays)}")
    arrays = [array.tolist() if hasattr(array, "tolist") else array for array in arrays]
    shapes = [_shape(array, name) for array, name in zip(arrays, names, strict=True)]
    if not shapes[0]:
        raise SeriesError(f"{names[0]} must be an array, but was {arrays[0]!r:.60}")
    stages = shapes[0][-1] if stages is None else stages
    blocks = []
    for argument, array, shape in zip(program.arguments, arrays, shapes, strict=True):
        expected = argument.shape(stages)
        if shape != expected:
            raise SeriesError(f"{argument.name} must be {_size(expected)}, but was {_size(shape)}")
        flat = [_number(entry, argument.name) for entry in _flattened(array, len(shape))]
        size = len(flat) // len(argument.parts)
        blocks += [flat[k : k + size] for k in range(0, len(flat), size)]
    return stages, blocks


def _flattened(array: Any, depth: int) -> list[Any]:
    """The entries of nested sequences."""
    return [array] if depth == 0 else [entry for row in array for entry in _flattened(row, depth - 1)]


def _number(entry: Any, name: str) -> Any:
    """Check a number or expression; decimals become fractions, which mix with other numbers."""
    if isinstance(entry, Decimal) and entry.is_finite():
        return Fraction(entry)
    if not hasattr(entry, "__mul__"):
        raise SeriesError(f"{name} must hold numbers or expressions, but had {entry!r:.60}")
    return entry


def _shape(array: Any, name: str) -> tuple[int, ...]:
    """The shape of nested sequences of numbers."""
    if isinstance(array, str | bytes | dict | set):
        raise SeriesError(f"{name} must hold numbers in lists, tuples or arrays, but had {array!r:.60}")
    if not hasattr(array, "__len__"):
        return ()
    shapes = {_shape(row, name) for row in array}
    if len(shapes) != 1:
        raise SeriesError(f"{name} must have rows of one length, one at least, but was {array!r:.60}")
    return (len(array), *shapes.pop())


def _size(shape: Sequence[int]) -> str:
    sizes = " × ".join(map(str, shape))
    return f"{sizes} numbers" if shape else "one number"
