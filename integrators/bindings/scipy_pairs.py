"""Embedded Runge–Kutta pairs as solvers of SciPy, which must be installed; `scipy_bridge` imports this module.

Only `OdeSolver` and `DenseOutput` are used, which SciPy publishes for new solvers: the base class of its own
Runge–Kutta solvers is private. The rules for step sizes are the same, so equal pairs make equal steps.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from math import isfinite
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver

from integrators.bindings.embedded_pairs import continuous_extension, embedded_pair
from integrators.core.errors import IntegratorError, shorten

if TYPE_CHECKING:
    from integrators.bindings.embedded_pairs import ContinuousExtension, EmbeddedPair
    from integrators.methods.tableaux.runge_kutta import RungeKutta

    Array = np.ndarray[Any, Any]

SAFETY = 0.9
LEAST_FACTOR = 0.2
LARGEST_FACTOR = 10.0
LEAST_ERROR = 1e-30
"""Lower bound of error estimates, to avoid division by zero; far larger ones already give the largest factor."""
LEAST_RTOL = 100 * np.finfo(float).eps
SECOND_ERROR = 0.1
"""Weight of the second of two error estimates (Hairer, Nørsett, Wanner I, II.10, and the code DOP853)."""


class PairSolver(OdeSolver):
    """Base class of the solvers from `scipy_solver`, for `solve_ivp`.

    Args:
        fun: The right-hand side f(t, y).
        t0: The first time.
        y0: The state there, real or complex.
        t_bound: The last time.
        max_step: The largest step.
        rtol: The relative tolerance, one number or one for each component.
        atol: The absolute tolerance, likewise. Estimated errors are kept below atol + rtol |y|.
        vectorized: Whether `fun` also accepts states of the shape (n, k).
        first_step: The first step; None: chosen automatically.
        extraneous: Options of other solvers, ignored with a warning.

    Attributes:
        method: The method.
        order: Its order.
        error_estimator_order: The order k of the estimated error, O(h^(k+1)).
    """

    method: ClassVar[RungeKutta]
    order: ClassVar[int]
    error_estimator_order: ClassVar[int]
    pair: ClassVar[EmbeddedPair]

    def __init__(
        self,
        fun: Callable[[float, Any], Any],
        t0: float,
        y0: Any,
        t_bound: float,
        max_step: float = np.inf,
        rtol: Any = 1e-3,
        atol: Any = 1e-6,
        vectorized: bool = False,
        first_step: float | None = None,
        **extraneous: Any,
    ) -> None:
        if extraneous:
            names = ", ".join(extraneous)
            warnings.warn(f"these options have no effect on {type(self).__name__}: {names}", stacklevel=3)
        super().__init__(fun, t0, y0, t_bound, vectorized, support_complex=True)
        self.max_step = _positive(max_step, "max_step")
        self.rtol, self.atol = _tolerances(rtol, atol, self.n)
        self.start = t0, self.y
        # One row for each stage; the last one is the first stage of the next step.
        self.K = np.zeros((len(self.pair.b), self.n), dtype=self.y.dtype)
        self.K[-1] = self._first_derivative()
        if first_step is None:
            self.h_abs = self._chosen_first_step()
        else:
            self.h_abs = _positive(first_step, "first_step")
            if self.h_abs > abs(t_bound - t0):
                raise IntegratorError(f"first_step must be at most {abs(t_bound - t0)}, but was {first_step}")

    def _first_derivative(self) -> Array:
        f = self.fun(self.t, self.y)
        if f.shape != self.y.shape:
            raise IntegratorError(f"fun must return an array of the shape {self.y.shape}, but it was {f.shape}")
        return f

    def _chosen_first_step(self) -> float:
        """A step in which the first two terms of the Taylor series are small (Hairer, Nørsett, Wanner I, II.4)."""
        length = float(abs(self.t_bound - self.t))
        if self.n == 0 or length == 0:
            return length
        f, scale = self.K[-1], self.atol + abs(self.y) * self.rtol
        y_size, f_size = _rms(self.y / scale), _rms(f / scale)
        if not isfinite(f_size):
            return 0.0  # the shortest possible step, which may fail
        trial = min(1e-6 if min(y_size, f_size) < 1e-5 else 0.01 * y_size / f_size, length)
        h = trial * self.direction
        change = _rms((self.fun(self.t + h, self.y + h * f) - f) / scale) / trial
        largest = max(f_size, change)
        if largest <= 1e-15:
            guess = max(1e-6, trial * 1e-3)
        else:
            guess = (0.01 / largest) ** (1 / (self.error_estimator_order + 1))
        return min(100 * trial, guess, length, self.max_step)

    def _step_impl(self) -> tuple[bool, str | None]:
        t, y, exponent = self.t, self.y, -1 / (self.error_estimator_order + 1)
        needs_end = any(row[-1] for row in self.pair.errors)
        self.K[0] = self.K[-1]
        least = 10 * abs(np.nextafter(t, self.direction * np.inf) - t)
        h_abs, largest_factor = min(max(self.h_abs, least), self.max_step), LARGEST_FACTOR
        while h_abs >= least:
            t_new = t + h_abs * self.direction
            if self.direction * (t_new - self.t_bound) > 0:
                t_new = self.t_bound
            h = t_new - t
            y_new = self._attempt(t, y, h)
            if needs_end:
                self.K[-1] = self.fun(t_new, y_new)
            error = self._error_norm(h, self.atol + np.maximum(abs(y), abs(y_new)) * self.rtol)
            if error < 1:
                break
            h_abs = abs(h) * max(LEAST_FACTOR, SAFETY * error**exponent)
            largest_factor = 1.0  # no increase after a rejected step
        else:
            return False, self.TOO_SMALL_STEP
        if not needs_end:
            self.K[-1] = self.fun(t_new, y_new)
        self.h_abs = abs(h) * min(largest_factor, SAFETY * max(error, LEAST_ERROR) ** exponent)
        self.start, self.t, self.y = (t, y), t_new, y_new
        return True, None

    def _attempt(self, t: float, y: Array, h: float) -> Array:
        """The end of a step; all stages but the first and the last are stored in K."""
        A, b, c, *_ = self.pair
        for i in range(1, len(b) - 1):
            self.K[i] = self.fun(t + c[i] * h, y + h * np.dot(self.K[:i].T, A[i, :i]))
        return y + h * np.dot(self.K[:-1].T, b[:-1])

    def _error_norm(self, h: float, scale: Array) -> float:
        """The estimated error in units of the tolerances."""
        error, *others = (abs(h) * _rms(np.dot(self.K.T, row) / scale) for row in self.pair.errors)
        if not others or error == 0:
            return error
        # E² / √(E² + (0.1 E')²): of the order 2k − k' where E' is of a lower order k'.
        return error * (error / np.hypot(error, SECOND_ERROR * others[0]))

    def _dense_output_impl(self) -> DenseOutput:
        extension = _extension(type(self))
        t, y = self.start
        h = self.t - t
        K = np.pad(self.K, ((0, len(extension.nodes)), (0, 0)))
        for i, (row, node) in enumerate(zip(extension.rows, extension.nodes, strict=True), len(self.K)):
            K[i] = self.fun(t + node * h, y + h * np.dot(K[:i].T, row[:i]))
        return PairOutput(t, self.t, y, h * np.dot(K.T, extension.weights))


class PairOutput(DenseOutput):
    """The solution within one step, y + Σ_j coefficients_j θ^(j+1) at the time t_old + θh."""

    def __init__(self, t_old: float, t: float, y: Array, coefficients: Array) -> None:
        super().__init__(t_old, t)
        self.y = y
        self.coefficients = coefficients

    def _call_impl(self, t: Array) -> Array:
        part = (t - self.t_old) / (self.t - self.t_old)
        powers = np.power.outer(part, np.arange(1, self.coefficients.shape[1] + 1))
        return (np.dot(powers, self.coefficients.T) + self.y).T


@cache
def solver_class(method: RungeKutta, name: str) -> type[PairSolver]:
    """The solver class of a pair, under a name."""
    pair = embedded_pair(method)
    attributes = {
        "__doc__": f"The method {name} as a solver of SciPy.",
        "__module__": __name__,
        "method": method,
        "order": pair.order,
        "error_estimator_order": pair.error_order,
        "pair": pair,
    }
    return type("".join(filter(str.isprintable, name)), (PairSolver,), attributes)


@cache
def _extension(solver: type[PairSolver]) -> ContinuousExtension:
    return continuous_extension(solver.pair.A, solver.pair.b, solver.order)


def _rms(values: Array) -> float:
    """The root mean square, also of complex numbers."""
    return float(np.linalg.norm(values) / values.size**0.5)


def _positive(value: Any, argument: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = -1.0
    if not number > 0:
        raise IntegratorError(f"{argument} must be a positive number, but was {shorten(repr(value))}")
    return number


def _tolerances(rtol: Any, atol: Any, n: int) -> tuple[Array, Array]:
    """Tolerances as arrays; a relative tolerance near rounding error is raised with a warning, as in SciPy."""
    found = []
    for argument, value in (("rtol", rtol), ("atol", atol)):
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            array = np.array(-1.0)
        if array.shape not in ((), (n,)) or not (array >= 0).all():
            raise IntegratorError(f"{argument} must be a number ≥ 0 or {n} of them, but was {shorten(repr(value))}")
        found.append(array)
    if (found[0] < LEAST_RTOL).any():
        warnings.warn(f"rtol must be at least {LEAST_RTOL:.2g} and was raised to that", stacklevel=4)
    return np.maximum(found[0], LEAST_RTOL), found[1]
