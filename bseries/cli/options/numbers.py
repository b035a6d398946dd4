"""Numbers that options give."""

from __future__ import annotations

from typing import Any

from bseries.cli.application import Refusal


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
