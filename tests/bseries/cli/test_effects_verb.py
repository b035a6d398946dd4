"""`bseries effects`, against the library and against itself in all formats."""

from __future__ import annotations

import csv
import io
import json
import re

import pytest

import bseries as bs
from bseries.cli.output import Progress
from bseries.cli.verbs.effects import FirstRun

DAMPED = ("pendulum", "--method", "explicit-midpoint", "--effect", "damping", "--parameter", "gamma=1e-6")
RUN = (*DAMPED, "--step", "1/20", "--span", "2")


@pytest.fixture
def effects(answer):
    """The answer in JSON."""
    return lambda *arguments, **options: json.loads(answer("effects", *arguments, "--format", "json", **options))


def untimed(data):
    """What does not depend on how long steps take."""
    rows = [{k: x for k, x in row.items() if k not in ("seconds", "uncertainty")} for row in data["rows"]]
    return {**{k: x for k, x in data.items() if k not in ("seconds_per_step", "machine")}, "rows": rows}


def test_json_says_what_the_library_computes(effects):
    data = effects(*RUN)
    report = bs.effect_influence(
        "explicit-midpoint", "pendulum", h=0.05, span=2, effects="damping", parameters={"gamma": "1e-6"}
    )
    assert untimed(data) == untimed(json.loads(json.dumps(report.to_dict())))
    assert (data["kind"], data["leave_out"], data["keep"], data["steps"]) == ("effects", ["damping"], [], 40)
    assert 0 < data["apart"]["solution"] <= data["promised"] <= data["accept"]
    assert data["seconds_per_step"]["full"]["seconds"] > 0
    assert "processor" in data["machine"]


def test_what_is_accepted(effects):
    assert effects(*RUN, "--accept", "1e-9")["leave_out"] == []
    by_energy = effects(*RUN, "--measure", "energy", "--accept", "1/10")
    assert (by_energy["accept"], by_energy["leave_out"], by_energy["measure"]) == (0.1, ["damping"], "energy")


def test_all_formats_agree(answer, effects):
    table, markdown = answer("effects", *RUN), answer("effects", *RUN, "--format", "markdown")
    rows = list(csv.reader(io.StringIO(answer("effects", *RUN, "--format", "csv"))))
    data = effects(*RUN)
    assert rows[0][:5] == ["effect", "solution", "energy", "alone_solution", "alone_energy"]
    (row,), own = data["rows"], data["own_error"]
    assert [float(x) for x in rows[1][1:5]] == [*row["left_out"].values(), *row["alone"].values()]
    assert (rows[1][0], rows[1][-1]) == ("damping", "true")
    assert [rows[2][0], *map(float, rows[2][1:3])] == ["", *own.values()]
    title = "Effects of pendulum, explicit-midpoint: 40 steps of 0.05\n"
    assert table.startswith(title)
    assert markdown.startswith(title)
    for name, found in (("damping", row["left_out"]), ("(error of the method)", own)):
        solution, energy = (f"{found[key]:.2g}" for key in ("solution", "energy"))
        assert re.search(rf"\n{re.escape(name)} +{solution} +{energy}( .*)?\n", table)
        assert f"| `{name}` | `{solution}` | `{energy}` |" in markdown
    assert re.search(r"\nLeave out damping.*; keep none: \S+ is accepted for the solution\.\nPromised: ", table)
    assert r"(error of the method) & " in answer("effects", *RUN, "--format", "latex")


def test_scenes_from_files_and_standard_input(effects, tmp_path):
    text = bs.scene("pendulum", effects=["damping"], gamma="1e-6").to_toml()
    file = tmp_path / "mine.toml"
    file.write_text(text, encoding="utf-8")
    expected = untimed(effects(*RUN))
    options = ("--method", "explicit-midpoint", "--step", "1/20", "--span", "2")
    assert untimed(effects(str(file), *options)) == expected
    assert untimed(effects("-", *options, stdin=text)) == expected


def test_starts_and_options_of_built_in_scenes(effects):
    moved = effects(*RUN, "--start", "p=1;q=0")
    assert moved["rows"][0]["alone"] != effects(*RUN)["rows"][0]["alone"]
    options = ("--method", "explicit-midpoint", "--step", "0.01", "--span", "0.1", "--parameter", "masses=1,1,2")
    found = effects("n-body", *options, "--parameter", "epsilon=1/100")
    values = {"masses": ["1", "1", "2"], "epsilon": "1/100"}
    report = bs.effect_influence("explicit-midpoint", "n-body", h=0.01, span=0.1, parameters=values)
    assert found["rows"][0]["left_out"] == report.rows[0].left_out._asdict()
    assert found["keep"] == ["softening"]


def test_costs_without_a_span(answer, effects):
    call = (*DAMPED[:5], "--step", "0.05", "--order", "4")
    data = effects(*call)
    assert (data["kind"], data["order"], data["h"]) == ("effect-costs", 4, 0.05)
    assert [(row["effects"], row["trees"], row["all_trees"]) for row in data["rows"]] == [
        ([], 8, 8),
        (["damping"], 8, 8),
    ]
    assert all(row["field"]["seconds"] > 0 and row["step"]["seconds"] > 0 for row in data["rows"])
    names, *table = csv.reader(io.StringIO(answer("effects", *call, "--format", "csv")))
    numbers = [dict(zip(names, line, strict=True)) for line in table]
    assert [(line["on"], line["effects"], line["trees"]) for line in numbers] == [("0", "", "8"), ("1", "damping", "8")]
    assert all(
        0 < float(line["step_low"]) <= float(line["step_seconds"]) <= float(line["step_high"]) for line in numbers
    )
    found = answer("effects", *call)
    assert found.startswith("Cost of effects of pendulum, explicit-midpoint\n\non  effects ")
    assert re.search(r"\n 1  damping +\S+ ns +\S+ +\S+ ns +\S+ +8 +8\n", found)


class Shown(Progress):
    """Progress that is kept."""

    def __init__(self, shown):
        super().__init__()
        self.shown = shown

    def update(self, done, total):
        self.shown.append((done, total))


def test_the_first_run_tells_how_long_all_take(monkeypatch, capsys):
    """A clock of our own: steps take 10 ms, and compiling before the second run half an hour."""
    now, shown = [0.0], []
    for module in ("bseries.advice.predictions.prediction", "bseries.cli.options.expectation"):
        monkeypatch.setattr(f"{module}.perf_counter", lambda: now[0])
    first = FirstRun(Shown(shown), 0.1, 10.0)
    for done, seconds in ((1, 0.01), (41, 0.41), (100, 1.0), (110, 1800.0), (600, 1805.0)):
        now[0] = seconds
        first(done, 600)
    assert shown == [(done, 600) for done in (1, 41, 100, 110, 600)]
    expected = first.watch.prediction
    assert expected is not None
    assert (expected.steps, expected.h, expected.seconds) == (600, 0.1, pytest.approx(6.0, rel=0.01))
    assert capsys.readouterr().err.startswith(
        "bseries: expected: 6 s, errors unknown: they are the result of the measurement"
    )


def test_further_runs_announce_nothing(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr("bseries.advice.predictions.prediction.perf_counter", lambda: now[0])
    first = FirstRun(Shown([]), 0.1, 1.0)
    for done, seconds in ((1, 0.0), (10, 0.1), (11, 60.0), (20, 61.0), (60, 70.0)):
        now[0] = seconds
        first(done, 60)
    assert first.watch.prediction is None
    assert not capsys.readouterr().err


MISTAKES = {
    "no scene": ("--method rk4 --step 0.1", "SCENE must be given"),
    "no method": ("pendulum --step 0.1", "method must be given"),
    "no step": ("pendulum --method rk4 --span 2", "step must be given"),
    "no effects": ("lorenz --method rk4 --step 0.1 --span 2", "scene must have effects, but lorenz has none"),
    "unknown effect": ("kepler --method rk4 --step 0.1 --span 2 --effect wind", "the effects are relativity"),
    "parameter": ("pendulum --method rk4 --step 0.1 --span 2 --parameter mass=2", "there is no parameter mass"),
    "accept alone": ("pendulum --method rk4 --step 0.1 --accept 1", "span must be given with --accept"),
    "measure alone": ("pendulum --method rk4 --step 0.1 --measure energy", "span must be given with --measure"),
    "a run that is wrong": (
        "kepler --method rk4 --step 0.02 --span 6 --start p=0,1",
        "h must be small enough for an accurate run, or accept be given, but with 0.02 the error of the method",
    ),
    "energies beyond all numbers": (
        "pendulum --method rk4 --step 0.05 --span 1 --effect damping --start p=1e300 --measure energy",
        "the error of the method itself is inf",
    ),
    "order": ("pendulum --method rk4 --step 0.1 --span 1 --order 3", "order must be left out with --span"),
    "no number": ("pendulum --method rk4 --step x --span 1", "step must be"),
    "span": ("pendulum --method rk4 --step 0.1 --span -1", "span must be positive"),
    "beyond doubles": ("pendulum --method rk4 --step 1e-3 --span 1e400", "span must be a finite number, but was"),
    "many steps": ("pendulum --method rk4 --step 1e-320 --span 1e300", "must"),
    "zero": ("pendulum --method rk4 --step 0", "h must not be zero, but was 0"),
    "measure": ("pendulum --method rk4 --step 0.1 --span 1 --measure x", "measure must be one of solution, energy"),
    "two stdins": ("- --method - --step 0.1 --span 1", "METHOD and SCENE must not both be -|must"),
    "splitting": ("pendulum --method strang --step 0.1 --span 1", "parts must say what the method's parts a, b"),
    "kind": ("kepler --method blanes-moan-rkn6 --step 0.1 --span 1", "scene must be of the kind that blanes-moan-rkn6"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_end_in_one_line(run, mistake):
    line, sentence = MISTAKES[mistake]
    result = run("effects", *line.split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("bseries: error: ")
    assert result.stderr.count("\n") == 1
    assert re.search(sentence, result.stderr), result.stderr
