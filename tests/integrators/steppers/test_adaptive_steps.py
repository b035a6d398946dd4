"""Variable steps that stay reversible: against exact orbits, their own reversal, and what steps without symmetry do."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from integrators import IntegratorError, ProgramBuilder, Scene, scene
from integrators.compile.scene_source import compiled_scene
from integrators.steppers.adaptive import DENSITY, RATE, TIME
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

SIZE = "(q1^2 + q2^2)^(3/4)"
"""Steps on a Kepler orbit that are proportional to the time of free fall."""


def kepler_orbit(t, eccentricity):
    """Momenta and positions at a time: Kepler's equation E − e sin E = t, by Newton's method."""
    anomaly = t
    for _ in range(50):
        anomaly -= (anomaly - eccentricity * np.sin(anomaly) - t) / (1 - eccentricity * np.cos(anomaly))
    b = np.sqrt(1 - eccentricity**2)
    rate = 1 / (1 - eccentricity * np.cos(anomaly))
    c, s = np.cos(anomaly), np.sin(anomaly)
    return np.array([-s * rate, b * c * rate, c - eccentricity, b * s])


def energy_errors(steps, state, count, size=None):
    """The relative energy error after each step; with `size` each step has the size size(y) at its start."""
    energy = compiled_scene(steps.scene).energy
    start, found = energy(steps.scene.y0), []
    for _ in range(count):
        if size is not None:
            state.step_size, state.is_fresh = size(state.y), True
        steps.advance(state, 1)
        found.append(abs(energy(state.y) / start - 1))
    return found


@pytest.fixture(scope="module")
def eccentric():
    return scene("kepler", eccentricity="9/10")


@pytest.fixture(scope="module")
def controlled(eccentric):
    return stepper("stormer-verlet", eccentric, control=SIZE)


def test_the_first_step_is_that_of_the_formula(eccentric, controlled):
    """ρ_(1/2) = ρ_0 + ε/2 G(y_0) and h = ε/ρ_(1/2), all by hand."""
    y0 = np.array([0.3, 0.8, 0.5, -0.4])
    epsilon = 0.02
    state = controlled.start(y0, h=epsilon, t0=1.0)
    controlled.advance(state, 1)
    p, q = y0[:2], y0[2:]
    sigma = np.hypot(*q) ** 1.5
    middle = 1 / sigma - epsilon / 2 * 1.5 * np.dot(q, p) / np.dot(q, q)
    h = epsilon / middle
    constant = stepper("stormer-verlet", eccentric)
    other = constant.start(y0, h=h)
    constant.advance(other, 1)
    assert state.t == pytest.approx(1 + h, rel=1e-15)
    assert state.y == pytest.approx(other.y, rel=1e-14)


def test_the_rate_is_the_derivative_of_the_density_along_the_flow(controlled):
    state = controlled.start([0.3, 0.8, 0.5, -0.4], h=1e-6)
    assert state.control[DENSITY] == pytest.approx(np.hypot(0.5, 0.4) ** -1.5)
    controlled.advance(state, 1)
    p, q = np.array([0.3, 0.8]), np.array([0.5, -0.4])
    width = 1e-5
    there, here = (np.hypot(*(q + s * p)) ** -1.5 for s in (width, -width))
    sigma = np.hypot(*q) ** 1.5
    assert state.control[RATE] == pytest.approx(sigma * (there - here) / (2 * width), rel=1e-5)


def test_energy_does_not_drift_and_constant_steps_need_many_more(eccentric, controlled):
    state = controlled.start(h=2 * np.pi / 200)
    errors = energy_errors(controlled, state, 10_000)
    assert max(errors[8000:]) < 1.05 * max(errors[:2000]) < 5e-3
    constant = stepper("stormer-verlet", eccentric)
    period = state.n * 2 * np.pi / state.t  # steps for each period
    same = constant.start(h=2 * np.pi / period)
    assert max(energy_errors(constant, same, 500)) > 0.1


def test_steps_without_symmetry_drift(eccentric):
    """h_n = ε σ(y_n): the negative control."""
    constant = stepper("stormer-verlet", eccentric)
    errors = energy_errors(constant, constant.start(h=1), 10_000, lambda y: 2 * np.pi / 200 * np.hypot(*y[2:]) ** 1.5)
    assert max(errors[8000:]) > 2 * max(errors[:2000])


def test_going_back_retraces_all_steps(eccentric, controlled):
    state = controlled.start(h=0.05)
    controlled.advance(state, 2000)
    assert state.t > 1
    state = controlled.restart(state, h=-state.h)
    controlled.advance(state, 2000)
    assert state.y == pytest.approx(eccentric.y0, abs=1e-11)
    assert abs(state.t) < 1e-11


def test_chunks_of_steps_make_no_difference(controlled):
    one, other = controlled.start(h=0.05), controlled.start(h=0.05)
    controlled.advance(one, 100)
    for _ in range(10):
        controlled.advance(other, 10)
        other = pickle.loads(pickle.dumps(other)).copy()
    for name in ("y", "carry", "memory", "control"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()
    assert one.t == other.t == one.control[TIME]


def test_recorded_times_are_those_of_the_states(controlled):
    state, rows, times = controlled.start(h=0.05), np.empty((5, 4)), np.empty(5)
    controlled.record(state, 50, y_every=10, y_rows=rows, y_times=times)
    again = controlled.start(h=0.05)
    for row, t in zip(rows, times, strict=True):
        controlled.advance(again, 10)
        assert again.t == t
        assert (again.y == row).all()
    assert len(set(np.diff(times).round(6))) == 4


def test_implicit_methods_keep_their_order():
    """Gauss's method of order 4 on exact orbits: the density of steps is of order 2 only, but y follows the orbit."""
    system = scene("kepler")
    steps = stepper("gauss2", system, control=SIZE)
    errors = []
    for n in (100, 200):
        state = steps.start(h=2 * np.pi / n)
        steps.advance(state, 2 * n)
        errors.append(np.abs(state.y - kepler_orbit(state.t, 0.6)).max())
        state = steps.restart(state, h=-state.h)
        steps.advance(state, 2 * n)
        assert state.y == pytest.approx(system.y0, abs=1e-12)
    assert 3.9 < np.log2(errors[0] / errors[1]) < 4.1


@pytest.mark.slow
def test_linear_flows_do_without_matrices():
    """Their elements would depend on the step size; extrapolation gives the same step."""
    system = Scene({"p": 1, "q": 1}, hamiltonian="(p^2 + q^2)/2", start={"p": [0], "q": [1]})
    builder = ProgramBuilder()
    flow = builder.program(builder.y + builder.flow(builder.y), name="flow")
    steps = stepper(flow, system, control="1 + q^2/2")
    state = steps.start(h=0.1)
    steps.advance(state, 50)
    assert state.y == pytest.approx([-np.sin(state.t), np.cos(state.t)], abs=1e-14)
    assert not np.isclose(state.t, 5)


def test_steps_that_would_go_back_are_refused(controlled):
    state = controlled.start([3, 0, 0.1, 0], h=10)
    with pytest.raises(StepError, match=r"h must be small enough for .* on kepler, but with h = 10 step 1,"):
        controlled.advance(state, 1)
    assert state.n == 0


@pytest.mark.parametrize(
    ("control", "message"),
    [
        ("1", "control must depend on the variables, but was 1"),
        ("r^2", "control must be a formula in p1, p2, q1, q2, mu, but has the unknown name 'r'"),
        ([1, 2], r"control must be a formula or a number, but was \[1, 2\]"),
    ],
)
def test_what_is_no_function_of_step_sizes_is_refused(control, message):
    with pytest.raises(IntegratorError, match=message.replace("^", r"\^")):
        stepper("stormer-verlet", scene("kepler"), control=control)


def test_step_sizes_must_be_positive_at_the_start():
    steps = stepper("stormer-verlet", scene("kepler"), control="q2 - q1")
    with pytest.raises(IntegratorError, match=r"control must be positive at the start, but was -0\.4"):
        steps.start(h=0.1)
