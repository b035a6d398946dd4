"""Modifying integrators run as methods: the order of the global error is raised as promised."""

import numpy as np
import pytest
import sympy

import bseries as bs
from integrators.reference.plain_steps import plain_steps

MIDPOINT = bs.method("implicit-midpoint")
STEPS = {"rigid-body": (4, {4: 20, 6: 20, 8: 15}), "kepler": (1, {4: 100, 6: 100, 8: 40})}
"""The time of the run, and the smaller number of steps for each order."""


def field_of(scene):
    function = sympy.lambdify(scene.symbols, scene.field, "numpy")
    return lambda y: function(*y)


@pytest.fixture(scope="module")
def ends():
    """The exact solutions at the end, to rounding errors."""
    gauss = bs.method("gauss6")
    found = {}
    for name, (time, _) in STEPS.items():
        scene = bs.scene(name)
        found[name] = plain_steps(gauss, field_of(scene), scene.y0, time / 200, 200)[:, -1]
    return found


def measured_order(run, time, steps, end):
    errors = [np.linalg.norm(run(time / n, n)[:, -1] - end) for n in (steps, 2 * steps)]
    return np.log2(errors[0] / errors[1])


@pytest.mark.few(2)
@pytest.mark.parametrize("order", [4, 6, 8])
@pytest.mark.parametrize("name", STEPS)
def test_the_order_is_raised(name, order, ends):
    time, steps = STEPS[name]
    scene = bs.scene(name)
    found = measured_order(
        lambda h, n: bs.fields.modifying_steps(MIDPOINT, scene, order, scene.y0, h, n), time, steps[order], ends[name]
    )
    assert found == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("name", STEPS)
def test_without_modification_the_order_is_two(name, ends):
    time, steps = STEPS[name]
    scene = bs.scene(name)
    found = measured_order(
        lambda h, n: plain_steps(MIDPOINT, field_of(scene), scene.y0, h, n), time, steps[4], ends[name]
    )
    assert found == pytest.approx(2, abs=0.1)


def test_geometry_is_kept():
    """The modifying midpoint rule keeps quadratic invariants, Runge–Kutta methods of the same order do not."""
    scene = bs.scene("rigid-body")
    run = bs.fields.modifying_steps(MIDPOINT, scene, 4, scene.y0, 0.3, 300)
    other = plain_steps(bs.method("rk4"), field_of(scene), scene.y0, 0.3, 300)
    change, larger = (np.ptp((states**2).sum(axis=0)) for states in (run, other))
    assert change < 1e-13
    assert larger > 1e-6


def test_blocks_of_variables(ends):
    """Symplectic Euler of order 1, raised to 3: by doubles and in 30 digits."""
    scene, method = bs.scene("kepler"), bs.method("symplectic-euler-p")
    found = measured_order(
        lambda h, n: bs.fields.modifying_steps(method, scene, 3, scene.y0, h, n), 1, 400, ends["kepler"]
    )
    assert found == pytest.approx(3, abs=0.1)
    precise = bs.fields.modifying_steps(method, scene, 3, scene.start, "1/100", 3, digits=30)
    quick = bs.fields.modifying_steps(method, scene, 3, scene.y0, 0.01, 3)
    assert np.abs(precise.astype(float) - quick).max() < 1e-14


def test_blocks_named_otherwise():
    scene = bs.scene("brusselator")
    parts = {"p": "u", "q": "v"}
    run = bs.fields.modifying_steps(bs.method("symplectic-euler-q"), scene, 4, scene.y0, 0.01, 10, parts=parts)
    exact = plain_steps(bs.method("gauss4"), field_of(scene), scene.y0, 0.01, 10)
    assert np.abs(run - exact).max() < 1e-5
    plain = plain_steps(bs.method("explicit-euler"), field_of(scene), scene.y0, 0.01, 10)
    assert np.abs(plain - exact).max() > 1e-3


def test_parts_of_the_field_are_refused():
    with pytest.raises(bs.SeriesError, match="method must treat blocks of variables, but lie-trotter treats parts"):
        bs.fields.modifying_steps(bs.methods.lie_trotter(["a", "b", "c"]), bs.scene("abc-flow"), 2, [1, 2, 3], 0.1, 1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"h": None}, "h must be a real number or a formula, but was None"),
        ({"y": [1]}, "y must"),
        ({"steps": -1}, "steps must be 0, 1, 2, …, but was -1"),
        ({"method": 4}, "method must be"),
        ({"order": None}, "order must be given for a method, but was None"),
        ({"digits": 0}, "digits must be"),
    ],
)
def test_bad_arguments(changes, message):
    scene = bs.scene("pendulum")
    arguments = {"method": MIDPOINT, "order": 3, "y": [0, 1], "h": 0.1, "steps": 1, "digits": None, **changes}
    with pytest.raises(bs.errors, match=message):
        bs.fields.modifying_steps(scene=scene, **arguments)
