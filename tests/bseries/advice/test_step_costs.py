"""What steps cost: short runs are repeated from their start, not prolonged."""

import numpy as np
import pytest

import bseries as bs
from bseries.advice.timing import Work, step_costs
from integrators.steppers.stepping import Stepper


@pytest.fixture
def repetitions(monkeypatch):
    """The numbers of steps and of repetitions that are asked for."""
    asked, repeat = [], Stepper.repeat

    def noted(self, state, steps, times):
        asked.append((steps, times))
        repeat(self, state, steps, times)

    monkeypatch.setattr(Stepper, "repeat", noted)
    return asked


@pytest.mark.parametrize("most", [1, 10])
def test_runs_are_repeated_and_not_prolonged(repetitions, most):
    found = step_costs({"a": Work(bs.scene("pendulum"), "rk4", 0.1, most_steps=most)}, sample=0.001)["a"]
    assert {steps for steps, _ in repetitions} == {most}
    assert repetitions[-1][1] > 20
    assert found.low <= found.seconds <= found.high


def test_runs_that_end_are_repeated_up_to_there(repetitions):
    """y' = y² with h = 1/10 has no twentieth step."""
    step_costs({"a": Work(bs.scene("riccati"), "rk4", 0.1)}, sample=0.001)
    assert max(steps for steps, _ in repetitions) < 20


def test_stages_that_need_newtons_method_are_found_by_it(repetitions):
    stiff = bs.scene("van-der-pol")
    step_costs({"a": Work(stiff, "radau-iia2", 1e-3, options={"solver": "auto"}, most_steps=5)}, sample=0.001)
    assert repetitions


def test_compiling_is_not_taken_for_a_step(repetitions):
    """Nobody has used this stepper: loading it takes longer than a sample."""
    scene = bs.parse_scene("y' = -sin(1.2345678*y)")
    step_costs({"a": Work(scene, "rk4", 0.1, np.ones(1), most_steps=50)}, sample=0.001)
    assert {steps for steps, _ in repetitions} == {50}


def test_runs_that_change_their_solver_are_timed_as_they_go(repetitions):
    """Newton's method does not find the first of these steps, fixed-point iteration none of the later ones."""
    scene, options = bs.scene("lotka-volterra"), {"solver": "auto"}
    work = Work(scene, "radau-iia7", 200 / 188, options=options, most_steps=188)
    stepper = bs.stepper("radau-iia7", scene, solver="newton")
    with pytest.raises(bs.IntegratorError, match="188 could not"):
        stepper.repeat(stepper.start(h=work.h), 188, 1)
    repetitions.clear()
    step_costs({"a": work}, sample=0.001)
    (before, _), (after, _) = repetitions[:2]
    assert before + after == 188
    only_fixed = bs.stepper("radau-iia7", scene, solver="fixed-point")
    only_fixed.advance(only_fixed.start(h=work.h), before)
    with pytest.raises(bs.IntegratorError, match=f"step {before + 1}, from"):
        only_fixed.advance(only_fixed.start(h=work.h), before + 1)


def test_a_run_stays_where_it_is():
    pendulum = bs.scene("pendulum")
    for name in ("stormer-verlet", "gauss2"):
        stepper = bs.stepper(name, pendulum)
        one, other = stepper.start(h=0.1), stepper.start(h=0.1)
        for state in (one, other):
            stepper.advance(state, 3)
        stepper.repeat(one, 7, 3)
        assert (one.n, one.t) == (other.n, other.t)
        for state in (one, other):
            stepper.advance(state, 7)
        assert (one.y == other.y).all()


@pytest.mark.parametrize(
    ("steps", "times", "sentence"),
    [
        (100, 1, "steps must be so few that all can be made, but 100 could not"),
        (-1, 1, "steps must be a whole number, 0 or more, but was -1"),
        (1, 1.5, "times must be a whole number, 0 or more, but was 1.5"),
    ],
)
def test_mistakes(steps, times, sentence):
    stepper = bs.stepper("implicit-midpoint", bs.scene("riccati"), solver="fixed-point")
    with pytest.raises(bs.IntegratorError, match=sentence):
        stepper.repeat(stepper.start(h=0.1), steps, times)
