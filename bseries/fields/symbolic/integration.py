"""Integration of gradients, variable by variable, by rules for sums of simple products."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import sympy

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.differential_rings import DifferentialRing
from bseries.fields.symbolic.polynomials import Element

MOST_POWERS = 60
"""Higher powers of sines or of polynomials are not expanded."""


def potential(ring: DifferentialRing, gradient: Sequence[Element]) -> sympy.Expr | None:
    """Integrate a vector of formulas that is known to be a gradient; None if no rule applies.

    There are rules for powers of polynomials that are linear, or quadratic and even, in a variable, for trigonometric
    polynomials and for exponentials. The function is verified by differentiation.

    Example:
        >>> import sympy
        >>> from bseries.fields.symbolic.differential_rings import DifferentialRing
        >>> p, q = sympy.symbols("p q")
        >>> ring = DifferentialRing([p - 1 / p, sympy.sin(q) ** 2], [p, q])
        >>> potential(ring, ring.elements)
        p**2/2 + q/2 - log(p) - sin(2*q)/4
    """
    found: Any = sympy.Integer(0)
    for i, x in enumerate(ring.variables):
        rest = gradient[i] - ring.derivative(ring.element(found), i)
        part = antiderivative(ring.to_expression(rest, simplify=False), x)
        if part is None:
            return None
        found += part
    inverse = (ring.derivative(ring.element(found), i) for i in range(len(gradient)))
    return found if all(ring.is_zero(a - b) for a, b in zip(gradient, inverse, strict=True)) else None


def antiderivative(formula: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """An antiderivative of a sum of products; None if no rule applies to a product."""
    coefficients: dict[Any, list[Any]] = defaultdict(list)
    for term in sympy.Add.make_args(formula):
        coefficient, part = term.as_independent(x, as_Add=False) if term.has(x) else (term, sympy.Integer(1))
        coefficients[part].append(coefficient)
    try:
        integrals = {part: sympy.Add.make_args(_of_product(part, x)) for part in coefficients}
    except _NoRule:
        return None
    return sympy.Add(*(c * term for part, factors in coefficients.items() for c in factors for term in integrals[part]))


class _NoRule(SeriesError):
    """No rule integrates a product."""


def _of_product(product: Any, x: Any) -> Any:
    """∫ x^m f dx, where f is a product of sines and cosines, an exponential, or a power Q(x)^e."""
    power: Any = sympy.Integer(0)
    growth: Any = sympy.Integer(0)
    waves: list[tuple[Any, int]] = []
    others: list[tuple[Any, Any]] = []
    for factor in sympy.Mul.make_args(product):
        base, exponent = factor.as_base_exp()
        if base == x and not exponent.has(x):
            power += exponent
        elif isinstance(factor, sympy.exp):
            growth += factor.args[0]
        elif isinstance(base, sympy.sin | sympy.cos) and exponent.is_Integer and 0 < exponent <= MOST_POWERS:
            waves.append((base, int(exponent)))
        elif factor != 1:
            others.append((base, exponent))
    kinds = bool(growth) + bool(waves) + len(others)
    if kinds > 1:
        raise _NoRule
    if others:
        base, exponent = others[0]
        return _of_polynomial_power(power, base, exponent, x)
    if kinds == 0:
        return sympy.log(x) if power == -1 else x ** (power + 1) / (power + 1)
    sums = _superposition(waves) if waves else {sympy.exp(growth): 1}
    return sum(c * _by_parts(_degree(power), wave, x) for wave, c in sums.items())


def _degree(power: Any) -> int:
    if not power.is_Integer or not 0 <= power <= MOST_POWERS:
        raise _NoRule
    return int(power)


def _by_parts(m: int, wave: Any, x: Any) -> Any:
    """∫ x^m e^(kx+c) dx, also with sin, cos or 1 in place of exp, by parts."""
    if not wave.has(x):
        return wave * x ** (m + 1) / (m + 1)
    k = wave.args[0].diff(x)
    if k.has(x) or not k:
        raise _NoRule
    integrals = {sympy.exp: sympy.exp, sympy.sin: lambda argument: -sympy.cos(argument), sympy.cos: sympy.sin}
    inner = integrals[type(wave)](wave.args[0]) / k
    if m == 0:
        return inner
    coefficient, other = inner.as_independent(x, as_Add=False)
    return x**m * inner - m * coefficient * _by_parts(m - 1, other, x)


def _superposition(waves: Sequence[tuple[Any, int]]) -> dict[Any, Any]:
    """A product of powers of sines and cosines as a trigonometric sum, by cos b = (e^(ib) + e^(−ib))/2."""
    total: dict[Any, Any] = {sympy.Integer(0): sympy.Integer(1)}  # coefficients of e^(ia) by argument a
    for base, times in waves:
        plus, minus = (1, 1) if isinstance(base, sympy.cos) else (-sympy.I, sympy.I)
        for _ in range(times):
            longer: dict[Any, Any] = defaultdict(lambda: sympy.Integer(0))
            for a, c in total.items():
                longer[a + base.args[0]] += plus * c / 2
                longer[a - base.args[0]] += minus * c / 2
            total = longer
    found: dict[Any, Any] = defaultdict(lambda: sympy.Integer(0))
    for a, c in total.items():
        for formula, factor in ((sympy.cos(a), sympy.re(c)), (sympy.sin(a), -sympy.im(c))):
            sign, wave = formula.as_coeff_Mul()
            found[wave] += sign * factor
    return {wave: c for wave, c in found.items() if c}


def _of_polynomial_power(m: Any, base: Any, exponent: Any, x: Any) -> Any:
    """∫ x^m Q^e dx by the substitution u = Q, for Q = αx + β or, with odd m, Q = αx² + β."""
    if exponent.has(x) or not base.is_polynomial(x):
        raise _NoRule
    coefficients = sympy.Poly(base, x).all_coeffs()
    degree = len(coefficients) - 1
    leading, constant, rest = coefficients[0], coefficients[-1], coefficients[1:-1]
    times, odd = divmod(_degree(m) - (degree - 1), degree)
    if degree > 2 or any(rest) or times < 0 or odd:
        raise _NoRule
    total = sympy.Integer(0)
    for j in range(times + 1):  # x^m dx = ((u − β)/α)^times du / (degree α)
        power = exponent + j
        integral = sympy.log(base) if power == -1 else base ** (power + 1) / (power + 1)
        total += math.comb(times, j) * (-constant) ** (times - j) * integral
    return total / (degree * leading ** (times + 1))
