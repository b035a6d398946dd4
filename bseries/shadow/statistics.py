"""Statistics of shadow energies in one pass: sums, and blocks of steps that grow with the length of the trajectory."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from trees.compiled import float_kernel

BLOCKS = 2048
LEAST_BLOCKS = 16
"""Least number of blocks for an error estimate."""
WANDERS = 2.5
"""Ratio of squared differences of distant and neighbouring blocks from which on values are a random walk."""


class OrderStatistics(NamedTuple):
    """Statistics of the shadow energy of one order along a trajectory."""

    order: int  # the order; 2 is the energy itself
    mean: float  # its mean
    deviation: float  # half its range
    scatter: float  # its standard deviation about a straight line in time
    gap: float | None  # half the range of its difference to the order before; None for order 2
    drift: float  # the slope of the line by least squares, in energy per time
    drift_error: float  # the standard error of the slope, with correlations in time taken into account


@float_kernel
def add_values(values, first, moments, blocks, position, size):
    """Add values (orders, steps) to the statistics.

    Args:
        values: Values at consecutive steps.
        first: The value of step 0 for each order, which is subtracted.
        moments: For each order the sums of v, n v and v², the extremes of v, and those of its difference to the order
            before.
        blocks: For each order and block the sum and the extremes of v.
        position: The number of the first step.
        size: The number of steps in a block.
    """
    orders, steps = values.shape
    for order in range(orders):
        total, sums, before = moments[order], blocks[order], max(order - 1, 0)
        for k in range(steps):
            n = position + k
            v = values[order, k] - first[order]
            lower = values[before, k] - first[before]
            total[0] += v
            total[1] += n * v
            total[2] += v * v
            total[3], total[4] = min(total[3], v), max(total[4], v)
            total[5], total[6] = min(total[5], v - lower), max(total[6], v - lower)
            block = sums[n // size]
            block[0] += v
            block[1], block[2] = min(block[1], v), max(block[2], v)


class Statistics:
    """Statistics of the shadow energies of several orders after any number of steps, in constant memory."""

    def __init__(self, orders: tuple[int, ...]):
        self.orders, self.count, self.size = orders, 0, 1
        self.first = np.zeros(len(orders))
        self._moments = np.zeros((len(orders), 7))
        self._moments[:, [3, 5]], self._moments[:, [4, 6]] = np.inf, -np.inf
        self._blocks = _empty(len(orders), BLOCKS)

    def add(self, values: np.ndarray) -> None:
        """Add the values (orders, steps) of the next steps."""
        if not self.count:
            self.first = values[:, 0].copy()
        done = 0
        while done < values.shape[1]:
            if self.count == BLOCKS * self.size:
                self._merge()
            taken = values[:, done : done + BLOCKS * self.size - self.count]
            add_values.compiled(taken, self.first, self._moments, self._blocks, self.count, self.size)
            self.count += taken.shape[1]
            done += taken.shape[1]

    def _merge(self) -> None:
        """Merge blocks in pairs."""
        pairs, merged = self._blocks, _empty(len(self.orders), BLOCKS)
        one, other, half = pairs[:, ::2], pairs[:, 1::2], BLOCKS // 2
        merged[:, :half, 0] = one[..., 0] + other[..., 0]
        merged[:, :half, 1] = np.minimum(one[..., 1], other[..., 1])
        merged[:, :half, 2] = np.maximum(one[..., 2], other[..., 2])
        self._blocks, self.size = merged, 2 * self.size

    def blocks(self) -> np.ndarray:
        """Mean, least and largest values of full blocks, (orders, blocks, 3), relative to the first value."""
        found = self._blocks[:, : self.count // self.size].copy()
        found[..., 0] /= self.size
        return found

    def results(self, h: float) -> tuple[OrderStatistics, ...]:
        """The statistics so far, for steps of size h."""
        blocks = self.blocks()
        return tuple(self._of_order(k, h, blocks[k, :, 0]) for k in range(len(self.orders)))

    def _of_order(self, k: int, h: float, means: np.ndarray) -> OrderStatistics:
        n = self.count
        total, weighted, squares, least, largest, least_gap, largest_gap = map(float, self._moments[k])
        slope = (weighted - 0.5 * (n - 1) * total) * 12 / (n * (n * n - 1.0))
        about_line = squares - total * total / n - slope * slope * n * (n * n - 1.0) / 12
        return OrderStatistics(
            order=self.orders[k],
            mean=float(self.first[k]) + total / n,
            deviation=0.5 * (largest - least),
            scatter=math.sqrt(max(about_line, 0.0) / (n - 2)),
            gap=0.5 * (largest_gap - least_gap) if k else None,
            drift=slope / h,
            drift_error=slope_error(means) / (self.size * abs(h)),
        )


def slope_error(means: np.ndarray) -> float:
    """The standard error per block of the slope of a line through the means of blocks.

    Blocks are merged until few are left, and the largest error is used: it grows as long as neighbouring blocks are
    correlated, then stays constant. Random walks are taken into account as well.

    References:
        Flyvbjerg, Petersen, J. Chem. Phys. 91 (1989) 461, doi:10.1063/1.457480 (blocks).
    """
    errors, width = [0.0], 1
    while len(means) >= LEAST_BLOCKS:
        rest, spread = _about_line(means)
        errors.append(math.sqrt(float(rest @ rest) / (len(means) - 2) / spread) / width)
        if len(means) < 4 * LEAST_BLOCKS:
            errors.append(math.sqrt(1.2 * _diffusion(rest) / len(means)) / width)  # of a random walk's slope
        means, width = means[: len(means) // 2 * 2].reshape(-1, 2).mean(axis=1), 2 * width
    return max(errors)


def _about_line(means: np.ndarray) -> tuple[np.ndarray, float]:
    """The residuals of the least-squares line through values, and the sum of squares of their places."""
    places = np.arange(len(means)) - 0.5 * (len(means) - 1)
    spread = float(places @ places)
    return means - np.mean(means) - places * (float(places @ means) / spread), spread


def _diffusion(rest: np.ndarray) -> float:
    """The variance that a random walk gains per block; zero if differences do not grow with distance."""
    far = len(rest) // 4
    near, distant = (float(np.mean((rest[k:] - rest[:-k]) ** 2)) for k in (1, far))
    return (distant - near) / (far - 1) if distant > WANDERS * near else 0.0


def _empty(orders: int, blocks: int) -> np.ndarray:
    table = np.zeros((orders, blocks, 3))
    table[..., 1], table[..., 2] = np.inf, -np.inf
    return table
