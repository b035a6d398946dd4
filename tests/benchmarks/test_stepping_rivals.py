"""The C programs compute what the methods say, and curves of work and precision are measured and compared rightly."""

import importlib.util
import json
import shutil
import sys
from itertools import pairwise
from math import inf, sqrt
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bseries as bs
from integrators.reference.plain_steps import block_parts, plain_steps

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.stepping import diagram, precision, problems, ratios  # noqa: E402
from benchmarks.stepping.__main__ import main  # noqa: E402
from benchmarks.stepping.c_steps import METHODS, STEP_SIZES, CFailure, c_steps, yoshida6_sizes  # noqa: E402
from benchmarks.stepping.precision import Curve  # noqa: E402
from benchmarks.stepping.problems import Point, fastest, measure  # noqa: E402

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
SMALL = [(scene, method) for scene in ("pendulum", "kepler", "toda") for method in METHODS]
LARGE = [(scene, method) for scene in ("lennard-jones", "outer-solar-system") for method in METHODS]


@pytest.fixture(autouse=True)
def runs_of_a_moment(monkeypatch):
    monkeypatch.setattr(problems, "REPEAT", 0.0)
    monkeypatch.setattr(problems, "INSTANTS", 200)


def field(name):
    """p' and q' as functions of y = (p, q): of the large scenes written down with NumPy."""
    import sympy

    scene = bs.scene(name)
    if name == "lennard-jones":
        return attraction(np.ones(9), 2, lambda r2, m: 24 * (2 / r2**6 - 1 / r2**3) / r2)
    if name == "outer-solar-system":
        G, m = (np.array(scene.parameters[key], dtype=float) for key in ("G", "m"))
        return attraction(m, 3, lambda r2, mm: -G * mm / r2**1.5)
    f = sympy.lambdify(scene.symbols, scene.field, modules="math")
    return lambda y: np.array(f(*y))


def attraction(m, dimension, factor):
    """All forces on a body as a sum over all the others, not in pairs."""

    def f(y):
        p, q = y.reshape(2, -1, dimension)
        d = q[:, None] - q
        r2 = (d**2).sum(axis=2) + np.eye(len(m))
        w = factor(r2, m[:, None] * m) * (1 - np.eye(len(m)))
        return np.concatenate([(w[:, :, None] * d).sum(axis=1).ravel(), (p / m[:, None]).ravel()])

    return f


def plain(scene, method, f, h, steps):
    """The end of some steps, as the definition of the method makes them."""
    n, names = scene.dimension // 2, method.program.names
    if len(names) == 2:
        f = block_parts(f, {names[0]: range(n), names[1]: range(n, 2 * n)})
    return plain_steps(method, f, scene.y0, h, steps)[:, -1]


@needs_gcc
@pytest.mark.few(2)
@pytest.mark.parametrize(("name", "method"), SMALL + LARGE)
def test_the_c_programs_make_the_steps_of_the_methods(name, method):
    scene, h, steps = bs.scene(name), STEP_SIZES[name], 4
    y = scene.y0.copy()
    c_steps(name, method)(y, h, steps)
    expected = plain(scene, bs.method(method), field(name), h, steps)
    for found, wanted in zip(y.reshape(2, -1), expected.reshape(2, -1), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-14 * np.abs(wanted).max())
    c_steps(name, method)(y, -h, steps)
    error = np.abs(y - scene.y0).max() / np.abs(scene.y0).max()
    assert error < 1e-12 or (method == "rk4" and error < 1e-2)  # the others are symmetric


@needs_gcc
def test_c_programs_of_different_methods_differ():
    ends = []
    for method in METHODS:
        y = bs.scene("kepler").y0.copy()
        c_steps("kepler", method)(y, STEP_SIZES["kepler"], 4)
        ends.append(y)
    assert all(np.abs(a - b).max() > 1e-9 for k, a in enumerate(ends) for b in ends[:k])


@needs_gcc
def test_c_programs_say_that_they_fail():
    for method in ("rk4", "gauss2"):
        with pytest.raises(CFailure, match=f"{method} on toda with h = 1000"):
            c_steps("toda", method)(bs.scene("toda").y0, 1e3, 3)


def test_the_steps_of_yoshida6_add_up():
    sizes = yoshida6_sizes()
    assert len(sizes) == 7
    assert sum(sizes) == pytest.approx(1, abs=1e-15)
    assert sum(size**3 for size in sizes) == pytest.approx(0, abs=1e-14)  # HLW, formula (II.4.3)


def test_every_round_samples_both_sides_from_the_start():
    calls = []

    def side(name):
        def make(scene, method):
            def run(y, h, steps):
                calls.append((name, steps, float(y[1])))
                np.linalg.norm(np.ones(20_000))

            return run

        return make

    cells = ratios.compare(side("a"), side("b"), scenes=["pendulum"], methods=["rk4"], rounds=3, sample=1e-6)
    sampled = calls[-6:]
    assert [name for name, _, _ in sampled] == ["a", "b", "b", "a", "a", "b"]
    assert {start for _, _, start in sampled} == {-1.5}
    assert len({steps for _, steps, _ in sampled}) == 1
    assert [len(cells[0].ours), len(cells[0].theirs)] == [3, 3]


def test_ratios_are_medians_of_rounds_and_means_geometric():
    cells = [
        ratios.Cell("x", "m", [2.0, 2.0, 30.0], [1.0, 4.0, 10.0]),
        ratios.Cell("y", "m", [8.0], [1.0]),
        ratios.Cell("y", "n", [3.0], [1.0]),
    ]
    assert cells[0].ratio == 2.0
    assert ratios.means(cells) == pytest.approx({"m": 4.0, "n": 3.0})


def curve(*points, package="ours", method="m", problem="kepler"):
    return Curve(package, "", method, problem, [Point(*point, 0.1) for point in points])


def test_curves_are_straight_between_points_in_logarithms():
    found = curve((1e-2, 1.0), (1e-3, 50.0), (1e-4, 10.0), (0.0, 0.1), (inf, 0.1))  # the second is beaten
    assert found.seconds(1e-3) == pytest.approx(sqrt(10))
    assert found.seconds(1e-4) == pytest.approx(10)
    assert found.seconds(0.5) == 1.0
    assert found.seconds(0.9e-4) is None
    assert curve().seconds(1.0) is None


def test_leads_are_over_the_best_of_each_kind():
    curves = [
        curve((1e-3, 1.0), (1e-5, 4.0)),
        curve((1e-3, 0.5), (1e-4, 9.0), method="other"),
        curve((1e-6, 30.0), package="rebound", method="WHFast"),
        curve((1e-4, 40.0), package="rebound", method="leapfrog, order 2"),
    ]
    rows = {row["error"]: row for row in precision.leads(curves)}
    assert rows[1e-3]["ours"] == 0.5
    assert (rows[1e-5]["rebound"], rows[1e-5]["rebound, leapfrog"]) == (7.5, None)
    assert rows[1e-4]["rebound, leapfrog"] == 20.0
    assert rows[1e-4]["heyoka"] is None
    assert rows[1e-6]["rebound"] is None


@pytest.mark.parametrize("problem", precision.problems(), ids=lambda problem: problem.name)
def test_errors_of_energy_are_those_of_the_scene(problem):
    import sympy

    scene = bs.scene(problem.name)
    energy = sympy.lambdify(scene.symbols, scene.hamiltonian, cse=True)
    y = scene.y0 * (1 + 0.01 * np.random.default_rng(1).random((5, scene.dimension)))
    p, q = np.hsplit(y, 2)
    v = p / np.repeat(problem.masses, p.shape[1] // len(problem.masses))
    expected = max(abs(energy(*row) / energy(*scene.y0) - 1) for row in y)
    assert problem.energy_error(q, v) == pytest.approx(expected, rel=1e-9)
    assert problem.energy_error(problem.positions, problem.velocities) < 1e-15
    assert problem.energy_error(q * np.nan, v) == inf


def test_energy_is_looked_at_where_steps_end_at_or_after_the_instants():
    problem = precision.problems()[0]
    assert list(problem.looks(5)) == [1, 2, 3, 4, 5]
    assert list(problem.looks(400)) == list(range(2, 401, 2))
    assert list(problem.looks(300))[:4] == [2, 3, 5, 6]
    assert problem.instants()[-1] == problem.span


def test_a_curve_ends_with_a_long_run_or_with_rounding_and_leaves_out_what_failed():
    def at(errors):
        table = dict(enumerate(errors))
        return lambda k: (table[k], lambda: lambda: None)

    errors = [1e-1, 1e-12, 2e-12, 1e-13]
    assert [point.error for point in measure(range(4), at(errors), inf)] == errors[:3]
    assert [point.error for point in measure(range(4), at([1e-2, 1e-1, inf, 1e-3]), inf)] == [1e-2, 1e-1, 1e-3]
    assert [point.error for point in measure(range(4), at(errors), -1.0)] == errors[:1]
    assert 0 <= fastest(lambda: lambda: sum(range(10_000))) < inf


def short(problem):
    """Five periods."""
    return problem._replace(span=problem.span / 40)


@needs_gcc
def test_curves_of_methods_fall_with_their_order():
    problem = short(precision.problems()[0])._replace(steps=100)
    found = precision.our_curve(problem, "gauss3", c_steps("kepler", "gauss3"))
    fine = [point for point in found.points if 1e-11 < point.error < 1e-5]
    assert len(fine) >= 3
    orders = [2 * np.log2(a.error / b.error) for a, b in pairwise(fine)]
    assert np.median(orders) == pytest.approx(6, abs=0.7)


@pytest.mark.skipif(importlib.util.find_spec("scipy") is None, reason="scipy is not installed")
@pytest.mark.slow
def test_a_rival_is_measured_in_its_own_interpreter():
    curves = precision.rival_curves(Path(sys.prefix), "scipy", short(precision.problems()[0]), budget=0.0)
    assert [curve.method for curve in curves] == ["RK45", "DOP853", "LSODA", "Radau"]
    assert all(0 < point.error < 1e-2 and point.seconds > 0 for curve in curves for point in curve.points)


def test_rivals_that_are_not_installed_have_no_curves(tmp_path):
    assert precision.rival_curves(tmp_path, "rebound", precision.problems()[0]) == []


def test_the_diagram_has_a_line_for_every_curve_and_names_for_the_best_of_each_package():
    kepler, solar = precision.problems()
    curves = [
        curve((1e-2, 1.0), (1e-4, 10.0), method="gauss3"),
        curve((1e-2, 1.5), (1e-4, 15.0), method="rk4"),
        curve((1e-2, 1.1), (1e-4, 10.1), package="heyoka", method="Taylor"),
        curve((5.0, 1.0), package="scipy", method="RK45"),
        curve((1e-2, 1.1), package="rebound", method="IAS15", problem=solar.name),
    ]
    first, second = diagram.draw(curves, [kepler, solar]).axes
    assert [line.get_linewidth() for line in first.lines] == [2, 0.7, 1]
    assert [text.get_text() for text in first.get_legend().get_texts()] == ["heyoka Taylor", "gauss3"]
    assert len(second.lines) == 1


def test_the_command_measures_precision_and_keeps_it(tmp_path):
    kept, picture = tmp_path / "run.json", tmp_path / "run.png"
    options = ["--problem", "kepler", "--method", "rk4", "--budget", "0", "--rivals", str(tmp_path)]
    ended = CliRunner().invoke(main, ["precision", *options, "--json", str(kept), "--diagram", str(picture)])
    assert ended.exit_code == 0, ended.output
    (found,) = json.loads(kept.read_text())["curves"]
    assert (found["method"], found["problem"], len(found["points"])) == ("rk4", "kepler", 1)
    assert picture.read_bytes().startswith(b"\x89PNG")


@needs_gcc
def test_the_command_compares_with_c(tmp_path):
    kept = tmp_path / "run.json"
    options = ["--scene", "pendulum", "--method", "stormer-verlet-kdk", "--rounds", "1", "--json", str(kept)]
    ended = CliRunner().invoke(main, ["ratios", *options])
    assert ended.exit_code == 0, ended.output
    assert json.loads(kept.read_text())["means"].keys() == {"stormer-verlet-kdk"}


@needs_gcc
def test_both_sides_compute_the_same():
    from benchmarks.stepping.our_steps import our_steps_like_c

    ends = []
    for side in (our_steps_like_c, c_steps):
        y = bs.scene("kepler").y0.copy()
        side("kepler", "gauss2")(y, STEP_SIZES["kepler"], 50)
        ends.append(y)
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-12)
