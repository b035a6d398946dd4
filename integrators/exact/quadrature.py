"""Gauss–Legendre quadrature to any number of digits."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import Any


@cache
def gauss_legendre(count: int, digits: int = 40) -> tuple[tuple[Fraction, Fraction], ...]:
    """Nodes, in ascending order, and weights on [0, 1]; exact for polynomials of degree 2 count − 1.

    Example:
        >>> [(round(float(x), 10), float(weight)) for x, weight in gauss_legendre(2)]
        [(0.2113248654, 0.5), (0.7886751346, 0.5)]

    References:
        F. Johansson, M. Mezzarobba, SIAM J. Sci. Comput. 40 (2018) C726–C747, doi:10.1137/18M1170133.
    """
    import flint

    def midpoint(ball: Any) -> Fraction:
        mantissa, exponent = ball.mid().man_exp()
        return int(mantissa) * Fraction(2) ** int(exponent)

    with flint.ctx.workdps(digits + 10):
        pairs = [flint.arb.legendre_p_root(count, k, weight=True) for k in reversed(range(count))]
        return tuple((midpoint((1 + node) / 2), midpoint(weight / 2)) for node, weight in pairs)
