from __future__ import annotations

import io
import threading

import pytest

from bseries.cli.output import Progress
from integrators.core.arguments import split_row

pytestmark = pytest.mark.minimum


@pytest.mark.parametrize(
    ("text", "entries"),
    [
        ("", []),
        ("1", ["1"]),
        ("1,root(2,3),-(1,2)", ["1", "root(2,3)", "-(1,2)"]),
        (",", ["", ""]),
        ("(" * 10_000, ["(" * 10_000]),
    ],
)
def test_rows_are_split_outside_parentheses(text, entries):
    assert split_row(text) == entries


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def wait_for_timers():
    """Until the bar is drawn."""
    for thread in threading.enumerate():
        if isinstance(thread, threading.Timer):
            thread.join()


def test_progress_bar_appears_and_goes(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr("bseries.cli.output.PATIENCE", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    with Progress() as progress:
        wait_for_timers()
        progress.update(1, 2)
    assert "computing" in terminal.getvalue()
    assert "compiling" not in terminal.getvalue()
    shown = terminal.getvalue()
    progress.update(2, 2)
    assert terminal.getvalue() == shown  # the bar is gone


def test_progress_bar_says_that_code_is_compiled(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr("bseries.cli.output.PATIENCE", 0.0)
    monkeypatch.setattr("bseries.cli.output.is_compiling", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with Progress():
        wait_for_timers()
    assert "compiling for the first time" in terminal.getvalue()


def test_no_bar_for_quick_work_or_without_a_terminal(monkeypatch):
    for stream in (Terminal(), io.StringIO()):
        monkeypatch.setattr("sys.stderr", stream)
        with Progress() as progress:
            progress.update(1, 2)
        assert stream.getvalue() == ""
