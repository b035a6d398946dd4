"""Free trees: classes of rooted trees that differ only in the position of the root.

Moving the root along one edge maps u ∘ v to v ∘ u. Elementary Hamiltonians change sign, H(u ∘ v) = −H(v ∘ u), so the
Hamiltonian of a free tree is unique up to sign, and vanishes if u = v occurs: such free trees are called superfluous.

For each rooted tree only the edge to its largest child is considered. It leads towards the centroid. Every edge of the
free tree is chosen by one of the rootings: if neither end of an edge between u and v chose it, the chosen neighbours w
of u and x of v would give |u| > |w| ≥ |v| > |x| ≥ |u|.

There are two kinds of colours. *Parts* of the system, f = Σ f^[ν], belong to the nodes. *Blocks* p and q of a
Hamiltonian system belong to the edges: an edge has one end with ∂/∂p and one with ∂/∂q, the colour of a node is the
block in which its parent is differentiated, and the colour of a root has no meaning. When the root
moves along an edge, the old root gets the colour opposite to that of the new one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import Any, NamedTuple

from bseries_base.lowering.flat_kernels import flat_kernel
from trees import kernels
from trees.drawing import svg
from trees.errors import TreeError
from trees.kernels import OUTSIDE, graft, product
from trees.table import TreeTable, tree_table
from trees.tree import Tree


class Rooting(NamedTuple):
    """A rooted tree of a free tree, obtained from `multiplicity` choices of the root.

    Its Hamiltonian is `sign` times that of the representative; the sign is 0 if the free tree is superfluous.
    """

    tree: Tree
    sign: int
    multiplicity: int


class FreeTree(NamedTuple):
    """A free tree: a class of rooted trees that differ only in the position of the root.

    The root of `representative` is the centroid (of two, the one with the smaller tree); `symmetry` is the number of
    automorphisms, |τ| / Σ 1/σ over the rootings.

    Example:
        >>> import bseries as bs
        >>> star = bs.trees.free_tree_classes(4)[-1]
        >>> star.representative, star.symmetry, star.is_superfluous
        (Tree('[τ,τ,τ]'), 6, False)
        >>> star.rootings[0]
        Rooting(tree=Tree('[[τ,τ]]'), sign=-1, multiplicity=3)
    """

    representative: Tree
    rootings: tuple[Rooting, ...]
    symmetry: int
    is_superfluous: bool

    def __repr__(self) -> str:
        return f"FreeTree({self.representative.text()}: {len(self.rootings)} rootings, symmetry {self.symmetry})"

    def _repr_svg_(self) -> str:
        return svg(self.representative)


@flat_kernel
def move_roots(
    size, flips, max_order, colors, block, order, color, left, right, base_start, base, stack, flipped, turned,
):  # fmt: skip
    """For every tree the tree with the other root colour (only if `flips`), and with its largest child as the root."""
    for tree in range(size):
        u = left[tree]
        v = right[tree]
        flipped[tree] = turned[tree] = OUTSIDE
        if u < 0:
            turned[tree] = tree
            if flips:
                flipped[tree] = 1 - color[tree]
            continue
        if flips:
            if flipped[u] >= 0:
                flipped[tree] = product(flipped[u], v, max_order, colors, block, order, color, base_start, base)
            if color[u] == color[v]:
                u = flipped[u]
        if u >= 0:
            turned[tree] = graft(v, u, max_order, colors, block, order, color, left, right, base_start, base, stack)


@flat_kernel
def find_centroids(size, flips, order, color, right, flipped, turned, representative, sign):
    """Move every root to the centroid: the representative of the class, and the sign of the moves."""
    for tree in range(size):
        at = tree
        parity = 1
        while right[at] >= 0 and 2 * order[right[at]] > order[at]:
            at = turned[at]
            parity = -parity
        if flips and color[at] == 1:
            at = flipped[at]
        if right[at] >= 0 and 2 * order[right[at]] == order[at]:
            other = turned[at]
            if flips and color[other] == 1:
                other = flipped[other]
            if other == at:
                parity = 0
            elif other < at:
                at = other
                parity = -parity
        representative[tree] = at
        sign[tree] = parity


class Rootings:
    """The moves of the root for all trees of a table, as columns over the ids.

    `turned` is the id of v ∘ u for the tree u ∘ v with largest child v, and `representative` that of the class, with
    the `sign` of the Hamiltonian relative to it, 0 for superfluous trees. Where the colours are blocks of a system that
    is not separable, roots can change colour (`flips`): `flipped` is the id of the tree with the other root colour, and
    turning gives u the colour opposite to v's.
    """

    def __init__(self, table: TreeTable, *, blocks: bool = False):
        self.table = table
        self.flips = blocks and not is_separable(table)
        size = len(table)
        flipped, turned, representative = (table.column(size, "int32") for _ in range(3))
        sign, stack = table.column(size), table.column(table.max_order, "int32")
        table.run(move_roots)(size, self.flips, table.max_order, table.colors, *table.columns, stack, flipped, turned)
        self.flipped, self.turned = _list(flipped), _list(turned)
        if min(self.turned) < 0 or (self.flips and min(self.flipped) < 0):
            raise TreeError(f"table must hold every tree with its root moved, but {table!r} does not")
        columns = table.columns
        table.run(find_centroids)(
            size, self.flips, columns.order, columns.color, columns.right, flipped, turned, representative, sign
        )
        self.representative, self.sign = _list(representative), _list(sign)
        self._symmetry = _list(table.symmetry_and_density[0])

    def symmetry(self, tree: int) -> int:
        """Number of automorphisms of the free tree, which fix the centroid or the edge between two centroids."""
        return self._symmetry[self.representative[tree]] * (1 if self.sign[tree] else 2)

    def multiplicity(self, tree: int) -> int:
        """Number of nodes of the free tree that give this tree as roots."""
        return self.symmetry(tree) // self._symmetry[tree]


def _list(column: Any) -> list[int]:
    return column if isinstance(column, list) else column.tolist()


@lru_cache(maxsize=8)
def rootings(table: TreeTable, *, blocks: bool = False) -> Rootings:
    """The rootings of a table, cached."""
    return Rootings(table, blocks=blocks)


def is_separable(table: TreeTable) -> bool:
    """Whether the trees are those of p' = f(q), q' = g(p), without children of their parent's colour."""
    return table.colors == 2 and all(table.limits[c][c] == 0 for c in range(2))


def grafting(table: TreeTable) -> Callable[[int, int], int]:
    """The Butcher product u ∘ v on the ids of a table; negative if outside the table."""
    columns, stack = [_list(column) for column in table.columns], [0] * table.max_order
    return lambda u, v: kernels.graft(u, v, table.max_order, table.colors, *columns, stack)


def free_tree_classes(
    order: int,
    colors: int = 1,
    *,
    blocks: bool = False,
    max_children: Iterable[Iterable[float | None]] | float | None = None,
) -> tuple[FreeTree, ...]:
    """The free trees with 1 … `order` nodes, ascending by representative.

    The modified Hamiltonian of a method for y' = J ∇H has one term for each free tree that is not superfluous.

    Args:
        order: Largest number of nodes.
        colors: Number of colours.
        blocks: Whether two colours are the blocks p and q of a Hamiltonian system, p' = −H_q and q' = H_p; otherwise
            they are parts of a sum of systems. The roots for blocks have no colour and are written as p, except in
            separable systems, where their colour distinguishes kinetic and potential energy.
        max_children: Bounds on children, as for `TreeTable`, which moves of the root must respect.

    Raises:
        TreeError: An argument is out of range, or a move of the root violates the bounds.

    Example:
        >>> import bseries as bs
        >>> [str(free.representative) for free in bs.trees.free_tree_classes(5) if not free.is_superfluous]
        ['τ', '[τ,τ]', '[τ,τ,τ]', '[[τ],[τ]]', '[τ,τ,[τ]]', '[τ,τ,τ,τ]']
        >>> [(str(tree), sign, many) for tree, sign, many in bs.trees.free_tree_classes(3)[-1].rootings]
        [('[[τ]]', -1, 2), ('[τ,τ]', 1, 1)]
        >>> [free.representative.text("pq") for free in bs.trees.free_tree_classes(2, colors=2, blocks=True)]
        ['p', 'p[p]']

    References:
        HLW, sections IX.9 (elementary Hamiltonians, superfluous trees) and IX.10 (blocks).
        OEIS A000055 (free trees), A000238 (blocks: trees with directed edges).
    """
    if blocks and colors != 2:
        raise TreeError(f"blocks must be two colours, but were {colors!r:.60}")
    table = tree_table(order, colors, max_children)
    roots = rootings(table, blocks=blocks)
    classes: dict[int, list[Rooting]] = {}
    for tree, representative in enumerate(roots.representative):
        if not (roots.flips and table.columns.color[tree]):
            rooting = Rooting(table[tree], roots.sign[tree], roots.multiplicity(tree))
            classes.setdefault(representative, []).append(rooting)
    return tuple(
        FreeTree(table[at], tuple(classes[at]), roots.symmetry(at), roots.sign[at] == 0) for at in sorted(classes)
    )
