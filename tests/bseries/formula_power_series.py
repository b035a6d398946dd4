"""Formulas evaluated on power series in h, cut after h^ORDER, with 50 digits: logarithms of maps without trees."""

from functools import reduce
from math import comb

import mpmath
import sympy

ORDER = 6
CONTEXT = mpmath.MPContext()
CONTEXT.dps = 50


def constant(number):
    numerator, denominator = sympy.Rational(number).as_numer_denom()
    return [CONTEXT.mpf(int(numerator)) / int(denominator)] + [CONTEXT.mpf(0)] * ORDER


def plus(*series):
    return [CONTEXT.fsum(terms) for terms in zip(*series, strict=True)]


def times(a, b):
    return [CONTEXT.fdot((a[i], b[n - i]) for i in range(n + 1)) for n in range(ORDER + 1)]


def scaled(number, a):
    return [number * x for x in a]


def times_h(a):
    return [CONTEXT.mpf(0), *a[:-1]]


def power(a, exponent):
    """Products, or from a y' = exponent a' y."""
    if exponent > 0 and exponent == int(exponent):
        return reduce(times, [a] * int(exponent))
    found = [a[0] ** exponent]
    for n in range(1, ORDER + 1):
        total = CONTEXT.fsum((exponent * k - (n - k)) * a[k] * found[n - k] for k in range(1, n + 1))
        found.append(total / (n * a[0]))
    return found


def sine_and_cosine(a):
    s, c = [CONTEXT.sin(a[0])], [CONTEXT.cos(a[0])]
    for n in range(1, ORDER + 1):
        s.append(CONTEXT.fsum(k * a[k] * c[n - k] for k in range(1, n + 1)) / n)
        c.append(-CONTEXT.fsum(k * a[k] * s[n - k] for k in range(1, n + 1)) / n)
    return s, c


def evaluate(formula, values):
    """A formula of rational numbers, sums, products, rational powers, sin and cos."""
    formula = sympy.Add(formula)
    if formula in values:
        return values[formula]
    if formula.is_Rational:
        return constant(formula)
    if formula.is_Pow:
        exponent = CONTEXT.mpf(formula.exp.p) / formula.exp.q
        return power(evaluate(formula.base, values), exponent)
    parts = [evaluate(part, values) for part in formula.args]
    if formula.is_Add:
        return plus(*parts)
    if formula.is_Mul:
        product = parts[0]
        for part in parts[1:]:
            product = times(product, part)
        return product
    return sine_and_cosine(parts[0])[0 if isinstance(formula, sympy.sin) else 1]


def logarithm_of_map(step, start):
    """For each component the coefficients of h¹ … h^ORDER of log Φ* applied to it, at a point.

    Σ_j (−1)^{j+1}/j (Φ* − 1)^j y with (Φ* − 1)^j y = Σ_k (−1)^{j−k} C(j,k) Φ^k(y).
    """
    iterate = [constant(number) for number in start]
    total = [constant(0) for _ in start]
    for k in range(ORDER + 1):
        weight = sum(sympy.Rational((-1) ** (k + 1) * comb(j, k), j) for j in range(max(k, 1), ORDER + 1))
        number = constant(weight)[0]
        total = [plus(t, scaled(number, component)) for t, component in zip(total, iterate, strict=True)]
        iterate = step(iterate)
    return [series[1:] for series in total]


def close(found, expected):
    """Whether numbers agree to 30 digits."""
    return all(abs(a - b) < 1e-30 * (1 + abs(b)) for a, b in zip(found, expected, strict=True))
