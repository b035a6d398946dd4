"""Numbers that options give, as doubles."""

from __future__ import annotations

from .application import Refusal


def read_float(text: str, option: str) -> float:
    """The double nearest to a number such as ``1/3`` or ``2*pi``."""
    from integrators.expressions import parse_number

    try:
        return float(parse_number(text, argument=option))
    except OverflowError:
        raise Refusal(f"{option} must be a number that a double can hold, but was {text!r:.60}") from None
