"""`bseries shadow`, against the library and against itself in all formats."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

import bseries as bs


@pytest.fixture
def stored(tmp_path, monkeypatch):
    """A run of this package, in a file and as text, in the folder that commands work in."""
    monkeypatch.chdir(tmp_path)
    run = bs.integrate("stormer-verlet", bs.scene("pendulum"), h=0.1, steps=500)
    run.save("run.npz")
    lines = (f"{t!r},{p!r},{q!r}" for t, p, q in zip(run.t.tolist(), *run.y.tolist(), strict=True))
    Path("run.csv").write_text("t,p,q\n" + "\n".join(lines), encoding="utf-8")
    return run


def test_json_says_what_the_library_computes(answer, stored):
    report = bs.shadow_energy(stored, order=8)
    data = json.loads(answer("shadow", "run.npz", "--order", "8", "--bound", "1e-4", "--format", "json"))
    assert data == report.to_dict() | {
        "trajectory": "run.npz",
        "bound": {"energy": 1e-4, "step": report.step_for(1e-4)},
    }


@pytest.mark.parametrize(
    "arguments",
    [
        ("run.csv", "--scene", "pendulum"),
        ("run.csv", "--hamiltonian", "p^2/2 - cos(q)", "--step", "1/10"),
        ("run.npz", "--scene", "pendulum"),
        ("run.csv", "--scene", "pendulum", "--columns", "q=q;p=p;t=t", "--layout", "full", "--tolerance", "1e-8"),
        ("run.csv", "--scene", "pendulum", "--columns", "t=0, p=1:2,q=2"),
        ("run.csv", "--scene", "pendulum", "--period", "100"),
    ],
)
def test_every_way_in_gives_the_same(arguments, answer, stored):
    wanted = bs.shadow_energy(stored, order=6).rows
    found = json.loads(answer("shadow", *arguments, "--order", "6", "--format", "json"))["rows"]
    assert [row["deviation"] for row in found] == pytest.approx([row.deviation for row in wanted], rel=1e-6)


def test_text_comes_from_standard_input(answer, stored):
    text = Path("run.csv").read_text(encoding="utf-8")
    shown = answer("shadow", "-", "--scene", "pendulum", "--order", "4", stdin=text)
    assert shown.startswith("standard input: 501 states, h = 0.1, t = 0 to 50\n")


def test_csv_and_markdown(answer, stored):
    report = bs.shadow_energy(stored, order=4)
    rows = list(csv.DictReader(io.StringIO(answer("shadow", "run.npz", "--order", "4", "--format", "csv"))))
    assert [float(row["deviation"]) for row in rows] == [row.deviation for row in report.rows]
    assert rows[0]["gap"] == ""
    answer("shadow", "run.npz", "--order", "4", "-o", "run.md")
    assert "| order | mean | ± |" in Path("run.md").read_text(encoding="utf-8")


def test_pictures(answer, stored, monkeypatch):
    pytest.importorskip("matplotlib")
    drawn = []
    monkeypatch.setattr(
        bs.shadow.ShadowReport, "save_plot", lambda report, path: drawn.append((report.rows[-1].order, path))
    )
    answer("shadow", "run.npz", "--order", "6", "--plot", "run.svg")
    assert drawn == [(6, "run.svg")]


def test_a_bound_can_be_anything(answer, stored):
    data = json.loads(answer("shadow", "run.npz", "--bound", "1e300", "--format", "json"))
    assert data["bound"]["step"] == data["largest_step"]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ((), "FILE must be given: a trajectory, as NPZ or text, or - for text on standard input"),
        (("none.npz",), "none.npz must be a trajectory file, but was not: No such file"),
        (
            ("run.csv",),
            "run.csv must have the potential (U), but has t, p, q; columns can name it, as in U=NAME, or a scene ",
        ),
        (
            ("run.npz", "--plot", "run.gif"),
            "the ending of the plot 'run.gif' must be one of png, svg, pdf, but was 'gif'",
        ),
        (("run.npz", "--plot", "no/run.png"), "plot must be a file in a folder that is there, but was 'no/run.png'"),
        (("run.npz", "--format", "latex"), "format must be one of table, json, csv, markdown, html, but was 'latex'"),
        (("run.npz", "--order", "7"), "order must be an even number from 2 to 24, but was 7"),
        (("run.npz", "--order", "x"), "order must be a whole number, but was 'x'"),
        (("run.npz", "--step", "x"), "step"),
        (("run.npz", "--mass", "2"), "mass must be left out where a scene is given, which has masses, but was given"),
        (("run.npz", "--bound", "1e400"), "bound must be a number that a double can hold, but was '1e400'"),
        (("run.npz", "--bound", "0"), "bound must be a positive energy, but was 0.0"),
        (("run.npz", "--columns", "q"), "columns must be NAME=VALUE"),
        (("run.csv", "--columns", "q=x,q=y"), "each name once, as in \"q=[xy],v=v*\", but gave 'q' twice"),
        (
            ("run.npz", "--layout", "x"),
            "layout must be one of full, half-behind, half-ahead, drift-kick-drift, but was 'x'",
        ),
        (("run.npz", "--scene", "kepler"), "run.npz must have the variable p1 of the scene, but has p, q"),
        (("run.npz", "--scene", "lotka-volterra"), "scene must have a Hamiltonian of momenta and positions"),
    ],
)
def test_refusals_are_one_sentence(arguments, reason, run, stored):
    result = run("shadow", *arguments)
    assert result.exit_code == 2
    assert not result.stdout
    assert result.stderr.startswith("bseries: error: ")
    assert reason in result.stderr
    assert result.stderr.count("\n") == 1


def test_own_thinned_runs_are_refused(run, stored):
    bs.integrate("stormer-verlet", bs.scene("pendulum"), h=0.1, steps=500, save_every=10).save("thin.npz")
    result = run("shadow", "thin.npz")
    assert result.stderr == (
        "bseries: error: thin.npz must contain every step, but its states are every 10th of a run\n"
    )


def test_a_log_of_energies_is_judged(run, tmp_path):
    energies = -4.5 + 1e-3 * np.cos(0.7 * np.arange(4000)) + 2e-6 * np.arange(4000)
    lines = ["Step Temp TotEng", *(f"{10 * k} 1.44 {x:.12f}" for k, x in enumerate(energies)), "Loop time of 12.3"]
    path = tmp_path / "log.lammps"
    path.write_text("\n".join(lines))
    shown = run("shadow", str(path), "--energy", "total")
    assert shown.exit_code == 0
    assert "TotEng: linear drift" in shown.stdout
    found = json.loads(run("shadow", str(path), "--energy", "TotEng", "--format", "json").stdout)
    assert (found["kind"], found["verdict"], found["values"]) == ("energy-log", "linear drift", 4000)
    assert run("shadow", str(path), "--energy", "Enthalpy").exit_code == 2
    for option in (["--columns", "q=x"], ["--order", "4"], ["--bound", "1e-3"], ["--plot", "a.png"], ["--mass", "2"]):
        refused = run("shadow", str(path), "--energy", "total", *option)
        assert refused.exit_code == 2
        assert f"{option[0][2:]} must be left out with --energy" in refused.stderr
    missing = run("shadow", str(tmp_path / "nothing.log"), "--energy", "total")
    assert missing.exit_code == 2
    assert "must be a readable file, but was not: No such file" in missing.stderr
