"""Whether a quantity W, sampled along a run, drifts: a line, a random walk, or a band whose variance is saturated.

Take W = m t + a Brownian motion of variance 2Dt over a time T. The part that vanishes at both ends has independent
coefficients in sines of πkt/T, of the variance 2DT/(πk)², and does not depend on W(T) − W(0). So it gives D and the
standard error of m, and a walk stays close to the line between its ends with a known, small probability. Without the
line, the coefficients of W in cosines have the same variance and are independent, too. (Both are Karhunen–Loève
expansions.) Multiplied by πk, those of a walk are thus equal in size; a bounded quantity has hardly any of its variance
in the slowest waves; in slow oscillations, single ones stand out. Fast oscillations would enter by the ends of the run.
They are removed by averages with a smooth window, whose width is 1/64 of the run.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bseries.exceptions import SeriesError

BOUNDED, UNSEEN, SQUARE_ROOT = "bounded", "no drift seen", "square-root drift"
LINEAR, UNSTEADY, UNDECIDED = "linear drift", "unsteady drift", "undecided"
RANKS = (BOUNDED, UNSEEN, SQUARE_ROOT, LINEAR, UNSTEADY)
"""From the verdict that claims least change to the one that claims most."""
LEAST_VALUES = 512
TINY = 1e-300
PIECES = 16  # of a run, between which changes are added up


@dataclass(frozen=True)
class Thresholds:
    """Where verdicts begin; `tests/bseries/hamiltonians/test_drift_statistics.py` measures how often they err."""

    waves: int = 64  # number of sines or cosines
    slow: int = 8  # number of the slowest ones: the longest waves last a quarter of the run
    bend: float = 0.128  # largest distance from a line, as a part of its rise; less with probability 1e-4 in a walk
    one_way: float = 0.95  # least part of the rise in all changes between pieces of the run, if it goes one way
    event: float = 0.5  # largest part of a piece in the variances within pieces, if no single event decides
    spread: float = 0.3  # the same for a walk; exceeded by 5 % of them, and by functions of less than four periods
    saturated: float = 0.01  # largest part of the variance in slow waves: a walk stays invisible for ten times as long
    growth: float = 5.0  # 2D from slow waves and from faster ones agree up to this factor; 1 % of walks do not
    evenness: float = 2.0  # log of the arithmetic by the geometric mean; 1.27 ± 0.21 for 64 squares of a walk
    explained: float = 0.5  # largest part of the deviation of the energy that predictions leave
    least_mean: float = 1e-12  # part of the root mean square of a rate that rounding can fake as a mean
    roundings: float = 8.0  # rounding errors of the energy in a step, in units of roundoff; they add up like a walk


THRESHOLDS = Thresholds()


class DriftStatistics(NamedTuple):
    """Statistics of a quantity W at equidistant times."""

    time: float  # the length of the run
    mean: float  # m, the slope of W
    error: float  # its standard error for a walk, from slow waves; too large for other noise
    diffusion: float  # D
    diffusion_error: float
    slow: float  # the part of the variance in slow waves
    growth: float  # D from slow waves by D from the others
    evenness: float  # of the squares of waves
    bend: float  # the largest distance from the line between the ends, as a part of its rise
    one_way: float  # the rise as a part of all changes between pieces of the run
    event: float  # the largest part of a piece in the sum of variances within pieces
    deviation: float  # the standard deviation of the values
    end: float  # the value at the end, less that at the start
    low: float  # the least value, less that at the start
    high: float  # the largest

    @property
    def amplitude(self) -> float:
        """Half of the range."""
        return (self.high - self.low) / 2

    @property
    def kind(self) -> str:
        """``"linear drift"``, ``"unsteady drift"``, ``"bounded"``, ``"square-root drift"`` or ``"no drift seen"``.

        A drift is unsteady if W goes one way, but along no line, or if W does not come back from a single event. A walk
        is one if its slow waves are as large as the increments of a walk make them, and no wave stands out.
        """
        limits = THRESHOLDS
        if self.mean and self.bend < limits.bend:
            return LINEAR
        if self.event > limits.event:
            return UNSTEADY if abs(self.end) > self.amplitude else UNSEEN
        if self.slow < limits.saturated:
            return BOUNDED
        if self.one_way > limits.one_way:
            return UNSTEADY
        is_even = 1 / limits.growth < self.growth < limits.growth and self.evenness < limits.evenness
        return SQUARE_ROOT if is_even and self.event < limits.spread else UNSEEN


def drift_statistics(values: np.ndarray, dt: float, rounding: float = 0.0) -> DriftStatistics:
    """The statistics of a quantity at equidistant times.

    Args:
        values: The quantity.
        dt: The time between two values.
        rounding: The size of rounding errors; a smaller change counts as none.

    Raises:
        SeriesError: There are fewer than 512 values, or one is not finite.

    References:
        U. K. Müller, J. Econometrics 141 (2007) 1331–1352 (means and their errors from cosines of the rate, which
        are sines of its integral).
    """
    if len(values) < LEAST_VALUES:
        raise SeriesError(f"values must be {LEAST_VALUES} or more to tell drifts apart, but were {len(values)}")
    if not np.isfinite(values).all():
        raise SeriesError("values must be finite, but one was not")
    changes = values - values[0]
    time, low, high = (len(values) - 1) * dt, float(changes.min()), float(changes.max())
    size = max(high, -low)
    if size <= rounding:
        return DriftStatistics(time, *[0.0] * 14)
    changes = changes / size  # squares neither overflow nor vanish
    w, width = _averages(changes)
    rise, length = w[-1] - w[0], (len(values) - width) * dt
    least = THRESHOLDS.least_mean * length / dt * np.sqrt(np.mean(np.diff(changes) ** 2))
    mean = float(rise) if abs(rise) > max(least, rounding / size) else 0.0
    sines, cosines, parts = _waves(w, width / (len(values) - width))
    few, rest = THRESHOLDS.slow, np.mean(cosines[THRESHOLDS.slow :])
    away = np.abs(w - w[0] - rise * np.linspace(0, 1, len(w))).max()
    changed = np.abs(np.diff(w[:: len(w) // PIECES])).sum()
    within = np.array([piece.var() for piece in np.array_split(changes, PIECES)])
    diffusion = float(np.mean(sines) / 2 * size * size / length)
    return DriftStatistics(
        time,
        mean * size / length,
        float(np.mean(sines[:few])) ** 0.5 * size / length,
        diffusion,
        diffusion * (2 / THRESHOLDS.waves) ** 0.5,
        float(parts[:few].sum() / changes.var()),
        float(np.mean(cosines[:few]) / rest) if rest else 0.0,
        float(np.log(np.mean(cosines)) - np.log(np.maximum(cosines, TINY)).mean()) if rest else 0.0,
        float(away / abs(rise)) if rise else 0.0,
        float(abs(rise) / changed) if changed else 0.0,
        float(within.max() / within.sum()),
        float(changes.std() * size),
        float(changes[-1] * size),
        low,
        high,
    )


def _averages(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Averages in Hann's window, half overlapping, and its width."""
    count = 2 * THRESHOLDS.waves
    width = 2 * (len(values) // (count + 2))
    starts = np.linspace(0, len(values) - width, count + 1).astype(int)
    window = np.hanning(width + 2)[1:-1]
    window /= window.sum()
    return np.array([window @ values[at : at + width] for at in starts]), width


def _waves(w: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The squares of the coefficients of averages in sines and cosines, times (πk)²; and those in cosines without it.

    The sines are those of w less the line between its ends. In Hann's window, of this width relative to the run, waves
    lose a factor, which is restored.
    """
    tau, k = np.linspace(0, 1, len(w)), np.arange(1, THRESHOLDS.waves + 1)
    weights = np.full(len(w), 2**0.5 / (len(w) - 1))  # of the trapezoidal rule
    weights[[0, -1]] /= 2
    x = k * width / 2
    scale, phases = (1 - x**2) / np.sinc(x), np.pi * np.outer(k, tau)
    sines = scale * (np.sin(phases) @ (weights * (w - w[0] - (w[-1] - w[0]) * tau)))
    cosines = scale * (np.cos(phases) @ (weights * w))
    return (np.pi * k * sines) ** 2, (np.pi * k * cosines) ** 2, cosines**2
