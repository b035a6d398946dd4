"""Order conditions of weights, and continuous extensions: the solution between the ends of a step.

A rooted tree with children τ₁, …, τₘ has the stage vector Φ = ∏ A Φ(τⱼ) and the number e = ∏ e(τⱼ)/|τⱼ|. Weights b
have order p if b·Φ = e/k for all trees with k ≤ p nodes (HNW I, Theorem II.2.13). The vectors of forests are products
of those of their trees, the largest last, so trees as objects are not needed.

Polynomial weights b(θ) give y(t + θh) ≈ y + h Σ b_i(θ) k_i. They satisfy their order conditions,
Σ b_i(θ) Φ_i(τ) = θ^|τ|/γ(τ), and make the solution continuously differentiable: b(1) = b, b'(0) is the unit vector of
the first stage, b'(1) that of the derivative at the end of the step. Of all solutions the one with the smallest error
terms is chosen. If the stages of the method do not suffice, the field is evaluated at points of the extension of one
order less.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count, islice
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np

    Array = np.ndarray

MAX_ORDER = 13
"""There are 12,486 trees with this number of nodes; higher orders are not distinguished."""
ROUNDING = 1e-9
"""In doubles, residuals over the catalogue are below 2e-14 for satisfied conditions, above 1e-2 for failed ones."""


class Conditions(NamedTuple):
    """The order conditions ``vectors @ weights == values`` of one order k."""

    vectors: Array  # one stage vector for each tree with k nodes
    values: Array  # 1/γ of each tree


def weight_conditions(A: Array) -> Iterator[Conditions]:
    """The order conditions of a stage matrix for orders 1, 2, 3, …."""
    import numpy as np

    one = A[0, 0] * 0 + 1
    # Rows are Φ followed by e; forests[k] are those with k nodes, ordered by the index of their largest tree.
    forests = [np.full((1, len(A) + 1), one)]
    largest = [np.array([-1])]
    trees: list[tuple[int, Array]] = []
    for k in count(1):
        rooted = forests[k - 1]
        vectors, values = rooted[:, :-1], rooted[:, -1] / k
        yield Conditions(vectors, values)
        trees += [(k, tree) for tree in np.column_stack([vectors @ A.T, values])]
        before = [np.searchsorted(largest[k - size], i, side="right") for i, (size, _) in enumerate(trees)]
        products = [forests[k - size][:n] * tree for n, (size, tree) in zip(before, trees, strict=True)]
        forests.append(np.concatenate(products))
        largest.append(np.repeat(np.arange(len(trees)), before))


def order_of_weights(A: Array, weights: Array, factor: int = 1) -> int:
    """The largest order ≤ `MAX_ORDER` up to which weights·Φ = factor/γ for all trees; in doubles up to rounding.

    With the factor 0, for the difference of two rows of weights: the k for which their results differ by O(h^(k+1)).
    """
    tolerance = 0 if A.dtype == object else ROUNDING
    for k, (vectors, values) in enumerate(islice(weight_conditions(A), MAX_ORDER)):
        size = abs(vectors) @ abs(weights) + factor * values
        if (abs(vectors @ weights - factor * values) > tolerance * size).any():
            return k
    return MAX_ORDER


HERMITE_ORDER = 3
"""Order of cubic Hermite interpolation, which needs only the two ends of a step."""
MOST_EXTENSION_ORDER = 8
MOST_FURTHER_STAGES = 8
LARGEST_WEIGHT = 1000.0
"""Larger weights would cost more than three digits."""
RANK_CUT = 1e-10
ERROR_CUT = 1e-2
"""Relative size below which directions that reduce the error terms are ignored: they would make the weights large."""


class ContinuousExtension(NamedTuple):
    """Polynomial weights and their additional stages."""

    order: int  # the order of the extension at all points of a step
    rows: Array  # the coefficients of the additional stages, one row for each, over all stages
    nodes: Array  # the nodes of the additional stages
    weights: Array  # the matrix whose entry (i, j) is the coefficient of θ^(j+1) in b_i(θ)


def continuous_extension(A: Array, b: Array, order: int) -> ContinuousExtension:
    """The extension of order p − 1 of a method of order p, whose error O(h^p) is that of the method at a fixed time.

    References:
        M. Zennaro, Math. Comp. 46 (1986) 119–133 (natural continuous extensions);
        W. H. Enright, K. R. Jackson, S. P. Nørsett, P. G. Thomsen, ACM Trans. Math. Softw. 12 (1986) 193–218
        (further stages by interpolation); Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.6.
    """
    import numpy as np

    stages = len(b)
    reached = min(order, HERMITE_ORDER)
    weights = _polynomial_weights(A, b, stages, reached)
    assert weights is not None  # cubic Hermite interpolation is one solution
    nodes = np.empty(0)
    while reached < min(order, MOST_EXTENSION_ORDER):
        most = MOST_FURTHER_STAGES if reached < order - 1 else 0
        for number in range(most + 1):
            new = np.arange(1, 2 * number, 2) / (2 * number + 2)
            longer = np.pad(A, (0, number))  # with stages at points of the extension
            longer[len(A) :, : len(A)] = new[:, None] ** np.arange(1, weights.shape[1] + 1) @ weights.T
            found = _polynomial_weights(longer, np.append(b, np.zeros(number)), stages, reached + 1)
            if found is not None:
                break
        else:
            break
        A, b, nodes, weights = longer, np.append(b, np.zeros(number)), np.append(nodes, new), found
        reached += 1
    return ContinuousExtension(reached, A[stages:], nodes, weights)


def _polynomial_weights(A: Array, b: Array, end: int, order: int) -> Array | None:
    """Polynomial weights of an order over the stages of A; None if there are none, or only large ones.

    Stage number `end` is the derivative at the end of the step. The coefficients of θ are known from b'(0); the
    unknowns are those of θ², θ³, ….
    """
    import numpy as np

    powers = np.arange(2, max(order, HERMITE_ORDER) + 1)
    *conditions, beyond = islice(weight_conditions(A), order + 1)
    vectors = np.concatenate([found.vectors / found.values[:, None] for found in conditions])
    orders = np.concatenate([np.full(len(found.values), k) for k, found in enumerate(conditions, 1)])
    targets = np.equal.outer(orders, powers)
    units = np.eye(len(b))
    sums = np.column_stack([powers**0, powers])  # for values and derivatives at the end of the step
    ends = np.column_stack([b, units[end - 1]]) - units[0][:, None]
    # There are more trees than stages: orthogonal transformations shorten the least-squares systems.
    rotation, triangle = np.linalg.qr(vectors)
    matrix = np.concatenate([np.kron(np.eye(len(powers)), triangle), np.kron(sums.T, units)])
    right = np.concatenate([*(rotation.T @ targets).T, *ends.T])
    left, sizes, rows = np.linalg.svd(matrix, full_matrices=False)
    kept = sizes > RANK_CUT * sizes[0]
    rows = rows[kept]
    solution = (right @ left[:, kept] / sizes[kept]) @ rows
    columns = solution.reshape(len(powers), len(b)).T
    if not (_agree(vectors, columns, targets) and _agree(columns, sums, ends)):
        return None
    # Least squares give the shortest change in the kernel (up to rounding) that minimises the error terms.
    points = np.linspace(0, 1, 2 * len(powers) + 3)[1:-1]
    of_points, points_triangle = np.linalg.qr(points[:, None] ** powers)
    of_trees, trees_triangle = np.linalg.qr(beyond.vectors)
    errors = np.kron(points_triangle, trees_triangle)
    wanted = np.kron(points ** (order + 1) @ of_points, beyond.values @ of_trees)
    free = errors - errors @ rows.T @ rows
    if np.linalg.norm(free) > ROUNDING * np.linalg.norm(errors):
        change = np.linalg.lstsq(free, wanted - errors @ solution, rcond=ERROR_CUT)[0]
        columns = (solution + change - rows.T @ (rows @ change)).reshape(len(powers), len(b)).T
    weights = np.column_stack([units[0], columns])
    return weights if abs(weights).max() <= LARGEST_WEIGHT else None


def _agree(matrix: Array, solution: Array, right: Array) -> bool:
    """Whether a linear system is solved up to rounding."""
    return bool((abs(matrix @ solution - right) <= ROUNDING * (abs(matrix) @ abs(solution) + 1)).all())
