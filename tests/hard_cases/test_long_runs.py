"""Long runs: rounding is a random walk, nothing drifts, and times are never sums."""

from __future__ import annotations

from fractions import Fraction
from itertools import accumulate, islice

import numpy as np
import pytest

import bseries as bs
from integrators.steppers import implicit_stages
from integrators.steppers.adaptive import DENSITY, RATE, TIME_COMPENSATION

pytestmark = pytest.mark.slow

MANY = 10**8
OSCILLATOR = bs.parse_hamiltonian("(p^2 + q^2)/2", start="p=0;q=1")
KEPLER = bs.scene("kepler")


OSCILLATION = "oscillator, stormer-verlet"


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
    return bs.integrate("stormer-verlet", OSCILLATOR, h=h, steps=steps, save_every=steps // 1000, **options)


@pytest.fixture(scope="module")
def long_run():
    return oscillate(3 / 32, MANY)


def test_rounding_of_a_hundred_million_steps_is_a_random_walk(long_run, measured):
    changes = squared_radius(long_run)
    case = f"{OSCILLATION}, h = 3/32, 10⁸ steps"
    measured.within(f"{case}: what the method conserves", abs(changes).max(), 1e-12, what="relative change")
    measured.within(f"{case}: changes over 6.4e6 steps against 1e5 (random walk: 8, drift: 64)", growth(changes), 16)
    assert growth(np.linspace(0, 1, 1001)) == pytest.approx(64)


def test_without_compensation_it_is_larger(long_run, measured):
    """The negative control: ten times the rounding errors in each step, or more."""
    plain = squared_radius(oscillate(3 / 32, MANY // 10, compensated=False))
    spread = np.std(np.diff(plain[::100])) / np.std(np.diff(squared_radius(long_run)[::10]))
    case = f"{OSCILLATION}, h = 3/32, not compensated: changes over 10⁶ steps against those of compensated steps"
    measured.at_least(case, spread, 4, " times")


@pytest.mark.parametrize("h", [0.1, 0.01])
def test_decimal_steps_do_not_drift(h, measured):
    """The digits of h = 0.1 are periodic, so that the last bits of h p are not random on a linear scene."""
    changes = squared_radius(oscillate(h, MANY // 10))
    case = f"{OSCILLATION}, h = {h}, 10⁷ steps: what the method conserves"
    measured.within(case, abs(changes).max(), 2e-13, what="relative change")
    plain = squared_radius(oscillate(h, MANY // 10, compensated=False))
    assert abs(plain).max() > 10 * abs(changes).max()


def angular_momentum(state):
    """With the rounding errors that are not yet in y."""
    p1, p2, q1, q2 = (Fraction(float(y)) + Fraction(float(e)) for y, e in zip(state.y, state.carry, strict=True))
    return q1 * p2 - q2 * p1


@pytest.mark.parametrize("start", [(0.0, 2.0, 0.4, 0.0), (0.1, 1.8, 0.5, 0.1)])
def test_angular_momentum_of_an_eccentric_orbit(start, measured):
    """Rounding of h ∇U is the only torque: over ten million steps a random walk, within 5 standard deviations of 0."""
    verlet = bs.stepper("stormer-verlet", KEPLER)
    state, values = verlet.start(start, h=0.01), []
    for _ in range(21):
        values.append(angular_momentum(state))
        verlet.advance(state, 5 * 10**5)
    steps = np.diff([float(value / values[0] - 1) for value in values])
    walk = abs(steps.sum()) / (np.std(steps) * np.sqrt(len(steps)))
    case = f"kepler from {start}, stormer-verlet, h = 0.01, 10⁷ steps: angular momentum"
    measured.within(case, abs(steps.sum()), 1e-14, what="relative change")
    measured.within(case, walk, 5, " standard deviations of a random walk")
    plain = bs.stepper("stormer-verlet", KEPLER, compensated=False)
    rough = plain.start(start, h=0.01)
    first = angular_momentum(rough)
    plain.advance(rough, 10**7)
    assert abs(float(angular_momentum(rough) / first - 1)) > 1e-14


# Implicit methods


def rotate(**start):
    """A pendulum that rotates, with an angle that grows by some 2 in each step."""
    pendulum = bs.parse_hamiltonian("p^2/2 - cos(q)", start="p=3/2;q=-22/7")
    return bs.integrate("implicit-midpoint", pendulum, h=1.0, steps=20000, observe="energy", **start)


def test_implicit_steps_do_not_stop_where_angles_have_grown(measured, monkeypatch):
    """The pendulum rotates 6000 times: rounding of an unwrapped angle of 4e4 must not count as failure."""
    run = rotate()
    energy = run.observed["energy"]
    late, early = (abs(part - energy[0]).max() for part in (energy[-5000:], energy[:5000]))
    case = "pendulum rotating, implicit-midpoint, h = 1, 20,000 steps: energy error of the last 5000"
    note = f"angle {abs(run.y[1]).max():.3g} at the end"
    measured.within(case, late / early, 1.05, " of that of the first", form=".3f", note=note)
    assert len(run.t) == 20001
    # iterations that take no account of the size of the angle
    monkeypatch.setattr(implicit_stages, "rounding", lambda blocks, writer: "False")
    with pytest.raises(bs.integrators.StepError, match=r"step 1\d{4}, .* did not converge"):
        rotate(y0=(1.5, -np.pi), solver="newton")


GAUSS = bs.method("gauss2")


def norms(solver, h=3 / 32, method=GAUSS, **options):
    """The squared norm of an oscillation, relative to its start, at a thousand times in a million steps."""
    run = bs.integrate(
        method, bs.scene("linear"), h=h, steps=10**6, save_every=None, solver=solver,
        observe="squared_norm", observe_every=1000, **options,
    )  # fmt: skip
    return run.observed["squared_norm"] / 2 - 1


@pytest.mark.parametrize("solver", ["fixed-point", "newton"])
def test_gauss_steps_conserve_quadratic_integrals(solver, measured):
    """What remains is rounding; with rounded coefficients it is the same in every step, and drifts."""
    changes = norms(solver)
    case = f"oscillator, gauss2 ({solver}), h = 3/32, 10⁶ steps: squared norm"
    measured.within(case, abs(changes).max(), 5e-14, what="relative change")
    case = f"{case}, changes over 64,000 steps against 1000 (random walk: 8, drift: 64)"
    measured.within(case, growth(changes), 16)
    rounded = norms(solver, split=False)
    assert abs(rounded).max() > 5e-14
    assert growth(rounded) > 16


@pytest.mark.parametrize("h", [0.3, 0.7])
def test_decimal_steps_of_implicit_methods_on_linear_scenes(h, measured):
    """A limit: stages of a linear scene with decimal steps are rounded in a pattern, not at random, and drift.

    The squared norm changes by 2 y·Δy in a step. If all roundings of slopes, 2⁻⁵³ each, had one sign, that would be
    2h · 2⁻⁵³ of it.
    """
    changes = norms("fixed-point", h=h)
    drift = abs(changes[-1]) / 10**6
    case = f"oscillator, gauss2, h = {h}, 10⁶ steps: relative drift of the squared norm in each"
    measured.within(case, drift / h * 2.0**53, 2, " · 2⁻⁵³ h")
    assert growth(changes) > 16  # so it is no random walk
    assert isinstance(GAUSS, bs.RungeKutta)
    (first, *rest), *others = GAUSS.to_float().A
    spoilt = bs.RungeKutta([[first + 1e-14, *rest], *others], GAUSS.to_float().b, warn=False)
    assert abs(norms("fixed-point", h=h, method=spoilt)[-1]) / 10**6 > 2 * h * 2.0**-53


# Time


def test_time_is_no_sum(long_run, measured):
    """0.1 added ten million times is off by 1.6e-4."""
    h, steps = 0.1, 10**7
    run = oscillate(h, steps)
    error = max(
        abs(Fraction(float(t)) - k * (steps // 1000) * Fraction(h)) / Fraction(np.spacing(t))
        for k, t in enumerate(run.t[1:], 1)
    )
    measured.within("t in 10⁷ steps of h = 0.1, against n h", float(error), 0.5, " ulp", form=".2f")
    summed = np.add.accumulate(np.full(steps, h))[-1]
    assert abs(summed - steps * h) > 1e-4
    assert (long_run.t == np.arange(1001) * (MANY // 1000) * (3 / 32)).all()


def test_time_as_a_variable_keeps_up(measured):
    """Where t is among the variables it is a compensated sum."""
    forced = bs.parse_scene("y' = cos(t)", start="y=0")
    options = {"h": 0.1, "steps": 10**6, "save_every": 10**5}
    run = bs.integrate("explicit-euler", forced, **options)
    error = (abs(run.y[1] - run.t) / np.spacing(run.t)).max()
    measured.within("t as a variable (y' = cos t), 10⁶ steps of 0.1, against t0 + n h", error, 2, " ulp")
    plain = bs.integrate("explicit-euler", forced, **options, compensated=False)
    assert abs(plain.y[1] - plain.t).max() > 1e-7


def test_variable_steps_have_a_compensated_time(measured):
    """The sizes of the steps, as a step takes them from the density, summed exactly; a plain sum is off by more."""
    steps = bs.stepper("stormer-verlet", KEPLER, control="(q1^2 + q2^2)^(3/4)")
    state = steps.start(h=0.05)
    steps.advance(state, 1)  # the first one finds the rate of the density
    sizes, times = [state.t, state.control[TIME_COMPENSATION]], []
    for _ in range(50_000):
        sizes.append(state.h / (state.control[DENSITY] + 0.5 * state.h * state.control[RATE]))
        steps.advance(state, 1)
        times.append(state.t)
    exact = list(islice(accumulate(map(Fraction, sizes)), 2, None))

    def error(found):
        return float(max(abs(Fraction(t) - x) / Fraction(np.spacing(t)) for t, x in zip(found, exact, strict=True)))

    plain = error(np.add.accumulate(sizes)[2:].tolist())
    measured.within(
        "kepler, 50,000 variable steps: t against the sum of their sizes", error(times), 1, " ulp", form=".2f",
        note=f"{plain:.0f} ulp for a plain sum",
    )  # fmt: skip
    assert plain > 4
    assert max(sizes[2:]) > 1.5 * min(sizes[2:])  # the sizes do vary
