"""What README and the pages under docs claim: commands print what is shown, links lead somewhere.

The Python examples run as doctests; here are the others.
"""

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from bseries.cli.application import application

ROOT = Path(__file__).parent.parent
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]


def console_session():
    """Pairs (command, output shown) of the console blocks in README."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for block in re.findall(r"```console\n(.*?)```", text, re.DOTALL):
        for command, _, output in (part.partition("\n") for part in block.split("$ ")[1:]):
            yield command, output


SESSION = list(console_session())


def pattern(shown):
    """A regular expression for an output; a line … stands for any lines."""
    return "".join(r"(?:.*\n)*?" if line == "…\n" else re.escape(line) for line in shown.splitlines(keepends=True))


@pytest.mark.parametrize(("command", "shown"), [pair for pair in SESSION if pair[0].startswith("bseries ")])
def test_commands_print_what_readme_shows(command, shown, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for other, content in SESSION:
        if other.startswith("cat "):
            Path(other.removeprefix("cat ")).write_text(content, encoding="utf-8")
    output = CliRunner().invoke(application, shlex.split(command)[1:]).output
    assert re.fullmatch(pattern(shown), output), output


def test_a_wrong_output_would_be_noticed():
    assert re.fullmatch(pattern("a\n…\nc\n"), "a\nb\nb\nc\n")
    assert not re.fullmatch(pattern("a\n…\nc\n"), "a\nb\nb\n")
    assert not re.fullmatch(pattern("a\n1/2\n"), "a\n1/3\n")


def test_make_demo_shows_what_readme_shows():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    demo = re.search(r"^demo:.*\n((?:\t.*\n)+)", makefile, re.MULTILINE)
    assert demo is not None
    commands = re.findall(r"(bseries .*)", demo[1])
    assert commands == [command for command, _ in SESSION if command.startswith("bseries ")][: len(commands)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_between_files_lead_somewhere(page):
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8"))
    assert all((page.parent / target).exists() for target in targets), targets
