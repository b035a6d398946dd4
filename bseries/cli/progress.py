"""Progress bar on stderr for work of more than a second, if stderr is a terminal; it names what takes the time."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Any

import click

from foundation.machine_code import is_compiling

PATIENCE = 1.0
"""Seconds before a bar is drawn."""
COMPILING = "compiling for the first time"


class Progress:
    """A context manager that draws a bar after `PATIENCE` seconds and erases it at the end."""

    def __init__(self) -> None:
        self._timer: Any = None
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        if sys.stderr.isatty():
            from threading import Timer

            self._timer = Timer(PATIENCE, self._draw)
            self._timer.daemon = True
            self._timer.start()
        return self

    def _draw(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, ProgressColumn, TaskProgressColumn, TimeElapsedColumn
        from rich.progress import Progress as Bars

        class Work(ProgressColumn):
            """What is being done at this moment."""

            def render(self, task: Any) -> str:
                return COMPILING if is_compiling() else task.description

        columns = Work(), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
        bar = Bars(*columns, console=Console(stderr=True), transient=True)
        self._task = bar.add_task("computing", total=None)
        bar.start()
        self._bar = bar

    def update(self, done: int, total: int) -> None:
        """Show the part of the writing that is done; before the first call the bar is indeterminate."""
        if self._bar is not None:
            self._bar.update(self._task, description="writing", completed=done, total=total)

    def say(self, text: str) -> None:
        """A line on stderr, above the bar if there is one."""
        if self._bar is not None:
            self._bar.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            click.echo(text, err=True)

    def close(self) -> None:
        """Erase the bar, or keep it from being drawn."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer.join()
            self._timer = None
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
