"""Embedded Runge–Kutta pairs as solvers of SciPy, which must be installed; `scipy_bridge` imports this module.

Steps are those of SciPy's own Runge–Kutta solvers. The tableau, the norm of two error estimates and the interpolation
are ours.
"""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar

import numpy as np
from scipy.integrate import RK45

from integrators.core.errors import IntegratorError, shorten
from integrators.exact.entries import round_entry, sum_entries
from integrators.methods.catalogue.registry import catalogue
from integrators.methods.tableaux.runge_kutta import RungeKutta
from integrators.methods.tableaux.weights import (
    MAX_ORDER,
    ContinuousExtension,
    continuous_extension,
    order_of_weights,
)

Array = np.ndarray[Any, Any]

MOST_ESTIMATES = 2
SECOND_ERROR = 0.1
"""Weight of the second of two error estimates (Hairer, Nørsett, Wanner I, II.10, and the code DOP853)."""


class PairSolver(RK45):
    """Base class of the solvers from `scipy_solver`, for `solve_ivp`; options are those of ``scipy.integrate.RK45``.

    Attributes:
        method: The method.
        order: Its order.
        error_estimator_order: The order k of the estimated error, O(h^(k+1)).
        A, B, C: The tableau, without a last stage that is the derivative at the end of the step.
        E: The weights minus the embedded weights, for the stages and the derivative at the end of the step.
        E2: The same for a second row of embedded weights of a lower order; None if there is none.
    """

    method: ClassVar[RungeKutta]
    E2: ClassVar[Array | None]

    def _step_impl(self) -> Any:
        if np.isnan(self.h_abs):  # SciPy would repeat the first step for ever
            return False, "The right-hand side is not finite at the start."
        return super()._step_impl()

    def _estimate_error_norm(self, K: Array, h: float, scale: Array) -> float:
        """The estimated error in units of the tolerances."""
        error = super()._estimate_error_norm(K, h, scale)
        if self.E2 is None or error == 0:
            return error
        other = np.linalg.norm(np.dot(K.T, self.E2) * h / scale) / scale.size**0.5
        # E²/√(E² + (0.1 E')²): of the order 2k − k' where E' is of a lower order k'.
        return error * (error / np.hypot(error, SECOND_ERROR * other))

    def _dense_output_impl(self) -> Any:
        extension, h = _extension(type(self)), self.h_previous
        K = np.pad(self.K, ((0, len(extension.nodes)), (0, 0)))
        for i, (row, node) in enumerate(zip(extension.rows, extension.nodes, strict=True), len(self.K)):
            K[i] = self.fun(self.t_old + node * h, self.y_old + h * np.dot(K[:i].T, row[:i]))
        stages, self.K, self.P = self.K, K, extension.weights
        output = super()._dense_output_impl()
        self.K = stages
        return output


@cache
def solver_class(method: RungeKutta, name: str) -> type[PairSolver]:
    """The solver class of a pair, under a name.

    Orders come from the order conditions. Two estimates E of order k and E' of a lower order k' combine into
    E²/√(E² + (0.1 E')²), of order 2k − k'.

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.4 (embedded weights) and II.10 (two
        estimates).
    """
    _check(method)
    rounded = method.to_float()
    A, b, c = np.array(rounded.A), np.array(rounded.b), np.array(rounded.c)
    # Differences of weights are exact before rounding.
    errors = [
        np.array([round_entry(sum_entries((x, -y))) for x, y in zip(method.b, row, strict=True)])
        for row in method.embedded
    ]
    if np.array_equal(A[-1], b):
        A, b, c = A[:-1, :-1], b[:-1], c[:-1]
    else:
        errors = [np.append(row, 0.0) for row in errors]
    stages, weights = with_end(A, b)
    orders = [order_of_weights(stages, row, 0) for row in errors]
    if max(orders) == MAX_ORDER:
        raise IntegratorError(
            f"embedded weights must give another result than b, but those of {shorten(method.name)} do not"
        )
    (order, E), *others = sorted(zip(orders, errors, strict=True), key=lambda pair: -pair[0])
    attributes = {
        "__doc__": f"The method {name} as a solver of SciPy.",
        "__module__": __name__,
        "method": method,
        "order": order_of_weights(stages, weights),
        "error_estimator_order": 2 * order - others[0][0] if others else order,
        "n_stages": len(b),
        "A": A,
        "B": b,
        "C": c,
        "E": E,
        "E2": others[0][1] if others else None,
    }
    return type("".join(filter(str.isprintable, name)), (PairSolver,), attributes)


def with_end(A: Array, b: Array) -> tuple[Array, Array]:
    """A stage matrix and weights with one more stage, the derivative at the end of the step."""
    return np.pad(np.vstack([A, b]), ((0, 0), (0, 1))), np.append(b, 0.0)


@cache
def _extension(solver: type[PairSolver]) -> ContinuousExtension:
    return continuous_extension(*with_end(solver.A, solver.B), solver.order)


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
