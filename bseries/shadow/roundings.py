"""Bounds of rounding errors of stored numbers: by the precision of arrays and the digits of text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import numpy as np

ULPS = 16
"""Number of roundings in a number computed with the precision in which it is stored."""
DOUBLE = 2.0**-52
MOST_DIGITS = 15
"""Numbers with more digits are doubles."""


class Rounding(NamedTuple):
    """Bounds of rounding errors of the numbers of a role.

    Attributes:
        relative: Relative to the largest number of the column; one for all columns, or one for each.
        absolute: Added to that, in the same form.
    """

    relative: Any = ULPS * DOUBLE
    absolute: Any = 0.0

    def of(self, rows: np.ndarray) -> np.ndarray:
        """The bound for each column of finite numbers (states, …)."""
        import numpy as np

        return self.relative * np.max(np.abs(rows), axis=0) + self.absolute


class Roundings(NamedTuple):
    """Bounds of rounding errors of mass-weighted states, their energies, and the step size."""

    q: float = 0.0
    p: float = 0.0
    g: float = 0.0
    energy: float = 0.0
    h: float = 0.0


def precision(*arrays: np.ndarray) -> float:
    """The relative distance of neighbouring numbers in the coarsest array, at least that of doubles."""
    import numpy as np

    return max([DOUBLE, *(float(np.finfo(array.dtype).eps) for array in arrays if array.dtype.kind == "f")])


def written(columns: Sequence[Sequence[str]]) -> list[Rounding]:
    """The rounding of columns of text.

    If all numbers of a column have the same number of decimals ("%.8f"), the last decimal is rounded; if all have
    exponents ("%.8e"), the last digit of the longest. Others were written without trailing zeros ("%g"), with at most
    the same number of digits in each such column. Whole numbers are exact, unless such programs wrote them.
    """
    kinds, digits = list(map(_kind, columns)), list(map(_digits, columns))
    most = max((count for count, kind in zip(digits, kinds, strict=True) if kind == "any"), default=MOST_DIGITS + 1)
    found = []
    for column, count, kind in zip(columns, digits, kinds, strict=True):
        if kind == "fixed":
            found.append(Rounding(absolute=10.0 ** -len(column[0].partition(".")[2])))
        else:
            count = count if kind == "exponents" else most
            found.append(Rounding() if count > MOST_DIGITS else Rounding(relative=10.0 ** (1 - count)))
    return found


def _kind(column: Sequence[str]) -> str:
    """The number format: whole, fixed decimals, exponents, or any other."""
    exponents = sum("e" in cell.lower() for cell in column)
    if exponents:
        return "exponents" if exponents == len(column) else "any"
    decimals = {len(cell.partition(".")[2]) for cell in column}
    return "any" if len(decimals) > 1 else "whole" if decimals <= {0} else "fixed"


def _digits(column: Sequence[str]) -> int:
    """The number of significant digits in the longest number."""
    mantissas = (re.split("[eE]", cell)[0] for cell in column)
    return max((len(mantissa.lstrip("+-0.").replace(".", "")) for mantissa in mantissas), default=1) or 1
