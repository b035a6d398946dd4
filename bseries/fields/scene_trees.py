"""Trees of a series on a scene: colours are pieces of the field, formulas bound the numbers of children.

For a method with one part the scene may still be split into blocks of variables. Simple blocks have fewer coloured
trees than the whole field has trees in one colour (123 in place of 200 to order 8 for a separable Hamiltonian with
quadratic kinetic energy), so the smaller table is used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.algebra.bseries import BSeries
from bseries.algebra.stages import auxiliary_colors, check_method
from bseries.exceptions import SeriesError
from bseries.fields.elementary_differentials import SymbolicSeries
from integrators.methods.programs.program import Method
from integrators.scenes.particles.expansion import flat_field
from integrators.scenes.particles.parts import Piece, check_kind, degrees, pieces_of
from integrators.scenes.scene import Scene
from trees.counting import count_trees
from trees.free_trees import grafting
from trees.table import TreeTable, tree_table

if TYPE_CHECKING:
    import sympy


class SceneTrees(NamedTuple):
    """The trees of a method on a scene."""

    pieces: tuple[Piece, ...]  # of the field, for each colour
    table: TreeTable  # the trees whose elementary differentials need not vanish on the scene
    shapes: TreeTable  # the table for the series of the method: `table`, or one without colours
    total: int  # the number of trees of this order in the colours of `table` without bounds on children


def trees_of_method(method: Method, order: int, scene: Scene, parts: Any = None) -> SceneTrees:
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


def trees_of_series(series: BSeries, scene: Scene, parts: Any = None) -> SceneTrees:
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


class SeriesOnScene:
    """A series on a scene, with the pieces of the field that its colours stand for; data for every evaluation."""

    def __init__(self, scene: Scene, trees: SceneTrees, series: BSeries):
        if series.table != trees.table:
            raise SeriesError(f"series must have the trees {trees.table!r}, but has {series.table!r}")
        self.scene, self.trees, self.series = scene, trees, series
        self.label = series.label or "a series"
        self.order, self.dimension, self.variables = trees.table.max_order, scene.dimension, scene.variables
        self.empty: Any = series.empty  # the coefficient of the empty tree: 0 for a field, not a map
        self.is_field = series.empty == 0

    @cached_property
    def weights(self) -> list[Any]:
        """The factors coefficient/σ of the elementary differentials."""
        return self.series.weights()

    @cached_property
    def formulas(self) -> SymbolicSeries:
        """The symbolic form of the series."""
        return self.symbolic_series()

    def symbolic_series(self, **limits: int) -> SymbolicSeries:
        """A new symbolic form of the series, abandoned where formulas exceed a limit."""
        fields = flat_fields(self.scene, self.trees.pieces)
        return SymbolicSeries(self.series, fields, self.scene.symbols, **limits)


def shapes(table: TreeTable, plain: TreeTable) -> list[int]:
    """The id of each tree, without its colours, in another table."""
    if table == plain:
        return list(range(len(table)))
    _, _, left, right = table.lists
    product = grafting(plain)
    found: list[int] = []
    for u, v in zip(left, right, strict=True):
        found.append(0 if u < 0 else product(found[u], found[v]))
    return found


def mapped_uncertainty(uncertainty: Callable[[int], float], ids: Sequence[int], at: int) -> float:
    """The uncertainty of a coefficient taken from another tree; a function of a module, for pickling."""
    return uncertainty(ids[at])
