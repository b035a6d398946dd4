"""The figures about long times: their numbers against the lecture's, against laws, and against other routes."""

from __future__ import annotations

import json
from functools import cache
from math import pi
from pathlib import Path

import mpmath
import numpy as np
import pytest

import bseries as bs
from bseries.figures import (
    chaos_onset,
    large_steps,
    lennard_jones_drift,
    linear_error_growth,
    small_divisors,
    takahashi_imada_drift,
    theorem_3,
)
from bseries.figures.helpers import growth_exponent
from bseries.figures.registry import compute, drawn, figure_file, figure_names, takes_progress

pytestmark = pytest.mark.slow

pytest.importorskip("matplotlib")

GIVEN = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())["figures_2_to_7"]
ATOMS = {"h": 0.02, "members": 36, "span": 2500.0}
"""Figure 8 in a reduced form, of 4.5 million steps in place of 800 million."""

LATE = linear_error_growth.FIT_FROM, linear_error_growth.SPAN, linear_error_growth.SHOWN
"""The times of the fit of exponents in figure 10."""


@cache
def numbers_of(name):
    return compute(figure_file(name), {})


@pytest.fixture(scope="module")
def atoms():
    """Figure 8, reduced, with all trajectories one by one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lennard_jones_drift, "KEPT", ATOMS["members"])
        return lennard_jones_drift.numbers(**ATOMS)


def deviation_in(atoms, time):
    """The standard deviation of changes in a time, over all trajectories and all times that they begin at."""
    lag = round(time / atoms.t[1])
    return np.sqrt(np.mean((atoms.single[:, lag:] - atoms.single[:, :-lag]) ** 2))


def homoclinic_momentum(h):
    """Where the separatrix of the steps crosses q = 0, by bisection: below it they turn back, above they turn over."""
    low, high = 1.9, 2.4
    for _ in range(55):
        p = (low + high) / 2
        q = bs.integrate("implicit-midpoint", bs.scene("pendulum"), h=h, steps=round(60 / h), y0=[p, 0]).y[1]
        leaves = np.flatnonzero((np.diff(q) < 0) | (q[1:] > pi))[0]
        low, high = (p, high) if np.diff(q)[leaves] < 0 else (low, p)
    return low


def separatrix_slope(h):
    """log of the saddle point's multiplier, and dp/dq of its unstable curve at q = 0, in many digits."""
    with mpmath.workdps(50):
        h = mpmath.mpf(h)
        multiplier = (1 + h / 2) / (1 - h / 2)

        def step(p, q):
            moved = mpmath.findroot(lambda x: x - q - h * p + h**2 / 2 * mpmath.sin((q + x) / 2), q + h * p)
            return p - h * mpmath.sin((q + moved) / 2), moved

        def end(start, count=None):
            p, q, made = start, start - mpmath.pi, 0
            while made != count if count else q < 0:
                (p, q), made = step(p, q), made + 1
            return (p, q), made

        first = mpmath.mpf(10) ** -16  # the unstable curve is odd about the saddle point: p = q + π up to cubes
        count = end(first)[1]
        log_start = mpmath.findroot(
            lambda x: end(mpmath.exp(x), count)[0][1],
            (mpmath.log(first / multiplier), mpmath.log(first)), solver="anderson", tol=1e-60, verify=False,
        )  # fmt: skip
        near = mpmath.mpf(10) ** -14
        (p0, q0), (p1, q1) = (end(mpmath.exp(log_start + d), count)[0] for d in (-near, near))
        return mpmath.log(multiplier), (p1 - p0) / (q1 - q0)


class TestLargeSteps:
    ROWS = GIVEN["figure6"]["rows"]

    @pytest.mark.parametrize("h", ROWS)
    def test_conservation_of_the_modified_hamiltonian(self, h):
        for order, key in ((1, "max|H-H0|"), (3, "max|H3-H3_0|"), (5, "max|H5-H5_0|")):
            energy = bs.modified_hamiltonian(bs.method("implicit-midpoint"), bs.scene("pendulum"), order)
            runs = (energy(large_steps.orbit(float(h), start), float(h)) for start in numbers_of("large-steps").starts)
            found = [abs(values - values[0]).max() for values in runs]
            np.testing.assert_allclose(found, [row[key] for row in self.ROWS[h]], rtol=1e-4, atol=1e-10)

    def test_starts_are_those_of_the_lecture(self):
        given = [
            [float(x.replace("-pi", str(-pi))) for x in start.strip("()").split(",")]
            for start in GIVEN["figure6"]["initial_(p,q)"]
        ]
        np.testing.assert_array_equal(numbers_of("large-steps").starts, given)

    def test_energies_are_those_of_the_states(self):
        found = numbers_of("large-steps")
        for h, states, energies in zip(found.h, found.states, found.energies, strict=True):
            p, q = states[:, 0], states[:, 1]
            formula = p**2 / 2 - np.cos(q) + h**2 / 48 * (np.cos(2 * q) - 2 * p**2 * np.cos(q))
            differences = formula - energies  # H₃ is known up to a constant
            np.testing.assert_allclose(differences, differences[0, 0], atol=1e-13)

    def test_angles_are_reduced_between_steps_only(self):
        """Orbits that are joined from pieces are those of one run."""
        whole = bs.integrate("implicit-midpoint", bs.scene("pendulum"), h=0.3, steps=5000, y0=[1.5, -pi]).y
        p, q = large_steps.orbit(0.3, (1.5, -pi))[:, :5001]
        np.testing.assert_allclose(p, whole[0], atol=1e-9)
        np.testing.assert_allclose(np.exp(1j * q), np.exp(1j * whole[1]), atol=1e-9)

    @pytest.mark.parametrize("h", [0.7, 1.0, 1.29, 1.3, 1.45])
    def test_which_orbits_that_swing_are_chaotic(self, h):
        table = list(GIVEN["figure6"]["chaotic_step_sizes_in_0.70..1.60_(grid 0.01)"].values())[:2]
        starts = np.array([[0.0, -1.5], [0.0, -2.5]])
        assert chaos_onset.is_chaotic(starts, h, 20_000 * h).tolist() == [h in row for row in table]

    def test_all_steps_are_drawn_and_in_the_picture(self):
        found = numbers_of("large-steps")
        assert found.states.shape[-1] == 20_001
        panels = drawn(large_steps, found).axes
        for axes, states in zip(panels, found.states, strict=True):
            curves = [line.get_xydata().T[::-1] for line in axes.lines if line.get_marker() == "."]
            np.testing.assert_array_equal(curves, states)
        p = found.states[:, :, 0]
        assert found.p[0] < p.min() < p.max() < found.p[-1]

    def test_which_orbits_are_chaotic_in_the_caption(self):
        found = numbers_of("large-steps")
        table = list(GIVEN["figure6"]["chaotic_step_sizes_in_0.70..1.60_(grid 0.01)"].values())
        expected = [[h in row for row in table] for h in found.h]
        assert found.chaotic.tolist() == expected
        text = large_steps.caption(found)
        assert "from (0, −2.5) for h = 1.3" in text
        assert "None of these orbits" not in text
        calm = found._replace(chaotic=0 * found.chaotic)
        assert "None of these orbits is chaotic" in large_steps.caption(calm)


class TestChaosOnset:
    def test_the_layer_is_exponentially_thin(self):
        """ln(width) = −π²/2h + … at the saddle point: the slope against 1/h, where the layer is thin."""
        found = numbers_of("chaos-onset")
        thin = found.width < 0.1
        slope = np.polyfit(1 / found.h[thin], np.log(found.width[thin]), 1)[0]
        assert slope == pytest.approx(-(pi**2) / 2, rel=0.2)
        assert thin[found.h <= 0.8].all()

    def test_the_power_of_h_in_the_width(self):
        """The factor is constant only with h^(−3/2): what is left of it varies less than threefold."""
        found = numbers_of("chaos-onset")
        with_power, without = (
            found.width / chaos_onset.asymptotic_width(found.h),
            found.width * np.exp(pi**2 / 2 / found.h),
        )
        assert with_power.max() < 3 * with_power.min()
        assert without.max() > 5 * without.min()

    def test_the_width_at_the_bottom(self):
        """At q = 0 the width in p goes like h⁻³ e^(−π²/h), the square of that at the saddle point."""
        away = np.logspace(-8, -0.5, 46)
        h, widths = np.array([0.5, 0.6, 0.7, 0.8, 0.9, 1.0]), []
        for size in h:
            starts = np.column_stack([homoclinic_momentum(size) + away, 0 * away])
            widths.append(10 ** (-8 + 7.5 * chaos_onset.is_chaotic(starts, size, 2000.0).mean()))
        slope = np.polyfit(1 / h, np.log(widths * h**3), 1)[0]
        assert slope == pytest.approx(-(pi**2), rel=0.1)

    def test_the_angle_of_the_separatrices(self):
        """At q = 0 they are each other's reflections, of slopes ±s there, with s like h⁻³ e^(−π²/h)."""
        logs, slopes = zip(*(separatrix_slope(h) for h in ("0.2", "0.3")), strict=True)
        scaled = [s * mpmath.exp(mpmath.pi**2 / log) for log, s in zip(logs, slopes, strict=True)]
        power = mpmath.log(scaled[1] / scaled[0]) / mpmath.log(logs[1] / logs[0])
        assert float(power) == pytest.approx(-3, abs=0.05)

    def test_chaos_lies_at_the_separatrix(self):
        found = numbers_of("chaos-onset")
        h, p = np.meshgrid(found.h, found.bottom, indexing="ij")
        early = found.chaotic_bottom & (h < 1.25)
        separatrix = 2 / np.sqrt(1 - h**2 / 12)
        assert early.any()
        assert abs(p - separatrix)[early].max() < 0.12

    def test_the_separatrix_of_the_formula(self):
        energy = bs.modified_hamiltonian(bs.method("implicit-midpoint"), bs.scene("pendulum"), 3)
        for h in (0.4, 1.2):
            assert energy([2 / np.sqrt(1 - h**2 / 12), 0], h) == pytest.approx(energy([0, pi], h), rel=1e-14)

    def test_the_exact_flow_is_not_chaotic(self):
        """Negative control: a method of order 6 with a small step."""
        starts = np.array([[0.05, -pi], [1.9, 0.0], [2.1, 0.0]])
        assert chaos_onset.is_chaotic(starts, 1.3).any()
        assert not chaos_onset.is_chaotic(starts, 0.2).any()


class TestTakahashiImadaDrift:
    RUNS = GIVEN["figure7"]["runs"]
    KEYS = (
        ("pendulum", "forwards", "pendulum U=-cos q, simplified_TI_(14), p0=2.5"),
        ("pendulum", "symplectic", "pendulum U=-cos q, TI_(13), p0=2.5"),
        ("perturbed", "forwards", "perturbed U=-cos q+0.2 sin 2q, simplified_TI_(14), p0=2.5"),
        ("perturbed", "symplectic", "perturbed U=-cos q+0.2 sin 2q, TI_(13), p0=2.5"),
    )

    @pytest.mark.parametrize(("scene", "run", "key"), KEYS)
    def test_errors(self, scene, run, key):
        found, given = numbers_of("takahashi-imada-drift"), self.RUNS[key]
        errors = getattr(getattr(found, scene), run)
        at = [round(t / found.h) for t in (1000, 2000, 3000, 4000, 5000)]
        np.testing.assert_allclose(errors[at], given["E-E0 at t=1000..5000"], rtol=1e-4, atol=1e-8)
        np.testing.assert_allclose([errors.min(), errors.max()], [given["min_E-E0"], given["max_E-E0"]], atol=1e-8)
        slope = takahashi_imada_drift.slope(found.t, errors)
        assert slope == pytest.approx(given["slope_least_squares_E"], rel=1e-5, abs=1e-13)

    @pytest.mark.parametrize(("scene", "run", "key"), KEYS)
    def test_lines(self, scene, run, key):
        """Slopes of the modified energy with three and five terms, and how far it is from these lines."""
        method = takahashi_imada_drift.SIMPLIFIED if run == "forwards" else takahashi_imada_drift.SYMPLECTIC
        system = bs.scene("pendulum", effects=["asymmetry"] if scene == "perturbed" else [])
        states = bs.integrate(method, system, h=0.2, steps=25_000, y0=[2.5, 0])
        given = self.RUNS[key]
        for order, slope, rms in (
            (3, "slope_least_squares_E", "residual_rms_about_line"),
            (5, "slope_least_squares_E+h^4H5", "rms_E5_residual"),
        ):
            energy = bs.modified_hamiltonian(bs.method(takahashi_imada_drift.SYMPLECTIC), system, order)(states.y, 0.2)
            line = np.polyfit(states.t, energy, 1)
            assert line[0] == pytest.approx(given[slope], rel=1e-6, abs=1e-13)
            rest = energy - np.polyval(line, states.t)
            assert np.sqrt(np.mean(rest**2)) == pytest.approx(given[rms], rel=1e-6, abs=1e-10)

    def test_predicted_slopes(self):
        found = numbers_of("takahashi-imada-drift")
        given = self.RUNS[self.KEYS[2][2]]["predicted_leading_slope_-(h^4 alpha^2/2)*int/T_rev"]
        assert found.perturbed.slope == pytest.approx(given, rel=1e-10)
        assert found.pendulum.slope == 0
        for errors, sign in ((found.perturbed.forwards, 1), (found.perturbed.backwards, -1)):
            assert takahashi_imada_drift.slope(found.t, errors) == pytest.approx(sign * given, rel=0.02)

    def test_the_caption(self):
        integral = bs.hamiltonians.takahashi_imada_integral(bs.scene("pendulum", effects=["asymmetry"]))
        assert float(integral) / 288 == pytest.approx(pi / 240, rel=1e-15)


class TestLennardJonesDrift:
    def test_the_deviation_grows_like_the_root_of_time(self, atoms):
        """The motion is stationary: changes in a time are as those from the start, but many more."""
        times = np.array([200, 300, 400, 600, 800, 1000])
        deviations = [deviation_in(atoms, time) for time in times]
        assert np.polyfit(np.log(times), np.log(deviations), 1)[0] == pytest.approx(0.5, abs=0.1)
        np.testing.assert_allclose(np.interp(times, atoms.t, atoms.deviation), deviations, rtol=0.4)
        assert atoms.exponent == pytest.approx(0.5, abs=0.25)

    def test_the_deviation_is_of_order_four(self, atoms):
        """s = h⁴ √(2Dt), where runs with h = 0.01 have 2D = 400."""
        assert deviation_in(atoms, 1000) / atoms.h**4 / 1000**0.5 == pytest.approx(20, rel=0.25)

    def test_exponent_and_coefficient(self, atoms):
        law = atoms._replace(deviation=3e-5 * atoms.t**0.5)
        assert (law.exponent, law.coefficient) == (pytest.approx(0.5, abs=1e-4), pytest.approx(3e-5, rel=1e-12))

    def test_the_step_size_at_which_the_lecture_agrees(self, atoms):
        """By the law h⁴ √t, whatever the step size and the length of the run."""
        law = atoms._replace(deviation=3.08e-6 * (atoms.h / 0.005) ** 4 * (atoms.t / 2e4) ** 0.5)
        assert law.lecture_step == pytest.approx(0.005, rel=1e-12)
        assert atoms.lecture_step == pytest.approx(0.01 * (3.08e-6 / (20e-8 * 2e4**0.5)) ** 0.25, rel=0.1)
        assert f"{atoms.lecture_step:.2g}" in lennard_jones_drift.caption(atoms)

    def test_the_mean_is_zero(self, atoms):
        every = slice(100, None, 100)
        assert (abs(atoms.mean[every]) < 3 * atoms.standard_error[every]).all()
        np.testing.assert_allclose(atoms.mean, atoms.single.mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(atoms.deviation, atoms.single.std(axis=0, ddof=1), atol=1e-12)

    def test_the_symplectic_method_does_not_walk(self, monkeypatch, atoms):
        monkeypatch.setattr(lennard_jones_drift, "SIMPLIFIED", lennard_jones_drift.SYMPLECTIC)
        symplectic = lennard_jones_drift.numbers(h=0.02, members=8, span=200)
        assert symplectic.deviation[-50:].mean() < deviation_in(atoms, 200) / 4

    def test_all_trajectories_have_the_same_energy(self):
        atoms, h = bs.scene("lennard-jones"), 0.02
        random = np.random.default_rng(1)
        states = [lennard_jones_drift.start(atoms, bs.runs.thermal_momenta(atoms, 1), h, random) for _ in range(3)]
        energies = [
            bs.integrate("rk4", atoms, h=h, steps=0, y0=y, observe="energy").observed["energy"][0] for y in states
        ]
        at_rest = np.append(np.zeros(18), atoms.y0[18:])
        rest = bs.integrate("rk4", atoms, h=h, steps=0, y0=at_rest, observe="energy").observed["energy"][0]
        np.testing.assert_allclose(energies, rest + lennard_jones_drift.KINETIC, atol=0.05)
        for y in states:
            assert abs(y[:18].reshape(9, 2).sum(axis=0)).max() < 1e-12

    def test_an_interrupted_computation_goes_on(self, tmp_path):
        options = {"h": 0.02, "members": 4, "span": 20}
        seen = []

        def stop(done, total):
            if done == 2:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            lennard_jones_drift.numbers(**options, checkpoint=str(tmp_path), progress=stop)
        assert list(tmp_path.glob("block-*"))
        resumed = lennard_jones_drift.numbers(
            **options, checkpoint=str(tmp_path), progress=lambda done, total: seen.append((done, total))
        )
        assert seen[-1] == (4, 4)
        np.testing.assert_array_equal(resumed.single, lennard_jones_drift.numbers(**options).single)

    def test_it_says_how_far_it_is(self):
        assert [name for name in figure_names() if takes_progress(figure_file(name))] == ["lennard-jones-drift"]

    def test_standard_errors_need_many_trajectories(self, atoms):
        few = atoms._replace(members=lennard_jones_drift.ENOUGH - 1)
        counts = [len(drawn(lennard_jones_drift, numbers).axes[1].lines) for numbers in (atoms, few)]
        assert counts[0] == counts[1] + 1

    def test_the_picture(self, atoms):
        figure = drawn(lennard_jones_drift, atoms)
        assert [axes.get_xlabel() for axes in figure.axes] == ["time $t$", "time $t$"]
        canvas = figure.bbox
        for axes in figure.axes:
            box = axes.get_tightbbox()
            assert canvas.x0 <= box.x0 < box.x1 <= canvas.x1
            assert canvas.y0 <= box.y0 < box.y1 <= canvas.y1

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"h": 0.1}, "h must be a number from 0.002 to 0.02, but was 0.1"),
            ({"members": 1}, "members must be a whole number from 2 to 100000, but was 1"),
            ({"span": 1}, r"span must be a number from 20 to 1e\+06, but was 1"),
            ({"seed": -1}, "seed must be a whole number from 0 to .*, but was -1"),
        ],
    )
    def test_wrong_options(self, options, message):
        with pytest.raises(bs.SeriesError, match=message):
            bs.figure("lennard-jones-drift", **options)


class TestLinearErrorGrowth:
    def test_growth(self):
        found = numbers_of("linear-error-growth")

        def exponent(errors):
            return growth_exponent(found.t, errors, *LATE)

        for errors in (found.symplectic, *found.predicted):
            assert exponent(errors) == pytest.approx(1, abs=0.05)
        assert exponent(found.other) == pytest.approx(2, abs=0.05)
        for changes in (found.actions, *found.new_actions):
            assert exponent(changes) == pytest.approx(0, abs=0.01)
        assert exponent(found.other_actions) == pytest.approx(1, abs=0.02)

    @pytest.mark.parametrize("method", ["lobatto-iiia3", "lobatto-iiia4"])
    def test_symmetric_methods_on_reversible_systems(self, method):
        """They are not symplectic, but errors grow like t and not like t², and the actions do not drift."""
        assert not bs.method(method).is_symplectic
        found = linear_error_growth.numbers(h=0.05, method=method)
        assert growth_exponent(found.t, found.other, *LATE) == pytest.approx(1, abs=0.02)
        assert found.other_actions[-1] < 1.01 * np.interp(30, found.t, found.other_actions) + 1e-12

    def test_each_term_gains_two_powers_of_h(self):
        coarse, fine = linear_error_growth.numbers(h=0.04), numbers_of("linear-error-growth")
        pairs = [
            (coarse.symplectic, fine.symplectic),
            *zip(coarse.predicted, fine.predicted, strict=True),
            (coarse.actions, fine.actions),
            *zip(coarse.new_actions, fine.new_actions, strict=True),
        ]
        t = 300.0
        gains = [np.log2(np.interp(t, coarse.t, a) / np.interp(t, fine.t, b)) for a, b in pairs]
        np.testing.assert_allclose(gains, [2, 4, 6, 2, 4, 6], atol=0.1)

    def test_the_frequencies_have_the_golden_ratio(self):
        change = bs.hamiltonians.harmonic_action_angle(linear_error_growth.OLD, linear_error_growth.NEW, [1, 1])
        system = change.hamiltonian(linear_error_growth.scene())
        omega = bs.integrators.right_hand_side(system)(0.0, np.array(linear_error_growth.START))[2:]
        assert omega[1] / omega[0] == pytest.approx((1 + 5**0.5) / 2, rel=1e-14)

    def test_the_exact_solution(self):
        """Against a reference solution of the equations in Cartesian coordinates."""
        change = bs.hamiltonians.harmonic_action_angle(linear_error_growth.OLD, linear_error_growth.NEW, [1, 1])
        rotors, start = linear_error_growth.scene(), np.array(linear_error_growth.START)
        solution = bs.reference_solution(rotors, 5, y0=change.to_old(start))[:, 0]
        angles = start[2:] + 5 * np.array([1 + start[1] / 2, 1.5 + start[0] / 2])
        np.testing.assert_allclose(solution, change.to_old([*start[:2], *angles]), atol=1e-12)


class TestTheorem3:
    KEY = "theorem3_symplectic_euler_max|H^[N](y_n)-H^[N](y_0)|,t<=100,h=0.2,0.1,0.05"

    def test_given_errors(self):
        found = numbers_of("theorem-3")
        at = [theorem_3.STEP_SIZES.index(h) for h in (0.2, 0.1, 0.05)]
        np.testing.assert_allclose(found.errors[:3, at], list(GIVEN[self.KEY].values()), rtol=1e-6)

    def test_exponents(self):
        np.testing.assert_allclose(numbers_of("theorem-3").exponents, range(1, 9), atol=0.25)

    def test_errors_do_not_grow(self):
        found = numbers_of("theorem-3")
        early = np.array([np.interp(30, found.t, row) for row in found.growth])
        assert (found.growth[:, -1] < 1.2 * early).all()

    def test_a_method_that_is_not_symplectic(self):
        """Negative control: what symplectic Euler conserves, explicit Euler does not."""
        energy = bs.modified_hamiltonian(bs.method(theorem_3.METHOD), bs.scene("pendulum"), 3)
        assert (
            theorem_3.largest_errors(energy, 0.05, 100.0, "explicit-euler")[2, -1]
            > 1e3 * numbers_of("theorem-3").errors[2, 6]
        )


class TestSmallDivisors:
    PERIODS = (4332.59, 10759.2, 30688.5, 60190.0, 90560.0)
    """Sidereal periods in days, from tables of the planets."""

    def test_periods(self):
        periods = 2 * pi / numbers_of("small-divisors").frequencies * 365.25
        np.testing.assert_allclose(periods[:4], self.PERIODS[:4], rtol=2e-4)
        np.testing.assert_allclose(periods[4], self.PERIODS[4], rtol=5e-3)  # it librates for 20,000 years

    def test_neptune_and_pluto_are_in_resonance(self):
        """2ω_N − 3ω_P is minus the rate of Pluto's perihelion, whose period is 3.7 million years."""
        found = numbers_of("small-divisors")
        assert abs(2 * found.frequencies[3] - 3 * found.frequencies[4]) < 4e-6
        assert abs(found.planets.k[4]).tolist() == [0, 0, 0, 2, 3]

    def test_the_great_inequality(self):
        """Its period is about 880 years."""
        jupiter, saturn = numbers_of("small-divisors").frequencies[:2]
        assert 2 * pi / abs(2 * jupiter - 5 * saturn) == pytest.approx(883, rel=0.02)

    def test_all_k(self):
        """Against a plain search."""
        omega = np.array([1.0, 2**0.5, 3**0.5])
        found = small_divisors.divisors(omega, 6)
        grid = np.array(np.meshgrid(*[range(-6, 7)] * 3)).reshape(3, -1)
        for norm, least, k in zip(*found, strict=True):
            chosen = grid[:, abs(grid).sum(axis=0) == norm]
            assert least == pytest.approx(abs(omega @ chosen).min(), abs=1e-14)
            assert (abs(k).sum(), k @ omega) == (norm, pytest.approx(least, abs=1e-14))

    def test_gamma(self):
        found = numbers_of("small-divisors").giants
        assert (found.least >= found.gamma * found.norm**-3.0 * (1 - 1e-14)).all()
        assert found.nu == 3

    def test_golden_ratio(self):
        """Nothing is further from resonance: |k₁ + k₂ φ| |k| does not go to zero."""
        found = small_divisors.divisors(np.array([1.0, (1 + 5**0.5) / 2]), 30)
        assert found.gamma > 0.7
