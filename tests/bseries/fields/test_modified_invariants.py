"""Integrals of modified equations of Poisson systems, and divergences: exercises 2 and 6 of the lecture."""

import json
from pathlib import Path

import numpy as np
import pytest
import sympy

import bseries as bs
from bseries.fields.differential_rings import DifferentialRing
from bseries.fields.modified_invariants import potential

LECTURE = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())
EXERCISE2 = LECTURE["example2_lotka_volterra_and_exercise2"]
EXERCISE5 = LECTURE["exercise5_field_nijhoff"]
EXERCISE6 = LECTURE["exercise6_volume_preserving"]
LOTKA_VOLTERRA = bs.scene("lotka-volterra")
ABC = bs.scene("abc-flow", A=2, B=3, C=5)
X, Y, Z = sympy.symbols("x y z")
SHORT = {f"{'cs'[f is sympy.sin]}{x}": f(x) for f in (sympy.sin, sympy.cos) for x in (X, Y, Z)}


def lecture_formula(text):
    values = {"A": sympy.Integer(2), "B": sympy.Integer(3), "C": sympy.Integer(5)}
    return sympy.sympify(text, locals={str(x): x for x in sympy.symbols("p q")} | values | SHORT)


def invariant_of(scene, method, order, **options):
    return bs.modified_invariant(bs.modified_field(bs.method(method), scene, order, **options))


@pytest.mark.parametrize("name", ["p", "q"])
def test_the_integrals_of_exercise_2(name):
    found = invariant_of(LOTKA_VOLTERRA, f"symplectic-euler-{name}", 3)
    expected = EXERCISE2[f"symplectic_euler_{name}_implicit"]["first_integral_I_k"]
    assert [sympy.expand(a - lecture_formula(b)) for a, b in zip(found.terms, expected, strict=True)] == [0, 0, 0]


@pytest.mark.parametrize(("method", "power"), [("explicit-euler", 1), ("implicit-midpoint", 2), ("rk4", 4)])
def test_methods_that_are_no_poisson_integrators_fail(method, power):
    power_named = rf"at h\^{power}, B\^\(-1\) f_{power + 1} "
    message = rf"f must be a Hamiltonian or Poisson field, but .* of {method} on lotka-volterra .*: {power_named}"
    with pytest.raises(bs.SeriesError, match=message):
        invariant_of(LOTKA_VOLTERRA, method, power + 1)
    assert invariant_of(LOTKA_VOLTERRA, method, power).terms[1:] == (0,) * (power - 1)


@pytest.mark.parametrize("name", ["p", "q"])
def test_the_numerical_solution_keeps_the_integral(name):
    """Exercise 2: the deviation from I + … + h^k I_(k+1) over 5000 steps, as tabulated in the lecture."""
    table = EXERCISE2[f"symplectic_euler_{name}_implicit"]
    expected = table["max_deviation_of_truncated_first_integral_h0.1_5000steps_from_(p,q)=(1.5,2.5)"]
    found = invariant_of(LOTKA_VOLTERRA, f"symplectic-euler-{name}", 5)
    orbit = np.array(list(symplectic_euler(name, 1.5, 2.5, 0.1, 5000))).T
    for k in range(5):
        partial = found._replace(terms=found.terms[: k + 1]).expression(0.1)
        values = sympy.lambdify(found.variables, partial, "numpy")(*orbit)
        assert np.abs(values - values[0]).max() == pytest.approx(expected[f"h^{k}"], rel=1e-6)


def symplectic_euler(name, p, q, h, steps):
    """The definitions of the lecture, solved for the implicit variable."""
    yield p, q
    for _ in range(steps):
        if name == "p":
            p = p / (1 - h * (2 - q))
            q = q + h * q * (p - 1)
        else:
            q = q / (1 - h * (p - 1))
            p = p + h * p * (2 - q)
        yield p, q


def test_the_hamiltonian_of_exercise_5():
    """H − Σ h^k I^(−k) / (k (k+1)) with I = (1 + p)(1 + q)."""
    found = invariant_of(bs.scene("field-nijhoff"), "symplectic-euler-p", 8)
    p, q = found.variables
    coefficients = EXERCISE5["p_implicit"]["coefficients_of_h^k_I^-k_k=1..9"]
    for k in range(1, 8):
        expected = sympy.Rational(coefficients[k - 1]) / ((1 + p) * (1 + q)) ** k
        assert sympy.simplify(found.terms[k] - expected) == 0


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("implicit-midpoint", LECTURE["example5_midpoint_pendulum"]["H_h^k"]),
        ("stormer-verlet-kdk", LECTURE["example6_stoermer_verlet"]["direct"]["pendulum"]["UTU"]),
        ("stormer-verlet-dkd", LECTURE["example6_stoermer_verlet"]["direct"]["pendulum"]["TUT"]),
        ("symplectic-euler-p", LECTURE["example7_symplectic_euler_eq25"]["pendulum"]),
    ],
)
def test_hamiltonians_of_the_pendulum(method, expected):
    found = invariant_of(bs.scene("pendulum"), method, 5)
    for key, text in expected.items():
        if key.strip("h^").isdigit():
            formula = text["fourier"] if isinstance(text, dict) else text
            difference = found.terms[int(key.strip("h^"))] - lecture_formula(formula)
            assert all(sympy.simplify(difference.diff(x)) == 0 for x in found.variables)


@pytest.mark.parametrize(
    ("scene", "options", "method"),
    [
        ("kepler", {}, "stormer-verlet"),
        ("henon-heiles", {}, "symplectic-euler-q"),
        ("toda", {}, "stormer-verlet"),
        ("central-field", {}, "symplectic-euler-p"),
        ("fermi-pasta-ulam", {"m": 1}, "stormer-verlet"),
    ],
)
def test_integrals_give_back_the_field(scene, options, method):
    """J⁻¹ ∇I_k at a random point against the compiled terms."""
    f = bs.modified_field(bs.method(method), bs.scene(scene, **options), 3)
    found = bs.modified_invariant(f)
    n = f.dimension // 2
    y = f.scene.y0 + np.random.default_rng(1).uniform(0.1, 0.3, 2 * n)
    point = {x: sympy.Float(value, 30) for x, value in zip(found.variables, y, strict=True)}
    for term, expected in zip(found.terms, f.terms(y), strict=True):
        gradient = [float(term.diff(x).subs(point)) for x in found.variables]
        assert [*(-g for g in gradient[n:]), *gradient[:n]] == pytest.approx(expected.tolist(), rel=1e-9, abs=1e-11)


@pytest.mark.parametrize(
    ("scene", "method", "message"),
    [
        ("rigid-body", "implicit-midpoint", "scene must have an invertible structure B, but that of rigid-body"),
        ("abc-flow", "rk4", "scene must be canonical or a Poisson system in all variables, but abc-flow is not"),
        (
            "brusselator",
            "rk4",
            "canonical .*, but brusselator is not; momenta and positions are recognised by the names of blocks",
        ),
        ("n-body", "stormer-verlet", "f must be simple enough to integrate, but .* is not: at h"),
        ("pendulum", "tsit5", "f must be exact, but the coefficients of .* are decimals"),
    ],
)
def test_refused_integrals(scene, method, message):
    with pytest.raises(bs.SeriesError, match=message):
        invariant_of(bs.scene(scene), method, 3)


def test_effects_without_an_integral():
    message = r"f must be a Hamiltonian or Poisson field, but .* is none: at h\^0, B\^\(-1\) f_1 is no gradient"
    with pytest.raises(bs.SeriesError, match=message):
        invariant_of(bs.scene("pendulum", effects=["damping"]), "symplectic-euler-p", 2)
    with pytest.raises(bs.SeriesError, match="canonical or a Poisson system in all variables, but pendulum is not"):
        invariant_of(bs.scene("pendulum", effects=["drive"]), "symplectic-euler-p", 2)


def test_maps_are_refused():
    step = bs.series_map(bs.method("rk4"), bs.scene("pendulum"), 2)
    for function in (bs.modified_invariant, lambda f: bs.fields.divergence(f, 0)):
        with pytest.raises(bs.SeriesError, match="f must be a field, such as modified_field gives, but was the series"):
            function(step)


def test_text_and_plain_data():
    found = invariant_of(bs.scene("pendulum"), "symplectic-euler-p", 2)
    p, q, h = sympy.symbols("p q h")
    assert found.expression(h) == p**2 / 2 - sympy.cos(q) - h * p * sympy.sin(q) / 2
    assert str(found).splitlines()[1:] == ["h^0   p**2/2 - cos(q)", "h^1   -p*sin(q)/2"]
    data = json.loads(json.dumps(found.to_dict()))
    assert data["terms"][1] == {"power": 1, "invariant": "-p*sin(q)/2"}
    with pytest.raises(bs.SeriesError, match="h must be a number or a SymPy expression, but was '1'"):
        found.expression("1")


P, Q, R = sympy.symbols("p q r")


@pytest.mark.parametrize(
    "function",
    [
        P**3 * Q - Q**2 / 7 + 3 * P,
        sympy.log(P + 2 * Q) + P * Q**3 / (P + 2 * Q) ** 2,
        sympy.log(P * P + Q * Q) + (P**2 + Q**2 + 1) ** sympy.Rational(-3, 2),
        sympy.sin(P) ** 2 * sympy.cos(Q) + sympy.cos(P - 2 * Q) ** 3,
        P * sympy.sin(Q) ** 4 + Q * sympy.cos(Q) ** 2 + Q**2 * sympy.sin(3 * Q),
        P**2 * sympy.exp(2 * Q - 3 * P) + sympy.exp(-Q),
        sympy.sqrt(P) * Q + P ** sympy.Rational(5, 3) + sympy.sqrt(2) * P,
        R * P**2 * Q + sympy.cos(R) * Q,
    ],
    ids=str,
)
def test_potentials_of_gradients(function):
    ring = DifferentialRing([function.diff(P), function.diff(Q)], [P, Q])
    found = potential(ring, ring.elements)
    point = {P: sympy.Rational(3, 7), Q: sympy.Rational(5, 11), R: sympy.Rational(1, 3)}
    for x in (P, Q):
        assert abs((found.diff(x) - function.diff(x)).subs(point).evalf(30)) < 1e-25


@pytest.mark.parametrize(
    "gradient",
    [(1 / sympy.sin(P), 0), (sympy.exp(P**2), 0), (P**2 / sympy.sqrt(P**2 + Q**2), 0), (Q, 0)],
    ids=str,
)
def test_no_potential_is_found(gradient):
    """Beyond the rules, and the last no gradient at all: the answer is verified."""
    ring = DifferentialRing([sympy.sympify(g) for g in gradient], [P, Q])
    assert potential(ring, ring.elements) is None


@pytest.mark.parametrize(
    ("method", "powers"),
    [(bs.methods.lie_trotter(["a", "b", "c"]), range(6)), (bs.methods.strang(["a", "b", "c"]), range(6))],
    ids=str,
)
def test_splittings_preserve_volume(method, powers):
    f = bs.modified_field(method, bs.scene("abc-flow"), len(powers))
    assert [bs.fields.divergence(f, k) for k in powers] == [0] * len(powers)
    assert any(f.symbolic(k) != (0, 0, 0) for k in powers[1:])


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("explicit-euler", EXERCISE6["counter_example_explicit_euler_divergence"]),
        ("implicit-midpoint", EXERCISE6["implicit_midpoint_divergence_(not volume preserving in 3D)"]),
    ],
)
def test_other_methods_do_not(method, expected):
    f = bs.modified_field(bs.method(method), ABC, 3)
    found = [bs.fields.divergence(f, k) for k in range(3)]
    assert [sympy.simplify(a - lecture_formula(b)) for a, b in zip(found, expected, strict=True)] == [0, 0, 0]
    assert found[-1] != 0


@pytest.mark.parametrize("scene", ["pendulum", "lotka-volterra", "lorenz"])
def test_divergence_from_its_definition(scene):
    f = bs.modified_field(bs.method("heun2"), bs.scene(scene), 4)
    for k in range(4):
        expected = sum(g.diff(x) for g, x in zip(f.symbolic(k), f.scene.symbols, strict=True))
        assert sympy.simplify(bs.fields.divergence(f, k) - expected) == 0


@pytest.mark.parametrize("k", [-1, 3, True, "1", 1.0])
def test_bad_powers(k):
    f = bs.modified_field(bs.method("rk4"), bs.scene("pendulum"), 3)
    with pytest.raises(bs.SeriesError, match="k must be a power of h from 0 to 2, but was"):
        bs.fields.divergence(f, k)
