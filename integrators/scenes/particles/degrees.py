"""How often parts of a field can be differentiated before they vanish, read off the formulas.

These numbers say which elementary differentials are zero for every method: in a tree, a node can have only as many
children of a kind as its field has derivatives in that direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from integrators.scenes.model.local_terms import VALUE, LocalTerm, Output, Place

if TYPE_CHECKING:
    import sympy

    from integrators.scenes.model.system import System


Family: TypeAlias = tuple[str, int]
"""Variables that are told apart: the name of a block, and a number in it."""


class Piece(NamedTuple):
    """A piece of the field: what the terms of a part (None: all) add to the variables of some blocks (None: all)."""

    blocks: frozenset[str] | None = None
    part: str | None = None

    def outputs(self, term: LocalTerm, scene: System) -> list[Output]:
        """Where a term goes as far as it belongs to the piece."""
        if self.part is not None and term.part != self.part:
            return []
        return [x for x in term.outputs if self.blocks is None or block_of(x.place, scene) in self.blocks]


def block_of(place: Place, scene: System) -> str:
    """The name of the block that a place lies in."""
    return next(block.name for block in scene.blocks if block.offset <= place.offset < block.end)


def family_of(place: Place, scene: System) -> Family:
    """The block that a place lies in, and its component there (of each site, where there are sites)."""
    block = next(block for block in scene.blocks if block.offset <= place.offset < block.end)
    entry = place.offset - block.offset
    return block.name, entry % len(block.components) if block.components else entry


def supports(scene: System, pieces: Sequence[Piece]) -> list[frozenset[Family]]:
    """For each piece of the field, the families of variables in which it has entries."""
    return [
        frozenset(family_of(x.place, scene) for term in scene.local_terms for x in piece.outputs(term, scene))
        for piece in pieces
    ]


def degrees(scene: System, pieces: Sequence[Piece]) -> list[list[int | None]]:
    """How often each piece of the field can be differentiated along each other piece, and in all, before it vanishes.

    Args:
        scene: The scene.
        pieces: The pieces of its field, the colours of trees.

    Returns:
        A row for each piece: its degree in the variables of each piece, and in all of these together; None where it is
        no polynomial. It has the form of `max_children` of a table of trees.

    Example:
        >>> from integrators import scene
        >>> blocks = [Piece(frozenset("p")), Piece(frozenset("q"))]
        >>> degrees(scene("pendulum"), blocks)
        [[0, None, None], [1, 0, 1]]
    """
    where = supports(scene, pieces)
    every = frozenset().union(*where)
    rows: list[list[int | None]] = []
    for piece in pieces:
        row: list[int | None] = [0] * (len(pieces) + 1)
        for term in scene.local_terms:
            for output in piece.outputs(term, scene):
                for k, families in enumerate([*where, every]):
                    row[k] = _larger(row[k], _degree(term, output, families, scene))
        rows.append(row)
    return rows


def _larger(one: int | None, other: int | None) -> int | None:
    return None if one is None or other is None else max(one, other)


def _degree(term: LocalTerm, output: Output, families: frozenset[Family], scene: System) -> int | None:
    """The degree of what a term adds at one place, in its local variables of these families."""
    import sympy

    formula = term.formula
    if output.derivative != VALUE:
        formula = formula.diff(sympy.Symbol(f"x{output.derivative}"))
    moved = [k for k, argument in enumerate(term.arguments) if family_of(argument.plus, scene) in families]
    return degree(formula, [sympy.Symbol(f"x{k}") for k in moved])


def degree(formula: sympy.Expr, variables: Sequence[sympy.Symbol]) -> int | None:
    """The total degree of a polynomial in some of its variables; None if it is none."""
    import sympy

    used = [variable for variable in variables if formula.has(variable)]
    if not used:
        return 0
    return sympy.Poly(formula, *used).total_degree() if formula.is_polynomial(*used) else None
