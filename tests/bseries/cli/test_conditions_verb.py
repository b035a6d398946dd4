from __future__ import annotations

import csv
import io
import json

import pytest

import bseries as bs


def test_table(answer):
    lines = answer("conditions", "runge-kutta", "--order", "3").splitlines()
    assert lines[0] == "Order 3 of Runge–Kutta methods: 4 conditions"
    assert "  3  [[τ]]   Σ b_i a_ij c_j = 1/6" in lines
    assert lines[-1] == "c_i = Σ_j a_ij."


@pytest.mark.parametrize(
    ("arguments", "count"),
    [
        (("runge-kutta", "--order", "7"), 85),
        (("RUNGE_KUTTA", "--order", "5", "--assume", "B5 C2 D1"), 1),
        (("runge-kutta", "--order", "5", "--assume", "B(6), C(2), D(2)"), 0),
        (("runge-kutta", "--order", "5", "--scalar"), 12),
        (("runge-kutta", "--scalar", "nonautonomous", "--order", "5"), 16),
        (("runge-kutta", "--scalar", "--order", "5"), 12),
        (("runge-kutta", "--order", "5", "--symmetric"), 12),
        (("runge-kutta", "--order", "5", "--max-children", "1"), 5),
        (("additive", "--order", "2", "--colors", "3"), 12),
        (("nystrom", "--order", "5"), 20),
        (("general-nystrom", "--order", "2"), 4),
        (("rosenbrock", "--order", "4"), 8),
        (("splitting", "--order", "5"), 14),
    ],
)
def test_json_and_csv(answer, arguments, count):
    data = json.loads(answer("conditions", *arguments, "--format", "json"))
    assert (data["schema"], data["kind"], data["methods"]) == (1, "conditions", arguments[0].lower().replace("_", "-"))
    assert len(data["conditions"]) == count
    rows = list(csv.DictReader(io.StringIO(answer("conditions", *arguments, "--format", "csv"))))
    assert [row["left"] for row in rows] == [c["left"] for c in data["conditions"]]
    assert f"{count} condition" in answer("conditions", *arguments).splitlines()[0]


def test_json_against_the_library(answer):
    data = json.loads(answer("conditions", "partitioned", "--order", "3", "--format", "json"))
    assert data["colors"] == ["p", "q"]
    for record, condition in zip(data["conditions"], bs.order_conditions("partitioned", 3), strict=True):
        tree = bs.Tree.from_levels(record["levels"], record["colors"])
        assert (tree, record["order"]) == (condition.tree, condition.tree.order)
        assert (record["tree"], record["right"]) == (tree.text(["p", "q"]), str(condition.right))
    scalar = json.loads(answer("conditions", "runge-kutta", "--scalar", "--format", "json"))
    assert scalar["scalar"] == "autonomous"
    assert scalar["conditions"][-2]["isomeric"] == ["[τ,[τ]]"]


def test_latex_and_markdown_and_notes(answer):
    latex = answer("conditions", "runge-kutta", "--order", "2", "--format", "latex")
    assert latex.splitlines()[2] == r"\sum_{i} b_{i} c_{i} &= \frac{1}{2}"
    markdown = answer("conditions", "runge-kutta", "--order", "2", "--format", "markdown")
    assert "| `2` | `[τ]` | `Σ b_i c_i = 1/2` |" in markdown
    assert "C(2), D(1)" in answer("conditions", "runge-kutta", "--assume", "C2 D1")
    assert "y' = f(t, y)" in answer("conditions", "runge-kutta", "--scalar", "nonautonomous")
    assert "even numbers of nodes" in answer("conditions", "splitting", "--symmetric")


@pytest.mark.parametrize("language", ["numpy", "julia", "c"])
def test_code_on_stdout_and_in_a_file(answer, tmp_path, language):
    arguments = ("conditions", "partitioned", "--order", "2", "--structure", "explicit,full", "--stages", "2")
    source = answer(*arguments, "--code", language)
    conditions = bs.order_conditions("partitioned", 2, structure=["explicit", "full"])
    assert source == conditions.code(language, stages=2)
    assert "residual" in source
    assert "jacobian" in source
    target = tmp_path / "conditions.any"
    assert answer(*arguments, "--code", language, "-o", str(target)) == ""
    assert target.read_text(encoding="utf-8") == source


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("euler",), "kind must be one of runge-kutta, partitioned"),
        (("runge-kutta", "--order", "0"), "order must be 1 or more"),
        (("runge-kutta", "--order", "x"), "order must be a whole number"),
        (("runge-kutta", "--order", "30"), "order must be smaller: there would be"),
        (("runge-kutta", "--stages", "-1"), "stages must be 1 or more, but was -1"),
        (("runge-kutta", "--assume", "B(x)"), "assumptions must be like"),
        (("runge-kutta", "--scalar", "no"), "scalar must be"),
        (("runge-kutta", "--colors", "2"), "colors must be left out"),
        (("runge-kutta", "--structure", "lower"), "structure must be one of"),
        (("runge-kutta", "--structure", "full", "--explicit"), "structure must be left out where --explicit"),
        (("splitting", "--explicit"), "structure must be left out"),
        (("nystrom", "--max-children", "2"), "max_children must be left out"),
        (("runge-kutta", "--code", "c"), "stages must be given"),
        (("runge-kutta", "--code", "cobol", "--stages", "2"), "language must be one of"),
        (("runge-kutta", "--code", "numpy", "--format", "json"), "format must be left out where --code"),
        (("runge-kutta", "--code", "numpy", "--assume", "B4 C2 D1"), "there must be conditions to write code for"),
        ((), "Missing argument 'KIND'"),
    ],
)
def test_bad_input(run, arguments, sentence):
    result = run("conditions", *arguments)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not result.stdout
