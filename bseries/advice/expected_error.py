"""An error that is expected, or why it cannot be known."""

from __future__ import annotations

from typing import NamedTuple

AGREEMENT = 2.0
"""Two ways to an expected error may differ by this factor."""
TELLING = 1e-8
"""If the modified equation leads away by so much of a state or an energy, that is no rounding of the pilot."""
SMALL = 0.02
"""As long as it leads no further away, in parts of a state, that solution can be made in a few passes."""
ROUNDING = 1e-14
"""Below such relative errors rounding decides."""

NO_ENERGY = "there is no energy that the scene conserves"
TERMS_DIFFER = "terms of the modified equation up to h^{last} and one less lead to errors that differ by more than 2"
ANOTHER_ORBIT = "the energy changes so much that the orbit is another one"
UNTOLD = "how it grows cannot be told from the time to t = {last:.3g}"
ONLY_ROUNDING = "rounding will be larger"
OF_HIGHER_ORDER = "to first order it does not change on this orbit, beside which it would"
NOT_SMALL = "the modified equation leads to another orbit, as in chaos or next to a separatrix"


class ExpectedError(NamedTuple):
    """An error that is expected, or why it cannot be known.

    Attributes:
        value: The error; None where it cannot be known.
        reason: Why not, or what is to be said of the value; empty if nothing.

    Example:
        >>> print(ExpectedError(2.13e-7), ExpectedError(None, "there is no energy"))
        2.1e-07 unknown: there is no energy
    """

    value: float | None
    reason: str = ""

    def __str__(self) -> str:
        text = "unknown" if self.value is None else f"{self.value:.1e}"
        return f"{text}: {self.reason}" if self.reason else text


def with_rounding(value: float) -> ExpectedError:
    """An error that is known, unless rounding is larger."""
    return ExpectedError(value, "" if value > ROUNDING else ONLY_ROUNDING)
