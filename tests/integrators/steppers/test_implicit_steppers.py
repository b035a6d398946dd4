"""Compiled steps with derivatives, linear systems and Newton: against plain steps, closed forms and geometry."""

from __future__ import annotations

import pickle
from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pytest
import sympy

from integrators import IntegratorError, ProgramBuilder, RungeKutta, method, scene
from integrators.compile.scene_source import compiled_scene
from integrators.reference.plain_steps import block_parts, plain_steps
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

VALUES = {
    "sdirk2": {"gamma": "1/3"},
    "sdirk2-general": {"gamma": "1/3", "c2": "2/5"},
    "ros2": {"gamma": "1/3"},
    "ros2-w": {"gamma": "1/3"},
}
ROSENBROCK = ["rosenbrock-euler", "ros2", "ros3p", "rodas3", "grk4a", "grk4t", "rosenbrock-shampine4", "rodas4"]
W_METHODS = ["ros2-w", "ros34pw2"]
DIAGONALLY_IMPLICIT = ["implicit-euler", "implicit-midpoint", "trapezoidal", "crouzeix3", "crouzeix4", "qin-zhang"]
IMPLICIT = ["gauss2", "radau-ia2", "radau-iia3", "lobatto-iiia3", "lobatto-iiib3", "lobatto-iiic2", "lobatto-iiid2"]
FORCE_GRADIENTS = ["takahashi-imada", "simplified-takahashi-imada", "chin4a", "chin4b", "chin4c"]
STEP_SIZES = {"van-der-pol": 1e-4}
STEPS = 3


def made(name):
    return method(name, **VALUES.get(name, {}))


def coupled_derivatives():
    """A linear system of two evaluations, at different points."""
    builder = ProgramBuilder()
    first, second = builder.unknowns(2)
    k = builder.field(builder.y)
    builder.derivative(builder.y, k + second / 2, into=first)
    builder.derivative(builder.y + k / 3, k - first + second / 4, into=second)
    return builder.program(builder.y + k + first + second * 2)


@cache
def functions(name):
    """The field of a scene and its derivative, for numbers of mpmath."""
    system = scene(name)
    jacobian = sympy.Matrix(system.field).jacobian(system.symbols)
    field = sympy.lambdify([system.symbols], list(system.field), "mpmath")
    matrix = sympy.lambdify([system.symbols], jacobian.tolist(), "mpmath")
    return field, lambda y, v: [sum(a * x for a, x in zip(row, v, strict=True)) for row in matrix(y)]


def plain(chosen, name):
    """The same steps by definition, with 30 digits."""
    system, (field, derivative) = scene(name), functions(name)
    names = chosen.program.names
    if chosen.program.auxiliary:
        fields = {"f": field, "W": lambda y: [0 * x for x in y]}
        derivatives = dict.fromkeys(names, derivative)
    elif len(names) == 1:
        fields, derivatives = field, derivative
    else:
        blocks = {block.name: range(block.offset, block.end) for block in system.blocks}
        fields, derivatives = block_parts(field, blocks), block_parts(derivative, blocks)
    h = STEP_SIZES.get(name, 0.05)
    return plain_steps(chosen, fields, list(system.y0), h, STEPS, derivative=derivatives, digits=30)[:, -1]


def steps(chosen, name, **options):
    compiled = stepper(chosen, scene(name), **options)
    state = compiled.start(h=STEP_SIZES.get(name, 0.05))
    compiled.advance(state, STEPS)
    return state


def error(state, expected):
    """The relative error, rounding errors that are still to be added included."""
    distances = [abs(mpmath.mpf(y) + e - x) for y, e, x in zip(state.y, state.carry, expected, strict=True)]
    return float(max(distances) / max(map(abs, expected)))


CASES = [
    *((name, "van-der-pol", "auto") for name in ROSENBROCK + W_METHODS),
    ("rosenbrock-euler", "kepler", "auto"),
    ("ros3p", "lotka-volterra", "auto"),
    ("rodas4", "double-pendulum", "auto"),
    ("ros34pw2", "lotka-volterra", "auto"),
    ("tdrk4", "double-pendulum", "auto"),
    ("tdrk4", "kepler", "auto"),
    ("tdrk5", "lotka-volterra", "auto"),
    *((name, "kepler", "auto") for name in FORCE_GRADIENTS),
    *((name, "van-der-pol", "newton") for name in DIAGONALLY_IMPLICIT[::2] + IMPLICIT[::2]),
    *(
        pytest.param(name, "van-der-pol", "newton", marks=pytest.mark.slow)  # iterated in `test_step_properties`
        for name in DIAGONALLY_IMPLICIT[1::2] + IMPLICIT[1::2]
    ),
    ("sdirk2", "lotka-volterra", "newton"),
    ("sdirk2-general", "lotka-volterra", "newton"),
    ("lobatto-iiie2", "lotka-volterra", "newton"),
    ("kahan", "lotka-volterra", "newton"),
    ("avf", "lotka-volterra", "newton"),
    ("gauss2", "kepler", "newton"),
    ("lobatto-iiia-iiib2", "double-pendulum", "newton"),
    ("lobatto-iiic2", "kepler", "fixed-point"),
    ("gauss2", "double-pendulum", "fixed-point"),
]


@pytest.mark.few(6)
@pytest.mark.parametrize(("name", "where", "solver"), CASES)
def test_steps_are_those_of_the_definition(name, where, solver):
    chosen = made(name)
    assert error(steps(chosen, where, solver=solver), plain(chosen, where)) < 5e-15


@pytest.mark.parametrize("solver", ["fixed-point", "newton"])
def test_linear_systems_of_several_evaluations(solver):
    program = coupled_derivatives()
    expected = plain(program, "lotka-volterra")
    assert error(steps(program, "lotka-volterra", solver=solver), expected) < 1e-15
    assert error(steps(program, "lotka-volterra", solver=solver), expected[::-1]) > 1e-3


def test_other_coefficients_make_other_steps():
    assert error(steps(method("rodas4"), "van-der-pol"), plain(method("ros3p"), "van-der-pol")) > 1e-3


@pytest.mark.parametrize("name", ROSENBROCK[-2:])
def test_one_factorization_serves_all_stages(name):
    source = stepper(method(name), scene("van-der-pol")).source
    assert source.count(" factorize(") == 1
    assert source.count(" solve(") > 3


# Stiff linear systems: y' = −λ y for λ = 10⁻⁸ … 10⁸, coupled to nothing; h = 1

RATES = [Fraction(10) ** k for k in range(-8, 9, 2)]
STABILITY = {
    "implicit-euler": lambda z: 1 / (1 - z),
    "gauss2": lambda z: (1 + z / 2 + z**2 / 12) / (1 - z / 2 + z**2 / 12),
    "radau-iia2": lambda z: (1 + z / 3) / (1 - 2 * z / 3 + z**2 / 6),
    "rosenbrock-euler": lambda z: 1 / (1 - z),
}


@pytest.mark.parametrize("name", STABILITY)
def test_stiff_linear_systems_to_rounding(name):
    matrix = [[-rate if i == j else 0 for j in range(len(RATES))] for i, rate in enumerate(RATES)]
    compiled = stepper(method(name), scene("linear", matrix=matrix), solver="newton")
    state = compiled.start(h=1.0)
    compiled.advance(state, 1)
    expected = [STABILITY[name](-rate) for rate in RATES]
    # what is subtracted is y itself: rounding errors are relative to 1
    distances = [abs(Fraction(y) + Fraction(e) - x) for y, e, x in zip(state.y, state.carry, expected, strict=True)]
    assert max(distances) < 1e-15


# Orders


@pytest.mark.parametrize(("name", "order"), [("gauss2", 4), ("radau-iia2", 3), ("rodas4", 4)])
def test_order_on_the_brusselator(name, order):
    reference = stepper("rodas4", scene("brusselator"))
    exact = reference.start(h=1 / 4000)
    reference.advance(exact, 4000)
    errors = []
    for count in (100, 200):
        compiled = stepper(method(name), scene("brusselator"), solver="newton")
        state = compiled.start(h=1 / count)
        compiled.advance(state, count)
        errors.append(abs(state.y - exact.y).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


# Geometry: Newton's method leaves rounding errors only


def invariant_drift(name, solver):
    system = scene("kepler")
    compiled, observed = stepper(name, system, solver=solver), np.empty((2, len(system.invariants)))
    state = compiled.start(h=0.05)
    compiled_scene(system).invariants(state.y, observed[0])
    compiled.advance(state, 2000)
    compiled_scene(system).invariants(state.y, observed[1])
    k = list(system.invariants).index("angular_momentum")
    return abs(observed[1, k] - observed[0, k])


def test_quadratic_invariants_are_kept_by_gauss_and_by_no_radau():
    assert invariant_drift("gauss2", "newton") < 1e-14
    assert invariant_drift("radau-iia2", "newton") > 1e-6


# The choice of a solver


def test_newton_takes_over_where_fixed_points_diverge():
    compiled = stepper("gauss2", scene("brusselator"))
    state = compiled.start(h=0.4)
    compiled.advance(state, 18)
    assert state.solver == "fixed-point"
    whole, halted = state.copy(), pickle.loads(pickle.dumps(state))
    compiled.advance(whole, 60)
    for count in (1, 7, 12, 40):
        compiled.advance(halted, count)
    assert whole.solver == halted.solver == "newton"
    assert np.array_equal(whole.y, halted.y)
    assert np.array_equal(whole.memory, halted.memory)
    y_rows = np.empty((20, 2))
    compiled.record(state, 60, y_every=3, y_rows=y_rows)
    assert np.array_equal(y_rows[-1], whole.y)
    fixed = stepper("gauss2", scene("brusselator"), solver="fixed-point")
    with pytest.raises(StepError, match=r"from t = 7\.2, did not converge") as caught:
        fixed.advance(fixed.start(h=0.4), 60)
    assert caught.value.step == 19


def test_recording_goes_on_with_the_row_after_the_change():
    compiled = stepper("gauss2", scene("brusselator"))
    y_rows = np.empty((30, 2))
    compiled.record(compiled.start(h=0.4), 30, y_every=1, y_rows=y_rows)
    state = compiled.start(h=0.4)
    for row in y_rows:
        compiled.advance(state, 1)
        assert np.array_equal(state.y, row)


def test_fixed_points_are_kept_where_they_converge():
    assert steps(method("gauss2"), "kepler").solver == "fixed-point"
    assert steps(method("implicit-euler"), "van-der-pol").solver == "newton"


def test_rounding_errors_that_come_and_go_in_turn_are_no_failure():
    """In step 10,217 momenta and angles change in every other sweep each, for ever."""
    compiled = stepper("gauss2", scene("double-pendulum"), solver="fixed-point")
    state = compiled.start(h=0.02)
    compiled.advance(state, 11000)
    assert state.n == 11000


def test_failure_is_told_with_the_last_good_state():
    compiled = stepper("implicit-euler", scene("van-der-pol"))
    state = compiled.start(h=1e-3)
    with pytest.raises(
        StepError, match=r"h must be small enough for implicit-euler on van-der-pol, but with h = 0.001 step \d+, from"
    ) as caught:
        compiled.advance(state, 2000)
    assert state.solver == "newton"
    assert 800 < state.n == caught.value.step - 1 < 815  # where the slow solution ends, at t = 0.807
    assert np.array_equal(state.y, caught.value.y)
    assert np.isfinite(state.y).all()


def test_solver_must_be_known():
    with pytest.raises(IntegratorError, match="solver must be one of auto, fixed-point, newton, but was 'bisection'"):
        stepper("gauss2", scene("kepler"), solver="bisection")


@pytest.mark.filterwarnings("ignore:weights b sum to")
@pytest.mark.parametrize("options", [{}, {"solver": "newton"}, {"split": False}, {"compensated": False}])
def test_coefficients_below_the_range_of_doubles_are_zero(options):
    """A stage at the start of the step gives an Euler step; weights of zero leave the state as it is."""
    y = np.array([0.25, 1.0])
    for weight in ("1", "1e-400"):
        compiled = stepper(RungeKutta([["1e-400"]], [weight]), scene("pendulum"), **options)
        state = compiled.start(y, h=0.125)
        compiled.advance(state, 1)
        euler = y + 0.125 * np.array([-np.sin(1.0), 0.25])
        np.testing.assert_allclose(state.y, euler if weight == "1" else y, rtol=1e-15)
