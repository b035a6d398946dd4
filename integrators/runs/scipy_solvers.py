"""SciPy: embedded Runge–Kutta pairs as solvers for `solve_ivp`, and scenes as right-hand sides."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bseries_base.errors import shorten
from bseries_base.extras import optional_module
from integrators.compile.black_boxes import failure, forget_failure
from integrators.compile.scene_source import compiled_scene
from integrators.core.errors import IntegratorError
from integrators.exact.entries import round_entry, sum_entries
from integrators.methods.catalogue.registry import as_method, catalogue
from integrators.methods.tableaux.runge_kutta import RungeKutta
from integrators.methods.tableaux.weights import (
    MAX_ORDER,
    ContinuousExtension,
    continuous_extension,
    order_of_weights,
)
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    from scipy.integrate import RK45

Array = np.ndarray

MOST_ESTIMATES = 2
SECOND_ERROR = 0.1
"""Weight of the second of two error estimates (Hairer, Nørsett, Wanner I, II.10, and the code DOP853)."""


def right_hand_side(scene: Scene | str) -> Callable[[float, Array], Array]:
    """The field of a scene as a compiled function f(t, y), for `solve_ivp` and other solvers.

    Args:
        scene: The scene; its parameters must be numbers. Scenes are autonomous: if the field depends on the time, the
            time is one of the variables, and the argument t is ignored.

    Returns:
        A function of the time and of a state, one real number for each variable, that returns a new array.

    Raises:
        IntegratorError: `scene` is not a scene, or a parameter is a symbol; when called: y is not such a state, or a
            compiled function of the scene raises an error.

    Example:
        >>> import bseries as bs
        >>> from scipy.integrate import solve_ivp
        >>> kepler, span = bs.scene("kepler"), (0, 6.283185307179586)
        >>> field, solver = bs.integrators.right_hand_side(kepler), bs.integrators.scipy_solver("dop853")
        >>> found = solve_ivp(field, span, kepler.y0, method=solver, rtol=1e-12, atol=1e-12)
        >>> bool(abs(found.y[:, -1] - kepler.y0).max() < 1e-9)
        True
    """
    scene = as_scene(scene)
    field, shape = compiled_scene(scene).field, (scene.dimension,)

    def fun(t: float, y: Array) -> Array:
        if np.iscomplexobj(y):
            raise IntegratorError("y must be real, but was complex")
        state = np.ascontiguousarray(y, dtype=float)
        if state.shape != shape:
            raise IntegratorError(f"y must have the shape {shape}, but had {state.shape}")
        out = np.empty(shape)
        forget_failure()
        field(state, out)
        if (raised := failure()) is not None:
            raise raised
        return out

    return fun


def scipy_solver(method: RungeKutta | str) -> type[RK45]:
    """A solver class of SciPy from an embedded pair, for ``solve_ivp(…, method=scipy_solver(method))``.

    Steps are those of SciPy's own Runge–Kutta solvers, with the options of ``scipy.integrate.RK45``; the order of the
    estimated error comes from the tableau. The weights `b` advance the solution. States may be complex.

    Between steps the solution is continuously differentiable, and of order p − 1 for a method of order p ≤ 9 (p for
    p ≤ 3). An interpolated step needs one additional evaluation of the right-hand side with ``verner65``, four with
    ``dop853``, and none with the other pairs of the catalogue.

    Args:
        method: An explicit method with one or two rows of embedded weights, such as ``method("tsit5")``.

    Returns:
        A class, the same for equal methods of the same name. Its attribute ``method`` is the method, ``order`` its
        order, and ``error_estimator_order`` the order k of the estimated error, O(h^(k+1)).

    Raises:
        IntegratorError: The method has symbols, is implicit or inconsistent, or has no usable embedded weights.

    Example:
        >>> import bseries as bs
        >>> from scipy.integrate import solve_ivp
        >>> tsit5 = bs.integrators.scipy_solver(bs.method("tsit5"))
        >>> found = solve_ivp(lambda t, y: -y, (0, 1), [1.0], method=tsit5, rtol=1e-8, atol=1e-10)
        >>> print(f"{found.y[0, -1]:.7f}", tsit5.order, tsit5.error_estimator_order)
        0.3678794 5 4

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.4 (embedded weights) and II.10 (two
        estimates).
    """
    optional_module("scipy.integrate", "scipy_solver")
    found = as_method(method)
    if not isinstance(found, RungeKutta):
        raise IntegratorError(f"method must be a RungeKutta, but was {shorten(repr(found))}")
    return _solver_class(found, found.name)


@cache
def _solver_class(method: RungeKutta, name: str) -> type[RK45]:
    """The solver class of a pair, under a name; orders come from the order conditions.

    A and B are the tableau without a last stage that is the derivative at the end of the step, E the weights minus the
    embedded weights, and E2 the same for a second row of a lower order, or None.
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
    stages, weights = _with_end(A, b)
    orders = [order_of_weights(stages, row, 0) for row in errors]
    if max(orders) == MAX_ORDER:
        raise IntegratorError(
            f"embedded weights must give another result than b, but those of {shorten(method.name)} do not"
        )
    (order, E), *others = sorted(zip(orders, errors, strict=True), key=lambda pair: -pair[0])
    attributes = {
        "__doc__": f"The method {name} as a solver of SciPy.", "__module__": __name__, "method": method,
        "order": order_of_weights(stages, weights), "n_stages": len(b), "A": A, "B": b, "C": c, "E": E,
        "E2": others[0][1] if others else None,
        "error_estimator_order": 2 * order - others[0][0] if others else order,
    }  # fmt: skip
    return type("".join(filter(str.isprintable, name)), (_pair_solver(),), attributes)


@cache
def _pair_solver() -> Any:
    """The base class of the solvers, created on first use, since SciPy may be missing."""
    from scipy.integrate import RK45

    class PairSolver(RK45):
        """Steps of SciPy's own solvers; the norm of two error estimates and the interpolation are ours."""

        E2: Array | None

        def _step_impl(self) -> Any:
            if np.isnan(self.h_abs):  # SciPy would repeat the first step for ever
                return False, "The right-hand side is not finite at the start."
            return super()._step_impl()

        def _estimate_error_norm(self, K: Array, h: float, scale: Array) -> float:
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

    return PairSolver


@cache
def _extension(solver: Any) -> ContinuousExtension:
    return continuous_extension(*_with_end(solver.A, solver.B), solver.order)


def _with_end(A: Array, b: Array) -> tuple[Array, Array]:
    """A stage matrix and weights with one more stage, the derivative at the end of the step."""
    return np.pad(np.vstack([A, b]), ((0, 0), (0, 1))), np.append(b, 0.0)


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
