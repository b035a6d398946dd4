"""Trees of a method on a scene, and what evaluation needs of a series on them.

The colours of trees are pieces of the field, and formulas bound the numbers of children. For a method with one part the
scene may still be split into blocks of variables. Simple blocks have fewer coloured trees than the whole field has
trees in one colour (123 in place of 200 to order 8 for a separable Hamiltonian with quadratic kinetic energy), so the
smaller table is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Protocol

from bseries.algebra.bseries import BSeries
from bseries.algebra.stages import auxiliary_colors, check_method
from bseries.exceptions import SeriesError
from integrators.methods.programs.program import Method
from integrators.scenes.particles.expansion import flat_field
from integrators.scenes.particles.parts import Parts, Piece, check_kind, degrees, pieces_of
from integrators.scenes.scene import Scene
from trees.counting import count_trees
from trees.table import TreeTable, tree_table

if TYPE_CHECKING:
    import numpy as np
    import sympy
    from numpy.typing import ArrayLike

    from bseries.exact.domains import Coefficient
    from bseries.fields.elementary_differentials import SymbolicSeries


class SceneTrees(NamedTuple):
    """The trees of a method on a scene."""

    pieces: tuple[Piece, ...]  # of the field, for each colour
    table: TreeTable  # the trees whose elementary differentials need not vanish on the scene
    shapes: TreeTable  # the table for the series of the method: `table`, or one without colours
    total: int  # the number of trees of this order in the colours of `table` without bounds on children


def trees_of_method(method: Method, order: int, scene: Scene, parts: Parts | None = None) -> SceneTrees:
    """The trees needed for the series of a method on a scene."""
    check_method(method)
    if auxiliary_colors(method):
        raise SeriesError(f"method must treat parts of the field, but {method.name} has an auxiliary matrix as a part")
    pieces = pieces_of(method.names, scene, parts)
    bounds = degrees(scene, pieces)
    check_kind(method.name, method.max_children, pieces, scene)
    table = tree_table(order, len(pieces), bounds)
    choices = [SceneTrees(pieces, table, table, sum(count_trees(order, len(pieces))))]
    if len(pieces) == 1 and len(scene.blocks) > 1:
        blocks = tuple(Piece(frozenset([block.name])) for block in scene.blocks)
        finer = degrees(scene, blocks)
        if sum(count_trees(order, len(blocks), finer)) < len(table):
            total = sum(count_trees(order, len(blocks)))
            choices.append(SceneTrees(blocks, tree_table(order, len(blocks), finer), table, total))
    return min(choices, key=lambda choice: len(choice.table))


def trees_of_series(series: BSeries, scene: Scene, parts: Parts | None = None) -> SceneTrees:
    """All trees of a given series, with the pieces of the scene."""
    pieces = pieces_of(series.names, scene, parts)
    total = sum(count_trees(series.order, len(pieces)))
    return SceneTrees(pieces, series.table, series.table, total)


def flat_fields(scene: Scene, pieces: Sequence[Piece]) -> list[tuple[sympy.Expr, ...]]:
    """The field of each piece: one formula for each variable of the scene."""
    blocks = [block.name for block in scene.blocks for _ in block.variables]
    return [
        tuple(
            formula if piece.blocks is None or block in piece.blocks else formula * 0
            for formula, block in zip(flat_field(scene, piece.part), blocks, strict=True)
        )
        for piece in pieces
    ]


class SeriesOnScene(Protocol):
    """What evaluation needs of a `SceneSeries`."""

    scene: Scene
    trees: SceneTrees
    series: BSeries
    label: str
    order: int
    dimension: int
    is_field: bool
    empty: Coefficient

    @cached_property
    def weights(self) -> list[Coefficient]:
        """The factors of the elementary differentials."""
        ...

    def symbolic_series(self, **limits: int) -> SymbolicSeries:
        """A symbolic form of the series."""
        ...

    def terms(self, y: ArrayLike) -> np.ndarray:
        """The terms by order."""
        ...
