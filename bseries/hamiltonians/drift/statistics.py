"""Statistics of a rate along a long trajectory: its mean, the standard error, and the variance of its integral."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bseries.exceptions import SeriesError

BOUNDED, LINEAR, SQUARE_ROOT, UNDECIDED = "bounded", "linear drift", "square-root drift", "undecided"
BLOCKS = 32
"""Number of blocks of a trajectory for the standard error."""
HALVINGS = 4
"""Number of times that blocks are halved, for the growth of the variance with time."""
CERTAIN = 4.0
"""Number of standard errors that is significant."""
MOST_OF_ALL = 0.7
"""Largest part of a block in the sum of squares of a stationary rate."""
STEEPEST = 1.5
"""Largest growth exponent of variances (2 for a linear drift); above it correlations are longer than blocks."""


class RateStatistics(NamedTuple):
    """Statistics of a rate r sampled along a trajectory, and of its integral W(t) = ∫ r dt.

    Over times that are longer than correlations last, W has the mean m t and the variance c + 2 D t: c comes from the
    part of r that is a derivative of a bounded function, and D from what is left.

    Example:
        >>> import numpy as np
        >>> white = np.random.default_rng(1).standard_normal(2**15)
        >>> wave = np.cos(np.arange(2**15))
        >>> [rate_statistics(rates, 0.01).kind for rates in (white, wave, white + 0.1, wave + 0.1)]
        ['square-root drift', 'bounded', 'linear drift', 'linear drift']
        >>> 0.7 < rate_statistics(white, 0.01).diffusion / (0.01 / 2) < 1.4
        True
    """

    time: float  # the length of the trajectory
    mean: float  # m
    error: float  # its standard error, from the longest blocks
    diffusion: float  # D, from the variances of blocks of several lengths
    diffusion_error: float
    growth: float  # the exponent γ of the power t^γ that fits the variances of blocks
    largest: float  # the largest part of a block in the sum of squares of all: near 1, the rate is not stationary

    @property
    def kind(self) -> str:
        """``"linear drift"``, ``"square-root drift"``, ``"bounded"`` or ``"undecided"``.

        A rate is bounded if neither drift is significant within this time, and undecided if it is not stationary, as
        when a trajectory leaves its energy, or has correlations longer than the blocks.
        """
        if self.largest > MOST_OF_ALL or self.growth > STEEPEST:
            return UNDECIDED
        if abs(self.mean) > CERTAIN * self.error:
            return LINEAR
        return SQUARE_ROOT if self.diffusion > CERTAIN * self.diffusion_error else BOUNDED


def rate_statistics(rates: np.ndarray, dt: float) -> RateStatistics:
    """The statistics of a rate at equidistant times, dt apart.

    References:
        H. Flyvbjerg, H. G. Petersen, J. Chem. Phys. 91 (1989) 461–466, doi:10.1063/1.457480 (block averages).
    """
    least = BLOCKS * 2**HALVINGS
    if len(rates) < least:
        raise SeriesError(f"rates must be {least} or more to tell drifts apart, but were {len(rates)}")
    if not np.isfinite(rates).all():
        raise SeriesError("rates must be finite, but one was not")
    length = len(rates) // least
    used = rates[: least * length]
    mean, gains = float(used.mean()), ((used - used.mean()) * dt).reshape(-1, length).sum(axis=1)
    times = length * dt * 2.0 ** np.arange(HALVINGS + 1)
    variances = np.array([gains.reshape(-1, 2**k).sum(axis=1).var(ddof=1) for k in range(HALVINGS + 1)])
    error = float(np.sqrt(variances[-1] / BLOCKS) / times[-1])
    squares = gains.reshape(BLOCKS, -1).sum(axis=1) ** 2
    largest = float(squares.max() / squares.sum()) if squares.any() else 0.0
    growth = diffusion = diffusion_error = 0.0
    if variances.all():
        growth = float(np.polyfit(np.log(times), np.log(variances), 1)[0])
        # c + 2 D t, with the relative errors of the variances of so many blocks
        weights = 1 / (variances * np.sqrt(2 * times / (BLOCKS * times[-1])))
        fitted, covariance = np.polyfit(2 * times, variances, 1, w=weights, cov="unscaled")
        diffusion, diffusion_error = float(fitted[0]), float(np.sqrt(covariance[0, 0]))
    return RateStatistics(len(used) * dt, mean, error, diffusion, diffusion_error, growth, largest)
