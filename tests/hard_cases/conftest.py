"""What the hard cases promise and what was measured: kept row by row, and written to the page on request.

`pytest tests/hard_cases --hard-cases-page docs/hard-cases.md` replaces the tables of the test files that ran. Each
stands on the page between `<!-- measured by test_….py -->` and `<!-- end -->`; the text around is written by hand.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from bseries.advice.machine import machine

HEAD = "| case | promised | measured | test |\n|---|---|---|---|\n"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--hard-cases-page", metavar="PAGE", help="rewrite the tables of measured figures on this page")


def pytest_configure(config: pytest.Config) -> None:
    if page := config.getoption("--hard-cases-page", None):
        config.pluginmanager.register(_PageWriter(Path(page)))


@pytest.fixture
def measured(request: pytest.FixtureRequest, record_property: Callable[[str, object], None]) -> Callable[..., None]:
    """Keep one row of the page: measured("log of rk4, order 15", "≤ 100 ulp", 3.2, "{:.1f} ulp").

    It asserts nothing. A number is shown by the format given (two digits otherwise), a text as it is.
    """

    def keep(case: str, promise: str, value: float | str, form: str | None = None) -> None:
        shown = value if isinstance(value, str) and form is None else (form or "{:.2g}").format(value)
        cells = (text.replace("|", r"\|") for text in (case, promise, shown))
        record_property("hard case", f"| {' | '.join(cells)} | `{request.node.originalname}` |\n")

    return keep


class _PageWriter:
    """Collects the rows (the reports bring them here from the workers of pytest-xdist too) and writes the page."""

    def __init__(self, page: Path) -> None:
        self.page = page
        self.rows: dict[str, list[str]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            rows = [str(row) for name, row in report.user_properties if name == "hard case"]
            self.rows.setdefault(Path(report.fspath).name, []).extend(rows)

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        if exitstatus != pytest.ExitCode.OK or hasattr(session.config, "workerinput"):
            return
        text = self.page.read_text(encoding="utf-8")
        for file, rows in self.rows.items():
            if rows:
                text = _with_section(text, f"measured by {file}", HEAD + "".join(rows))
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
