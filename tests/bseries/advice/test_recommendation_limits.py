"""Where nothing is recommended: finer steps that fail, and steps that meet the error by luck."""

from __future__ import annotations

import bseries as bs
from bseries.advice.timing import Timing
from bseries.advice.work_precision.recommendation import bracket, largest_step
from bseries.advice.work_precision.sweeps import Curve, Judge, Row, RunErrors, candidate


def curve_of(errors):
    """A method with such errors of the solution by numbers of steps."""
    rows = []
    for steps, error in errors.items():
        found = RunErrors(failure="step 1 failed") if error is None else RunErrors(error)
        rows.append(Row(1 / steps, steps, None if error is None else Timing(1e-6, 1e-6, 1e-6, 5), found))
    return Curve(candidate(bs.scene("pendulum"), "rk4"), tuple(rows))


class From:
    """In place of a judge: runs that meet any error from so many steps on, but for some numbers of steps."""

    def __init__(self, least, *but):
        self.least, self.but = least, but

    def run(self, candidate, steps):
        return RunErrors(1.0 if steps < self.least or steps in self.but else 1e-13)


def test_nothing_is_recommended_where_finer_steps_fail():
    runs = From(20)
    met = curve_of({10: 1e-2, 20: 1e-5, 40: 1e-6})
    step = largest_step(runs, met, 1e-4, "solution")
    assert step is not None
    assert step.steps == 20
    failed = curve_of({10: 1e-2, 20: 1e-5, 40: 1e-6, 80: None})
    assert largest_step(runs, failed, 1e-4, "solution") is None
    lucky = curve_of({10: 1e-5, 20: 1e-2, 40: 1e-3})
    assert largest_step(runs, lucky, 1e-4, "solution") is None


def test_a_step_that_meets_the_error_between_others_that_do_not_is_luck():
    found = curve_of({50: 1e-2, 100: 1e-5, 200: 1e-6})
    for but, expected in (((), 100), ((103,), 104), ((103, 117), 118), ((150,), 100)):
        step = largest_step(From(100, *but), found, 1e-4, "solution")
        assert step is not None
        assert step.steps == expected


def test_only_rounding_may_make_errors_of_finer_steps_larger():
    runs = From(20)
    for rounding in (3e-13, 9e-10):
        found = curve_of({10: 1e-2, 20: 2e-13, 40: rounding})
        step = largest_step(runs, found, 2e-13, "solution")
        assert step is not None
        assert step.steps == 20
    assert bracket({10: 1e-2, 20: 2e-13, 40: 3e-9}, 2e-13) == (None, 0)


def test_methods_whose_finer_steps_say_nothing_hide_no_other():
    class All:
        scene, span, problem, available = bs.scene("pendulum"), 1.0, None, ("solution",)

        def run(self, candidate, steps):
            return RunErrors(1e-5 if steps >= 160 else 1.0)

        def work(self, candidate, steps):
            return Judge(self.scene, self.span, ()).work(candidate, steps)

    lucky = curve_of({10: 1e-5, 20: None})
    dear = curve_of({80: 1e-2, 160: 1e-5})._replace(candidate=candidate(bs.scene("pendulum"), "gauss2"))
    found = bs.advice.WorkPrecision(All(), (1e-2, 1e-6), [lucky, dear], {})  # pyright: ignore[reportArgumentType]
    assert found.best(1e-4).method == "gauss2"
