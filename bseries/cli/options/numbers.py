"""Options that are numbers: real ones, orders and powers of h, bounds on the number of children."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import click

from bseries.cli.application import Refusal
from bseries.cli.output import WholeNumber


def read_float(text: str, option: str) -> float:
    """The double nearest to a number such as ``1/3`` or ``2*pi``."""
    from integrators.exact.expressions import parse_constant

    try:
        return float(parse_constant(text, argument=option))
    except OverflowError:
        raise Refusal(f"{option} must be a number that a double can hold, but was {text!r:.60}") from None


def read_given(text: str | None, option: str) -> Any:
    """The number that an option gives, exactly where it can be; it must be given."""
    from integrators.exact.expressions import parse_constant

    if text is None:
        raise Refusal(f"{option} must be given, as in --{option} 1/10, but was not")
    return parse_constant(text, argument=option)


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


UNBOUNDED = ("inf", "*")


class ChildLimits(click.ParamType):
    """Bounds on the number of children: one number, or K rows of K numbers or ``inf``, as in ``0,inf;inf,0``."""

    name = "LIMITS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read the text; the library checks the numbers."""
        if not isinstance(value, str):
            return value
        rows = [[_bound(entry.strip(), value) for entry in row.split(",")] for row in value.split(";")]
        return rows[0][0] if len(rows) == len(rows[0]) == 1 else rows


def _bound(entry: str, text: str) -> int | None:
    if entry in UNBOUNDED:
        return None
    try:
        return int(entry)
    except ValueError:
        raise Refusal(f"max_children must be numbers or inf, as in 2 or 0,inf;inf,0, but was {text!r:.60}") from None


def takes_max_children(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Add the option --max-children to a verb."""
    text = 'Largest number of children of a node: one number, or a row for each colour, as in "0,inf;inf,0".'
    return click.option("--max-children", type=ChildLimits(), help=text)(verb)
