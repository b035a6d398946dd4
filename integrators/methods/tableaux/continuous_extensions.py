"""Continuous extensions of Runge–Kutta methods: the solution between the ends of a step.

Polynomial weights b(θ) give y(t + θh) ≈ y + h Σ b_i(θ) k_i. They satisfy their order conditions,
Σ b_i(θ) Φ_i(τ) = θ^|τ|/γ(τ), and make the solution continuously differentiable: b(1) = b, b'(0) is the unit vector of
the first stage, b'(1) that of the derivative at the end of the step. Of all solutions the one with the smallest error
terms is chosen. If the stages of the method do not suffice, the field is evaluated at points of the extension of one
order less.
"""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.methods.tableaux.elementary_weights import ROUNDING, Conditions, weight_conditions

if TYPE_CHECKING:
    import numpy as np

    Array = np.ndarray[Any, Any]

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
    """Polynomial weights and their additional stages.

    Attributes:
        order: The order of the extension at all points of a step.
        rows: The coefficients of the additional stages, one row for each, over all stages.
        nodes: The nodes of the additional stages.
        weights: The matrix whose entry (i, j) is the coefficient of θ^(j+1) in b_i(θ).
    """

    order: int
    rows: Array
    nodes: Array
    weights: Array


def continuous_extension(A: Array, b: Array, order: int) -> ContinuousExtension:
    """The extension of order p − 1 of a method of order p, whose error O(h^p) is that of the method at a fixed time.

    Example:
        >>> import numpy as np
        >>> heun = continuous_extension(np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.5, 0]]), np.array([0.5, 0.5, 0]), 2)
        >>> heun.order, len(heun.nodes), (heun.weights @ [1 / 2, 1 / 4, 1 / 8]).round(12).tolist()
        (2, 0, [0.375, 0.25, -0.125])

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
            longer = _with_stages(A, weights, new)
            found = _polynomial_weights(longer, np.append(b, np.zeros(number)), stages, reached + 1)
            if found is not None:
                break
        else:
            break
        A, b, nodes, weights = longer, np.append(b, np.zeros(number)), np.append(nodes, new), found
        reached += 1
    return ContinuousExtension(reached, A[stages:], nodes, weights)


def _with_stages(A: Array, weights: Array, nodes: Array) -> Array:
    """The stage matrix with additional stages at points of an extension."""
    import numpy as np

    longer = np.pad(A, (0, len(nodes)))
    longer[len(A) :, : len(A)] = nodes[:, None] ** np.arange(1, weights.shape[1] + 1) @ weights.T
    return longer


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
    errors, wanted = _error_terms(beyond, order + 1, powers)
    free = errors - errors @ rows.T @ rows
    if np.linalg.norm(free) > ROUNDING * np.linalg.norm(errors):
        change = np.linalg.lstsq(free, wanted - errors @ solution, rcond=ERROR_CUT)[0]
        columns = (solution + change - rows.T @ (rows @ change)).reshape(len(powers), len(b)).T
    weights = np.column_stack([units[0], columns])
    return weights if abs(weights).max() <= LARGEST_WEIGHT else None


def _error_terms(beyond: Conditions, order: int, powers: Array) -> tuple[Array, Array]:
    """Matrix and right-hand side of the order conditions at some points of the step."""
    import numpy as np

    points = np.linspace(0, 1, 2 * len(powers) + 3)[1:-1]
    of_points, points_triangle = np.linalg.qr(points[:, None] ** powers)
    of_trees, trees_triangle = np.linalg.qr(beyond.vectors)
    return np.kron(points_triangle, trees_triangle), np.kron(points**order @ of_points, beyond.values @ of_trees)


def _agree(matrix: Array, solution: Array, right: Array) -> bool:
    """Whether a linear system is solved up to rounding."""
    return bool((abs(matrix @ solution - right) <= ROUNDING * (abs(matrix) @ abs(solution) + 1)).all())
