"""Compiled averages and flows, against plain steps in 30 digits, exact solutions and what they preserve."""

from __future__ import annotations

from fractions import Fraction

import flint
import mpmath
import numpy as np
import pytest
import sympy

from integrators import IntegratorError, ProgramBuilder, Scene, Term, method, scene, strang
from integrators.compile.scene_source import compiled_scene
from integrators.reference.plain_steps import plain_step
from integrators.scenes.model.system import output_formula
from integrators.scenes.particles.parts import pieces_of
from integrators.steppers.flows import doubles, phi_functions
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper


def piece_fields(system, names):
    """The pieces of a scene's field as functions of mpmath numbers, term by term and row by row."""
    symbols = system.symbols
    fields = {}
    for name, piece in zip(names, pieces_of(names, system), strict=True):
        total = [sympy.Integer(0)] * system.dimension
        for term in system.numeric_terms:
            for output in piece.outputs(term, system):
                for row in term.sites.rows():
                    rule = {sympy.Symbol(f"d{k}"): data.values[row[data.role]] for k, data in enumerate(term.data)}
                    for k, (plus, minus) in enumerate(term.arguments):
                        other = 0 if minus is None else symbols[minus.at(row)]
                        rule[sympy.Symbol(f"x{k}")] = symbols[plus.at(row)] - other
                    total[output.place.at(row)] += output_formula(term, output).xreplace(rule)
        fields[name] = _function(symbols, total)
    return fields


def _function(symbols, formulas):
    compiled = sympy.lambdify(symbols, formulas, "mpmath")
    return lambda y: compiled(*y)


def relative_gap(system, made, h, y=None):
    """How far one compiled step is from the plain one."""
    y = system.y0 if y is None else np.array(y, float)
    steps = stepper(made, system)
    state = steps.start(y, h=h)
    steps.advance(state, 1)
    wanted = plain_step(made, piece_fields(system, made.names), y.tolist(), h, digits=30)
    return max(float(abs(a - b) / max(1, abs(b))) for a, b in zip(state.y.tolist(), wanted, strict=True)), steps


def forced(powers, time=1):
    """Exponential methods: the flow of L, forced by N at some points, in powers of θ."""
    builder = ProgramBuilder(["L", "N"])
    one = builder.field(builder.y, "N")
    two = builder.field(builder.y + one / 3, "N")
    forcing = [one, two - one, one / 5][:powers]
    return builder.program(builder.y + builder.flow(builder.y, "L", time=time, forcing=forcing), name=f"etd{powers}")


# Averages


ENERGY = [("pendulum", "avf", 0.2), ("kepler", "avf", 0.05), ("henon-heiles", "energy-collocation2", 0.2)]


@pytest.mark.parametrize(("name", "made", "h"), ENERGY)
def test_averages_preserve_the_energy_to_rounding(name, made, h):
    system = scene(name)
    energy = compiled_scene(system).energy
    steps = stepper(made, system)
    state = steps.start(h=h)
    largest = 0.0
    for _ in range(40):
        steps.advance(state, 50)
        largest = max(largest, abs(energy(state.y) - energy(system.y0)))
    assert largest < 1e-14


def test_one_node_is_the_midpoint_rule_which_does_not_preserve_the_energy():
    system = scene("pendulum")
    averaged, midpoint = stepper("avf", system, average_nodes=1), stepper("implicit-midpoint", system)
    states = [steps.start(h=0.2) for steps in (averaged, midpoint)]
    averaged.advance(states[0], 50)
    midpoint.advance(states[1], 50)
    assert states[0].y == pytest.approx(states[1].y, abs=1e-14)
    energy = compiled_scene(system).energy
    assert abs(energy(states[0].y) - energy(system.y0)) > 1e-4


@pytest.mark.parametrize(("name", "made", "h"), ENERGY)
def test_averages_are_those_of_plain_steps(name, made, h):
    system = scene(name)
    gap, _ = relative_gap(system, method(made), h)
    assert gap < 4e-15


@pytest.mark.parametrize("given", [0, 101, 2.0, True, "ten"])
def test_wrong_numbers_of_nodes_are_refused(given):
    with pytest.raises(IntegratorError, match=r"average_nodes must be an integer from 1 to 100, but was"):
        stepper("avf", scene("pendulum"), average_nodes=given)


# φ-functions


def mpf_of(ball):
    mantissa, exponent = ball.mid().man_exp()
    return mpmath.mpf(int(mantissa)) * mpmath.mpf(2) ** int(exponent)


@pytest.mark.parametrize("size", [1, 3, 8])
@pytest.mark.parametrize("scale", [Fraction(1, 1000), 1, 30])
def test_phi_functions_are_those_of_mpmath(size, scale):
    random = np.random.default_rng(size)
    rows = [[Fraction(float(x)) * scale for x in row] for row in random.normal(size=(size, size))]
    found = phi_functions(rows, 3)
    with mpmath.workdps(90):
        X = mpmath.matrix([[mpmath.mpf(x.numerator) / x.denominator for x in row] for row in rows])
        wanted, factorial = mpmath.expm(X), 1
        for k in range(1, 4):
            wanted = X**-1 * (wanted - mpmath.eye(size) / factorial)
            factorial *= k
            scale_of = mpmath.mnorm(wanted, 1)
            for i in range(size):
                for j in range(size):
                    assert abs(mpf_of(found[k - 1][i, j]) - wanted[i, j]) < 1e-30 * scale_of


def test_doubles_keep_what_rounding_takes():
    with flint.ctx.workprec(200):
        heads, tails = doubles([flint.arb(1) / 3, flint.arb(-1), flint.arb(2) ** -176, flint.arb(0)])
    assert heads[0] == 1 / 3
    assert tails[0] == float(Fraction(1, 3) - Fraction(1 / 3))
    assert heads.tolist()[1:] == [-1.0, 2.0**-176, 0.0]
    assert not tails[1:].any()


def test_exponentials_beyond_the_range_of_doubles_are_none():
    assert phi_functions([[Fraction(2000)]], 1) is None
    assert phi_functions([[Fraction(10) ** 300]], 1) is None


@pytest.mark.parametrize("decay", [10**4, 10**12, 10**300])
def test_phi_functions_of_stiff_matrices(decay):
    """φ_1(X) = −X⁻¹ but for e^X, here with −decay · [[2, −1], [−1, 2]]."""
    (found,) = phi_functions([[Fraction(-2 * decay), Fraction(decay)], [Fraction(decay), Fraction(-2 * decay)]], 1)
    with mpmath.workdps(40):
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            assert abs(mpf_of(found[i, j]) * 3 * decay - (2 if i == j else 1)) < 1e-30


# Flows

DUFFING = Scene(
    {"p": 1, "q": 1},
    terms=[Term(field={"p": "-4*q - p/3", "q": "p"}, part="L"), Term(field={"p": "-q^3"}, part="N")],
    start={"p": [0.3], "q": [1.2]},
    name="duffing",
)
AFFINE = Scene(
    {"x": ["u", "v", "w"]},
    terms=[
        Term(field={"u": "-u + 2*v + 1", "v": "u - 100*v", "w": "sqrt(2)"}, part="L"),
        Term(field={"u": "v*w", "w": "sin(u)"}, part="N"),
    ],
    start={"x": [1, 2, 3]},
    name="affine",
)
OSCILLATORS = Scene(
    {"p": 3, "q": 3},
    terms=[
        Term(over="each", hamiltonian="(p_i^2 + w_i*q_i^2)/2", part="L"),
        Term(over="ring", hamiltonian="(q_i - q_j)^4/4", part="N"),
    ],
    parameters={"w": [1, 1, 50]},
    start={"p": [0, 0, 0], "q": [1, 0, 2]},
    name="oscillators",
)
FROZEN = Scene(
    {"x": ["u"], "z": ["v"]},
    terms=[Term(field={"u": "-u*v + v"}, part="L"), Term(field={"u": "1 - u^2", "v": "u"}, part="N")],
    start={"x": [1], "z": [2]},
    name="frozen",
)
RIGID_BODY = Scene(
    {"y": 3},
    terms=[
        Term(field={"y2": "-y1*y3", "y3": "y1*y2"}, part="a"),
        Term(field={"y1": "-y2*y3/2", "y3": "y1*y2/2"}, part="b"),
    ],
    start={"y": [0.4, 0.5, 0.9]},
    name="rigid-body",
)
LINEAR, DIAGONAL, NUMERICAL = "add_products(", "growth(", "midpoint_step("
CASES = [
    (DUFFING, method("lawson4"), 0.1, LINEAR),
    (DUFFING, forced(3, "1/2"), -0.1, LINEAR),
    (AFFINE, forced(2), 0.1, LINEAR),
    (OSCILLATORS, method("lawson4"), 0.2, LINEAR),
    (FROZEN, method("lawson4").program.restricted(None), 0.1, DIAGONAL),  # its series is for linear parts only
    (FROZEN, forced(2), 0.1, NUMERICAL),
    (RIGID_BODY, strang(), 0.3, NUMERICAL),
]


@pytest.mark.few(3)
@pytest.mark.parametrize(("system", "made", "h", "kind"), CASES, ids=lambda x: getattr(x, "name", None))
def test_flows_are_those_of_plain_steps(system, made, h, kind):
    gap, steps = relative_gap(system, made, h)
    assert gap < 1e-15
    assert [call for call in (LINEAR, DIAGONAL, NUMERICAL) if call in steps.source] == [kind]


def whole_flow():
    builder = ProgramBuilder()
    return builder.program(builder.y + builder.flow(builder.y), name="flow")


def test_a_linear_flow_turns_without_a_drift():
    """Rounded elements of the matrix, the same in every step, would make |y|² drift by 1e-12."""
    steps = stepper(whole_flow(), scene("linear"))
    state = steps.start([1, 0], h=0.1)
    steps.advance(state, 100_000)
    with mpmath.workdps(40):
        t = 100_000 * mpmath.mpf(0.1)
        assert abs(state.y[0] - mpmath.cos(t)) < 1e-13
        assert abs(state.y[1] - mpmath.sin(t)) < 1e-13


def test_splitting_of_lotka_volterra_is_made_of_exponentials():
    system = scene("lotka-volterra")
    steps, h = stepper("strang", system), 0.1
    state = steps.start([2, 3], h=h)
    steps.advance(state, 1)
    p, q = 2.0, 3.0
    q *= np.exp(h / 2 * (p - 1))
    p *= np.exp(h * (2 - q))
    q *= np.exp(h / 2 * (p - 1))
    assert state.y == pytest.approx([p, q], rel=1e-15)
    state = steps.restart(state, h=-h)
    steps.advance(state, 1)
    assert state.y == pytest.approx([2, 3], rel=1e-15)


def test_numerical_flows_preserve_what_the_exact_ones_do():
    """Both parts turn the vector: its length changes by rounding only."""
    steps = stepper(strang(), RIGID_BODY)
    state = steps.start(h=0.3)
    length = np.sum(state.y**2)
    steps.advance(state, 1000)
    assert abs(np.sum(state.y**2) - length) < 1e-13
    parts = piece_fields(RIGID_BODY, ["a", "b"])
    other = plain_step(method("rk4"), lambda y: np.add(parts["a"](y), parts["b"](y)), RIGID_BODY.y0.tolist(), 0.3)
    assert abs(np.sum(other**2) - length) > 1e-7


def test_a_flow_that_does_not_exist_is_no_step():
    system = Scene(
        {"x": ["u"], "z": ["v"]},
        terms=[Term(field={"u": "u^2"}, part="a"), Term(field={"v": "-v"}, part="b")],
        start={"x": [1], "z": [2]},
        name="blow-up",
    )
    steps = stepper(strang(), system)
    state = steps.start(h=0.125)
    with pytest.raises(
        StepError, match=r"h must be small enough for strang on blow-up, .* step 8, from t = 0.875"
    ) as e:
        steps.advance(state, 100)
    assert e.value.y == pytest.approx([8, 2 * np.exp(-0.875)])
    assert state.n == 7
