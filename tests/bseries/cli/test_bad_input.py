"""Every mistake ends with one sentence on stderr, exit code 2, nothing on stdout and no file."""

from __future__ import annotations

import json
import os

import pytest

MISTAKES = {
    "wrong parameter": ("modified sdirk2 --set name=1", "must be one of gamma, but 'name' was given"),
    "unknown verb": ("frobnicate", "verb must be one of modified, .* but was 'frobnicate'"),
    "unknown method": ("modified rkk4", "name must be a method .* nearest are rk4"),
    "no method": ("modified", "METHOD must be given"),
    "two methods": ("modified rk4 --A 0 --b 1", "METHOD must be left out where --A"),
    "family without stages": ("modified gauss", "needs a number of stages, for example gauss3"),
    "non-square A": ("modified --A 0,0;1/2 --b 0,1", "A must be square, but row 2 has 1 entry and row 1 has 2"),
    "lengths": ("modified --A 0,0;1/2,0 --b 0,1,2", "b must have as many entries as A has rows, 2, but has 3"),
    "nodes": ("modified --A 0,0;1/2,0 --b 0,1 --c 0", "c must have as many entries"),
    "empty tableau": ("modified --A= --b=", "A must have at least one row"),
    "nan": ("modified --A nan --b 1", "is not finite"),
    "infinity": ("modified --A 0 --b inf", "is not finite"),
    "no formula": ("modified --A hello --b 1", "unknown name 'hello'"),
    "code": ("modified --A __import__('os').system('touch${IFS}pwned') --b 1", "must be a formula"),
    "attribute": ("modified --A ().__class__ --b 1", "must be a formula"),
    "call": ("modified --A eval(1) --b 1", "must be a formula"),
    "comprehension": ("modified --A [x|for|x|in|y] --b 1", "must be a formula"),
    "tower": ("modified --A 10^10^10 --b 1", "more than 4000 digits"),
    "division by zero": ("modified --A 1/0 --b 1", "divides by zero"),
    "parentheses": (f"modified --A {'(' * 10_000}1{')' * 10_000} --b 1", "must be a formula"),
    "symbols": ("modified --A x --b 1 --symbols sqrt", "not name a function"),
    "order zero": ("modified rk4 --order 0", "order must be 1 or more, but was 0"),
    "negative order": ("series rk4 --order -3", "order must be 1 or more, but was -3"),
    "fractional order": ("modified rk4 --order 2.5", "order must be a whole number, but was '2.5'"),
    "wordy order": ("check rk4 --order many", "order must be a whole number, but was 'many'"),
    "order zero of check": ("check rk4 --order 0", "order must be 1 or more, but was 0"),
    "very long order": (f"modified rk4 --order {'9' * 5000}", "order must be"),
    "order beyond all tables": ("modified rk4 --order 61", "order must be 60 or less, but was 61"),
    "order beyond memory": ("modified rk4 --order 40 --format csv", "would take .* GB of memory, but .* are available"),
    "trees beyond memory": ("trees --order 45 --format csv", "order must be smaller"),
    "too much for a table": ("modified rk4 --order 16", "or format csv, to write more than 100,000 trees"),
    "too much for json": ("trees --order 16 --format json", "or format csv, to write more than 100,000 trees"),
    "unknown format": ("modified rk4 --format xml", "format must be one of table, json, csv, latex, markdown"),
    "unknown suffix": ("modified rk4 -o x.xlsx", "output must end in one of .txt, .json"),
    "no folder": ("modified rk4 -o nowhere/x.json", "output must be a file that can be written"),
    "a folder": ("modified rk4 -o .", "output must be a file that can be written, but was a folder"),
    "parameter of none": ("modified rk4 --set gamma=1", "rk4 cannot be given"),
    "unknown parameter": ("modified sdirk2 --set gama=1", "must be one of gamma, but 'gama' was given"),
    "no value": ("modified sdirk2 --set gamma", "set must be NAME=VALUE"),
    "two values": ("modified sdirk2 --set gamma=1 --set gamma=2", "gave 'gamma' twice"),
    "value without method": ("methods --set gamma=1", "set must come with a METHOD"),
    "value is code": ("modified sdirk2 --set gamma=open('x')", "gamma must be a formula"),
    "floats of symbols": ("modified sdirk2 --float", "must be a number to become a float"),
    "limits": ("trees --max-children many", "max_children must be numbers or inf"),
    "shape of limits": ("trees --colors 2 --max-children 1,2;3", "max_children must be one bound or 2 rows"),
    "colours": ("trees --colors 0", "colors must be 1 or more"),
    "misspelt option": ("modified rk4 --ordre 3", "No such option.*see `bseries modified --help`"),
    "missing file": ("modified ./missing.json", "must be a readable file"),
    "entries of steps beyond doubles": (
        "simulate pendulum --A 1e309 --b 1 --step 0.1 --steps 2",
        "numbers must be in the range of doubles to be rounded, but one was 1000",
    ),
    "missing argument": ("completion", "Missing argument"),
    "unknown shell": ("completion csh", "shell must be one of bash, zsh, fish"),
}

FILES = {
    "truncated": (b'{"A": [[0', "content must be JSON"),
    "binary": (bytes(range(128, 256)) * 4, "must be UTF-8 text"),
    "nul bytes": (b"\0\0\0", "must be text, but was binary"),
    "no tableau": (b"[1, 2]", "must be a table of keys and values"),
    "misspelt key": (b'{"A": [[0]], "B": [1]}', "had 'B'"),
    "nan": (b'{"A": [[NaN]], "b": [1]}', "numbers must be finite"),
    "too large": (b'{"A": [[1e5000]], "b": [1]}', "has a number of more than 4000 digits"),
    "a megabyte": (b'{"A": [["' + b"1" * 1_000_000 + b'"]], "b": [1]}', "has 1000000 characters"),
    "nested": (b"[" * 100_000, "nesting"),
    "code": (b'{"A": [["__import__(\'os\')"]], "b": [1]}', "must be a formula"),
}


def refused(result, sentence: str) -> None:
    import re

    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("bseries: error: ")
    assert result.stderr.count("\n") == 1
    assert len(result.stderr) < 400
    assert re.search(sentence, result.stderr)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake(run, tmp_path, monkeypatch, mistake):
    monkeypatch.chdir(tmp_path)
    line, sentence = MISTAKES[mistake]
    refused(run(*(word.replace("|", " ") for word in line.split())), sentence)
    assert os.listdir() == []


def test_division_by_an_expression_that_is_zero(run):
    result = run("modified", "--A", "1/((x+1)^2-x^2-2*x-1)", "--b", "1", "--symbols", "x", "--order", "2")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.splitlines()[-1].endswith("can be evaluated, but one divides by zero")


@pytest.mark.parametrize("mistake", FILES)
def test_bad_file(run, tmp_path, monkeypatch, mistake):
    monkeypatch.chdir(tmp_path)
    content, sentence = FILES[mistake]
    (tmp_path / "bad.json").write_bytes(content)
    refused(run("modified", "bad.json"), sentence)
    if mistake not in ("no tableau", "nested"):  # without a suffix these could be TOML
        refused(run("modified", "-", stdin=content), "" if mistake == "binary" else sentence)
    assert os.listdir() == ["bad.json"]


def test_existing_output_survives_a_refusal(run, tmp_path):
    path = tmp_path / "kept.json"
    path.write_text("old")
    refused(run("modified", "nosuch", "-o", str(path)), "must be a method")
    assert path.read_text() == "old"
    assert run("modified", "rk4", "-o", str(path)).exit_code == 0
    assert json.loads(path.read_text(encoding="utf-8"))["method"] == "rk4"


@pytest.mark.parametrize("error", [MemoryError, OSError(28, "No space left on device")])
def test_what_the_machine_lacks(run, monkeypatch, error):
    import bseries.algebra.modified

    def fail(*arguments, **options):
        raise error

    monkeypatch.setattr(bseries.algebra.modified, "modified_equation", fail)
    monkeypatch.setattr("bseries.cli.application.discard_output", lambda: None)
    refused(run("modified", "rk4"), "more memory" if error is MemoryError else "No space left on device")


def test_a_bug_is_not_hidden(run, monkeypatch):
    import bseries.algebra.modified

    def fail(*arguments, **options):
        raise ValueError("a bug")

    monkeypatch.setattr(bseries.algebra.modified, "modified_equation", fail)
    assert isinstance(run("modified", "rk4").exception, ValueError)
