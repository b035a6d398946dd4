"""The `bseries` command. One file per verb group; nothing is imported before it is needed."""

import gc
import sys

ALLOCATIONS = 50_000
"""Objects made between two searches for garbage: Python's 700 cost a tenth of the time of imports."""


def main() -> None:
    """Run the command with the arguments of this process."""
    gc.set_threshold(ALLOCATIONS, 20, 20)
    try:
        from bseries.cli.application import application

        application(prog_name="bseries")
    except KeyboardInterrupt:  # while starting; later ones end in `application`
        sys.exit(130)
    finally:
        gc.freeze()  # the search for garbage before Python ends costs a tenth of the time of short commands
