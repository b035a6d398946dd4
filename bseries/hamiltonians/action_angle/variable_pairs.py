"""Momenta and positions: the two blocks of variables of a canonical system, as users give them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.differential_rings import DifferentialRing
from bseries.fields.symbolic.sparse_polynomials import TooLarge
from integrators.scenes.model.blocks import Block, canonical_blocks, read_blocks
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import sympy


MOST_MONOMIALS = 10_000
"""Longer formulas are not simplified."""


def simplified(formula: sympy.Expr, symbols: Sequence[sympy.Symbol]) -> sympy.Expr:
    """An equal formula, factored, with sin² + cos² = 1 used; very long ones stay as they are."""
    try:
        ring = DifferentialRing([formula], symbols, limit=MOST_MONOMIALS)
        return ring.to_expression(ring.elements[0])
    except TooLarge:
        return formula


def simplified_from_within(formula: Any, symbols: Sequence[sympy.Symbol]) -> Any:
    """A formula simplified from within: √(x² + y²) is known as a radius only when its inside is.

    What comes out is factored, or a sum where that is shorter.
    """
    import sympy

    def inner(part: Any) -> Any:
        return part.func(*(simplified(argument, symbols) for argument in part.args))

    def is_opaque(part: Any) -> bool:
        return bool(part.is_Function or (part.is_Pow and not part.exp.is_Integer))

    factored: Any = simplified(formula.replace(is_opaque, inner), symbols)
    return min(sympy.expand_mul(factored), factored, key=sympy.count_ops)


def read_pair(blocks: Any, argument: str) -> tuple[Block, Block]:
    """Momenta and positions, and nothing else.

    Raises:
        SeriesError: There are others, or another structure.
    """
    if isinstance(blocks, Scene) and blocks.poisson is not None:
        raise SeriesError(f"{argument} must be canonical, but {blocks.name} has a Poisson structure of its own")
    found = blocks.blocks if isinstance(blocks, Scene) else read_blocks(blocks, argument)
    pair = canonical_blocks(found)
    if pair is None or len(found) != 2:
        names = ", ".join(block.name for block in found)
        raise SeriesError(
            f"{argument} must be momenta and as many positions, told apart by names such as p and q, "
            f"but was {names or 'empty':.60}"
        )
    return pair


def sizes(pair: Sequence[Block]) -> dict[str, Any]:
    """What the blocks are read from, in the order of the state."""
    return {block.name: block.size for block in sorted(pair, key=lambda block: block.offset)}


def names_of(pair: Sequence[Block]) -> tuple[str, ...]:
    """The names of all variables, in the order of the state."""
    return tuple(name for block in sorted(pair, key=lambda block: block.offset) for name in block.variables)


def check_mapping(formulas: Any, names: Sequence[str], argument: str) -> None:
    """Refuse what does not map just these names.

    Raises:
        SeriesError: One is missing, or there are others.
    """
    keys = list(formulas) if isinstance(formulas, Mapping) else None
    if keys is None or set(keys) != set(names):
        was = repr(formulas) if keys is None else f"for {', '.join(map(str, keys)) or 'none'}"
        raise SeriesError(f"{argument} must have a formula for each of {', '.join(names):.60}, but was {was:.60}")
