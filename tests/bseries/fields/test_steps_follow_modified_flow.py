"""Trajectories stay with the flow of the truncated modified equation of their method: stepping against series."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import bseries as bs

STARTS = {
    "pendulum": [0.4, 1.1],
    "lotka-volterra": [1.5, 2.25],
    "henon-heiles": [0.3, 0.1, -0.2, 0.25],
    "double-pendulum": [0.4, -0.3, 0.8, 1.1],
    "brusselator": [1.5, 3.0],
}
"""Starts without any symmetry."""
END = 1.0
ROUNDING = 1e-12
"""Distances that are smaller are spoilt by the errors of what is called exact here."""
FINEST = 11


def distance(made, field, steps):
    """How far the end of a trajectory is from that of the flow of the modified field."""
    name, h = field.scene.name, END / steps
    compiled = bs.stepper(made, field.scene)
    state = compiled.start(STARTS[name], h=h)
    compiled.advance(state, steps)
    flow = solve_ivp(lambda t, y: field(y, h), (0, END), STARTS[name], method="DOP853", rtol=2.3e-14, atol=1e-15)
    return np.abs(state.y - flow.y[:, -1]).max()


def measured_power(made, field):
    """The power of h with which the distance falls, by the two smallest of the steps 1/4, 1/8, … that show it."""
    found = []
    for level in range(2, FINEST + 1):
        gap = distance(made, field, 2**level)
        if gap < ROUNDING:
            break
        found.append(gap)
    return np.log2(found[-2] / found[-1])


CASES = [
    ("explicit-euler", "pendulum", 4),
    ("rk4", "double-pendulum", 6),
    ("rk4", "brusselator", 7),
    ("dormand-prince54", "henon-heiles", 7),
    ("radau-iia2", "lotka-volterra", 5),
    ("implicit-midpoint", "double-pendulum", 4),
    ("implicit-midpoint", "henon-heiles", 6),
    ("gauss2", "lotka-volterra", 6),
    ("gauss3", "lotka-volterra", 8),
    ("avf", "henon-heiles", 6),
    ("kahan", "lotka-volterra", 6),
    ("symplectic-euler-p", "double-pendulum", 4),
    ("symplectic-euler-q", "lotka-volterra", 5),
    ("stormer-verlet-kdk", "henon-heiles", 6),
    ("stormer-verlet-dkd", "double-pendulum", 4),
    ("lobatto-iiia-iiib3", "double-pendulum", 6),
    ("gark2", "lotka-volterra", 4),
    ("rkn-nystrom4", "henon-heiles", 6),
    ("takahashi-imada", "pendulum", 6),
    ("chin4b", "henon-heiles", 6),
    ("strang", "lotka-volterra", 4),
    ("blanes-moan4", "henon-heiles", 6),
    ("tdrk4", "brusselator", 6),
    ("ros3p", "brusselator", 5),
]
"""Methods of all kinds, and the order N of the truncation: powers h^0 … h^(N−1) are kept, h^N is left out first."""


@pytest.mark.few(6)
@pytest.mark.parametrize(("name", "where", "order"), CASES)
def test_distance_falls_with_the_first_power_left_out(name, where, order):
    made = bs.method(name)
    assert measured_power(made, bs.modified_field(made, bs.scene(where), order)) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize(
    ("name", "other", "where", "order"),
    [
        ("explicit-midpoint", "heun2", "lotka-volterra", 2),
        ("implicit-midpoint", "trapezoidal", "double-pendulum", 2),
        ("stormer-verlet-kdk", "stormer-verlet-dkd", "henon-heiles", 2),
        ("rk4", "rk38", "double-pendulum", 4),
    ],
)
def test_the_flow_of_another_method_is_left_with_the_order_of_both(name, other, where, order):
    field = bs.modified_field(bs.method(other), bs.scene(where), 6)
    assert measured_power(bs.method(name), field) == pytest.approx(order, abs=0.1)
