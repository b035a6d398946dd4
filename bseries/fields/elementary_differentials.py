"""Symbolic elementary differentials and B-series of fields given by formulas."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from numbers import Rational, Real
from typing import TYPE_CHECKING, Any, TypeAlias

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.differential_rings import MOST_MONOMIALS, DifferentialRing, Element
from bseries.fields.symbolic.flint_rings import fastest
from bseries.fields.symbolic.sparse_polynomials import TooLarge
from trees.counting import check_order
from trees.tree import Tree

if TYPE_CHECKING:
    Key: TypeAlias = tuple[int, tuple[int, ...]]
    Tower: TypeAlias = dict[Key, Any]
    """{(component, α): T_α}, with the multi-index α as an ascending list of variables."""

    import sympy

    from bseries.algebra.bseries import BSeries

    Fields: TypeAlias = Iterable[Iterable[sympy.Expr | int | float | Fraction]]
    Formulas: TypeAlias = tuple[sympy.Expr, ...]


class DerivativeTowers:
    """Derivative tensors of coloured fields, computed on demand: f^(m+r)(F(u1), …, F(um)) for the tree [u1, …, um]."""

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
        """Σ coefficient(τ) F(τ) for trees τ = u ∘ v of one order; the F(v) are summed before T(u) is applied."""
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
            elif derivatives := self.tower(left, 1):
                branches = self._combined((c, self.tower(tree.children[-1], 0)) for c, tree in group)
                parts.append((1, self._contracted(derivatives, branches)))
        nodes = max((tree.order for tree in coefficients), default=0)
        found = self._combined([(Fraction(1, common * self._scale**nodes), self._combined(parts))])
        components = (found.get((i, ()), self._arithmetic.zero) for i in range(len(self.ring.variables)))
        return tuple(map(self._arithmetic.unload, components))

    def tower(self, tree: Tree, rank: int) -> Tower:
        """The tensor of this rank for a tree (of fields multiplied by their common denominator)."""
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
        """The r-th derivatives of a field, from those of order r − 1."""
        tower = self._single.get((color, rank))
        if tower is None:
            tower = {}
            for (i, alpha), element in self._of_single_node(color, rank - 1).items():
                for j in range(alpha[-1] if alpha else 0, len(self.ring.variables)):
                    if derivative := self._arithmetic.derivative(element, j):
                        tower[i, (*alpha, j)] = derivative
            self._single[color, rank] = tower
        return tower

    def _contracted(self, tower: Tower, vector: Tower) -> Tower:
        """The contraction Σ_j T_{α+e_j} v_j, which lowers the rank by one."""
        products: dict[Key, list[tuple[Any, Any]]] = {}
        for (i, alpha), element in tower.items():
            for at, j in enumerate(alpha):
                component = vector.get((j, ()))
                if component is not None and (at == 0 or alpha[at - 1] != j):
                    products.setdefault((i, alpha[:at] + alpha[at + 1 :]), []).append((element, component))
        return {key: element for key, pairs in products.items() if (element := self._arithmetic.dot(pairs))}

    def _combined(self, parts: Iterable[tuple[Any, Tower]]) -> Tower:
        """A linear combination of tensors."""
        summands: dict[Key, list[tuple[int | Fraction, Any]]] = {}
        for factor, tower in parts:
            for key, element in tower.items():
                is_number = isinstance(factor, int | Fraction)
                summand = (factor, element) if is_number else (1, self._arithmetic.dot([(factor, element)]))
                summands.setdefault(key, []).append(summand)
        return {key: element for key, group in summands.items() if (element := self._arithmetic.sum(group))}


FLOAT_DIGITS = 15
"""Significant digits of a float."""


class SymbolicSeries:
    """Symbolic series Σ h^|τ| / σ(τ) · b(τ) F(τ) on a field; the terms are computed on demand.

    Arithmetic is exact. With floats in the field, or a method published as decimals, the results are written as floats
    with the significant digits only.

    Args:
        series: The series, such as a modified equation.
        fields: One field for each colour of its trees: a SymPy expression or number for every variable. If colours are
            blocks of variables, the formulas outside a block are 0.
        variables: The symbols of the variables; other symbols are parameters.
        limit: Largest number of monomials in an intermediate formula.

    Raises:
        SeriesError: The fields or variables do not fit the series, or a formula divides by zero.

    Example:
        >>> import bseries as bs, sympy
        >>> p, q = sympy.symbols("p q")
        >>> euler = bs.modified_equation(bs.method("explicit-euler"), 3)
        >>> SymbolicSeries(euler, [(p * (2 - q), q * (p - 1))], (p, q)).term(2)
        (p*(p*q - q**2 + 3*q - 4)/2, -q*(p**2 - p*q + 1)/2)

    References:
        HLW, example IX.1.3 and definition III.1.8.
    """

    def __init__(
        self, series: BSeries, fields: Fields, variables: Iterable[sympy.Symbol], *, limit: int = MOST_MONOMIALS
    ):
        self.series = series
        self._coefficients = series.coefficients()
        self._limit = limit
        self._towers = _towers(
            fields, variables, limit,
            colors=series.table.colors,
            digits=_digits(series),
            others=[x for x in self._coefficients if not isinstance(x, Fraction | float)],
        )  # fmt: skip
        self._elements: dict[int, tuple[Element, ...]] = {}

    @property
    def ring(self) -> DifferentialRing:
        """The ring of the formulas."""
        return self._towers.ring

    def term(self, n: int, *, simplify: bool = True) -> Formulas:
        """The contribution of the trees with n nodes, in a modified equation the coefficient of h^(n−1).

        Args:
            n: Number of nodes.
            simplify: Whether to use common denominators and factor the formulas.

        Raises:
            SeriesError: `n` exceeds the order of the series, or a formula the limit.
        """
        elements = self.elements(n)
        with refusing_large(self._limit):
            return tuple(self.ring.to_expression(element, simplify=simplify) for element in elements)

    def elements(self, n: int) -> tuple[Element, ...]:
        """The contribution of the trees with n nodes, as elements of `ring`."""
        series = self.series
        if check_order(n) > series.order:
            raise SeriesError(f"n must be at most {series.order}, the order of the series, but was {n}")
        if n not in self._elements:
            weights = {series.table[at]: self._weight(at) for at in series.table.ids(n) if not series.is_zero_at(at)}
            with refusing_large(self._limit):
                self._elements[n] = self._towers.sum(weights)
        return self._elements[n]

    def _weight(self, at: int) -> Fraction | Element:
        """b(τ)/σ(τ) of the tree with this id; floats are taken as binary fractions."""
        value = self._coefficients[at]
        number = Fraction(value) if isinstance(value, Fraction | float) else self.ring.element(value)
        return number * Fraction(1, int(self.series.table.symmetry_and_density[0][at]))


def elementary_differentials(
    trees: Iterable[Tree | str],
    fields: Fields,
    variables: Iterable[sympy.Symbol],
    *,
    simplify: bool = True,
    limit: int = MOST_MONOMIALS,
) -> list[Formulas]:
    """The elementary differentials F(τ) of trees, F([τ1,…,τm]) = f^(m)(F(τ1),…,F(τm)), as formulas.

    Args:
        trees: The trees, such as a `TreeTable`.
        fields: One field for each colour: a formula for every variable.
        variables: The symbols of the variables.
        simplify: Whether to use common denominators and factor the formulas.
        limit: Largest number of monomials in an intermediate formula.

    Returns:
        For every tree the formulas of F(τ), one for each variable.

    Raises:
        SeriesError: The fields or variables do not fit the trees, a formula divides by zero or exceeds the limit.

    Example:
        >>> import bseries as bs, sympy
        >>> y = sympy.Symbol("y")
        >>> elementary_differentials(bs.TreeTable(3), [(y**2,)], (y,))
        [(y**2,), (2*y**3,), (4*y**4,), (2*y**4,)]

    References:
        HLW, definition III.1.2.
    """
    chosen = [Tree(tree) for tree in trees]
    fields = [tuple(field) for field in fields]
    colors = max((color for tree in chosen for color in tree.colors), default=0) + 1
    if len(fields) < colors:
        raise SeriesError(f"fields must be one for each colour of the trees, {colors}, but were {len(fields)}")
    towers = _towers(fields, variables, limit, colors=len(fields), digits=None, others=())
    found = []
    for tree in chosen:
        with refusing_large(limit):
            elements = towers.sum({tree: Fraction(1)})
            found.append(tuple(towers.ring.to_expression(element, simplify=simplify) for element in elements))
    return found


def _digits(series: BSeries) -> int | None:
    """Significant digits of the results: one less than those of rounded decimals."""
    if series.digits is not None:
        return max(1, min(series.digits - 1, FLOAT_DIGITS))
    return None if series.is_exact else FLOAT_DIGITS


def _towers(
    fields: Fields, variables: Iterable[sympy.Symbol], limit: int, *, colors: int, digits: int | None, others: Any
) -> DerivativeTowers:
    """The derivative tensors of checked fields, in a ring that also holds other formulas."""
    import sympy

    symbols = tuple(variables)
    if not symbols or len(set(symbols)) < len(symbols) or not all(isinstance(x, sympy.Symbol) for x in symbols):
        raise SeriesError(f"variables must be different SymPy symbols, but were {symbols!s:.60}")
    rows = [tuple(map(_formula, field)) for field in fields]
    if len(rows) != colors:
        raise SeriesError(f"fields must be {colors}, one for each colour of the trees, but were {len(rows)}")
    for row in rows:
        if len(row) != len(symbols):
            size = len(symbols)
            raise SeriesError(f"fields must have {size} formulas, one for each variable, but one has {len(row)}")
    formulas = [formula for row in rows for formula in row]
    if digits is None and any(formula.has(sympy.Float) for formula in formulas):
        digits = FLOAT_DIGITS
    with refusing_large(limit):
        ring = DifferentialRing([*formulas, *others], symbols, limit=limit, digits=digits)
        return DerivativeTowers(ring, [[ring.element(formula) for formula in row] for row in rows])


def _formula(value: object) -> Any:
    """A number or expression as a SymPy expression."""
    import sympy

    if isinstance(value, sympy.Expr):
        return value
    if isinstance(value, Rational):
        return sympy.Rational(int(value.numerator), int(value.denominator))
    if isinstance(value, Real):
        return sympy.Float(float(value))
    raise SeriesError(f"fields must hold SymPy expressions or numbers, but one was {value!r:.60}")


@contextmanager
def refusing_large(limit: int) -> Iterator[None]:
    """Turn excessive growth of formulas into a `SeriesError`."""
    try:
        yield
    except TooLarge:
        raise SeriesError(f"fields must stay simpler: a formula would have more than {limit} monomials") from None
    except RecursionError:
        raise SeriesError("fields and trees must be nested less deeply than the interpreter's limit") from None
