"""`bseries conditions`: the order conditions of a kind of methods, as formulas or as code."""

from __future__ import annotations

from typing import Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.values import WholeNumber, takes_max_children
from bseries.cli.output import Output, takes_output, takes_text
from bseries_base.table import Table


@click.command()
@click.argument("kind", metavar="KIND")
@click.option("--order", type=WholeNumber(), default=4, show_default=True, help="Order of the methods.")
@click.option("--stages", type=WholeNumber(), help="Number of stages, for code.")
@click.option("--colors", type=WholeNumber(), help="Number of parts, for kinds that have parts.")
@click.option("--explicit", is_flag=True, help="Explicit methods: short for --structure explicit.")
@click.option("--structure", metavar="NAMES", help="full, explicit or diagonally-implicit; for each matrix, by commas.")
@click.option("--assume", metavar="TEXT", help='Simplifying assumptions that hold, as in "B5 C2 D1".')
@click.option(
    "--scalar",
    is_flag=False,
    flag_value="autonomous",
    metavar="[WHICH]",
    help="Only for scalar equations: autonomous y' = f(y), or nonautonomous.",
)
@click.option("--symmetric", is_flag=True, help="Symmetric methods: only conditions for odd numbers of nodes.")
@takes_max_children
@takes_text("--code", "LANGUAGE", "Source of residual and Jacobian: numpy, c or julia.")
@takes_output
def conditions(
    kind: str,
    order: int,
    *,
    explicit: bool,
    structure: str | None,
    assume: str | None,
    scalar: str | None,
    language: str | None,
    output: Output,
    **options: Any,
) -> Table | str:
    """The order conditions of a kind of methods.

    KIND is runge-kutta, partitioned, additive, nystrom (y'' = g(y)), general-nystrom (y'' = g(y, y')), rosenbrock or
    splitting. With --code comes source code of two functions, residual and jacobian, in numpy, c or julia.

    \b
    Examples:
      bseries conditions runge-kutta --order 4
      bseries conditions runge-kutta --order 5 --assume "C2 D1"
      bseries conditions runge-kutta --order 5 --scalar
      bseries conditions runge-kutta --order 3 --explicit --stages 3 --code c -o conditions.c
      bseries conditions partitioned --order 3 --format latex
      bseries conditions splitting --order 4 --symmetric --format json
    """
    from bseries.conditions.listing import order_conditions

    if explicit and structure is not None:
        raise Refusal(f"structure must be left out where --explicit is given, but was {structure!r:.60}")
    names = (structure or "full").split(",")
    given = names[0] if len(names) == 1 else names
    options |= {"explicit": explicit, "structure": given, "assumptions": assume, "scalar": scalar or False}
    found = order_conditions(kind, order, **options)
    if language is not None:
        return found.code(language)
    output.check_rows(len(found))
    return found.to_table()
