"""Where a method is stable: how far along the real and the imaginary axis, and in which sector."""

from __future__ import annotations

import cmath
import math
from fractions import Fraction
from typing import Any

from bseries.analysis.stability import sturm
from bseries.analysis.stability.field_elements import midpoint, upper
from bseries.analysis.stability.functions import Method, function_of, is_a_stable, stability_gap
from bseries.analysis.stability.inexact import nearest_float
from bseries.analysis.stability.rational_functions import StabilityFunction

ANGLE_STEPS = 30
"""Bisections of the tangent of half an angle: 10^-7 degrees."""


def real_stability_interval(method: Method) -> float | None:
    """The largest x with |R| ≤ 1 on the real interval [−x, 0].

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The length, the float nearest to an exactly isolated root; ``inf`` if the interval has no end, None where it
        depends on symbols, or hangs on roots of too high a degree.

    Example:
        >>> from integrators import method
        >>> real_stability_interval(method("rk4"))
        2.785293563405282

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.2.
    """
    R = function_of(method)
    if not R.has_signs:
        return None
    # |Q|² − |P|² is the product of Q − P and Q + P, which have no root in common.
    factors = (sturm.reflect(sturm.combine(R.q, R.p, sign)) for sign in (-1, 1))
    return min(_length(sturm.first_crossing(sturm.strip(map(upper, factor)))) for factor in factors)


def imaginary_stability_interval(method: Method) -> float | None:
    """The largest y with |R| ≤ 1 on the imaginary interval [−iy, iy].

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        As `real_stability_interval`; 0.0 where |R(iy)| > 1 for all small y.

    Example:
        >>> from integrators import method
        >>> imaginary_stability_interval(method("rk4")), imaginary_stability_interval(method("heun2"))
        (2.8284271247461903, 0.0)

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.2.
    """
    R = function_of(method)
    return math.sqrt(_length(sturm.first_crossing(stability_gap(R)))) if R.has_signs else None


def _length(crossing: Fraction | float | None) -> float:
    return math.inf if crossing is None else crossing if isinstance(crossing, float) else nearest_float(crossing)


def stability_angle(method: Method) -> float | None:
    """The largest α for which the method is A(α)-stable: |R(z)| ≤ 1 wherever |arg(−z)| ≤ α.

    Each ray is decided exactly, its direction having a rational tangent of half the angle; the angle is bisected.

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The angle in degrees within 10^-7: 90.0 for A-stable methods, 0.0 if the negative real axis is all that is
        stable, or not even that; None where it depends on symbols, or hangs on roots of too high a degree.

    Example:
        >>> round(stability_angle(StabilityFunction([1], [1, -1, "1/2", "-1/6"])), 2)
        88.23

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, Definition IV.3.9.
    """
    R = function_of(method)
    stable = is_a_stable(R)
    if stable is not False:
        return 90.0 if stable else None
    if not R.has_signs or not _is_stable_ray(R, Fraction(0)):  # without signs only polynomials are decided
        return 0.0
    stable_to, unstable_from = Fraction(0), Fraction(1)
    nearest_pole = min((abs(math.pi - abs(cmath.phase(pole))) for pole in R.poles), default=math.pi)
    for _ in range(ANGLE_STEPS):
        middle = (stable_to + unstable_from) / 2
        if 2 * math.atan(middle) < nearest_pole and _is_stable_ray(R, middle):
            stable_to = middle
        else:
            unstable_from = middle
    return math.degrees(2 * math.atan(stable_to))


def _is_stable_ray(R: StabilityFunction, tangent: Fraction) -> bool:
    """Whether |R| ≤ 1 on the ray z = −x exp(iα), with tan(α/2) given.

    The coefficient of (−x)^(j+k) in |Q|² is q_j q_k cos((j − k) α), and cosines of multiples of α are Chebyshev
    polynomials of cos α.
    """
    size = max(len(R.p), len(R.q))
    p, q = ([*map(midpoint, values), *[Fraction(0)] * (size - len(values))] for values in (R.p, R.q))
    cosines = [Fraction(1), (1 - tangent**2) / (1 + tangent**2)]
    while len(cosines) < size:
        cosines.append(2 * cosines[1] * cosines[-1] - cosines[-2])
    gap: list[Any] = [Fraction(0)] * (2 * size - 1)
    for j in range(size):
        for k in range(size):
            gap[j + k] = gap[j + k] + (-1) ** (j + k) * cosines[abs(j - k)] * (q[j] * q[k] - p[j] * p[k])
    return sturm.is_nonnegative(sturm.strip(gap))
