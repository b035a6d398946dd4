"""The homological equation [f, g] = r for the next term of a processor, solved exactly, tree by tree.

At a tree with n + 1 nodes [f, g](τ) is the sum of g over τ without a leaf, minus g(θ) if θ is the only child of τ's
root. The equation at u ∘ • (one more leaf on the root of u) contains g(u), multiplied by the number of leaves on the
root, and otherwise only values at trees with more leaves on their roots: it determines g(u) once those are known.
(Roots q of a Nyström system, q' = p, have one child, to which the leaf is added; p-roots are determined first.) The
remaining equations are solvability conditions on the method. The same elimination determines the pairs ρ(u, v) that
measure the deviation of g from a Hamiltonian field.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from bseries.analysis.structure_conditions import closure
from bseries.exceptions import SeriesError
from trees.free_trees import grafting, rootings

if TYPE_CHECKING:
    from trees.table import TreeTable

Key = TypeVar("Key", bound=Hashable)
Number = Callable[[Fraction], Any]


class ProcessorTerm(NamedTuple):
    """The term of g with n nodes, the residuals of the equations with n + 1 nodes, and the tree of each residual."""

    term: dict[int, Any]
    residuals: list[Any]
    breaks: list[int]


def solve_triangular(
    unknowns: Iterable[Key],
    pivot: Callable[[Key], Key],
    equation: Callable[[Key], Mapping[Key, int]],
    right_side: Callable[[Key], Any],
    known: Mapping[Key, Any],
    number: Number,
) -> dict[Key, Any]:
    """Solve a triangular system: each unknown from its pivot equation Σ factor · unknown = right side."""
    values = dict(known)

    def value(key: Key) -> Any:
        if key not in values:
            at = pivot(key)
            factors = dict(equation(at))
            own = factors.pop(key)
            rest = sum((value(other) * factor for other, factor in factors.items()), start=number(Fraction(0)))
            values[key] = (right_side(at) - rest) * number(Fraction(1, own))
        return values[key]

    for key in unknowns:
        value(key)
    return values


class Leaves:
    """Addition and removal of leaves, on the ids of a table.

    Leaves are added to the root or, where that may have one child only (q' = p), to the child.
    """

    def __init__(self, table: TreeTable):
        self.table = table
        self.product = grafting(table)
        self._leaf_colors = [_leaf_color(table, color) for color in range(table.colors)]
        self.without = cache(self._without)

    def add(self, tree: int) -> int:
        """The tree with one more leaf."""
        _, color, left, right = self.table.lists
        leaf, free = self._leaf_colors[color[tree]]
        if free or left[tree] < 0:
            return self.product(tree, leaf)
        return self.product(left[tree], self.add(right[tree]))

    def count(self, tree: int) -> int:
        """The number of leaves of this colour on the node to which `add` adds one."""
        _, color, left, right = self.table.lists
        (leaf, free), found = self._leaf_colors[color[tree]], 0
        if not free and left[tree] >= 0:
            return self.count(right[tree])
        while right[tree] >= 0:
            found += right[tree] == leaf
            tree = left[tree]
        return found

    def _without(self, tree: int) -> Counter[int]:
        """The trees that remain when a leaf other than the root is removed."""
        left, right = self.table.lists[2][tree], self.table.lists[3][tree]
        found: Counter[int] = Counter()
        if left < 0:
            return found
        if self.table.lists[3][right] < 0:
            found[left] += 1
        for smaller, multiplicity in self.without(left).items():
            found[self.product(smaller, right)] += multiplicity
        for smaller, multiplicity in self.without(right).items():
            found[self.product(left, smaller)] += multiplicity
        return found


def _leaf_color(table: TreeTable, color: int) -> tuple[int, bool]:
    """A colour in which nodes may have children (if possible the first), and whether any number of them."""
    *each, total = table.limits[color]
    for child in range(table.colors) if color == 0 else (0,):
        if min(each[child], total) >= table.max_order - 1:
            return child, True
    child = 1 - color
    if table.colors == 2 and each[color] == 0 and min(each[child], total) == 1:
        *each, total = table.limits[child]
        if min(each[color], total) >= table.max_order - 1:
            return child, False
    raise _table_error(table)


def _table_error(table: TreeTable) -> SeriesError:
    """The error for a table on which the equation cannot be solved."""
    return SeriesError(f"series must be on all trees, or those of a separable system, but was on {table!r}")


class EffectiveOrder:
    """The equation b_{n+1} + [g_n, f] = 0."""

    def __init__(self, table: TreeTable):
        self._table = table
        self._leaves = Leaves(table)

    def step(self, n: int, b: list[Any], number: Number) -> ProcessorTerm:
        """Solve for g_n, given b at all trees with up to n + 1 nodes; g₁ is 0 at the first leaf."""
        known = {0: number(Fraction(0))} if n == 1 else {}
        trees, larger = self._table.ids(n), self._table.ids(n + 1)
        term = solve_triangular(trees, self._leaves.add, self._equation, b.__getitem__, known, number)
        residuals = [b[tree] - _sum(self._equation(tree), term, number) for tree in larger]
        return ProcessorTerm(term, residuals, list(larger))

    def _equation(self, tree: int) -> Counter[int]:
        factors = Counter(self._leaves.without(tree))
        if self._table.lists[2][tree] < self._table.colors:
            factors[self._table.lists[3][tree]] -= 1
        return factors


def _sum(factors: Mapping[Key, int], values: Mapping[Key, Any], number: Number) -> Any:
    return sum((values[key] * factor for key, factor in factors.items()), start=number(Fraction(0)))


class ConjugateSymplectic:
    """The condition that b_{n+1} + [g_n, f] is Hamiltonian.

    The unknowns are ρ(u, v) = g(u ∘ v) + g(v ∘ u), under the key (u, v) with u ≤ v, and for blocks δ(τ), the value at τ
    with its root in p minus that in q, under the key (τ,).
    """

    def __init__(self, table: TreeTable, blocks: bool):
        if closure(table, blocks) != table:
            raise _table_error(table)
        self._leaves = Leaves(table)
        self._roots = rootings(table, blocks=blocks)
        self._columns = table.lists
        self._keys: list[dict[tuple[int, ...], tuple[int, int]]] = [{} for _ in range(table.max_order + 1)]
        _, color, left, right = table.lists
        for tree, turned in enumerate(self._roots.turned):
            keys = self._keys[self._columns[0][tree]]
            if self._roots.flips and color[tree] == 0:
                keys[tree,] = tree, self._roots.flipped[tree]
            if left[tree] >= 0 and not (self._roots.flips and color[left[tree]] == color[right[tree]]):
                keys.setdefault(_pair(left[tree], right[tree]), (tree, turned))

    def step(self, n: int, b: list[Any], number: Number) -> ProcessorTerm:
        """Solve for g_n up to Hamiltonian fields, given b at all trees with up to n + 1 nodes."""
        unknowns, equations = self._keys[n], self._keys[n + 1]

        def right_side(key: tuple[int, ...]) -> Any:
            tree, other = equations[key]
            return b[tree] + b[other] if len(key) == 2 else b[tree] - b[other]

        found = solve_triangular(unknowns, self._pivot, self._equation, right_side, {}, number)
        residuals = [right_side(key) - _sum(self._equation(key), found, number) for key in equations]
        term = self._lifted(self._roots.table.ids(n), found, number)
        return ProcessorTerm(term, residuals, [min(pair) for pair in equations.values()])

    def _pivot(self, key: tuple[int, ...]) -> tuple[int, ...]:
        if len(key) == 1:
            return (self._leaves.add(key[0]),)
        u, v = sorted(key, key=self._leaves.count)
        return _pair(u, self._leaves.add(v))

    def _equation(self, key: tuple[int, ...]) -> Counter[tuple[int, ...]]:
        if len(key) == 1:
            return Counter({(tree,): multiplicity for tree, multiplicity in self._leaves.without(key[0]).items()})
        factors: Counter[tuple[int, ...]] = Counter()
        for u, v in (key, key[::-1]):
            for smaller, multiplicity in self._leaves.without(u).items():
                factors[_pair(smaller, v)] += multiplicity
        return factors

    def _lifted(self, trees: range, found: Mapping[tuple[int, ...], Any], number: Number) -> dict[int, Any]:
        """A field g with these ρ and δ: zero at the representative of every free tree (if g is free there)."""
        roots = self._roots
        _, color, left, right = self._columns
        values: dict[int, Any] = {}

        def value(tree: int) -> Any:
            if tree in values:
                return values[tree]
            if roots.representative[tree] == tree:
                half = number(Fraction(1, 2))
                result = number(Fraction(0)) if roots.sign[tree] else found[_pair(left[tree], right[tree])] * half
            elif roots.flips and (
                roots.flipped[tree] == roots.representative[tree] or color[tree] == color[right[tree]]
            ):
                other = roots.flipped[tree]
                result = value(other) + (found[tree,] if color[tree] == 0 else -found[other,])
            else:
                result = found[_pair(left[tree], right[tree])] - value(roots.turned[tree])
            values[tree] = result
            return result

        return {tree: value(tree) for tree in trees}


def _pair(u: int, v: int) -> tuple[int, int]:
    return (u, v) if u <= v else (v, u)
