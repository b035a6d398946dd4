"""`bseries scenes`: the list, one scene in all formats, and scene files."""

from __future__ import annotations

import csv
import io
import json
import os
import re

import pytest

import bseries as bs

SCENES = {
    "pendulum": ("pendulum", "--effect", "damping", "--effect", "drive", "--parameter", "gamma=1/3"),
    "kepler": ("kepler", "--parameter", "eccentricity=1/2"),
    "many particles": ("lennard-jones", "--parameter", "particles=12"),
    "parts": ("fpu",),
    "poisson": ("rigid-body",),
    "built-in effects": ("n-body", "--effect", "softening"),
    "matrix": ("linear", "--parameter", "matrix=0,1/2,root(2,3);-1,0,0;0,0,1"),
    "equations": ("--ode", "u' = -v*t; v' = c*u", "--parameter", "c=2"),
    "energy": ("--hamiltonian", "x^2/2 - mu*cos(y)", "--blocks", "p=x;q=y", "--parameter", "mu=0.1"),
}


def facts_of(text: str) -> dict[str, str]:
    return {row["what"]: row["value"] for row in csv.DictReader(io.StringIO(text))}


def test_list_in_every_format(answer):
    entries = bs.scene_catalogue()
    data = json.loads(answer("scenes", "--format", "json"))
    assert (data["schema"], data["kind"], len(data["scenes"])) == (1, "scenes", len(entries))
    records = {record["name"]: record for record in data["scenes"]}
    assert list(records["pendulum"]["effects"]) == ["asymmetry", "damping", "drive"]
    assert records["toda"] == {
        "name": "toda",
        "dimension": 6,
        "effects": {},
        "options": {"n": 3},
        "aliases": ["toda-lattice"],
        "summary": records["toda"]["summary"],
        "reference": records["toda"]["reference"],
    }
    rows = list(csv.DictReader(io.StringIO(answer("scenes", "--format", "csv"))))
    assert [row["name"] for row in rows] == [entry.name for entry in entries]
    assert next(row["effects"] for row in rows if row["name"] == "kepler") == "relativity oblateness drag"
    for format in ("table", "markdown", "latex"):
        text = answer("scenes", "--format", format)
        assert all(entry.name in text for entry in entries)
        assert all(option in text for option in ("asymmetry, damping, drive", "options: eccentricity", "also: fpu"))


@pytest.mark.few(3)
@pytest.mark.parametrize("call", SCENES)
def test_files_are_read_back(answer, tmp_path, call):
    text = answer("scenes", *SCENES[call], "--toml")
    path = tmp_path / "scene.toml"
    assert answer("scenes", *SCENES[call], "-o", str(path)) == ""
    assert path.read_text(encoding="utf-8") == text
    again = answer("scenes", str(path), "--format", "json")
    assert again == answer("scenes", *SCENES[call], "--format", "json")
    assert again == answer("scenes", "-", "--format", "json", stdin=text)
    assert answer("scenes", str(path), "--toml") == text
    assert bs.load_scene(path).dimension == json.loads(again)["dimension"]


def test_parameters_effects_and_options(answer, tmp_path):
    path = tmp_path / "scene.toml"
    answer("scenes", *SCENES["pendulum"], "-o", str(path))
    assert bs.load_scene(path) == bs.scene("pendulum", effects=["damping", "drive"], gamma="1/3")
    answer("scenes", *SCENES["many particles"], "-o", str(path))
    assert bs.load_scene(path) == bs.scene("lennard-jones", particles=12)
    answer("scenes", *SCENES["matrix"], "-o", str(path))
    assert bs.load_scene(path) == bs.scene("linear", matrix=[[0, "1/2", "root(2,3)"], [-1, 0, 0], [0, 0, 1]])
    answer("scenes", *SCENES["energy"], "-o", str(path))
    expected = bs.Scene({"p": ["x"], "q": ["y"]}, hamiltonian="x^2/2 - mu*cos(y)", parameters={"mu": 0.1})
    assert bs.load_scene(path) == expected
    assert bs.load_scene(path) != expected.with_parameters(mu="1/9")


def test_one_scene_in_detail(answer):
    facts = facts_of(answer("scenes", *SCENES["pendulum"], "--format", "csv"))
    assert facts == {
        "variables": "p, q, t",
        "blocks": "p of 1, q of 1, t of 1",
        "H": "p**2/2 - cos(q)",
        "p'": "amplitude*cos(omega*t) - gamma*p",
        "t'": "1",
        "parameter gamma": "1/3",
        "parameter amplitude": "1/2",
        "parameter omega": "2/3",
        "effect asymmetry (off)": facts["effect asymmetry (off)"],
        "effect damping (on)": "friction, −γp",
        "effect drive (on)": "a periodic force, a cos(ωt)",
        "start p": "0",
        "start q": "-3/2",
        "start t": "0",
        "reference": bs.scene("pendulum").reference,
    }
    assert facts["effect asymmetry (off)"].endswith("; epsilon = 1/5")
    kepler = facts_of(answer("scenes", "kepler", "--format", "csv"))
    assert kepler["option eccentricity"] == "by default 3/5"
    assert kepler["invariant angular_momentum"] == "-p1*q2 + p2*q1"
    assert kepler["positive"] == "q1**2 + q2**2"
    body = facts_of(answer("scenes", "euler-top", "--format", "csv"))
    assert (body["Poisson matrix, row 1"], body["also called"]) == ("0, -y3, y2", "euler-top")
    springs = facts_of(answer("scenes", "fpu", "--format", "csv"))
    assert springs["H, sites 3, part nonlinear"] == "(qx_i + qy_i)**4/4"
    assert springs["H, each site, part linear"] == "omega**2*qy_i**2/2 + px_i**2/2 + py_i**2/2"


def test_tables_of_many_particles_are_short_and_their_csv_is_whole(answer):
    table, whole = (answer("scenes", *SCENES["many particles"], "--format", format) for format in ("table", "csv"))
    assert table.startswith("lennard-jones: atoms with the Lennard-Jones potential")
    assert max(map(len, table.splitlines())) < 350
    starts = facts_of(whole)["start p"].split(", ")
    assert len(starts) == 24
    assert all(re.fullmatch(r"-?\d+(\.\d+)?", number) for number in starts)  # decimals, not long fractions


@pytest.mark.few(3)
@pytest.mark.parametrize("call", SCENES)
def test_tables_for_readers_and_papers(answer, call):
    from matplotlib.mathtext import MathTextParser

    rows = facts_of(answer("scenes", *SCENES[call], "--format", "csv"))
    for format in ("table", "markdown"):
        text = answer("scenes", *SCENES[call], "--format", format)
        assert all(what in text for what in rows)
    if "t'" in rows:
        assert "The field depends on the time t: made autonomous" in answer("scenes", *SCENES[call])
    latex = answer("scenes", *SCENES[call], "--format", "latex")
    lines = latex.splitlines()[2:-1]
    assert len(lines) == len(rows)
    for line in lines:
        assert line.endswith(r" \\")
        words, formulas = line.split("$")[::2], line.split("$")[1::2]
        assert len(words) == len(formulas) + 1
        assert not re.search(r"(?<!\\)[_^#%]|[²³−γωμ]", "".join(words))
        if formulas and len(line) < 2000:
            MathTextParser("agg").parse("$" + r"\quad ".join(formulas) + "$")


def test_effects_that_are_built_in(answer):
    softened = answer("scenes", *SCENES["built-in effects"])
    assert softened.startswith("n-body with softening: gravity among 3 bodies, softened\n")
    assert "epsilon**2" in softened
    assert "epsilon**2" not in answer("scenes", "n-body")
    assert "effect pluto" in answer("scenes", "outer-solar-system", "--effect", "jupiter")


@pytest.mark.parametrize("format", ["table", "json", "csv", "latex", "markdown"])
def test_file_and_stdout_agree(answer, tmp_path, format):
    suffix = {"table": ".txt", "json": ".json", "csv": ".csv", "latex": ".tex", "markdown": ".md"}[format]
    path = tmp_path / f"out{suffix}"
    assert answer("scenes", "toda", "-o", str(path)) == ""
    assert path.read_text(encoding="utf-8") == answer("scenes", "toda", "--format", format)
    assert list(tmp_path.iterdir()) == [path]


MISTAKES = {
    "unknown scene": ("pendulun", "scene must be one of the catalogue, but was 'pendulun'; did you mean pendulum"),
    "two scenes": ("kepler --ode y'=y", "SCENE must be given in one way"),
    "no scene to write": ("--toml", "SCENE must be given where a TOML file is written"),
    "no scene for a file": ("-o all.toml", "SCENE must be given where a TOML file is written"),
    "two formats": ("kepler --toml --format json", "format must be left out where a TOML file is written"),
    "a file of another format": ("kepler -o kepler.toml --format csv", "format must be left out"),
    "effect of none": ("--effect drag", "effect and parameter must come with a SCENE"),
    "parameter of none": ("--parameter mu=1", "effect and parameter must come with a SCENE"),
    "unknown option": (
        "toda --parameter particles=3",
        "there is no parameter particles; there are none; options of toda are n",
    ),
    "no count": ("toda --parameter n=two", "n must be"),
    "effects as a parameter": ("n-body --parameter effects=softening", "must be one of the scene's, but was 'effects'"),
    "no folder": ("kepler -o nowhere/kepler.toml", "output must be a file that can be written"),
    "missing file": ("./missing.toml", "must be a readable file"),
    "a tableau": ("tableau.toml", "content must have"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_end_in_one_line(run, tmp_path, monkeypatch, mistake):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tableau.toml").write_text("A = [[0]]\nb = [1]\n")
    line, sentence = MISTAKES[mistake]
    result = run("scenes", *line.split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("bseries: error: ")
    assert result.stderr.count("\n") == 1
    assert sentence in result.stderr
    assert os.listdir() == ["tableau.toml"]
