"""Whether energies drift: symplectic and reversible methods, those that only seem to be, and what is predicted then."""

from __future__ import annotations

from fractions import Fraction

import pytest

import bseries as bs
from bseries.advice.measures import energy_size, relative_change, relative_distance

FACTOR = 3.0


def iterated_midpoint(times):
    """The implicit midpoint rule solved by so many iterations: symplectic up to about as many powers of h."""
    a = [[0] * (times + 1) for _ in range(times + 1)]
    for i in range(times):
        a[i + 1][i] = Fraction(1, 2)
    return bs.RungeKutta(a, [0] * times + [1], name=f"midpoint iterated {times} times")


def turning(asymmetry):
    """A pendulum that turns round and round, with cos q and a part of sin 2q for its potential."""
    return bs.Scene(
        {"p": 1, "q": 1}, hamiltonian=f"p^2/2 - cos(q) + {asymmetry}*sin(2*q)", start={"p": ["5/2"], "q": [0]}
    )


def orbit(scene, h=0.05, steps=4000):
    return bs.integrate("gauss4", scene, h=h, steps=steps).y


@pytest.mark.slow
def test_errors_are_those_of_the_part_that_is_followed():
    """p ↦ −p turns it the other way round: energy drifts, though method and scene are reversible by that.

    A drift that shows only later is not predicted, and nothing is said of the time after the part that is followed.
    """
    scene, method, steps = turning("1/2"), "simplified-takahashi-imada", 10**5
    prediction = bs.predict_run(method, scene, h=0.2, steps=steps, timed=False)
    run = bs.integrate(method, scene, h=0.2, steps=steps, save_every=None, observe="energy", observe_every=1)
    size, followed = energy_size(scene, scene.y0), round(prediction.covered * steps)
    real, early = (relative_change(run.observed["energy"][:n], size) for n in (steps, followed))
    assert real > 1.2 * early  # control: it does drift
    assert "over the first" in str(prediction)
    assert prediction.energy.value is not None, prediction.energy.reason
    assert 1 / FACTOR < prediction.energy.value / early < FACTOR


@pytest.mark.parametrize(("scene", "h", "steps"), [("pendulum", 0.05, 10**6), ("kepler", 0.01, 10**6)])
def test_errors_of_symmetric_methods(scene, h, steps):
    made = bs.scene(scene)
    prediction = bs.predict_run("lobatto-iiia3", made, h=h, steps=steps, timed=False)
    found, steps = prediction.solution, round(prediction.covered * steps)
    every = steps // 500
    runs = [bs.integrate(name, made, h=h, steps=steps, save_every=every).y for name in ("lobatto-iiia3", "gauss4")]
    assert found.value is not None, found.reason
    assert 1 / FACTOR < found.value / relative_distance(*runs) < FACTOR


@pytest.mark.parametrize(("times", "h", "steps"), [(5, 0.2, 10**5), (4, 0.1, 10**5)])
def test_methods_that_are_symplectic_in_the_first_terms_only(times, h, steps):
    pendulum, method = bs.scene("pendulum"), iterated_midpoint(times)
    symplectic_to = bs.symplecticity(method, 8).order
    prediction = bs.predict_run(method, pendulum, h=h, steps=steps, timed=False)
    assert symplectic_to in prediction.powers  # the power of the first term that is not Hamiltonian
    found = prediction.energy
    run = bs.integrate(method, pendulum, h=h, steps=steps, save_every=None, observe="energy", observe_every=1)
    energy, size = run.observed["energy"], energy_size(pendulum, pendulum.y0)
    real = relative_change(energy[: round(prediction.covered * steps)], size)
    assert found.value is not None, found.reason
    assert 1 / FACTOR < found.value / real < FACTOR


@pytest.mark.parametrize("steps", [10**5, 10**7, 10**9])
def test_what_rounding_does_to_a_conserved_energy_is_no_drift(steps):
    """The averaged vector field method conserves energy, whatever the span."""
    found = bs.predict_run("avf", bs.scene("pendulum"), h=0.1, steps=steps, timed=False)
    assert found.energy.reason == "rounding will be larger"
    assert found.energy.value is not None
    assert found.energy.value < 1e-18


@pytest.mark.parametrize(("method", "h", "known"), [("stormer-verlet", 0.02, False), ("yoshida6", 0.002, True)])
def test_energies_that_change_to_second_order_only(method, h, known):
    """On a circle ∇H · r is 0, by symmetry and not because energy is conserved."""
    circle = bs.scene("kepler").with_start(p=[0, 1], q=[1, 0])
    found = bs.predict_run(method, circle, h=h, steps=1000, timed=False).energy
    energy = bs.integrate(method, circle, h=h, steps=1000, observe="energy").observed["energy"]
    real = relative_change(energy, energy_size(circle, circle.y0))
    if known:
        assert real < 1e-13
        assert found.reason == "rounding will be larger"
    else:
        assert real > 1e-8  # control
        assert found.value is not None, found.reason
        assert 1 / FACTOR < found.value / real < FACTOR
