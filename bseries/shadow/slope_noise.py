"""Slopes that noise alone gives a line by least squares: their standard error, and how large chance makes them.

Noise of a shadow energy is white (each value is rounded), a random walk (each step is rounded, and rounding errors add
up), a mixture of both, or an oscillation that its order leaves. In the cosine transform of n values, coefficient k has
the variance v of white noise, and about v r / k² for a random walk. Where r is larger than 1 a slope is mostly that of
the walk, so that r decides, although few frequencies tell it: chance averages over what they leave open.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

LEAST_BLOCKS = 16
"""Least number of blocks for an error estimate."""
MOST_FREQUENCIES = 32
"""Lowest frequencies used: more would see oscillations of the motion, fewer leave the noise unknown."""
RATIOS = np.concatenate(([0.0], np.logspace(-0.5, 4.5, 21)))
WHITE = 0.9
"""Ratios r, and the probability of the first before values are seen; the others are equally likely. With half of it
white noise hides drifts twice as large, and with 0.99 a fifth of mixtures with r = 9 would pass for drifts."""
NEGLIGIBLE = 1e-6
"""Probability of a ratio that does not count."""
CHANCE = math.erfc(3 / math.sqrt(2))
"""Probability that noise alone exceeds the limit: that of three standard errors of a normal distribution."""


class SlopeNoise(NamedTuple):
    """What noise does to the slope of a line."""

    error: float  # the standard error of the slope
    limit: float  # the absolute value that the slope exceeds by chance with the probability `CHANCE`


def slope_noise(means: np.ndarray) -> SlopeNoise:
    """The noise per block of the slope of a line through the means of blocks.

    References:
        Flyvbjerg, Petersen, J. Chem. Phys. 91 (1989) 461, doi:10.1063/1.457480 (blocks).
    """
    error, rest = 0.0, means
    width = 1
    while len(rest) >= LEAST_BLOCKS:  # the error grows while neighbours are correlated, as in oscillations
        left, spread = _about_line(rest)
        error = max(error, math.sqrt(float(left @ left) / (len(rest) - 2) / spread) / width)
        rest, width = rest[: len(rest) // 2 * 2].reshape(-1, 2).mean(axis=1), 2 * width
    spectral = _spectral_noise(_about_line(means)[0])
    return SlopeNoise(max(error, spectral.error), max(3 * error, spectral.limit))


def _about_line(values: np.ndarray) -> tuple[np.ndarray, float]:
    """Values less their line by least squares, and the sum of squares of places about their middle."""
    places = np.arange(len(values)) - 0.5 * (len(values) - 1)
    spread = float(places @ places)
    return values - np.mean(values) - places * (float(places @ values) / spread), spread


def _spectral_noise(rest: np.ndarray) -> SlopeNoise:
    """The noise of the slope of a line from the lowest frequencies of the values about it."""
    n, size = len(rest), float(np.max(np.abs(rest)))
    if not size > 0:
        return SlopeNoise(0.0, 0.0)
    k = np.arange(2, min(MOST_FREQUENCIES + 2, n))  # the line has most of k = 1
    squares = 2 / n * (np.cos(math.pi / n * np.outer(k, np.arange(n) + 0.5)) @ (rest / size)) ** 2
    shapes = 1 + np.outer(RATIOS, (math.pi / (2 * n * np.sin(math.pi / (2 * n) * k))) ** 2)
    variances = np.maximum(np.mean(squares / shapes, axis=1), np.finfo(float).tiny)
    logarithms = -0.5 * (len(k) * np.log(variances) + np.log(shapes).sum(axis=1))
    prior = np.where(RATIOS == 0, WHITE, (1 - WHITE) / (len(RATIOS) - 1))
    weights = prior * np.exp(logarithms - logarithms.max())
    errors = size * np.sqrt(variances * (12 + 1.2 * math.pi**2 * RATIOS) / n**3)  # of the slope, for each ratio
    low, high = 0.0, 100 * float(errors.max())
    likely = [(w, e) for w, e in zip(weights / weights.sum(), errors, strict=True) if w > NEGLIGIBLE]
    while high - low > 1e-3 * high:
        limit = 0.5 * (low + high)
        chance = sum(weight * _two_tails(limit / error, len(k)) for weight, error in likely)
        low, high = (limit, high) if chance > CHANCE else (low, limit)
    return SlopeNoise(float(errors[np.argmax(weights)]), high)


def _two_tails(t: float, freedom: int) -> float:
    """The probability that |t| is exceeded, for Student's distribution; relative error below 0.1 at the limit.

    References:
        D. L. Wallace, Ann. Math. Statist. 30 (1959) 1121, doi:10.1214/aoms/1177706078 (normal deviates of t).
    """
    deviate = math.sqrt(freedom * math.log1p(t * t / freedom)) * (8 * freedom + 1) / (8 * freedom + 3)
    return math.erfc(deviate / math.sqrt(2))
