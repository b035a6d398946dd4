"""The options --order, --power and --nonzero of verbs that print formulas by powers of h."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import click

from bseries.cli.application import Refusal
from bseries.cli.output import WholeNumber

DEFAULT_ORDER = 5


def takes_powers(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options --order, --power and --nonzero to a verb; `read_powers` reads the first two."""
    help_order = f"Trees with 1 to N nodes, powers h^0 to h^(N-1); by default {DEFAULT_ORDER}, or for --power."
    options = (
        click.option("--order", type=WholeNumber(), help=help_order),
        click.option("--power", type=WholeNumber(), metavar="K", help="Only what h^K multiplies."),
        click.option("--nonzero", is_flag=True, help="Leave out zero terms."),
    )
    return functools.reduce(lambda command, option: option(command), reversed(options), verb)


def read_powers(order: int | None, power: int | None) -> tuple[int, range]:
    """The order, and the powers of h to write."""
    from trees.counting import check_order

    if order is None:
        order = DEFAULT_ORDER if power is None or power < 0 else power + 1
    check_order(order)
    if power is not None and not 0 <= power < order:
        raise Refusal(f"power must be from 0 to {order - 1}, but was {power}")
    return order, range(order) if power is None else range(power, power + 1)
