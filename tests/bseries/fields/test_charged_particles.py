"""Boris's method: its step against the published one, order, volume, energy and the magnetic moment."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import sympy

import bseries as bs
from integrators.reference.plain_steps import block_parts, plain_step

BORIS = bs.method("boris")
DIPOLE = bs.scene("magnetic-dipole")
SLOPED = "x^3 - y^3 + x^4/5 + y^4 + z^4"
CURVED = ["(y - z)/2", "(x + z)/2", "(y - x)/2"]
START = {"v": ["9/100", "11/20", "3/10"], "x": [0, 1, "1/10"]}


def particle(magnetic, potential):
    return bs.scene("charged-particle", magnetic=magnetic, potential=potential).with_start(**START)


def pushed(v, x, h, electric, magnetic):
    """One step as Boris wrote it, with the rotation by cross products, between two half steps of x."""
    x = x + h / 2 * v
    t = h / 2 * magnetic(x)
    before = v + h / 2 * electric(x)
    turned = before + np.cross(before + np.cross(before, t), 2 * t / (1 + t @ t))
    v = turned + h / 2 * electric(x)
    return v, x + h / 2 * v


FIELDS = {
    "dipole": (
        bs.scene("magnetic-dipole", effects=["attraction"]),
        lambda x: -x / 500 / (x @ x) ** 1.5,
        lambda x: (3 * x * x[2] - np.array([0, 0, x @ x])) / (x @ x) ** 2.5,
    ),
    "general": (
        particle(CURVED, SLOPED),
        lambda x: -np.array([3 * x[0] ** 2 + 0.8 * x[0] ** 3, -3 * x[1] ** 2 + 4 * x[1] ** 3, 4 * x[2] ** 3]),
        lambda x: np.array([x[1] - x[2], x[0] + x[2], x[1] - x[0]]) / 2,
    ),
}


@pytest.mark.parametrize("solver", ["auto", "newton"])
@pytest.mark.parametrize("name", FIELDS)
def test_steps_are_those_that_boris_wrote(name, solver):
    scene, electric, magnetic = FIELDS[name]
    v, x = scene.y0[:3], scene.y0[3:]
    found = bs.integrate(BORIS, scene, h=0.05, steps=20, solver=solver).y
    for k in range(21):
        assert found[:, k] == pytest.approx(np.hstack([v, x]), abs=3e-15)
        v, x = pushed(v, x, 0.05, electric, magnetic)


def test_order_2():
    scene = FIELDS["dipole"][0]
    exact = bs.integrate("gauss4", scene, h=0.01, span=4).y[:, -1]
    errors = [np.abs(bs.integrate(BORIS, scene, h=h, span=4).y[:, -1] - exact).max() for h in (0.02, 0.01, 0.005)]
    assert np.log2(errors[:-1]) - np.log2(errors[1:]) == pytest.approx([2, 2], abs=0.01)
    assert bs.order_of(BORIS) == 2
    assert bs.symmetry(BORIS).holds


@pytest.mark.parametrize("effects", [[], ["attraction"]])
def test_modified_field_has_no_divergence(effects):
    scene = bs.scene("magnetic-dipole", effects=effects)
    field = bs.modified_field(BORIS, scene, 5)
    assert [bs.fields.divergence(field, k) for k in range(5)] == [0] * 5
    assert field.formulas.elements(3) != [field.formulas.ring.zero] * 6  # there is a term with h^2
    other = bs.modified_field(bs.method("stormer-verlet"), scene, 3)
    assert bs.fields.divergence(other, 2) != 0


def jacobian_determinant(method, scene, h):
    """The determinant of the derivative of a step, by difference quotients in 80 digits."""
    with mpmath.workdps(80):
        field = sympy.lambdify([scene.symbols], scene.field, "mpmath")
        parts = block_parts(field, {"v": range(3), "x": range(3, 6)})
        start, width = [mpmath.mpf(float(x)) for x in scene.y0], mpmath.mpf(10) ** -20

        def step(i, sign):
            y = [x + sign * width * (i == k) for k, x in enumerate(start)]
            return mpmath.matrix(plain_step(method, parts if len(method.names) == 2 else field, y, h, digits=80))

        columns = [(step(i, 1) - step(i, -1)) / (2 * width) for i in range(6)]
        return mpmath.det(mpmath.matrix(6, 6) + mpmath.matrix([list(column) for column in columns]))


def test_a_step_preserves_volume():
    scene = FIELDS["general"][0]
    assert abs(jacobian_determinant(BORIS, scene, 0.1) - 1) < 1e-30
    assert abs(jacobian_determinant(bs.method("rk4"), scene, 0.1) - 1) > 1e-8


def test_no_poisson_integrator():
    field = bs.modified_field(BORIS, DIPOLE, 3)
    with pytest.raises(bs.errors, match=r"at h\^2, B\^\(-1\) f_3 is no gradient"):
        bs.modified_invariant(field)


def energy_means(scene, h, span):
    """The mean energy error in each fifth of a run."""
    energy = bs.integrate(BORIS, scene, h=h, span=span, save_every=10, observe="energy").observed["energy"]
    return np.array([part.mean() for part in np.array_split(energy, 5)]) - energy[0]


def test_energy_stays_where_the_field_is_constant_or_the_potential_quadratic():
    """Hairer & Lubich (2018): near-conservation in these two cases, drift or random walk in general."""
    for scene in (particle([0, 0, 1], SLOPED), particle(CURVED, "(x^2 + 2*y^2 + 3*z^2)/2")):
        assert np.ptp(energy_means(scene, 0.05, 100_000)) < 0.001
    assert np.ptp(energy_means(particle(CURVED, SLOPED), 0.05, 100_000)) > 0.3


def test_speed_is_kept_without_a_potential():
    run = bs.integrate(BORIS, DIPOLE, h=0.05, span=1000, save_every=10, observe=["energy", "momentum"])
    assert run.observed["energy"] == pytest.approx(0.0025, rel=1e-13)
    assert run.observed["momentum"] == pytest.approx(2.025, rel=1e-4)


def test_without_a_magnetic_field_it_is_verlet():
    for name in ("pendulum", "kepler"):
        boris, verlet = (bs.integrate(method, name, h=0.01, steps=100).y for method in (BORIS, "stormer-verlet-dkd"))
        assert boris == pytest.approx(verlet, abs=1e-14)
    named = bs.integrate("stormer-verlet", DIPOLE, h=0.01, steps=10, parts={"p": "v", "q": "x"}).y
    assert (bs.integrate("stormer-verlet", DIPOLE, h=0.01, steps=10).y == named).all()


@pytest.mark.parametrize(
    ("magnetic", "message"),
    [
        (["x", 0, 0], "magnetic must be divergence-free, but its divergence was 1"),
        ([0, 1], "magnetic must be the three components of B, but had 2"),
        ([0, 0, "w"], r"magnetic\[3\] must be a formula in x, y, z, but has the unknown name 'w'"),
    ],
)
def test_magnetic_fields_are_checked(magnetic, message):
    with pytest.raises(bs.errors, match=message):
        bs.scene("charged-particle", magnetic=magnetic)
