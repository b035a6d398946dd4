"""The modified field of any step, from its iterates: no formula of the method or of the field is needed.

The iterates Φ^k(y) of a step are the values at the times kh of the exact solution of its modified equation y' = f_h(y).
So f_h(y) is the derivative of k ↦ Φ^k(y) at 0, divided by h, and a central difference of 2m + 1 iterates gives it up to
a term of the size h^(2m).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from bseries.exceptions import SeriesError
from bseries_base.errors import shown
from integrators.core.arguments import read_whole
from integrators.exact.arguments import read_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]

Step: TypeAlias = Callable[["Array", float], ArrayLike]
"""A step: the state and the step size, then the state after the step."""

MOST_POINTS = 12
"""Central differences of more points on each side only add rounding errors."""
MOST_ITERATIONS = 200
EPSILON = float(np.finfo(float).eps)


class FieldValue(NamedTuple):
    """The modified field at a state.

    Attributes:
        value: The vector f_h(y).
        error: An estimate of its largest error: truncation, which is the change by the last point, plus rounding.
        points: The number m of iterates on each side.
    """

    value: Array
    error: float
    points: int


def step_field(
    step: Step, y: ArrayLike, h: float, *, points: int | None = None, inverse: Step | None = None
) -> FieldValue:
    """The modified field f_h(y) of a step: the vector field whose exact flow over the time h is the step.

    Args:
        step: Any function (y, h) that returns the state after a step, near the identity. It must not change y.
        y: The state, an array of numbers.
        h: The step size.
        points: The number m of iterates on each side; by default that with the smallest estimate of the error.
        inverse: The inverse of the step, (y, h) ↦ Φ_h⁻¹(y), such as the adjoint method with the step size −h. By
            default it is found by iteration.

    Returns:
        `value`, the vector f_h(y), with `error`, an estimate of its largest error, and `points`.

    Raises:
        SeriesError: An argument is out of range, the step returns other shapes or numbers that are not finite, or it is
            too far from the identity to be inverted.

    Example:
        The explicit Euler method on y' = y: the modified field is log(1 + h)/h · y.

        >>> import math
        >>> import bseries as bs
        >>> found = bs.fields.step_field(lambda y, h: y + h * y, [1.0], 0.1)
        >>> abs(found.value[0] - math.log(1.1) / 0.1) < 2 * found.error < 1e-11
        True

    References:
        HLW, section IX.1: the modified equation; section IX.7 for the size of what a formal series leaves out.
    """
    start = np.array(y, dtype=float)
    size = float(read_number(h, "h"))
    if size == 0 or not np.isfinite(start).all() or not start.size:
        raise SeriesError(f"y and h must be finite numbers, h not 0, but were {shown(y)} and {shown(h)}")
    if not callable(step):
        raise SeriesError(f"step must be a function of (y, h), but was {shown(step)}")
    most = (
        MOST_POINTS
        if points is None
        else read_whole(points, "points", f"a whole number from 1 to {2 * MOST_POINTS}", 1, 2 * MOST_POINTS)
    )

    def forward(state: Array) -> Array:
        return _state(step, state, size, "step")

    def backward(state: Array) -> Array:
        return _inverse(forward, state) if inverse is None else _state(inverse, state, size, "inverse")

    found: list[FieldValue] = []
    after, before, differences = start, start, []
    scale = float(abs(start).max()) or 1.0
    for m in range(1, most + 1):
        after, before = forward(after), backward(before)
        differences.append(after - before)
        scale = max(scale, float(abs(after).max()), float(abs(before).max()))
        weights = [_weight(k, m) for k in range(1, m + 1)]
        value = sum(w * d for w, d in zip(weights, differences, strict=True)) / size
        rounding = EPSILON * scale * sum(2 * k * abs(w) for k, w in enumerate(weights, 1)) / abs(size)
        change = float(abs(value - found[-1].value).max()) if found else math.inf
        found.append(FieldValue(np.asarray(value), change + rounding, m))
        if points is None and m > 2 and found[-1].error > found[-2].error > found[-3].error:
            break
    return found[-1] if points is not None else min(found, key=lambda value: value.error)


def _weight(k: int, m: int) -> float:
    """Weight of Φ^k − Φ^(−k) in the central difference of a first derivative with m points on each side."""
    return (-1) ** (k + 1) * math.factorial(m) ** 2 / (k * math.factorial(m - k) * math.factorial(m + k))


def _state(step: Step, state: Array, h: float, name: str) -> Array:
    """The state after a step, checked."""
    found = np.asarray(step(state.copy(), h), dtype=float)
    if found.shape != state.shape or not np.isfinite(found).all():
        raise SeriesError(
            f"{name} must return finite numbers of the shape {state.shape}, but gave {shown(found)} at {shown(state)}"
        )
    return found


def _inverse(forward: Callable[[Array], Array], target: Array) -> Array:
    """The state from which a step leads to `target`, by z ← z + target − Φ(z), which contracts where Φ is near id."""
    state, best = target, math.inf
    for _ in range(MOST_ITERATIONS):
        gap = target - forward(state)
        size = float(abs(gap).max())
        if size == 0 or (size >= best and best <= 16 * EPSILON * max(1.0, float(abs(target).max()))):
            return state
        if size > 1e6 * min(best, 1 + float(abs(target).max())):
            break
        best = min(best, size)
        state = state + gap
    raise SeriesError(
        f"step must be near the identity, or come with its inverse, but at {shown(target)} the inverse is missed by "
        f"{best:.1e}"
    )


def observed_order(
    step: Step, f: Callable[[Array], ArrayLike], y: ArrayLike, h: float, *, inverse: Step | None = None
) -> float:
    """The order that a step shows at a state: the power of h with which its modified field tends to f.

    Args:
        step, y, inverse: As for `step_field`.
        f: The right-hand side of y' = f(y).
        h: The larger of the two step sizes h and h/2 that are compared.

    Returns:
        log₂ of the quotient of |f_h − f| at the two step sizes; infinite where neither differs from f by more than its
        error.

    Raises:
        SeriesError: As for `step_field`; or rounding hides the difference at h/2.

    Example:
        >>> import bseries as bs
        >>> def midpoint(y, h):
        ...     return y + h * (y + h / 2 * y**2) ** 2
        >>> round(bs.fields.observed_order(midpoint, lambda y: y**2, [0.5], 0.02), 1)
        2.0
    """
    exact = np.asarray(f(np.array(y, dtype=float)), dtype=float)
    values = [step_field(step, y, size, inverse=inverse) for size in (float(h), float(h) / 2)]
    first, second = (float(abs(found.value - exact).max()) for found in values)
    error, smaller = (found.error for found in values)
    if first <= 2 * error and second <= 2 * smaller:
        return math.inf
    if second <= 4 * smaller:
        raise SeriesError(f"h must be larger: at {h / 2:g} the difference {second:.1e} is within rounding errors")
    return math.log2(first / second)
