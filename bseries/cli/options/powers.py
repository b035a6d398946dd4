"""What verbs share that write out, by powers of h, what a method does on a scene."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.output import WholeNumber

if TYPE_CHECKING:
    from bseries.algebra.bseries import BSeries
    from bseries.cli.options.method_argument import Method
    from integrators import Scene

DEFAULT_ORDER = 5


def takes_powers(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Give a verb the options --order, --power and --nonzero; `read_powers` reads the first two."""
    help_order = f"Trees with 1 to N nodes, powers h^0 to h^(N-1); by default {DEFAULT_ORDER}, or for --power."
    options = (
        click.option("--order", type=WholeNumber(), help=help_order),
        click.option("--power", type=WholeNumber(), metavar="K", help="Only what h^K multiplies."),
        click.option("--nonzero", is_flag=True, help="Leave out what is zero."),
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


def span(powers: range) -> str:
    """For titles: the powers of h."""
    return f"powers h^{powers[0]} to h^{powers[-1]}" if len(powers) > 1 else f"power h^{powers[0]}"


def remarks(series: BSeries, method: Method, scene: Scene) -> dict[str, Any]:
    """What JSON says of the numbers, the method and the scene where there is something to say."""
    lists = {"issues": list(method.issues), "notes": list(scene.notes)}
    digits = {} if series.digits is None else {"digits": series.digits}
    return digits | {key: value for key, value in lists.items() if value}


def notes(series: BSeries, method: Method, scene: Scene, *, nonzero: bool) -> Iterator[str]:
    """What a reader must know about the formulas."""
    if series.digits is not None:
        yield f"The tableau is published as decimals with {series.digits} digits: numbers show what these tell."
    elif not series.is_exact:
        yield "Floating point: the tableau holds floats, so the numbers carry rounding errors."
    for note in scene.notes:
        yield f"{note[0].upper()}{note[1:]}."
    if nonzero:
        yield "What is zero is left out."
    for issue in method.issues:
        yield f"Beware: {issue}."
