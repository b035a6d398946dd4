"""Stiff scenes: implicit methods converge or say that they do not; explicit ones overflow and say so."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import bseries as bs

pytestmark = pytest.mark.slow

RATES = [Fraction(10) ** k for k in range(-8, 9, 2)]
"""λ of y' = −λy; with h = 1 they are −λh."""
DAMPED = bs.scene("linear", matrix=[[-rate * (i == j) for j in range(len(RATES))] for i, rate in enumerate(RATES)])
DECAY = "y' = −λy, λh = 1e-8 … 1e8"


def states_of(method, solver="auto", steps=1):
    """The state after some steps of size 1."""
    return bs.integrate(method, DAMPED, h=1, steps=steps, save_every=None, solver=solver).y[:, -1]


def runge_kutta(name: str) -> bs.RungeKutta:
    method = bs.method(name)
    assert isinstance(method, bs.RungeKutta)
    return method


def factors(method):
    """What one step multiplies by, exactly."""
    R = bs.stability_function(runge_kutta(method))
    return [Fraction(R(-rate)) for rate in RATES]


def distances(values, exact):
    return [abs(float(Fraction(float(value)) - x)) for value, x in zip(values, exact, strict=True)]


@pytest.mark.parametrize("method", ["implicit-euler", "gauss2", "gauss5", "radau-iia3", "lobatto-iiic3"])
def test_linear_systems_over_sixteen_powers_of_ten(method, measured):
    error = max(distances(states_of(method), factors(method)))
    measured.within(f"{DECAY}: {method}, error of one step against R(−λh)", error, 1e-15)
    assert max(distances(states_of(method), factors("implicit-midpoint"))) > 1e-3


@pytest.mark.parametrize("method", ["trapezoidal", "lobatto-iiia3"])
def test_an_explicit_first_stage_costs_digits(method, measured):
    """h f(y0) = −λh y0 is subtracted again: rounding errors are relative to that."""
    found = distances(states_of(method), factors(method))
    lost = max(error / max(1.0, float(rate)) for error, rate in zip(found, RATES, strict=True))
    case = f"{DECAY}: {method} (first stage explicit), error of one step"
    measured.within(case, lost * 2.0**52, 1, " · 2⁻⁵² max(1, λh)")
    assert max(found) > 1e-12


def test_decay_and_what_is_conserved_over_many_steps(measured):
    """L-stable methods forget stiff components at once; Gauss's methods keep |R| = 1 for λh = ±1e8 i."""
    left = states_of("radau-iia3", steps=1000)[RATES.index(Fraction(10**8))]
    assert left == 0
    measured.said("y' = −λy, λh = 1e8: radau-iia3 after 1000 steps", "0", f"{left:g}")
    wave = bs.scene("linear", matrix=[[0, -(10**8)], [10**8, 0]])
    run = bs.integrate("gauss2", wave, h=1, steps=1000, observe="squared_norm")
    change = float(abs(run.observed["squared_norm"] / 2 - 1).max())
    measured.within(
        "y'' = −λ²y, λh = 1e8: gauss2, change of the squared norm in 1000 steps", change * 2.0**53, 1000, " · 2⁻⁵³",
        form=".0f",
    )  # fmt: skip
    damped = bs.integrate("implicit-euler", wave, h=1, steps=1, observe="squared_norm").observed["squared_norm"]
    assert damped[-1] < 1e-15


@pytest.mark.parametrize("method", ["implicit-euler", "gauss2"])
def test_fixed_points_say_that_they_do_not_converge(method, measured):
    with pytest.raises(
        bs.integrators.StepError, match=f"small enough for {method} on linear, .* step 1, from t = 0, did not conv"
    ):
        states_of(method, solver="fixed-point")
    slow = bs.scene("linear", matrix=[["-1/10"]])
    assert bs.integrate(method, slow, h=1, steps=3, solver="fixed-point").y.shape == (1, 4)
    case = f"{DECAY}: {method} by fixed-point iteration alone"
    measured.said(case, "StepError", "“… step 1, from t = 0, did not converge”")


def test_a_step_onto_a_pole_is_refused(measured):
    """1 − λh = 0: the equations of the stage have no solution, and next to it they have a large one.

    Of 2⁻⁴⁰ = 1 − h, rounding of λh to 53 bits leaves 13.
    """
    with pytest.raises(
        bs.integrators.StepError, match="but with h = 1 step 1, from t = 0, did not end in finite numbers"
    ):
        bs.integrate("implicit-euler", bs.scene("linear", matrix=[[1]]), h=1, steps=1)
    beside = 1 - 2.0**-40
    end = bs.integrate("implicit-euler", bs.scene("linear", matrix=[[1]]), h=beside, steps=1).y[0, -1]
    measured.said("y' = y, implicit-euler at the pole h = 1 of R", "StepError", "“… did not end in finite numbers”")
    case = "y' = y, implicit-euler at h = 1 − 2⁻⁴⁰, against 2⁴⁰"
    measured.within(case, abs(end / 2**40 - 1) * 2.0**13, 1, " · 2⁻¹³", what="relative error")


def test_explicit_methods_overflow_and_say_so(measured):
    assert distances(states_of("rk4"), factors("rk4"))[-1] < 1e-15 * abs(factors("rk4")[-1])
    with pytest.raises(
        bs.integrators.StepError, match=r"rk4 on linear, but with h = 1 step \d+, .* did not end in finite"
    ) as found:
        states_of("rk4", steps=100)
    kept = found.value.trajectory
    assert kept is not None
    assert np.isfinite(kept.y).all()
    assert kept.t[-1] == found.value.step - 1
    measured.said(
        f"{DECAY}: rk4, 100 steps, amplified by 4e30 in each", "StepError with all states before", f"“{found.value}”"
    )


# Van der Pol's equation, ε = 10⁻⁶


def test_the_slow_part_of_van_der_pol(measured):
    """Along the slow part nothing is stiff, and what is left is the order, 5: h⁵ = 1e-10 (order 3 leaves 1e-8)."""
    stiff, h = bs.scene("van-der-pol"), 0.01
    exact = bs.reference_solution(stiff, ["1/2"])[:, 0]

    def error(method):
        return float(abs(bs.integrate(method, stiff, h=h, steps=50, save_every=None).y[:, -1] - exact).max())

    case = "van-der-pol (ε = 1e-6), radau-iia3, h = 0.01, along the slow part to t = 0.5: error"
    measured.within(case, error("radau-iia3"), h**5)
    assert error("radau-iia2") > 10 * h**5
    with pytest.raises(bs.integrators.StepError, match="did not end in finite numbers"):
        bs.integrate("rk4", stiff, h=h, steps=50)


@pytest.mark.parametrize("method", ["implicit-euler", "radau-iia3"])
def test_the_jump_of_van_der_pol_ends_the_run(method, measured):
    """The slow solution ends at t = 0.807, and jumps within a time of about ε."""
    with pytest.raises(
        bs.integrators.StepError, match=f"small enough for {method} on van-der-pol, .* did not converge"
    ) as found:
        bs.integrate(method, bs.scene("van-der-pol"), h=1e-3, steps=2000)
    kept = found.value.trajectory
    assert kept is not None
    assert np.isfinite(kept.y).all()
    assert (kept.y[:, -1] == found.value.y).all()
    assert 0.79 < kept.t[-1] < 0.815
    measured.said(
        f"van-der-pol, {method}, h = 1e-3, at the jump (t = 0.807)", "StepError with all states before",
        f"“… did not converge” at t = {kept.t[-1]:.3f}",
    )  # fmt: skip
