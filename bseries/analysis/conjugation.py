"""Lie bracket, conjugation, effective order, and conjugate symplecticity.

A method has the long-time behaviour of its conjugates: n steps of χ⁻¹ ∘ Φ ∘ χ are χ⁻¹ ∘ Φⁿ ∘ χ.

The next term g_n of the logarithm of χ, the processor, solves the homological equation [f, g_n] = r exactly, tree by
tree. At a tree with n + 1 nodes [f, g](τ) is the sum of g over τ without a leaf, minus g(θ) if θ is the only child of
τ's root. The equation at u ∘ • (one more leaf on the root of u) contains g(u), multiplied by the number of leaves on
the root, and otherwise only values at trees with more leaves on their roots: it determines g(u) once those are known.
(Roots q of a Nyström system, q' = p, have one child, to which the leaf is added; p-roots are determined first.) The
remaining equations are solvability conditions on the method. The same elimination determines the pairs ρ(u, v) that
measure the deviation of g from a Hamiltonian field.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from bseries.algebra.bseries import BSeries
from bseries.algebra.composition import compose
from bseries.algebra.series import check_flow
from bseries.algebra.uncertainty import conjugated, worst_case
from bseries.analysis.order import Verdict, field_elements, flow_of
from bseries.analysis.stability.field_elements import Element
from bseries.analysis.structure import Coloring, Structure, closure, failing, has_blocks
from bseries.exact.domains import make_values, to_float
from bseries.exceptions import SeriesError
from bseries_base.table import as_html
from integrators.methods.programs.program import Method
from trees.free_trees import grafting, rootings
from trees.table import TreeTable
from trees.tree import Tree

if TYPE_CHECKING:
    from bseries.exact.domains import Coefficient

Key = TypeVar("Key", bound=Hashable)
Number = Callable[[Fraction], Element]


def conjugate(a: BSeries, c: BSeries) -> BSeries:
    """Conjugate method χ⁻¹ ∘ Φ ∘ χ: first c, then a, then the inverse of c.

    With Φ and χ the maps of a and c, this is compose(compose(c, a), c.inverse()), Butcher's product c a c⁻¹: c is the
    starting method, its inverse the finishing method.

    Raises:
        SeriesError: An argument is no flow, or the trees differ.

    Example:
        The trapezoidal rule and the implicit midpoint rule are conjugate by half a step of the explicit Euler method:

        >>> import bseries as bs
        >>> from fractions import Fraction
        >>> half = bs.series("explicit-euler", 6).scale_step(Fraction(1, 2))
        >>> midpoint = bs.series("implicit-midpoint", 6)
        >>> bs.analysis.conjugate(midpoint, half) == bs.series("trapezoidal", 6)
        True

    References:
        HLW, section VI.8; J. C. Butcher, *Numerical Methods for Ordinary Differential Equations*, section 389.
    """
    check_flow(a, "a")
    check_flow(c, "c")
    return compose(compose(c, a), c.inverse())


class ConjugateVerdict(NamedTuple):
    """The order up to which a method is conjugate to one with a property.

    Attributes:
        order: The largest k ≤ `tested_to` such that a conjugate method has the property for all trees to k nodes.
        breaks: The first tree for which no processor gives the property, or None.
        tested_to: The largest number of nodes tested.
        processor: The flow c such that conjugate(a, c) has the property up to `order`.

    Example:
        >>> import bseries as bs
        >>> verdict = bs.effective_order("trapezoidal", 4)
        >>> verdict.order, verdict.holds
        (2, False)
    """

    order: int
    breaks: Tree | None
    tested_to: int
    processor: BSeries

    @property
    def holds(self) -> bool:
        """Whether no tree violates the property."""
        return self.breaks is None

    __str__, to_dict, to_table, _repr_html_ = Verdict.__str__, Verdict.to_dict, Verdict.to_table, as_html

    def __repr__(self) -> str:
        return f"<ConjugateVerdict: {self}>"


def effective_order(method: Method | BSeries | str, order: int | None = None) -> ConjugateVerdict:
    """Effective order: the largest order of accuracy of a conjugate method, with the processor that gives it.

    Order by order, [f, g_n] = b_{n+1} is solved for the next term of g, the logarithm of the processor, with b the
    modified equation of the method conjugated by the terms found so far. The solution is unique up to multiples of f in
    g₁, which are time shifts and have no effect.

    Args:
        method: A method, or a flow.
        order: The largest number of nodes; by default the order of a series, and for a method that of `check`.

    Returns:
        A `ConjugateVerdict`: conjugate(a, processor) has the order found.

    Raises:
        SeriesError: `method` is neither a method nor a flow, `order` exceeds the order of the series, or its trees are
            neither all trees nor those of separable or of Nyström systems.

    Example:
        For separable systems the symplectic Euler method is conjugate to the Störmer–Verlet method, of order 2:

        >>> import bseries as bs
        >>> euler = bs.series("symplectic-euler-p", 5, max_children=[[0, None], [None, 0]])
        >>> verdict = bs.effective_order(euler)
        >>> bs.order_of(euler), verdict.order, bs.order_of(bs.analysis.conjugate(euler, verdict.processor))
        (1, 2, 2)

    References:
        J. C. Butcher, *The effective order of Runge–Kutta methods*, Lecture Notes in Mathematics 109 (1969),
        doi:10.1007/BFb0060019; S. Blanes, F. Casas, A. Murua, SIAM J. Numer. Anal. 42 (2004), 531–552 (processing).
    """
    flow = flow_of(method, order)
    table, node = flow.table, _inconsistent(flow)
    if node is not None:
        return ConjugateVerdict(0, table[node], table.max_order, flow**0)
    return _solve(flow, EffectiveOrder(table))


def conjugate_symplecticity(
    method: Method | BSeries | str, order: int | None = None, *, colors_are: Coloring = None
) -> ConjugateVerdict:
    """Order to which a method is conjugate to a symplectic one, by a map with a B-series.

    Order by order, the next term g_n of the processor's logarithm makes b_{n+1} + [g_n, f] Hamiltonian. It is
    determined up to Hamiltonian fields, which conjugate symplectic methods to symplectic ones. (With ρ(u, v) =
    g(u ∘ v) + g(v ∘ u) the equations read Σ ρ(u without a leaf, v) + Σ ρ(u, v without a leaf) = r(u, v). They determine
    ρ, and any symmetric function ρ belongs to some g.)

    Args:
        method: A consistent method, or its flow.
        order: As for `effective_order`.
        colors_are: As for `symplecticity`.

    Returns:
        A `ConjugateVerdict`: conjugate(a, processor) is symplectic up to the order found.

    Raises:
        SeriesError: As for `effective_order`, or the method is inconsistent, or has the trees of a Nyström system.

    Example:
        >>> import bseries as bs
        >>> bs.conjugate_symplecticity("trapezoidal", 6).holds
        True
        >>> bs.conjugate_symplecticity("rk4", 6).order
        4

    References:
        E. Hairer, C. J. Zbinden, *On conjugate symplecticity of B-series integrators*, IMA J. Numer. Anal. 33 (2013).
        P. Chartier, E. Faou, A. Murua, Numer. Math. 103 (2006), 575–590.
    """
    flow = flow_of(method, order)
    table, node = flow.table, _inconsistent(flow)
    if node is not None:
        found = flow.stored[node]
        raise SeriesError(f"method must be consistent, with the coefficient 1 of {table[node]}, but has {found!s:.60}")
    return _solve(flow, ConjugateSymplectic(table, has_blocks(flow, colors_are)))


def _solve(s: BSeries, problem: EffectiveOrder | ConjugateSymplectic) -> ConjugateVerdict:
    """Find the logarithm g of the processor order by order."""
    table = s.table
    g: list[Coefficient] = [Fraction(0)] * len(table)
    order, violating = table.max_order, None
    unit = None if s.digits is None else 10 ** (s.digits + 10)
    changes = None if s.uncertainty is None else _Changes(s, problem)
    for n in range(1, table.max_order):
        flow = s.truncate(n + 1)
        b, number, public = field_elements((conjugate(flow, _processor(s, g, n + 1)) if any(g) else flow).log())
        step = problem.step(n, b, number)
        residuals, term = (None, None) if changes is None else changes.step(n)
        violating = min((step.breaks[k] for k in failing(step.residuals, residuals)), default=None)
        if violating is not None:
            order = n
            break
        if next(failing(list(step.term.values()), term), None) is None:
            continue  # it counts as zero
        for tree, value in step.term.items():
            # of a method in decimals rounded to ten digits more than it has
            g[tree] = public(value) if unit is None else Fraction(round(public(value) * unit), unit)
        if changes is not None:
            changes.choose(n, g)
    breaks = None if violating is None else table[violating]
    return ConjugateVerdict(order, breaks, table.max_order, _processor(s, g, table.max_order))


class _Changes:
    """Changes of the equations of `_solve` with the entries of a method in decimals, to first order."""

    def __init__(self, s: BSeries, problem: EffectiveOrder | ConjugateSymplectic):
        import numpy as np

        self._problem, self._table, field = problem, s.table, s.log()
        assert field.uncertainty is not None
        values = np.array([to_float(x) for x in field.coefficients()])
        self._field = self._conjugated = np.column_stack([values, field.uncertainty.changes])
        self._processor = np.zeros_like(self._field)

    def step(self, n: int) -> tuple[list[float], list[float]]:
        """The uncertainties of the residuals and of the term g_n: both depend linearly on the field."""
        import numpy as np

        rows = list(self._conjugated[:, 1:])
        step = self._problem.step(n, rows, float)
        residuals, term = (
            np.array([np.broadcast_to(x, rows[0].shape) for x in found]).reshape(-1, len(rows[0]))
            for found in (step.residuals, step.term.values())
        )
        self._term = term
        return worst_case(residuals), worst_case(term)

    def choose(self, n: int, g: Sequence[Coefficient]) -> None:
        """Continue with the term g_n that `step` found."""
        ids = self._table.ids(n)
        self._processor[ids.start : ids.stop, 0] = [to_float(x) for x in g[ids.start : ids.stop]]
        self._processor[ids.start : ids.stop, 1:] = self._term
        self._conjugated = conjugated(self._table, self._field, self._processor)


def _inconsistent(flow: BSeries) -> int | None:
    """The first single node whose coefficient is not 1."""
    nodes = range(flow.table.colors)
    return next((node for node in nodes if flow.stored[node] != 1 and not flow.may_be(node, 1)), None)


def _processor(s: BSeries, g: Sequence[Coefficient], order: int) -> BSeries:
    """The flow exp g on the trees of a series, up to some order."""
    table = s.truncate(order).table
    return BSeries(table, make_values(table, g[: len(table)]), 0, names=s.names).exp()


class ProcessorTerm(NamedTuple):
    """The term of g with n nodes, the residuals of the equations with n + 1 nodes, and the tree of each residual."""

    term: dict[int, Any]
    residuals: Sequence[Any]
    breaks: list[int]


def solve_triangular(
    unknowns: Iterable[Key],
    pivot: Callable[[Key], Key],
    equation: Callable[[Key], Mapping[Key, int]],
    right_side: Callable[[Key], Element],
    known: Mapping[Key, Element],
    number: Number,
) -> dict[Key, Element]:
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
        left, right = self.table.lists.left[tree], self.table.lists.right[tree]
        found: Counter[int] = Counter()
        if left < 0:
            return found
        if self.table.lists.right[right] < 0:
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

    def step(self, n: int, b: Sequence[Element], number: Number) -> ProcessorTerm:
        """Solve for g_n, given b at all trees with up to n + 1 nodes; g₁ is 0 at the first leaf."""
        known = {0: number(Fraction(0))} if n == 1 else {}
        trees, larger = self._table.ids(n), self._table.ids(n + 1)
        term = solve_triangular(trees, self._leaves.add, self._equation, b.__getitem__, known, number)
        residuals = [b[tree] - _sum(self._equation(tree), term, number) for tree in larger]
        return ProcessorTerm(term, residuals, list(larger))

    def _equation(self, tree: int) -> Counter[int]:
        factors = Counter(self._leaves.without(tree))
        if self._table.lists.left[tree] < self._table.colors:
            factors[self._table.lists.right[tree]] -= 1
        return factors


def _sum(factors: Mapping[Key, int], values: Mapping[Key, Element], number: Number) -> Any:
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
            keys = self._keys[self._columns.order[tree]]
            if self._roots.flips and color[tree] == 0:
                keys[tree,] = tree, self._roots.flipped[tree]
            if left[tree] >= 0 and not (self._roots.flips and color[left[tree]] == color[right[tree]]):
                keys.setdefault(_pair(left[tree], right[tree]), (tree, turned))

    def step(self, n: int, b: Sequence[Element], number: Number) -> ProcessorTerm:
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
        *others, last = sorted(key, key=self._leaves.count)
        return tuple(sorted((*others, self._leaves.add(last))))

    def _equation(self, key: tuple[int, ...]) -> Counter[tuple[int, ...]]:
        if len(key) == 1:
            return Counter({(tree,): multiplicity for tree, multiplicity in self._leaves.without(key[0]).items()})
        factors: Counter[tuple[int, ...]] = Counter()
        for u, v in (key, key[::-1]):
            for smaller, multiplicity in self._leaves.without(u).items():
                factors[_pair(smaller, v)] += multiplicity
        return factors

    def _lifted(self, trees: range, found: Mapping[tuple[int, ...], Element], number: Number) -> dict[int, Element]:
        """A field g with these ρ and δ: zero at the representative of every free tree (if g is free there)."""
        roots = self._roots
        _, color, left, right = self._columns
        values: dict[int, Element] = {}

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


CONJUGATE_STRUCTURES = (
    Structure(("conjugate_symplectic",), conjugate_symplecticity),
    Structure(("effective_order",), effective_order),
)
"""Tests of `check` for the structure of conjugate methods."""
