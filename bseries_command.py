"""The `bseries` command, which Ctrl-C ends quietly from the first moment on, while its packages are imported."""

# What `signal` is made of: that takes a hundredth of a second to import, in which Ctrl-C gives a traceback.
import _signal  # pyright: ignore[reportMissingImports]
import os

INTERRUPTED = 130
"""The exit code for SIGINT: 128 + its number."""


def main() -> None:
    """Run the command with the arguments of this process."""
    if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:  # ignored in the background of a shell
        _signal.signal(_signal.SIGINT, lambda *_: os._exit(INTERRUPTED))  # nothing has been written yet
    from bseries.cli import main

    main()
