"""What the engine computes for the exercises, by second routes: runs, direct formulas, other functions."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
import sympy

import bseries as bs
from bseries.course import questions
from bseries.course.questions import QUESTIONS
from integrators import adjoint_method

TRUTHS = {question.key: question.truth for question in QUESTIONS}


def test_the_recursion_of_the_lecture_gives_the_equations_of_exercise_1():
    """The Maple script of example 1, for steps as series in h: y1 solves an equation, term by term."""
    y, h = sympy.symbols("y h")

    def step(increment):
        """The series of y1 = y + h increment(y, y1), by iteration."""
        end = y
        for _ in range(7):
            end = sympy.series(sympy.expand(y + h * increment(y, end)), h, 0, 7).removeO()
        return end

    methods = {
        "1a": lambda a, b: b**2,
        "1b": lambda a, b: ((a + b) / 2) ** 2,
        "1c": lambda a, b: (a**2 + b**2) / 2,
    }
    for key, increment in methods.items():
        field, end = [y**2], sympy.expand(step(increment))
        for n in range(2, 6):
            f = sum(h**j * g for j, g in enumerate(field))
            derivatives = [y]
            for _ in range(n):
                derivatives.append(sympy.expand(derivatives[-1].diff(y) * f))
            flow = sum(h**k * g / math.factorial(k) for k, g in enumerate(derivatives))
            field.append(sympy.expand(end - flow).coeff(h, n))
        if key == "1a":
            assert [g / y ** (k + 3) for k, g in enumerate(field[1:])] == list(TRUTHS[key]())
        else:
            assert sympy.expand(sum(h**j * g for j, g in enumerate(field)) - TRUTHS[key]()[0]) == 0


def test_divergences_of_exercise_6():
    """div f_2 = −½ tr f'², div f_3 = tr f'³/12."""
    x, y, z = sympy.symbols("x y z")
    abc = bs.scene("abc-flow")
    jacobian = sympy.Matrix(bs.modified_field("explicit-euler", abc, 1).symbolic(0)).jacobian([x, y, z])
    assert sympy.expand(TRUTHS["6a"]()[0] + (jacobian**2).trace() / 2) == 0
    assert sympy.expand(TRUTHS["6b"]()[0] - (jacobian**3).trace() / 12) == 0
    assert sympy.expand(TRUTHS["6b"]()[0]) != 0


def test_energy_of_oscillators_in_exercise_13():
    """The factor of RK4 by steps on the oscillator; the energy of the explicit Euler method by a run."""
    scene = bs.parse_hamiltonian("(p^2 + q^2)/2", start="p=0; q=1")
    step = bs.integrate("rk4", scene, h=0.5, steps=1).y[:, -1]
    factor = float(TRUTHS["13a"]()[0].subs(sympy.Symbol("h"), Fraction(1, 2)))
    assert step @ step == pytest.approx(factor, rel=1e-14)
    run = bs.integrate("explicit-euler", scene, h=0.01, steps=1000).y[:, -1]
    assert run @ run == pytest.approx(float(TRUTHS["13c"]()[0]), rel=1e-12)
    h, steps = 0.1, float(TRUTHS["13b"]()[0])
    assert steps == pytest.approx(math.log(2) / (h**6 / 72 - h**8 / 576), rel=1e-7)
    assert float(f"{steps:.3g}") == 5.00e7


def test_the_energy_error_of_exercise_14_is_that_of_a_run():
    largest = float(TRUTHS["14d"]()[0])
    for h in (2e-3, 1e-3):
        run = bs.integrate("symplectic-euler-p", "pendulum", h=h, steps=20_000, y0=[2.5, 0])
        energy = run.y[0] ** 2 / 2 - np.cos(run.y[1])
        assert np.abs(energy - energy[0]).max() / h == pytest.approx(largest, abs=h)


def test_the_splitting_of_exercise_15_is_chin_s():
    gamma, _ = TRUTHS["15b"]()
    (kappa,) = TRUTHS["15c"]()
    chin = bs.method("chin4a")
    assert bs.order_of(chin) == 4
    assert (gamma, kappa) == (Fraction(1, 6), Fraction(1, 48))
    kicks = [("p", gamma), ("q", Fraction(1, 2)), ("p", 1 - 2 * gamma), ("q", Fraction(1, 2)), ("p", gamma)]
    assert bs.order_of(bs.Splitting(kicks)) == 2
    energy = bs.modified_hamiltonian(bs.Splitting(kicks), "pendulum", 3).symbolic(2)
    assert sympy.simplify(energy - sympy.sin(sympy.Symbol("q")) ** 2 / 72) == 0


def test_the_gain_of_exercise_16_is_that_of_a_run():
    """The energy after many turns; what oscillates stays below one thousandth of the whole."""
    h, (gain,) = 0.2, TRUTHS["16b"]()
    scene = bs.scene("pendulum", effects=["asymmetry"])
    run = bs.integrate("simplified-takahashi-imada", scene, h=h, steps=400_000, y0=[2.5, 0])
    energy = run.y[0] ** 2 / 2 - np.cos(run.y[1]) + np.sin(2 * run.y[1]) / 5
    means = energy[1:].reshape(-1, 4000).mean(axis=1)
    turns = abs(run.y[1, -1] - run.y[1, 0]) / (2 * np.pi)
    slope = np.polyfit(np.linspace(0, turns, len(means)), means, 1)[0]
    assert slope / h**4 == pytest.approx(float(gain), rel=0.1)


def test_adjoints_of_exercise_11():
    """Φ* after a step back is the identity, and the composition is symmetric."""
    ralston = bs.method("ralston2")
    assert bs.symmetry(questions.symmetrized_ralston(), 6).breaks is None
    assert bs.symmetry(ralston, 6).breaks is not None
    back = bs.series(adjoint_method(ralston), 5).inverse()
    signs = {tree: (-1) ** tree.order for tree in back}
    assert all(back[tree] == signs[tree] * value for tree, value in bs.series(ralston, 5).items())
