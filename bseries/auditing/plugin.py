"""A plugin of pytest: with `--audit-tableaus PATH` every method of the path of which something is claimed is a test.

It is loaded with every run of pytest, so it imports the audit only where it is asked for.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from bseries_base.errors import BSeriesError

if TYPE_CHECKING:
    from bseries.auditing.verdicts import Audited


class WrongTableau(Exception):
    """A claim of a tableau that does not hold."""


class TableauItem(pytest.Item):
    """The test of one method: its claims hold."""

    def __init__(self, *, method: Audited, **given: Any):
        super().__init__(**given)
        self.method = method

    def runtest(self) -> None:
        """Fail where a claim does not hold."""
        if self.method.findings:
            raise WrongTableau(self.method.findings)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The claims that do not hold, with the entries that mend them."""
        if not isinstance(excinfo.value, WrongTableau):
            return super().repr_failure(excinfo, style)
        where = f"{self.method.source}:{self.method.line}: {self.method.name}"
        return "\n".join(f"{where}: {finding}" for finding in self.method.findings)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Where the method is."""
        return Path(self.method.source), self.method.line - 1, f"tableau {self.method.name}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option that names sources."""
    help_ = "audit the tableaus in a file or folder; repeatable"
    parser.getgroup("bseries").addoption("--audit-tableaus", action="append", default=[], metavar="PATH", help=help_)


def pytest_collection_modifyitems(session: pytest.Session, config: pytest.Config, items: list[pytest.Item]) -> None:
    """Add a test for each method that claims something."""
    if sources := config.getoption("--audit-tableaus"):
        from bseries.auditing.audit import audit

        try:
            found = audit(sources)
        except BSeriesError as error:
            raise pytest.UsageError(str(error)) from None
        for method in found.methods:
            if method.claims:
                name = f"{method.source}:{method.line}::{method.name}"
                items.append(TableauItem.from_parent(session, name=name, method=method))
