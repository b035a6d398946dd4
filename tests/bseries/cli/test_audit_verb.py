"""`bseries audit`: exit codes, claims from files and options, comparisons, and sources that cannot be read."""

from __future__ import annotations

import json

import pytest

RIGHT = "def heun():\n    # second-order method\n    A = [[0, 0], [1, 0]]\n    b = [1/2, 1/2]\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "right.py").write_text(RIGHT)
    (tmp_path / "wrong.py").write_text(RIGHT.replace("[1, 0]]", "[-1, 0]]"))
    return tmp_path


def test_the_exit_code_says_whether_claims_hold(run, folder):
    assert run("audit", "right.py").exit_code == 0
    wrong = run("audit", ".", "--format", "json")
    assert wrong.exit_code == 1
    data = json.loads(wrong.stdout)
    assert [len(method["findings"]) for method in data["methods"]] == [0, 1]
    assert run("audit").exit_code == run("audit", "none.py").exit_code == 2


@pytest.mark.parametrize(("name", "text"), [("claims.json", '{"heun": %d}'), ("claims.toml", "heun = %d")])
def test_claims_of_files(run, folder, name, text):
    (folder / name).write_text(text % 3)
    found = run("audit", "right.py", "--claims", name)
    assert found.exit_code == 1
    assert "order 3, but order 2" in found.stdout
    assert run("audit", "right.py", "--claims", name, "--claim", "heun=2").exit_code == 0


def test_claims_of_methods_that_are_not_there_are_said(run, folder):
    found = run("audit", "right.py", "--claim", "heum=2")
    assert "no method has the name 'heum' of a claim" in found.stdout


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1]", "claims must be a table"),
        ('{"heun": "two"}', "the order of 'heun' was 'two'"),
        ('{"heun": true}', "the order of 'heun' was True"),
        ('{"heun": 2.5}', "the order of 'heun' was"),
        ('{"heun": [2]}', "the order of 'heun' was [2]"),
        ("{", "content must be JSON"),
    ],
)
def test_claims_that_cannot_be_read(run, folder, text, message):
    (folder / "claims.json").write_text(text)
    found = run("audit", "right.py", "--claims", "claims.json")
    assert (found.exit_code, found.stdout) == (2, "")
    assert message in found.stderr
    assert found.stderr.count("\n") == 1


def test_side_by_side(run, folder):
    assert run("audit", "right.py", "--against", "right.py").exit_code == 0
    found = run("audit", "right.py", "--against", "wrong.py")
    assert found.exit_code == 1
    assert "A[2,1]" in found.stdout
    assert run("audit", "right.py", "--against", "wrong.py", "--order", "2").exit_code == 2


def test_sources_that_cannot_be_read_are_said_and_the_rest_audited(run, folder):
    (folder / "binary.c").write_bytes(bytes(range(256)))
    (folder / "deep.c").write_text("double A[2][2] = " + "{" * 5000)
    (folder / "large.c").write_text("/* */" * 2_500_000)
    found = run("audit", "right.py", "binary.c", "deep.c", "large.c")
    assert found.exit_code == 0
    assert "binary.c" in found.stdout
    assert "large.c" in found.stdout
