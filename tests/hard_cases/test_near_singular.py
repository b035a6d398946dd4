"""Orbits near to a singularity: eccentric, close to zero, next to a separatrix, up to a blow-up, overlapping."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import bseries as bs

pytestmark = pytest.mark.slow

# Kepler's problem, e = 0.9, 0.99, 0.999

ECCENTRICITIES = ("0.9", "0.99", "0.999")
CONTROL = "(q1^2 + q2^2)^(3/4)"
"""Steps as the free fall time, |q|^(3/2)."""


def orbit(e, t):
    """The exact orbit from the perihelion: E − e sin E = t."""
    with mpmath.workdps(30):
        E = mpmath.findroot(lambda E: E - e * mpmath.sin(E) - t, mpmath.mpf(t) + e * mpmath.sin(t), tol=1e-25)
        r, b = 1 - e * mpmath.cos(E), mpmath.sqrt(1 - e**2)
        y = [-mpmath.sin(E) / r, b * mpmath.cos(E) / r, mpmath.cos(E) - e, b * mpmath.sin(E)]
        return np.array([float(x) for x in y])


def energy_error(run):
    """The largest change of the energy, in parts of the potential at the perihelion, 1/(1 − e)."""
    energy = run.observed["energy"]
    return abs(energy - energy[0]).max() * np.hypot(*run.y[2:, 0])


@pytest.mark.parametrize("e", ECCENTRICITIES)
@pytest.mark.parametrize(("method", "promise"), [("stormer-verlet", 3e-4), ("gauss3", 1e-12)])
def test_variable_steps_hold_the_energy_of_eccentric_orbits(e, method, promise, measured):
    comet = bs.scene("kepler", eccentricity=e)
    run = bs.integrate(method, comet, h=0.02, steps=5000, control=CONTROL, observe="energy")
    error, energy = energy_error(run), run.observed["energy"]
    case = f"kepler e = {e}, {method}, 5000 reversible variable steps"
    measured.within(f"{case}: energy error", error, promise, "/(1 − e)", note=f"{run.t[-1] / (2 * np.pi):.1f} periods")
    early, late = (abs(part / energy[0] - 1).max() for part in (energy[:2000], energy[-2000:]))
    measured.within(
        f"{case}: energy error of the last 2000 steps",
        late / (early + 1e-13),
        1.05,
        " of that of the first",
        form=".3f",
    )
    if method == "gauss3":
        distance = float(abs(run.y[:, -1] - orbit(mpmath.mpf(e), run.t[-1]))[2:].max()) * (1 - float(e))
        measured.within(f"{case}: position at the end against Kepler's equation", distance, 1e-9, "/(1 − e)")


@pytest.mark.parametrize("e", ECCENTRICITIES)
def test_fixed_steps_fail_there_and_the_modified_equation_warns(e, measured):
    """Less than half as many steps as the variable ones make in a period."""
    comet, h = bs.scene("kepler", eccentricity=e), 2 * np.pi / 200
    run = bs.integrate("stormer-verlet", comet, h=h, steps=2000, observe="energy")
    error = abs(run.observed["energy"] / run.observed["energy"][0] - 1).max()
    field = bs.modified_field(bs.method("stormer-verlet"), comet, 9)
    with pytest.warns(bs.fields.TruncationWarning, match="stormer-verlet-kdk on kepler is worse at order 9 than"):
        found = bs.fields.reach(field, comet.y0, h)
    assert error > 0.5
    measured.said(
        f"kepler e = {e}, stormer-verlet, 200 fixed steps a period", "the modified equation warns at the perihelion",
        f"needs h ≤ {found.largest_step:.1e}, h = {h:.1e}; relative energy error {error:.1e}",
    )  # fmt: skip
    far = [0, -float(mpmath.sqrt((1 - mpmath.mpf(e)) / (1 + mpmath.mpf(e)))), -1 - float(e), 0]
    assert not bs.fields.reach(field, far, h).is_beyond


# Lotka–Volterra close to zero

PREDATORS = bs.scene("lotka-volterra")
NEARLY_EXTINCT = (1e-12, 1e-12)


@pytest.mark.parametrize(("method", "promise"), [("rk4", 1e-5), ("gauss2", 1e-6)])
def test_populations_close_to_zero(method, promise, measured):
    """The orbit comes down to p = 2e-36."""
    run = bs.integrate(method, PREDATORS, h=0.001, steps=30_000, y0=NEARLY_EXTINCT, observe="energy")
    exact = bs.reference_solution(PREDATORS, [1, 10, 30], y0=NEARLY_EXTINCT)
    error = float(abs(run.y[:, [1000, 10_000, 30_000]] / exact - 1).max())
    assert run.y.min() > 0
    measured.within(
        f"lotka-volterra from p = q = 1e-12, {method}, h = 0.001: p and q, both positive, at t = 1, 10, 30",
        error, promise, what="relative error", note=f"p ≥ {run.y[0].min():.1e}",
    )  # fmt: skip


def test_what_is_no_population_is_told(measured):
    """Explicit Euler jumps to a negative p, where the energy has no value."""
    with pytest.warns(RuntimeWarning, match=r"energy must be finite .* observed, but was nan at t = 16\.4"):
        run = bs.integrate("explicit-euler", PREDATORS, h=0.01, steps=3000, y0=NEARLY_EXTINCT, observe="energy")
    assert run.y.min() < 0
    case = "lotka-volterra from p = q = 1e-12, explicit-euler, h = 0.01: p < 0 from t = 16.4 on"
    measured.said(case, "warns", "“energy must be finite …”")
    with pytest.raises(bs.IntegratorError, match="start must make p positive, but it was 0"):
        PREDATORS.with_start(p=[0])
    assert bs.integrate("rk4", PREDATORS, h=0.01, steps=3, y0=(5e-324, 1e-308)).y.min() > 0


# The pendulum within 1e-12 of the separatrix

PENDULUM = bs.scene("pendulum")


def turn(p0):
    """The period from (p0, 0), or the time of a turn if it rotates."""
    with mpmath.workdps(40):
        m = mpmath.mpf(p0) ** 2 / 4
        return float(4 * mpmath.ellipk(m) if m < 1 else 2 * mpmath.ellipk(1 / m) / mpmath.sqrt(m))


def measured_turn(run):
    """The same from a run, None if it does what it should not; between steps q changes with constant velocity."""
    (p0, q), rotates = (run.y[0, 0], run.y[1]), run.y[0, 0] > 2
    if rotates != (abs(q).max() > 4):
        return None
    goal = 2 * np.pi if rotates else 0.0
    k = 1 + int(np.argmax((q[1:-1] < goal) & (q[2:] >= goal)))
    return run.t[k] + (goal - q[k]) / p0


@pytest.mark.parametrize("p0", [2 - 5e-13, 2 + 5e-13])
def test_next_to_the_separatrix(p0, measured):
    """H = 1 ∓ 1e-12: from there on rounding of the energy, 2e-16, changes the period by some 1e-6."""
    run = bs.integrate("gauss5", PENDULUM, h=0.05, steps=1400, y0=(p0, 0))
    found = measured_turn(run)
    assert found is not None
    what = f"rotates in {turn(p0):.4f}" if p0 > 2 else f"swings in {turn(p0):.4f}"
    measured.within(
        f"pendulum, H = 1 {'+−'[p0 < 2]} 1e-12 ({what}), gauss5, h = 0.05: period",
        abs(found / turn(p0) - 1), 1e-5, what="relative error",
    )  # fmt: skip
    other, h = ("stormer-verlet", 0.1) if p0 < 2 else ("rk4", 0.01)  # they come to the other side
    assert measured_turn(bs.integrate(other, PENDULUM, h=h, steps=int(70 / h), y0=(p0, 0))) is None


def distance_from_the_top(start, t):
    """π − q after a time t from rest at q = start: sin(q/2) = k cd(t) with the modulus k = sin(start/2)."""
    with mpmath.workdps(50):
        k = mpmath.sin(mpmath.mpf(start) / 2)
        return mpmath.pi - 2 * mpmath.asin(k * mpmath.ellipfun("cd", t, m=k**2))


def fallen(method, start, t):
    """How much π − q is off after a fall from rest, as a part of 2⁻⁵³ e^t."""
    run = bs.integrate(method, PENDULUM, h=0.0625, steps=16 * t, save_every=None, y0=(0, start))
    with mpmath.workdps(50):
        error = abs(mpmath.pi - float(run.y[1, -1]) - distance_from_the_top(start, t))
        return float(error * 2**53 / mpmath.exp(t))


@pytest.mark.parametrize(("start", "t"), [(np.pi - 1e-8, 10), (np.pi - 1e-8, 20), (np.pi - 1e-12, 20)])
def test_next_to_the_equilibrium_of_the_separatrix(start, t, measured):
    """At rest beside the top, H = 1 − 5e-17 or − 5e-25. The distance from the top, d, grows like d cosh(t).

    q near π has the last bit 2⁻⁵¹, half of which an angle may be off: a force that is off by 2⁻⁵² for all the time
    moves the pendulum by 2⁻⁵² (cosh(t) − 1), less than 2⁻⁵³ e^t.
    """
    beside = float(distance_from_the_top(start, t))
    measured.within(
        f"pendulum from rest at π − {np.pi - start:.0e}, gauss5, h = 1/16: distance from π at t = {t}",
        fallen("gauss5", start, t), 1, f" · 2⁻⁵³ e^{t}", what="error", note=f"distance {beside:.1e}",
    )  # fmt: skip
    assert beside > 1000 * 2.0**-53 * np.exp(t)  # a pendulum that stayed at rest would be noticed
    assert fallen("stormer-verlet", start, t) > 4  # so is an error of 1e-3 of the distance


# y' = y² to the blow-up at t = 1

RICCATI = bs.scene("riccati")


@pytest.mark.parametrize("method", ["rk4", "gauss3"])
def test_fixed_steps_end_at_the_blow_up(method, measured):
    with pytest.raises(
        bs.integrators.StepError, match=f"h must be small enough for {method} on riccati, but with h = 0.01"
    ) as found:
        bs.integrate(method, RICCATI, h=0.01, steps=10_000)
    kept = found.value.trajectory
    assert kept is not None
    assert np.isfinite(kept.y).all()
    half = abs(kept.y[0, 50] / 2 - 1)
    assert 0.98 < kept.t[-1] < 1.06
    measured.said(
        f"y' = y², {method}, h = 0.01: blow-up at t = 1", "StepError with all states before",
        f"stops at t = {kept.t[-1]:.2f}; y(0.5) to {half:.0e}",
    )  # fmt: skip
    with pytest.warns(bs.fields.TruncationWarning, match="worse at order 13"):
        bs.fields.reach(bs.modified_field(bs.method(method), RICCATI, 13), kept.y[:, 99], 0.01)


def test_variable_steps_go_up_to_the_blow_up(measured):
    with pytest.raises(
        bs.integrators.StepError, match=r"step 35\d\d\d, from t = 1, did not end in finite numbers"
    ) as found:
        bs.integrate("gauss3", RICCATI, h=0.01, steps=100_000, control="1/y")
    kept = found.value.trajectory
    assert kept is not None
    k = int(np.searchsorted(kept.y[0], 1e6))
    error = abs(kept.y[0, k] * (1 - kept.t[k]) - 1)
    case = "y' = y², gauss3 with steps ε/y"
    measured.within(f"{case}: y at y = 1e6", error, 1e-9, what="relative error")
    measured.at_least(f"{case}: largest y before the run ends", kept.y[0, -1], 1e150)
    measured.within(f"{case}: where the run ends", abs(kept.t[-1] - 1), 1e-12, what="|t − 1|")
    fixed = bs.integrate("gauss3", RICCATI, h=0.01, steps=98)  # fixed steps lose all digits long before
    assert abs(fixed.y[0, -1] * (1 - fixed.t[-1]) - 1) > 1e-9


def test_the_reference_solution_says_where_it_ends(measured):
    with pytest.raises(bs.IntegratorError, match=r"t must end before (1|0\.99999\d+), beyond which") as found:
        bs.reference_solution(RICCATI, 2)
    measured.said("y' = y², reference_solution to t = 2", "a clear error", f"“{found.value}”")


# Lennard-Jones atoms that overlap at the start


def dimer(distance, method, h, steps):
    """Two atoms so far apart; their minimum is at 1.12."""
    scene = bs.scene("lennard-jones", particles=2, dimension=1, temperature=0)
    return bs.integrate(method, scene, h=h, steps=steps, y0=[0, 0, -distance / 2, distance / 2], observe="energy")


@pytest.mark.parametrize("method", ["stormer-verlet", "rk4", "implicit-midpoint"])
@pytest.mark.parametrize("distance", [0.0, 1e-200])
def test_atoms_at_one_place_are_refused(method, distance, measured):
    with pytest.raises(
        bs.integrators.StepError,
        match="y0 must be where the field of lennard-jones is finite, but step 1, from t = 0, began where it",
    ) as found:
        dimer(distance, method, 1e-3, 100)
    kept = found.value.trajectory
    assert kept is not None
    assert kept.y.shape == (4, 1)
    case = f"lennard-jones, two atoms at distance {distance:g}, {method}"
    measured.said(case, "a clear error", "“y0 must be where …”")


def test_overlapping_atoms_call_for_small_steps(measured):
    """At half the diameter the energy is 16,128, and the atoms fly apart with velocity 127 each."""
    error = {
        h: abs(np.diff(dimer(0.5, "stormer-verlet", h, 1000).observed["energy"][[0, -1]])[0]) / 16128
        for h in (1e-3, 1e-5)
    }
    case = "lennard-jones at distance 0.5, stormer-verlet"
    measured.within(f"{case}, h = 1e-5: energy after 1000 steps", error[1e-5], 1e-3, what="relative error")
    assert error[1e-3] > 1
    scene = bs.scene("lennard-jones", particles=2, dimension=1, temperature=0)
    field, start = bs.modified_field(bs.method("stormer-verlet"), scene, 5), [0, 0, -0.25, 0.25]
    with pytest.warns(
        bs.fields.TruncationWarning, match=r"worse at order 5 than at order 1: for h = 0\.001 .* needs h ≤"
    ):
        found = bs.fields.reach(field, start, 1e-3)
    assert not bs.fields.reach(field, start, 1e-5).is_beyond
    measured.said(
        f"{case}, h = 1e-3: the modified equation", "warns",
        f"needs h ≤ {found.largest_step:.1e}; relative energy error {error[1e-3]:.1g}",
    )  # fmt: skip


def test_implicit_steps_from_a_deep_overlap_say_that_they_do_not_converge(measured):
    with pytest.raises(
        bs.integrators.StepError, match=r"small enough for implicit-midpoint .* step 1, from t = 0, did not converge"
    ):
        dimer(1e-3, "implicit-midpoint", 1e-3, 100)
    case = "lennard-jones at distance 1e-3, implicit-midpoint, h = 1e-3"
    measured.said(case, "StepError", "“… did not converge”")
