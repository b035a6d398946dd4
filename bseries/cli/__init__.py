"""The `bseries` command. One file per verb group; nothing is imported before it is needed."""

import atexit
import gc
import os
import signal
import sys
from types import FrameType
from typing import Any

from bseries_base.interrupts import in_llvmlite, interrupt_soon
from bseries_command import INTERRUPTED

ALLOCATIONS = 500_000
"""Objects made between two searches for garbage, more than imports make.

A search after every 50,000 takes a tenth of the time of short commands, and saves at most a twentieth of the memory.
"""


def main() -> None:
    """Run the command with the arguments of this process."""
    gc.set_threshold(ALLOCATIONS, 10, 10)
    interrupts = Interrupts()
    try:
        from bseries.cli.application import application

        application(prog_name="bseries")
    except BaseException:
        if not interrupts.came:
            raise
        sys.exit(INTERRUPTED)
    finally:
        interrupts.end()
        gc.freeze()  # the search for garbage before Python ends costs a tenth of the time of short commands


class Interrupts:
    """Ctrl-C as KeyboardInterrupt, even where Python would only print it: in finalizers and callbacks.

    Modules that are being loaded may turn it into another error; `came` tells that there was one. It waits
    for llvmlite.
    """

    def __init__(self) -> None:
        self.came = False
        self._is_heard = callable(signal.getsignal(signal.SIGINT))  # they are ignored in the background of a shell
        if self._is_heard:
            signal.signal(signal.SIGINT, self._interrupt)
            sys.unraisablehook = self._ignored
            # Registered first, this is called last: Python then restores the default action, a death without exit code.
            atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)

    def _interrupt(self, _: int, frame: FrameType | None) -> None:
        if in_llvmlite(frame):
            interrupt_soon()
        else:
            self.came = True
            raise KeyboardInterrupt

    def _ignored(self, problem: Any) -> None:
        if issubclass(problem.exc_type, KeyboardInterrupt):
            interrupt_soon()  # after this hook
        else:
            sys.__unraisablehook__(problem)

    def end(self) -> None:
        """End the process at once from now on: all is written."""
        if self._is_heard:
            signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
