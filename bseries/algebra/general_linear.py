"""The underlying one-step method and the starting procedure of a general linear method.

With a finishing procedure d · x, d · u = 1, there are unique series S_1 … S_r and Φ with GLM∘S = S∘Φ and d · S = id
(HLW, theorem XV.8.1). They are computed tree by tree with b = log Φ in place of Φ, so that S∘Φ = Σ ∂_b^j S / j! needs
no sums over subtrees.

Denominators and bounds, by number of nodes, follow the same recursion: slopes are products of values Y at n − 1 nodes
in all, and ∂_b^j S is made of products of j values of b and one of S.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any

from bseries.exact import bounds, domains, lie, memory_kernels
from bseries.exact.arithmetic import Exact, factorial_weights
from bseries.exact.bounds import ONE, Bound, product, scaled
from bseries.exact.domains import Values, converted, narrowest
from bseries.exact.rationals import Operation
from integrators.methods.kinds.memory import GeneralLinear
from trees.basis import Growth
from trees.table import TreeTable


class GeneralLinearInputs:
    """The matrices of a general linear method in one domain, which its series and the logarithm of that come from."""

    def __init__(self, method: GeneralLinear):
        self.stages, self.inputs = len(method.A), method.inputs
        matrices = (method.A, method.U, method.B, method.solver, (method.u,))
        flat = [x for matrix in matrices for row in matrix for x in row]
        self.kind, entries, self.ring, common = narrowest(flat)
        if self.kind == "ring":  # a field, so that the entries need no common denominator
            self.ring, own = self.ring.get_field(), self.ring
            divisor = converted(common, own, self.ring)
            entries = [converted(x, own, self.ring) / divisor for x in entries]
        rest = iter(entries)
        self._matrices = [[[next(rest) for _ in row] for row in matrix] for matrix in matrices]

    @cached_property
    def step(self) -> Any:
        """A common multiple of the denominators; 1 in a field."""
        if self.kind == "rational":
            return math.lcm(*(x.denominator for matrix in self._matrices for row in matrix for x in row))
        return self.ring.one if self.kind == "ring" else 1

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool = False) -> list[Any]:
        """The matrices A, U, B, the solver and u, flat."""
        return [arithmetic.vector([x for row in matrix for x in row]) for matrix in self._matrices]

    def logarithm(self, table: TreeTable) -> Values:
        """The modified equation."""
        return self._apply(table, self.inputs)

    def series(self, table: TreeTable) -> Values:
        """The series Φ = exp b."""
        return lie.exponential(self.logarithm(table))

    def starting(self, table: TreeTable) -> list[Values]:
        """The starting series S_i."""
        return [self._apply(table, i) for i in range(self.inputs)]

    def _apply(self, table: TreeTable, row: int) -> Values:
        """The series S_i, or b for i = r."""
        of_start = row < self.inputs

        def expression(arithmetic: Exact, matrices: Any) -> Any:
            starting, field = _solved(table, arithmetic, self.stages, self.inputs, matrices())
            return starting[row :: self.inputs] if of_start else field

        def bound(known: Bound) -> Bound:
            return self._bounds(table.growth, table.max_order, (ONE,) if of_start else known)[not of_start]

        def denominators(n: int, _: int) -> int:
            start, field = self._denominators(table.max_order)
            return start[row][n] if of_start else field[n]

        def step(order: int, _: int) -> int:
            return math.lcm(*(denominators(n, 1) for n in range(1, order + 1)))

        operation = Operation(expression, bound, denominators, step, units=2, passes=self.inputs)
        return domains.apply(table, [self], operation)

    def _largest(self, at: int, rows: slice = slice(None)) -> int:
        """The largest row sum of a matrix, as a bound."""
        return max(scaled(sum(map(abs, row), Fraction(0))) for row in self._matrices[at][rows])

    @lru_cache(maxsize=64)  # noqa: B019  # few inputs are kept, by `stages`
    def _denominators(self, order: int) -> tuple[list[list[int]], list[int]]:
        """Denominators of each S_i and of b, from those of the empty tree on."""
        a, u, b, solver, (vector,) = self._matrices
        start, field, cut = [[x.denominator] for x in vector], [1], [[1]]  # cut[j][n]: products of j values of b
        points: list[list[int]] = [[1] for _ in a]
        for n in range(1, order + 1):
            slopes = [1 if n == 1 else _common(row, n - 1) for row in points]
            cut[0].append(0)
            cut.append([0] * n)
            for j in range(2, n + 1):
                cut[j].append(math.lcm(*filter(None, (cut[j - 1][n - k] * field[k] for k in range(1, n)))))
            known = []
            for i, row in enumerate(b):
                pairs = ((j, m) for j in range(1, n + 1) for m in range(j, n + (j > 1)) if cut[j][m])
                terms = (math.factorial(j) * cut[j][m] * start[i][n - m] for j, m in pairs)
                known.append(math.lcm(_of_sum(row, slopes), *terms))
            found = [_of_sum(row, [*known, 1]) for row in solver]
            for row, x in zip([*start, field], found, strict=True):
                row.append(x)
            cut[1].append(field[n])
            for i, row in enumerate(points):
                row.append(math.lcm(_of_sum(a[i], slopes), _of_sum(u[i], found[:-1])))
        return start, field

    @lru_cache(maxsize=64)  # noqa: B019
    def _bounds(self, growth: Growth, order: int, known: Bound) -> tuple[Bound, Bound]:
        """Bounds on the S_i and on b; `known` bounds |b| at the smallest trees more sharply."""
        a, u, b = map(self._largest, range(3))
        vector = max(scaled(abs(x)) for x in self._matrices[4][0])
        of_start, of_field = (self._largest(3, part) for part in (slice(-1), slice(-1, None)))
        field, points, rows = list(known), [ONE], [[vector]]
        for n in range(1, order + 1):
            slopes = ONE if n == 1 else bounds.products(points)[n - 1]
            total, rows = product(b, slopes), [*rows, [0] * n]
            for j in range(1, n + 1):
                rows[j].append(bounds.derivative(growth, field, rows[j - 1], n))
                total += rows[j][n] // math.factorial(j) + 1
            if n == len(field):
                field.append(product(of_field, total))
            rows[1][n] += product(vector, field[n])
            rows[0].append(product(of_start, total))
            points.append(product(a, slopes) + product(u, rows[0][n]))
        return tuple(rows[0]), tuple(field)


def _of_sum(row: Sequence[Fraction], values: Sequence[int]) -> int:
    """The denominator of Σ x_j v_j from those of the values."""
    return math.lcm(*(x.denominator * d for x, d in zip(row, values, strict=True) if x))


def _common(values: Sequence[int], n: int) -> int:
    """A common multiple of the products of values at n nodes in all."""
    found = [1]
    for m in range(1, n + 1):
        found.append(math.lcm(*(found[m - k] * values[k] for k in range(1, m + 1))))
    return found[n]


def _solved(table: TreeTable, arithmetic: Exact, stages: int, inputs: int, matrices: Sequence[Any]) -> tuple[Any, Any]:
    """All S_i, tree by tree, and b."""
    zeros, size, top = arithmetic.zeros, len(table), table.offsets[-2]
    width = arithmetic.width(table.max_order)
    order, _, left, right = arithmetic.columns(table)
    weights = factorial_weights(arithmetic, table.max_order, 1, False)
    kept = (zeros(top * stages), zeros(top * stages), zeros(top * inputs * width), zeros(size * inputs), zeros(size))
    scratch = (zeros(stages), zeros(inputs + 1), zeros(inputs + 1), zeros(inputs * width), zeros(1))
    for cuts in table.cut_chunks():
        arithmetic.run(memory_kernels.general_linear)(
            cuts.first, cuts.last, order, left, right, *arithmetic.cuts(cuts)[:3], width, top, stages, inputs,
            *matrices, *weights, len(weights[1]) > 0, arithmetic.modulus, *kept, *scratch,
        )  # fmt: skip
    return kept[-2:]
