"""The `bseries` command. One file per verb group; nothing is imported before it is needed."""

import gc
import sys

ALLOCATIONS = 500_000
"""Objects made between two searches for garbage, more than imports make.

A search after every 50,000 takes a tenth of the time of short commands, and saves at most a twentieth of the memory.
"""


def main() -> None:
    """Run the command with the arguments of this process."""
    gc.set_threshold(ALLOCATIONS, 10, 10)
    try:
        from bseries.cli.application import application

        application(prog_name="bseries")
    except KeyboardInterrupt:  # while starting; later ones end in `application`
        sys.exit(130)
    finally:
        gc.freeze()  # the search for garbage before Python ends costs a tenth of the time of short commands
