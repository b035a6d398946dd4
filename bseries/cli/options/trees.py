"""The option --max-children, which bounds the number of children of nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from bseries.cli.application import Refusal

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
