"""Polynomial degrees of the pieces of a field.

Degrees bound the trees with nonzero elementary differentials: a node has at most as many children of a colour as its
field has nonzero derivatives in that direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from integrators.scenes.model.local_terms import LocalTerm, Output, Place, output_formula

if TYPE_CHECKING:
    import sympy

    from integrators.scenes.model.system import System


Family: TypeAlias = tuple[str, int]
"""A class of variables: the name of a block and an index in it."""


class Piece(NamedTuple):
    """The contribution of the terms of a part (None: all) to the variables of some blocks (None: all)."""

    blocks: frozenset[str] | None = None
    part: str | None = None

    def outputs(self, term: LocalTerm, scene: System) -> list[Output]:
        """The outputs of a term that belong to the piece."""
        if self.part is not None and term.part != self.part:
            return []
        return [x for x in term.outputs if self.blocks is None or family_of(x.place, scene)[0] in self.blocks]


def family_of(place: Place, scene: System) -> Family:
    """The block of a place, and its component there (the same for all sites)."""
    block = next(block for block in scene.blocks if block.offset <= place.offset < block.end)
    entry = place.offset - block.offset
    return block.name, entry % len(block.components) if block.components else entry


def supports(scene: System, pieces: Sequence[Piece]) -> list[frozenset[Family]]:
    """The families of variables in which each piece of the field has entries."""
    return [
        frozenset(family_of(x.place, scene) for term in scene.local_terms for x in piece.outputs(term, scene))
        for piece in pieces
    ]


def degrees(scene: System, pieces: Sequence[Piece]) -> list[list[int | None]]:
    """The degree of each piece of the field in the variables of every piece.

    Args:
        scene: The scene.
        pieces: The pieces of its field, the colours of trees.

    Returns:
        A row for each piece: its degree in the variables of each piece, and in all of these together; None if it is
        not a polynomial. The format is that of `max_children` of a table of trees.

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
    """The degree of an output of a term in its local variables of these families."""
    import sympy

    used = [k for k, argument in enumerate(term.arguments) if family_of(argument.plus, scene) in families]
    return degree(output_formula(term, output), [sympy.Symbol(f"x{k}") for k in used])


def degree(formula: sympy.Expr, variables: Sequence[sympy.Symbol]) -> int | None:
    """The total degree of a formula in some variables; None if it is not a polynomial in them."""
    import sympy

    used = [variable for variable in variables if formula.has(variable)]
    if not used:
        return 0
    return sympy.Poly(formula, *used).total_degree() if formula.is_polynomial(*used) else None
