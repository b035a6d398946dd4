"""`bseries course --check`: ten right and ten wrong answers, formats, refusals."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bseries.cli.verbs.course import write_template
from bseries.course.answers import answer_template

ANSWERS = Path(__file__).parents[1] / "course"
KEYS = ("1a", "1d", "2b", "4a", "7b", "9c", "12c", "13b", "14c", "16b")
TEN = {
    name: "\n".join(
        line.partition("->")[0]
        for line in (ANSWERS / f"{name}_answers.txt").read_text(encoding="utf-8").splitlines()
        if line.startswith(tuple(f"{key} " for key in KEYS))
    )
    for name in ("right", "wrong")
}


def verdicts(result):
    return {answer["key"]: answer["verdict"] for answer in json.loads(result.stdout)["answers"]}


@pytest.mark.parametrize(("name", "code"), [("right", 0), ("wrong", 1)])
def test_ten_answers(run, tmp_path, name, code):
    path = tmp_path / "answers.txt"
    path.write_text(TEN[name], encoding="utf-8")
    result = run("course", "--check", str(path), "--format", "json")
    assert (result.exit_code, result.stderr) == (code, "")
    assert verdicts(result) == dict.fromkeys(KEYS, name)


def test_one_wrong_answer_among_right_ones(run):
    result = run("course", "--check", "-", stdin=TEN["right"].replace("1d = no", "1d = yes"))
    assert result.exit_code == 1
    assert result.stdout.startswith("Answers: 9 of 10 right\n")


def test_the_verdicts_in_a_file(run, tmp_path):
    path = tmp_path / "verdicts.csv"
    result = run("course", "--check", "-", "-o", str(path), stdin="1d = no\n4c = 1/0\n")
    assert (result.exit_code, result.output) == (1, "")
    header, right, unreadable = path.read_text(encoding="utf-8").splitlines()
    assert (header, right) == ("key,answer,verdict,remark", "1d,no,right,")
    assert unreadable.startswith("4c,1/0,unreadable,")


@pytest.mark.parametrize(
    ("arguments", "stdin", "sentence"),
    [
        (["-"], "a" * 10**6, "must have at most 400000 bytes, but has more"),
        (["-"], "a" * 200_000, "answers must have at most 100,000 characters, but had 200,000"),
        (["-"], b"1d = \xff", "must be UTF-8 text"),
        (["-"], "1d = no\n1d = no", "keys must have one answer, but line 2 gave another one to 1d"),
        (["-"], "1z = no", "keys must be of 1a to 16c, but line 1 had '1z'"),
        (["-"], "no", "line 1 must be key = answer, as in 1d = no, but was 'no'"),
        (["-"], "", "answers must hold an answer such as 1d = no, but held none"),
        (["nowhere.txt"], None, "nowhere.txt must be a readable file"),
        (["-", "--format", "pdf"], "1d = no", "format must be one of table, json, csv, latex, markdown, html"),
        (["-", "--document", "slides"], "1d = no", "document must be left out where --check is given"),
        (["-", "-o", "nowhere/verdicts.json"], "1d = no", "output must be a file that can be written"),
    ],
)
def test_refusals(run, arguments, stdin, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("course", "--check", *arguments, stdin=stdin)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert not list(tmp_path.iterdir())


def test_the_course_comes_with_a_file_to_fill_in(run, tmp_path):
    pytest.importorskip("pypandoc")
    result = run("course", "-o", str(tmp_path), "--document", "exercises", "--format", "html")
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["answers.txt", "exercises.html"]
    empty = (tmp_path / "answers.txt").read_text(encoding="utf-8")
    assert run("course", "--check", "-", stdin=empty).exit_code == 2
    assert run("course", "--check", "-", stdin=empty.replace("\n1d =", "\n1d = no")).exit_code == 0


def test_answers_survive_when_the_course_is_made_again(tmp_path):
    write_template(str(tmp_path))
    path = tmp_path / "answers.txt"
    assert path.read_text(encoding="utf-8") == answer_template()
    path.write_text("1d = no\n", encoding="utf-8")
    write_template(str(tmp_path))
    assert path.read_text(encoding="utf-8") == "1d = no\n"
