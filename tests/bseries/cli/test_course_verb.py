"""`bseries course`: files, and refusals."""

from __future__ import annotations

import os
import sys

import pytest

pytest.importorskip("pypandoc")


def test_a_part_of_the_course(answer, tmp_path):
    folder = tmp_path / "new" / "course"
    assert answer("course", "-o", str(folder), "--document", "handout", "--format", "HTML") == ""
    assert [path.name for path in folder.iterdir()] == ["handout.html"]
    assert (folder / "handout.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "output must be given, as in -o course, but was not"),
        (["-o", "file"], "output must be a folder that can be made, but 'file' was not: File exists"),
        (
            ["-o", "a", "--document", "book"],
            "document must be one of slides, handout, exercises, solutions, but was 'book'",
        ),
        (["-o", "a", "--format", "epub"], "format must be one of html, pdf, but was 'epub'"),
    ],
)
def test_refusals(run, tmp_path, monkeypatch, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    result = run("course", *arguments)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert result.stderr.startswith("bseries: error: ")
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.glob("*/*"))


def test_a_folder_that_is_not_writable(run, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write everywhere
    result = run("course", "-o", str(tmp_path))
    assert result.exit_code == 2
    assert "output must be a folder that can be written to, but was" in result.stderr


def test_without_typst_there_is_a_sentence(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "typst", None)
    result = run("course", "-o", str(tmp_path), "--document", "handout")
    assert result.exit_code == 2
    assert "the course needs typst: pip install '.[course]'" in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
