"""Dense reference solution: Chebyshev interpolation on short intervals."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import thread_time
from typing import TYPE_CHECKING

from bseries.advice.distances import largest_size, without_time
from integrators.core.errors import IntegratorError
from integrators.reference.solution import reference_solution

if TYPE_CHECKING:
    import numpy as np

    from integrators.scenes.scene import Scene

DEGREE = 16
FIRST_INTERVALS, MOST_INTERVALS = 64, 4096
PRECISION = 2e-14
"""Relative tolerance of the interpolation, besides the effect of rounded times."""
TRIAL = 0.02
"""Part of the span for which the cost is measured."""
SAMPLINGS = 3
"""Usual number of computations until there are enough intervals."""
REFERENCE_PROGRAM = "import bseries as bs; bs.reference_solution(bs.scene('riccati'), [0.5], full=True)"
"""Program that compiles the code of reference solutions."""


@contextmanager
def reference_compiled_ahead() -> Iterator[None]:
    """Compile the code of reference solutions in another process, which writes it to the cache on disk.

    Example:
        >>> with reference_compiled_ahead():
        ...     pass
    """
    null = subprocess.DEVNULL
    process = subprocess.Popen([sys.executable, "-c", REFERENCE_PROGRAM], stdin=null, stdout=null, stderr=null)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def affordable_span(scene: Scene, span: float, seconds: float) -> float:
    """The part of a span whose dense reference solution fits into a CPU time, estimated from a trial.

    Example:
        >>> import bseries as bs
        >>> affordable_span(bs.scene("pendulum"), 10.0, 60.0)
        10.0
    """

    def trial() -> float:
        began = thread_time()
        reference_solution(scene, [span * TRIAL], y0=scene.y0, full=True)
        return thread_time() - began

    try:
        trial()  # compiles
        return min(span, span * TRIAL * seconds / (SAMPLINGS * trial()))
    except IntegratorError:  # the solution ends early
        return span


class DenseReference:
    """A reference solution as a function of time.

    Args:
        scene: The scene.
        y0: The start, at time 0.
        span: The length of time.

    Attributes:
        span: The length of time.
        size: The largest Euclidean norm of the state.
        error: The bound of the relative error.

    Raises:
        IntegratorError: The solution ends early, or is not accurate to the precision of doubles.

    Example:
        >>> import bseries as bs, math
        >>> solution = DenseReference(bs.scene("linear"), [1.0, 0.0], 10.0)
        >>> bool(abs(solution([math.pi])[:, 0] + [1, 0]).max() < 1e-13)
        True
    """

    def __init__(self, scene: Scene, y0: np.ndarray, span: float):
        self.scene, self.y0, self.span = scene, y0, span
        intervals = FIRST_INTERVALS
        self._sample(intervals)
        while self.error > PRECISION + self._rounding:
            if self._uncertainty > PRECISION or intervals >= MOST_INTERVALS:
                raise IntegratorError(
                    f"span must be shorter for a reference solution of {scene.name} in doubles, but was {span:g}"
                )
            intervals *= 4
            self._sample(intervals)

    def _sample(self, intervals: int) -> None:
        """Compute the solution at the nodes of intervals, and at points between for the error."""
        import numpy as np

        self._intervals = intervals
        self._points = (1 - np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)) / 2
        between = (self._points[DEGREE // 2] + self._points[DEGREE // 2 + 1]) / 2
        places = np.append(self._points[1:-1], [between, 1.0])
        places = np.sort(places)
        width = self.span / intervals
        times = (np.arange(intervals)[:, None] + places).ravel() * width
        found = reference_solution(self.scene, times, y0=self.y0, full=True)
        at = np.searchsorted(places, between)
        values = found.high.reshape(len(self.y0), intervals, DEGREE + 1)
        ends = np.concatenate([np.asarray(self.y0)[:, None], values[:, :-1, -1]], axis=1)
        self._values = np.concatenate([ends[:, :, None], np.delete(values, at, axis=2)], axis=2)
        self.size = largest_size(without_time(self.scene, self._values.reshape(len(self.y0), -1)))
        interpolated = self((np.arange(intervals) + between) * width)
        off = np.linalg.norm(interpolated - values[:, :, at], axis=0).max()
        self._uncertainty = float(np.linalg.norm(found.error, axis=0).max()) / self.size
        speed = np.linalg.norm(np.diff(values.reshape(len(self.y0), -1)), axis=0) / np.diff(times)
        self._rounding = 2.0**-52 * self.span * float(speed.max()) / self.size  # due to rounded times
        self.error = max(float(off) / self.size, self._uncertainty)
        if not math.isfinite(self.error):
            self.error = math.inf

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """The solution at times from 0 to `span`, (variables, times).

        References:
            J.-P. Berrut, L. N. Trefethen, Barycentric Lagrange interpolation, SIAM Review 46 (2004) 501–517.
        """
        import numpy as np

        scaled = np.asarray(times, dtype=float) * (self._intervals / self.span)
        at = np.clip(scaled.astype(int), 0, self._intervals - 1)
        weights = (-1.0) ** np.arange(DEGREE + 1)
        weights[[0, -1]] /= 2
        distances = (scaled - at)[:, None] - self._points
        exact = distances == 0
        distances[exact] = 1.0
        factors = weights / distances
        hit = exact.any(axis=1)
        factors[hit] = exact[hit]
        values = self._values[:, at, :]
        return (values * factors).sum(axis=2) / factors.sum(axis=1)
