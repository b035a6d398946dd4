"""Which trees a scene calls for: colours as pieces of its field, and bounds on children from its formulas.

A method of one part sees one field; the scene may still be seen as blocks, whose trees in several colours are fewer
than those in one wherever the blocks are simple (a separable Hamiltonian with quadratic kinetic energy has 123 trees to
order 8 in two colours, and 200 in one). The smaller table is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.algebra.bseries import BSeries
from bseries.algebra.stages import auxiliary_colors, check_method, own_trees
from bseries.exceptions import SeriesError
from bseries.fields.differentials import SymbolicSeries
from integrators.scenes.particles.degrees import Piece, degrees
from integrators.scenes.particles.expansion import flat_field
from integrators.scenes.particles.parts import check_kind, pieces_of
from trees.counting import count_trees
from trees.kernels import graft
from trees.table import TreeTable, tree_table

if TYPE_CHECKING:
    import sympy

    from bseries.fields.differentials import SymbolicSeries
    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene


class SceneTrees(NamedTuple):
    """The trees of a method on a scene.

    Attributes:
        pieces: The piece of the field that each colour stands for.
        table: The trees whose elementary differentials need not vanish on the scene.
        shapes: The table on which the method's series is computed: `table`, or one without colours.
        total: The number of trees of this order in the colours of `table` for a scene of which nothing is known.
    """

    pieces: tuple[Piece, ...]
    table: TreeTable
    shapes: TreeTable
    total: int


def trees_of_method(method: Method, order: int, scene: Scene, parts: Any = None) -> SceneTrees:
    """The trees that a method's series on a scene needs.

    Args:
        method: The method.
        order: Largest number of nodes.
        scene: The scene.
        parts: What the method's parts are, see `pieces_of`.

    Raises:
        SeriesError: The method's parts are none of the scene's, or the scene is not of the kind it is meant for.
    """
    check_method(method)
    if auxiliary_colors(method):
        raise SeriesError(f"method must treat parts of the field, but {method.name} has an auxiliary matrix as a part")
    pieces = pieces_of(method.names, scene, parts)
    bounds = degrees(scene, pieces)
    check_kind(method.name, own_trees(method), pieces, scene)
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
    """The trees of a given series, all of them, as those of a scene."""
    pieces = pieces_of(series.names, scene, parts)
    total = sum(count_trees(series.order, len(pieces)))
    return SceneTrees(pieces, series.table, series.table, total)


def flat_fields(scene: Scene, pieces: Sequence[Piece]) -> list[tuple[sympy.Expr, ...]]:
    """The field of each piece, one formula for each variable of the scene."""
    blocks = [block.name for block in scene.blocks for _ in block.variables]
    return [
        tuple(
            formula if piece.blocks is None or block in piece.blocks else formula * 0
            for formula, block in zip(flat_field(scene, piece.part), blocks, strict=True)
        )
        for piece in pieces
    ]


class SeriesOnScene:
    """A series with the scene and the pieces of its field that the colours stand for: what evaluations of it read.

    Attributes:
        scene: The scene.
        trees: The trees and the pieces of the field that their colours stand for.
        series: The coefficients.

    Raises:
        SeriesError: The series has other trees.
    """

    def __init__(self, scene: Scene, trees: SceneTrees, series: BSeries):
        if series.table != trees.table:
            raise SeriesError(f"series must have the trees {trees.table!r}, but has {series.table!r}")
        self.scene, self.trees, self.series = scene, trees, series

    @property
    def label(self) -> str:
        """What it is a series of."""
        return self.series.label or "a series"

    @property
    def empty(self) -> Any:
        """The coefficient of the empty tree: 0 for a field."""
        return self.series.empty

    @cached_property
    def weights(self) -> list[Any]:
        """The factors of the elementary differentials: coefficient/σ."""
        return self.series.weights()

    @property
    def order(self) -> int:
        """The largest number of nodes."""
        return self.trees.table.max_order

    @property
    def dimension(self) -> int:
        """The number of variables."""
        return self.scene.dimension

    @property
    def variables(self) -> tuple[str, ...]:
        """The names of the variables."""
        return self.scene.variables

    @property
    def is_field(self) -> bool:
        """Whether it is a field, and not a map."""
        return self.empty == 0

    @cached_property
    def formulas(self) -> SymbolicSeries:
        """The series written out; see `bseries.fields.differentials`."""
        return self.written()

    def written(self, **limits: int) -> SymbolicSeries:
        """The series written out anew, given up where formulas grow beyond a limit."""

        fields = flat_fields(self.scene, self.trees.pieces)
        return SymbolicSeries(self.series, fields, self.scene.symbols, **limits)


def shapes(table: TreeTable, plain: TreeTable) -> list[int]:
    """For each tree of a table, the id of the same tree without colours in another table."""
    if table == plain:
        return list(range(len(table)))
    _, _, left, right = table.lists
    stack = [0] * plain.max_order
    found: list[int] = []
    for u, v in zip(left, right, strict=True):
        if u < 0:
            found.append(0)
        else:
            found.append(
                int(
                    graft.py_func(
                        found[u], found[v], plain.max_order, 1, plain.block, *plain.lists, plain.columns.base_start,
                        plain.columns.base, stack,
                    )
                )
            )  # fmt: skip
    return found
