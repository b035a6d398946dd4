"""Options of figures, captions that follow them, pictures in grey, fonts, and registry."""

from __future__ import annotations

import re
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from quick_figures import numbers_of

import bseries as bs
from bseries.figures import area_patch, energy_error, lotka_volterra, registry, riccati, toda, truncation
from bseries.figures.options import read_count, read_methods, read_number, read_numbers, read_start, read_starts
from bseries.figures.registry import animate, compute, drawn, figure_file, figure_names
from bseries_base.plotting import BLUE, GREEN, ORANGE, VERMILION, new_figure, picture, print_style
from integrators.methods.catalogue.registry import catalogue
from integrators.runs.titles import printed_name

pytest.importorskip("matplotlib")

OTHERS = [
    ("riccati", {"method": "implicit-midpoint", "h": "1/20"}, ["implicit midpoint", "h = 0.05", "1, 3, 5 and 7 terms"]),
    ("lotka-volterra", {"methods": "implicit-euler,rk4", "y0": "3,1"}, ["(3, 1)", "both methods are spirals", "h⁴"]),
    ("truncation", {"methods": "implicit-euler,symplectic-euler-q", "terms": 2}, ["(implicit q) grow", "(2, 2)"]),
    ("pendulum-portraits", {"h": "0.1,0.2,1/4", "y0": "p=1;q=1/2"}, ["h = 0.25 from (1, 0.5)"]),
    ("energy-error", {"methods": "stormer-verlet,rk4", "y0": "1,1", "h": "1/10"}, ["RK4 the energy drifts", "at h²"]),
    (
        "large-steps",
        {"method": "stormer-verlet", "h": "1/2,1", "y0": "1,0", "steps": 200},
        ["Störmer–Verlet", "(h = |)"],
    ),
    ("takahashi-imada-drift", {"p": 3, "h": "1/10", "span": 100}, ["p = ±3", "h = 0.1"]),
    ("toda", {"methods": "implicit-midpoint,kutta3", "h": "1/10,1/20"}, ["h = 0.1: the eigenvalues", "Kutta 3"]),
    ("linear-error-growth", {"method": "heun3", "h": "1/20"}, ["Heun 3", "h = 0.05"]),
    ("area-patch", {"scene": "lotka-volterra", "y0": "2,3", "size": 1, "steps": 4}, ["Lotka–Volterra", "(2, 3)"]),
    ("theorem-3", {"method": "stormer-verlet", "terms": 2, "y0": "1,0"}, ["Störmer–Verlet (KDK)", "(1, 0)"]),
    ("small-divisors", {"reach": "5"}, ["γ"]),
]


@pytest.mark.few(3)
@pytest.mark.parametrize(("name", "options", "said"), OTHERS, ids=[name for name, _, _ in OTHERS])
def test_figures_take_options(name, options, said):
    """The caption says what was drawn, and the picture can be drawn."""
    figure = bs.figure(name, **options)
    for text in said:
        assert re.search(text if "|" in text else re.escape(text), figure.caption), figure.caption
    assert picture(figure, "png").startswith(b"\x89PNG")


def test_objects_and_text_are_the_same():
    first = riccati.numbers(h="1/20", method="rk4")
    second = riccati.numbers(h=0.05, method=bs.method("rk4"))
    np.testing.assert_array_equal(first.y, second.y)
    assert riccati.caption(first) == riccati.caption(second)


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("area-patch", {"methods": "{},{}", "steps": 4}),
        ("energy-error", {"methods": "{},{}", "span": 10}),
        ("lotka-volterra", {"methods": "{},{}"}),
        ("pendulum-portraits", {"methods": "{},{},{}"}),
        ("toda", {"methods": "{},{}"}),
        ("truncation", {"methods": "{},{}", "terms": 1}),
    ],
)
def test_a_method_twice_has_all_its_columns(name, options):
    """With two step sizes, for instance; its columns replaced each other."""
    file = figure_file(name)
    counts = []
    for names in (("rk4", "rk4", "rk4"), ("rk4", "rk38", "kutta3")):
        given = {**options, "methods": options["methods"].format(*names)}
        counts.append(len(file.columns(compute(file, given))))
    assert counts[0] == counts[1]


class TestCaptions:
    """They state no law that does not hold for what was drawn."""

    def test_closed_curves(self):
        lecture, other = lotka_volterra.numbers(), lotka_volterra.numbers(methods="explicit-euler,implicit-euler")
        assert (
            "explicit Euler are spirals, those of symplectic Euler (implicit p) are closed"
            in lotka_volterra.caption(lecture)
        )
        assert "closed" not in lotka_volterra.caption(other)
        assert [len(row) for row in other.starts] == [1, 1]

    def test_theorem_7_is_about_symplectic_methods(self):
        assert toda.caption(toda.numbers()).count("theorem 7") == 1
        assert "theorem 7" not in toda.caption(toda.numbers(methods="rk4,lobatto-iiia3", h="0.1,0.1"))

    def test_periods_are_of_periodic_solutions(self):
        text = truncation.caption(truncation.numbers(methods="explicit-euler,implicit-euler", terms=2))
        assert "periods" not in text

    def test_drift_and_band(self):
        first, second = energy_error.numbers(methods="rk4,gauss2", h=0.2, y0=(1, 0.5)).runs
        assert first.slope == bs.energy_drift("rk4", "pendulum", y0=[1, 0.5], h=0.2).slope() != 0
        assert second.slope == 0
        low, high = second.band
        assert low < second.errors.min() * 0.9
        assert second.errors.max() == pytest.approx(high, rel=0.05, abs=0.05 * abs(low))

    def test_the_area_is_multiplied(self):
        found = area_patch.numbers(steps=4)
        explicit, symplectic = found.carried
        assert area_patch.areas(symplectic.steps)[-1] == pytest.approx(area_patch.areas(found.exact)[0], rel=2e-3)
        # each explicit Euler step multiplies areas by det = 1 + h² cos q
        q = explicit.steps[:-1, 1].mean(axis=1)
        factor = float(np.prod(1 + found.h**2 * np.cos(q)))
        found_factor = area_patch.areas(explicit.steps)[-1] / area_patch.areas(explicit.steps)[0]
        assert found_factor == pytest.approx(factor, rel=0.02)
        assert f"{found_factor:.3g} by explicit Euler" in area_patch.caption(found)

    def test_the_modified_flow_carries_the_patch_as_the_method_does(self):
        found = area_patch.numbers(steps=4)
        for carried in found.carried:
            steps, exact, modified = carried.steps[-1], found.exact[-1], carried.modified[-1]
            assert abs(steps - modified).max() < abs(steps - exact).max() / 5

    def test_distances_of_riccati(self):
        t, distances = riccati.numbers(method="rk4", h=0.1).distances()
        assert distances == sorted(distances, reverse=True)
        assert t < 1


class TestReaders:
    @pytest.mark.parametrize(
        ("read", "message"),
        [
            (lambda: read_number("0", "h", 0.1, 1), "h must be a number from 0.1 to 1, but was '0'"),
            (lambda: read_number("x", "h", 0, 1), "h must be a number, but 'x' has the unknown name"),
            (lambda: read_number(None, "h", 0, 1), "h must be a number from 0 to 1, but was None"),
            (lambda: read_number(True, "h", 0, 1), "h must be a number from 0 to 1, but was True"),
            (lambda: read_number("9**9**9**9", "h", 0, 1), "h must"),
            (lambda: read_count("5/2", "terms", 1, 6), "terms must be a whole number from 1 to 6, but was '5/2'"),
            (lambda: read_count(2.0, "terms", 1, 6), "terms must be a whole number from 1 to 6, but was 2.0"),
            (lambda: read_numbers("1,2", "h", [3], 0, 9), "h must be 3 numbers, but was '1,2'"),
            (lambda: read_methods("rk4", 2), "methods must be 2 names, but was 'rk4'"),
            (lambda: read_methods("rk4,rk5", 2), "name must be a method of the catalogue, but was 'rk5'"),
            (lambda: read_methods(["rk4", 5], 2), "method must be a method such as"),
            (lambda: read_start("1", bs.scene("pendulum")), "y0 must have numbers for p, q of pendulum"),
            (lambda: read_starts("1,1;2,2;3,3", bs.scene("pendulum"), [1, 2]), "y0 must be 1 to 2 starts"),
            (lambda: read_start("1,inf", bs.scene("pendulum")), "y0 must be a number, but 'inf' is not finite"),
            (
                lambda: read_start("0,0,0,0", bs.scene("kepler")),
                "y0 must be a state at which the field of kepler is fin",
            ),
        ],
    )
    def test_one_sentence(self, read, message):
        with pytest.raises(bs.errors, match=re.escape(message)) as caught:
            read()
        assert "\n" not in str(caught.value)

    def test_starts(self):
        scene = bs.scene("pendulum")
        wanted = ((1.0, 0.5),)
        for given in ("1,1/2", "p=1; q=1/2", (1, 0.5), [[1, 0.5]], np.array([1, 0.5]), ("1", "1/2")):
            assert read_starts(given, scene, [1]) == wanted

    def test_whole_numbers_stay_exact(self):
        assert read_count(str(2**62 + 1), "seed", 0, 2**63) == 2**62 + 1
        assert read_count(np.int64(3), "terms", 1, 6) == 3


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        (
            "large-steps",
            {"method": "rk4"},
            "method must have a modified Hamiltonian on the pendulum, but that of RK4 ends",
        ),
        ("theorem-3", {"method": "rk4"}, "method must be symplectic on pendulum"),
        ("energy-error", {"y0": "0,0"}, "y0 must not be an equilibrium"),
        ("energy-error", {"y0": "2,0"}, "y0 must lie on a closed orbit"),
        ("energy-error", {"h": "0.0005", "span": 1e5}, "span/h must be at most 10,000,000 steps"),
        ("truncation", {"y0": "1,2"}, "y0 must have positive p and q and must not be the equilibrium"),
        ("lotka-volterra", {"y0": "9,2"}, "p of y0 must be a number from 0.01 to 5"),
        ("area-patch", {"scene": "kepler"}, "scene must have two variables, but kepler has 4"),
        ("area-patch", {"scene": "nothing"}, "scene must be one of the catalogue, but was 'nothing'"),
        ("area-patch", {"h": 0}, "h must be a number from 0.0001 to 10, but was 0"),
        ("riccati", {"method": "gauss4", "h": "1/50"}, "method must have an error among the terms up to h^8"),
        ("riccati", {"method": "symplectic-euler-p"}, "scene must have blocks or parts for p, q"),
        ("takahashi-imada-drift", {"p": 1}, "p must be a number from 2.3 to 4, but was 1"),
    ],
)
def test_options_that_make_no_sense(name, options, message):
    with pytest.raises(bs.errors, match=re.escape(message)) as caught:
        compute(figure_file(name), options)
    assert "\n" not in str(caught.value)


def test_printed_names():
    """Every name of the catalogues is printed without hyphens, and no two names alike; others are left alone."""
    names = [entry.name + ("3" if entry.is_family else "") for entry in catalogue()]
    printed = [printed_name(name) for name in names]
    assert len(set(printed)) == len(names)
    scenes = [printed_name(entry.name) for entry in bs.scene_catalogue()]
    assert [name for name in (*printed, *scenes) if "-" in name] == ["n-body", "Lennard-Jones"]
    for other in ("my-method", "run-1.csv", "", "a", "explicit-euler.json", "rk4 with r = 2"):
        assert printed_name(other) == other


def luminance(colour):
    """The grey that a colour is printed as, from 0 to 1 (ITU-R BT.601, as picture libraries convert)."""
    from matplotlib.colors import to_rgb

    return float(np.dot(to_rgb(colour), (0.299, 0.587, 0.114)))


def alike_in_grey(figure):
    """Pairs of labelled curves in one panel that differ in colour only, and too little in grey."""
    pairs = []
    for axes in figure.axes:
        lines = [line for line in axes.lines if not str(line.get_label()).startswith("_")]
        for one, other in combinations(lines, 2):
            shapes = [(line.get_marker(), line._unscaled_dash_pattern, line.get_fillstyle()) for line in (one, other)]
            difference = abs(luminance(one.get_color()) - luminance(other.get_color()))
            if one.get_label() != other.get_label() and shapes[0] == shapes[1] and difference < 0.2:
                pairs.append((one.get_label(), other.get_label()))
    return pairs


SLOW = {"lennard-jones-drift": pytest.mark.slow}


@pytest.mark.few(4)
@pytest.mark.parametrize("name", [pytest.param(name, marks=SLOW.get(name, ())) for name in figure_names()])
def test_pictures_can_be_read_in_grey(name):
    figure = drawn(figure_file(name), numbers_of(name))
    assert not alike_in_grey(figure)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    if len(titles) > 1:
        assert [title[:3] for title in titles] == [f"({letter})" for letter in "abcdefghi"[: len(titles)]]


def test_colours_alike_in_grey_would_be_noticed():
    figure = new_figure((8, 5))
    axes = figure.add_subplot()
    for colour, label in ((GREEN, "green"), (VERMILION, "vermilion"), (BLUE, "blue"), (ORANGE, "orange")):
        axes.plot([0, 1], [0, 1], color=colour, label=label)
    assert ("green", "vermilion") in alike_in_grey(figure)
    assert ("blue", "orange") not in alike_in_grey(figure)
    axes.lines[0].set_linestyle("--")
    assert ("green", "vermilion") not in alike_in_grey(figure)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["riccati", "takahashi-imada-drift"])
def test_fonts_are_truetype(name):
    """Printers refuse Type 3 fonts."""
    figure = drawn(figure_file(name), numbers_of(name))
    content = picture(figure, "pdf")
    assert b"/FontFile2" in content
    assert b"/Type3" not in content

    from io import BytesIO

    from matplotlib import rc_context
    from matplotlib.figure import Figure

    other = BytesIO()
    with print_style(), rc_context({"pdf.fonttype": 3}):
        Figure.savefig(figure, other, format="pdf")
    assert b"/Type3" in other.getvalue()  # negative control: without the setting there are


class TestAnimations:
    MOVING = ("lotka-volterra", "large-steps", "area-patch", "chaos-onset")

    def test_which_figures_move(self):
        assert [name for name in figure_names() if hasattr(figure_file(name), "frames")] == list(self.MOVING)
        page = (Path(__file__).parents[3] / "docs" / "howto" / "draw-figures.md").read_text(encoding="utf-8")
        paragraph = page.partition("## Animations\n")[2].partition("```")[0]
        assert sorted(re.findall(r"`([a-z-]+)`", paragraph)) == sorted(self.MOVING)

    @pytest.mark.few(1)
    @pytest.mark.parametrize("name", MOVING)
    def test_number_of_frames(self, name):
        """Bounded for all options; frames count from 1, and the last says that it is the last."""
        file = figure_file(name)
        longest = {"area-patch": {"steps": 24}, "lotka-volterra": {"h": 0.005}, "chaos-onset": {"span": 50}}
        numbers = compute(file, longest.get(name, {}))
        with print_style():
            steps = file.frames(numbers, new_figure(file.SIZE))
            first, count = next(steps)
            assert first == 1
            assert count <= registry.MOST_FRAMES
            if name != "chaos-onset":
                assert [frame for frame, _ in steps] == list(range(2, count + 1))

    @pytest.mark.slow
    def test_a_gif(self, tmp_path):
        from PIL import Image

        path, seen = tmp_path / "patch.gif", []
        figure = bs.figure("area-patch", steps=4)
        figure.animate(str(path), progress=lambda done, total: seen.append((done, total)))
        with Image.open(path) as film:
            frames = []
            for k in range(film.n_frames):
                film.seek(k)
                frames.append(np.asarray(film.convert("L"), int))
        assert seen == [(k, 25) for k in range(1, 26)]
        assert len(frames) == 25
        assert frames[0].shape[1] <= 740
        assert all((abs(one - other) > 50).sum() > 20 for one, other in pairwise(frames))
        assert path.stat().st_size < 1_000_000
        assert list(tmp_path.iterdir()) == [path]

    @pytest.mark.slow
    def test_an_mp4(self, tmp_path, monkeypatch):
        pytest.importorskip("imageio_ffmpeg")
        monkeypatch.setattr(area_patch, "FINE", 2)  # fewer frames than above
        path = tmp_path / "patch.mp4"
        file = figure_file("area-patch")
        animate(file, area_patch.numbers(steps=4), path)
        content = path.read_bytes()
        assert content[4:8] == b"ftyp"
        assert 10_000 < len(content) < 1_000_000

    @pytest.mark.slow
    @pytest.mark.parametrize("name", MOVING)
    def test_films_of_the_lecture_are_small(self, name, tmp_path):
        from PIL import Image

        path = tmp_path / "film.gif"
        bs.figure(name).animate(path)
        assert path.stat().st_size < 5_000_000
        with Image.open(path) as film:
            assert 90 <= film.n_frames <= registry.MOST_FRAMES

    def test_an_interrupted_film_leaves_no_file(self, tmp_path):
        def stop(done, total):
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            bs.figure("area-patch", steps=4).animate(tmp_path / "patch.gif", progress=stop)
        assert not list(tmp_path.iterdir())

    @pytest.mark.parametrize(
        ("name", "path", "message"),
        [
            (
                "riccati",
                "a.gif",
                "name must be a figure that moves, one of lotka-volterra, large-steps, area-patch, chaos-onset",
            ),
            ("area-patch", "a.png", "animate must be a file that ends in .gif or .mp4, but was 'a.png'"),
            ("area-patch", "no/a.gif", "animate must be a file in a folder that is there, but was 'no/a.gif'"),
        ],
    )
    def test_wrong_files(self, name, path, message, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        with pytest.raises(bs.errors, match=re.escape(message)):
            animate(figure_file(name), None, path)

    def test_an_encoder_that_fails(self, tmp_path, monkeypatch):
        from matplotlib import rcParams

        monkeypatch.setitem(rcParams, "animation.ffmpeg_path", "false")
        with pytest.raises(bs.SeriesError, match="animate must be a file that ffmpeg can write, but false failed on"):
            animate(figure_file("area-patch"), area_patch.numbers(steps=4), tmp_path / "patch.mp4")
        assert not list(tmp_path.iterdir())

    def test_mp4_needs_an_encoder(self, monkeypatch):
        from matplotlib.animation import FFMpegWriter

        monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
        monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
        with pytest.raises(ImportError, match=r"needs imageio_ffmpeg: pip install '.\[animate\]'"):
            registry.check_animation("a.mp4")
        assert registry.check_animation("a.GIF") == "gif"
