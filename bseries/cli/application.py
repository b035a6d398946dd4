"""The group of verbs: imports a verb when it is called, and reports every failure in one line."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any, TextIO

import click

from bseries_base.errors import plain, suggestion
from bseries_base.extras import MissingPackage
from bseries_command import INTERRUPTED

VERBS = {
    "modified": "series",
    "modifying": "series",
    "series": "series",
    "compose": "compose",
    "equation": "equation",
    "hamiltonian": "hamiltonian",
    "drift": "drift",
    "check": "check",
    "audit": "audit",
    "conditions": "conditions",
    "trees": "trees",
    "methods": "catalogue",
    "scenes": "catalogue",
    "simulate": "simulate",
    "shadow": "shadow",
    "effects": "effects",
    "cost": "cost",
    "figure": "figure",
    "explore": "explore",
    "report": "explore",
    "course": "course",
    "completion": "completion",
}
"""The verbs and their modules."""

BROKEN_PIPE = 141
"""The exit code for SIGPIPE: 128 + its number."""


class Refusal(click.ClickException):
    """A failure that ends the command with one sentence and exit code 2."""

    exit_code = 2


class Application(click.Group):
    """A group of verbs, imported when called, with one-line errors."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The verbs, in the order of the help."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a verb."""
        if cmd_name not in VERBS:
            return None
        return getattr(import_module(f"bseries.cli.verbs.{VERBS[cmd_name]}"), cmd_name)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Find the verb, or refuse with verbs of a similar spelling."""
        if args and args[0] not in VERBS and not args[0].startswith("-"):
            near = suggestion(args[0], VERBS)
            raise Refusal(f"verb must be one of {', '.join(VERBS)}, but was {args[0]!r:.60}{near}")

        return super().resolve_command(ctx, args)

    def main(self, args: Sequence[str] | None = None, *rest: Any, standalone_mode: bool = True, **extra: Any) -> Any:
        """Run; failures print one line and exit with code 2."""
        arguments = list(sys.argv[1:] if args is None else args) or ["--help"]
        if not standalone_mode:
            return super().main(arguments, *rest, standalone_mode=False, **extra)
        try:
            code = super().main(arguments, *rest, standalone_mode=False, **extra)
        except click.ClickException as error:
            message = error.format_message()
            if isinstance(error, click.UsageError) and error.ctx is not None:
                message = f"{message.rstrip('.')}; see `{error.ctx.command_path} --help`"
            say("error", message)
            code = 2
        except click.Abort:  # Ctrl-C while arguments were read
            code = INTERRUPTED
        sys.exit(code)

    def make_context(self, *arguments: Any, **extra: Any) -> click.Context:
        """Read the arguments; --help and --version print here."""
        with _quiet_ends():
            return super().make_context(*arguments, **extra)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a verb."""
        check_environment()
        limit = sys.get_int_max_str_digits()
        sys.set_int_max_str_digits(0)  # of printed integers; input has a limit of its own
        try:
            with _quiet_ends(), warnings.catch_warnings():
                warnings.simplefilter("always")
                warnings.simplefilter("ignore", ResourceWarning)  # of files that an interrupt left open
                warnings.showwarning = lambda message, *_: say("warning", str(message))
                result = super().invoke(ctx)
                sys.stdout.flush()
                return result
        finally:
            sys.set_int_max_str_digits(limit)


@contextmanager
def _quiet_ends() -> Iterator[None]:
    """Convert errors that a user can cause to a sentence or an exit code."""
    try:
        prepare_streams()
        yield
    except KeyboardInterrupt:
        raise click.exceptions.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        discard_output()
        raise click.exceptions.Exit(BROKEN_PIPE) from None
    except OSError as error:  # the disk is full, for example; errors of input files are the library's
        discard_output()
        raise Refusal(f"output must be writable, but was not: {error.strerror}") from None
    except MemoryError:
        raise Refusal("there must be more memory for this request; a smaller --order needs less") from None
    except MissingPackage as error:
        raise Refusal(str(error)) from None
    except ValueError as error:
        from bseries import errors

        if isinstance(error, errors):
            raise Refusal(str(error)) from None
        raise


def say(kind: str, sentence: str) -> None:
    """One line on stderr: ``bseries: error: …`` or ``bseries: warning: …``."""
    with suppress(OSError):  # the reader is gone; the exit code reports it
        click.echo(f"bseries: {kind}: {plain(' '.join(sentence.split()))}", err=True)


def check_environment() -> None:
    """Refuse what numba would refuse with a traceback; pictures go to files, whatever backend is set for windows."""
    threads = os.environ.get("NUMBA_NUM_THREADS", "").strip()
    if threads.removeprefix("-").isdecimal() and int(threads) < 1:
        raise Refusal(f"NUMBA_NUM_THREADS must be a number of threads, 1 or more, but was {threads!r:.60}")
    os.environ["MPLBACKEND"] = "agg"


def standard_input() -> TextIO:
    """Standard input, for - in place of a file."""
    if sys.stdin is None:  # closed by the caller
        raise Refusal("- must stand for what comes on standard input, but that was closed")
    return sys.stdin


def prepare_streams() -> None:
    """Ensure that standard output and error exist, and that output encodes the letter τ."""
    if sys.stderr is None:  # closed by the caller, who wants to see nothing
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8")
    if sys.stdout is None:  # closed by the caller: writing fails, as on a full disk
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")
    elif (sys.stdout.encoding or "").lower().replace("-", "") != "utf8" and hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8")  # pyright: ignore[reportAttributeAccessIssue]


def discard_output() -> None:
    """Redirect standard output to the null device, since its reader is gone."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@click.group(cls=Application, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="bseries-engine", message="%(prog)s %(version)s")
def application() -> None:
    """Rooted trees, B-series and backward error analysis of numerical methods for y' = f(y), exactly.

    \b
    Examples:
      bseries modified rk4 --order 6
      bseries modified stormer-verlet --order 3 --nonzero
      bseries modifying implicit-midpoint --order 5
      bseries hamiltonian implicit-midpoint --scene pendulum
      bseries check gauss3
      bseries series --A "0,0;1/2,0" --b "0,1" --format csv
      bseries trees --order 5

    METHOD is a name from `bseries methods`; a tableau file, if it has a path separator or ends in .json or .toml; or -
    for a tableau file on standard input. Instead of it, --A and --b give a tableau inline. Everything is computed
    exactly unless floats go in.
    """
