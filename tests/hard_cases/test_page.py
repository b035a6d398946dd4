"""The page of hard cases and its tests know each other: every row names a test, every test that measures has a row."""

import ast
import math
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

FOLDER = Path(__file__).parent
PAGE = (FOLDER.parents[1] / "docs" / "hard-cases.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"<!-- measured by (\S+) -->\n(.*?)<!-- end -->", PAGE, re.DOTALL))
FILES = {file.name for file in FOLDER.glob("test_*.py")} - {Path(__file__).name}


def measuring(source: str) -> list[str]:
    """The tests of a module that ask for the fixture `measured`, in order."""
    functions = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef))
    return [function.name for function in functions if any(x.arg == "measured" for x in function.args.args)]


def named(section: str) -> list[str]:
    """The tests that the rows of a table name, each where rows of it begin."""
    rows = re.findall(r"\| `(test_\w+)` \|$", section, re.MULTILINE)
    return [name for k, name in enumerate(rows) if not k or rows[k - 1] != name]


@pytest.fixture
def written(request):
    """For what is true when the page has been written."""
    if request.config.getoption("--hard-cases-page", None):
        pytest.skip("the page is being written")


def test_every_file_has_a_section():
    assert set(SECTIONS) == FILES


@pytest.mark.usefixtures("written")
@pytest.mark.parametrize("file", sorted(FILES))
def test_rows_and_tests_agree(file):
    """In the order of the file, with all rows of a test together."""
    assert named(SECTIONS[file]) == measuring((FOLDER / file).read_text(encoding="utf-8"))


def test_a_difference_would_be_noticed():
    assert measuring("def test_a(measured): ...\ndef test_b(x): ...\ndef test_c(x, measured): ...") == [
        "test_a",
        "test_c",
    ]
    rows = "| case | promised | measured | test |\n|---|---|---|---|\n" + "".join(
        f"| x | y | z | `test_{name}` |\n" for name in "aaba"
    )
    assert named(rows) == ["test_a", "test_b", "test_a"]


@pytest.mark.usefixtures("written")
def test_every_case_stands_for_itself():
    """Rows may be read alone, so that none refers to the one before; and no two say the same."""
    for section in SECTIONS.values():
        rows = re.findall(r"^\| (.*? \| .*?) \| .* `test_", section, re.MULTILINE)
        assert rows
        assert not [row for row in rows if row.startswith("the same")]
        assert len(rows) == len(set(rows))


# The fixture


@pytest.fixture
def kept(measured):
    """A fixture of its own whose rows do not come to the page, and its rows."""
    rows = []
    return type(measured)(lambda *row: rows.append(row)), rows


def test_what_is_promised_is_asserted(kept):
    asserting, rows = kept
    asserting.within("x", 0.5, 0.5, " ulp", what="error", note="as known")
    asserting.at_least("y", 3, 2, form=".1f")
    asserting.said("z", "warns", "“warning”")
    assert rows == [("x", "error ≤ 0.5 ulp", "0.5 ulp; as known"), ("y", "≥ 2", "3.0"), ("z", "warns", "“warning”")]


@pytest.mark.parametrize("value", [0.51, math.inf, math.nan])
def test_what_is_not_kept_fails(kept, value):
    asserting, rows = kept
    with pytest.raises(AssertionError, match=r"x: .* instead of ≤ 0\.5"):
        asserting.within("x", value, 0.5)
    with pytest.raises(AssertionError, match=r"x: .* instead of ≥ 2"):
        asserting.at_least("x", -value, 2)
    assert not rows


@pytest.mark.usefixtures("written")
def test_promises_that_the_page_lacks_fail(measured):
    with pytest.raises(AssertionError, match=r"the page lacks the row \| no such case"):
        measured.within("no such case", 1, 2)


def test_rows_are_sorted_by_the_order_of_tests(request):
    """Reports come as workers of pytest-xdist end."""
    writer = request.config.pluginmanager.get_plugin(str(FOLDER / "conftest.py")).PageWriter(Path("page.md"))
    for place, row in ((2, "c\n"), (0, "a\n"), (10, "d\n"), (0, "b\n")):
        report = SimpleNamespace(when="call", user_properties=[("hard case", [place, row])], fspath="tests/test_x.py")
        writer.pytest_runtest_logreport(report)
    assert writer.table("test_x.py").splitlines()[2:] == ["a", "b", "c", "d"]
