"""Where nothing is recommended: finer steps that fail or say nothing, and motions that have not turned."""

from __future__ import annotations

import math

import numpy as np
import pytest
from steady_budgets import for_steps, stop_the_clock

import bseries as bs
from bseries.advice.timing import Timing
from bseries.advice.work_precision.candidates import candidate
from bseries.advice.work_precision.curves import Curve, Extrapolation, Row
from bseries.advice.work_precision.extrapolation import fitted_extrapolation
from bseries.advice.work_precision.recommendation import bracket, largest_step
from bseries.advice.work_precision.run_errors import Judge, RunErrors

BUDGET = for_steps(20_000)


@pytest.fixture(autouse=True)
def stopped_clock(monkeypatch):
    stop_the_clock(monkeypatch)


def evenly(error):
    return RunErrors(error, courses={"solution": np.linspace(0, error, 201)})


def curve_of(errors, courses=None):
    """A method with such errors of the solution by numbers of steps, which grow evenly or take a given course."""
    rows = []
    for steps, error in errors.items():
        found = RunErrors(failure="step 1 failed") if error is None else evenly(error)
        if courses and steps in courses:
            found = found._replace(courses={"solution": courses[steps]})
        rows.append(Row(1 / steps, steps, None if error is None else Timing(1e-6, 1e-6, 1e-6, 5), found))
    return Curve(candidate(bs.scene("pendulum"), "rk4"), tuple(rows))


class From:
    """In place of a judge: runs that meet any error from so many steps on, but for some numbers of steps."""

    def __init__(self, least, *but):
        self.least, self.but = least, but

    def run(self, candidate, steps):
        return evenly(1.0 if steps < self.least or steps in self.but else 1e-13)


def test_nothing_is_recommended_where_finer_steps_say_nothing():
    runs, exponential = From(20), np.exp(20 * np.linspace(-1, 0, 201))
    met = curve_of({10: 1e-2, 20: 1e-5, 40: 1e-6})
    for ahead in (Extrapolation(), Extrapolation(4.0)):
        step = largest_step(runs, met, ahead, 1e-4, "solution")
        assert step is not None
        assert step.steps == 20
    failed = curve_of({10: 1e-2, 20: 1e-5, 40: 1e-6, 80: None})
    assert largest_step(runs, failed, Extrapolation(), 1e-4, "solution") is None
    untold = curve_of({10: 1e-2, 20: 1e-5, 40: 1e-6}, {40: 1e-6 * exponential})
    assert largest_step(runs, untold, Extrapolation(), 1e-4, "solution") is not None
    assert largest_step(runs, untold, Extrapolation(4.0), 1e-4, "solution") is None
    lucky = curve_of({10: 1e-5, 20: 1e-2, 40: 1e-3})
    assert largest_step(runs, lucky, Extrapolation(), 1e-4, "solution") is None


def test_a_step_that_meets_the_error_between_others_that_do_not_is_luck():
    found = curve_of({50: 1e-2, 100: 1e-5, 200: 1e-6})
    for but, expected in (((), 100), ((103,), 104), ((103, 117), 118), ((150,), 100)):
        step = largest_step(From(100, *but), found, Extrapolation(), 1e-4, "solution")
        assert step is not None
        assert step.steps == expected


def test_only_rounding_may_make_errors_of_finer_steps_larger():
    runs = From(20)
    for rounding in (3e-13, 9e-10):
        found = curve_of({10: 1e-2, 20: 2e-13, 40: rounding})
        step = largest_step(runs, found, Extrapolation(), 2e-13, "solution")
        assert step is not None
        assert (step.steps, found.rounded("solution")) == (20, {20, 40})
    assert bracket({10: 1e-2, 20: 2e-13, 40: 3e-13}, 2e-13) == (None, 0)


def test_methods_whose_finer_steps_say_nothing_hide_no_other():
    class All:
        scene, span, problem, available = bs.scene("pendulum"), 1.0, None, ("solution",)

        def run(self, candidate, steps):
            return RunErrors(1e-5 if steps >= 160 else 1.0)

        def work(self, candidate, steps):
            return Judge(self.scene, self.span, ()).work(candidate, steps)

    lucky = curve_of({10: 1e-5, 20: None})
    dear = curve_of({80: 1e-2, 160: 1e-5})._replace(candidate=candidate(bs.scene("pendulum"), "gauss2"))
    found = bs.WorkPrecision(All(), (1e-2, 1e-6), [lucky, dear], {})  # pyright: ignore[reportArgumentType]
    assert found.best(1e-4).method == "gauss2"


def test_less_than_a_turn_does_not_tell_how_errors_grow(monkeypatch):
    """From half of Kepler's ellipse on, an error of 1e-3 after ten turns would have been one of 7e-3."""
    found = bs.work_precision("kepler", "stormer-verlet", span=3, errors=(1e-2, 1e-5), budget=BUDGET)
    assert found.best(1e-3, span=60).basis.endswith("as the modified equation tells")
    monkeypatch.setattr("bseries.advice.work_precision.extrapolation.predicted_factor", lambda *_: None)
    for measure in found.measures:
        with pytest.raises(bs.IntegratorError, match="from 3 to 60 may be unknown, since the motion turned too seldom"):
            found.best(1e-3, span=60, measure=measure)
        assert found.best(1e-3, measure=measure).error <= 1e-3
    judge, curve = Judge(found.scene, 3.0, ("energy",)), found.curves[0]
    assert fitted_extrapolation(judge, curve, 20.0).period == math.inf


@pytest.mark.parametrize(("span", "known"), [(5, False), (7.5, False), (16, True)])
def test_drifts_show_after_two_turns(span, known):
    """After 1.2 turns rk4's energy seems to drift a third of what it does; without a drift one turn is enough."""
    found = bs.work_precision("kepler", ["rk4", "stormer-verlet"], span=span, errors=(1e-2, 1e-4), budget=BUDGET)
    drifting, steady = (
        fitted_extrapolation(Judge(found.scene, span, ("energy",)), curve, 10.0) for curve in found.curves
    )
    assert (drifting.drifts, steady.drifts) == (True, False)
    assert drifting.is_possible("energy") == known
    assert steady.is_possible("solution") == known
    assert steady.is_possible("energy") == (span > 7)
