"""Means of periodic functions in high precision."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..exceptions import SeriesError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

DIGITS = 15
"""Digits that means are certain to."""
WORKING_DIGITS = 30
LEAST_POINTS, MOST_POINTS = 64, 2**14


def mean_of_samples(samples: Callable[[int], Sequence[Any]]) -> Any:
    """The mean of a smooth periodic function, by the trapezoidal rule: for such functions it converges exponentially.

    Args:
        samples: Gives the values at so many equally spaced points of a period, as numbers of mpmath.

    Returns:
        The mean; 0 where it is below 10^−15 of the mean size.

    Raises:
        SeriesError: The points that are allowed do not suffice.

    Example:
        >>> import mpmath
        >>> f = lambda x: 1 / (2 + mpmath.cos(x))
        >>> mean = mean_of_samples(lambda n: [f(2 * mpmath.pi * j / n) for j in range(n)])
        >>> print(mpmath.nstr(mean * mpmath.sqrt(3), 15))
        1.0
    """
    import mpmath

    with mpmath.workdps(WORKING_DIGITS):
        points, before = LEAST_POINTS, None
        while points <= MOST_POINTS:
            values = samples(points)
            mean, size = mpmath.fsum(values) / points, mpmath.fsum(map(abs, values)) / points
            least = size * mpmath.mpf(10) ** -DIGITS
            if before is not None and abs(mean - before) <= least:
                return mpmath.mpf(0) if abs(mean) <= least else mean
            points, before = 2 * points, mean
    raise SeriesError(f"rates must be smoother: {MOST_POINTS} points of an orbit do not give their mean")
