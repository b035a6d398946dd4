"""Symbolic elementary differentials and B-series of fields given by formulas."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

import sympy

from bseries.algebra.bseries import BSeries
from bseries.exceptions import SeriesError
from bseries.fields.differential_rings import MOST_MONOMIALS, DifferentialRing
from bseries.fields.polynomials import Element, Number
from trees.counting import check_order
from trees.tree import Tree

Key: TypeAlias = tuple[int, tuple[int, ...]]
Tensor: TypeAlias = dict[Key, Element]
"""{(component, α): T_α}, with the multi-index α as an ascending list of variables."""

Formulas: TypeAlias = tuple[sympy.Expr, ...]


class DerivativeTowers:
    """Derivative tensors of coloured fields, computed on demand: f^(m+r)(F(u1), …, F(um)) for the tree [u1, …, um]."""

    def __init__(self, ring: DifferentialRing, fields: Sequence[Sequence[Element]]):
        self.ring = ring
        self._single: dict[tuple[int, int], Tensor] = {
            (color, 0): {(i, ()): component for i, component in enumerate(field) if component}
            for color, field in enumerate(fields)
        }
        self._known: dict[tuple[Tree, int], Tensor] = {}

    def sum(self, coefficients: Mapping[Tree, Element | Fraction]) -> tuple[Element, ...]:
        """Σ coefficient(τ) F(τ) for trees τ = u ∘ v of one order; the F(v) are summed before T(u) is applied."""
        by_left: dict[Tree | None, list[tuple[Element | Fraction, Tree]]] = {}
        for tree, c in coefficients.items():
            by_left.setdefault(tree.left, []).append((c, tree))
        parts: list[tuple[Element | Number, Tensor]] = []
        for left, group in by_left.items():
            if left is None:
                parts += [(c, self.tensor(tree, 0)) for c, tree in group]
            elif derivatives := self.tensor(left, 1):
                branches = self._combined((c, self.tensor(tree.children[-1], 0)) for c, tree in group)
                parts.append((1, self._contracted(derivatives, branches)))
        found = self._combined(parts)
        return tuple(found.get((i, ()), self.ring.zero) for i in range(len(self.ring.variables)))

    def tensor(self, tree: Tree, rank: int) -> Tensor:
        """The tensor of this rank for a tree."""
        left, right = tree.left, tree.right
        if left is None or right is None:
            return self._of_single_node(tree.color, rank)
        tensor = self._known.get((tree, rank))
        if tensor is None:
            tensor = self.tensor(left, rank + 1)
            if tensor:
                tensor = self._contracted(tensor, self.tensor(right, 0))
            self._known[tree, rank] = tensor
        return tensor

    def _of_single_node(self, color: int, rank: int) -> Tensor:
        """The r-th derivatives of a field, from those of order r − 1."""
        tensor = self._single.get((color, rank))
        if tensor is None:
            tensor = {}
            for (i, alpha), element in self._of_single_node(color, rank - 1).items():
                for j in range(alpha[-1] if alpha else 0, len(self.ring.variables)):
                    if derivative := self.ring.derivative(element, j):
                        tensor[i, (*alpha, j)] = derivative
            self._single[color, rank] = tensor
        return tensor

    def _contracted(self, tensor: Tensor, vector: Tensor) -> Tensor:
        """The contraction Σ_j T_{α+e_j} v_j, which lowers the rank by one."""
        products: dict[Key, list[tuple[Element, Element]]] = {}
        for (i, alpha), element in tensor.items():
            for at, j in enumerate(alpha):
                component = vector.get((j, ()))
                if component is not None and (at == 0 or alpha[at - 1] != j):
                    products.setdefault((i, alpha[:at] + alpha[at + 1 :]), []).append((element, component))
        return {key: element for key, pairs in products.items() if (element := self.ring.dot(pairs))}

    def _combined(self, parts: Iterable[tuple[Element | Number, Tensor]]) -> Tensor:
        """A linear combination of tensors."""
        summands: dict[Key, list[tuple[Element | Number, Element]]] = {}
        for factor, tensor in parts:
            for key, element in tensor.items():
                summands.setdefault(key, []).append((factor, element))
        return {key: element for key, group in summands.items() if (element := self.ring.dot(group))}


FLOAT_DIGITS = 15  # significant digits of a float


class SymbolicSeries:
    """Symbolic series Σ h^|τ| / σ(τ) · b(τ) F(τ) on a field for each colour of trees; terms are computed on demand.

    Arithmetic is exact. With floats in the fields, or a method published as decimals, the results are written as floats
    with the significant digits only. `limit` bounds the number of monomials in an intermediate formula.

    References:
        HLW, example IX.1.3 and definition III.1.8.
    """

    def __init__(
        self,
        series: BSeries,
        fields: Sequence[Sequence[sympy.Expr]],
        variables: Sequence[sympy.Symbol],
        *,
        limit: int = MOST_MONOMIALS,
    ):
        self.series = series
        self._coefficients = series.coefficients()
        formulas = [formula for field in fields for formula in field]
        digits = None if series.is_exact else FLOAT_DIGITS
        if series.digits is not None:
            digits = max(1, min(series.digits - 1, FLOAT_DIGITS))  # one less than those of rounded decimals
        if digits is None and any(formula.has(sympy.Float) for formula in formulas):
            digits = FLOAT_DIGITS
        irrational = [x for x in self._coefficients if not isinstance(x, Fraction | float)]
        self.ring = DifferentialRing([*formulas, *irrational], variables, limit=limit, digits=digits)
        """The ring of the formulas."""
        self._towers = DerivativeTowers(self.ring, [list(map(self.ring.element, field)) for field in fields])
        self._elements: dict[int, tuple[Element, ...]] = {}

    def term(self, n: int, *, simplify: bool = True) -> Formulas:
        """The formulas of the trees with n nodes, with common denominators and factored if `simplify`."""
        return tuple(self.ring.to_expression(element, simplify=simplify) for element in self.elements(n))

    def elements(self, n: int) -> tuple[Element, ...]:
        """The contribution of the trees with n nodes, as elements of `ring`."""
        series = self.series
        if check_order(n) > series.order:
            raise SeriesError(f"n must be at most {series.order}, the order of the series, but was {n}")
        if n not in self._elements:
            weights = {series.table[at]: self._weight(at) for at in series.table.ids(n) if not series.is_zero_at(at)}
            try:
                self._elements[n] = self._towers.sum(weights)
            except RecursionError:
                raise SeriesError("trees must be nested less deeply than the interpreter's limit") from None
        return self._elements[n]

    def _weight(self, at: int) -> Fraction | Element:
        """b(τ)/σ(τ) of the tree with this id; floats are taken as binary fractions."""
        value = self._coefficients[at]
        number = Fraction(value) if isinstance(value, Fraction | float) else self.ring.element(value)
        return number * Fraction(1, int(self.series.table.symmetry_and_density[0][at]))
