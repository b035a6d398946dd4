"""Start values: exact numbers, block by block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..errors import IntegratorError
from ..expressions import shorten
from .blocks import TIME, Block
from .formulas import read_numbers

if TYPE_CHECKING:
    import sympy

    Start = dict[str, tuple[sympy.Expr, ...]]


def read_start(values: Any, blocks: Sequence[Block], argument: str = "start") -> Start:
    """The start values of some blocks.

    Args:
        values: Maps blocks to their numbers: one, a list, or a row for each site. The time t may be among them.
        blocks: The blocks that there are.
        argument: What a message calls it.

    Raises:
        IntegratorError: A block is unknown, or has another number of values.
    """
    if not isinstance(values, Mapping):
        raise IntegratorError(f"{argument} must map blocks to lists of numbers, but was {shorten(repr(values))}")
    sizes = {TIME: 1} | {block.name: block.dimension for block in blocks}
    found: Start = {}
    for name, value in values.items():
        if name not in sizes:
            known = shorten(", ".join(block.name for block in blocks) or "none")
            raise IntegratorError(f"{argument} must have values for {known}, but has some for {name!r:.60}")
        entries = _flattened(value)
        if len(entries) != sizes[name]:
            raise IntegratorError(
                f"{argument}.{name} must have as many values as the block has variables, {sizes[name]}, "
                f"but has {len(entries)}"
            )
        found[name] = read_numbers(entries, f"{argument}.{name}")
    return found


def join_start(values: Start, blocks: Sequence[Block], argument: str = "start") -> tuple[sympy.Expr, ...]:
    """The start values of all variables in the order of the state; the time begins at 0.

    Raises:
        IntegratorError: A block has none.
    """
    import sympy

    values = {TIME: (sympy.Integer(0),), **values}
    for block in blocks:
        if block.name not in values:
            known = shorten(", ".join(block.name for block in blocks))
            raise IntegratorError(f"{argument} must have values for {known}, but has none for {block.name}")
    return tuple(value for block in blocks for value in values[block.name])


def _flattened(value: Any, depth: int = 2) -> list[Any]:
    """The entries of a number, a list, or a list of rows."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if depth and isinstance(value, Sequence) and not isinstance(value, str):
        return [entry for row in value for entry in _flattened(row, depth - 1)]
    return [value]
