"""Embedded Runge–Kutta pairs for error-controlled steps, and their continuous extensions.

A continuous extension gives the solution between the ends of a step: polynomial weights b(θ) with
y(t + θh) ≈ y + h Σ b_i(θ) k_i. They satisfy their order conditions, Σ b_i(θ) Φ_i(τ) = θ^|τ|/γ(τ), and make the solution
continuously differentiable: b(1) = b, b'(0) is the unit vector of the first stage, b'(1) that of the derivative at the
end of the step. Among the solutions the one with the smallest error terms is chosen. If the stages of the method do not
suffice, the field is evaluated at points of the extension of one order less.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.core.errors import IntegratorError, shorten
from integrators.exact.entries import round_entry, sum_entries
from integrators.methods.catalogue.registry import catalogue
from integrators.methods.tableaux.elementary_weights import (
    MAX_ORDER,
    ROUNDING,
    Conditions,
    order_of_difference,
    order_of_weights,
    weight_conditions,
)

if TYPE_CHECKING:
    import numpy as np

    from integrators.exact.entries import Entry
    from integrators.methods.tableaux.runge_kutta import RungeKutta

    Array = np.ndarray[Any, Any]

MOST_ESTIMATES = 2
HERMITE_ORDER = 3
"""Order of cubic Hermite interpolation, which needs only the two ends of a step."""
MOST_EXTENSION_ORDER = 8
MOST_FURTHER_STAGES = 8
LARGEST_WEIGHT = 1000.0
"""Larger weights would cost more than three digits."""
RANK_CUT = 1e-10
ERROR_CUT = 1e-2
"""Relative size below which directions that reduce the error terms are ignored: they would make the weights large."""


class EmbeddedPair(NamedTuple):
    """A pair in doubles, whose last stage is the derivative at the end of the step, added if missing.

    Attributes:
        A: The stage matrix; its last row is `b`.
        b: The weights.
        c: The nodes.
        errors: The weights minus the embedded weights: one row, or two, the first of the higher order.
        order: The order of the weights.
        error_order: The order k of the estimated error, O(h^(k+1)).
    """

    A: Array
    b: Array
    c: Array
    errors: tuple[Array, ...]
    order: int
    error_order: int


def embedded_pair(method: RungeKutta) -> EmbeddedPair:
    """The pair of a method, with orders from the order conditions.

    Two estimates E of order k and E' of a lower order k' combine into E²/√(E² + (0.1 E')²), of order 2k − k'.

    Raises:
        IntegratorError: The method has symbols, is implicit or inconsistent, or has no usable embedded weights.

    Example:
        >>> from integrators import method
        >>> [embedded_pair(method(name))[-2:] for name in ("fehlberg45", "cash-karp45", "dop853")]
        [(4, 4), (5, 4), (8, 7)]

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.4 (embedded weights) and II.10 (two
        estimates).
    """
    import numpy as np

    _check(method)
    rounded = method.to_float()
    A, b, c = np.array(rounded.A), np.array(rounded.b), np.array(rounded.c)
    errors = [_rounded_difference(method.b, row) for row in method.embedded]
    if not np.array_equal(A[-1], b):
        A = np.pad(np.vstack([A, b]), ((0, 0), (0, 1)))
        b, c, errors = np.append(b, 0.0), np.append(c, 1.0), [np.append(row, 0.0) for row in errors]
    orders = [order_of_difference(A, row) for row in errors]
    if max(orders) == MAX_ORDER:
        raise IntegratorError(
            f"embedded weights must give another result than b, but those of {shorten(method.name)} do not"
        )
    if len(orders) > 1 and orders[0] < orders[1]:
        errors, orders = errors[::-1], orders[::-1]
    error_order = orders[0] if len(orders) == 1 else 2 * orders[0] - orders[1]
    return EmbeddedPair(A, b, c, tuple(errors), order_of_weights(A, b), error_order)


def _check(method: RungeKutta) -> None:
    """Refuse methods that are not explicit, or have no error estimate."""
    name = shorten(method.name)
    if method.parameters:
        raise IntegratorError(f"parameters of {name} must have values, but {', '.join(method.parameters)} had none")
    if not method.is_explicit:
        raise IntegratorError(f"method must be explicit, but {name} is implicit: SciPy has Radau and BDF of its own")
    if not method.embedded:
        known = ", ".join(entry.name for entry in catalogue() if entry.kind == "embedded pair")
        raise IntegratorError(
            f"method must have embedded weights to estimate errors, but {name} has none; of the catalogue have {known}"
        )
    if len(method.embedded) > MOST_ESTIMATES:
        raise IntegratorError(
            f"method must have one or two rows of embedded weights, but {name} has {len(method.embedded)}"
        )
    if method.issues:
        raise IntegratorError(f"method must be consistent, but {method.issues[0]}")


def _rounded_difference(weights: Sequence[Entry], others: Sequence[Entry]) -> Array:
    """The difference of two rows of weights, exact before rounding."""
    import numpy as np

    return np.array([round_entry(sum_entries((x, -y))) for x, y in zip(weights, others, strict=True)])


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

    Args:
        A: The stage matrix of an explicit method in doubles. The last stage is the derivative at the end of the step,
            so the last row is `b`.
        b: The weights.
        order: The order p.

    Returns:
        An extension of order p − 1, at least min(p, 3) and at most `MOST_EXTENSION_ORDER`; of lower order if
        `MOST_FURTHER_STAGES` do not suffice.

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
