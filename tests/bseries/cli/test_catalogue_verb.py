from __future__ import annotations

import csv
import io
import json

import pytest

import bseries as bs


def test_catalogue_in_every_format(answer):
    entries = bs.catalogue()
    data = json.loads(answer("methods", "--format", "json"))
    assert (data["schema"], data["kind"], len(data["methods"])) == (1, "methods", len(entries))
    rk4 = next(entry for entry in data["methods"] if entry["name"] == "rk4")
    assert (rk4["kind"], rk4["stages"], rk4["order"]) == ("explicit", 4, 4)
    assert rk4["reference"].startswith("W. Kutta")
    rows = list(csv.DictReader(io.StringIO(answer("methods", "--format", "csv"))))
    assert [row["name"] for row in rows] == [entry["name"] for entry in data["methods"]]
    for format in ("table", "markdown", "latex"):
        text = answer("methods", "--format", format)
        assert all(entry.name in text for entry in entries)


def test_catalogue_shows_families_aliases_and_parameters(answer):
    text = answer("methods")
    assert "gauss{s}" in text
    assert "also: stormer-verlet, velocity-verlet, leapfrog, UTU" in text
    assert "parameters: gamma" in text


@pytest.mark.parametrize("name", ["rk4", "gauss3", "tsit5", "dormand-prince54", "stormer-verlet-kdk", "sdirk2"])
def test_json_of_one_method_is_a_tableau_file(answer, tmp_path, name):
    path = tmp_path / "method.json"
    answer("methods", name, "-o", str(path))
    assert bs.load_method(path) == bs.method(name)
    from_name = answer("series", name, "--order", "3")
    assert answer("series", str(path), "--order", "3") == from_name
    assert answer("series", "-", "--order", "3", stdin=path.read_bytes()) == from_name


def test_one_method_with_its_source(answer):
    text = answer("methods", "classical-rk4")
    assert str(bs.method("rk4")) in text
    assert "kind: explicit, stages: 4, order: 4" in text
    assert "aliases: classical-rk4" in text
    assert "reference: W. Kutta, Z. Math. Phys. 46 (1901)" in text
    family = answer("methods", "gauss2", "--format", "markdown")
    assert "```text\n1/2 - sqrt(3)/6 │ 1/4" in family
    assert "- kind: implicit, stages: 2, order: 2s with s stages" in family
    assert "order" not in answer("methods", "--A", "0", "--b", "1")


def test_tableau_as_csv_and_latex(answer):
    rows = list(csv.reader(io.StringIO(answer("methods", "fehlberg45", "--format", "csv"))))
    assert rows[0] == ["part", "row", "node", "1", "2", "3", "4", "5", "6"]
    assert [row[1] for row in rows[1:]] == ["A1", "A2", "A3", "A4", "A5", "A6", "b", "embedded"]
    assert rows[4] == ["", "A4", "12/13", "1932/2197", "-7200/2197", "7296/2197", "0", "0", "0"]
    parts = list(csv.reader(io.StringIO(answer("methods", "leapfrog", "--format", "csv"))))[1:]
    assert [row[:2] for row in parts] == [[part, row] for part in "pq" for row in ("A1", "A2", "b")]
    latex = answer("methods", "heun2", "--format", "latex")
    assert latex.splitlines() == [
        r"\begin{array}{c|cc}",
        r"0 & 0 & 0 \\",
        r"1 & 1 & 0 \\ \hline",
        r" & \frac{1}{2} & \frac{1}{2} \\",
        r"\end{array}",
    ]
    assert r"\frac{\sqrt{3}}{6}" in answer("methods", "gauss2", "--format", "latex")
    assert "0.046910077030668" in answer("methods", "gauss5", "--format", "csv")


def test_parameters_get_values(answer):
    assert "1/4" in answer("methods", "sdirk2", "--set", "gamma=1/4")
    assert "parameters: gamma" in answer("methods", "sdirk2")


@pytest.mark.parametrize("name", ["grk4a", "strang", "rkn-nystrom5", "avf", "energy-collocation2", "lawson4"])
def test_a_method_without_tableau_shows_its_program(answer, name):
    method = bs.method(name)
    assert method.to_table().to_text().partition("\n\n")[0] in answer("methods", name)
    for format_ in ("markdown", "csv", "latex"):
        rows = list(answer("methods", name, "--format", format_).splitlines())
        assert len([row for row in rows if row]) > len(method.to_table().rows)
    assert json.loads(answer("methods", name, "--format", "json"))["kind"] == "method"


def test_the_flows_of_a_splitting_are_rows(answer):
    lines = answer("methods", "strang", "--format", "csv").splitlines()
    assert lines == ["step,flow of,coefficient of h", "1,a,1/2", "2,b,1", "3,a,1/2"]


@pytest.mark.parametrize("package", ["nodepy", "diffrax", "scipy", "sundials", "petsc", "rungekutta.jl", "sciml"])
def test_a_method_as_text_for_another_package(run, answer, tmp_path, package):
    text = answer("methods", "dormand-prince54", "--as", package)
    found = bs.methods.import_tableau(text)
    assert found == bs.method("dormand-prince54") or (package == "rungekutta.jl" and not found.embedded)
    path = tmp_path / "pair.any"
    assert answer("methods", "dormand-prince54", "--as", package, "-o", str(path)) == ""
    assert path.read_text(encoding="utf-8") == text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--as", "petsc"), "METHOD must be given where --as is, but only 'petsc' was"),
        (("rk4", "--as", "matlab"), "format must be one of nodepy"),
        (("rk4", "--as", "petsc", "--format", "json"), "format must be left out where --as is given, but was 'json'"),
        (("strang", "--as", "petsc"), "method must be a RungeKutta"),
    ],
)
def test_what_no_package_takes_is_refused(run, arguments, message):
    result = run("methods", *arguments)
    assert result.exit_code == 2
    assert message in result.stderr
