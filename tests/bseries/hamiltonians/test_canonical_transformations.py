"""Symplectic changes of coordinates: exercises 3 and 4 of the lecture, and (26)."""

import pickle

import numpy as np
import pytest
import sympy

import bseries as bs
from bseries.hamiltonians.canonical_transformations import (
    CoordinateChange,
    canonical_transformation,
    generating_transformation,
    harmonic_action_angle,
    point_transformation,
)

ONE, TWO, THREE = ({"p": n, "q": n} for n in (1, 2, 3))
NEW, NEW_TWO = ({"P": n, "Q": n} for n in (1, 2))
POLAR = {"p": ["p_r", "p_phi"], "q": ["r", "phi"]}
SPHERICAL = {"p": ["p_r", "p_u", "p_v"], "q": ["r", "u", "v"]}
CIRCLE = {"q1": "r*cos(phi)", "q2": "r*sin(phi)"}
SPHERE = {"q1": "r*sin(u)*cos(v)", "q2": "r*sin(u)*sin(v)", "q3": "r*cos(u)"}

CHANGES = {
    "polar": lambda: point_transformation(TWO, POLAR, CIRCLE, positive=["r"]),
    "spherical": lambda: point_transformation(THREE, SPHERICAL, SPHERE, positive=["r"]),
    "oscillators": lambda: harmonic_action_angle(TWO, {"a": 2, "theta": 2}, [2, "sqrt(3)"]),
    "kick": lambda: canonical_transformation(
        TWO, NEW_TWO, {"p1": "P1 + sin(Q2)", "p2": "P2 + Q1*cos(Q2)", "q1": "Q1", "q2": "Q2"}
    ),
    "quarter turn": lambda: canonical_transformation(ONE, NEW, {"p": "-Q", "q": "P"}),
    "generating": lambda: generating_transformation(TWO, NEW_TWO, "P1*q1 + 2*P2*q2 + q1*q2 + P1*P2*q1 + sin(P1)"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_the_jacobian_is_symplectic(name):
    """By differences of the map, ψ'ᵀ Ω ψ' = Ω, with all momenta before all positions."""
    change = CHANGES[name]()
    assert change.is_symplectic
    z = np.random.default_rng(5).uniform(0.5, 1, len(change.symbols))
    step = 1e-6 * np.eye(len(z))
    jacobian = np.array([change.to_old(z + d) - change.to_old(z - d) for d in step]).T / 2e-6
    size = len(z) // 2
    form = np.block([[np.zeros((size, size)), np.eye(size)], [-np.eye(size), np.zeros((size, size))]])
    assert np.abs(jacobian.T @ form @ jacobian - form).max() < 1e-8


@pytest.mark.parametrize("name", CHANGES)
def test_newtons_method_inverts_the_map(name):
    change = CHANGES[name]()
    z = np.random.default_rng(6).uniform(0.5, 1, (len(change.symbols), 30))
    assert np.abs(change.to_new(change.to_old(z), z + 0.02) - z).max() < 1e-13
    assert np.abs(change.to_new(change.to_old(z[:, 0]), z[:, 0] + 0.02) - z[:, 0]).max() < 1e-13


def test_blocks_in_another_order():
    change = canonical_transformation({"q": 1, "p": 1}, ONE, {"p": "p + q^2", "q": "q"})
    assert change.to_old([2.0, 3.0]).tolist() == [3.0, 11.0]
    assert not CoordinateChange({"q": 1, "p": 1}, ONE, {"p": "q", "q": "p"}).is_symplectic


# Exercise 3, and (26).


def test_polar_momenta_are_those_of_the_lecture():
    p1, p2, p_r, p_phi, r, phi = sympy.symbols("p1 p2 p_r p_phi r phi")
    formulas = CHANGES["polar"]().formulas
    momenta = {p1: formulas["p1"], p2: formulas["p2"]}
    radial = p1 * sympy.cos(phi) + p2 * sympy.sin(phi)
    angular = -r * p1 * sympy.sin(phi) + r * p2 * sympy.cos(phi)
    assert sympy.simplify(radial.subs(momenta) - p_r) == 0
    assert sympy.simplify(angular.subs(momenta) - p_phi) == 0


@pytest.mark.parametrize(("name", "effects"), [("kepler", []), ("perturbed-kepler", ["perturbation"])])
def test_example_8_central_fields(name, effects):
    """The Kepler problems in polar coordinates are the built-in central fields."""
    polar = CHANGES["polar"]().hamiltonian(bs.scene(name), start={"p": [0, "4/5"], "q": ["2/5", 0]})
    expected = bs.scene("central-field", effects=effects)
    assert polar.variables == expected.variables
    assert sympy.expand(polar.hamiltonian - expected.hamiltonian) == 0
    assert str(polar.invariants["angular_momentum"]) == "p_phi"
    assert not polar.invariant_defects()


def test_solutions_correspond():
    """Exercise 4: ψ carries solutions in new variables to solutions in old ones."""
    change, kepler = CHANGES["polar"](), bs.scene("kepler")
    start = change.to_new(kepler.y0, near=[0, 1, 0.5, 0])
    assert start == pytest.approx([0, 0.8, 0.4, 0], abs=1e-14)
    t = [0.5, 1, 2]
    new = bs.reference_solution(change.hamiltonian(kepler), t, y0=["0", "4/5", "2/5", "0"])
    old = bs.reference_solution(kepler, t)
    assert np.abs(change.to_old(new) - old).max() < 1e-13
    assert np.abs(change.to_new(old, near=new + 0.01) - new).max() < 1e-13


def test_the_hamiltonian_on_a_sphere():
    free = bs.Scene(THREE, hamiltonian="(p1^2 + p2^2 + p3^2)/2 + q3/sqrt(q1^2 + q2^2 + q3^2)")
    found = CHANGES["spherical"]().hamiltonian(free).hamiltonian
    expected = bs.Scene(SPHERICAL, hamiltonian="(p_r^2 + p_u^2/r^2 + p_v^2/(r*sin(u))^2)/2 + cos(u)").hamiltonian
    assert sympy.simplify(found - expected) == 0


# Other kinds.


def test_a_generating_function_is_solved_for():
    """S(P, q) = P q + q²/2 kicks: p = P + q, Q = q."""
    change = generating_transformation(ONE, NEW, "P*q + q^2/2")
    assert {name: str(formula) for name, formula in change.formulas.items()} == {"p": "P + Q", "q": "Q"}


def test_a_generating_function_makes_a_point_transformation():
    """Exercise 3 with its hint S(P, q) = P χ(q), χ = exp: Q = e^q, p = P e^q."""
    change = generating_transformation(ONE, NEW, "P*exp(q)", positions={"q": "log(Q)"}, positive=["Q"])
    assert change == point_transformation(ONE, NEW, {"q": "log(Q)"}, positive=["Q"])
    toda = change.hamiltonian(bs.parse_hamiltonian("p^2/2 + exp(q)"))
    assert str(toda.hamiltonian) == "P**2*Q**2/2 + Q"


def test_symplectic_euler_is_a_canonical_transformation():
    """(20) with S = h H for H = p²/2 + q²/2: its step keeps the form p² + q² − h p q."""
    step = generating_transformation(ONE, NEW, "P*q + h*(P^2 + q^2)/2", parameters=["h"])
    P, Q, h, p, q = sympy.symbols("P Q h p q")
    modified = p**2 + q**2 - h * p * q
    assert sympy.expand(step.composed(modified) - (P**2 + Q**2 - h * P * Q)) == 0
    half = step.with_parameters(h="1/2")
    assert half.parameters == ()
    assert half.to_old([0.3, 0.7]) == pytest.approx(
        [float(step.formulas[k].subs({P: 0.3, Q: 0.7, h: 0.5})) for k in "pq"]
    )


def test_action_angle_variables_of_oscillators():
    change = harmonic_action_angle(TWO, {"a": 2, "theta": 2}, ["w", 3], parameters=["w"])
    oscillators = bs.Scene(
        TWO, hamiltonian="(p1^2 + p2^2 + w^2*q1^2 + 9*q2^2)/2 + eps*q1^2", parameters={"w": "w", "eps": "1/10"}
    )
    found = change.hamiltonian(oscillators)
    assert str(sympy.expand(found.hamiltonian)) == "a1*w + a1*sin(theta1)**2/(5*w) + 3*a2"
    assert set(found.parameters) == {"w"}
    number = change.hamiltonian(oscillators.with_parameters(w=2))
    assert sympy.simplify(number.hamiltonian - found.hamiltonian.subs("w", 2)) == 0


def test_changes_are_values():
    change = CHANGES["polar"]()
    assert change == CHANGES["polar"]() != CHANGES["kick"]()
    assert pickle.loads(pickle.dumps(change)) == change
    assert len({change, CHANGES["polar"]()}) == 1
    assert repr(change) == "<CoordinateChange from p_r, p_phi, r, phi to p1, p2, q1, q2>"
    assert str(CHANGES["quarter turn"]()) == "p = -Q\nq = P"


ANGLES = {"p": "sqrt(2*a)*cos(theta)", "q": "sqrt(2*a)*sin(theta)"}


def test_a_new_variable_may_bear_the_name_of_a_parameter():
    """a = 3 in the old Hamiltonian is not the action a."""
    change = canonical_transformation(ONE, {"a": 1, "theta": 1}, ANGLES)
    old = bs.Scene(ONE, hamiltonian="p^2/2 + a*q^2/2", invariants={"energy": "p^2/2 + a*q^2/2"}, parameters={"a": "3"})
    new = change.hamiltonian(old)
    expected = bs.Scene({"a": 1, "theta": 1}, hamiltonian="a*cos(theta)^2 + 3*a*sin(theta)^2").hamiltonian
    for formula in (new.hamiltonian, new.invariants["energy"]):
        assert sympy.simplify(formula - expected) == 0
    z = [0.3, 0.7]
    p, q = change.to_old(z)
    assert float(new.hamiltonian.subs({"a": z[0], "theta": z[1]})) == pytest.approx(p**2 / 2 + 3 * q**2 / 2)
    with pytest.raises(bs.SeriesError, match="new must have names of its own, but a is also a symbol in "):
        change.hamiltonian(old.with_parameters(a="a"))


# Refusals.


@pytest.mark.parametrize(
    ("formulas", "message"),
    [
        ({"p1": "2*P1", "p2": "P2", "q1": "Q1", "q2": "Q2"}, r"with \{q1, p1\} = 1, but this bracket was 2"),
        ({"p1": "P1", "p2": "P2", "q1": "Q1", "q2": "Q2 + P1"}, r"with \{q1, q2\} = 0, but this bracket was 1"),
        ({"p1": "P1", "p2": "P2 + Q1", "q1": "Q1", "q2": "Q2"}, r"with \{p1, p2\} = 0, but this bracket was -1"),
        ({"p1": "P1*cos(Q1)", "p2": "P2", "q1": "Q1", "q2": "Q2"}, r"with \{q1, p1\} = 1, .* was cos\(Q1\)"),
    ],
)
def test_changes_that_are_not_symplectic(formulas, message):
    assert not CoordinateChange(TWO, NEW_TWO, formulas).is_symplectic
    with pytest.raises(bs.SeriesError, match=f"formulas must be symplectic, {message}"):
        canonical_transformation(TWO, NEW_TWO, formulas)
    with pytest.raises(bs.SeriesError, match="formulas must be symplectic"):
        CoordinateChange(TWO, NEW_TWO, formulas).hamiltonian(bs.scene("kepler"))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: canonical_transformation(ONE, NEW, {"p": "P"}), "formulas must have a formula for each of p, q"),
        (lambda: canonical_transformation(ONE, NEW, ["P", "Q"]), "formulas must have a formula for each of p, q"),
        (lambda: canonical_transformation(ONE, NEW_TWO, {}), "new must have 2 variables, as old has, but had 4"),
        (lambda: canonical_transformation(ONE, {"P": 1, "Q": 2}, {}), "new must be momenta and as many positions"),
        (lambda: canonical_transformation(bs.scene("lorenz"), NEW, {}), "old must be momenta and as many positions"),
        (lambda: canonical_transformation(bs.scene("lotka-volterra"), NEW, {}), "old must be canonical"),
        (lambda: canonical_transformation(ONE, NEW, {"p": "P", "q": "Q*x"}), "formulas.q must be a formula in P, Q"),
        (
            lambda: canonical_transformation(ONE, NEW, {"p": "P", "q": "Q"}, positive=["r"]),
            "positive must be new variables, but 'r' is none",
        ),
        (
            lambda: canonical_transformation(ONE, NEW, {"p": "P", "q": "Q"}, parameters=["P"]),
            "parameters must have names of their own, but P is a variable",
        ),
        (
            lambda: canonical_transformation(ONE, NEW, {"p": "P", "q": "Q"}, parameters=["q"]),
            "parameters must have names of their own, but q is a variable",
        ),
        (lambda: point_transformation(TWO, POLAR, {"q1": "r", "q2": "r"}), "positions must determine new coordinates"),
        (lambda: point_transformation(TWO, NEW, {"q1": "Q", "q2": "Q"}), "new must have 2 positions, as old has"),
        (lambda: generating_transformation(ONE, ONE, "q^2"), "new must have other names than old, but both have p"),
        (lambda: generating_transformation(ONE, NEW, "q^2"), "S must determine new coordinates"),
        (lambda: generating_transformation(ONE, NEW, "P*exp(q)"), "positions must be given where S is not quadratic"),
        (
            lambda: generating_transformation(ONE, NEW, "P*exp(q)", positions={"q": "Q"}),
            r"positions must solve Q = exp\(q\), but leave ",
        ),
        (lambda: harmonic_action_angle(ONE, NEW, [0]), "frequencies must be positive, but one was 0"),
        (lambda: harmonic_action_angle(ONE, NEW, [1, 2]), "frequencies must be 1, one for each pair"),
        (lambda: CHANGES["polar"]().with_parameters(h=1), "parameters must be among none, but had h"),
        (lambda: CHANGES["polar"]().hamiltonian(bs.scene("pendulum")), "scene must be one in p1, p2, q1, q2, but was"),
        (
            lambda: CHANGES["polar"]().hamiltonian(bs.scene("kepler", effects=["drag"])),
            "scene must have a Hamiltonian, but kepler has none",
        ),
        (lambda: CHANGES["polar"]().to_old([1, 2]), r"y must have the shape \(4,\)"),
        (lambda: CHANGES["polar"]().to_new([1, 2, 0.1, 0.1], [0, 0, 0, 0]), "near must be closer to the solution"),
        (
            lambda: CHANGES["polar"]().to_new([0.1, 0.1, 1, 0.1], [0, 0, -1, 3.1]),
            "near must be closer to the solution, but from there r was not positive",
        ),
        (lambda: CHANGES["polar"]().to_new(np.ones((4, 3)), np.ones((4, 2))), "near must be one point or 3, but was 2"),
        (
            lambda: generating_transformation(ONE, NEW, "P*q*c", parameters=["c"]).to_old([1, 2]),
            "parameters must be numbers, but c is a symbol: see with_parameters",
        ),
    ],
)
def test_arguments_that_do_not_fit(call, message):
    with pytest.raises(bs.errors, match=message):
        call()
