"""The modified field of steps from their iterates, against that of trees, closed forms, and wrong fields."""

from __future__ import annotations

import math
from itertools import pairwise, product

import numpy as np
import pytest

import bseries as bs

METHODS = ["explicit-euler", "implicit-midpoint", "rk4", "heun3", "stormer-verlet"]
SCENES = {"pendulum": 0.1, "lotka-volterra": 0.05, "henon-heiles": 0.1, "kepler": 0.02}
PAIRS = [pair for pair in product(METHODS, SCENES) if pair != ("stormer-verlet", "lotka-volterra")]


def one_step(method, scene):
    return lambda y, h: bs.integrate(method, scene, h=h, steps=1, y0=y).y[:, -1]


@pytest.mark.few(6)
@pytest.mark.parametrize(("method", "scene"), PAIRS)
def test_iterates_and_trees_give_the_same_field(method, scene):
    h, y = SCENES[scene], np.array(bs.scene(scene).start, float) * 0.9 + 0.05
    found = bs.fields.step_field(one_step(method, scene), y, h)
    trees = bs.modified_field(method, scene, 13)(y, h)
    assert abs(found.value - trees).max() < 4 * found.error + 1e-11
    assert found.error < 1e-8
    assert abs(found.value - bs.modified_field(method, scene, 2)(y, h)).max() > 1e4 * found.error  # further terms count


def verlet(y, h):
    p, q = y
    p = p - h / 2 * math.sin(q)
    q = q + h * p
    return np.array([p - h / 2 * math.sin(q), q])


def test_errors_fall_with_the_points_and_are_bounded_by_their_estimates():
    y = [0.3, 1.2]
    exact = bs.modified_field("stormer-verlet", "pendulum", 17)(np.array(y), 0.1)
    sizes = []
    for points in (2, 4, 6, 8):
        found = bs.fields.step_field(verlet, y, 0.1, points=points)
        sizes.append(abs(found.value - exact).max())
        assert sizes[-1] <= found.error
    assert all(later < earlier / 50 for earlier, later in pairwise(sizes))
    with_inverse = bs.fields.step_field(verlet, y, 0.1, inverse=lambda y, h: verlet(y, -h))
    assert abs(with_inverse.value - exact).max() < with_inverse.error < 1e-12


def test_a_wrong_inverse_shows():
    found = bs.fields.step_field(lambda y, h: y + h * y, [1.0], 0.1, inverse=lambda y, h: y - h * y)
    assert abs(found.value[0] - math.log(1.1) / 0.1) > 1e-3


def test_rotations_have_their_angle():
    """A rotation by the angle h·ω is the flow of the field ω J y, whatever made it."""
    omega, h = 1.7, 0.2
    matrix = np.array([[math.cos(h * omega), -math.sin(h * omega)], [math.sin(h * omega), math.cos(h * omega)]])
    found = bs.fields.step_field(lambda y, h: matrix @ y, [0.6, -0.8], h)
    assert found.value == pytest.approx([0.8 * omega, 0.6 * omega], abs=1e-12)


@pytest.mark.parametrize(("method", "order"), [("explicit-euler", 1), ("heun2", 2), ("kutta3", 3), ("rk4", 4)])
def test_observed_orders(method, order):
    scene = bs.scene("pendulum")
    f = bs.modified_field(method, scene, 1)
    found = bs.fields.observed_order(one_step(method, scene), lambda y: f(y, 0.0), [0.3, 1.2], 0.05)
    assert found == pytest.approx(order, abs=0.1)


def test_the_exact_flow_has_no_order():
    assert bs.fields.observed_order(lambda y, h: y * math.exp(h), lambda y: y, [1.0], 0.1) == math.inf


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((lambda y, h: y[:1], [1.0, 2.0], 0.1), r"step must return finite numbers of the shape \(2,\)"),
        ((lambda y, h: y * math.nan, [1.0], 0.1), "step must return finite numbers"),
        ((lambda y, h: -3 * y, [1.0], 0.1), "step must be near the identity, or come with its inverse"),
        ((lambda y, h: y, [math.inf], 0.1), "y and h must be finite numbers"),
        ((lambda y, h: y, [1.0], 0), "h not 0"),
        ((lambda y, h: y, [1.0], "x"), "h must be"),
        (("rk4", [1.0], 0.1), r"step must be a function of \(y, h\), but was 'rk4'"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(bs.errors, match=message):
        bs.fields.step_field(*arguments)
    with pytest.raises(bs.errors, match="points must be a whole number from 1 to 24, but was 0"):
        bs.fields.step_field(verlet, [0.3, 1.2], 0.1, points=0)
