"""Modified Hamiltonians from trees: H̃ = Σ h^(|τ|−1) b(τ)/σ(τ) H(τ), one summand for each free tree.

With b the modified equation of a symplectic method, b(τ) H(τ) is the same for all rooted trees τ of a free tree, and
the number of the free tree's automorphisms is |τ| / Σ 1/σ(τ) over these. A rooted tree whose root is the centroid has
σ(τ) automorphisms, those of its free tree; its largest branch has less than half of the nodes. Where two centroids are
joined by an edge, all automorphisms keep the edge if the tree is not superfluous (for superfluous trees b = 0), and
each of the two rootings counts by one half. So no tree needs a differential of more than half of its nodes.

H(τ) is an elementary differential with a root of one more colour (see `EnergyScene`), and b(τ) is the coefficient of
its *twin*: the same tree with its root in the colour of the piece that comes from this energy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.algebra.bseries import BSeries
from bseries.algebra.modified import modified_equation
from bseries.algebra.stages import own_trees
from bseries.analysis.order import trusted
from bseries.analysis.structure import hamiltonian_field
from bseries.exact.domains import make_values
from bseries.exceptions import SeriesError
from bseries.fields.scene_trees import SceneTrees, trees_of_method, trees_of_series
from bseries.hamiltonians.energy_scene import EnergyScene
from bseries.hamiltonians.evaluation import EnergySeries
from integrators.methods.program.child_bounds import common_bounds
from integrators.scenes.particles.degrees import Piece, degrees
from trees.counting import count_trees
from trees.free_trees import grafting
from trees.kernels import OUTSIDE
from trees.table import TreeTable, tree_table

if TYPE_CHECKING:
    from bseries.analysis.verdicts import Verdict
    from integrators import Scene
    from integrators.methods.program.program import Method

    Bounds = list[list[int | None]]


class EnergyTrees(NamedTuple):
    """What a modified Hamiltonian is made from.

    Attributes:
        scene: The scene with its energies.
        table: The trees in the colours of its pieces.
        field: The modified equation, on trees that hold the twins of those with an energy at the root.
        colors: For each colour of `table` that of `field`.
        blocks: Whether the colours of `field` are blocks of variables.
    """

    scene: EnergyScene
    table: TreeTable
    field: BSeries
    colors: tuple[int, ...]
    blocks: bool

    @property
    def verdict(self) -> Verdict:
        """How far the modified equation is Hamiltonian, on the trees that the scene calls for."""
        return hamiltonian_field(self.field, colors_are="blocks" if self.blocks else "parts")


def energy_trees(method: Method | BSeries, scene: Scene, order: int, parts: Any) -> EnergyTrees:
    """The trees and coefficients for a method, or a field series, on a canonical scene."""
    if isinstance(method, BSeries):
        method = method.truncate(order)
        trees = trees_of_series(method, scene, parts)
    else:
        trees = trees_of_method(method, order, scene, parts)
    augmented = EnergyScene(scene, trees.pieces)
    bounds = degrees(augmented, augmented.pieces)
    colors = (*range(len(trees.pieces)), *augmented.twins)
    blocks = trees.pieces[0].blocks is not None
    if trees.table != trees.shapes:  # the method sees one field, whose trees tell its coefficients
        blocks, colors = False, (0,) * len(colors)
    field = method
    if not isinstance(field, BSeries):
        field = modified_equation(trusted(field), _table_of_twins(field, augmented, bounds, order, colors, blocks))
    return EnergyTrees(augmented, tree_table(order, len(bounds), bounds), field, colors, blocks)


def _table_of_twins(
    method: Any, scene: EnergyScene, bounds: Bounds, order: int, colors: Sequence[int], blocks: bool
) -> TreeTable:
    """The trees that a method's coefficients are needed for: a twin's root has as many children as an energy."""
    if max(colors) == 0:
        return tree_table(order, 1, degrees(scene, [Piece()]))
    count = len(scene.field_pieces)
    if blocks and not scene.separated:
        return tree_table(order, count)
    rows = [[*row[:count], row[-1]] for row in bounds]
    for twin, energy in zip(scene.twins, rows[count:], strict=True):
        rows[twin] = [None if a is None or b is None else max(a, b) for a, b in zip(rows[twin], energy, strict=True)]
    return tree_table(order, count, common_bounds(tuple(map(tuple, rows[:count])), own_trees(method)))


def energy_series(trees: EnergyTrees) -> EnergySeries:
    """The modified Hamiltonian as a series on the scene with its energies.

    Raises:
        SeriesError: The series is on trees that do not tell the coefficients.
    """
    table, field = trees.table, trees.field
    count, total = len(trees.scene.field_pieces), sum(count_trees(table.max_order, table.colors))
    values, sources, coefficients = field.coefficients(), [0] * len(table), [Fraction(0)] * len(table)
    for tree, (source, factor) in enumerate(_twins(trees, count)):
        if factor and source < 0:
            raise SeriesError(
                f"series must be on a table that holds each tree with its root moved, but {field.table!r} does not"
            )
        if factor:
            sources[tree], coefficients[tree] = source, factor * values[source]
    uncertainty = field.uncertainty and partial(_uncertainty_of_twin, field.uncertainty, sources)
    label = field.label or "a series"
    series = BSeries(
        table, make_values(table, coefficients), 0, label=label, digits=field.digits, uncertainty=uncertainty
    )
    return EnergySeries(trees.scene, SceneTrees(trees.scene.pieces, table, table, total), series)


def _twins(trees: EnergyTrees, count: int) -> list[tuple[int, Fraction]]:
    """For each tree one of the field with the same coefficient up to a factor, 0 for those that have no part in H̃.

    On trees of Nyström systems a twin may have one branch too many, when the root moved to its largest branch has not:
    b(u ∘ v) = −b(v ∘ u).
    """
    order, color, left, right = trees.table.lists
    graft = grafting(trees.field.table)
    images: list[int] = []
    found: list[tuple[int, Fraction]] = []
    for tree, (u, v) in enumerate(zip(left, right, strict=True)):
        is_energy = color[tree] >= count
        if u < 0:
            source, factor = trees.colors[color[tree]], Fraction(int(is_energy))
        else:
            source, rest = _product(graft, images[u], images[v]), order[tree] - 2 * order[v]
            factor = Fraction(1, 1 if rest else 2) if is_energy and rest >= 0 else Fraction(0)
        images.append(source)
        if factor and source < 0:
            source, factor = _product(graft, images[v], images[u]), -factor
        found.append((source, factor))
    return found


def _product(graft: Callable[[int, int], int], u: int, v: int) -> int:
    return graft(u, v) if u >= 0 and v >= 0 else OUTSIDE


def _uncertainty_of_twin(uncertainty: Any, sources: list[int], at: int) -> float:
    return uncertainty(sources[at])
