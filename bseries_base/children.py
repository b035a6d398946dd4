"""Processes that run no code from the working directory, leave interrupts to their parent, and end with it."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from bseries_base.interrupts import uninterrupted


@contextmanager
def _environment(name: str, value: str) -> Iterator[None]:
    """Set a variable of the environment in this block."""
    before = os.environ.get(name)
    os.environ[name] = value
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = before


def safe_path() -> AbstractContextManager[None]:
    """Python, where it is started in this block, imports nothing from the working directory."""
    return _environment("PYTHONSAFEPATH", "1")


def start_tracker() -> None:
    """Start the process that frees shared locks, which others would start, and then let interrupts through.

    It says nothing about the locks of killed processes.
    """
    if os.name == "posix":
        from multiprocessing.resource_tracker import ensure_running

        with _environment("PYTHONWARNINGS", "ignore"), safe_path(), uninterrupted():
            ensure_running()


class _Process(SpawnProcess):
    """A process that is started in this way."""

    @staticmethod
    def _Popen(process_obj: SpawnProcess) -> object:  # type: ignore[override]
        with safe_path(), uninterrupted():
            return SpawnProcess._Popen(process_obj)  # type: ignore[attr-defined]


class Children(SpawnContext):
    """A context of `multiprocessing` whose processes are spawned safely, and can be ended at once.

    What they run calls `end_with_parent` first.
    """

    def __init__(self) -> None:
        self._started: list[_Process] = []
        start_tracker()

    def Process(self, *arguments: Any, **options: Any) -> _Process:  # type: ignore[override]
        """A process of this context."""
        made = _Process(*arguments, **options)
        self._started.append(made)
        return made

    def end(self) -> None:
        """End all processes, whatever they are doing."""
        for process in self._started:
            if process.pid is not None and process.is_alive():
                process.kill()


def end_with_parent() -> None:
    """End this process as soon as the one that started it has ended, in whatever way."""
    threading.Thread(target=_watch, daemon=True).start()


def _watch() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
