"""Dense reference solution: Chebyshev interpolation on short intervals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bseries.advice.measures import largest_size, without_time
from integrators.core.errors import IntegratorError
from integrators.reference.solution import reference_solution

if TYPE_CHECKING:
    import numpy as np

    from integrators.scenes.scene import Scene

DEGREE = 16
"""Degree of the interpolation: about as many points as doubles have digits."""
INTERVALS = 64, 256, 1024, 4096
"""Numbers of intervals tried: with the last one there are 70,000 points."""
PRECISION = 2e-14
"""Relative tolerance of the interpolation, besides rounded times: a hundred times the unit roundoff, for 17 terms."""


class TooLong(IntegratorError):
    """The span is too long for a reference solution to the precision of doubles."""


class DenseReference:
    """A reference solution as a function of time, from y0 at time 0.

    Args:
        scene: The scene.
        y0: The start.
        span: The length of time.
        allowed: The relative error allowed, if larger than the precision of doubles.

    Attributes:
        size: The largest Euclidean norm of the state.
        source: Where the solution comes from.

    Raises:
        TooLong: The solution is not accurate enough.
        IntegratorError: The solution ends early.

    Example:
        >>> import bseries as bs, math
        >>> solution = DenseReference(bs.scene("linear"), [1.0, 0.0], 10.0)
        >>> bool(abs(solution([math.pi])[:, 0] + [1, 0]).max() < 1e-13)
        True
    """

    def __init__(self, scene: Scene, y0: np.ndarray, span: float, allowed: float = 0.0):
        self._scene, self._y0, self._span = scene, y0, span
        allowed = max(allowed, PRECISION)
        for intervals in INTERVALS:
            uncertainty, error, rounding = self._sample(intervals)
            if uncertainty <= allowed + rounding and error <= PRECISION + rounding + uncertainty:
                return
            if uncertainty > allowed:
                break
        raise TooLong(f"span must be shorter for a reference solution of {scene.name} in doubles, but was {span:g}")

    def _sample(self, intervals: int) -> tuple[float, float, float]:
        """Interpolate the solution in intervals; its error, that of the interpolation, and the effect of rounded times.

        The solution is computed at the nodes and, for the error, at a point between the middle two of them.
        """
        import numpy as np

        nodes = -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
        between = (nodes[DEGREE // 2] + nodes[DEGREE // 2 + 1]) / 2
        places = np.insert(nodes[1:], DEGREE // 2, between)
        width = self._span / intervals
        times = ((np.arange(intervals)[:, None] + (1 + places) / 2) * width).ravel()
        found = reference_solution(self._scene, times, y0=self._y0, full=True)
        self.source = found.source
        values = found.high.reshape(len(self._y0), intervals, DEGREE + 1)
        starts = np.concatenate([np.asarray(self._y0)[:, None], values[:, :-1, -1]], axis=1)
        at_nodes = np.concatenate([starts[:, :, None], np.delete(values, DEGREE // 2, axis=2)], axis=2)
        self._coefficients = at_nodes @ np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, DEGREE)).T
        self.size = largest_size(without_time(self._scene, at_nodes.reshape(len(self._y0), -1)))
        interpolated = self((np.arange(intervals) + (1 + between) / 2) * width)
        error = float(np.linalg.norm(interpolated - values[:, :, DEGREE // 2], axis=0).max()) / self.size
        uncertainty = float(np.linalg.norm(found.error, axis=0).max()) / self.size
        speed = np.linalg.norm(np.diff(values.reshape(len(self._y0), -1)), axis=0) / np.diff(times)
        rounding = 2.0**-52 * self._span * float(speed.max()) / self.size
        return uncertainty, error if math.isfinite(error) else math.inf, rounding

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """The solution at times from 0 to the span, (variables, times)."""
        import numpy as np

        intervals = self._coefficients.shape[1]
        scaled = np.asarray(times, dtype=float) * (intervals / self._span)
        at = np.clip(scaled.astype(int), 0, intervals - 1)
        basis = np.polynomial.chebyshev.chebvander(2 * (scaled - at) - 1, DEGREE)
        return np.einsum("vtk,tk->vt", self._coefficients[:, at], basis)
