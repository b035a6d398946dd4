"""The page of hard cases and its tests know each other: every row names a test, every test that measures has a row."""

import ast
import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
PAGE = (FOLDER.parents[1] / "docs" / "hard-cases.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"<!-- measured by (\S+) -->\n(.*?)<!-- end -->", PAGE, re.DOTALL))
FILES = {file.name for file in FOLDER.glob("test_*.py")} - {Path(__file__).name}


def measuring(source: str) -> set[str]:
    """The tests of a module that ask for the fixture `measured`."""
    functions = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef))
    return {function.name for function in functions if any(x.arg == "measured" for x in function.args.args)}


def named(section: str) -> set[str]:
    """The tests that the rows of a table name."""
    return set(re.findall(r"\| `(test_\w+)` \|$", section, re.MULTILINE))


def test_every_file_has_a_section():
    assert set(SECTIONS) == FILES


@pytest.mark.parametrize("file", sorted(FILES))
def test_rows_and_tests_agree(file):
    assert named(SECTIONS[file]) == measuring((FOLDER / file).read_text(encoding="utf-8"))


def test_a_difference_would_be_noticed():
    assert measuring("def test_a(measured): ...\ndef test_b(x): ...\ndef test_c(x, measured): ...") == {
        "test_a",
        "test_c",
    }
    assert named("| case | promised | measured | test |\n|---|---|---|---|\n| x | y | z | `test_a` |\n") == {"test_a"}
