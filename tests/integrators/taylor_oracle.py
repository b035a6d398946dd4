"""Exact solutions of polynomial systems by their Taylor series: y_(n+1) = [f(y)]_n / (n + 1), in mpmath's numbers.

A field is a list of polynomials in the components, {exponents: coefficient}, as in `power_series_oracle`.
"""

from __future__ import annotations

import mpmath


def function(field):
    """The field as a function of y, for numbers of any kind."""

    def value(y):
        found = []
        for polynomial in field:
            total = 0 * y[0]
            for exponents, x in polynomial.items():
                term = x
                for i, power in enumerate(exponents):
                    for _ in range(power):
                        term = term * y[i]
                total = total + term
            found.append(total)
        return found

    return value


def taylor(field, y, count):
    """The first coefficients of the solution that starts in y, for each component."""
    series = [[x] for x in y]
    for n in range(1, count):
        slopes = [_value(polynomial, series, n) for polynomial in field]
        series = [[*s, slope[n - 1] / n] for s, slope in zip(series, slopes, strict=True)]
    return series


def _value(polynomial, series, count):
    total = [mpmath.mpf(0)] * count
    for exponents, x in polynomial.items():
        term = [mpmath.mpf(x.numerator) / x.denominator] + [mpmath.mpf(0)] * (count - 1)
        for i, power in enumerate(exponents):
            for _ in range(power):
                term = [mpmath.fdot(term[: n + 1], series[i][n::-1]) for n in range(count)]
        total = [a + b for a, b in zip(total, term, strict=True)]
    return total


def at(series, t):
    """The solution at time t."""
    return [mpmath.polyval(coefficients[::-1], t) for coefficients in series]
