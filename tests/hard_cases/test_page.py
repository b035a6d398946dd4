"""What the hard cases measure: promises are asserted, and the page shows them in the order of the tests."""

import math
from pathlib import Path
from types import SimpleNamespace

import pytest

FOLDER = Path(__file__).parent


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


def test_the_page_has_a_section_for_each_file_and_rows_in_the_order_of_tests(request, tmp_path):
    """Reports come as workers of pytest-xdist end."""
    writer = request.config.pluginmanager.get_plugin(str(FOLDER / "conftest.py")).PageWriter(tmp_path / "page.md")
    for place, row in ((2, "c\n"), (0, "a\n"), (10, "d\n"), (0, "b\n")):
        properties = [("hard case", [place, row])]
        writer.pytest_runtest_logreport(SimpleNamespace(when="call", user_properties=properties, fspath=__file__))
    writer.pytest_sessionfinish(SimpleNamespace(config=object()), pytest.ExitCode.OK)
    lines = (tmp_path / "page.md").read_text(encoding="utf-8").splitlines()
    assert lines[4] == "## Page"
    assert lines[6] == __doc__
    assert lines[-4:] == ["a", "b", "c", "d"]


def test_a_failed_run_writes_no_page(request, tmp_path):
    writer = request.config.pluginmanager.get_plugin(str(FOLDER / "conftest.py")).PageWriter(tmp_path / "page.md")
    writer.pytest_sessionfinish(SimpleNamespace(config=object()), pytest.ExitCode.TESTS_FAILED)
    assert not (tmp_path / "page.md").exists()
