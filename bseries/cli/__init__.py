"""The `bseries` command. One file per verb group; nothing is imported before it is needed."""

import gc
import os
import signal
import sys
from typing import Any

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

    Modules that are being loaded may turn it into another error; `came` tells that there was one.
    """

    def __init__(self) -> None:
        self.came = False
        self._is_heard = callable(signal.getsignal(signal.SIGINT))  # they are ignored in the background of a shell
        if self._is_heard:
            signal.signal(signal.SIGINT, self._interrupt)
            sys.unraisablehook = self._ignored

    def _interrupt(self, *_: object) -> None:
        self.came = True
        raise KeyboardInterrupt

    def _ignored(self, problem: Any) -> None:
        if issubclass(problem.exc_type, KeyboardInterrupt):
            from threading import Timer

            again = Timer(0.01, os.kill, (os.getpid(), signal.SIGINT))  # after this hook
            again.daemon = True
            again.start()
        else:
            sys.__unraisablehook__(problem)

    def end(self) -> None:
        """End the process at once from now on: all is written."""
        if self._is_heard:
            signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
