"""Statements of slides and solutions that are no formulas, by computations of their own."""

from __future__ import annotations

import re
from fractions import Fraction
from math import comb
from pathlib import Path

import numpy as np
import sympy

import bseries as bs
from bseries.course import documents
from bseries.course.computed import computed

FOLDER = Path(documents.__file__).parent
SLIDES, EXERCISES = (
    " ".join((FOLDER / name).read_text(encoding="utf-8").split()) for name in ("slides.md", "exercises.md")
)
p, q = sympy.symbols("p q")


def iterative_logarithm(terms: int) -> list[Fraction]:
    """The coefficients c_k of h^k y^(k+2) in (5), by g(z + z²) = (1 + 2z) g(z): the flow takes its own field along."""
    c = [Fraction(0), Fraction(0), Fraction(1)]
    for n in range(3, terms + 2):
        c.append(sum((c[k] * comb(k, n + 1 - k) for k in range(2, n)), Fraction(0)) / (2 - n))
    return c[2:]


def test_where_the_signs_of_example_1_cease_to_alternate():
    c = iterative_logarithm(200)
    assert list(map(str, c[:6])) == ["1", "-1", "3/2", "-8/3", "31/6", "-157/15"]
    first = next(k for k, value in enumerate(c) if (value > 0) != (k % 2 == 0))
    assert f"the signs of these terms alternate; from $h^{{{first}}}$ on they do not" in SLIDES
    # the largest of ten successive coefficients grows like k!/(2π)^k, that is, by (k/2π)^10 in ten steps
    largest = [float(max(map(abs, c[k : k + 10]))) for k in range(100, 190, 10)]
    rates = np.diff(np.log(largest)) / 10
    assert np.allclose(rates, np.log((np.arange(110, 190, 10)) / (2 * np.pi)), atol=0.3)


def test_no_integral_of_the_modified_equation_of_explicit_euler():
    """I₂ would decrease along closed orbits: its derivative along them is −∇I·f₂."""
    scene = bs.scene("lotka-volterra")
    integral = p - sympy.log(p) + q - 2 * sympy.log(q)
    f2 = bs.modified_field("explicit-euler", scene, 2).symbolic(1)
    rate = -sum(integral.diff(y) * f for y, f in zip((p, q), f2, strict=True))
    assert sympy.expand(rate + (p - 1) ** 2 + (q - 2) ** 2 / 2) == 0
    assert r"\dot I_2 = -\nabla I\cdot f_2" in EXERCISES
    # for the symplectic method the mean over an orbit is zero, as it must be
    f2 = bs.modified_field("symplectic-euler-p", scene, 2).symbolic(1)
    rate = -sum(integral.diff(y) * f for y, f in zip((p, q), f2, strict=True))
    run = bs.integrate("gauss4", scene, h=4.614871 / 400, steps=400, y0=[2, 2])
    values = sympy.lambdify((p, q), rate)(*run.y[:, :-1])
    assert abs(values.mean()) < 1e-5 < abs(values).max()


def test_the_mean_of_18_vanishes_by_a_symmetry_that_keeps_all_integrals():
    """(p, q) ↦ (−Sp, Sq), S the reflection with SP = −P, for three atoms in the plane."""
    random = np.random.default_rng(1)
    momenta, places = random.normal(size=(3, 2)), 2 * random.normal(size=(3, 2))
    atoms = sympy.symbols("x1 y1 x2 y2 x3 y3")
    pairs = [(0, 2), (0, 4), (2, 4)]
    r2 = [(atoms[i] - atoms[j]) ** 2 + (atoms[i + 1] - atoms[j + 1]) ** 2 for i, j in pairs]
    U = sympy.Add(*(x**-2 - x**-1 for x in r2))
    velocity, gradient = sympy.symbols("v1:7"), sympy.symbols("g1:7")

    def along(f: sympy.Expr, v: tuple[sympy.Symbol, ...]) -> sympy.Expr:
        return sympy.Add(*(f.diff(x) * y for x, y in zip(atoms, v, strict=True)))

    rate = sympy.lambdify((*velocity, *gradient, *atoms), along(along(along(U, velocity), gradient), gradient))
    slope, energy = (sympy.lambdify(atoms, f) for f in ([U.diff(x) for x in atoms], U))

    def integrals(p: np.ndarray, q: np.ndarray):
        spin = (q[:, 0] * p[:, 1] - q[:, 1] * p[:, 0]).sum()
        return [*p.sum(axis=0), spin, (p**2).sum() / 2 + energy(*q.flat)]

    def F(p: np.ndarray, q: np.ndarray):
        return rate(*p.flat, *slope(*q.flat), *q.flat)

    n = momenta.sum(axis=0) / np.linalg.norm(momenta.sum(axis=0))
    S = np.eye(2) - 2 * np.outer(n, n)
    there = -momenta @ S, places @ S
    assert np.allclose(integrals(*there), integrals(momenta, places))
    assert abs(F(momenta, places)) > 1e-3
    assert np.isclose(F(*there), -F(momenta, places))
    # p ↦ −p alone, which the lecture has in mind, takes the states to others
    assert np.isclose(F(-momenta, places), -F(momenta, places))
    assert not np.allclose(integrals(-momenta, places), integrals(momenta, places))
    assert "ergodic on the states of equal $E$, $P$ and $L$" in SLIDES


def growth(values, t):
    """The power of t that values follow, from t = 20 on."""
    late = t > 20
    return np.polyfit(np.log(t[late]), np.log(values[late]), 1)[0]


def errors(method, scene, omega, h):
    """Times, changes of the energy, and errors of the solution from (0, 1), which turns with the frequency ω."""
    run = bs.integrate(method, scene, h=h, steps=round(200 / h), y0=[0, 1], save_every=10, observe="energy")
    exact = np.array([-np.sin(omega * run.t), np.cos(omega * run.t)])
    energy = run.observed["energy"]
    return run.t, abs(energy - energy[0]), np.linalg.norm(run.y - exact, axis=0)


def test_errors_grow_like_t_squared_only_if_frequencies_depend_on_actions():
    """Kutta's method of order 3 loses energy on both oscillators."""
    anharmonic = bs.parse_hamiltonian("(p^2 + q^2)/2 + (p^2 + q^2)^2/8")
    for scene, omega, power in ((bs.scene("harmonic-oscillator"), 1, 1), (anharmonic, 1.5, 2)):
        t, energy, solution = errors("kutta3", scene, omega, 0.02)
        assert abs(growth(energy, t) - 1) < 0.05
        assert abs(growth(solution, t) - power) < 0.05
    # symmetric and not symplectic, on a reversible system
    t, energy, solution = errors("lobatto-iiia3", anharmonic, 1.5, 0.1)
    assert abs(growth(solution, t) - 1) < 0.05
    assert energy.max() < 1e-11
    assert "Where the frequencies depend on the actions, the global error then grows like $t^2$" in SLIDES


def test_the_condition_of_symplecticity_is_not_necessary_for_reducible_tableaus():
    """The midpoint rule with its stage written twice."""
    doubled = bs.RungeKutta([["1/2", 0], ["1/2", 0]], ["1/2", "1/2"])
    assert 2 * doubled.b[0] * doubled.A[0][0] != doubled.b[0] ** 2
    assert bs.symplecticity(doubled, 6).holds
    assert "For *irreducible* methods" in EXERCISES


def test_24_is_about_the_generating_function_of_the_flow():
    """S_j are the terms of a method's function; those of a flow are others, and the requirement compares both."""
    text = computed("exact-generating-function")
    assert text.count(r"\widetilde S_") == 3
    assert not re.search(r"(?<!widetilde )S_\d|(?<!widetilde{)H", text)
