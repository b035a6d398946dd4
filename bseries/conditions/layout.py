"""Where the coefficients of a method lie: argument by argument, part by part, row by row."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.conditions.kinds import DIAGONALLY_IMPLICIT, FULL
from bseries.exceptions import SeriesError
from trees.counting import check_order

if TYPE_CHECKING:
    from bseries.conditions.program import Argument, Program


MOST_STAGES = 1000


class Entry(NamedTuple):
    """One coefficient: its argument and index there (from 0), its block and place there, and whether it is free."""

    argument: Argument
    at: tuple[int, ...]
    block: int
    place: int
    is_free: bool


def layout(program: Program, structures: Sequence[str], stages: int) -> list[Entry]:
    """All entries of all arguments; those that the structure of their matrix rules out are not free."""
    found = []
    structure = iter(structures)
    for block, (argument, part) in enumerate(program.blocks):
        stack = (argument.parts.index(part),) if argument.is_stack else ()
        own = next(structure) if argument.is_matrix else FULL
        for place, at in enumerate(_indices((stages,) * (1 + argument.is_matrix))):
            found.append(Entry(argument, (*stack, *at), block, place, own == FULL or _is_inside(own, *at)))
    return found


def _is_inside(structure: str, row: int, column: int) -> bool:
    """Whether a triangular matrix may have an entry here."""
    return column < row or (structure == DIAGONALLY_IMPLICIT and column == row)


def _indices(shape: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """All indices into an array, row by row."""
    if not shape:
        yield ()
        return
    for first in range(shape[0]):
        for rest in _indices(shape[1:]):
            yield (first, *rest)


def named_blocks(
    program: Program, structures: Sequence[str], stages: int, name: Callable[[Argument, tuple[int, ...]], Any]
) -> list[list[Any]]:
    """The entries of every block as symbols; 0 where they are not free."""
    blocks: list[list[Any]] = [[] for _ in program.blocks]
    for entry in layout(program, structures, stages):
        blocks[entry.block].append(name(entry.argument, entry.at) if entry.is_free else 0)
    return blocks


def check_stages(stages: object) -> int:
    """A number of stages that arrays can have."""
    count = check_order(stages, "stages")
    if count > MOST_STAGES:
        raise SeriesError(f"stages must be {MOST_STAGES} or less, but was {count}")
    return count


def known_stages(stages: int | None) -> int:
    """The number of stages where it must be known."""
    if stages is None:
        raise SeriesError("stages must be given to write the equations out, but was not")
    return check_stages(stages)


def read_arrays(program: Program, arrays: Sequence[Any], stages: int | None) -> tuple[int, list[list[Any]]]:
    """The number of stages and the blocks of the arrays that somebody passes.

    Raises:
        SeriesError: Their number or a shape does not fit.
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
    """Any kind of number or expression; decimals as fractions, which mix with the others."""
    if isinstance(entry, Decimal) and entry.is_finite():
        return Fraction(entry)
    if not hasattr(entry, "__mul__"):
        raise SeriesError(f"{name} must hold numbers or expressions, but had {entry!r:.60}")
    return entry


def _shape(array: Any, name: str) -> tuple[int, ...]:
    """The sizes of nested sequences of numbers."""
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
