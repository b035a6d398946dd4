"""The `bseries` command. One file per verb group; nothing is imported before it is needed."""

import sys


def main() -> None:
    """Run the command with the arguments of this process."""
    try:
        from bseries.cli.application import application

        application(prog_name="bseries")
    except KeyboardInterrupt:  # while starting; later ones end in `application`
        sys.exit(130)
