"""`bseries figure`, against the library."""

from __future__ import annotations

import csv
import io
import sys

import numpy as np
import pytest

import bseries as bs
from bseries.figures import registry, riccati, toda
from bseries.figures.registry import compute, drawn, figure_file, figure_names
from bseries.picture_files import data_rows
from bseries_base.plotting import picture

pytest.importorskip("matplotlib")

BEGINNINGS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}


@pytest.fixture
def two_figures(monkeypatch):
    """As if there were two figures, the second of which says how far it is."""
    reports = []

    def numbers(*, progress=None):
        progress(1, 2)
        reports.append(progress)
        return riccati.numbers()

    names = {"riccati": riccati, "long": type("Long", (), {**vars(riccati), "numbers": staticmethod(numbers)})}
    for name in ("columns", "caption", "draw"):
        setattr(names["long"], name, staticmethod(getattr(riccati, name)))
    monkeypatch.setattr(registry, "figure_names", lambda: list(names))
    monkeypatch.setattr(registry, "figure_file", names.get)
    return reports


@pytest.mark.parametrize("ending", BEGINNINGS)
def test_pictures(answer, tmp_path, ending):
    path = tmp_path / f"picture.{ending}"
    assert answer("figure", "riccati", "--set", "h=1/50", "-o", str(path)) == f"{riccati.caption(riccati.numbers())}\n"
    assert path.read_bytes().startswith(BEGINNINGS[ending])
    assert path.read_bytes() == picture(drawn(figure_file("riccati"), riccati.numbers()), ending)
    assert list(tmp_path.iterdir()) == [path]


def test_without_matplotlib_nothing_is_computed(run, tmp_path, monkeypatch):
    computed = []
    monkeypatch.setattr(registry, "compute", lambda *given: computed.append(given) or riccati.numbers())
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = run("figure", "riccati", "-o", str(tmp_path / "picture.png"))
    assert (result.exit_code, result.stderr.count("\n"), computed) == (2, 1, [])
    assert "a figure needs matplotlib: pip install '.[plot]'" in result.stderr
    with pytest.raises(ImportError, match="a figure needs matplotlib"):
        bs.figure("riccati")
    assert computed == []
    assert run("figure", "riccati", "--data", str(tmp_path / "data.csv")).exit_code == 0
    assert len(computed) == 1


def test_data(answer, tmp_path):
    path = tmp_path / "toda.csv"
    assert answer("figure", "toda", "--data", str(path)) == ""
    rows = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8"))))
    columns = toda.columns(toda.numbers())
    assert rows == [list(columns), *data_rows(columns)]
    assert list(tmp_path.iterdir()) == [path]


def test_data_on_standard_output(answer, tmp_path):
    path = tmp_path / "picture.svg"
    text = answer("figure", "truncation", "--set", "terms=1", "--set", "h=0.05", "--data", "-", "-o", str(path))
    rows = list(csv.reader(io.StringIO(text)))
    found = compute(figure_file("truncation"), {"h": 0.05, "terms": 1})
    assert "distance_explicit_euler_1_terms" in rows[0]
    assert "distance_explicit_euler_2_terms" not in rows[0]
    times = [float(row[0]) for row in rows[1:] if row[0]]
    np.testing.assert_array_equal(times, found.t)
    assert path.exists()


def test_an_animation(answer, tmp_path, monkeypatch):
    """The file, and the caption; methods may be files."""
    from bseries.figures import area_patch

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(area_patch, "FINE", 1)
    tableau = tmp_path / "mine.json"
    bs.save_method(bs.method("gauss2"), str(tableau))
    options = ["--set", "methods=mine.json, rk4", "--set", "steps=4"]
    text = answer("figure", "area-patch", *options, "--animate", "patch.gif")
    found = area_patch.numbers(methods=[bs.load_method(str(tableau)), "rk4"], steps=4)
    assert " ".join(text.split()) == area_patch.caption(found)
    assert (tmp_path / "patch.gif").read_bytes().startswith(b"GIF89a")


def test_list(answer):
    lines = answer("figure", "--list").splitlines()[2:]
    assert [line.split()[0] for line in lines] == figure_names()
    shown = {line.split()[0]: line for line in lines}
    assert shown["truncation"].endswith("h=0.1, terms=3, methods=explicit-euler,symplectic-euler-p, y0=2,2")
    assert shown["toda"].split()[1] == "9"


def test_list_needs_nothing_heavy():
    import subprocess
    import sys

    code = "import sys\nfrom bseries.cli import main\ntry:\n    main()\nfinally:\n    print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code, "figure", "--list"], capture_output=True, text=True, check=True)
    assert not {"numpy", "sympy", "matplotlib", "numba"} & set(run.stdout.split())


@pytest.mark.usefixtures("two_figures")
@pytest.mark.few(1)
@pytest.mark.parametrize("ending", ["png", "pdf"])
def test_all(answer, tmp_path, two_figures, ending):
    folder, data = tmp_path / "gallery", tmp_path / "numbers"
    options = [] if ending == "png" else ["--format", "PDF"]
    assert answer("figure", "--all", "-o", str(folder), "--data", str(data), *options) == ""
    assert sorted(path.name for path in folder.iterdir()) == [f"long.{ending}", f"riccati.{ending}"]
    assert sorted(path.name for path in data.iterdir()) == ["long.csv", "riccati.csv"]
    assert len(two_figures) == 1
    assert (folder / f"riccati.{ending}").read_bytes().startswith(BEGINNINGS[ending])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "one of NAME, --list and --all must be given, but none were"),
        (["riccati", "--all"], "one of NAME, --list and --all must be given, but NAME and --all were"),
        (["riccati"], "output, data or animate must be given, as in -o riccati.png, but none was"),
        (["nothing", "-o", "a.png"], "name must be one of riccati, lotka-volterra"),
        (["riccati", "-o", "a.gif"], "the ending of the output 'a.gif' must be one of png, svg, pdf, but was 'gif'"),
        (["riccati", "-o", "-"], "must be one of png, svg, pdf, but was ''"),
        (["riccati", "-o", "no/a.png"], "output must be a file in a folder that is there, but was 'no/a.png'"),
        (["riccati", "--data", "no/a.csv"], "data must be a file in a folder that is there, but was 'no/a.csv'"),
        (["riccati", "--data", "."], "data must be a file in a folder that is there, but was '.'"),
        (["riccati", "-o", "a.png", "--format", "png"], "format must be left out without --all"),
        (["riccati", "-o", "a.png", "--set", "h"], "set must be NAME=VALUE, as in h=1/20, but was 'h'"),
        (
            ["riccati", "-o", "a.png", "--set", "g=1"],
            "set must be one of h=0.02, method=explicit-euler for riccati, but was 'g'",
        ),
        (["toda", "-o", "a.png", "--set", "h=1"], "h must be 2 numbers, but was '1'"),
        (["riccati", "-o", "a.png", "--set", "h=x"], "h must"),
        (["riccati", "-o", "a.png", "--set", "h=5"], "h must be a number from 0.002 to 0.1, but was '5'"),
        (["riccati", "-o", "a.png", "--set", "h=1e400"], "h must be a number from 0.002 to 0.1, but was '1e400'"),
        (
            ["riccati", "-o", "a.png", "--set", "h=10^400+1/3"],
            "h must be a number from 0.002 to 0.1, but was '10^400+1/3'",
        ),
        (
            ["truncation", "-o", "a.png", "--set", "terms=5/2"],
            "terms must be a whole number from 1 to 6, but was '5/2'",
        ),
        (["riccati", "--animate", "a.gif"], "name must be a figure that moves, one of lotka-volterra, large-steps,"),
        (["area-patch", "--animate", "a.avi"], "animate must be a file that ends in .gif or .mp4, but was 'a.avi'"),
        (["area-patch", "--animate", "no/a.gif"], "animate must be a file in a folder that is there"),
        (["area-patch", "-o", "a.png", "--set", "scene=kepler"], "scene must have two variables, but kepler has 4"),
        (["large-steps", "-o", "a.png", "--set", "method=no.json"], "no.json"),
        (["large-steps", "-o", "a.png", "--set", "y0=__import__('os')"], "y0 must"),
        (["--all", "-o", "a", "--animate", "a.gif"], "animate must be left out with --all, but was 'a.gif'"),
        (["--all"], "output must be a folder with --all"),
        (["--all", "-o", "a", "--data", "-"], "output must be a folder with --all"),
        (["--all", "-o", "a", "--set", "h=1"], "set must be left out with --all, but was 'h=1'"),
        (["--all", "-o", "a", "--format", "gif"], "format must be one of png, svg, pdf, but was 'gif'"),
        (["--all", "-o", "file"], "output must be a folder that can be made, but 'file' was not: File exists"),
    ],
)
def test_bad_arguments(run, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    result = run("figure", *arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.startswith("bseries: error: ")
    assert result.stderr.count("\n") == 1
    assert not result.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_completion(run, monkeypatch):
    from click.shell_completion import BashComplete

    from bseries.cli.application import application

    monkeypatch.setenv("COMP_WORDS", "bseries figure lotka")
    monkeypatch.setenv("COMP_CWORD", "2")
    assert BashComplete(application, {}, "bseries", "_BSERIES_COMPLETE").complete() == "plain,lotka-volterra"
