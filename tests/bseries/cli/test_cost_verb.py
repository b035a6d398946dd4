"""`bseries cost` in all formats, against the library, and what it refuses."""

from __future__ import annotations

import csv
import io
import json
import re
from types import SimpleNamespace

import pytest

import bseries as bs
from bseries.advice.timing import Timing
from bseries.advice.work_precision.precision_curves import run_times
from bseries.advice.work_precision.recommendation import Recommendation
from bseries.advice.work_precision.sweeps import Curve, Row, RunErrors

SMALL = ("cost", "pendulum", "--methods", "stormer-verlet,rk4", "--span", "10", "--errors", "1e-2:1e-4")


def test_the_table_and_the_recommendation(answer):
    lines = answer(*SMALL, "--measure", "solution", "--error", "1e-3").splitlines()
    assert lines[0] == "pendulum, t = 0 to 10: CPU time against the error of the solution"
    assert lines[2].split() == ["method", "1e-02", "1e-03", "1e-04"]
    table = {line.split()[0]: line for line in lines[4:6]}
    assert set(table) == {"stormer-verlet", "rk4"}
    assert sum(line.count("*") for line in table.values()) == 3
    advice = next(line for line in lines if line.startswith("Error 1e-03: "))
    assert re.split(r" {2,}", table[advice.split()[2]].strip())[2].endswith("*")
    assert "with h = " in advice
    assert "(measured over 10)" in advice
    assert any(line.startswith("Measured ") for line in lines)


def test_cells_are_runs_and_the_star_is_at_the_method_that_is_recommended():
    """The row with 20 steps meets 1e-5 by chance: with 40 it is not met."""

    def curve(name, *rows, step=1e-6):
        timing = Timing(step, step, step, 5)
        kept = (Row(1 / n, n, timing, RunErrors(solution=error)) for n, error in rows)
        return Curve(SimpleNamespace(name=name), tuple(kept))

    errors, rows = (1e-3, 1e-4, 1e-5), ((10, 1e-2), (20, 1e-6), (40, 5e-4), (80, 5e-5), (160, 5e-6))
    curves = [curve("rk4", *rows), curve("gauss2", (10, 5e-4), (20, 2e-5), (40, 1e-6)), curve("midpoint", (50, 1e-3))]
    times, stars = zip(*run_times(curves, errors, "solution", {}), strict=True)
    assert [column.get("rk4") for column in times] == pytest.approx([20e-6, 80e-6, 160e-6])
    assert [column.get("gauss2") for column in times] == pytest.approx([10e-6, 20e-6, 40e-6])
    assert [column.get("midpoint") for column in times] == [pytest.approx(50e-6), None, None]
    assert stars == ("gauss2", "gauss2", "gauss2")
    choice = Recommendation("rk4", 0.1, 100, 9e-6, 1e-4, "solution", 10.0, "measured over 10", {"gauss2": 30e-6})
    times, stars = zip(*run_times(curves, errors, "solution", {1e-4: choice, 1e-5: "no method"}), strict=True)
    assert [column["rk4"] for column in times] == pytest.approx([9e-6, 9e-6, 160e-6])  # which meets a larger error
    assert [column["gauss2"] for column in times] == pytest.approx([10e-6, 30e-6, 40e-6])
    assert stars == ("rk4", "rk4", None)
    dear = choice._replace(examined={"gauss2": 35e-6}, seconds=100e-6)
    times, _ = zip(*run_times(curves, errors, "solution", {1e-3: dear}), strict=True)
    assert [column["rk4"] for column in times] == pytest.approx([100e-6, 160e-6, 160e-6])  # not 80: that was chance
    assert [column["gauss2"] for column in times] == pytest.approx([35e-6, 40e-6, 40e-6])


def test_json_and_csv_have_all_runs(answer):
    data = json.loads(answer(*SMALL, "--error", "1e-3", "--format", "json"))
    assert (data["schema"], data["kind"], data["scene"], data["span"]) == (1, "work-precision", "pendulum", 10.0)
    assert data["measures"] == ["solution", "energy"]
    choice = data["choices"][0]
    assert choice["wanted"] == 1e-3
    assert choice["error"] <= 1e-3
    assert (choice["span"], choice["basis"]) == (10.0, "measured over 10")
    rows = list(csv.DictReader(io.StringIO(answer(*SMALL, "--measure", "solution", "--format", "csv"))))
    methods = {entry["method"]: entry["rows"] for entry in data["methods"]}
    assert {row["method"] for row in rows} == set(methods)
    row = next(row for row in rows if row["method"] == "rk4" and row["steps"] == str(methods["rk4"][2]["steps"]))
    assert float(row["solution"]) == methods["rk4"][2]["solution"]
    assert row["energy"]  # is measured in any case


def test_tableau_files_beside_names(answer, tmp_path):
    mine = tmp_path / "mine.json"
    bs.save_method(bs.RungeKutta([[0, 0], ["1/2", 0]], [0, 1], name="mine"), mine)
    options = ("--span", "5", "--errors", "1e-1:1e-2", "--measure", "energy")
    lines = answer("cost", "pendulum", "--methods", f"rk4,{mine}", *options).splitlines()
    assert {line.split()[0] for line in lines[4:6]} == {"rk4", "mine"}


def test_budgets(answer):
    rows = [
        len(json.loads(answer(*SMALL[:-1], "1e-2:1e-12", "--budget", budget, "--format", "json"))["methods"][0]["rows"])
        for budget in ("1e-5", "1e-1")
    ]
    assert rows[0] < rows[1]


def test_the_picture_is_written_and_the_text_goes_to_stdout(answer, tmp_path):
    pytest.importorskip("matplotlib")
    for name, begin in (("cost.svg", b"<?xml"), ("cost.png", b"\x89PNG")):
        path = tmp_path / name
        text = answer(*SMALL, "--measure", "energy", "--plot", str(path))
        assert "error of the energy" in text
        assert path.read_bytes().startswith(begin)
    assert answer(*SMALL, "--measure", "energy", "-o", str(tmp_path / "cost.md")) == ""
    assert (tmp_path / "cost.md").read_text(encoding="utf-8").startswith("pendulum")
    assert len(list(tmp_path.iterdir())) == 3


def test_what_does_not_fit_and_what_is_out_of_reach_is_said(answer):
    small = ("--methods", "rk4,rkn-verlet", "--span", "1", "--errors", "1e-2:1e-3")
    text = answer("cost", "lorenz", *small, "--error", "1e-25")
    assert "Left out: rkn-verlet: scene must" in text
    assert "Error 1e-25: error must be one that a method reaches on lorenz" in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "SCENE must be given"),
        (("pendulum", "--methods", "rk5"), "name must be a method of the catalogue, but was 'rk5'"),
        (("pendulum", "--methods", ","), "methods must name at least one method"),
        (("pendulum", "--errors", "1e-3"), "errors must be A:B, as in 1e-3:1e-12, but was '1e-3'"),
        (("pendulum", "--errors", "1:2"), "errors must be two numbers from 1 to 1e-15"),
        (("pendulum", "--span", "0"), "span must be positive"),
        (("pendulum", "--measure", "x"), "measure must be one of solution, energy, but was 'x'"),
        (("pendulum", "--against", "steps"), "against must be one of seconds, evaluations, but was 'steps'"),
        (("pendulum", "--against", "evaluations"), "against must come with --plot, but came without"),
        (("pendulum", "--format", "latex"), "format must be one of table, json, csv, markdown, html, but was 'latex'"),
        (("pendulum", "-o", "k.tex"), "output must end in one of .txt, .json, .csv, .md, .html where"),
        (("pendulum", "--span", "1e300"), "span must be at most 6.02e+05 for pendulum"),
        (("pendulum", "--plot", "missing/cost.png"), "plot must be a file in a folder that is there"),
        (("pendulum", "-o", "cost.png"), "output must end in one of"),
        (("pendulum", "--budget", "0"), "budget must be positive, but was '0'"),
    ],
)
def test_refusals(run, arguments, message):
    result = run("cost", *arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


def test_errors_are_shown_as_they_were_given(answer):
    text = answer(*SMALL, "--error", "2.5e-3", "--error", "1e-3")
    assert [line.split(":")[0] for line in text.splitlines() if line.startswith("Error")] == [
        "Error 2.5e-03",
        "Error 1e-03",
    ]
