"""Shadow energies as exact formulas: against closed forms, the modified Hamiltonian, and steps in high precision."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest
import sympy
from shadow_oracles import evaluated, step_by_step

from bseries.shadow.formulas import ShadowFormula, shadow_formula
from integrators import Scene, scene

ORDERS = range(2, 26, 2)


def quartic():
    start = {"p": ["1/10", "2/5"], "q": ["3/10", "1/5"]}
    energy = "p1^2/4 + p2^2/6 + q1^2/2 + q2^2 + q1^2*q2 - q2^3/3 + q1*q2^3/5 + q1^4/7"
    return Scene({"p": 2, "q": 2}, hamiltonian=energy, start=start)


CASES = {
    "pendulum": (lambda: scene("pendulum"), [1]),
    "two masses": (quartic, [2, 3]),
    "three Lennard-Jones particles": (lambda: scene("lennard-jones", particles=3), [1] * 6),
}


@pytest.mark.parametrize("name", CASES)
def test_each_order_is_constant_up_to_its_power_of_h(name):
    make, masses = CASES[name]
    with mpmath.workdps(110):
        scale = mpmath.mpf(1) / (200 if "Jones" in name else 40)
        changes = {}
        for parts in (1, 2):
            h = scale / parts
            states = step_by_step(make(), masses, h, 30 * parts)
            for order in ORDERS:
                one, other = (evaluated(shadow_formula(order), states, masses, h, n * parts) for n in (7, 20))
                changes[order, parts] = other - one
        for order in ORDERS:
            measured = mpmath.log(abs(changes[order, 1] / changes[order, 2]), 2)
            assert abs(measured - order) < 0.35, (order, measured)


def test_the_harmonic_oscillator_has_its_closed_form():
    """Kick–drift–kick turns by ψ with cos ψ = 1 − (hω)²/2: H̃ = ψ (p² + ω² (1 − (hω)²/4) q²) / (2 sin ψ)."""
    oscillator = Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 + 9*q^2/2", start={"p": ["1/3"], "q": ["2/5"]})
    with mpmath.workdps(80):
        errors = {}
        for parts in (1, 2):
            h = mpmath.mpf(1) / (30 * parts)
            states = step_by_step(oscillator, [1], h, 12)
            (p,), _, (g,) = states[6]
            q, psi = g / 9, mpmath.acos(1 - 9 * h * h / 2)
            exact = psi / mpmath.sin(psi) * (p * p + 9 * (1 - 9 * h * h / 4) * q * q) / 2
            for order in ORDERS:
                errors[order, parts] = abs(evaluated(shadow_formula(order), states, [1], h, 6) - exact)
        for order in ORDERS:
            assert errors[order, 1] < mpmath.mpf("0.2") ** order
            # the states differ, but their energies hardly: the error itself goes like the power
            assert 2 ** (order - 1) < errors[order, 1] / errors[order, 2] < 2 ** (order + 1)


def taylor(formula: ShadowFormula, most: int):
    """The coefficients of h^0 … h^(most−1) of a formula in one degree of freedom, for any potential U."""
    h, p = sympy.symbols("h p")
    u = sympy.symbols(f"u:{most + 1}")  # the derivatives of U at q

    def cut(expression):
        expanded = sympy.Poly(expression, h)
        return sum(c * h**k for (k,), c in expanded.terms() if k < most)

    def at(d, k):  # the k-th derivative of U at q + d
        total, power = 0, sympy.Integer(1)
        for j in range(most - k + 1):
            total += u[k + j] * power / sympy.factorial(j)
            power = cut(sympy.expand(power * d))
        return cut(sympy.expand(total))

    states = {0: (u[0], u[1])}
    for sign in (1, -1):
        d, momentum, g = sympy.Integer(0), p, u[1]
        for n in range(1, formula.reach + 1):
            half = momentum - sign * h / 2 * g
            d = cut(sympy.expand(d + sign * h * half))
            g = at(d, 1)
            momentum = cut(sympy.expand(half - sign * h / 2 * g))
            states[sign * n] = at(d, 0), g
    value = p**2 / 2 + sum(
        sympy.Rational(w) * states[s * i][0] for i, w in enumerate(formula.potentials) for s in ((1, -1) if i else (1,))
    )
    value += h * p * sum(sympy.Rational(a) * (states[i][1] - states[-i][1]) for i, a in enumerate(formula.works, 1))
    value += h**2 * sum(sympy.Rational(b) * states[i][1] * states[j][1] for (i, j), b in formula.products.items())
    return p, u, sympy.Poly(sympy.expand(value), h)


@pytest.mark.parametrize("order", [4, 6, 8])
def test_the_expansion_is_the_modified_hamiltonian_of_kick_drift_kick(order):
    """The terms in h² and h⁴ for one degree of freedom and any U (HLW, section IX.3; brackets of example 6)."""
    p, u, value = taylor(shadow_formula(order), 6)
    terms = {0: p**2 / 2 + u[0], 2: p**2 * u[2] / 12 - u[1] ** 2 / 24}
    if order > 4:
        terms[4] = -(p**4) * u[4] / 720 + p**2 * u[1] * u[3] / 120 + p**2 * u[2] ** 2 / 60 - u[1] ** 2 * u[2] / 240
    for power in range(min(order, 6)):
        assert sympy.expand(value.coeff_monomial(value.gen**power) - terms.get(power, 0)) == 0


def test_a_wrong_factor_of_works_changes_the_expansion():
    formula = shadow_formula(6)
    _, _, value = taylor(formula, 3)
    _, _, other = taylor(ShadowFormula(6, formula.potentials, (Fraction(1, 48),), formula.products), 3)
    assert sympy.expand(value.coeff_monomial(value.gen**2) - other.coeff_monomial(other.gen**2)) != 0


@pytest.mark.parametrize("order", ORDERS)
def test_formulas_look_at_few_steps_and_amplify_no_rounding(order):
    formula = shadow_formula(order)
    weights = [formula.potentials[0], *(2 * w for w in formula.potentials[1:])]
    assert formula.reach == order // 4
    assert sum(weights) == 1
    assert min(weights) > 0
    assert all(formula.products[i, j] == formula.products[-j, -i] for i, j in formula.products)


def test_a_wrong_weight_spoils_the_order():
    formula = shadow_formula(8)
    other = tuple(w + Fraction(s, 10**6) for w, s in zip(formula.potentials, (2, -1, 0), strict=True))
    wrong = ShadowFormula(8, other, formula.works, formula.products)
    with mpmath.workdps(50):
        changes = []
        for parts in (1, 2):
            h = mpmath.mpf(1) / (40 * parts)
            states = step_by_step(scene("pendulum"), [1], h, 30 * parts)
            changes.append(evaluated(wrong, states, [1], h, 20 * parts) - evaluated(wrong, states, [1], h, 7 * parts))
        assert abs(mpmath.log(abs(changes[0] / changes[1]), 2) - 2) < 0.5


@pytest.mark.parametrize("order", [0, 3, 26, -4, 4.0, "4", None])
def test_other_orders_are_refused(order):
    with pytest.raises(ValueError, match="order must be an even number from 2 to 24, but was"):
        shadow_formula(order)
