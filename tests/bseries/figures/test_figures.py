"""The lecture's figures: their numbers against values from outside and against laws; drawing and saving."""

from __future__ import annotations

import csv
import io
import json
import math
import subprocess
import sys
from base64 import b64decode
from hashlib import sha256
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from quick_figures import numbers_of

import bseries as bs
from bseries.figures import (
    energy_error,
    lotka_volterra,
    optimal_truncation,
    pendulum_portraits,
    riccati,
    toda,
    truncation,
)
from bseries.figures.helpers import truncated_scene
from bseries.figures.registry import drawn, figure_file, figure_names, options_of
from bseries.picture_files import data_rows, picture_format
from bseries_base.plotting import FORMATS, new_figure, picture
from bseries_base.table import csv_lines

pytest.importorskip("matplotlib")

ROOT = Path(__file__).parents[3]
LECTURE = json.loads((ROOT / "tests" / "reference" / "lecture_values.json").read_text())
LONG = {"lennard-jones-drift"}


def figures():
    return [name for name in figure_names() if name not in LONG]


def gap(curve, points):
    """How far points are from a curve at most."""
    places = np.arange(curve.shape[1])
    fine = np.array([np.interp(np.linspace(0, places[-1], 20 * len(places)), places, row) for row in curve])
    return np.linalg.norm(fine[:, None] - points[:, :, None], axis=0).min(axis=1).max()


class TestRiccati:
    GIVEN = LECTURE["example1_and_fig1"]["figure1"]

    def test_steps(self):
        found = numbers_of("riccati")
        at = [round(t / found.h) for t in self.GIVEN["t"]]
        np.testing.assert_allclose(found.y[at], np.array(self.GIVEN["numerical"], float), rtol=1e-11)

    @pytest.mark.parametrize("terms", [1, 2, 3, 4])
    def test_truncated_solutions(self, terms):
        found = numbers_of("riccati")
        t, y = found.truncated[terms]
        compared = 0
        for time, row in zip(self.GIVEN["t"], self.GIVEN["truncated_1_2_3_4_terms"], strict=True):
            at = round(time / found.h) * riccati.FINE
            if at < len(t) - 1:
                assert t[at] == pytest.approx(time, rel=1e-14)
                assert y[at] == pytest.approx(float(row[terms - 1]), rel=1e-9)
                compared += 1
        assert compared >= 4

    def test_one_term_is_the_exact_solution(self):
        t, y = numbers_of("riccati").truncated[1]
        np.testing.assert_allclose(y, 1 / (1 - t), rtol=1e-12)

    @pytest.mark.parametrize("h", [0.002, 0.01, 0.1])
    def test_any_step_fills_the_picture(self, h):
        found = riccati.numbers(h=h)
        assert found.y[-1] > riccati.REACH / h
        for t, y in found.truncated.values():
            assert y[-1] == pytest.approx(riccati.REACH / h, rel=1e-9)
            assert (np.diff(t) > 0).all()
            assert (np.diff(y) > 0).all()


class TestLotkaVolterra:
    GIVEN = LECTURE["figures_2_to_7"]["figure2_3"]
    KEYS = (("explicit-euler", "explicit_euler"), ("symplectic-euler-p", "symplectic_euler_p_implicit"))

    @pytest.mark.parametrize(("method", "key"), KEYS)
    def test_steps(self, method, key):
        given = np.array(self.GIVEN[key]["y_n(t=1,2,5,10) [p,q]"], float)
        k = [name for name, _ in self.KEYS].index(method)
        for states in (numbers_of("lotka-volterra").steps[k][0], numbers_of("truncation").steps[k]):
            np.testing.assert_allclose(states[:, [10, 20, 50, 100]].T, given, rtol=1e-11)

    @pytest.mark.parametrize(("method", "key"), KEYS)
    def test_distances_from_truncated_solutions(self, method, key):
        k = [name for name, _ in self.KEYS].index(method)
        found = truncation.numbers(terms=5).distances(k)[:, [10, 20, 50, 100]]
        given = np.array([self.GIVEN[key][f"N={n}"] for n in range(1, 6)], float)
        np.testing.assert_allclose(found, given, rtol=2e-5)

    def test_distances_are_of_the_order_of_the_terms(self):
        coarse, fine = truncation.numbers(h=0.04), truncation.numbers(h=0.02)
        for k in range(2):
            distances = [found.distances(k)[:, round(2 / found.h)] for found in (coarse, fine)]
            np.testing.assert_allclose(np.log2(distances[0] / distances[1]), [1, 2, 3], atol=0.12)

    def test_which_curves_are_closed(self):
        """The modified equation of symplectic Euler has closed curves as the exact one; that of explicit Euler not."""
        found = numbers_of("lotka-volterra")
        explicit, symplectic = found.modified
        assert all(curve.is_closed for curve in (*found.exact, *symplectic))
        for curve in explicit:
            assert not curve.is_closed
            from_rest = np.linalg.norm(curve.states - np.array([[1], [2]]), axis=0)
            assert from_rest[-1] > 10 * from_rest[0]

    def test_spirals_end_at_the_frame(self):
        for curve in numbers_of("lotka-volterra").modified[0]:
            last, before = curve.states[:, -1], curve.states[:, -2]
            assert (last > lotka_volterra.LEAVES).any()
            assert (before < lotka_volterra.LEAVES).all()

    def test_steps_lie_on_the_modified_flow(self):
        found = numbers_of("lotka-volterra")
        for runs, curves in zip(found.steps, found.modified, strict=True):
            for curve, exact, states in zip(curves, found.exact, runs, strict=False):
                gaps = [gap(flow.states, states[:, :60]) for flow in (curve, exact)]
                assert gaps[0] < gaps[1] / 3

    def test_the_periods_of_the_caption(self):
        """The time from (2, 2) back to q = 2: of the given equations, after h, after h², and of the steps."""
        scene, method = bs.scene("lotka-volterra"), "symplectic-euler-p"
        for terms, given in ((1, "4.615"), (2, "4.620"), (3, "4.591")):
            t, flow = float(given), truncated_scene(method, scene, terms, 0.1)
            (p,), (q,) = bs.reference_solution(flow, t, y0=truncation.START)
            t -= (q - 2) / bs.integrators.right_hand_side(flow)(0.0, np.array([p, q]))[1]
            assert f"{t:.3f}" == given
            assert given in truncation.caption(numbers_of("truncation"))
        p, q = bs.integrate(method, scene, h=0.1, steps=20_000, y0=truncation.START).y
        angle = np.unwrap(np.arctan2(q - 2, p - 1))
        assert 2000 * 2 * np.pi / abs(angle[-1] - angle[0]) == pytest.approx(4.594, abs=1e-3)
        assert "4.594 for the steps" in truncation.caption(numbers_of("truncation"))
        assert np.isnan(numbers_of("truncation").periods[0][[0, 2]]).all()  # explicit Euler spirals


class TestPendulumPortraits:
    GIVEN = LECTURE["figures_2_to_7"]["figure4"]

    def test_explicit_euler(self):
        given = self.GIVEN["explicit_euler h=0.2 (p,q)=(0,0.5), 50 steps"]
        self.check(0, 0, given)
        assert (np.diff(numbers_of("pendulum-portraits").portraits[0].energies[0]) > 0).all()

    @pytest.mark.parametrize(
        ("method", "key"),
        [
            (1, "symplectic_euler(p_implicit) h=0.3, q0=0, 1000 steps"),
            (2, "stoermer_verlet(UTU) h=0.6, q0=0, 1000 steps"),
        ],
    )
    def test_symplectic_methods(self, method, key):
        for start, p in enumerate(("0.7", "1.4", "2.1")):
            self.check(method, start, self.GIVEN[key][p])

    def check(self, method, start, given):
        found = numbers_of("pendulum-portraits").portraits[method]
        energy = found.energies[start]
        assert energy[0] == pytest.approx(given["H0"], rel=1e-14)
        assert abs(energy - energy[0]).max() == pytest.approx(given["max|H-H0|"], rel=1e-9)
        np.testing.assert_allclose(found.runs[start][:, -1], given["final_(p,q)"], rtol=1e-8)

    def test_level_curves(self):
        p, q = numbers_of("pendulum-portraits").levels.transpose(1, 0, 2)
        energies = p**2 / 2 - np.cos(q)
        np.testing.assert_allclose(energies, energies[:, :1] + 0 * energies, atol=1e-12)
        assert sorted({round(energy, 9) for energy in energies[:, 0]}) == sorted(pendulum_portraits.LEVELS)


class TestEnergyError:
    GIVEN = LECTURE["figures_2_to_7"]["figure5"]

    def test_errors(self):
        found = numbers_of("energy-error")
        explicit, symplectic = (run.errors for run in found.runs)
        at = [round(t / found.h) for t in self.GIVEN["t"]]
        np.testing.assert_allclose(explicit[at], self.GIVEN["explicit_euler_H-H0"], rtol=1e-9)
        np.testing.assert_allclose(symplectic[at], self.GIVEN["symplectic_euler_p_implicit_H-H0"], rtol=1e-9)
        for errors, key in (
            (explicit, "explicit_euler_min_max_over_[0,200]"),
            (symplectic, "symplectic_euler_p_implicit_min_max_over_[0,200]"),
        ):
            assert [errors.min(), errors.max()] == pytest.approx(self.GIVEN[key], rel=1e-9)

    def test_predictions(self):
        explicit, symplectic = numbers_of("energy-error").runs
        assert explicit.slope == pytest.approx(
            self.GIVEN["prediction_explicit_mean_slope_h/2*<p^2 cos q+sin^2 q>"], rel=1e-12
        )
        amplitude = self.GIVEN["prediction_symplectic_amplitude_h/2*max|p sin q|"]
        np.testing.assert_allclose(symplectic.band, (-amplitude, amplitude), rtol=1e-3)
        assert symplectic.slope == 0
        assert np.isnan(explicit.band).all()

    @pytest.mark.parametrize("h", [0.0025, 0.02])
    def test_both_errors_are_proportional_to_the_step(self, h):
        found = energy_error.numbers(h=h)
        explicit, symplectic = found.runs
        assert abs(symplectic.errors).max() == pytest.approx(symplectic.band[1], rel=2 * h)
        early = found.t <= 20
        assert np.polyfit(found.t[early], explicit.errors[early], 1)[0] == pytest.approx(explicit.slope, rel=0.2)


class TestToda:
    GIVEN = LECTURE["figure9_toda"]
    KEYS = ((0, "RK4 h=0.08"), (1, "Stoermer-Verlet UTU (kick-drift-kick) h=0.02"))

    @pytest.mark.parametrize(("method", "key"), KEYS)
    def test_errors(self, method, key):
        found = numbers_of("toda")[method]
        for label, given in self.GIVEN[key].items():
            if label.startswith("t="):
                at = round(float(label[2:]) / found.h)
                assert found.t[at] == pytest.approx(float(label[2:]), rel=1e-14)
                for errors, kind in ((found.eigenvalues, "eig_error_euclid"), (found.solution, "global_error")):
                    now = given.get(kind, given.get("global_error_euclid(p,q)"))
                    every = self.every(method, errors is found.solution)
                    assert errors[at] == pytest.approx(now, rel=1e-8)
                    assert errors[: at + 1 : every].max() == pytest.approx(given[f"running_max_{kind}"], rel=1e-8)

    @pytest.mark.parametrize(("method", "key"), KEYS)
    def test_growth(self, method, key):
        found = numbers_of("toda")[method]
        shown = slice(None, None, self.every(method, True))
        solution = toda.growth_exponent(found.t[shown], found.solution[shown])
        values = toda.growth_exponent(found.t, found.eigenvalues)
        assert solution == pytest.approx(
            self.GIVEN[key]["growth_exponent_global_error_(log-log fit running max, 10<=t<=100)"], abs=1e-6
        )
        assert values == pytest.approx(self.GIVEN[key]["growth_exponent_eigenvalue_error"], abs=1e-6)

    @staticmethod
    def every(method, is_solution):
        """The reference has the global error of Störmer–Verlet at every other step only."""
        return 2 if is_solution and method == 1 else 1

    def test_eigenvalues(self):
        """tr L and tr L² are −Σ p/2 and H/2 for any number of particles; for n = 3 see the reference."""
        start = bs.scene("toda").y0[:, None]
        np.testing.assert_allclose(toda.eigenvalues(start)[0], np.array(self.GIVEN["eigenvalues_L"], float), rtol=1e-14)
        states = np.random.default_rng(1).normal(size=(10, 4))
        p, q = np.split(states, 2)
        energy = (p**2 / 2 + np.exp(q - np.roll(q, -1, axis=0))).sum(axis=0)
        values = toda.eigenvalues(states)
        np.testing.assert_allclose(values.sum(axis=1), -p.sum(axis=0) / 2, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose((values**2).sum(axis=1), energy / 2, rtol=1e-12)

    def test_eigenvalues_stay_on_exact_solutions_only(self):
        exact = bs.reference_solution(bs.scene("toda"), [0, 1, 5, 10])
        np.testing.assert_allclose(toda.eigenvalues(exact), toda.eigenvalues(exact[:, :1]).repeat(4, 0), rtol=1e-13)
        assert numbers_of("toda")[0].eigenvalues[-1] > 0.01


class TestOptimalTruncation:
    def test_quadrature_against_the_euler_maclaurin_formula(self):
        """One step of the trapezoidal rule less ∫ and the terms B_k/k! h^k [g^(k−1)]; g = Re 1/(t + i)."""
        mpmath = pytest.importorskip("mpmath")
        found = numbers_of("optimal-truncation").quadrature
        with mpmath.workdps(40):
            for h, errors in list(zip(found.h, found.errors, strict=True))[::4]:
                h = mpmath.mpf(float(h))

                def g(t, k=0):
                    return ((-1) ** k * mpmath.factorial(k) / (t + 1j) ** (k + 1)).real

                rest = h * (g(0) + g(h)) / 2 - mpmath.log(1 + h**2) / 2
                expected = [abs(rest)]
                for k in range(2, found.terms[-1], 2):
                    rest -= mpmath.bernoulli(k) / mpmath.factorial(k) * h**k * (g(h, k - 1) - g(0, k - 1))
                    expected.append(abs(rest))
                count = sum(error < 1 for error in expected)  # beyond, quadratures of 34th derivatives are rough
                np.testing.assert_allclose(errors[:count], np.array(expected[:count], float), rtol=1e-7, atol=3e-16)

    def test_quadrature_obeys_the_laws(self):
        """N = 2πδ/h to within 1, and an error below exp(−2πδ/h) that falls as fast."""
        found = numbers_of("optimal-truncation").quadrature
        assert (abs(found.best - found.x) <= 1).all()
        assert (abs(found.expected - found.x) <= 1).all()
        scaled = found.least * np.exp(found.x)
        assert (scaled < 1).all()
        assert np.polyfit(found.x, np.log(found.least), 1)[0] == pytest.approx(-1, abs=0.1)

    def test_pendulum_obeys_the_laws(self):
        found = optimal_truncation.numbers(terms=13).pendulum
        inside = found.x <= 13
        assert (abs(found.best - found.x)[inside] <= 3).all()
        assert (abs(found.expected - found.x)[inside] <= 1).all()
        # C h^(−3) exp(−x): the power belongs to the poles of p
        scaled = (found.least * np.exp(found.x) * found.h**3)[inside]
        assert scaled.max() < 1.4 * scaled.min()

    def test_first_truncations_have_errors_of_their_orders(self):
        """Negative control: a fixed N gives a power of h only, here h^(N+2) for odd N."""
        found = numbers_of("optimal-truncation").pendulum
        for column, n in enumerate(found.terms[:2]):
            slope = np.polyfit(np.log(found.h[-3:]), np.log(found.errors[-3:, column]), 1)[0]
            assert slope == pytest.approx(n + 2, abs=0.8)

    def test_distance_of_the_singularities(self):
        """For H > 1, q/2 is the amplitude function of pt/2 with modulus k = 2/p, and its poles lie at iK'."""
        special = pytest.importorskip("scipy.special")
        p = optimal_truncation.PENDULUM_START[0]
        expected = special.ellipk(1 - (2 / p) ** 2) * 2 / p
        assert optimal_truncation.pendulum_distance() == pytest.approx(expected, rel=1e-13)


def test_names():
    names = figure_names()
    assert names == bs.figure_names()
    own = ["riccati", "lotka-volterra", "truncation", "pendulum-portraits", "energy-error", "toda"]
    assert [name for name in names if name in own] == own
    assert "optimal-truncation" in names
    assert not {"style", "registry", "animations", "options", "helpers"} & set(names)
    assert figure_file("Energy_Error") is energy_error
    assert figure_file("lotka-volterra") is lotka_volterra


@pytest.mark.parametrize("name", figures())
def test_files_say_what_they_show(name):
    file = figure_file(name)
    assert len(file.TITLE) < 120
    caption = file.caption(numbers_of(name))
    assert caption.endswith(".")
    assert (f"Lecture, figure {file.NUMBER}" in caption) == (file.NUMBER is not None)
    width, height = file.SIZE
    assert 8 <= width <= 17
    assert 5 <= height <= 23


def is_whole(figure):
    """Whether nothing that is drawn is cut off at the edges of the picture."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    shown = figure.get_tightbbox(FigureCanvasAgg(figure).get_renderer())
    return bool((shown.min >= 0).all() and (shown.max <= figure.get_size_inches()).all())


def test_notebooks_show_figures_with_captions():
    figure = bs.figure("riccati")
    assert isinstance(figure, type(new_figure((1, 1))))
    assert figure._repr_png_().startswith(b"\x89PNG")
    image, caption = ElementTree.fromstring(figure._repr_html_())
    assert b64decode(image.attrib["src"].removeprefix("data:image/png;base64,")) == figure._repr_png_()
    assert caption.text == riccati.caption(numbers_of("riccati"))


def test_captions_are_text_and_not_html():
    figure = new_figure((8, 5), "a < b & c")
    assert isinstance(figure, type(new_figure((1, 1))))
    assert "<figcaption>a &lt; b &amp; c</figcaption>" in figure._repr_html_()
    figure.caption = ""
    assert "figcaption" not in figure._repr_html_()


def test_what_is_cut_off_would_be_noticed():
    figure = bs.figure("riccati")
    assert is_whole(figure)
    figure.axes[0].set_title("a title that is much too long " * 5)
    assert not is_whole(figure)


@pytest.mark.slow
@pytest.mark.parametrize("name", figures())
def test_pictures_are_complete(name):
    """Axes have labels, and no text is cut off or tiny."""
    from matplotlib.text import Text

    figure = drawn(figure_file(name), numbers_of(name))
    assert np.allclose(figure.get_size_inches() * 2.54, figure_file(name).SIZE)
    assert is_whole(figure)
    assert all(text.get_fontsize() >= 6 for text in figure.findobj(Text))
    for axes in (axes for axes in figure.axes if axes.axison):  # a diagram has no scales
        place = axes.get_subplotspec()
        assert any(other.get_xlabel() for other in figure.axes if other.get_subplotspec().colspan == place.colspan)
        assert any(other.get_ylabel() for other in figure.axes if other.get_subplotspec().rowspan == place.rowspan)


@pytest.mark.slow
@pytest.mark.parametrize("name", figures())
def test_columns_survive_csv(name):
    columns = figure_file(name).columns(numbers_of(name))
    text = "".join(csv_lines(list(columns), data_rows(columns)))
    rows = list(csv.reader(io.StringIO(text)))
    assert rows[0] == list(columns)
    for k, column in enumerate(columns.values()):
        cells = [row[k] for row in rows[1:]]
        assert not any(cells[len(column) :])
        np.testing.assert_array_equal(np.array(cells[: len(column)], float), column)


@pytest.mark.slow
def test_the_same_bytes_each_time():
    """Also from another process, with other hashes and whatever settings the user has."""
    code = (
        "import matplotlib; matplotlib.rcParams['font.size'] = 20\n"
        "from bseries.figures.registry import compute, drawn, figure_file\n"
        "from bseries_base.plotting import FORMATS, picture\n"
        "from hashlib import sha256\n"
        "file = figure_file('riccati')\n"
        "figure = drawn(file, compute(file, {}))\n"
        "print(*(sha256(picture(figure, format_)).hexdigest() for format_ in FORMATS))"
    )
    other = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    figure = drawn(figure_file("riccati"), numbers_of("riccati"))
    assert other.split() == [sha256(picture(figure, format_)).hexdigest() for format_ in FORMATS]


def test_drawing_leaves_the_settings_alone():
    import matplotlib

    before = dict(matplotlib.rcParams)
    picture(bs.figure("riccati"), "svg")
    assert dict(matplotlib.rcParams) == before


def test_figure_takes_options():
    assert "0.04" in bs.figure("riccati", h=0.04).axes[0].get_legend().get_texts()[-1].get_text()
    assert options_of(figure_file("truncation")) == {
        "h": 0.1,
        "terms": 3,
        "methods": ("explicit-euler", "symplectic-euler-p"),
        "y0": (2.0, 2.0),
    }


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("nothing", {}, "name must be one of riccati, lotka-volterra, .*, but was 'nothing'"),
        ("style", {}, "name must be one of riccati, .*, but was 'style'"),
        ("../riccati", {}, "name must be one of"),
        (None, {}, "name must be one of .*, but was None"),
        ("riccati", {"step": 1}, "option must be one of h, method, but was 'step'"),
        ("toda", {"h": 1}, "h must be 2 numbers, but was 1"),
        ("riccati", {"h": 0}, "h must be a number from 0.002 to 0.1, but was 0"),
        ("riccati", {"h": math.nan}, "h must be a number from 0.002 to 0.1, but was nan"),
        ("riccati", {"h": "1/5"}, "h must be a number from 0.002 to 0.1, but was '1/5'"),
        ("riccati", {"h": True}, "h must be a number from 0.002 to 0.1, but was True"),
        ("riccati", {"h": 10**400}, "h must be a number from 0.002 to 0.1, but was 1000"),
        ("lotka-volterra", {"h": 1}, "h must be a number from 0.005 to 0.12, but was 1"),
        ("truncation", {"terms": 2.5}, "terms must be a whole number from 1 to 6, but was 2.5"),
        ("truncation", {"terms": 100}, "terms must be a whole number from 1 to 6, but was 100"),
        ("energy-error", {"h": -1}, "h must be a number from 0.0005 to 0.5, but was -1"),
        ("optimal-truncation", {"terms": 1}, "terms must be a whole number from 5 to 19, but was 1"),
    ],
)
def test_bad_arguments(name, options, message):
    with pytest.raises(bs.errors, match=message):
        bs.figure(name, **options)


@pytest.mark.parametrize("path", ["a", "a.jpg", "png", ".png/a", "a.png.txt"])
def test_unknown_endings(path):
    with pytest.raises(bs.SeriesError, match="must be one of png, svg, pdf, but was"):
        picture_format(path)
    assert picture_format("a.PDF") == "pdf"
