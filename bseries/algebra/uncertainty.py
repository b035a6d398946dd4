"""Uncertainties of coefficients of methods published as decimals.

An entry with d significant digits may be any number within half a unit of its d-th digit; zeros are exact, and equal
entries may differ. A coefficient is a polynomial in the entries x_e. It may differ from that of the true entries by

    Σ_e |∂ coefficient/∂ x_e| · δ_e + R,    δ_e half a unit, R ≤ n(n−1)/2 · ε² (1 + ε)^(n−2) · M,    ε = max δ_e/|x_e|.

The sum is the worst case to first order, which entries can reach. The derivatives are exact: the recursions run on dual
numbers, in floats. R bounds the terms of higher order, which matter for few digits: each coefficient of a tree with n
nodes is homogeneous of degree n in the entries, and M is the same polynomial with absolute values. Numbers that depend
linearly on coefficients have the worst case of the same linear combination of `changes`; so do linear parts of others.

Coefficients of other programs than tableaus and splittings are made of published numbers by products and sums. They
count as known to a relative error of 5 · 10^−d, the largest of numbers with d digits, and whole ones as exact; R is an
estimate there. For modifying integrators, which are no polynomials, it is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property, partial
from itertools import pairwise
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.algebra.stages import FloatStages, FlowChain, MethodStages, StageRows
from bseries.exact.domains import to_float
from bseries.exact.recursions import Stages
from bseries.exceptions import SeriesError
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.exact.entries import half_unit
from integrators.methods.programs.program import Method, mapped_program
from trees.basis import Basis
from trees.table import TreeTable
from trees.words import Words

if TYPE_CHECKING:
    import numpy as np

    Array = np.ndarray[Any, Any]
    """Dual numbers: along the last axis values, then their changes with each entry."""

LARGEST_ARRAY = 2**22
"""Changes with all entries are computed at once up to this size of arrays, otherwise with some entries at a time."""
CHANGE = 2.0**-20
"""Of the entries, relative: balances the errors of central differences with those of rounding."""
MOST_DIGITS = 250
"""Further digits do not count: the smallest doubles are near 1e-308."""
ROUNDING = 1 + 2.0**-30
"""Errors of entries are enlarged by this factor, since sums of floats may be a little too small."""


class Uncertainty:
    """Uncertainties of the coefficients of a series, by tree; the functions are called on first use.

    Args:
        nodes: The number of nodes of each tree.
        relative: ε, the largest relative error of an entry.
        changes: Gives ∂ coefficient/∂ x_e · δ_e, a row for each tree and a column for each entry.
        sizes: Gives M for each tree.
    """

    def __init__(self, nodes: Any, relative: float, changes: Callable[[], Array], sizes: Callable[[], Array]):
        self.nodes, self.relative, self._compute = nodes, relative, (changes, sizes)

    @cached_property
    def changes(self) -> Array:
        """The changes with each entry to first order: a row for each tree."""
        return _finite(self._compute[0])

    @cached_property
    def sizes(self) -> Array:
        """The polynomials of the coefficients with absolute values."""
        return _finite(self._compute[1])

    @cached_property
    def rest(self) -> Array:
        """Bounds on the terms of higher order."""
        import numpy as np

        n, relative = np.asarray(self.nodes, float), self.relative
        return n * (n - 1) / 2 * relative**2 * (1 + relative) ** np.maximum(n - 2, 0) * self.sizes

    @cached_property
    def _bounds(self) -> list[float]:
        return worst_case(self.changes, self.rest)

    def __call__(self, at: int) -> float:
        """The uncertainty of the coefficient of the tree with this id."""
        return self._bounds[at]

    def mapped(self, ids: Sequence[int], factors: Sequence[Any] | None = None) -> Uncertainty:
        """The uncertainty of coefficients taken from other trees, times factors."""
        import numpy as np

        at, scale = list(ids), np.array([float(x) for x in factors or [1] * len(ids)])
        changes, sizes = lambda: self.changes[at] * scale[:, None], lambda: self.sizes[at] * abs(scale)
        return Uncertainty(np.asarray(self.nodes)[at], self.relative, changes, sizes)

    def of_logarithm(self, basis: Basis[Any], flow: Callable[[], Sequence[Any]]) -> Uncertainty:
        """The uncertainty of log a from that of the flow a, given its coefficients."""

        def changes() -> Array:
            import numpy as np

            values = np.array([to_float(x) for x in flow()])[:, None]
            step = max(1, LARGEST_ARRAY // (len(basis.offsets) * basis.offsets[-2] + 1))
            parts = (self.changes[:, k : k + step] for k in range(0, max(self.changes.shape[1], 1), step))
            return np.hstack([logarithm(basis, np.hstack([values, part]))[:, 1:] for part in parts])

        sizes = lambda: logarithm(basis, self.sizes[:, None], sign=1)[:, 0]  # noqa: E731
        return Uncertainty(self.nodes, self.relative, changes, sizes)

    def __reduce__(self) -> tuple[Any, ...]:
        return _known, (self.nodes, self.relative, self.changes, self.sizes)


def _known(nodes: Any, relative: float, changes: Array, sizes: Array) -> Uncertainty:
    return Uncertainty(nodes, relative, lambda: changes, lambda: sizes)


def _finite(compute: Callable[[], Array]) -> Array:
    """Results of floats, unless some overflowed."""
    import numpy as np

    with np.errstate(all="ignore"):
        found = compute()
    if not np.isfinite(found).all():
        raise SeriesError("coefficients must stay within the range of floats, but some overflowed")
    return found


def of_errors(errors: Sequence[float]) -> Uncertainty:
    """The uncertainty of coefficients with these errors, which are independent."""
    import numpy as np

    return _known(np.ones(len(errors)), 0.0, np.diag(errors), np.zeros(len(errors)))


def worst_case(changes: Array, rest: Array | float = 0.0) -> list[float]:
    """The largest changes of numbers whose changes with each entry are the rows."""
    return (abs(changes).sum(-1) + rest).tolist()


def uncertainty_of(method: Method, inputs: MethodStages | FlowChain, table: Any) -> Uncertainty:
    """The uncertainty of the series of a method in decimals on a table."""
    nodes = table.order
    if isinstance(inputs, FlowChain):
        times, errors = _times(inputs, method.digits or 0)
        changes, sizes = (
            partial(_chain_changes, inputs, times, errors, table),
            partial(_chain_sizes, inputs, times, table),
        )
        return Uncertainty(nodes, _relative(times, errors), changes, sizes)
    entries = _entries(method, inputs, table.max_order)
    changes, sizes = partial(_weight_changes, entries, table), partial(_weight_sizes, entries, table)
    return Uncertainty(nodes, entries.relative, changes, sizes)


def rough_series(method: Method, inputs: MethodStages | FlowChain, table: Any) -> tuple[Array, Array]:
    """The coefficients of a method in floats, and the same polynomials with absolute values."""
    if isinstance(inputs, FlowChain):
        times = _times(inputs, 1)[0]
        return _chain(inputs, times, [], table)[:, 0], _chain_sizes(inputs, times, table)
    entries = _entries(method, inputs, table.max_order)
    return _weights(entries, table, range(0))[:, 0], _weight_sizes(entries, table)


def by_differences(
    method: Method, stages: MethodStages, table: TreeTable, coefficients: Callable[[MethodStages], Sequence[float]]
) -> Uncertainty:
    """The uncertainty of a function of the stages, to first order, from its central differences with each entry."""

    def changes() -> Array:
        import numpy as np

        entries, columns = _entries(method, stages, table.max_order), []
        for e in range(entries.number):
            scale = CHANGE / entries.relative
            da, db = (entries.dense(x, y.shape, range(e, e + 1))[..., 0] * scale for x, y in entries.both)
            up, down = (
                coefficients(FloatStages(stages.stages.with_entries(a.ravel().tolist(), b.ravel().tolist())))
                for a, b in ((entries.a + da, entries.b + db), (entries.a - da, entries.b - db))
            )
            columns.append((np.array(up) - np.array(down)) / (2 * scale))
        return np.array(columns).T.reshape(len(table), -1)

    sizes = table.arrays.order * 0.0
    return Uncertainty(table.arrays.order, 0.0, changes, lambda: sizes)


def _entries(method: Method, stages: MethodStages, order: int) -> Entries:
    if isinstance(method, RungeKutta | PartitionedRungeKutta):
        return _tableau_entries(method, stages.stages)
    return _program_entries(method, order)


def _error(x: Any, digits: int) -> float:
    """Half a unit of the last digit of an entry."""
    return ROUNDING * float(half_unit(Fraction(x), min(digits, MOST_DIGITS)))


def _relative(values: Sequence[float], errors: Sequence[float]) -> float:
    return max((e / abs(x) for x, e in zip(values, errors, strict=True) if x), default=0.0)


class Entries(NamedTuple):
    """The stages of a method in floats, and their changes with its entries.

    Attributes:
        a, b: Matrices and weights, with an axis for colours in front.
        changes_a, changes_b: Triples (place, entry, change), by place in the flattened a and b.
        number: The number of entries of the method.
        relative: The largest relative error of an entry.
        blocks: The first components of the blocks of stages, and their number.
    """

    a: Array
    b: Array
    changes_a: list[tuple[int, int, float]]
    changes_b: list[tuple[int, int, float]]
    number: int
    relative: float
    blocks: Sequence[int]

    @property
    def both(self) -> tuple[tuple[list[tuple[int, int, float]], Array], ...]:
        """The changes of a and b with what they change."""
        return (self.changes_a, self.a), (self.changes_b, self.b)

    def dense(self, changes: Sequence[tuple[int, int, float]], shape: tuple[int, ...], columns: range) -> Array:
        """The changes with some entries, as an array."""
        import numpy as np

        found = np.zeros((math.prod(shape), len(columns)))
        for place, e, change in changes:
            if e in columns:
                found[place, e - columns.start] = change
        return found.reshape(*shape, len(columns))


def _tableau_entries(method: RungeKutta | PartitionedRungeKutta, stages: Stages) -> Entries:
    """The entries of tableaus; each part has its own number of digits."""
    import numpy as np

    size, digits = stages.size, [part.digits for part in method.partitions]
    found: list[list[tuple[int, int, float]]] = []
    count, relative = 0, 0.0
    for numbers, length in ((stages.a, size * size), (stages.b, size)):
        found.append([])
        for place, x in enumerate(numbers):
            known = digits[place // length]
            if x and known is not None:
                found[-1].append((place, count, error := _error(x, known)))
                count, relative = count + 1, max(relative, error / abs(to_float(x)))
    a, b = (np.array([to_float(x) for x in numbers]) for numbers in (stages.a, stages.b))
    return Entries(a.reshape(-1, size, size), b.reshape(-1, size), found[0], found[1], count, relative, range(size + 1))


class _Dual:
    """A float and its changes with the entries of a method."""

    __slots__ = ("changes", "value")

    def __init__(self, value: float, changes: dict[int, float]):
        self.value, self.changes = value, changes

    def __add__(self, other: Any) -> _Dual:
        if not isinstance(other, _Dual):
            return _Dual(self.value + float(other), self.changes)
        keys = self.changes | other.changes
        return _Dual(self.value + other.value, {k: self.changes.get(k, 0) + other.changes.get(k, 0) for k in keys})

    def __mul__(self, other: Any) -> _Dual:
        if not isinstance(other, _Dual):
            return _Dual(self.value * float(other), {k: x * float(other) for k, x in self.changes.items()})
        first, second = self * other.value, other * self.value
        return _Dual(first.value, (_Dual(0, first.changes) + _Dual(0, second.changes)).changes)

    __radd__, __rmul__ = __add__, __mul__


def _program_entries(method: Method, order: int) -> Entries:
    """The entries of a program."""
    import numpy as np

    count, relative = 0, ROUNDING * 5 * 10.0 ** -min(method.digits or 0, MOST_DIGITS)

    def dual(x: Any) -> Any:
        nonlocal count
        if x.denominator == 1:
            return x
        count += 1
        return _Dual(to_float(x), {count - 1: relative * abs(to_float(x))})

    evaluations, end = mapped_program(method.program, lambda form: form.map(dual), dual)
    rows: Any = StageRows(SimpleNamespace(evaluations=evaluations, result=end), order)  # type: ignore[arg-type]
    size, found, arrays = len(rows.rows), [], []
    for numbers in rows.flat(len(method.names)):
        duals = [(place, x) for place, x in enumerate(numbers) if isinstance(x, _Dual)]
        found.append([(place, e, change) for place, x in duals for e, change in x.changes.items()])
        arrays.append(np.array([x.value if isinstance(x, _Dual) else to_float(x) for x in numbers]))
    starts = [sum(rows.sizes[:k]) for k in range(len(rows.sizes) + 1)]
    a, b = arrays
    return Entries(a.reshape(-1, size, size), b.reshape(-1, size), found[0], found[1], count, relative, starts)


def _weight_changes(entries: Entries, table: TreeTable) -> Array:
    """The changes of the elementary weights of a method."""
    import numpy as np

    step = max(1, LARGEST_ARRAY // (table.offsets[-2] * entries.a.shape[-1] + 1))
    parts = (range(k, min(k + step, entries.number)) for k in range(0, max(entries.number, 1), step))
    return np.hstack([_weights(entries, table, columns)[:, 1:] for columns in parts])


def _weight_sizes(entries: Entries, table: TreeTable) -> Array:
    """The elementary weights of the absolute values."""
    return _weights(entries._replace(a=abs(entries.a), b=abs(entries.b)), table, range(0))[:, 0]


def _weights(entries: Entries, table: TreeTable, columns: range) -> Array:
    """The elementary weights with their changes with some entries, all trees of an order and colour at once."""
    import numpy as np

    size, colors, width = entries.a.shape[-1], table.colors, 1 + len(columns)
    changes_a = entries.dense(entries.changes_a, entries.a.shape, columns)
    changes_b = entries.dense(entries.changes_b, entries.b.shape, columns)
    _, _, left, right = table.arrays
    weight = np.zeros((len(table), width))
    stage, applied = (np.zeros((table.offsets[-2], size, width)) for _ in range(2))
    for k, (first, last) in enumerate(pairwise(table.block)):
        ids, color = slice(first, last), k % colors
        if k < colors:
            g = np.zeros((last - first, size, width))
            g[:, list(entries.blocks[:-1]), 0] = 1
        else:
            g = _block_product(stage[left[ids]], applied[right[ids]], entries.blocks)
        weight[ids] = np.einsum("j,nje->ne", entries.b[color], g)
        weight[ids, 1:] += g[..., 0] @ changes_b[color]
        if first < len(stage):
            stage[ids], applied[ids] = g, entries.a[color] @ g
            applied[ids, :, 1:] += np.tensordot(g[..., 0], changes_a[color], (1, 1))
    return weight


def _product(x: Array, y: Array) -> Array:
    """Products of dual numbers."""
    z = x * y[..., :1]
    z[..., 1:] += x[..., :1] * y[..., 1:]
    return z


def _block_product(x: Array, y: Array, blocks: Sequence[int]) -> Array:
    """Products of stages, which are polynomials modulo a power of their variable in each block."""
    import numpy as np

    if len(blocks) == x.shape[1] + 1:
        return _product(x, y)
    z = np.zeros_like(x)
    for first, last in pairwise(blocks):
        for k in range(first, last):
            z[:, k:last] += _product(x[:, k : k + 1], y[:, first : last - (k - first)])
    return z


def logarithm(basis: Basis[Any], flow: Array, sign: int = -1) -> Array:
    """The field b with exp b = a for a flow a; with sign = 1 the bound |a| + Σ_{j≥2} ∂_b^{j−1} b / j! instead.

    Order by order b = a − Σ_{j≥2} ∂_b^{j−1} b / j!, as in `recursions.logarithm`.
    """
    import numpy as np

    field = np.zeros_like(flow)
    rows = np.zeros((basis.offsets[-2], basis.max_order, flow.shape[-1]))  # ∂_b^{j−1} b, for j = 1, 2, …
    factors = np.array([sign / math.factorial(j) for j in range(2, basis.max_order + 1)])
    for first, last, trunks, branches in _cuts(basis, basis.max_order * flow.shape[-1]):
        n, ids = trunks.shape[1] + 1, slice(first, last)
        terms = np.zeros((last - first, n - 1, flow.shape[-1]))
        for trunk, branch in zip(trunks.T, branches.T, strict=True):
            terms += _product(rows[trunk, : n - 1], field[branch][:, None])
        field[ids] = flow[ids] + np.einsum("j,nje->ne", factors[: n - 1], terms)
        if last <= len(rows):
            rows[ids, 0], rows[ids, 1:n] = field[ids], terms
    return field


def derivative(basis: Basis[Any], along: Array, field: Array) -> Array:
    """The Lie derivative ∂_b c of a field c along a field b."""
    import numpy as np

    found = np.zeros_like(field)
    for first, last, trunks, branches in _cuts(basis, field.shape[-1]):
        for trunk, branch in zip(trunks.T, branches.T, strict=True):
            found[first:last] += _product(field[trunk], along[branch])
    return found


def conjugated(basis: Basis[Any], field: Array, processor: Array) -> Array:
    """The field of the method conjugated by exp g, Σ_j ad_g^j b / j! with ad_g b = ∂_g b − ∂_b g."""
    total = term = field
    for j in range(1, basis.max_order):
        term = (derivative(basis, processor, term) - derivative(basis, term, processor)) / j
        total = total + term
    return total


def _cuts(basis: Basis[Any], width: int) -> Any:
    """Trees first, …, last − 1 of one order with all their n − 1 cuts: trunks and branches, a row for each tree."""
    import numpy as np

    step = max(1, LARGEST_ARRAY // width)
    for cuts in basis.cut_chunks():
        trunk, branch = (np.asarray(x, np.uint32) for x in (cuts.trunk, cuts.branch))
        for n, (start, end) in enumerate(pairwise(basis.offsets), 1):
            for first in range(max(start, cuts.first), min(end, cuts.last), step):
                last = min(first + step, end, cuts.last)
                at = slice(cuts.start[first - cuts.first], cuts.start[last - cuts.first])
                yield first, last, trunk[at].reshape(last - first, n - 1), branch[at].reshape(last - first, n - 1)


def _times(flows: FlowChain, digits: int) -> tuple[list[float], list[float]]:
    """The times of flows and half a unit of the last digit of each."""
    return [to_float(x) for x in flows.times], [_error(x, digits) for x in flows.times]


def _chain_changes(flows: FlowChain, times: list[float], errors: list[float], table: Basis[Any]) -> Array:
    """The changes of the coefficients of a chain of flows with each time."""
    return _chain(flows, times, errors, table)[:, 1:]


def _chain_sizes(flows: FlowChain, times: list[float], table: Basis[Any]) -> Array:
    """The coefficients with the absolute values of the times."""
    return _chain(flows, [*map(abs, times)], [], table)[:, 0]


def _chain(flows: FlowChain, times: list[float], errors: list[float], table: Basis[Any]) -> Array:
    """The coefficients of a chain of flows, with their changes with each time that has an error.

    From the last flow to the first, a ↦ Σ_j t^j ∂_c^j a / j!, where ∂_c removes a leaf of the colour c of the flow. The
    derivative of this sum with t is its own Lie derivative ∂_c.
    """
    import numpy as np

    if isinstance(table, Words):
        return _chain_on_words(flows, times, errors, table)
    leaves = _leaf_cuts(table)

    def removed(values: Array, part: int | None) -> Array:
        found = np.zeros_like(values)
        for color in range(table.colors) if part is None else (part,):
            tree, start, rest = leaves[color]
            if len(tree):
                found[tree] += np.add.reduceat(values[rest], start)
        return found

    values = np.zeros((len(table) + 1, 1 + len(errors)))
    values[-1, 0] = 1  # the empty tree
    for k, e in enumerate(reversed(range(len(times))), 1):  # column k changes with the k-th flow from the end
        term = values[:, : k if errors else 1]
        total = term.copy()
        for j in range(1, table.max_order + 1):
            term = removed(term, flows.parts[e]) * (times[e] / j)
            total += term
        values[:, : total.shape[1]] = total
        if errors:
            values[:, k] = removed(total[:, :1], flows.parts[e])[:, 0] * errors[e]
    return values[:-1]


def _chain_on_words(flows: FlowChain, times: list[float], errors: list[float], words: Words) -> Array:
    """The same as `_chain`, by products of exponentials of letters."""
    import numpy as np

    found = np.zeros((1 + len(words), 1 + len(errors)))
    found[0, 0] = 1
    for e, (part, time) in enumerate(zip(flows.parts, times, strict=True)):
        for _, k, longer, rest in words.prefixes(part):
            found[longer] += time**k / math.factorial(k) * found[rest]
            if errors:
                found[longer, 1 + e] += time ** (k - 1) / math.factorial(k - 1) * errors[e] * found[rest, 0]
    return found[1:]


def _leaf_cuts(table: Basis[Any]) -> list[tuple[Array, Array, Array]]:
    """For each colour the trees with leaves of this colour, and what remains without one: start of each tree, rest."""
    import numpy as np

    trees: list[list[Array]] = [[np.array([color])] for color in range(table.colors)]
    rests: list[list[Array]] = [[np.array([len(table)])] for _ in range(table.colors)]
    for first, _, trunks, branches in _cuts(table, 1):
        for color in range(table.colors):
            row, k = np.nonzero(branches == color)
            trees[color].append(row + first)
            rests[color].append(trunks[row, k])
    found = []
    for tree, rest in zip(map(np.concatenate, trees), map(np.concatenate, rests), strict=True):
        unique, start = np.unique(tree, return_index=True)
        found.append((unique, start, rest.astype(np.int64)))
    return found
