"""What the hard cases promise and what was measured: asserted, kept row by row, and written to the page on request.

`pytest tests/hard_cases --hard-cases-page docs/hard-cases.md` replaces the tables of the test files that ran. Each
stands on the page between `<!-- measured by test_….py -->` and `<!-- end -->`; the text around is written by hand.
Without the option, cases and promises that the page does not have in these words fail.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from bseries.advice.timing import machine

PAGE = Path(__file__).parents[2] / "docs" / "hard-cases.md"
HEAD = "| case | promised | measured | test |\n|---|---|---|---|\n"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--hard-cases-page", metavar="PAGE", help="rewrite the tables of measured figures on this page")


def pytest_configure(config: pytest.Config) -> None:
    if page := config.getoption("--hard-cases-page", None):
        config.pluginmanager.register(PageWriter(Path(page)))


class Measured:
    """Asserts promises, and keeps a row of the page for each: the number on the page is the number asserted.

    Args:
        keep: Called with the case, the promise and what was measured.
    """

    def __init__(self, keep: Callable[[str, str, str], object]) -> None:
        self._keep = keep

    def within(self, case: str, value: float, limit: float, unit: str = "", **shown: str) -> None:
        """value ≤ limit, in the three digits that are shown; nan is not."""
        limit = _shown(limit)
        assert float(value) <= limit, f"{case}: {value!r} instead of ≤ {limit:g}{unit}"
        self._row(case, "≤", limit, value, unit, **shown)

    def at_least(self, case: str, value: float, limit: float, unit: str = "", **shown: str) -> None:
        """value ≥ limit, in the three digits that are shown; nan is not."""
        limit = _shown(limit)
        assert float(value) >= limit, f"{case}: {value!r} instead of ≥ {limit:g}{unit}"
        self._row(case, "≥", limit, value, unit, **shown)

    def said(self, case: str, promise: str, found: str) -> None:
        """What no number says: errors, warnings, exact results, and figures of which nothing is promised."""
        self._keep(_short(case), promise, found)

    def _row(
        self, case: str, sign: str, limit: float, value: float, unit: str, *, what: str = "", form: str = ".2g",
        note: str = "",
    ) -> None:  # fmt: skip
        """Write the row: `what` is what is limited, `form` how the value is shown, `note` what else was found."""
        promise = _short(f"{what} {sign} {limit:g}{unit}".strip())
        self._keep(_short(case), promise, _short(f"{float(value):{form}}{unit}") + (f"; {note}" if note else ""))


def _shown(limit: float) -> float:
    return float(f"{limit:.3g}")


def _short(text: str) -> str:
    """1e-9 for 1e-09, and 1e150 for 1e+150."""
    return re.sub(r"(?<=\d)e(-?)\+?0*(?=\d)", r"e\1", text)


@pytest.fixture
def measured(request: pytest.FixtureRequest, record_property: Callable[[str, object], None]) -> Measured:
    """Promises of this test; see `Measured`."""
    place = request.session.items.index(request.node)
    page = None if request.config.getoption("--hard-cases-page", None) else PAGE.read_text(encoding="utf-8")

    def keep(*cells: str) -> None:
        case, promise, found = (text.replace("|", r"\|") for text in cells)
        row = f"| {case} | {promise} |"
        assert page is None or row in page, f"the page lacks the row {row}: see --hard-cases-page in {__file__}"
        name = getattr(request.node, "originalname", request.node.name)
        record_property("hard case", [place, f"| {case} | {promise} | {found} | `{name}` |\n"])

    return Measured(keep)


class PageWriter:
    """Collects the rows (the reports bring them here from the workers of pytest-xdist too) and writes the page."""

    def __init__(self, page: Path) -> None:
        self.page = page
        self.rows: dict[str, list[tuple[int, str]]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            rows = [row for name, row in report.user_properties if name == "hard case"]
            self.rows.setdefault(Path(report.fspath).name, []).extend((int(row[0]), str(row[1])) for row in rows)  # pyright: ignore

    def table(self, file: str) -> str:
        """The rows of a file in the order of its tests, whichever ended first."""
        return HEAD + "".join(row for _, row in sorted(self.rows[file], key=lambda found: found[0]))

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        if exitstatus != pytest.ExitCode.OK or hasattr(session.config, "workerinput"):
            return
        text = self.page.read_text(encoding="utf-8")
        for file in (file for file, rows in self.rows.items() if rows):
            text = _with_section(text, f"measured by {file}", self.table(file))
        found = machine()
        text = _with_section(text, "measured on", f"{found['date']}, {found['processor']}, {found['versions']}.\n")
        self.page.write_text(text, encoding="utf-8")


def _with_section(page: str, name: str, content: str) -> str:
    """The page with the content between <!-- name --> and <!-- end -->."""
    begin = f"<!-- {name} -->\n"
    section = re.compile(re.escape(begin) + r".*?(?=<!-- end -->)", re.DOTALL)
    if not section.search(page):
        raise pytest.UsageError(f"the page of hard cases must have `{begin.strip()}` and `<!-- end -->`, but has not")
    return section.sub(lambda _: f"{begin}\n{content}\n", page, count=1)
