"""Work and precision: errors against closed forms, orders, the modified energy, and recommendations that hold."""

from __future__ import annotations

import cmath
import json
import math

import numpy as np
import pytest
from steady_budgets import for_steps, stop_the_clock

import bseries as bs
from bseries.advice.distances import relative_distance
from bseries.advice.timing import Timing
from bseries.advice.work_precision import run_errors
from bseries.advice.work_precision.candidates import candidate, candidates, modifying_scene
from bseries.advice.work_precision.curves import Curve, Extrapolation, Row
from bseries.advice.work_precision.dense_reference import DenseReference
from bseries.advice.work_precision.extrapolation import fitted_extrapolation
from bseries.advice.work_precision.recommendation import largest_step
from bseries.advice.work_precision.run_errors import Judge, RunErrors
from bseries.advice.work_precision.sweeps import time_scale

METHODS = ("stormer-verlet", "rk4", "gauss2")
ROTATING = bs.scene("pendulum").with_start(p=[3], q=[0])


BUDGET = for_steps(20_000)


@pytest.fixture(scope="module", autouse=True)
def stopped_clock():
    with pytest.MonkeyPatch.context() as monkeypatch:
        stop_the_clock(monkeypatch)
        yield


@pytest.fixture(scope="module")
def pendulum(stopped_clock):
    return bs.work_precision("pendulum", METHODS, span=20, errors=(1e-2, 1e-7), budget=BUDGET)


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
        ("modifying-midpoint4", 4),
        ("modifying-midpoint6", 6),
    ],
)
def test_errors_fall_with_the_order(name, order):
    scene = bs.scene("pendulum")
    judge, method = Judge(scene, 5.0, ("solution",)), candidate(scene, name)
    rough, fine = (judge.run(method, n).solution for n in (100, 200))
    assert rough is not None
    assert fine is not None
    assert abs(math.log2(rough / fine) - order) < 0.2


def test_the_modified_energy_changes_less_than_the_energy(pendulum):
    errors = next(row.errors for row in curve(pendulum, "stormer-verlet").rows if row.h < 0.06)
    assert errors.modified_order is not None
    assert errors.modified_order >= 3
    assert (errors.error("modified-energy") or 1.0) < 1e-3 * (errors.error("energy") or 0.0)
    assert all(row.errors.modified_energy is None for row in curve(pendulum, "rk4").rows)  # it has none


def test_a_scene_without_energy():
    lorenz = bs.scene("lorenz")
    found = bs.work_precision(lorenz, ["rk4"], span=1, errors=(1e-2, 1e-4), budget=BUDGET)
    assert found.measures == ("solution",)
    with pytest.raises(bs.IntegratorError, match="measure must be one that can be had on lorenz, but energy cannot"):
        bs.work_precision(lorenz, ["rk4"], measure="energy")


def test_default_spans_end_before_the_solution_does():
    found = bs.work_precision(bs.scene("riccati"), ["rk4"], errors=(1e-2, 1e-6), budget=BUDGET)
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
    found = bs.work_precision(pendulum, "rk4", span=10, errors=(1e-2, 1e-6), measure="energy", budget=BUDGET)
    assert all(row.errors.energy < 1e-2 for row in found.curves[0].rows if row.h < 0.5)
    report = bs.effect_influence(pendulum.with_effects("damping", gamma="1e-3"), "rk4", h=0.05, span=5)
    assert report.rows[0].left_out.energy < 1e-2
    run = bs.integrate(pendulum, "rk4", h=0.1, steps=100, observe="energy").observed["energy"]
    expected = bs.predict_run(pendulum, "rk4", h=0.1, steps=100, timed=False).energy
    assert 1 / 3 < expected.value / abs(run - run[0]).max() < 3


# Rows


def test_methods_of_users_beside_those_of_the_catalogue(pendulum):
    mine = bs.RungeKutta([[0, 0], ["1/2", 0]], [0, 1], name="mine")
    found = bs.work_precision(
        bs.scene("pendulum"), [mine, "explicit-midpoint"], span=5, errors=(1e-1, 1e-3), budget=BUDGET
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
    found = bs.work_precision(riccati, ["implicit-euler"], span=0.9, errors=(0.5, 1e-3), budget=BUDGET)
    rows = found.curves[0].rows
    assert rows[0].errors.failure is not None
    assert rows[0].seconds is None
    assert rows[-1].errors.failure is None
    assert rows[-1].cost is not None
    assert rows[-1].cost.seconds > 0
    assert "runs failed" in " ".join(found.notes)


def test_stiff_scenes_get_newtons_method():
    stiff = bs.parse_scene("y' = z; z' = -1000*z - 1000*y").with_start(y=[1, -1])
    found = bs.work_precision(stiff, ["radau-iia2", "rk4"], span=2, errors=(1e-1, 1e-6), budget=BUDGET)
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
    names = [method.name for method in candidates(bs.scene(scene)).found]
    assert has in names
    assert has_not not in names
    assert "modifying-midpoint6" in names


def test_methods_that_do_not_fit_are_left_out_with_a_reason():
    found = candidates(bs.scene("lorenz"), ["rk4", "rkn-verlet", "rk4"])
    assert [method.name for method in found.found] == ["rk4"]
    assert "must have blocks or parts for p, q, which the method treats differently" in found.left_out["rkn-verlet"]


def test_modifying_fields_are_refused_where_formulas_would_be_long():
    many = bs.scene("toda", n=5)
    with pytest.raises(bs.SeriesError, match="must have at most 8 variables, but toda has 10"):
        modifying_scene(bs.method("implicit-midpoint"), many, 4)
    with pytest.raises(bs.SeriesError, match="must treat the whole field alike"):
        modifying_scene(bs.method("stormer-verlet"), bs.scene("pendulum"), 4)


# Recommendations


@pytest.mark.parametrize("error", [1e-2, 1e-4, 1e-6])
def test_the_step_is_the_largest_that_meets_the_error(pendulum, judge, error):
    for found in pendulum.curves:
        step = largest_step(judge, found, Extrapolation(), error, "solution")
        if step is None:
            assert found.candidate.name == "stormer-verlet"
            assert error == 1e-6
            continue
        assert step.error <= error
        larger = judge.run(found.candidate, math.floor(step.steps / 1.05)).solution
        assert larger is None or larger > error


@pytest.mark.usefixtures("laws")
def test_longer_spans_follow_the_growth_of_errors(pendulum, judge):
    ahead = [fitted_extrapolation(judge, found, 4.0) for found in pendulum.curves]
    assert [until[:3] for until in ahead] == [(4.0, drifts, 1.0) for drifts in (False, True, False)]
    whole = Judge(pendulum.scene, 80.0, ("solution",))
    known = 0
    for found, until in zip(pendulum.curves, ahead, strict=True):
        step = largest_step(judge, found, until, 1e-3, "solution")
        if step is not None:
            known += 1
            actual = whole.run(found.candidate, 4 * step.steps).solution
            assert actual is not None
            assert 1 / 2 < actual / step.error < 2
    assert known  # three turns tell little
    chosen = pendulum.best(1e-3, span=80)
    assert "extrapolated, as errors of regular motion grow like t" in chosen.basis
    assert chosen.steps == math.ceil(80 / chosen.h * (1 - 1e-12))
    assert pendulum.best(1e-3).basis == "measured over 20"


@pytest.fixture
def laws(monkeypatch):
    """The modified equation says nothing, so that laws count."""
    monkeypatch.setattr("bseries.advice.work_precision.extrapolation.predicted_factor", lambda *_: None)


@pytest.mark.slow
@pytest.mark.usefixtures("laws")
@pytest.mark.parametrize("errors", [(1e-2, 1e-6), (1e-2, 1e-10), (1e-3, 1e-9)])
def test_the_law_does_not_hang_on_the_range_of_errors(errors):
    """With fine steps the energy of rk4 hardly drifts beyond its oscillation in three turns, but it does in 300."""
    pendulum = bs.scene("pendulum")
    found = bs.work_precision(pendulum, "rk4", span=20, errors=errors, budget=BUDGET)
    assert "as the energy drifts" in found.best(1e-4, span=2000, measure="energy").basis
    for error in (1e-3, 1e-4):
        chosen = found.best(error, span=2000, measure="energy")
        energy = bs.integrate(pendulum, "rk4", h=chosen.h, steps=chosen.steps, observe="energy").observed["energy"]
        assert chosen.error == pytest.approx(abs(energy / energy[0] - 1).max(), rel=0.1)
    with pytest.raises(bs.IntegratorError, match="how errors grow on from 20 to 2000 may be unknown"):
        found.best(1e-3, span=2000)  # three turns do not tell how fast the solution's error grows


def real_error(scene, method, h, steps, finer):
    """The error of the solution, from another method with finer steps."""
    exact = bs.integrate(scene, "gauss4", h=h / finer, steps=steps * finer, save_every=finer).y
    return relative_distance(bs.integrate(scene, method, h=h, steps=steps).y, exact)


LONGER = pytest.mark.parametrize(
    ("scene", "method", "span", "finest", "longer", "error", "law"),
    [
        (bs.scene("pendulum"), "rk4", 100, 1e-6, 1000, 1e-3, "t^2 at most"),
        (ROTATING, "rk4", 100, 1e-8, 5000, 1e-4, "t^2 at most, and states get 50 times as large"),
        (ROTATING, "gauss2", 100, 1e-8, 5000, 1e-4, "t at most, and states get 50 times as large"),
        (bs.scene("central-field"), "gauss2", 50, 1e-8, 1000, 1e-4, "t at most, and states get 20.4 times as large"),
        (bs.scene("kepler"), "blanes-moan-rkn6-11", 20, 1e-8, 200, 1e-6, "t at most"),
    ],
)


@pytest.mark.slow
@LONGER
@pytest.mark.usefixtures("laws")
def test_solutions_of_longer_spans_by_laws(scene, method, span, finest, longer, error, law):
    """Where angles grow, errors are relative to the angles at the end."""
    found = bs.work_precision(scene, method, span=span, errors=(1e-2, finest), measure="solution", budget=BUDGET)
    chosen = found.best(error, span=longer)
    assert chosen.basis.endswith(f"errors of regular motion grow like {law}")
    assert chosen.error == pytest.approx(real_error(scene, method, chosen.h, chosen.steps, 8), rel=0.2)


@pytest.mark.slow
@LONGER
def test_solutions_of_longer_spans_by_the_modified_equation(scene, method, span, finest, longer, error, law):
    """From a part of the span that the laws need."""
    errors = (1e-2, finest)
    found = bs.work_precision(scene, method, span=span / 4, errors=errors, measure="solution", budget=BUDGET)
    chosen = found.best(error, span=longer)
    assert chosen.basis.endswith("as the modified equation tells")
    assert chosen.error <= error
    assert chosen.error == pytest.approx(real_error(scene, method, chosen.h, chosen.steps, 8), rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "methods", "span", "longer", "best"),
    [
        ("pendulum", ["rk4", "stormer-verlet"], 100, 3000, "rk4"),
        ("lotka-volterra", ["rk4", "stormer-verlet"], 60, 1500, "rk4"),
    ],
)
def test_what_grows_fastest_in_the_end_may_be_small_for_long(scene, methods, span, longer, best):
    """The energy of rk4 drifts, but for this span and error it is the cheapest by far."""
    found = bs.work_precision(scene, methods, span=span, errors=(1e-2, 1e-7), measure="solution", budget=5 * BUDGET)
    chosen = found.best(1e-4, span=longer)
    assert chosen.method == best
    assert real_error(bs.scene(scene), best, chosen.h, chosen.steps, 4) < 1.1e-4


def test_chaos_behind_the_span_that_was_measured_is_seen():
    found = bs.work_precision("lorenz", ["rk4", "dop853"], span=2, errors=(1e-2, 1e-5), budget=BUDGET)
    with pytest.raises(bs.IntegratorError, match="how errors grow on from 2 to 50 may be unknown"):
        found.best(1e-4, span=50)
    assert found.best(1e-4).error <= 1e-4  # control


def test_energies_may_drift_where_modified_terms_cannot_be_had(pendulum, judge, monkeypatch):
    def refuse(method, scene):
        raise bs.SeriesError("too high an order")

    verlet = curve(pendulum, "stormer-verlet")
    assert not fitted_extrapolation(judge, verlet, 4.0).drifts
    monkeypatch.setattr(run_errors, "modified_terms", refuse)
    assert fitted_extrapolation(judge, verlet, 4.0).drifts
    assert fitted_extrapolation(judge, verlet, 1.0) == Extrapolation()


def test_modifying_integrators_drift_as_their_methods_do():
    found = bs.work_precision(bs.scene("pendulum"), "modifying-midpoint4", span=5, errors=(1e-1, 1e-3), budget=BUDGET)
    assert not fitted_extrapolation(Judge(found.scene, found.span), found.curves[0], 2.0).drifts


def test_errors_that_grow_exponentially_are_noticed():
    times = np.linspace(0, 1, 201)

    def after(course, drifts):
        return Extrapolation(4.0, drifts).error(RunErrors(solution=1.0, courses={"solution": course}), "solution")

    assert after(times, False) == pytest.approx(4, rel=0.3)
    assert after(times**2, True) == pytest.approx(16, rel=0.3)
    assert after(np.exp(20 * (times - 1)), True) is None
    uneven = Extrapolation(4.0, growth=None)
    assert uneven.error(RunErrors(solution=1.0, courses={"solution": times}), "solution") is None


@pytest.mark.usefixtures("laws")
def test_too_few_turns_do_not_tell_how_errors_grow():
    """From 1.6 turns of Kepler's ellipse dop853's error looks a hundred times too small after 8 turns."""
    kepler = bs.scene("kepler")
    found = bs.work_precision(kepler, ["dop853"], span=10, errors=(1e-3, 1e-7), measure="solution")
    with pytest.raises(bs.IntegratorError, match="how errors grow on from 10 to 50 may be unknown"):
        found.best(1e-5, span=50)


def test_the_energy_as_the_measure(pendulum):
    chosen = pendulum.best(1e-3, measure="energy")
    assert chosen.measure == "energy"
    assert chosen.error <= 1e-3
    data = json.loads(json.dumps(chosen.to_dict()))
    assert (data["schema"], data["kind"], data["method"]) == (1, "recommendation", chosen.method)


def test_methods_without_a_modified_hamiltonian_are_left_out_where_it_alone_counts():
    pendulum, options = bs.scene("pendulum"), {"span": 5, "errors": (1e-2, 1e-4), "measure": "modified-energy"}
    found = bs.work_precision(pendulum, ["rk4", "stormer-verlet"], **options, budget=BUDGET)
    assert found.left_out == {"rk4": "it has no modified Hamiltonian on pendulum"}
    assert found.curves[0].seconds(1e-3, "modified-energy") is not None
    with pytest.raises(bs.IntegratorError, match="modified-energy cannot: none of the methods has a modified Hamilton"):
        bs.work_precision(pendulum, "rk4", **options)


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
        (
            {"methods": ["modifying-midpoint99"]},
            "methods must have an even order from 4 to 10 behind modifying-midpoint, but one was",
        ),
        ({"methods": ["lawson4"]}, "methods must have one that fits pendulum, but had none"),
        ({"span": -1}, "span must be positive, but was -1"),
        ({"span": "x"}, "span must be a finite number"),
        ({"errors": (1e-5, 1e-3)}, "errors must be two numbers from 1 to 1e-15, the larger one first"),
        ({"errors": 3}, "errors must be two numbers"),
        ({"measure": "speed"}, "measure must be one of solution, energy, modified-energy, but was 'speed'"),
        ({"budget": 0}, "budget must be a positive number of seconds, but was 0"),
        ({"budget": True}, "budget must be a finite number, but was True"),
        ({"progress": 5}, "progress must be a function of two numbers, but was 5"),
    ],
)
def test_bad_arguments(options, message):
    with pytest.raises(bs.errors, match=message):
        bs.work_precision("pendulum", **options)


@pytest.mark.parametrize(
    ("scene", "message"),
    [("pendulumm", "did you mean pendulum"), (3, "scene must be a Scene or the name of one, but was 3")],
)
def test_no_scenes(scene, message):
    with pytest.raises(bs.IntegratorError, match=message):
        bs.work_precision(scene)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0,), "error must be positive, but was 0"),
        ((1e-30,), "error must be one that a method reaches on pendulum within its budget, but was 1e-30"),
        ((1e-3, 1.0), "span must be at least the one measured, 20, but was 1"),
        ((1e-3, None, "speed"), "measure must be one of"),
    ],
)
def test_bad_wishes(pendulum, arguments, message):
    with pytest.raises(bs.IntegratorError, match=message):
        pendulum.best(*arguments)


def test_the_picture_has_a_panel_for_each_measure_and_all_names(pendulum):
    pytest.importorskip("matplotlib")
    from bseries.advice.work_precision.diagram import draw

    figure = draw(pendulum)
    assert len(figure.axes) == 3
    assert {text.get_text() for text in figure.axes[0].texts} == set(METHODS)
