from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest
from click.testing import CliRunner, Result

from bseries.cli.application import application

# Before click 8.2 stderr had to be kept apart from stdout on request.
APART: dict[str, Any] = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}


@pytest.fixture
def run() -> Callable[..., Result]:
    """Run the command in this process: run("modified", "rk4", …)."""

    def invoke(*arguments: str, stdin: str | bytes | None = None) -> Result:
        return CliRunner(**APART).invoke(application, list(arguments), input=stdin, prog_name="bseries")

    return invoke


@pytest.fixture
def answer(run: Callable[..., Result]) -> Callable[..., str]:
    """What the command prints on stdout when all is well."""

    def invoke(*arguments: str, stdin: str | bytes | None = None) -> str:
        result = run(*arguments, stdin=stdin)
        assert result.exit_code == 0, result.output
        assert not result.stderr
        return result.stdout

    return invoke
