"""Work and precision: errors against closed forms, orders, the modified energy, and recommendations that hold."""

from __future__ import annotations

import cmath
import json
import math

import numpy as np
import pytest
from steady_budgets import for_steps, stop_the_clock

import bseries as bs
from bseries.advice.timing import Timing
from bseries.advice.work_precision.recommendation import largest_step
from bseries.advice.work_precision.sweeps import (
    Curve,
    DenseReference,
    Judge,
    Row,
    RunErrors,
    candidate,
    candidates,
    time_scale,
)

METHODS = ("stormer-verlet", "rk4", "gauss2")

BUDGET = for_steps(20_000)


@pytest.fixture(scope="module", autouse=True)
def stopped_clock():
    with pytest.MonkeyPatch.context() as monkeypatch:
        stop_the_clock(monkeypatch)
        yield


@pytest.fixture(scope="module")
def pendulum(stopped_clock):
    return bs.work_precision(METHODS, "pendulum", span=20, errors=(1e-2, 1e-7), budget=BUDGET)


@pytest.fixture(scope="module")
def judge():
    """What measures errors as the pendulum's were."""
    return Judge(bs.scene("pendulum"), 20.0)


def curve(found, name) -> Curve:
    return next(curve for curve in found.curves if curve.candidate.name == name)


# Errors


def test_errors_of_runs_against_the_closed_solution():
    oscillator, span, n = bs.parse_hamiltonian("(p^2 + q^2)/2", start="p=0; q=1"), 7.0, 60
    found = Judge(oscillator, span).run(candidate(oscillator, "rk4"), n)
    h, z = span / n, 1.0 + 0.0j  # rk4 multiplies by its stability function, the exact flow by exp(ih)
    factor, distances = sum((1j * h) ** k / math.factorial(k) for k in range(5)), []
    for k in range(1, n + 1):
        z *= factor
        distances.append(abs(z - cmath.exp(1j * h * k)))
    assert found.solution == pytest.approx(max(distances), rel=1e-6)
    assert found.energy == pytest.approx(1 - abs(z) ** 2, rel=1e-6)


def test_the_dense_reference_between_its_points():
    times = np.random.default_rng(8).uniform(0, 0.9, 200)
    riccati = bs.scene("riccati")
    found = DenseReference(riccati, riccati.y0, 0.9)
    assert np.abs(found(times)[0] * (1 - times) - 1).max() < 1e-13
    with pytest.raises(bs.IntegratorError, match="t must end before 1"):
        DenseReference(riccati, riccati.y0, 1.1)


@pytest.mark.parametrize(
    ("name", "order"),
    [
        ("stormer-verlet", 2),
        ("implicit-midpoint", 2),
        ("rk4", 4),
    ],
)
def test_errors_fall_with_the_order(name, order):
    scene = bs.scene("pendulum")
    judge, method = Judge(scene, 5.0, ("solution",)), candidate(scene, name)
    rough, fine = (judge.run(method, n).solution for n in (100, 200))
    assert rough is not None
    assert fine is not None
    assert abs(math.log2(rough / fine) - order) < 0.2


def test_a_scene_without_energy():
    lorenz = bs.scene("lorenz")
    found = bs.work_precision(["rk4"], lorenz, span=1, errors=(1e-2, 1e-4), budget=BUDGET)
    assert found.measures == ("solution",)
    with pytest.raises(
        bs.IntegratorError, match="measure must be one that can be measured on lorenz, but energy cannot"
    ):
        bs.work_precision(["rk4"], lorenz, measure="energy")


def test_default_spans_end_before_the_solution_does():
    found = bs.work_precision(["rk4"], bs.scene("riccati"), errors=(1e-2, 1e-6), budget=BUDGET)
    assert found.span == pytest.approx(0.5)
    assert found.measures == ("solution",)
    assert time_scale(bs.scene("kepler")) == pytest.approx(0.3108, abs=1e-3)


def test_long_spans_have_a_reference_as_precise_as_times_are():
    """At t = 200 the last bit of the time is 3e-14, more than the precision of the interpolation elsewhere."""
    kepler = bs.scene("kepler")
    found = DenseReference(kepler, kepler.y0, 200.0)
    exact = bs.reference_solution(kepler, [123.456], full=True).high[:, 0]
    assert np.abs(found(np.array([123.456]))[:, 0] - exact).max() < 2e-13


def test_energies_that_are_only_rounding_at_the_start():
    """At q = π/2 the pendulum's energy is −6e-17 in doubles: what it loses is not a million times of it."""
    pendulum = bs.scene("pendulum").with_start(p=[0], q=[math.pi / 2])
    found = bs.work_precision("rk4", pendulum, span=10, errors=(1e-2, 1e-6), measure="energy", budget=BUDGET)
    assert all(row.errors.energy < 1e-2 for row in found.curves[0].rows if row.h < 0.5)
    report = bs.effect_influence("rk4", pendulum.with_effects("damping", gamma="1e-3"), h=0.05, span=5)
    assert report.rows[0].left_out.energy < 1e-2
    run = bs.integrate("rk4", pendulum, h=0.1, steps=100, observe="energy").observed["energy"]
    expected = bs.predict_run("rk4", pendulum, h=0.1, steps=100, timed=False).energy
    assert 1 / 3 < expected.value / abs(run - run[0]).max() < 3


# Rows


def test_methods_of_users_beside_those_of_the_catalogue(pendulum):
    mine = bs.RungeKutta([[0, 0], ["1/2", 0]], [0, 1], name="mine")
    found = bs.work_precision(
        [mine, "explicit-midpoint"], bs.scene("pendulum"), span=5, errors=(1e-1, 1e-3), budget=BUDGET
    )
    first, second = ({row.steps: row.errors.solution for row in curve.rows} for curve in found.curves)
    assert [curve.candidate.name for curve in found.curves] == ["mine", "explicit-midpoint"]
    both = first.keys() & second.keys()
    assert both
    assert all(first[steps] == second[steps] for steps in both)


def test_timed_steps_never_leave_the_span():
    """Beyond t = 1 the solution of y' = y² does not exist, and far beyond it steps are of another kind."""
    judge = Judge(bs.scene("riccati"), 0.9)
    assert judge.work(candidate(bs.scene("riccati"), "rk4"), 30).most_steps == 30


def test_rows_have_times_and_failures_stay():
    riccati = bs.scene("riccati")
    found = bs.work_precision(["implicit-euler"], riccati, span=0.9, errors=(0.5, 1e-3), budget=BUDGET)
    rows = found.curves[0].rows
    assert rows[0].errors.failure is not None
    assert rows[0].seconds is None
    assert rows[-1].errors.failure is None
    assert rows[-1].cost is not None
    assert rows[-1].cost.seconds > 0
    assert "runs failed" in " ".join(found.notes)


def test_what_is_timed(pendulum):
    """Each step size of steps that iterate, and one of the others: their cost does not depend on it."""
    for curve in pendulum.curves:
        costs = [id(row.cost) for row in curve.rows if row.cost is not None]
        assert len(set(costs)) == (len(costs) if curve.candidate.name == "gauss2" else 1)


def test_stiff_scenes_get_newtons_method():
    stiff = bs.parse_scene("y' = z; z' = -1000*z - 1000*y").with_start(y=[1, -1])
    found = bs.work_precision(["radau-iia2", "rk4"], stiff, span=2, errors=(1e-1, 1e-6), budget=BUDGET)
    implicit, explicit = found.curves
    assert implicit.candidate.solver == "auto"
    assert explicit.candidate.solver == "fixed-point"
    steps = [min(row.steps for row in c.rows if (row.errors.solution or 1) < 1e-4) for c in found.curves]
    assert 20 * steps[0] < steps[1]


def test_interpolated_times_and_fronts():
    scene = bs.scene("pendulum")
    points = [(10, 1e-2, 1e-6), (20, 1e-4, 1e-6), (40, 1e-3, 1e-6), (80, 1e-6, 1e-6)]
    rows = [Row(1 / n, n, Timing(t, t, t, 5), RunErrors(solution=error)) for n, error, t in points]
    made = Curve(candidate(scene, "rk4"), tuple(rows))
    assert made.front("solution") == [
        (1e-2, pytest.approx(1e-5)),
        (1e-4, pytest.approx(2e-5)),
        (1e-6, pytest.approx(8e-5)),
    ]
    assert made.seconds(1e-3) == pytest.approx(math.sqrt(2) * 1e-5)
    assert made.seconds(0.5) == pytest.approx(1e-5)
    assert made.seconds(1e-7) is None
    assert made.seconds(1e-3, "energy") is None


def test_the_answer_is_plain_data(pendulum):
    data = json.loads(json.dumps(pendulum.to_dict()))
    assert (data["kind"], data["scene"], data["span"]) == ("work-precision", "pendulum", 20.0)
    assert [entry["method"] for entry in data["methods"]] == list(METHODS)
    assert {"date", "processor", "versions"} <= set(data["machine"])
    assert "3 methods on pendulum" in repr(pendulum)


# Candidates


@pytest.mark.parametrize(
    ("scene", "has", "has_not"),
    [
        ("kepler", "blanes-casas-rkn8", "radau-iia3"),
        ("lotka-volterra", "blanes-moan6", "blanes-casas-rkn8"),
        ("lorenz", "rodas4", "stormer-verlet"),
    ],
)
def test_methods_suit_the_structure(scene, has, has_not):
    names = [method.name for method in candidates(bs.scene(scene))[0]]
    assert has in names
    assert has_not not in names


def test_methods_that_do_not_fit_are_left_out_with_a_reason():
    found, left_out = candidates(bs.scene("lorenz"), ["rk4", "rkn-verlet", "rk4"])
    assert [method.name for method in found] == ["rk4"]
    assert "must have blocks or parts for p, q, which the method treats differently" in left_out["rkn-verlet"]


# Recommendations


@pytest.mark.parametrize("error", [1e-2, 1e-4, 1e-6])
def test_the_step_is_the_largest_that_meets_the_error(pendulum, judge, error):
    for found in pendulum.curves:
        step = largest_step(judge, found, error, "solution")
        if step is None:
            assert found.candidate.name == "stormer-verlet"
            assert error == 1e-6
            continue
        assert step.error <= error
        larger = judge.run(found.candidate, math.floor(step.steps / 1.05)).solution
        assert larger is None or larger > error


def test_spans_for_which_the_budget_is_too_short_are_refused():
    """Nothing is recommended for a time that was not measured."""
    with pytest.raises(bs.IntegratorError, match=r"span must be at most 6.02e\+05 for pendulum and this budget"):
        bs.work_precision(METHODS, "pendulum", span=1e12)


@pytest.mark.slow
def test_without_a_precise_reference_only_energies_are_measured():
    found = bs.work_precision("rk4", "kepler", span=1e5, errors=(1e-1, 1e-3), budget=10 * BUDGET)
    assert (found.span, found.measures) == (1e5, ("energy",))
    assert any(note.startswith("The solution was not measured: t must end sooner") for note in found.notes)


def test_the_energy_as_the_measure(pendulum):
    chosen = pendulum.best(1e-3, measure="energy")
    assert chosen.measure == "energy"
    assert chosen.error <= 1e-3
    data = json.loads(json.dumps(chosen.to_dict()))
    assert (data["schema"], data["kind"], data["method"]) == (1, "recommendation", chosen.method)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"methods": ["no-such"]}, "name must be a method of the catalogue, but was 'no-such'"),
        ({"methods": []}, "methods must name at least one method"),
        ({"methods": [4]}, "method must be a method such as .*, but was 4"),
        (
            {"methods": ["rk4", bs.RungeKutta([[0]], [1], name="rk4")]},
            "methods must have different names, but two are called rk4",
        ),
        ({"methods": ["lawson4"]}, "methods must have one that fits pendulum, but had none"),
        ({"span": -1}, "span must be positive, but was -1"),
        ({"span": "x"}, "span must be a number, but 'x'"),
        ({"errors": (1e-5, 1e-3)}, "errors must be two numbers from 1 to 1e-15, the larger one first"),
        ({"errors": 3}, "errors must be two numbers"),
        ({"measure": "speed"}, "measure must be one of solution, energy, but was 'speed'"),
        ({"budget": 0}, "budget must be positive, but was 0"),
        ({"budget": True}, "budget must be a finite number, but was True"),
        ({"progress": 5}, "progress must be a function of two numbers, True or None, but was 5"),
    ],
)
def test_bad_arguments(options, message):
    with pytest.raises(bs.errors, match=message):
        bs.work_precision(**{"methods": "auto", "scene": "pendulum", **options})


@pytest.mark.parametrize(
    ("scene", "message"),
    [("pendulumm", "did you mean pendulum"), (3, "scene must be a Scene or the name of one, but was 3")],
)
def test_no_scenes(scene, message):
    with pytest.raises(bs.IntegratorError, match=message):
        bs.work_precision("auto", scene)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0,), "error must be positive, but was 0"),
        ((1e-30,), "error must be one that a method reaches on pendulum within its budget, but was 1e-30"),
        ((1e-3, "speed"), "measure must be one of"),
    ],
)
def test_bad_wishes(pendulum, arguments, message):
    with pytest.raises(bs.IntegratorError, match=message):
        pendulum.best(*arguments)


def test_the_picture_has_a_panel_for_each_measure_and_all_names(pendulum):
    pytest.importorskip("matplotlib")
    from bseries.advice.work_precision.precision_curves import draw

    figure = draw(pendulum.curves, pendulum.errors, pendulum.measures, pendulum.title)
    assert len(figure.axes) == 2
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert {text.get_text() for text in legend.get_texts()} == set(METHODS)


@pytest.mark.parametrize(
    ("name", "scene", "count"),
    [
        ("rk4", "kepler", 4),
        ("dormand-prince54", "kepler", 6),  # seven stages, of which the last is the next step's first
        ("bs32", "lotka-volterra", 3),
        ("stormer-verlet-kdk", "kepler", 1),
        ("stormer-verlet-dkd", "kepler", 1),
        ("implicit-midpoint", "kepler", None),
        ("strang", "lotka-volterra", None),  # exact flows of parts
    ],
)
def test_evaluations_are_those_that_a_step_makes(name, scene, count):
    from bseries.advice.work_precision.sweeps import evaluations

    assert evaluations(bs.method(name), bs.scene(scene)) == count
