"""`bseries report` and its refusals."""

from __future__ import annotations

import pytest

pytest.importorskip("bokeh")


def test_the_verb(run, tmp_path):
    path = tmp_path / "heun.html"
    result = run("report", "heun2", "-o", str(path), "--order", "3")
    assert (result.exit_code, result.output) == (0, "")
    assert path.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["rk4"], "output must be given and end in .html, as in -o report.html, but was None"),
        (["rk4", "-o", "rk4.pdf"], "output must be given and end in .html"),
        (["rk4", "-o", "nowhere/rk4.html"], "output must be a file in a folder that is there"),
        (["rk4", "--span", "3", "-o", "x.html"], "span and start must come with a SCENE"),
        (["rk4", "pendulum", "--span", "-1", "-o", "x.html"], "span must be more than 0 and at most 1000"),
        (["rk4", "--order", "9", "-o", "x.html"], "order must be from 1 to 8 for rk4"),
        (["sdirk2", "pendulum", "-o", "x.html"], "gamma"),
        (["gauss30", "-o", "x.html"], "method must have at most 24 stages to explore"),
    ],
)
def test_refusals(run, arguments, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("report", *arguments)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
