"""Compiled shadow energies and their statistics; states are columns of arrays (coordinates, steps).

Everything is mass-weighted: q̂ = M^(1/2) q, p̂ = M^(−1/2) p, ĝ = M^(−1/2) ∇U, so that masses do not appear.
"""

from __future__ import annotations

from typing import Any

from trees.compiled import float_kernel


@float_kernel
def shadow_values(
    h: Any, p: Any, g: Any, u: Any, weights: Any, works: Any, products: Any, power: Any, product: Any, out: Any
) -> None:
    """Write the shadow energies at all steps but the first and last few to out, (orders, steps − 2 reach).

    The formulas are rows: weights of potentials and `works` from the middle outwards, and for each lag the factors of
    g_i·g_(i + lag) from i = −reach to reach. Scalar products are computed once for all orders, in `power` (shifts,
    steps) and `product` (lags, steps).
    """
    coordinates, steps = p.shape
    orders, reach = weights.shape[0], weights.shape[1] - 1
    power[:, :] = 0.0
    product[:, :] = 0.0
    for d in range(coordinates):
        for n in range(steps):
            power[0, n] += 0.5 * p[d, n] * p[d, n]
        for i in range(1, power.shape[0]):
            for n in range(i, steps - i):
                power[i, n] += p[d, n] * (g[d, n + i] - g[d, n - i])
        for lag in range(product.shape[0]):
            for n in range(steps - lag):
                product[lag, n] += g[d, n] * g[d, n + lag]
    width = steps - 2 * reach
    for order in range(orders):
        row = out[order]
        for n in range(width):
            row[n] = power[0, n + reach] + weights[order, 0] * u[n + reach]
        for i in range(1, reach + 1):
            weight = weights[order, i]
            if weight != 0.0:
                for n in range(width):
                    row[n] += weight * (u[n + reach + i] + u[n + reach - i])
        for i in range(1, power.shape[0]):
            factor = h * works[order, i]
            if factor != 0.0:
                for n in range(width):
                    row[n] += factor * power[i, n + reach]
        for lag in range(product.shape[0]):
            for i in range(2 * reach + 1):
                factor = h * h * products[order, lag, i]
                if factor != 0.0:
                    for n in range(width):
                        row[n] += factor * product[lag, n + i]


@float_kernel
def add_values(values: Any, first: Any, moments: Any, blocks: Any, position: Any, size: Any) -> None:
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
