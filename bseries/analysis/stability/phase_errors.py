"""How closely the stability function follows exp(z): order for linear problems, dispersion and dissipation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import count, islice
from typing import Any

from bseries.analysis.stability import sturm
from bseries.analysis.stability.functions import Method, function_of, squared_gap


def linear_order(method: Method) -> int:
    """The largest p with R(z) = exp(z) + O(z^(p+1)): the order for linear systems with constant coefficients.

    Args:
        method: a Runge–Kutta method or its stability function; the order holds for every value of symbols.

    Example:
        >>> from integrators import method
        >>> linear_order(method("gauss3")), linear_order(method("heun3"))
        (6, 3)
    """
    R = function_of(method)
    residuals = _times_exponential(R.q, 1)
    # A rational function has contact of order deg P + deg Q with exp at most.
    for k in range(len(R.p) + len(R.q)):
        if next(residuals) - (R.p[k] if k < len(R.p) else 0):
            return k - 1
    return len(R.p) + len(R.q) - 2


def _times_exponential(p: Sequence[Any], sign: int) -> Iterator[Any]:
    """The power series of p(z) exp(±z)."""
    for m in count():
        yield sum((a * Fraction(sign ** (m - k), math.factorial(m - k)) for k, a in enumerate(p[: m + 1])), Fraction(0))


def dispersion_order(method: Method) -> int | None:
    """The largest q with phase error y − arg R(iy) = O(y^(q+1)) for y' = iy: always even.

    Args:
        method: a Runge–Kutta method or its stability function; the order holds for every value of symbols.

    Returns:
        The order; None if decimals or floats do not show the first power that differs.

    Example:
        >>> from integrators import method
        >>> dispersion_order(method("rk4")), dispersion_order(method("gauss2"))
        (4, 4)

    References:
        P. J. van der Houwen, B. P. Sommeijer, SIAM J. Numer. Anal. 24 (1987) 595–617, doi:10.1137/0724041.
    """
    R = function_of(method)
    # R(iy) exp(−iy) has the argument of P(z) Q(−z) exp(−z) at z = iy, whose imaginary part consists of the odd powers.
    product = sturm.multiply(R.p, sturm.reflect(R.q))
    series = islice(_times_exponential(product, -1), 2 * len(product) + 2)
    return next((m - 1 for m, a in enumerate(series) if m % 2 and a), None)


def dissipation_order(method: Method) -> int | None:
    """The largest r with amplification error 1 − |R(iy)| = O(y^(r+1)) for y' = iy: always odd.

    Args:
        method: a Runge–Kutta method or its stability function; the order holds for every value of symbols.

    Returns:
        The order; None if it is infinite, |R(iy)| being 1 for all y.

    Example:
        >>> from integrators import method
        >>> dissipation_order(method("rk4")), dissipation_order(method("gauss2"))
        (5, None)

    References:
        P. J. van der Houwen, B. P. Sommeijer, SIAM J. Numer. Anal. 24 (1987) 595–617, doi:10.1137/0724041.
    """
    # 1 − |R|² = E / |Q|², and |Q(0)| = 1.
    return next((2 * k - 1 for k, a in enumerate(squared_gap(function_of(method))) if a), None)
