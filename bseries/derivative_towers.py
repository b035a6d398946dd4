"""Elementary differentials of formulas, and sums of them, by derivative towers.

F([τ1,…,τm]) = f^(m)(F(τ1),…,F(τm)). The tower of rank r of a tree u with m children holds the derivatives

    T_α(u) = ∂^α f^(m)(F(τ1),…,F(τm)),   |α| = r,

the F(τj) not being differentiated. So T_α(u∘v) = Σ_j T_{α+e_j}(u) F(v)_j, one contraction for each tree, and F = T_0.
Only what is not zero is kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from .differential_rings import DifferentialRing, Element
from .flint_rings import fastest

if TYPE_CHECKING:
    from typing import TypeAlias

    from trees.tree import Tree

    Key: TypeAlias = tuple[int, tuple[int, ...]]
    Tower: TypeAlias = dict[Key, Any]
    """{(component, α): T_α}, with α as the ascending list of variables; elements are those of the arithmetic in use."""


class DerivativeTowers:
    """The towers of coloured fields, each computed when it is first asked for.

    Args:
        ring: The ring that the fields live in.
        fields: One field for each colour, with one element for each variable.
    """

    def __init__(self, ring: DifferentialRing, fields: Sequence[Sequence[Element]]):
        self.ring = ring
        self._arithmetic: Any = fastest(ring)
        self._scale = self._arithmetic.denominator(component for field in fields for component in field)
        self._single: dict[tuple[int, int], Tower] = {}
        for color, field in enumerate(fields):
            scaled = ((i, self._arithmetic.load(self._scale * component)) for i, component in enumerate(field))
            self._single[color, 0] = {(i, ()): component for i, component in scaled if component}
        self._known: dict[tuple[Tree, int], Tower] = {}

    def sum(self, coefficients: Mapping[Tree, Element | Fraction]) -> tuple[Element, ...]:
        """Σ coefficient(τ) F(τ) for trees of one order: F(v) are summed for every left u before T(u) is multiplied."""
        rationals = [c for c in coefficients.values() if isinstance(c, Fraction)]
        common = math.lcm(*(c.denominator for c in rationals))
        by_left: dict[Tree | None, list[tuple[Any, Tree]]] = {}
        for tree, c in coefficients.items():
            factor = int(c * common) if isinstance(c, Fraction) else self._arithmetic.load(c * common)
            by_left.setdefault(tree.left, []).append((factor, tree))
        parts: list[tuple[Any, Tower]] = []
        for left, group in by_left.items():
            if left is None:
                parts += [(c, self.tower(tree, 0)) for c, tree in group]
            elif slopes := self.tower(left, 1):
                branches = self._combined((c, self.tower(tree.children[-1], 0)) for c, tree in group)
                parts.append((1, self._contracted(slopes, branches)))
        nodes = max((tree.order for tree in coefficients), default=0)
        found = self._combined([(Fraction(1, common * self._scale**nodes), self._combined(parts))])
        components = (found.get((i, ()), self._arithmetic.zero) for i in range(len(self.ring.variables)))
        return tuple(map(self._arithmetic.unload, components))

    def tower(self, tree: Tree, rank: int) -> Tower:
        """The tower of a tree (for the fields times a common denominator)."""
        left, right = tree.left, tree.right
        if left is None or right is None:
            return self._of_single_node(tree.color, rank)
        tower = self._known.get((tree, rank))
        if tower is None:
            tower = self.tower(left, rank + 1)
            if tower:
                tower = self._contracted(tower, self.tower(right, 0))
            self._known[tree, rank] = tower
        return tower

    def _of_single_node(self, color: int, rank: int) -> Tower:
        """The derivatives of a field: those of rank r are those of rank r − 1, differentiated once more."""
        tower = self._single.get((color, rank))
        if tower is None:
            tower = {}
            for (i, alpha), element in self._of_single_node(color, rank - 1).items():
                for j in range(alpha[-1] if alpha else 0, len(self.ring.variables)):
                    if slope := self._arithmetic.derivative(element, j):
                        tower[i, (*alpha, j)] = slope
            self._single[color, rank] = tower
        return tower

    def _contracted(self, tower: Tower, vector: Tower) -> Tower:
        """Σ_j T_{α+e_j} v_j: a tower of one rank less."""
        products: dict[Key, list[tuple[Any, Any]]] = {}
        for (i, alpha), element in tower.items():
            for at, j in enumerate(alpha):
                component = vector.get((j, ()))
                if component is not None and (at == 0 or alpha[at - 1] != j):
                    products.setdefault((i, alpha[:at] + alpha[at + 1 :]), []).append((element, component))
        return {key: element for key, pairs in products.items() if (element := self._arithmetic.dot(pairs))}

    def _combined(self, parts: Iterable[tuple[Any, Tower]]) -> Tower:
        """The sum of multiples of towers."""
        summands: dict[Key, list[tuple[int | Fraction, Any]]] = {}
        for factor, tower in parts:
            for key, element in tower.items():
                is_number = isinstance(factor, int | Fraction)
                summand = (factor, element) if is_number else (1, self._arithmetic.dot([(factor, element)]))
                summands.setdefault(key, []).append(summand)
        return {key: element for key, group in summands.items() if (element := self._arithmetic.sum(group))}
