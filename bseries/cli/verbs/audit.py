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
@click.option("--claims", "file", metavar="FILE", type=click.Path(), help="Orders by name, as JSON or TOML.")
@click.option("--against", metavar="FILE|FOLDER", type=click.Path(), help="Compare with methods of the same name.")
@takes_output
def audit(
    sources: Sequence[str],
    order: int | None,
    claims: Sequence[str],
    file: str | None,
    against: str | None,
    output: Output,
) -> Table:
    """Tableaus in anybody's source: what is claimed of them, and what is true.

    Files in C, C++, Julia, Python, Fortran, MATLAB, Mathematica, JSON and TOML are parsed and never run. For each
    method found, the order that its name, fields or comments claim is proved or refuted; orders of rounded numbers hold
    to some digits. Where a claim fails, the entries whose change restores it are named. With --against, entries that
    differ from those of another source are listed instead. The exit code is 1 if a claim fails or an entry differs.

    \b
    Examples:
      bseries audit src/tableaus
      bseries audit erk.jl --format json -o audit.json
      bseries audit mine.py --claim step=4
      bseries audit mine.jl --against theirs.c
    """
    from bseries.auditing.audit import audit

    if not sources:
        raise Refusal("FILE must be given: one or several files or folders, but there was none")
    if against is not None:
        if order is not None or claims or file:
            raise Refusal("against must be given without claims, but there were some")
        from bseries.auditing.comparison import compare

        found, fails = (comparison := compare(sources, against)), bool(comparison.differences)
    else:
        found = audit(sources, order=order, claims=_orders(claims, file))
        fails = not found.holds
    if fails:
        click.get_current_context().call_on_close(lambda: _fail())
        if output.has_records:
            say("warning", repr(found)[1:-1])
    return found.to_table()


def _orders(claims: Sequence[str], file: str | None) -> dict[str, int]:
    """The orders by name in a file, and those of options, which come first."""
    said: dict[str, object] = {}
    if file is not None:
        from integrators.core.text_files import errors_from, parse_json, parse_toml, read_text

        text, label = read_text(file)
        with errors_from(label):
            said = parse_json(text) if file.lower().endswith(".json") else parse_toml(text)
        if not isinstance(said, dict):
            raise Refusal(f"claims must be a table of names and orders, but was {said!r:.60}")
    said |= read_assignments(claims, "claim", "rk4=4")
    for name, order in said.items():
        if isinstance(order, bool) or not str(order).isdecimal():
            raise Refusal(f"claims must be NAME=ORDER, but the order of {name!r:.60} was {order!r:.60}")
    return {name: int(str(order)) for name, order in said.items()}


def _fail() -> None:
    raise SystemExit(FAILED)
