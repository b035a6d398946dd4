"""Gauss's quadrature formulas in more digits than doubles have."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from .nodes import DECIMALS

if TYPE_CHECKING:
    import sympy

    Rule = tuple[tuple[sympy.Rational, sympy.Rational], ...]
    """Nodes and weights."""


@cache
def gauss_legendre(count: int) -> Rule:
    """Gauss's formula on [0, 1], exact for polynomials of degree 2 count − 1.

    Args:
        count: The number of nodes.

    Returns:
        Nodes in ascending order, and weights, to 40 digits.

    Example:
        >>> [(x.n(10), weight) for x, weight in gauss_legendre(2)]
        [(0.2113248654, 1/2), (0.7886751346, 1/2)]

    References:
        Abramowitz, Stegun, *Handbook of Mathematical Functions*, formula 25.4.29.
    """
    import mpmath
    import sympy

    def rational(x: Any) -> Any:
        return sympy.Rational(mpmath.nstr(x, DECIMALS))

    pairs: list[tuple[sympy.Rational, sympy.Rational]] = []
    with mpmath.workdps(DECIMALS + 10):
        for k in range(count, 0, -1):
            x = mpmath.cos(mpmath.pi * (k - mpmath.mpf(1) / 4) / (count + mpmath.mpf(1) / 2))
            for _ in range(8):  # Newton's iteration doubles at least two correct digits each time
                value, slope = _legendre(count, x)
                x -= value / slope
            _, slope = _legendre(count, x)
            pairs.append((rational((1 + x) / 2), rational(1 / ((1 - x * x) * slope * slope))))
    return tuple(pairs)


def _legendre(n: int, x: Any) -> tuple[Any, Any]:
    """Legendre's polynomial P_n and its derivative."""
    before, value = 0 * x, 1 + 0 * x
    for j in range(1, n + 1):
        before, value = value, ((2 * j - 1) * x * value - (j - 1) * before) / j
    return value, n * (x * value - before) / (x * x - 1)
