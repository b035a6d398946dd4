"""Flows of a page against exact solutions, and failures that end a curve."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

import bseries as bs
from bseries.explorer.flows import CIRCLE, MOST_STEPS, ORBITS, PATCHES, SAMPLES, SceneFlows, enclosed_area


def flows(method: str, scene: str | bs.Scene, **options: float) -> SceneFlows:
    return SceneFlows(bs.method(method), bs.scene(scene) if isinstance(scene, str) else scene, **options)


SLOW = pytest.mark.slow  # lorenz has three variables too, and kepler four
OSCILLATOR = bs.parse_hamiltonian("p^2/2 + q^2/2", start="p=0; q=1")


def test_the_numerical_solution_is_that_of_integrate():
    found = flows("rk4", "kepler").numerical(0.05, 1.0)["curve"]
    run = bs.integrate("rk4", "kepler", h=0.05, steps=399, save_every=3, observe="energy")
    count = len(run.t)
    assert (found["t"][:count] == run.t).all()
    assert (found["x"][:count] == run.y[2]).all()
    assert (found["y"][:count] == run.y[3]).all()
    assert np.allclose(found["energy"][:count], run.observed["energy"] - run.observed["energy"][0], atol=1e-14)
    assert np.isnan(found["t"][count:]).all()


def test_the_exact_solution_and_the_error():
    found = flows("stormer-verlet", OSCILLATOR).exact(0.1, 2.0)["curve"]
    t = found["t"][np.isfinite(found["t"])]
    assert np.allclose(found["x"][: len(t)], 2 * np.cos(t), atol=1e-12)
    run = bs.integrate("stormer-verlet", OSCILLATOR, h=0.1, steps=200, save_every=2, y0=[0, 2])
    error = np.hypot(run.y[1] - 2 * np.cos(run.t), run.y[0] + 2 * np.sin(run.t))
    assert np.allclose(found["error"][1 : len(t)], error[1:], rtol=1e-6)


def test_errors_from_the_modified_flow_have_its_order():
    """With N terms the distance is O(h^N)."""
    example = flows("symplectic-euler-p", "pendulum", span=2.0)
    for terms in (1, 2, 3, 4):
        coarse, fine = (np.nanmax(example.modified(h, 1.0, terms)["curve"]["error"]) for h in (0.1, 0.05))
        assert math.log2(coarse / fine) == pytest.approx(terms, abs=0.25)


def test_modified_energies_are_kept_better_with_more_terms():
    example = flows("symplectic-euler-p", "pendulum")
    largest = [np.nanmax(abs(example.modified(0.1, 1.0, n)["curve"]["energy"])) for n in (1, 2, 3, 4)]
    assert all(b < a / 5 for a, b in pairwise(largest))
    assert largest[0] == np.nanmax(abs(example.numerical(0.1, 1.0)["curve"]["energy"]))


@pytest.mark.parametrize(
    ("method", "scene", "kept"),
    [
        ("symplectic-euler-p", "pendulum", True),
        ("symplectic-euler-p", "lotka-volterra", True),  # ∫ dp dq/(pq), for a Poisson integrator
        ("stormer-verlet", "toda", True),
        ("explicit-euler", "pendulum", False),
    ],
)
def test_areas(method, scene, kept):
    example = flows(method, scene, span=5.0)
    areas = {name: getattr(example, name)(0.1, 1.0)["area"]["area"] for name in ("numerical", "exact")}
    assert np.allclose(areas["exact"], 1, atol=1e-7)
    assert np.allclose(areas["numerical"], 1, atol=1e-7) == kept
    assert np.allclose(example.modified(0.1, 1.0, 4)["area"]["area"], areas["numerical"], atol=1e-2)


def test_unresolved_curves_have_no_area_and_are_not_drawn():
    wave = np.random.default_rng(1).normal(size=48)
    assert math.isnan(enclosed_area(wave, wave[::-1].copy()))
    view = flows("rk4", "kepler").numerical(0.05, 1.0)  # where angles shear patches
    drawn = np.isfinite(view["patch"]["x"].reshape(PATCHES + 1, -1)).any(axis=1)
    assert 0 < np.isfinite(view["area"]["area"]).sum() < drawn.sum() < len(drawn)


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "scene",
    ["pendulum", "riccati", "lorenz", "kepler", *(pytest.param(x, marks=SLOW) for x in ("rigid-body", "henon-heiles"))],
)
def test_columns_have_lengths_that_do_not_depend_on_the_step(scene):
    example = flows("implicit-midpoint", scene)
    for h in (example.largest, example.largest / 7):
        for view in (example.numerical(h, 1.0), example.exact(h, 1.0), example.modified(h, 1.0, 2)):
            assert {len(column) for column in view["curve"].values()} == {SAMPLES + 1}
            assert {len(column) for column in view["patch"].values()} == {(PATCHES + 1) * (CIRCLE + 2)}
            assert {len(column) for column in view["area"].values()} == {PATCHES + 1}
    assert len(example.orbits(example.largest)["x"]) % ORBITS == 0


def test_sections_lie_on_an_energy_surface():
    """Of Hénon–Heiles: the bounded orbits cross q1 = 0."""
    orbits = flows("implicit-midpoint", "henon-heiles").orbits(0.1)
    assert np.isfinite(orbits["x"]).sum() > 200
    inner = abs(orbits["x"]) < 0.5  # the outer orbits escape
    assert np.nanmax(abs(orbits["y"][inner])) < 1
    assert np.nanmax(abs(orbits["y"])) < 10


def test_a_solution_that_ends_is_a_curve_that_ends():
    example = flows("explicit-euler", "riccati")  # y = 1/(1/y0 − t)
    exact, numerical = (view["curve"]["y"] for view in (example.exact(0.1, 1.0), example.numerical(0.1, 1.0)))
    for curve in (exact, numerical):
        assert 0 < np.isfinite(curve).sum() < SAMPLES
    growing = flows("explicit-euler", "lotka-volterra")
    growing.modified(growing.largest, 1.5, 6)


def test_bad_steps_and_starts_are_sentences():
    example = flows("rk4", "pendulum")
    for h in (0.0, -0.1, math.nan, math.inf):
        with pytest.raises(bs.SeriesError, match="h must be a number greater than 0, but was"):
            example.numerical(h, 1.0)
    with pytest.raises(bs.SeriesError, match=r"h must be at least 0.001 for a time of 20, but was"):
        example.numerical(20 / MOST_STEPS / 2, 1.0)
    with pytest.raises(bs.SeriesError, match="start must be where the field is finite"):
        SceneFlows(bs.method("rk4"), bs.parse_scene("y' = exp(y)", start="y=1000"))


def test_scenes_without_a_modified_hamiltonian():
    assert flows("rk4", "lorenz").energy_terms == 0
    assert flows("explicit-euler", "pendulum").energy_terms == 1
    assert flows("rk4", "kepler").energy_terms == 5
    assert np.isnan(flows("explicit-euler", "pendulum").modified(0.1, 1.0, 2)["curve"]["energy"]).all()
