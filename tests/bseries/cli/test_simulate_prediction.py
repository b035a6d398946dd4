"""`bseries simulate --predict`: the line beforehand, the notes afterwards, and JSON."""

from __future__ import annotations

import json

import pytest

import bseries as bs
from bseries.cli.options import expectation
from bseries.cli.options.expectation import Expectation
from bseries.cli.output import Progress

RUN = ("simulate", "pendulum", "--method", "rk4", "--step", "0.1", "--steps", "2000")
LINE = "bseries: expected: "


def test_a_line_beforehand_and_notes_afterwards(run):
    found = run(*RUN, "--predict")
    assert found.exit_code == 0
    assert found.stderr.startswith(LINE)
    assert found.stderr.count("\n") == 1
    assert "relative energy error 2.2e-04, relative solution error " in found.stderr
    assert "(from the modified equation to h^6)" in found.stderr
    assert "Met and expected: " in found.stdout
    assert "relative energy error 2.2e-04 (expected: 2.2e-04)" in found.stdout


@pytest.mark.parametrize("option", [(), ("--no-predict",)])
def test_short_runs_say_nothing(run, option):
    found = run(*RUN, *option)
    assert not found.stderr
    assert "expected" not in found.stdout


def test_json_has_prediction_and_outcome(run):
    data = json.loads(run(*RUN, "--predict", "--format", "json").stdout)
    expected = bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=2000, timed=False)
    prediction = data["prediction"]
    assert prediction["energy_error"]["value"] == pytest.approx(expected.energy.value)
    assert prediction["solution_error"]["value"] == pytest.approx(expected.solution.value)
    assert prediction["powers"] == [4, 5, 6]
    assert prediction["seconds"] > 0
    energy = next(row for row in data["rows"] if row["what"] == "energy")
    assert data["outcome"]["energy_error"] == energy["relative"]
    assert 1 / 3 < energy["relative"] / prediction["energy_error"]["value"] < 3


def test_json_without_a_prediction_is_as_it_was(run):
    data = json.loads(run(*RUN, "--format", "json").stdout)
    assert "prediction" not in data
    assert "outcome" not in data


def test_a_prediction_changes_no_number(run):
    plain, predicted = (json.loads(run(*RUN, *x, "--format", "json").stdout) for x in ((), ("--predict",)))
    assert plain["rows"] == predicted["rows"]


def test_long_runs_are_announced_by_themselves(run, monkeypatch):
    """With less patience a second is long: the beginning of the run itself is its calibration."""
    monkeypatch.setattr(expectation, "LONG", 0.0)
    monkeypatch.setattr(expectation, "SECONDS", 0.05)
    monkeypatch.setattr(expectation, "COMPARABLE", 0.0)
    found = run(*RUN[:-1], "3000000")
    assert found.stderr.startswith(LINE)
    assert "over the first" in found.stderr
    assert "took " in found.stdout


def test_energy_that_effects_take_is_no_error(run):
    call = ("pendulum", "--effect", "damping", "--method", "rk4", "--step", "0.1", "--steps", "2000", "--predict")
    assert "energy error" not in run("simulate", *call).stdout
    assert json.loads(run("simulate", *call, "--format", "json").stdout)["outcome"]["energy_error"] is None


def test_nothing_is_relative_to_an_energy_that_is_only_rounding(run):
    call = ("simulate", "pendulum", "--start", "p=0;q=pi/2", "--method", "rk4", "--step", "0.1", "--steps", "500")
    data = json.loads(run(*call, "--predict", "--format", "json").stdout)
    energy = data["rows"][0]
    assert (energy["what"], energy["relative"]) == ("energy", None)
    assert data["outcome"]["energy_error"] == energy["change"] < 1e-3
    assert 1 / 3 < energy["change"] / data["prediction"]["energy_error"]["value"] < 3


def test_what_cannot_be_known_is_said(run):
    found = run("simulate", "pendulum", "--method", "rk4", "--step", "3", "--steps", "100", "--predict")
    assert "errors unknown: " in found.stderr
    assert "Met and expected" in found.stdout


def test_ensembles_say_how_long_they_take(run, monkeypatch):
    monkeypatch.setattr(expectation, "SECONDS", 0.0)
    found = run(*RUN, "--ensemble", "200", "--spread", "0.1", "--predict", "--workers", "1")
    assert found.exit_code == 0, found.output
    assert found.stderr.startswith(LINE)
    assert "each run has a start of its own" in found.stderr


def test_ensembles_that_are_over_at_once_say_so_if_asked(run, monkeypatch):
    monkeypatch.setattr(expectation, "SECONDS", 600.0)
    many = (*RUN, "--ensemble", "20", "--spread", "0.1", "--workers", "1")
    assert run(*many, "--predict").stderr == "bseries: expected: nothing, since all was done within 600 s\n"
    assert not run(*many).stderr


class TestExpectation:
    """The calibration by a run's own beginning, by a clock of our own."""

    @pytest.fixture
    def clock(self, monkeypatch):
        """A clock that stands still unless it is set."""
        now = [100.0]
        for module in ("bseries.advice.predictions.prediction", "bseries.cli.options.expectation"):
            monkeypatch.setattr(f"{module}.perf_counter", lambda: now[0])
        return now

    @staticmethod
    def expected(seconds=None):
        from bseries.advice.predictions.prediction import time_only

        return time_only(0.1, 10, "nobody looked", seconds)

    def expectation(self, clock, wanted=None):
        def predict(cost):
            clock[0] += 7.0  # a prediction takes its time
            return self.expected(cost and 10 * cost)

        return Expectation(Progress(), predict, wanted, beforehand=False)

    def test_time_for_the_prediction_does_not_count(self, clock, capsys):
        watch = self.expectation(clock)
        for done, now in ((10, 100.0), (20, 101.0)):
            clock[0] = now
            watch(done, 1010)
        clock[0] += 99.0
        watch(1010, 1010)
        outcome = watch.to_dict(None)["outcome"]
        assert watch.prediction is not None
        assert watch.prediction.seconds == pytest.approx(100.0)
        assert watch.seconds == outcome["seconds"] == pytest.approx(100.0)
        assert "expected: 100 s, errors unknown: nobody looked" in capsys.readouterr().err

    def test_a_run_that_will_soon_end_is_not_announced(self, clock):
        watch = self.expectation(clock)
        for done, now in ((10, 100.0), (20, 101.0), (40, 103.0)):
            clock[0] = now
            watch(done, 40)
        assert watch.prediction is None
        assert watch.to_dict(None) == {}

    def test_a_prediction_after_the_last_step_takes_nothing_off_the_time(self, clock, monkeypatch):
        monkeypatch.setattr(expectation, "LONG", 0.0)
        watch = self.expectation(clock)
        for done, now in ((10, 100.0), (20, 101.0)):
            clock[0] = now
            watch(done, 20)
        assert watch.prediction is not None
        assert watch.seconds == pytest.approx(1.0)

    def test_a_run_that_goes_on_takes_what_is_left(self, clock):
        watch = self.expectation(clock)
        for done, now in ((900, 100.0), (910, 101.0)):
            clock[0] = now
            watch(done, 1000)
        assert watch.prediction is not None
        assert watch.prediction.seconds == pytest.approx(10.0)
