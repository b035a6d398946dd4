"""Structure of methods and series: each test gives the order up to which it holds, and the first violating tree.

A structure is decided for all fields of its class at once, not for one particular system. Smaller classes of fields
have series on restricted tables; methods for special systems, with their own `max_children`, are decided on those.
Properties that a tableau decides for every order are in `RungeKutta` and `PartitionedRungeKutta`.

All conditions are linear in the field b = log a: b preserves a structure to order k if and only if the flow does. For
symplecticity the conditions on the flow itself differ by products a(u) a(v) only, and need no logarithm.

Colours have two meanings (see `trees.free_trees`): parts of a sum of fields, each with the structure in question, and
blocks p and q of the variables of one field that has it. A block by itself has no structure, so coefficients must not
depend on the colour of the root; in separable systems, p' = f(q) and q' = g(p), blocks are parts.

On restricted tables, such as that of Nyström systems, moving the root may give trees outside the table. Their
elementary differentials vanish and their coefficients are arbitrary: conditions are listed on all trees and these
coefficients eliminated.

A new structure needs the rows of its conditions, its test, and an entry in `STRUCTURES`; `check` reads that table.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import compress, count
from typing import Any, Literal, NamedTuple, TypeAlias

from bseries.algebra.bseries import BSeries
from bseries.algebra.series import check_field
from bseries.algebra.stages import auxiliary_colors
from bseries.algebra.uncertainty import worst_case
from bseries.analysis.order import Verdict, accuracy_of, decidable, field_of, flow_of, series_of, verdict
from bseries.exact.domains import to_float
from bseries.exceptions import SeriesError
from integrators.core.arguments import canonical_names
from integrators.exact.polynomials import to_flint
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from trees.counting import normal_limits
from trees.free_trees import grafting, is_separable, rootings
from trees.table import TreeTable, tree_table

Coloring: TypeAlias = Literal["blocks", "parts"] | None
Row: TypeAlias = tuple[dict[int, int], int, int]


NO_PRODUCT = -1
SEPARABLE = ((0, None), (None, 0))


class StructureConditions:
    """Conditions Σ factor · b(tree) = 0 on a field, or Σ factor · a(tree) = a(u) a(v) on a flow.

    All trees of one condition have the same number of nodes, that of u and v together.

    Args:
        rows: For each condition its factors by tree, and the ids of u and v, both `NO_PRODUCT` if there are none.
    """

    def __init__(self, rows: Iterable[Row]):
        import numpy as np

        starts, trees, factors, pairs = [0], list[int](), list[int](), list[tuple[int, int]]()
        self.breaks: list[int] = []
        """The first tree of each condition."""
        self._norm = 0
        for row, u, v in rows:
            trees += row.keys()
            factors += row.values()
            starts.append(len(trees))
            pairs.append((u, v))
            self.breaks.append(min(row))
            self._norm = max(self._norm, sum(map(abs, row.values())))
        self.start, self.trees, self.factors = (np.array(x, np.int64) for x in (starts, trees, factors))
        whole = np.array(pairs, np.int64).reshape(-1, 2)
        self._paired = np.flatnonzero(whole[:, 0] >= 0)
        self._first, self._second = np.ascontiguousarray(whole[self._paired].T)

    def residuals(self, values: Any, *, flow: bool) -> list[Any]:
        """Left minus right side of every condition.

        Args:
            values: A coefficient for each tree: numbers in a list, or an int64 array. Arrays, and numbers of a flow,
                may include a factor L^n for n nodes.
            flow: Whether the coefficients are those of a flow.
        """
        import numpy as np

        if not self.breaks:
            return []
        if isinstance(values, list):
            values = np.fromiter(values, object, len(values))
        else:
            largest = max(int(values.max(initial=0)), -int(values.min(initial=0)))
            if largest * self._norm + flow * largest**2 >= 2**63:
                values = values.astype(object)
        sums = np.add.reduceat(values[self.trees] * self.factors, self.start[:-1])
        if flow:
            sums[self._paired] -= values[self._first] * values[self._second]
        return sums.tolist()

    def uncertainties(self, s: BSeries, *, flow: bool) -> list[float]:
        """The uncertainties of the residuals of a series in decimals."""
        import numpy as np

        uncertainty: Any = s.uncertainty
        if not self.breaks:
            return []
        start, factors = self.start[:-1], self.factors
        changes = np.add.reduceat(uncertainty.changes[self.trees] * factors[:, None], start)
        rest = np.add.reduceat(uncertainty.rest[self.trees] * abs(factors), start)
        if flow:  # the product of a(u) + δ(u) and a(v) + δ(v)
            values = np.array([to_float(x) for x in s.coefficients()])
            errors = np.array(worst_case(uncertainty.changes, uncertainty.rest))
            u, v = self._first, self._second
            first, second = uncertainty.changes[u] * values[v, None], uncertainty.changes[v] * values[u, None]
            changes[self._paired] -= first + second
            rest[self._paired] += abs(values[u]) * uncertainty.rest[v] + abs(values[v]) * uncertainty.rest[u]
            rest[self._paired] += errors[u] * errors[v]
        return worst_case(changes, rest)


def cached_conditions(
    build: Callable[[TreeTable, bool], Iterator[Row]],
) -> Callable[[TreeTable, bool], StructureConditions]:
    """Decorate a generator of rows as a function that returns the conditions on a table with blocks or parts."""

    @lru_cache(maxsize=8)
    def conditions(table: TreeTable, blocks: bool) -> StructureConditions:
        return StructureConditions(build(table, blocks))

    return conditions


def is_complete(table: TreeTable) -> bool:
    """Whether a table holds all trees up to its order."""
    return table.limits == normal_limits(table.colors, None)


def closure(table: TreeTable, blocks: bool, *, more: int = 0) -> TreeTable:
    """The smallest family of trees that contains a table and is closed under moving the root, to `more` nodes."""
    if blocks and not is_separable(table) and not is_complete(table):
        raise restricted_table_error(table, "all trees up to its order, or trees of separable systems")
    limits = SEPARABLE if is_separable(table) else None
    return tree_table(table.max_order + more, table.colors, limits)


def restricted_table_error(table: TreeTable, needed: str) -> SeriesError:
    """The error for a restricted table."""
    return SeriesError(f"series must be on a table that holds {needed}, but was on {table!r}")


def ids_within(table: TreeTable, whole: TreeTable) -> dict[int, int]:
    """A table's own ids of its trees, by their ids in a larger table."""
    if table.limits == whole.limits:
        return {tree: tree for tree in range(len(table))}
    product, places = grafting(whole), list(range(table.colors))
    for left, right in zip(*table.lists[2:], strict=True):
        if left >= 0:
            places.append(product(places[left], places[right]))
    return {place: tree for tree, place in enumerate(places)}


def decide(conditions: StructureConditions, s: BSeries, *, flow: bool = False) -> Verdict:
    """Decide conditions on a series."""
    if s.uncertainty is None:
        residuals, bounds = conditions.residuals(s.stored.homogeneous(flow=flow), flow=flow), None
    else:
        values = list(map(to_flint, s.stored.coefficients()))
        residuals, bounds = conditions.residuals(values, flow=flow), conditions.uncertainties(s, flow=flow)
    violating = min((conditions.breaks[k] for k in failing(residuals, bounds)), default=None)
    return verdict(s.table, violating)


def failing(residuals: Sequence[Any], bounds: Sequence[float] | None) -> Iterator[int]:
    """Indices of residuals that are not zero; of a series in decimals, not within its uncertainty."""
    for k in compress(count(), residuals):
        if bounds is None or abs(residuals[k]) > to_flint(Fraction(bounds[k])):
            yield k


def block_names(names: Sequence[str]) -> tuple[str, str] | None:
    """The names of momenta and of positions, if two colours are blocks of them by their names."""
    return canonical_names(names) if len(names) == 2 else None


def has_blocks(s: BSeries, colors_are: Coloring) -> bool:
    """Whether the colours of a series are blocks of variables; by default if their names say so."""
    if colors_are not in (None, "blocks", "parts"):
        raise SeriesError(f"colors_are must be 'blocks' or 'parts', but was {colors_are!r:.60}")
    if colors_are == "blocks" and s.table.colors != 2:
        raise SeriesError(f"colors_are must be 'parts' unless there are two colours, but there are {s.table.colors}")
    return block_names(s.names) is not None if colors_are is None else colors_are == "blocks"


def accuracy(method: Method | BSeries | str, order: int | None = None) -> Verdict:
    """Order of agreement with the exact flow: the order of accuracy, decided by trees.

    Arguments and errors are those of `symplecticity`. If a tree violates it, the verdict has the order of the method.

    Example:
        >>> import bseries as bs
        >>> bs.analysis.accuracy("rk4", 6)[:2]
        (4, Tree('[[[[τ]]]]'))

    References:
        HLW, theorem III.1.5. `order_of` needs no trees where simplifying assumptions suffice.
    """
    method = as_method(method)
    s = series_of(method, order)
    return accuracy_of(s, frozenset() if isinstance(method, BSeries) else auxiliary_colors(method))


@cached_conditions
def symmetry_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """b(τ) = 0 for every tree with an even number of nodes."""
    for n in range(2, table.max_order + 1, 2):
        for tree in table.ids(n):
            yield {tree: 1}, NO_PRODUCT, NO_PRODUCT


def symmetry(method: Method | BSeries | str, order: int | None = None) -> Verdict:
    """Order to which a method is symmetric, equal to its adjoint.

    The modified equation of a symmetric method contains even powers of h only: trees with odd numbers of nodes.

    Arguments and errors are those of `symplecticity`.

    Example:
        >>> import bseries as bs
        >>> bs.symmetry("trapezoidal", 6).holds, bs.symmetry("heun2", 6).order
        (True, 3)

    References:
        HLW, theorems II.3.2 and IX.2.2.
    """
    field = flow_of(method, order).log()
    return decide(symmetry_conditions(field.table, False), field)


@cached_conditions
def hamiltonian_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """b(u ∘ v) + b(v ∘ u) = 0, for flows a(u ∘ v) + a(v ∘ u) = a(u) a(v); for blocks where the roots differ in colour.

    One pair (u, v) for each tree suffices (see `trees.free_trees`). On a restricted table conditions are for fields.
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


def _root_colors(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """For blocks: coefficients do not depend on the colour of the root."""
    if blocks and not is_separable(table):
        roots = rootings(table, blocks=blocks)
        for tree, other in enumerate(roots.flipped):
            if tree < other:
                yield {tree: 1, other: -1}, NO_PRODUCT, NO_PRODUCT


def _restricted_hamiltonian(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """b(τ) = ±b(θ) where moving the root changes τ to θ through pairs (u, v) of the table and any trees u ∘ v."""
    whole = closure(table, blocks)
    roots, within = rootings(whole, blocks=blocks), ids_within(table, whole)
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


def symplecticity(method: Method | BSeries | str, order: int | None = None, *, colors_are: Coloring = None) -> Verdict:
    """Order to which a method is symplectic on Hamiltonian systems, and conserves quadratic invariants of any system.

    The conditions are a(u ∘ v) + a(v ∘ u) = a(u) a(v) for all trees u and v. Where colours are blocks they apply to
    roots u in p and v in q, and a must not depend on the colour of the root; the invariants are those of the form
    pᵀ E q. On the trees of separable systems the second condition is void.

    Args:
        method: A method, or a flow.
        order: The largest number of nodes; by default the order of a series, and for a method that of `check`.
        colors_are: ``"blocks"`` p and q of the variables of one Hamiltonian system, or ``"parts"`` of a sum of
            Hamiltonian systems, f = Σ f^[ν]. By default blocks if two colours are called p and q, or v and x.

    Raises:
        SeriesError: `method` is neither a method nor a flow, `order` exceeds the order of the series, or colours are
            blocks on a restricted table of trees that are not those of separable systems.

    Example:
        >>> import bseries as bs
        >>> bs.symplecticity("implicit-midpoint", 8).holds, bs.symplecticity("radau-iia2", 8).order
        (True, 3)
        >>> bs.symplecticity("stormer-verlet", 5).holds
        True

    References:
        HLW, section VI.7 (quadratic invariants first, symplecticity from them; B-series, then P-series).
        A. L. Araújo, A. Murua, J. M. Sanz-Serna, SIAM J. Numer. Anal. 34 (1997), 1926–1947 (parts).
    """
    flow = flow_of(method, order)
    table, blocks = flow.table, has_blocks(flow, colors_are)
    conditions = hamiltonian_conditions(table, blocks)
    if closure(table, blocks) == table:
        return decide(conditions, flow, flow=True)
    return decide(conditions, flow.log())


def hamiltonian_field(field: BSeries, order: int | None = None, *, colors_are: Coloring = None) -> Verdict:
    """Order to which a field is Hamiltonian for all Hamiltonian f: b(u ∘ v) + b(v ∘ u) = 0.

    Arguments and errors are those of `symplecticity`, but for a field series, such as a modified equation.

    Example:
        >>> import bseries as bs
        >>> bs.hamiltonian_field(bs.modified_equation("gauss2", 7)).holds
        True
        >>> bs.hamiltonian_field(bs.modified_equation("lobatto-iiia3", 7))[:2]
        (4, Tree('[τ,[[τ]]]'))

    References:
        HLW, section IX.9 on elementary Hamiltonians, section IX.10 for blocks.
    """
    check_field(field, "field")
    s = decidable(field, order)
    return decide(hamiltonian_conditions(s.table, has_blocks(s, colors_are)), s)


@cached_conditions
def energy_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """The conditions of `energy_preservation`.

    The derivative of H along F(τ) is the Hamiltonian of [τ], and Σ b(τ)/σ(τ) H([τ]) is summed by free trees, with the
    number of automorphisms of T as common denominator. For parts, H = Σ H^[ν], the new root has any colour; for blocks
    its colour differs from that of the root of τ.
    """
    larger = closure(table, blocks, more=1)
    roots, within = rootings(larger, blocks=blocks), ids_within(table, closure(table, blocks))
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


def energy_preservation(
    method: Method | BSeries | str, order: int | None = None, *, colors_are: Coloring = None
) -> Verdict:
    """Order to which a method conserves H on all systems y' = J ∇H(y) with a constant skew matrix J.

    With b the modified equation, Σ ± b(T without a leaf, rooted next to it) = 0 over the leaves of every free tree T
    that is not superfluous.

    Arguments and errors are those of `symplecticity`, and `method` may be a field. Blocks: p' = −H_q, q' = H_p. Parts:
    f = Σ J ∇H^[ν], and the sum of all H^[ν] is conserved.

    Example:
        >>> import bseries as bs
        >>> bs.energy_preservation("implicit-midpoint", 7)[:2]
        (2, Tree('[τ,τ]'))

    References:
        E. Faou, E. Hairer, T.-L. Pham, BIT 44 (2004), 699–709; HLW, section IX.9.
        E. Celledoni, R. I. McLachlan, B. Owren, G. R. W. Quispel, Found. Comput. Math. 10 (2010), 673–693,
        doi:10.1007/s10208-010-9073-1.
    """
    return _decide_field(energy_conditions, method, order, colors_are)


@cached_conditions
def volume_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """The conditions of `volume_preservation`.

    The divergence of F(τ) is a sum over the nodes of τ: an edge from the node to the root closes a cycle, with a tree
    attached to each of its nodes. A cycle of one node is a derivative of div f = 0.
    """
    closure(table, blocks)  # raises for blocks on other restricted tables
    product = grafting(table)
    order = table.lists.order
    words: list[dict[tuple[int, ...], int]] = [{}]  # by number of nodes: cycles cut open, and the resulting tree
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
            # If a rotation is missing, a node has too many children and the cycle vanishes.
            if word == min(rotations) and rotations <= words[n].keys():
                yield Counter(words[n][rotation] for rotation in rotations), NO_PRODUCT, NO_PRODUCT
    yield from _root_colors(table, blocks)


def volume_preservation(
    method: Method | BSeries | str, order: int | None = None, *, colors_are: Coloring = None
) -> Verdict:
    """Order to which a method preserves volume for all divergence-free systems.

    With b the modified equation, Σ b(u₁ ∘ (u₂ ∘ (… ∘ u_m))) = 0 over the rotations of every cycle of m ≥ 2 trees.

    For one field f only the B-series of the exact flow (of a multiple of f) satisfies all conditions: the order is that
    of accuracy. Splitting methods, compositions of the exact flows of divergence-free parts, satisfy them, and no other
    series does. In separable systems, p' = f(q) and q' = g(p), both blocks are such parts. Symplectic methods preserve
    volume for Hamiltonian systems; that is a smaller class of systems, not tested here.

    Arguments and errors are those of `symplecticity`, and `method` may be a field. Blocks: the whole field is
    divergence-free. Parts: each f^[ν] is.

    Example:
        >>> import bseries as bs
        >>> bs.volume_preservation("gauss2", 6).order, bs.volume_preservation(bs.exact_flow(6)).holds
        (4, True)
        >>> separable = bs.series("symplectic-euler-p", 6, max_children=[[0, None], [None, 0]])
        >>> bs.volume_preservation(separable).holds, bs.volume_preservation("symplectic-euler-p", 3).order
        (True, 1)

    References:
        A. Iserles, G. R. W. Quispel, P. S. P. Tse, BIT 47 (2007), 351–378.
        P. Chartier, A. Murua, IMA J. Numer. Anal. 27 (2007), 381–405, doi:10.1093/imanum/drl039.
    """
    return _decide_field(volume_conditions, method, order, colors_are)


@cached_conditions
def cubic_conditions(table: TreeTable, blocks: bool) -> Iterator[Row]:
    """The conditions of `cubic_invariants`, with u ∘ v ∘ w = (u ∘ v) ∘ w.

    For an invariant I of degree 3, derivatives of I' f = 0 reduce I' F(τ) to terms I''(F(u), F(v)) and
    I'''(F(u), F(v), F(w)); these are their coefficients.
    """
    if not is_complete(table):
        raise restricted_table_error(table, "all trees up to its order")
    product, order, last = grafting(table), table.lists.order, table.max_order
    ends = [0, *(table.ids(n).stop for n in range(1, last + 1))]  # of the trees with up to n nodes
    for u in range(len(table)):
        for v in range(u, ends[last - order[u]]):
            pair, other = product(u, v), product(v, u)
            yield Counter((pair, other)), NO_PRODUCT, NO_PRODUCT
            for w in range(v, ends[last - order[u] - order[v]]):
                third = product(product(w, u), v)
                yield Counter((product(pair, w), product(other, w), third)), NO_PRODUCT, NO_PRODUCT
    yield from _root_colors(table, blocks)


def cubic_invariants(
    method: Method | BSeries | str, order: int | None = None, *, colors_are: Coloring = None
) -> Verdict:
    """Order to which a method conserves all polynomial invariants of degree up to three.

    With b the modified equation, b(u ∘ v) + b(v ∘ u) = 0 and b(u ∘ v ∘ w) + b(v ∘ w ∘ u) + b(w ∘ u ∘ v) = 0.

    For one field f only the B-series of the exact flow (of a multiple of f) satisfies all conditions; for a sum of
    fields that share the invariants, only compositions of their exact flows do. So a series that conserves cubic
    invariants conserves invariants of every degree.

    Arguments and errors are those of `symplecticity`, and `method` may be a field, on a table that is not restricted.
    Blocks: the whole field has the invariant. Parts: each f^[ν] has it.

    Example:
        >>> import bseries as bs
        >>> bs.analysis.cubic_invariants("gauss3", 7)[:2]
        (6, Tree('[[[τ]],[[τ]]]'))

    References:
        P. Chartier, A. Murua, IMA J. Numer. Anal. 27 (2007), 381–405, doi:10.1093/imanum/drl039.
    """
    return _decide_field(cubic_conditions, method, order, colors_are)


def _decide_field(
    conditions: Callable[[TreeTable, bool], StructureConditions],
    method: Method | BSeries | str,
    order: int | None,
    colors_are: Coloring,
) -> Verdict:
    """The verdict of conditions on the modified equation of a method, or on a field."""
    field = field_of(method, order)
    return decide(conditions(field.table, has_blocks(field, colors_are)), field)


class Structure(NamedTuple):
    """A structure test of `check`: the names of its verdict in reports, and whether it needs the field or the flow."""

    names: tuple[str, ...]
    test: Callable[[BSeries], object]
    of_field: bool = False


STRUCTURES = (
    Structure(("symmetric",), symmetry),
    Structure(("symplectic", "quadratic_invariants"), symplecticity),
    Structure(("hamiltonian",), hamiltonian_field, of_field=True),
    Structure(("energy_preserving",), energy_preservation, of_field=True),
    Structure(("cubic_invariants",), cubic_invariants, of_field=True),
    Structure(("volume_preserving",), volume_preservation, of_field=True),
)
"""Structure tests in the order of reports; those of conjugate methods follow."""
