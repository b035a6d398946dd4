"""`bseries report` and `bseries explore`: a file, and refusals."""

from __future__ import annotations

import sys

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


@pytest.mark.parametrize(
    ("arguments", "module"),
    [(["explore", "--no-open"], "bokeh.server.server"), (["report", "rk4", "-o", "rk4.html"], "bokeh.embed")],
)
def test_without_bokeh_there_is_a_sentence(run, arguments, module, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    result = run(*arguments)
    assert result.exit_code == 2
    assert "needs bokeh: pip install '.[explore]'" in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_port_that_is_taken(run):
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        result = run("explore", "--no-open", "--port", str(taken.getsockname()[1]))
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "port must be free, but" in result.stderr
    assert "port must be from 0 to 65535, but was 99999" in run("explore", "--port", "99999").stderr
