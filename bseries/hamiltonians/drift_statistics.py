"""Whether a quantity W, sampled along a run, drifts: a line, a random walk, or a band whose variance is saturated.

Take W = m t + a Brownian motion of variance 2Dt over a time T. The part of W that vanishes at both ends has independent
coefficients in sines of πkt/T, all of the variance 2DT/(πk)², and they do not depend on W(T) − W(0): so the ratio of
the line to the first K of them has Student's distribution. The same holds for the cosines of W with m = 0 (both are
Karhunen–Loève expansions). A line therefore has a large ratio, a walk has coefficients that are equal in size after
multiplication by k, and a bounded quantity has hardly any of its variance in its slowest waves. Fast oscillations would
enter by the ends of the run. They are removed by averages with a smooth window, whose width is 1/64 of the run.
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
PIECES = 16  # of a run, between which a rise goes one way


@dataclass(frozen=True)
class Thresholds:
    """Where verdicts begin; `tests/bseries/hamiltonians/test_drift_statistics.py` measures how often they err."""

    waves: int = 64  # number of sines or cosines
    slow: int = 8  # number of the slowest ones: the longest waves last a quarter of the run
    significant: float = 7.1  # a walk exceeds so many standard errors with probability 1e-4, by Student's t with 8
    one_way: float = 0.95  # least part of the rise in all changes between 16 parts of the run, if it goes one way
    saturated: float = 0.05  # largest part of the variance in slow waves: ten times as long a walk stays invisible
    growth: float = 5.0  # 2D from slow waves and from faster ones agree up to this factor; 1 % of walks do not
    evenness: float = 2.0  # log of the arithmetic by the geometric mean; 1.27 ± 0.21 for 64 squares of a walk
    least_mean: float = 1e-12  # part of the root mean square of a rate that rounding can fake as a mean


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
    one_way: float  # the rise by the sum of all changes between parts of the run
    low: float  # the least value, less that at the start
    high: float  # the largest

    @property
    def amplitude(self) -> float:
        """Half of the range."""
        return (self.high - self.low) / 2

    @property
    def kind(self) -> str:
        """``"linear drift"``, ``"unsteady drift"``, ``"bounded"``, ``"square-root drift"`` or ``"no drift seen"``.

        A drift is unsteady if W goes one way, but along no line. A walk is one if its slow waves are as large as the
        increments of a walk make them, and no line or period stands out.
        """
        limits = THRESHOLDS
        if abs(self.mean) > limits.significant * self.error:
            return LINEAR
        if self.low == self.high:
            return BOUNDED
        if self.one_way > limits.one_way:
            return UNSTEADY
        if self.slow < limits.saturated:
            return BOUNDED
        is_even = 1 / limits.growth < self.growth < limits.growth and self.evenness < limits.evenness
        return SQUARE_ROOT if is_even else UNSEEN


def drift_statistics(values: np.ndarray, dt: float, rounding: float = 0.0) -> DriftStatistics:
    """The statistics of a quantity at equidistant times.

    Args:
        values: The quantity.
        dt: The time between two values.
        rounding: The size of rounding errors; a smaller change counts as none.

    Raises:
        SeriesError: There are fewer than 512 values, or one is not finite.

    References:
        U. K. Müller, J. Econometrics 141 (2007) 1331–1352 (the ratio in sines and cosines).
    """
    if len(values) < LEAST_VALUES:
        raise SeriesError(f"values must be {LEAST_VALUES} or more to tell drifts apart, but were {len(values)}")
    if not np.isfinite(values).all():
        raise SeriesError("values must be finite, but one was not")
    changes = values - values[0]
    time, low, high = (len(values) - 1) * dt, float(changes.min()), float(changes.max())
    size = max(high, -low)
    if size <= rounding:
        return DriftStatistics(time, *[0.0] * 10)
    changes = changes / size  # squares neither overflow nor vanish
    w, width = _averages(changes)
    length = (len(values) - width) * dt
    tau = np.linspace(0, 1, len(w))
    k = np.arange(1, THRESHOLDS.waves + 1)
    rise, few = w[-1] - w[0], THRESHOLDS.slow
    x = k * width / (2 * (len(values) - width))
    scale = np.pi * k * (1 - x**2) / np.sinc(x)  # restores what the window takes from waves
    sines = scale * _coefficients(np.sin, k, tau, w - w[0] - rise * tau)
    cosines = scale * _coefficients(np.cos, k, tau, w)
    squares = cosines**2
    error = float(np.sqrt(np.mean(sines[:few] ** 2)))
    steps = np.abs(np.diff(w[:: len(w) // PIECES])).sum()
    rest = squares[few:].mean()
    least = THRESHOLDS.least_mean * length / dt * np.sqrt(np.mean(np.diff(changes) ** 2))
    to_rate = size / length
    diffusion = float(np.mean(sines**2) / 2 * size * to_rate)
    return DriftStatistics(
        time,
        float(rise * to_rate) if abs(rise) > max(least, rounding / size) else 0.0,
        error * to_rate,
        diffusion,
        diffusion * (2 / THRESHOLDS.waves) ** 0.5,
        float((squares / (np.pi * k) ** 2)[:few].sum() / changes.var()),
        float(squares[:few].mean() / rest) if rest else 0.0,
        float(np.log(squares.mean()) - np.log(np.maximum(squares, TINY)).mean()) if rest else 0.0,
        float(abs(rise) / steps) if steps else 0.0,
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


def _coefficients(wave: np.ufunc, k: np.ndarray, tau: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The coefficients of values on [0, 1] in √2 times sines or cosines of πkτ."""
    weights = np.full(len(tau), 2**0.5 / (len(tau) - 1))  # of the trapezoidal rule
    weights[[0, -1]] /= 2
    return wave(np.pi * np.outer(k, tau)) @ (weights * values)
