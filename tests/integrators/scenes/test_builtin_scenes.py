"""The built-in scenes: what they keep, what their effects break, solutions that are known, options."""

from __future__ import annotations

import json
import pickle
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy

from integrators import IntegratorError, Scene, scene, scene_catalogue
from integrators.exact.expressions import parse_expression

ORBIT = ("relativity", "oblateness", "drag")
# name: (variables in the order of the state, effects)
SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "riccati": ("y", ()),
    "linear": ("y1 y2", ()),
    "nonlinear-oscillator": ("u1 u2", ()),
    "lotka-volterra": ("p q", ()),
    "rigid-body": ("y1 y2 y3", ()),
    "abc-flow": ("x y z", ()),
    "brusselator": ("u v", ()),
    "van-der-pol": ("y1 y2", ()),
    "lorenz": ("x y z", ()),
    "kepler": ("p1 p2 q1 q2", ORBIT),
    "perturbed-kepler": ("p1 p2 q1 q2", ORBIT),
    "harmonic-oscillator": ("p q", ()),
    "pendulum": ("p q", ("asymmetry", "damping", "drive")),
    "double-pendulum": ("p1 p2 q1 q2", ()),
    "henon-heiles": ("p1 p2 q1 q2", ()),
    "central-field": ("p_r p_phi r phi", ("perturbation",)),
    "field-nijhoff": ("p q", ()),
    "charged-particle": ("vx vy vz x y z", ()),
    "magnetic-dipole": ("vx vy vz x y z", ("attraction",)),
}
CASES = [(name, effect) for name, (_, effects) in SCENES.items() for effect in (None, *effects)]
LECTURE = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())
ZERO = 1e-25


@pytest.fixture(autouse=True)
def _thirty_digits():
    with mpmath.workdps(30):
        yield


def evaluate(formula: Any, names: tuple[str, ...], point: Any) -> Any:
    return sympy.lambdify(names, formula, "mpmath")(*point)


def random_point(dimension: int) -> list[Any]:
    """Positive numbers, which lie in the domain of every scene."""
    generator = random.Random(dimension)
    return [mpmath.mpf(generator.randint(300, 1500)) / 1000 for _ in range(dimension)]


def filled(formula: sympy.Expr, built: Scene) -> sympy.Expr:
    """The formula with the values of parameters."""
    return formula.xreplace({sympy.Symbol(name): value for name, value in built.parameter_values.items()})


def rate(formula: sympy.Expr, built: Scene) -> Any:
    """∇I·f at a random point."""
    formula = filled(formula, built)
    along = sum(formula.diff(y) * f for y, f in zip(built.symbols, built.field, strict=True))
    return evaluate(along, built.variables, random_point(built.dimension))


# The catalogue


def test_every_scene_says_what_it_is():
    entries = {entry.name: entry for entry in scene_catalogue()}
    assert [name for name in entries if name in SCENES] == list(SCENES)
    for name, (variables, effects) in SCENES.items():
        built = entries[name].build()
        assert (built.name, built.summary, built.reference) == (name, entries[name].summary, entries[name].reference)
        assert built.summary
        assert built.reference
        assert built.variables == tuple(variables.split())
        assert tuple(built.effects) == effects
        assert all(effect.summary for effect in built.effects.values())
        assert np.isfinite(built.y0).all()


@pytest.mark.parametrize(("name", "effect"), CASES)
def test_every_effect_changes_the_field(name: str, effect: str | None):
    built = scene(name, effects=effect)
    assert len(built.field) == built.dimension
    assert len(built.local_terms) > 0
    assert pickle.loads(pickle.dumps(built)) == built
    assert (built.field == scene(name).field) == (effect is None)


@pytest.mark.parametrize(
    ("alias", "name"),
    [
        ("Harmonic oscillator", "harmonic-oscillator"),
        ("predator_prey", "lotka-volterra"),
        ("Hénon–Heiles", "henon-heiles"),
        ("Euler-Top", "rigid-body"),
        ("ABC", "abc-flow"),
    ],
)
def test_other_names(alias: str, name: str):
    assert scene(alias) == scene(name)


# First integrals


@pytest.mark.parametrize(("name", "effect"), CASES)
def test_first_integrals_are_kept(name: str, effect: str | None):
    built = scene(name, effects=effect)
    for formula in built.invariants.values():
        assert abs(rate(formula, built)) < ZERO
    if built.hamiltonian is not None:
        assert abs(rate(built.hamiltonian, built)) < ZERO


@pytest.mark.parametrize(("name", "effect"), [case for case in CASES if case[1]])
def test_effects_break_what_they_say(name: str, effect: str):
    plain, built = scene(name), scene(name, effects=effect)
    broken = built.effects[effect].breaks
    assert set(plain.invariants) - set(built.invariants) == set(broken) <= set(plain.invariants)
    for key in broken:
        assert abs(rate(plain.invariants[key], built)) > 1e-6
    if built.hamiltonian is None:
        assert abs(rate(built.base_hamiltonian, built)) > 1e-6


# Forms of the lecture


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("lotka-volterra", LECTURE["example2_lotka_volterra_and_exercise2"]["ode"]),
        ("field-nijhoff", LECTURE["exercise5_field_nijhoff"]["ode"]),
        ("abc-flow", LECTURE["exercise6_volume_preserving"]["ode"]),
    ],
)
def test_fields_of_the_lecture(name: str, text: str):
    symbols = {key: key for key in scene(name).parameters} if name != "lotka-volterra" else {}
    built = scene(name, **symbols)
    written = re.sub(r" (sin|cos) (\w)", r"*\1(\2)", text)
    equations = dict(equation.split("'=") for equation in written.split(", "))
    expected = [parse_expression(equations[y], names=[*built.variables, *symbols]) for y in built.variables]
    assert [(f - g).expand() for f, g in zip(built.field, expected, strict=True)] == [0] * built.dimension


@pytest.mark.parametrize(
    ("name", "parameters", "text"),
    [
        ("lotka-volterra", {}, LECTURE["example2_lotka_volterra_and_exercise2"]["first_integral"].split(" = ")[1]),
        ("pendulum", {}, LECTURE["example5_midpoint_pendulum"]["hamiltonian"]),
        ("field-nijhoff", {"alpha": "alpha", "beta": "beta"}, LECTURE["exercise5_field_nijhoff"]["H"]),
        ("perturbed-kepler", {"mu": "mu"}, "(p1^2+p2^2)/2 - 1/sqrt(q1^2+q2^2) - mu/(3*sqrt(q1^2+q2^2)^3)"),
        ("central-field", {"potential": "-1/r - r"}, "p_phi**2/(2*r**2) + p_r**2/2 - 1/r - r"),
    ],
)
def test_hamiltonians_of_the_lecture(name: str, parameters: dict[str, str], text: str):
    built = scene(name, **parameters)
    expected = parse_expression(text, names=[*built.variables, *parameters])
    assert (built.hamiltonian - expected).expand() == 0


@pytest.mark.parametrize(
    ("plane", "effect"), [("kepler", ()), ("perturbed-kepler", "perturbation")], ids=["kepler", "perturbed"]
)
def test_polar_coordinates(plane: str, effect: Any):
    """Formula (26) of the lecture takes the one form of the problem to the other."""
    polar = scene("central-field", effects=effect)
    p_r, p_phi, r, phi = polar.symbols
    cos, sin = sympy.cos(phi), sympy.sin(phi)
    values = (p_r * cos - p_phi * sin / r, p_r * sin + p_phi * cos / r, r * cos, r * sin)
    flat = scene(plane)
    difference = flat.hamiltonian.subs(dict(zip(flat.symbols, values, strict=True))) - polar.hamiltonian
    assert abs(evaluate(difference, polar.variables, random_point(4))) < ZERO


# Known solutions


def ellipse(x: Any) -> list[Any]:
    """The orbit of Kepler's problem with eccentricity 3/5, by its eccentric anomaly."""
    e, b = mpmath.mpf(3) / 5, mpmath.mpf(4) / 5
    r = 1 - e * mpmath.cos(x)
    return [-mpmath.sin(x) / r, b * mpmath.cos(x) / r, mpmath.cos(x) - e, b * mpmath.sin(x)]


def orbit(t: Any) -> list[Any]:
    """The same by the time: Kepler's equation."""
    return ellipse(mpmath.findroot(lambda x: x - 3 * mpmath.sin(x) / 5 - t, t + mpmath.mpf(3) / 10))


def polar_orbit(t: Any) -> list[Any]:
    p1, p2, q1, q2 = orbit(t)
    r = mpmath.hypot(q1, q2)
    return [(p1 * q1 + p2 * q2) / r, mpmath.mpf(4) / 5, r, mpmath.atan2(q2, q1)]


def tumbling(t: Any) -> list[Any]:
    """Jacobi's solution (Landau–Lifshitz, Mechanics, §37), for the moments and the start of HLW."""
    cos, sin = mpmath.cos(mpmath.mpf("1.1")), mpmath.sin(mpmath.mpf("1.1"))
    sn, cn, dn = (mpmath.ellipfun(kind, sin * t / mpmath.sqrt(2), k=cos / sin) for kind in ("sn", "cn", "dn"))
    return [cos * cn, -mpmath.sqrt(2) * cos * sn, sin * dn]


SOLUTIONS: dict[str, Callable[[Any], list[Any]]] = {
    "riccati": lambda t: [1 / (1 - t)],
    "linear": lambda t: [mpmath.cos(t) - mpmath.sin(t), mpmath.cos(t) + mpmath.sin(t)],
    "harmonic-oscillator": lambda t: [-mpmath.sin(t), mpmath.cos(t)],
    "nonlinear-oscillator": lambda t: [mpmath.cos(t), mpmath.sin(t)],
    "field-nijhoff": lambda t: [2 * mpmath.exp(-t / 4) - 1, 2 * mpmath.exp(t / 4) - 1],
    "kepler": orbit,
    "central-field": polar_orbit,
    "rigid-body": tumbling,
}


@pytest.mark.parametrize("name", SOLUTIONS)
@pytest.mark.parametrize("time", ["0.1", "0.75"])
def test_closed_solutions(name: str, time: str):
    built, solution, t = scene(name), SOLUTIONS[name], mpmath.mpf(time)
    expected = [evaluate(f, built.variables, solution(t)) for f in built.field]
    assert [float(y) for y in solution(mpmath.mpf(0))] == pytest.approx(built.y0.tolist(), abs=1e-15)
    for k, value in enumerate(expected):
        assert abs(mpmath.diff(lambda s, k=k: solution(s)[k], t) - value) < 1e-12


@pytest.mark.parametrize("eccentricity", ["0", "1/5", 0.6, sympy.sqrt(2) / 2])
def test_the_start_of_kepler(eccentricity: Any):
    built = scene("kepler", eccentricity=eccentricity)
    at_start = dict(zip(built.symbols, built.start, strict=True))
    e = sympy.nsimplify(eccentricity)
    assert sympy.simplify(built.hamiltonian.subs(at_start)) == sympy.Rational(-1, 2)
    values = [sympy.simplify(filled(formula, built).subs(at_start)) for formula in built.invariants.values()]
    assert [sympy.simplify(x - y) for x, y in zip(values, [sympy.sqrt(1 - e**2), e, 0], strict=True)] == [0, 0, 0]


@pytest.mark.parametrize(
    ("name", "effect", "advance"),
    [
        ("kepler", "relativity", lambda p: 6 * mpmath.pi / (100**2 * p)),
        ("kepler", "oblateness", lambda p: 3 * mpmath.pi / 1000 * (1 / (4 * p)) ** 2),
        ("perturbed-kepler", None, lambda p: 2 * mpmath.pi * mpmath.mpf("0.015") / p**2),
    ],
)
def test_advance_of_the_perihelion(name: str, effect: str | None, advance: Callable[[Any], Any]):
    """The change of the Runge–Lenz vector in a revolution to first order; the trapezoidal rule has all 30 digits."""
    plain, built = scene("kepler"), scene(name, effects=effect)
    across = filled(plain.invariants["runge_lenz_2"], plain)
    change = sum(across.diff(y) * (f - g) for y, f, g in zip(plain.symbols, built.field, plain.field, strict=True))
    integrand, e, steps = sympy.lambdify(plain.variables, change, "mpmath"), mpmath.mpf(3) / 5, 80
    anomalies = [2 * mpmath.pi * k / steps for k in range(steps)]
    total = sum(integrand(*ellipse(x)) * (1 - e * mpmath.cos(x)) for x in anomalies) * 2 * mpmath.pi / steps
    assert abs(total / e / advance(1 - e**2) - 1) < ZERO


ROOT = sympy.sqrt(72)
X = sympy.Symbol("X")


@pytest.mark.parametrize(
    ("name", "point", "polynomial"),
    [
        ("brusselator", (1, 3), X**2 - X + 1),  # X² + (1 + A² − B) X + A²
        ("lorenz", (ROOT, ROOT, 27), X**3 + 41 * X**2 / 3 + 304 * X / 3 + 1440),
        ("van-der-pol", (0, 0), X**2 - 10**6 * X + 10**6),
        ("lotka-volterra", (1, 2), X**2 + 2),
        ("henon-heiles", (0, 0, 0, 1), (X**2 + 3) * (X**2 - 1)),
        ("double-pendulum", (0, 0, 0, 0), X**4 + 4 * X**2 + 2),  # ω² = 2 ± √2
        ("double-pendulum", (0, 0, sympy.pi, sympy.pi), X**4 - 4 * X**2 + 2),
    ],
)
def test_linearised_at_equilibria(name: str, point: tuple[Any, ...], polynomial: sympy.Expr):
    built = scene(name)
    there = dict(zip(built.symbols, point, strict=True))
    assert [f.subs(there) for f in built.field] == [0] * built.dimension
    jacobian = sympy.Matrix(built.field).jacobian(built.symbols).subs(there)
    assert (jacobian.charpoly(X).as_expr() - polynomial).expand() == 0


def test_slow_manifold_of_van_der_pol():
    """y2 = y1/(1 − y1²), to leading order in ε: what solutions from (2, −0.66) follow."""
    built = scene("van-der-pol", epsilon="epsilon")
    y1, y2 = built.symbols
    assert sympy.cancel(built.field[1].subs(y2, y1 / (1 - y1**2))) == 0


def test_henon_heiles_escapes_above_one_sixth():
    built = scene("henon-heiles", energy="1/8")
    assert built.hamiltonian.subs(dict(zip(built.symbols, (0, 0, 0, 1), strict=True))) == sympy.Rational(1, 6)
    assert built.hamiltonian.subs(dict(zip(built.symbols, built.start, strict=True))) == sympy.Rational(1, 8)


def test_double_pendulum_from_its_lagrangian():
    """H = p·v − L at p = ∂L/∂v, with L from the positions of the two masses."""
    names = {key: key for key in ("m1", "m2", "l1", "l2", "g")}
    built = scene("double-pendulum", **names)
    m1, m2, l1, l2, g, v1, v2 = symbols = sympy.symbols("m1 m2 l1 l2 g v1 v2")
    q1, q2 = built.symbols[2:]
    first = l1 * sympy.Matrix([sympy.sin(q1), -sympy.cos(q1)])
    second = first + l2 * sympy.Matrix([sympy.sin(q2), -sympy.cos(q2)])
    speeds = [x.jacobian([q1, q2]) * sympy.Matrix([v1, v2]) for x in (first, second)]
    kinetic = sum(m * v.dot(v) / 2 for m, v in zip((m1, m2), speeds, strict=True))
    lagrangian = kinetic - g * (m1 * first[1] + m2 * second[1])
    momenta = [lagrangian.diff(v) for v in (v1, v2)]
    energy = built.hamiltonian.subs(dict(zip(built.symbols, momenta, strict=False)))
    difference = energy - (momenta[0] * v1 + momenta[1] * v2 - lagrangian)
    assert abs(evaluate(difference, tuple(map(str, (*symbols, q1, q2))), random_point(9))) < ZERO


def test_abc_flow_is_a_sum_of_shears():
    built = scene("abc-flow", A="A", B="B", C="C")
    assert built.parts == ("a", "b", "c")
    for summand, part, target in zip(built.summands, "abc", "xyz", strict=True):
        assert (summand.part, summand.target) == (part, target)
        assert sympy.Symbol(target) not in summand.formula.free_symbols
    x, y, z = built.symbols
    f, g, h = built.field
    assert (h.diff(y) - g.diff(z), f.diff(z) - h.diff(x), g.diff(x) - f.diff(y)) == built.field  # curl v = v


# Options


@pytest.mark.parametrize(
    ("matrix", "field"),
    [
        ([["-1/2", 0.1], [0, "sqrt(2)"]], ("-y1/2 + y2/10", "sqrt(2)*y2")),
        (np.array([[1, 2], [3, 4]]), ("y1 + 2*y2", "3*y1 + 4*y2")),
        (sympy.Matrix([[0, 1], [0, 0]]).tolist(), ("y2", "0")),
        ([[-2]], ("-2*y",)),
    ],
)
def test_linear_with_a_matrix(matrix: Any, field: tuple[str, ...]):
    built = scene("linear", matrix=matrix)
    assert tuple(map(str, built.field)) == field
    assert built.invariants == {}


def test_linear_skew_symmetric():
    built = scene("linear", matrix=[[0, 1, -2], [-1, 0, 3], [2, -3, 0]])
    assert list(built.invariants) == ["squared_norm"]
    assert abs(rate(built.invariants["squared_norm"], built)) < ZERO


def test_parameters_of_lotka_volterra_and_kepler():
    built = scene("lotka-volterra", alpha="1/2", beta=3)
    assert built.field == tuple(parse_expression(f, names=["p", "q"]) for f in ("3*p - p*q", "p*q - q/2"))
    assert abs(rate(built.hamiltonian, built)) < ZERO
    heavier = scene("kepler", effects="relativity", mu=2, c="3")
    assert heavier.parameters == {"mu": 2, "c": 3}
    assert abs(rate(heavier.invariants["angular_momentum"], heavier)) < ZERO


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("kepler", {"eccentricity": 1}, "eccentricity must be at least 0 and less than 1, but was 1$"),
        ("perturbed-kepler", {"eccentricity": "-1/2"}, "eccentricity must be at least 0 .* but was -1/2$"),
        ("kepler", {"eccentricity": "e"}, "eccentricity must be .* unknown name 'e'"),
        ("kepler", {"eccentricity": None}, "eccentricity must be a formula or a number, but was None"),
        (
            "kepler",
            {"ecentricity": "1/2"},
            "there is no parameter ecentricity; the parameters are mu; options of kepler are eccentricity",
        ),
        ("kepler", {"c": 10}, "there is no parameter c unless the effect relativity is on"),
        (
            "kepler",
            {"effects": "friction"},
            "there is no effect 'friction'; the effects are relativity, oblateness, drag",
        ),
        ("henon-heiles", {"energy": 0}, "energy must be at least 7/1500, but was 0"),
        ("central-field", {"potential": "-1/q"}, "potential must be a formula.* unknown name 'q'"),
        ("central-field", {"potential": "log(r - 1)"}, "start must .*r - 1"),
        ("linear", {"matrix": [[1, 2], [3]]}, "matrix must be square, but row 2 of 2 has length 1"),
        ("linear", {"matrix": [[1, 2]]}, "matrix must be square, but row 1 of 1 has length 2"),
        ("linear", {"matrix": []}, "matrix must have at least one row, but was empty"),
        ("linear", {"matrix": 3}, "matrix must be a sequence, but was 3"),
        ("linear", {"matrix": [["a"]]}, r"matrix\[1\]\[1\] must be .* unknown name 'a'"),
        ("double-pendulum", {"m2": 0}, "must make m2 positive, but it was 0"),
        ("riccati", {"y": 2}, "there is no parameter y; there are none"),
    ],
)
def test_options_that_are_refused(name: str, options: dict[str, Any], message: str):
    with pytest.raises(IntegratorError, match=message) as caught:
        scene(name, **options)
    assert "\n" not in str(caught.value)
