from __future__ import annotations

import re
import shlex

import pytest

from bseries.cli.application import VERBS, application


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_examples(answer, verb):
    text = answer(verb, "--help")
    assert "Examples:" in text
    assert "\b" not in text
    assert f"\n  {verb} " in answer("--help")


def examples() -> list[str]:
    """The lines of help texts that start with `bseries`, but those that need or write a file, or serve for ever."""
    texts = [command.help or "" for command in (application, *(application.get_command(None, v) for v in VERBS))]  # type: ignore[arg-type]
    lines = [line.strip() for text in texts for line in text.splitlines() if line.strip().startswith("bseries ")]
    left_out = r"tableau\.toml|answers\.txt|shadow \w+\.|[>|]|order 15|bseries explore|bseries audit"
    return [line for line in lines if not re.search(left_out, line)]


LESS = {"cost": ("--methods", "rk4", "--span", "5", "--errors", "1e-2:1e-3")}
"""What makes examples short that measure for a minute: of an option that is given twice, the second counts."""


@pytest.mark.slow
@pytest.mark.parametrize("example", examples())
def test_examples_run(answer, tmp_path, monkeypatch, example):
    monkeypatch.chdir(tmp_path)
    _, verb, *options = shlex.split(example)
    text = answer(verb, *options, *LESS.get(verb, ()))
    assert text or list(tmp_path.iterdir())


def test_there_are_examples():
    assert len(examples()) > 15


def test_version(answer):
    assert re.fullmatch(r"bseries \d+\.\d+.*\n", answer("--version"))


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts(answer, shell):
    assert "_BSERIES_COMPLETE" in answer("completion", shell)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("bseries mod", {"modified", "modifying"}),
        ("bseries modified dormand", {"dormand-prince54", "dormand-prince87", "dormand-prince853", "dormand-prince"}),
        ("bseries check radau-iia", {f"radau-iia{s}" for s in range(1, 7)}),
        ("bseries series leap", {"leapfrog"}),
        ("bseries modified rk4 --max", {"--max-children"}),
    ],
)
def test_completion(run, monkeypatch, words, expected):
    from click.shell_completion import BashComplete

    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    lines = BashComplete(application, {}, "bseries", "_BSERIES_COMPLETE").complete().splitlines()
    assert {line.partition(",")[2] for line in lines} == expected


@pytest.mark.parametrize(
    "words",
    [
        "modified ./ta", "modified tab", "modified rk4 -o ta", "simulate kepler --checkpoint ta", "simulate my",
        "figure riccati --data ta", "cost kepler --plot ta", "course --output ta", "report -o ta", "shadow ta",
    ],
)  # fmt: skip
def test_completion_of_paths(monkeypatch, words):
    from click.shell_completion import BashComplete

    monkeypatch.setenv("COMP_WORDS", f"bseries {words}")
    monkeypatch.setenv("COMP_CWORD", str(len(words.split())))
    found = BashComplete(application, {}, "bseries", "_BSERIES_COMPLETE").complete()
    assert found == f"file,{words.split()[-1]}"
