"""Sums over pairs of few sites: every pair has a lane, and forces are those that the scene's own field gives."""

import itertools

import numpy as np
import pytest

import integrators as bi
from integrators.compile.scene_source import Ring, compiled_scene

pytestmark = pytest.mark.minimum

FORCES = {
    "gravity": "-m_i*m_j^2/sqrt((qx_i - qx_j)^2 + (qy_i - qy_j)^2)",  # what counts is who is the first of a pair
    "spring": "m_i*(qx_i - qx_j)^2/2 + s*(qx_i - qx_j)^4",
}


def slow(n):
    """Few sites, odd and even, and the largest ring have what others have; the ring itself is checked for all."""
    return pytest.param(n, marks=pytest.mark.slow)


def particles(n, formula):
    """n particles in the plane, their masses all different."""
    return bi.Scene(
        {"p": [n, 2], "q": [n, 2]},
        terms=[
            bi.Term(over="each", hamiltonian="(px_i^2 + py_i^2)/(2*m_i)"),
            bi.Term(over="pairs", hamiltonian=formula),
        ],
        parameters={"m": [f"{k}/3" for k in range(2, n + 2)], "s": "1/7"},
        start={name: [[f"{(k * k + s * k) % 13 + k}/7" for s in range(2)] for k in range(n)] for name in "pq"},
    )


@pytest.mark.parametrize("n", range(2, 18))
def test_every_pair_of_sites_has_a_lane(n):
    ring, pairs = Ring.of(n), n * (n - 1) // 2
    assert sorted(ring.rows[:pairs]) == [*itertools.combinations(range(n), 2)]
    assert set(ring.rows[pairs:]) <= {ring.rows[pairs - 1]}
    assert len(ring.rows) % 4 == 0
    for distance, lanes in enumerate(ring.lanes, 1):
        assert [set(ring.rows[lane]) for lane in lanes] == [{site, (site + distance) % n} for site in range(n)]


@pytest.mark.few(5)
@pytest.mark.parametrize("formula", FORCES.values(), ids=FORCES)
@pytest.mark.parametrize("n", [3, 4, 5, *map(slow, (6, 7, 8, 9, 12, 15)), 16, 17])
def test_forces_are_those_of_the_scene(n, formula):
    scene = particles(n, formula)
    stepper = bi.stepper("explicit-euler", scene)
    assert ("[r]]" in stepper.source) is (n < 17)  # more have lanes site by site
    state, slope = stepper.start(h=1.0), np.empty(scene.dimension)
    before = state.y.copy()
    compiled_scene(scene).field(before, slope)
    stepper.advance(state, 1)
    np.testing.assert_allclose(state.y - before, slope, rtol=1e-12, atol=1e-13 * abs(slope).max())


def test_what_both_sites_are_given_may_be_equal_or_differ():
    """Without differences: signs are equal, or there are two formulas, which lanes in another order add up."""
    for formula in ("qx_i*qx_j*qy_i*qy_j", "m_i*qx_i^2*qx_j"):
        scene = particles(6, formula)
        stepper = bi.stepper("explicit-euler", scene)
        state, slope = stepper.start(h=1.0), np.empty(scene.dimension)
        before = state.y.copy()
        compiled_scene(scene).field(before, slope)
        stepper.advance(state, 1)
        np.testing.assert_allclose(state.y - before, slope, rtol=1e-12, atol=1e-13 * abs(slope).max())


@pytest.mark.few(3)
@pytest.mark.parametrize("formula", FORCES.values(), ids=FORCES)
@pytest.mark.parametrize("n", [4, 5, *map(slow, (9, 16)), 17])
def test_energies_are_those_of_the_scene(n, formula):
    scene = particles(n, formula)
    run = bi.integrate("explicit-euler", scene, h=1e-3, steps=3, observe="energy", save_every=1)
    expected = [compiled_scene(scene).energy(y) for y in run.y.T]
    np.testing.assert_allclose(run.observed["energy"], expected, rtol=1e-14)
