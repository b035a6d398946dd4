"""Long runs: rounding is a random walk, nothing drifts, and times are never sums."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import bseries as bs

MANY = 10**8
OSCILLATOR = bs.parse_hamiltonian("(p^2 + q^2)/2", start="p=0;q=1")
KEPLER = bs.scene("kepler")


def squared_radius(run):
    """What Störmer–Verlet conserves exactly on the oscillator, relative to its start, with the digits of the states."""
    (p, q), h = run.y, run.h
    value = p**2 + (1 - h**2 / 4) * q**2
    return value / value[0] - 1


def growth(values):
    """How much larger changes over 64 intervals are than over one: 8 for a random walk, 64 for a drift."""
    near, far = (np.sqrt(np.mean((values[lag:] - values[:-lag]) ** 2)) for lag in (1, 64))
    return far / near


def oscillate(h, steps, **options):
    return bs.integrate(OSCILLATOR, "stormer-verlet", h=h, steps=steps, save_every=steps // 1000, **options)


@pytest.fixture(scope="module")
def long_run():
    return oscillate(3 / 32, MANY)


def test_rounding_of_a_hundred_million_steps_is_a_random_walk(long_run, measured):
    changes = squared_radius(long_run)
    measured(
        "oscillator, stormer-verlet, h = 3/32, 10⁸ steps: what the method conserves exactly", "relative change ≤ 1e-12",
        abs(changes).max(),
    )  # fmt: skip
    measured(
        "the same: changes over 6.4e6 steps against 1e5 steps (random walk: 8, drift: 64)", "≤ 16", growth(changes)
    )
    assert abs(changes).max() < 1e-12
    assert growth(changes) < 16
    assert growth(np.linspace(0, 1, 1001)) == pytest.approx(64)


def test_without_compensation_it_is_larger(long_run, measured):
    """The negative control: ten times the rounding errors in each step, or more."""
    plain = squared_radius(oscillate(3 / 32, MANY // 10, compensated=False))
    spread = np.std(np.diff(plain[::100])) / np.std(np.diff(squared_radius(long_run)[::10]))
    measured("the same without compensation: changes over 10⁶ steps against those with it", "≥ 4 times", spread)
    assert spread > 4


@pytest.mark.parametrize("h", [0.1, 0.01])
def test_decimal_steps_do_not_drift(h, measured):
    """The digits of h = 0.1 are periodic, so that the last bits of h p are not random on a linear scene."""
    changes = squared_radius(oscillate(h, MANY // 10))
    measured(f"the same, h = {h}, 10⁷ steps", "relative change ≤ 2e-13", abs(changes).max())
    assert abs(changes).max() < 2e-13
    plain = squared_radius(oscillate(h, MANY // 10, compensated=False))
    assert abs(plain).max() > 10 * abs(changes).max()


def angular_momentum(state):
    """With the rounding errors that are not yet in y."""
    p1, p2, q1, q2 = (Fraction(float(y)) + Fraction(float(e)) for y, e in zip(state.y, state.carry, strict=True))
    return q1 * p2 - q2 * p1


@pytest.mark.parametrize("start", [(0.0, 2.0, 0.4, 0.0), (0.1, 1.8, 0.5, 0.1)])
def test_angular_momentum_of_an_eccentric_orbit(start, measured):
    """Rounding of h ∇U is the only torque: over ten million steps a random walk, within 5 standard deviations of 0."""
    verlet = bs.stepper(KEPLER, "stormer-verlet")
    state, values = verlet.start(start, h=0.01), []
    for _ in range(21):
        values.append(angular_momentum(state))
        verlet.advance(state, 5 * 10**5)
    steps = np.diff([float(value / values[0] - 1) for value in values])
    walk = abs(steps.sum()) / (np.std(steps) * np.sqrt(len(steps)))
    case = f"kepler from {start}, stormer-verlet, h = 0.01, 10⁷ steps: angular momentum"
    measured(case, "relative change ≤ 1e-14", abs(steps.sum()))
    measured("the same, in standard deviations of a random walk", "≤ 5", walk)
    assert abs(steps.sum()) < 1e-14
    assert walk < 5
    plain = bs.stepper(KEPLER, "stormer-verlet", compensated=False)
    rough = plain.start(start, h=0.01)
    first = angular_momentum(rough)
    plain.advance(rough, 10**7)
    assert abs(float(angular_momentum(rough) / first - 1)) > 1e-14


# Implicit methods


def test_implicit_steps_do_not_stop_where_angles_have_grown(measured):
    """The pendulum rotates 5000 times: rounding of an unwrapped angle of 3e4 must not count as failure."""
    run = bs.integrate(
        bs.scene("pendulum"), "implicit-midpoint", h=1.0, steps=20000, y0=(1.5, -np.pi), observe="energy"
    )
    energy = run.observed["energy"]
    late, early = (abs(part - energy[0]).max() for part in (energy[-5000:], energy[:5000]))
    measured(
        f"pendulum rotating, implicit-midpoint, h = 1, 20,000 steps to an angle of {abs(run.y[1]).max():.3g}",
        "runs through, energy error does not grow", float(late / early), "late/early {:.3f}",
    )  # fmt: skip
    assert len(run.t) == 20001
    assert late < 1.05 * early


def norms(solver, h=3 / 32, **options):
    """The squared norm of an oscillation, relative to its start, at a thousand times in a million steps."""
    run = bs.integrate(
        bs.scene("harmonic-oscillator"), "gauss2", h=h, steps=10**6, save_every=None, solver=solver,
        observe="squared_norm", observe_every=1000, **options,
    )  # fmt: skip
    return run.observed["squared_norm"] / 2 - 1


@pytest.mark.parametrize("solver", ["fixed-point", "newton"])
def test_gauss_steps_conserve_quadratic_integrals(solver, measured):
    """What remains is rounding; with rounded coefficients it is the same in every step, and drifts."""
    changes = norms(solver)
    case = f"oscillator, gauss2 ({solver}), h = 3/32, 10⁶ steps: squared norm"
    measured(case, "relative change ≤ 5e-14", abs(changes).max())
    measured("the same: changes over 64,000 steps against 1000 (random walk: 8, drift: 64)", "≤ 16", growth(changes))
    assert abs(changes).max() < 5e-14
    assert growth(changes) < 16
    rounded = norms(solver, split=False)
    assert abs(rounded).max() > 5e-14
    assert growth(rounded) > 16


def test_decimal_steps_of_implicit_methods_on_linear_scenes(measured):
    """A limit: stages of a linear scene with h = 0.3 are rounded in a pattern, not at random."""
    drift = abs(norms("fixed-point", h=0.3)[-1]) / 10**6
    measured("the same, h = 0.3: drift in each step", "≤ 1e-18", drift)
    assert drift < 1e-18


# Time


def test_time_is_no_sum(long_run, measured):
    """0.1 added ten million times is off by 1.6e-4."""
    h, steps = 0.1, 10**7
    run = oscillate(h, steps)
    error = max(
        abs(Fraction(float(t)) - k * (steps // 1000) * Fraction(h)) / Fraction(np.spacing(t))
        for k, t in enumerate(run.t[1:], 1)
    )
    measured("t after 10⁷ steps of h = 0.1, against n h", "≤ 1/2 ulp", float(error), "{:.2f} ulp")
    assert error <= Fraction(1, 2)
    summed = np.add.accumulate(np.full(steps, h))[-1]
    assert abs(summed - steps * h) > 1e-4
    assert (long_run.t == np.arange(1001) * (MANY // 1000) * (3 / 32)).all()


def test_time_as_a_variable_keeps_up(measured):
    """Where t is among the variables it is a compensated sum."""
    forced = bs.parse_scene("y' = cos(t)", start="y=0")
    options = {"h": 0.1, "steps": 10**6, "save_every": 10**5}
    run = bs.integrate(forced, "explicit-euler", **options)
    error = abs(run.y[1] - run.t).max()
    measured("t as a variable (y' = cos t), 10⁶ steps of 0.1", "equal to t0 + n h to 2 ulp", error)
    assert (abs(run.y[1] - run.t) <= 2 * np.spacing(run.t)).all()
    plain = bs.integrate(forced, "explicit-euler", **options, compensated=False)
    assert abs(plain.y[1] - plain.t).max() > 1e-7


def test_variable_steps_have_a_compensated_time(measured):
    """Forth and back again: t returns to 0, although each way is a sum of a million steps."""
    steps = bs.stepper(KEPLER, "stormer-verlet", control="(q1^2 + q2^2)^(3/4)")
    state = steps.start(h=0.05)
    steps.advance(state, 10**6)
    end = state.t
    back = steps.restart(state, h=-state.h)
    steps.advance(back, 10**6)
    measured(f"variable steps, 10⁶ to t = {end:.0f} and 10⁶ back", "t returns to 0 within 1e-7", abs(back.t))
    assert abs(back.t) < 1e-7
    assert end > 1e4
