"""`bseries audit`: what sources claim of their tableaus, what is true, and which entry is wrong."""

from __future__ import annotations

from collections.abc import Sequence

import click

from bseries.cli.application import Refusal, say
from bseries.cli.options.values import WholeNumber, read_assignments
from bseries.cli.output import Output, takes_output
from bseries_base.table import Table

FAILED = 1
"""The exit code where a claim does not hold."""


@click.command()
@click.argument("sources", metavar="FILE|FOLDER...", nargs=-1, type=click.Path())
@click.option("--order", type=WholeNumber(), help="An order that every method must have.")
@click.option("--claim", "claims", metavar="NAME=ORDER", multiple=True, help="The order of a method; repeatable.")
@takes_output
def audit(sources: Sequence[str], order: int | None, claims: Sequence[str], output: Output) -> Table:
    """Tableaus in anybody's source: what is claimed of them, and what is true.

    Files in C, C++, Julia, Python, Fortran, MATLAB, Mathematica, JSON and TOML are parsed and never run. For each
    method found, the order that its name, fields or comments claim is proved or refuted; orders of rounded numbers hold
    to some digits. Where a claim fails, the entries whose change restores it are named. The exit code is 1 if a claim
    fails.

    \b
    Examples:
      bseries audit src/tableaus
      bseries audit erk.jl --format json -o audit.json
      bseries audit mine.py --claim step=4
    """
    from bseries.auditing.audit import audit

    if not sources:
        raise Refusal("FILE must be given: one or several files or folders, but there was none")
    said = read_assignments(claims, "claim", "rk4=4")
    wrong = next((name for name, text in said.items() if not text.strip().isdecimal()), None)
    if wrong is not None:
        raise Refusal(f"claim must be NAME=ORDER, but the order of {wrong!r:.60} was {said[wrong]!r:.60}")
    found = audit(sources, order=order, claims={name: int(text) for name, text in said.items()})
    if not found.holds:
        click.get_current_context().call_on_close(lambda: _fail())
        if output.has_records:
            say("warning", repr(found)[1:-1])
    return found.to_table()


def _fail() -> None:
    raise SystemExit(FAILED)
