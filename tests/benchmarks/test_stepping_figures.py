"""Rounding errors are told apart from what a method does itself, and every figure on time stepping is measured."""

import json
import shutil
import sys
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

import bseries as bs

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.running import chosen  # noqa: E402
from benchmarks.stepping import costs, figures, precision, problems, ratios, studies  # noqa: E402
from benchmarks.stepping.our_steps import our_steps_like_c  # noqa: E402
from benchmarks.stepping.problems import Point  # noqa: E402
from benchmarks.stepping.rounding import STEP, Rounding, energy_changes, random_starts, rounding  # noqa: E402

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")


def energy(y):
    return (y[..., 0] ** 2 + y[..., 1] ** 2) / 2 - 1 / np.hypot(y[..., 2], y[..., 3])


def test_starts_lie_on_turned_ellipses_all_over_the_period():
    p1, p2, q1, q2 = y = np.array(random_starts(50)).T
    np.testing.assert_allclose(energy(y.T), -0.5, rtol=1e-14)
    np.testing.assert_allclose(q1 * p2 - q2 * p1, sqrt(1 - 0.6**2), rtol=1e-14)
    radii = np.hypot(q1, q2)
    assert 0.4 - 1e-12 <= radii.min() < 0.6 < 1.4 < radii.max() <= 1.6 + 1e-12


@needs_gcc
@pytest.mark.parametrize(("method", "amplitude"), [("stormer-verlet-kdk", 1e-4), ("gauss3", 1e-11)])
def test_what_a_method_does_to_energy_is_no_rounding_error(method, amplitude):
    stepper = bs.stepper(method, bs.scene("kepler"))
    state, rows = stepper.start(random_starts(1)[0], h=STEP), []
    for _ in range(6):
        rows.append(np.concatenate([state.y, state.carry]))
        stepper.advance(state, 37)
    plain = energy(np.array(rows)[:, :4])
    assert np.ptp(plain) > amplitude
    assert np.abs(energy_changes(method, np.array(rows))).max() < 5e-15


@needs_gcc
@pytest.mark.parametrize("method", ["stormer-verlet-kdk", "gauss3"])
def test_a_change_of_energy_is_seen_to_its_size(method):
    y = np.array(random_starts(1)[0])
    scaled = np.array([1e-12, 1e-12, 0, 0]) * y
    rows = np.array([np.concatenate([y, 0 * y]), np.concatenate([y, scaled]), np.concatenate([y + scaled, 0 * y])])
    expected = 1e-12 * (y[0] ** 2 + y[1] ** 2) / 0.5  # of p²/2, relative to 1/2
    np.testing.assert_allclose(energy_changes(method, rows), [0, expected, expected], rtol=5e-3, atol=1e-17)


@needs_gcc
def test_compensation_is_seen():
    with_it, without = (rounding("stormer-verlet-kdk", 10_000, starts=6, compensated=c) for c in (True, False))
    assert with_it.changes.shape == (6, 12)
    assert (with_it.steps[0], with_it.steps[-1]) == (10, 10_000)
    assert 1e-17 < with_it.rms[-1] < without.rms[-1] / 3


def test_a_walk_and_a_drift_are_told_apart():
    steps = np.geomspace(1e4, 1e7, 12).round().astype(int)
    walk = np.random.default_rng(1).normal(size=(400, len(steps))) * np.sqrt(steps)
    assert Rounding(steps, walk).exponent == pytest.approx(0.5, abs=0.03)
    assert Rounding(steps, walk).bias < 3
    drift = walk + steps
    assert Rounding(steps, drift).exponent == pytest.approx(1, abs=0.03)
    assert Rounding(steps, drift).bias > 100
    assert Rounding(steps, np.tile(steps, (3, 1)) * 2.0).rms == pytest.approx(2 * steps)


@pytest.mark.parametrize("method", costs.OBSERVED)
def test_observed_steps_are_the_same_steps(method):
    ends = []
    for side in (costs.observed_steps, costs.unobserved_steps):
        y = bs.scene("kepler").y0.copy()
        side("kepler", method)(y, STEP, 250)
        ends.append(y)
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-12)


def test_observing_has_a_ratio_for_each_method():
    found = costs.observing(scenes=["pendulum"], methods=["rk4"], rounds=1, sample=1e-4)
    assert found.keys() == {"rk4"}
    assert found["rk4"] > 0


@pytest.mark.slow
def test_memory_of_a_child():
    growth = costs.memory(1000)
    assert 30e6 < growth.imported <= growth.short <= growth.long < 1e9


@pytest.mark.slow
def test_compile_times_of_each_pair():
    (found,) = costs.compile_times(["pendulum"], ["rk4"], loaded=True)
    assert found[:2] == ("pendulum", "rk4")
    assert min(found.first, found.cached) > 0


def test_an_ensemble_is_timed_with_one_worker_and_with_two():
    assert costs.ensemble_speedup("threads", steps=3, members=4, rounds=1) > 0


def test_what_takes_minutes_comes_in_a_full_run_only():
    rows = figures.measurements()
    assert len({row.name for row in rows}) == len(rows)
    quick, full = chosen(rows, "memory", False), chosen(rows, "memory", True)
    assert [row.name for row in quick] == ["stepping-memory"]
    assert [row.name for row in full] == ["stepping-memory", "stepping-memory-full"]


@pytest.mark.parametrize(
    ("replaced", "measure", "bars"),
    [
        ({"memory": lambda steps: costs.Growth(1, 2, 3)}, lambda: figures.held(10), [150.0, None]),
        ({"observing": lambda rounds: {"gauss3": 1.0}}, figures.observed, [1.1]),
        ({"ensemble_speedup": lambda kind, steps: 2.0}, figures.shared("threads", 1.9, 5), [1.9]),
        (
            {
                "compile_times": lambda loaded: [
                    costs.CompileTime("a", "b", 1, 0.2),
                    costs.CompileTime("c", "d", 2, 0.1),
                ]
            },
            lambda: figures.compiling(loaded=True),
            [2.0, 0.3],
        ),
        (
            {"rounding": lambda *_, **__: Rounding(np.array([10, 100]), np.array([[1e-16, 3e-16], [2e-16, 4e-16]]))},
            lambda: figures.rounded(100),
            2 * [1e-13, 0.6, 3.0] + 9 * [None],
        ),
    ],
)
def test_bars_of_figures(monkeypatch, replaced, measure, bars):
    for name, function in replaced.items():
        monkeypatch.setattr(figures, name, function)
    assert [figure.bar for figure in measure()] == bars


def test_leads_are_the_least_over_the_errors_that_both_reach():
    def curve(package, method, *points):
        return {"package": package, "version": "1", "method": method, "problem": "kepler", "points": list(points)}

    ours = curve("ours", "gauss3", [1e-2, 1.0, 50], [1e-11, 1.0, 100])
    rows = [
        ours,
        curve("scipy", "DOP853", [1e-2, 90.0, 1], [1e-5, 70.0, 1]),
        curve("heyoka", "Taylor", [1e-9, 2.0, 1]),
    ]
    found = studies.precision_figures(rows)
    assert [(round(figure.value, 3), figure.bar) for figure in found] == [(70.0, 50.0), (2.0, 1.0)]
    assert all(figure.at_least for figure in found)
    rows[0] = {**ours, "points": [[1e-2, 1.0, 50], [1e-4, 1.0, 100]]}  # errors that ours does not reach
    assert [figure.value for figure in studies.precision_figures(rows)] == [0, 0]
    assert studies.precision_figures([]) == []


def test_a_study_of_precision_keeps_its_curves_through_json():
    curves = [
        precision.Curve("ours", "", "gauss3", "kepler", [Point(1e-3, 0.001, 50), Point(1e-9, 0.1, 400)]),
        precision.Curve("heyoka", "7.13", "Taylor", "kepler", [Point(1e-3, 0.01, 1e-3)]),
    ]
    rows = json.loads(json.dumps([curve.to_dict() for curve in curves]))
    assert studies.curves_of(rows) == curves
    (table,) = studies.precision_tables(rows)
    assert table.title == "Kepler, e = 0.6, 200 periods"
    assert table.headings[-1] == "heyoka 7.13"
    assert table.rows[0] == ["1e-03", "1", "–", "–", "–", "10"]
    assert len(studies.draw_precision(rows).axes) == 1


def test_ratios_to_c_have_means_over_scenes_with_bars():
    cells = [
        ratios.Cell(scene, method, [2.0 * factor, 30.0], [1.0, 10.0 / factor])
        for scene, factor in (("pendulum", 1.0), ("kepler", 0.5))
        for method in ("rk4", "gauss3")
    ]
    rows = json.loads(json.dumps([studies.row_of(cell) for cell in cells]))
    assert (rows[0]["ours"], rows[0]["theirs"], rows[0]["ratio"]) == (16.0, 5.5, 2.5)
    costs, table = studies.ratio_tables(rows)
    assert costs.rows[0][0] == "rk4"
    assert table.headings == ["method", "pendulum", "kepler", "mean"]
    found = studies.ratio_figures(rows)
    assert [figure.bar for figure in found] == [1.05, 1.10]
    assert found[0].value == pytest.approx(sqrt(2.5 * rows[2]["ratio"]))
    assert studies.ratio_figures([]) == []


def test_a_curve_with_variable_steps(monkeypatch):
    monkeypatch.setattr(problems, "REPEAT", 0.0)
    monkeypatch.setattr(problems, "INSTANTS", 200)
    kepler = precision.problems()[0]
    short = kepler._replace(span=kepler.span / 40, steps=50)
    varied = precision.controlled_curve(short, "gauss3", "(q1^2 + q2^2)^(1/2)")
    constant = precision.our_curve(short, "gauss3", our_steps_like_c("kepler", "gauss3"))
    assert varied.method == "gauss3, σ = (q1^2 + q2^2)^(1/2)"
    assert varied.points[4].error < 0.2 * constant.points[4].error
    assert varied.points[6].error < 0.05 * varied.points[4].error  # order 6, steps half as long
