"""What README and the pages under docs claim: commands print what is shown, links lead somewhere.

The Python examples run as doctests; here are the others.
"""

import doctest
import inspect
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

import bseries
from bseries.cli.application import application

ROOT = Path(__file__).parent.parent
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("[hr]*/*.md")]


def console_session(page):
    """Pairs (command, output shown) of the console blocks of a page."""
    for block in re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        for command, _, output in (part.partition("\n") for part in block.split("$ ")[1:]):
            yield command, output


SESSIONS = {page.name: list(console_session(page)) for page in PAGES}


def pattern(shown):
    """A regular expression for an output; … stands for anything in a line, and a line … for any lines."""
    lines = shown.splitlines(keepends=True)
    return "".join(r"(?:.*\n)*?" if line == "…\n" else re.escape(line).replace("…", ".*") for line in lines)


@pytest.mark.slow
@pytest.mark.parametrize("page", [name for name, session in SESSIONS.items() if session])
def test_commands_print_what_pages_show(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command, content in SESSIONS[page]:
        if command.startswith("cat "):
            Path(command.removeprefix("cat ")).write_text(content, encoding="utf-8")
    for command, shown in SESSIONS[page]:
        if command.startswith("bseries "):
            output = None
            for verb in command.split(" | "):
                line = shlex.split(verb)[1:]
                output = CliRunner().invoke(application, line, input=output, prog_name="bseries").output
            assert output is not None
            assert re.fullmatch(pattern(shown), output), f"{command}\n{output}"


def test_copied_examples_are_their_commands_without_prompts():
    """What the copy button takes for a prompt begins each line of an example, and no line of output."""
    (prompt,) = re.findall(r'^copybutton_prompt_text = r"(.*?)"', (ROOT / "docs" / "conf.py").read_text("utf-8"), re.M)
    parser, seen = doctest.DocTestParser(), 0
    for page in sorted((ROOT / "docs").rglob("*.md")):
        for block in re.findall(r"^```python\n(>>> .*?)^```", page.read_text(encoding="utf-8"), re.M | re.S):
            copied = [re.sub(f"^({prompt})", "", line) for line in block.splitlines() if re.match(prompt, line)]
            sources = "".join(example.source for example in parser.get_examples(block))
            assert copied == sources.splitlines(), page
            seen += 1
    assert seen > 100
    assert re.match(prompt, "$ bseries check rk4")
    assert not re.match(prompt, "...")


FIRST_TASKS = ROOT / "docs" / "howto" / "first-tasks.md"
TASKS = re.findall(r"^## (.*?)$.*?^```python\n(.*?)^```", FIRST_TASKS.read_text(encoding="utf-8"), re.M | re.S)


def test_there_are_five_tasks_of_ten_lines():
    assert len(TASKS) == 5
    for title, text in TASKS:
        assert 4 <= sum(line.startswith((">>> ", "... ")) for line in text.splitlines()) <= 10, title


@pytest.mark.few(1)
@pytest.mark.parametrize(("title", "text"), TASKS, ids=[title for title, _ in TASKS])
def test_each_task_stands_alone(title, text):
    test = doctest.DocTestParser().get_doctest(text, {}, title, None, None)
    assert doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test).failed == 0


def test_a_wrong_output_would_be_noticed():
    assert re.fullmatch(pattern("a\n…\nc\n"), "a\nb\nb\nc\n")
    assert not re.fullmatch(pattern("a\n…\nc\n"), "a\nb\nb\n")
    assert not re.fullmatch(pattern("a\n1/2\n"), "a\n1/3\n")
    assert re.fullmatch(pattern("a … c\n"), "a b c\n")
    assert not re.fullmatch(pattern("a … c\n"), "a b\nc\n")


def test_make_demo_shows_what_readme_shows():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    demo = re.search(r"^demo:.*\n((?:\t.*\n)+)", makefile, re.MULTILINE)
    assert demo is not None
    commands = re.findall(r"(bseries .*)", demo[1])
    assert (
        commands == [command for command, _ in SESSIONS["README.md"] if command.startswith("bseries ")][: len(commands)]
    )


def test_reference_lists_all_public_names_once():
    listed = []
    for page in (ROOT / "docs" / "reference").glob("*.md"):
        for block in re.findall(r":nosignatures:\n\n((?:   \w+\n)+)", page.read_text(encoding="utf-8")):
            listed += block.split()
    places = [bseries, *(thing for name in dir(bseries) if inspect.ismodule(thing := getattr(bseries, name)))]
    public = {name for place in places for name in dir(place) if not inspect.ismodule(getattr(place, name))}
    assert sorted(listed) == sorted(public - {"errors"})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_between_files_lead_somewhere(page):
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8"))
    assert all((page.parent / target).exists() for target in targets), targets


@pytest.mark.parametrize(
    ("pattern", "last"),
    [
        (r"\((\d+)\)", 28),
        (r"Theorem (\d+)", 7),
        (r"Example (\d+)", 9),
        (r"Figure (\d+)", 10),
        (r"Exercise (\d+)", 6),
        (r"Definition (\d+)", 1),
    ],
)
def test_everything_that_the_lecture_numbers_is_listed(pattern, last):
    page = (ROOT / "docs" / "lecture.md").read_text(encoding="utf-8")
    first_cells = " ".join(re.findall(r"^\| ([^|]*) \| .*; notebook \[", page, re.MULTILINE))
    assert {int(number) for number in re.findall(pattern, first_cells)} == set(range(1, last + 1))
