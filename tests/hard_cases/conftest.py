"""What the hard cases promise and what was measured: asserted, and written to a page on request.

`pytest tests/hard_cases --hard-cases-page build/hard-cases.md` writes the page: for each test file its docstring and a
table of what its tests measured.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from bseries.advice.timing import machine

HEAD = "| case | promised | measured | test |\n|---|---|---|---|\n"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--hard-cases-page", metavar="PAGE", help="write what was measured to this page")


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

    def keep(*cells: str) -> None:
        case, promise, found = (text.replace("|", r"\|") for text in cells)
        name = getattr(request.node, "originalname", request.node.name)
        record_property("hard case", [place, f"| {case} | {promise} | {found} | `{name}` |\n"])

    return Measured(keep)


class PageWriter:
    """Collects rows from the reports, which also bring them from the workers of pytest-xdist, and writes the page."""

    def __init__(self, page: Path) -> None:
        self.page = page
        self.rows: dict[Path, list[tuple[int, str]]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            rows = [row for name, row in report.user_properties if name == "hard case"]
            self.rows.setdefault(Path(report.fspath), []).extend((int(row[0]), str(row[1])) for row in rows)  # pyright: ignore

    def section(self, file: Path) -> str:
        """The docstring of a file, and its rows in the order of its tests, whichever ended first."""
        title, _, text = (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or file.stem).partition("\n\n")
        rows = "".join(row for _, row in sorted(self.rows[file], key=lambda found: found[0]))
        return f"## {file.stem.removeprefix('test_').replace('_', ' ').capitalize()}\n\n" + "\n\n".join(
            filter(None, (title, text, HEAD + rows))
        )

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        if exitstatus != pytest.ExitCode.OK or hasattr(session.config, "workerinput"):
            return
        found = machine()
        sections = [self.section(file) for file in sorted(file for file, rows in self.rows.items() if rows)]
        head = f"# Hard cases\n\n{found['date']}, {found['processor']}, {found['versions']}."
        self.page.parent.mkdir(parents=True, exist_ok=True)
        self.page.write_text("\n\n".join([head, *sections]), encoding="utf-8")
