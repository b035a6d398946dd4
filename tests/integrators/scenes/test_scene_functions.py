"""Right-hand sides and Hamiltonians written in Python as scenes."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.special import erf

import bseries as bs
from integrators.scenes.functions import scene_from_function


def lorenz(t, y, sigma=10, rho=28, beta=8 / 3):
    x, v, z = y
    return [sigma * (v - x), x * (rho - z) - v, x * v - Fraction(8, 3) * z]


def in_place(t, y):
    rate = np.zeros_like(y)
    rate[0], rate[1] = y[1], -np.sin(y[0])
    return rate


def bodies(p, q, masses=None):
    """Three bodies in a plane."""
    m = [1, 2, 3]
    p, q = p.reshape(3, 2), q.reshape(3, 2)
    energy = sum(p[i] @ p[i] / (2 * m[i]) for i in range(3))
    for i in range(3):
        for j in range(i):
            energy = energy - m[i] * m[j] / np.linalg.norm(q[i] - q[j])
    return energy


@pytest.mark.parametrize("function", [lorenz, in_place, lambda y: np.exp(-y) * np.sqrt(1 + y**2) / 2.5])
def test_formulas_have_the_values_of_the_function(function):
    dimension = 3 if function is lorenz else 2
    scene = scene_from_function(function, [0.1] * dimension)
    rate = bs.integrators.right_hand_side(scene)
    random = np.random.default_rng(1)
    for _ in range(5):
        y = random.uniform(0.2, 2, dimension)
        expected = function(y) if function.__name__ == "<lambda>" else function(0.0, y)
        np.testing.assert_allclose(rate(0.0, y), expected, rtol=1e-14)


def test_hamiltonians_of_particles():
    start = [0.1, 0, -0.1, 0.2, 0, 0, 0, 0, 1, 0, 0, 1]
    scene = scene_from_function(bodies, start, hamiltonian=True)
    assert (scene.name, [block.name for block in scene.blocks], scene.dimension) == ("bodies", ["p", "q"], 12)
    run = bs.integrate("stormer-verlet", scene, h=0.001, steps=200, observe="energy")
    p, q = run.y[:6, -1], run.y[6:, -1]
    assert run.observed["energy"][-1] == pytest.approx(bodies(p, q), rel=1e-12)
    assert bs.symplecticity("stormer-verlet", 4).order == 4


def test_scenes_are_those_of_text():
    def pendulum(p, q):
        return p[0] ** 2 / 2 - np.cos(q[0])

    traced = scene_from_function(pendulum, [0, "-3/2"], hamiltonian=True)
    assert traced == bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)", start={"p": [0], "q": ["-3/2"]})
    H, known = (bs.modified_hamiltonian("stormer-verlet", scene, 5).symbolic(4) for scene in (traced, "pendulum"))
    assert known == H


def branches(t, y):
    force = np.where((y > 1) & ~(y[::-1] >= 3) | (y < -1), np.abs(y) ** 3, -np.sign(y))
    top = max(1, 2) * np.minimum(y[0], 1.5) + np.maximum(y, 0.5).sum() + abs(y[1])
    return force * erf(y) + top * np.heaviside(y[0], 0.25) + np.where(y[0] > y[1], y[0], 2 * y[1]) + np.max(y)


def test_branches_are_formulas():
    scene = scene_from_function(branches, [1, 2])
    rate = bs.integrators.right_hand_side(scene)
    random = np.random.default_rng(1)
    for y in [*random.normal(0, 2, (200, 2)), *random.integers(-3, 4, (50, 2)).astype(float)]:
        np.testing.assert_allclose(rate(0.0, y), branches(0.0, y), rtol=1e-14, atol=1e-14)


def test_arrays_are_changed_in_place():
    def function(y):
        rate = np.zeros_like(y)
        rate += y**2
        rate[0] -= np.float64(2) * y[1]
        return rate / np.sqrt(np.linalg.norm(y)) + np.dot(y, y)

    scene = scene_from_function(function, [1, 2])
    np.testing.assert_allclose(bs.integrators.right_hand_side(scene)(0.0, [1.0, 2.0]), function(np.array([1.0, 2.0])))


def test_time_parameters_and_exact_numbers():
    def driven(t, y, a=0.1, omega=2):
        return [y[1], -y[0] + a * np.cos(omega * t)]

    scene = scene_from_function(driven, [1, 0])
    assert scene.variables == ("y1", "y2", "t")
    assert dict(scene.parameters) == {"a": Fraction(1, 10), "omega": 2}
    assert scene.with_parameters(a=0).field[1] == -scene.symbols[0]
    assert scene_from_function(lambda y: [0.1 * y[0]], ["1/3"]).start == (Fraction(1, 3),)
    blocks = scene_from_function(lambda y: [y[1], -y[0]], [1, 2], variables={"x": 1, "v": 1}, name="spring")
    assert (blocks.name, blocks.variables) == ("spring", ("x", "v"))


REFUSED = {
    "branches": (lambda t, y: [y[0] if y[0] > 0 else 0], [1], "it looks at their values"),
    "max": (
        lambda y: [max(y[0], 1)],
        [1],
        r"looks at their values; for a choice use np\.where, np\.minimum or np\.max",
    ),
    "equal": (lambda y: [np.where(y == 1, y, 2)], [1], "it looks at their values"),
    "frexp": (lambda y: np.frexp(y[0])[0], [1], "must run on symbols, but failed"),
    "math": (lambda y: [math.sin(y[0])], [1], "must run on symbols, but failed: .*use NumPy's functions"),
    "arctan2": (lambda y: [np.arctan2(y[0], 1)], [1], "must run on symbols, but failed: .*arctan2"),
    "a float array": (lambda y: np.array([y[0]], dtype=float), [1], "use NumPy's functions, and np.zeros_like"),
    "too few": (lambda y: [y[0]], [1, 2], "must return 2 derivatives, one for each variable, but returned"),
    "nothing": (lambda y: None, [1], "must return 1 derivatives, one for each variable, but returned None"),
    "text": (lambda y: ["y"], [1], "derivative of y must be a formula or a number, but was 'y'"),
    "not finite": (lambda y: [y[0] * math.inf], [1], "numbers in function must be finite, but one was inf"),
    "arguments": (lambda a, b, c: [a], [1], "must take y, or t and y, but took 3 arguments"),
    "no function": (3, [1], r"function must be a function such as f\(t, y\), but was 3"),
    "a start": (lambda y: y, 1, "y0 must be a sequence, but was 1"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_formula_is_refused(case):
    function, start, message = REFUSED[case]
    with pytest.raises(bs.IntegratorError, match=message):
        scene_from_function(function, start, compiled=False)


def test_an_odd_number_of_momenta_and_positions_is_refused():
    with pytest.raises(bs.IntegratorError, match="y0 must hold as many momenta as positions, but held 3 numbers"):
        scene_from_function(lambda p, q: p[0], [1, 2, 3], hamiltonian=True)
    with pytest.raises(bs.IntegratorError, match="y0 must hold 2 numbers, one for each variable, but held 1"):
        scene_from_function(lambda y: y, [1], variables={"y": 2})
