"""Numbers known within an error: what decimals and floats of a tableau can show, carried through sums and products."""

from __future__ import annotations

import math
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any

GUARD = 20
"""Bits kept beyond those that are certain: values stay short, whatever the denominators of a tableau."""
SLACK = 1 + 2.0 ** (1 - GUARD)
"""Each operation increases the error by more than all of its own roundings."""
EXACT_DIGITS = 30
"""How many digits are shown of a number without error."""


def nearest_float(value: Fraction | int) -> float:
    """The nearest float; beyond their range an infinite one."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


class Inexact:
    """A number and how far it may be off; it counts as zero where that cannot be told from zero.

    Integers and `Fraction`s that meet it are exact.

    Example:
        >>> third = Inexact(Fraction("0.333"), 1e-3)
        >>> bool(third * 3 - 1), bool(third * 2 - 1)
        (False, True)
    """

    __slots__ = ("error", "value")

    def __init__(self, value: Fraction, error: float) -> None:
        places = GUARD - math.frexp(error)[1] if error else 0
        self.value = Fraction(round(value * 2**places), 2**places) if places > 0 else value
        self.error = error

    @property
    def upper(self) -> Fraction:
        """The largest number it may be; zero if it counts as zero."""
        return self.value + Fraction(self.error) if self else Fraction(0)

    def __bool__(self) -> bool:
        return abs(self.value) > self.error

    def __add__(self, other: Any) -> Inexact:
        if isinstance(other, Inexact):
            return Inexact(self.value + other.value, (self.error + other.error) * SLACK)
        return Inexact(self.value + other, self.error * SLACK)

    __radd__ = __add__

    def __neg__(self) -> Inexact:
        return Inexact(-self.value, self.error)

    def __sub__(self, other: Any) -> Inexact:
        return self + -other

    def __rsub__(self, other: Any) -> Inexact:
        return -self + other

    def __mul__(self, other: Any) -> Inexact:
        if isinstance(other, Inexact):
            error = abs(nearest_float(self.value)) * other.error + abs(nearest_float(other.value)) * self.error
            return Inexact(self.value * other.value, (error + self.error * other.error) * SLACK)
        return Inexact(self.value * other, self.error * abs(nearest_float(other)) * SLACK)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Inexact:
        if not isinstance(other, Inexact):
            return self * (1 / Fraction(other))
        quotient = self.value / other.value
        least = nearest_float(abs(other.value) - Fraction(other.error))
        error = (self.error + abs(nearest_float(quotient)) * other.error) / least if least else math.inf
        return Inexact(quotient, error * SLACK)

    def __rtruediv__(self, other: Any) -> Inexact:
        return Inexact(Fraction(other), 0.0) / self

    @property
    def text(self) -> str:
        """The number with the digits that are certain."""
        if not self:
            return "0"
        digits = (
            max(1, math.floor(-math.log10(self.error / abs(nearest_float(self.value))))) if self.error else EXACT_DIGITS
        )
        rounded = (
            Context(prec=digits).divide(Decimal(self.value.numerator), Decimal(self.value.denominator)).normalize()
        )
        return f"{rounded:f}" if -4 <= rounded.adjusted() < digits else f"{rounded:e}"
