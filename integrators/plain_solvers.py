"""Equations x = g(x) of implicit stages, solved until nothing but rounding is left."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from .plain_arithmetic import size

if TYPE_CHECKING:
    from .plain_arithmetic import Arithmetic, Vector

    Map = Callable[[Vector], Vector]

MOST_ITERATIONS = 200
PATIENCE = 3
"""So many iterations in a row may fail to bring a smaller increment: then they have stagnated, or diverge."""


def fixed_point(g: Map, start: Vector, scale: Any, arithmetic: Arithmetic) -> Vector | None:
    """The solution of x = g(x) by x ← g(x).

    Args:
        g: the map.
        start: the first x.
        scale: what rounding errors are relative to, besides x.
        arithmetic: the numbers to compute with.

    Returns:
        The solution; None if the iteration does not converge.

    Example:
        >>> from integrators.plain_arithmetic import Arithmetic
        >>> import numpy as np
        >>> print(fixed_point(np.cos, np.array([1.0]), 1, Arithmetic()))
        [0.73908513]
        >>> print(fixed_point(lambda x: 2 - 2 * x, np.array([1.0]), 1, Arithmetic()))
        None

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, VIII.6: iteration until stagnation.
    """
    return _settled(g, start, scale, arithmetic)


def newton(g: Map, start: Vector, scale: Any, arithmetic: Arithmetic) -> Vector | None:
    """The solution of x = g(x) by Newton's method, the Jacobian computed anew by differences in each iteration.

    Args:
        g: the map.
        start: the first x.
        scale: what rounding errors are relative to, besides x.
        arithmetic: the numbers to compute with.

    Returns:
        The solution; None if the iteration does not converge.

    Example:
        >>> from integrators.plain_arithmetic import Arithmetic
        >>> import numpy as np
        >>> print(newton(lambda x: 2 - 2 * x**3, np.array([1.0]), 1, Arithmetic()))
        [0.83512235]
    """

    def improved(x: Vector) -> Vector:
        value = g(x)
        width = arithmetic.rounding**0.5 * (max(scale, size(x)) or 1)
        matrix = arithmetic.zeros(len(x), len(x))
        for j in range(len(x)):
            moved = x.copy()
            moved[j] += width
            matrix[:, j] = -(g(moved) - value) / width
            matrix[j, j] += 1
        correction = arithmetic.solve(matrix, value - x)
        return value * float("nan") if correction is None else x + correction

    return _settled(improved, start, scale, arithmetic)


def _settled(advance: Map, x: Vector, scale: Any, arithmetic: Arithmetic) -> Vector | None:
    """What an iteration comes to; None if the increments stop falling before they are small, or are not finite."""
    least, failures = None, 0
    for _ in range(MOST_ITERATIONS):
        before, x = x, advance(x)
        if not arithmetic.is_finite(x):
            return None
        increment = size(x - before)
        if least is None or increment < least:
            least, failures = increment, 0
        else:
            failures += 1
        if increment == 0 or failures == PATIENCE:
            return x if increment <= arithmetic.rounding**0.75 * max(scale, size(x)) else None
    return None
