"""Stiff scenes: implicit methods converge or say that they do not; the modified equation warns outside its radius."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import bseries as bs

RATES = [Fraction(10) ** k for k in range(-8, 9, 2)]
"""λ of y' = −λy; with h = 1 they are −λh."""
DAMPED = bs.scene("linear", matrix=[[-rate * (i == j) for j in range(len(RATES))] for i, rate in enumerate(RATES)])
EPSILON = 2.0**-53


def states_of(method, solver="auto", steps=1):
    """The state after some steps of size 1."""
    return bs.integrate(DAMPED, method, h=1, steps=steps, save_every=None, solver=solver).y[:, -1]


def factors(method):
    """What one step multiplies by, exactly."""
    R = bs.stability_function(bs.method(method))
    return [Fraction(R(-rate)) for rate in RATES]


def distances(values, exact):
    return [abs(float(Fraction(float(value)) - x)) for value, x in zip(values, exact, strict=True)]


@pytest.mark.parametrize("method", ["implicit-euler", "gauss2", "gauss5", "radau-iia3", "lobatto-iiic3"])
def test_linear_systems_over_sixteen_powers_of_ten(method, measured):
    error = max(distances(states_of(method), factors(method)))
    measured(f"y' = −λy, λh = 1e-8 … 1e8: {method}, one step against R(−λh)", "error ≤ 1e-15", error)
    assert error < 1e-15
    assert max(distances(states_of(method), factors("implicit-midpoint"))) > 1e-3


@pytest.mark.parametrize("method", ["trapezoidal", "lobatto-iiia3"])
def test_an_explicit_first_stage_costs_digits(method, measured):
    """h f(y0) = −λh y0 is subtracted again: rounding errors are relative to that."""
    found = distances(states_of(method), factors(method))
    lost = max(error / max(1.0, float(rate)) for error, rate in zip(found, RATES, strict=True))
    measured(f"the same, {method} (first stage explicit): error / max(1, λh)", "≤ 2⁻⁵²", lost)
    assert lost < 2 * EPSILON
    assert max(found) > 1e-12


def test_decay_and_what_is_conserved_over_many_steps(measured):
    """L-stable methods forget stiff components at once; Gauss's methods keep |R| = 1 for λh = ±1e8 i."""
    left = states_of("radau-iia3", steps=1000)[RATES.index(10**8)]
    measured("the same, radau-iia3, component with λh = 1e8 after 1000 steps", "0", left)
    assert left == 0
    wave = bs.scene("linear", matrix=[[0, -(10**8)], [10**8, 0]])
    run = bs.integrate(wave, "gauss2", h=1, steps=1000, observe="squared_norm")
    change = float(abs(run.observed["squared_norm"] / 2 - 1).max())
    measured("y'' = −λ²y, λh = 1e8: gauss2, change of the squared norm in 1000 steps", "≤ 1e-12", change)
    assert change < 1e-12
    damped = bs.integrate(wave, "implicit-euler", h=1, steps=1, observe="squared_norm").observed["squared_norm"]
    assert damped[-1] < 1e-15


@pytest.mark.parametrize("method", ["implicit-euler", "gauss2"])
def test_fixed_points_say_that_they_do_not_converge(method, measured):
    with pytest.raises(bs.StepError, match=f"small enough for {method} on linear, .* step 1, from t = 0, did not conv"):
        states_of(method, solver="fixed-point")
    slow = bs.scene("linear", matrix=[["-1/10"]])
    assert bs.integrate(slow, method, h=1, steps=3, solver="fixed-point").y.shape == (1, 4)
    measured(
        f"the same, {method} by fixed-point iteration alone", "StepError", "“… step 1, from t = 0, did not converge”"
    )


def test_a_step_onto_a_pole_is_refused(measured):
    """1 − λh = 0: the equations of the stage have no solution, and next to it they have a large one."""
    with pytest.raises(bs.StepError, match="but with h = 1 step 1, from t = 0, did not end in finite numbers"):
        bs.integrate(bs.scene("linear", matrix=[[1]]), "implicit-euler", h=1, steps=1)
    beside = 1 - 2.0**-40
    end = bs.integrate(bs.scene("linear", matrix=[[1]]), "implicit-euler", h=beside, steps=1).y[0, -1]
    measured("y' = y, implicit-euler at the pole h = 1 of R", "StepError", "“… did not end in finite numbers”")
    measured("the same at h = 1 − 2⁻⁴⁰, against 2⁴⁰", "relative error ≤ 1e-3", abs(end / 2**40 - 1))
    assert end == pytest.approx(2**40, rel=1e-3)


def test_explicit_methods_overflow_and_say_so(measured):
    assert distances(states_of("rk4"), factors("rk4"))[-1] < 1e-15 * abs(factors("rk4")[-1])
    with pytest.raises(
        bs.StepError, match=r"rk4 on linear, but with h = 1 step \d+, .* did not end in finite"
    ) as found:
        states_of("rk4", steps=100)
    kept = found.value.trajectory
    assert kept is not None
    assert np.isfinite(kept.y).all()
    assert kept.t[-1] == found.value.step - 1
    measured(
        "the same, rk4: 100 steps, amplified by 4e30 in each", "StepError with all states before", str(found.value)
    )


# Van der Pol's equation, ε = 10⁻⁶


def test_the_slow_part_of_van_der_pol(measured):
    stiff = bs.scene("van-der-pol")
    exact = bs.reference_solution(stiff, ["1/2"])[:, 0]
    run = bs.integrate(stiff, "radau-iia3", h=0.01, steps=50, save_every=None)
    error = float(abs(run.y[:, -1] - exact).max())
    measured("van-der-pol (ε = 1e-6), radau-iia3, h = 0.01, along the slow part to t = 0.5", "error ≤ 1e-7", error)
    assert error < 1e-7
    with pytest.raises(bs.StepError, match="did not end in finite numbers"):
        bs.integrate(stiff, "rk4", h=0.01, steps=50)


@pytest.mark.parametrize("method", ["implicit-euler", "radau-iia3"])
def test_the_jump_of_van_der_pol_ends_the_run(method, measured):
    """The slow solution ends at t = 0.807, and jumps within a time of about ε."""
    with pytest.raises(bs.StepError, match=f"small enough for {method} on van-der-pol, .* did not converge") as found:
        bs.integrate(bs.scene("van-der-pol"), method, h=1e-3, steps=2000)
    kept = found.value.trajectory
    assert kept is not None
    assert np.isfinite(kept.y).all()
    assert (kept.y[:, -1] == found.value.y).all()
    assert 0.79 < kept.t[-1] < 0.815
    measured(
        f"van-der-pol, {method}, h = 1e-3, at the jump (t = 0.807)", "StepError with all states before",
        f"“… did not converge” at t = {kept.t[-1]:.3f}",
    )  # fmt: skip


# The modified equation outside its radius


@pytest.mark.parametrize("method", ["implicit-euler", "implicit-midpoint", "radau-iia3"])
def test_the_modified_equation_warns_outside_its_radius(method, measured):
    chosen = bs.method(method)
    field = bs.modified_field(chosen, DAMPED, 6)
    radius = bs.convergence_radius(chosen).radius
    limit = radius / 1e8
    inside = bs.reach(field, DAMPED.y0, 0.99 * limit, method=chosen)
    assert inside.converges
    with pytest.warns(bs.TruncationWarning, match="diverges: h times the spectral radius must be below"):
        outside = bs.reach(field, DAMPED.y0, 1.01 * limit, method=chosen)
    assert not outside.converges
    with pytest.warns(bs.TruncationWarning, match="diverges"):
        bs.reach(field, DAMPED.y0, 1, method=chosen)
    measured(
        f"modified equation of {method} on y' = −λy",
        f"warns from λh = {radius:.4g} on",
        "warns at 1.01, not at 0.99 of it",
    )


def test_the_modified_equation_warns_on_van_der_pol(measured):
    stiff, euler = bs.scene("van-der-pol"), bs.method("implicit-euler")
    field = bs.modified_field(euler, stiff, 4)
    with pytest.warns(
        bs.TruncationWarning, match=r"worse at order 4 than at order 1: for h = 0.01 .*; order 4 needs h"
    ):
        found = bs.reach(field, stiff.y0, 0.01)
    assert not bs.reach(field, stiff.y0, found.largest_step / 2).is_beyond
    measured(
        "modified equation of implicit-euler on van-der-pol, h = 0.01", "warns", f"needs h ≤ {found.largest_step:.2g}"
    )
