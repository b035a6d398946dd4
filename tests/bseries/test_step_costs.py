"""What steps cost: short runs are repeated from their start, not prolonged."""

import pytest

import bseries as bs
from bseries.advice.step_costs import Work, step_costs
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


def test_a_run_stays_where_it_is():
    pendulum = bs.scene("pendulum")
    for name in ("stormer-verlet", "gauss2"):
        stepper = bs.stepper(pendulum, name)
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
    stepper = bs.stepper(bs.scene("riccati"), "implicit-midpoint", solver="fixed-point")
    with pytest.raises(bs.IntegratorError, match=sentence):
        stepper.repeat(stepper.start(h=0.1), steps, times)
