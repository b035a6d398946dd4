"""Newton's method at many points at once, and its continuation from the identity."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    import numpy as np

    Equations: TypeAlias = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    """Functions from rows x, and their numbers among all points, to f(x) and the matrices f'(x)."""

MOST_STEPS = 200
CONVERGED = 1e-8
"""Newton's method has converged if its step is smaller; it continues until steps no longer decrease."""
CONTINUATIONS = (1, 8, 64)
"""The numbers of steps of the continuation, tried in this order: of 2,000 points near a small denominator, 75 would
reach another solution without, and 45 with 8 steps at most."""


def newton(equations: Equations, start: np.ndarray, growth: float = float("inf")) -> np.ndarray:
    """Solve f(x) = 0 at each row of `start`; nan where a step exceeds the previous one times `growth`, or steps end."""
    import numpy as np

    x, last = start.copy(), np.full(len(start), np.inf)
    active = np.flatnonzero(np.isfinite(x).all(axis=1))
    for _ in range(MOST_STEPS):
        if not active.size:
            break
        with np.errstate(all="ignore"):
            residual, matrix = equations(x[active], active)
            matrix[np.linalg.det(matrix) == 0] = np.nan
            step = np.linalg.solve(matrix, residual[..., None])[..., 0]
        x[active] -= step
        moved, before = (np.abs(step) / (1 + np.abs(x[active]))).sum(axis=1), last[active]
        done = (moved == 0) | ((moved >= before) & (before < CONVERGED))
        failed = ~done & ~(moved <= growth * before) & ~(before < CONVERGED)
        x[active[failed]] = np.nan
        last[active] = moved
        active = active[~done & ~failed]
    x[active] = np.nan
    return x


def continued(shift: Equations, origin: np.ndarray) -> np.ndarray:
    """Solve x + g(x) = origin at each row, for the solution that continues the identity; nan where that fails.

    The equations have other solutions far away. The wanted one is followed in x + s·g(x) = origin from s = 0 to 1, with
    Newton steps that at least halve. If a continuation fails, one with more steps is tried; in the end, plain Newton
    steps.

    References:
        P. Deuflhard, *Newton Methods for Nonlinear Problems*, section 5.1 (continuation with the monotonicity test).
    """
    import numpy as np

    x, identity = np.full_like(origin, np.nan), np.eye(origin.shape[1])
    for count, growth in [*((count, 0.5) for count in CONTINUATIONS), (1, np.inf)]:
        rest = np.flatnonzero(np.isnan(x).any(axis=1))
        found = origin[rest]
        for share in np.arange(1, count + 1) / count:

            def equations(
                z: np.ndarray, k: np.ndarray, share: float = share, at: np.ndarray = rest
            ) -> tuple[np.ndarray, np.ndarray]:
                value, matrix = shift(z, at[k])
                return z + share * value - origin[at[k]], identity + share * matrix

            found = newton(equations, found, growth)
        x[rest] = found
    return x
