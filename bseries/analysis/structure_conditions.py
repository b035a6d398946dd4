"""What structure asks of coefficients: linear conditions over trees, listed once for each table.

All of them are linear in the field b = log a: b preserves a structure to order k if and only if the flow does. For
symplecticity the flow itself satisfies conditions that differ by the products a(u) a(v) only, and needs no logarithm.

Two kinds of colours (see `trees.free_trees`): parts of a sum of fields, each with the structure in question, and
blocks p and q of the variables of one field that has it. A block by itself has no structure, so that coefficients must
not depend on the colour of the root; in separable systems, p' = f(q) and q' = g(p), blocks are parts.

Moving the root leads out of restricted tables, such as that of Nyström systems. The trees that it leads to have no
elementary differentials but any coefficient, so conditions are listed on all trees and these coefficients eliminated.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from trees.compiled import kernel
from trees.counting import normal_limits
from trees.free_trees import grafting, is_separable, rootings
from trees.table import tree_table

if TYPE_CHECKING:
    from trees.table import TreeTable

    Row = tuple[dict[int, int], int, int]

NO_PRODUCT = -1
SEPARABLE = ((0, None), (None, 0))


@kernel
def sum_rows(start, tree, factor, first, second, flow, values, sums):
    """sums[k] = Σ factor · values[tree] over the entries of row k, for flows minus the product of two values."""
    for k in range(len(sums)):
        total = values[tree[start[k]]] * factor[start[k]]
        for at in range(start[k] + 1, start[k + 1]):
            total += values[tree[at]] * factor[at]
        if flow and first[k] >= 0:
            total -= values[first[k]] * values[second[k]]
        sums[k] = total


class Conditions:
    """Conditions Σ factor · b(tree) = 0 on a field, or Σ factor · a(tree) = a(u) a(v) on a flow.

    The trees of one condition all have the same number of nodes (that of u and v together).

    Args:
        rows: For each condition its factors by tree, and the ids of u and v, both `NO_PRODUCT` if there are none.
    """

    def __init__(self, rows: Iterable[Row]):
        self._start, self._tree, self._factor = [0], [], []
        self._first: list[int] = []
        self._second: list[int] = []
        self.breaks: list[int] = []
        """For each condition the first tree that it speaks of."""
        for factors, u, v in rows:
            self._tree += factors.keys()
            self._factor += factors.values()
            self._start.append(len(self._tree))
            self._first.append(u)
            self._second.append(v)
            self.breaks.append(min(factors))
        sums = (map(abs, self._factor[i:j]) for i, j in zip(self._start, self._start[1:], strict=False))
        self._norm = max(map(sum, sums), default=0)

    def __len__(self) -> int:
        return len(self.breaks)

    @cached_property
    def _arrays(self) -> tuple[Any, ...]:
        import numpy as np

        return tuple(np.array(x, np.int64) for x in self._lists)

    @property
    def _lists(self) -> tuple[list[int], ...]:
        return self._start, self._tree, self._factor, self._first, self._second

    def residuals(self, values: Any, *, flow: bool) -> list[Any]:
        """Left minus right side of every condition.

        Args:
            values: A coefficient for each tree: numbers in a list, or int64 in an array. Arrays, and numbers of a flow,
                may carry a factor L^n for n nodes.
            flow: Whether they are those of a flow.
        """
        if isinstance(values, list):
            sums: list[Any] = [0] * len(self)
            sum_rows.py_func(*self._lists, flow, values, sums)
            return sums
        import numpy as np

        largest = max(int(values.max(initial=0)), -int(values.min(initial=0)))
        if largest * self._norm + flow * largest**2 >= 2**63:
            return self.residuals(values.tolist(), flow=flow)
        result = np.empty(len(self), np.int64)
        sum_rows.compiled(*self._arrays, flow, values, result)
        return result.tolist()


def kept(build: Callable[[TreeTable, bool], Iterator[Row]]) -> Callable[[TreeTable, bool], Conditions]:
    """Conditions on a table with blocks (or parts), from a generator of rows; the last few are kept."""

    @lru_cache(maxsize=8)
    def conditions(table: TreeTable, blocks: bool) -> Conditions:
        return Conditions(build(table, blocks))

    return conditions


def is_complete(table: TreeTable) -> bool:
    """Whether a table holds all trees up to its order."""
    return table.limits == normal_limits(table.colors, None)


def closure(table: TreeTable, blocks: bool, *, more: int = 0) -> TreeTable:
    """The smallest family of trees around a table that moving the root does not lead out of, with `more` nodes."""
    if blocks and not is_separable(table) and not is_complete(table):
        raise _restricted(table, "all trees up to its order, or trees of separable systems")
    limits = SEPARABLE if is_separable(table) else None
    return tree_table(table.max_order + more, table.colors, limits)


def _restricted(table: TreeTable, needed: str) -> SeriesError:
    return SeriesError(f"series must be on a table that holds {needed}, but was on {table!r}")


def _within(table: TreeTable, whole: TreeTable) -> dict[int, int]:
    """The ids of a table's trees in a larger table, with their own ids."""
    if table.limits == whole.limits:
        return {tree: tree for tree in range(len(table))}
    product, places = grafting(whole), list(range(table.colors))
    for left, right in zip(*table.lists[2:], strict=True):
        if left >= 0:
            places.append(product(places[left], places[right]))
    return {place: tree for tree, place in enumerate(places)}


def _root_colors(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """Blocks: the colour of the root makes no difference."""
    if blocks and not is_separable(table):
        roots = rootings(table, blocks=blocks)
        for tree, other in enumerate(roots.flipped):
            if tree < other:
                yield {tree: 1, other: -1}, NO_PRODUCT, NO_PRODUCT


@kept
def symmetry_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """b(τ) = 0 for every tree with an even number of nodes."""
    for n in range(2, table.max_order + 1, 2):
        for tree in table.ids(n):
            yield {tree: 1}, NO_PRODUCT, NO_PRODUCT


@kept
def hamiltonian_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """b(u ∘ v) + b(v ∘ u) = 0, for flows a(u ∘ v) + a(v ∘ u) = a(u) a(v); for blocks where the roots differ in colour.

    One pair (u, v) for each tree is enough (see `trees.free_trees`). On a restricted table conditions are for fields.
    """
    if closure(table, blocks) != table:
        yield from _restricted_hamiltonian(table, blocks)
        return
    roots = rootings(table, blocks=blocks)
    _, color, left, right = table.lists
    for tree in range(table.colors, len(table)):
        u, v = left[tree], right[tree]
        if not (roots.flips and color[u] == color[v]):
            yield Counter((tree, roots.turned[tree])), u, v
    yield from _root_colors(table, blocks)


def _restricted_hamiltonian(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """b(τ) = ±b(θ) where moving the root leads from τ to θ by pairs (u, v) of the table, through any trees u ∘ v."""
    whole = closure(table, blocks)
    roots, within = rootings(whole, blocks=blocks), _within(table, whole)
    links: dict[int, list[int]] = {}
    for tree, (u, v) in enumerate(zip(*whole.lists[2:], strict=True)):
        if u in within and v in within:
            links.setdefault(tree, []).append(roots.turned[tree])
            links.setdefault(roots.turned[tree], []).append(tree)
    done: set[int] = set()
    for start in within:
        if start in done:
            continue
        parity, reached = {start: 1}, [start]
        for tree in reached:
            for other in links.get(tree, ()):
                if other not in parity:
                    parity[other] = -parity[tree]
                    reached.append(other)
        done |= parity.keys()
        members = [tree for tree in reached if tree in within]
        superfluous = any(tree in links.get(tree, ()) for tree in reached)
        for tree in members if superfluous else members[1:]:
            row = {within[tree]: 1} if superfluous else {within[tree]: parity[tree], within[start]: -1}
            yield row, NO_PRODUCT, NO_PRODUCT


@kept
def energy_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """Σ ± b(T without a leaf, rooted next to it) = 0 over the leaves of every free tree T that is not superfluous.

    The derivative of H along F(τ) is the Hamiltonian of [τ], and Σ b(τ)/σ(τ) H([τ]) is summed by free trees, with the
    number of automorphisms of T as a common denominator. The new root has any colour among parts, H = Σ H^[ν]; among
    blocks it is the one that differs from the root of τ.
    """
    larger = closure(table, blocks, more=1)
    roots, within = rootings(larger, blocks=blocks), _within(table, closure(table, blocks))
    _, color, left, right = larger.lists
    rows: dict[int, dict[int, int]] = {}
    for tree in range(larger.colors, len(larger)):
        root, branch = left[tree], right[tree]
        if root >= larger.colors or branch not in within or (blocks and color[root] == color[branch]):
            continue
        if roots.sign[tree]:
            row = rows.setdefault(roots.representative[tree], {})
            row[within[branch]] = roots.sign[tree] * roots.multiplicity(tree)
    for row in rows.values():
        yield row, NO_PRODUCT, NO_PRODUCT


@kept
def volume_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """Σ b(u₁ ∘ (u₂ ∘ (… ∘ u_m))) = 0 over the rotations of every cycle of m ≥ 2 trees.

    The divergence of F(τ) is a sum over the nodes of τ: an edge from that node to the root makes a cycle, with a tree
    growing from each of its nodes. A cycle of one node is a derivative of div f = 0.
    """
    closure(table, blocks)  # refuses blocks on other tables
    product = grafting(table)
    order = table.lists[0]
    words: list[dict[tuple[int, ...], int]] = [{}]  # by number of nodes: cycles cut open, with the tree that results
    for n in range(1, table.max_order + 1):
        words.append({(tree,): tree for tree in table.ids(n)})
        for first in range(table.ids(n).start):
            for rest, tree in words[n - order[first]].items():
                joined = product(first, tree)
                if joined >= 0:
                    words[n][first, *rest] = joined
        for word in words[n]:
            if len(word) == 1 or word[0] > min(word):
                continue
            rotations = {word[k:] + word[:k] for k in range(len(word))}
            # Where a rotation is missing some node has too many children, and the cycle vanishes.
            if word == min(rotations) and rotations <= words[n].keys():
                yield Counter(words[n][rotation] for rotation in rotations), NO_PRODUCT, NO_PRODUCT
    yield from _root_colors(table, blocks)


@kept
def cubic_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """b(u ∘ v) + b(v ∘ u) = 0 and b(u ∘ v ∘ w) + b(v ∘ w ∘ u) + b(w ∘ u ∘ v) = 0, with u ∘ v ∘ w = (u ∘ v) ∘ w.

    For an invariant I of degree 3 the derivatives of I' f = 0 turn I' F(τ) into terms I''(F(u), F(v)) and
    I'''(F(u), F(v), F(w)); these are their coefficients.
    """
    if not is_complete(table):
        raise _restricted(table, "all trees up to its order")
    product, order, last = grafting(table), table.lists[0], table.max_order
    for u in range(len(table)):
        for v in _up_to(table, u, last - order[u]):
            pair, other = product(u, v), product(v, u)
            yield Counter((pair, other)), NO_PRODUCT, NO_PRODUCT
            for w in _up_to(table, v, last - order[u] - order[v]):
                third = product(product(w, u), v)
                yield Counter((product(pair, w), product(other, w), third)), NO_PRODUCT, NO_PRODUCT
    yield from _root_colors(table, blocks)


def _up_to(table: TreeTable, first: int, order: int) -> range:
    """Ids from `first` on of trees with at most `order` nodes."""
    return range(first, table.ids(order).stop) if order > 0 else range(0)
