"""Linear systems with constant coefficients."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..errors import IntegratorError
from ..tableau_input import items
from .base import Scene
from .formulas import read_formula

if TYPE_CHECKING:
    import sympy

SUMMARY = "y' = A y with any matrix A; the harmonic oscillator if none is given"
REFERENCE = "E. Hairer, lecture on long-time behaviour, example 3"
HARMONIC_OSCILLATOR = ((0, -1), (1, 0))


def linear(*, matrix: Any = HARMONIC_OSCILLATOR) -> Scene:
    """y' = A y, from y = (1, …, 1).

    Args:
        matrix: The rows of A, exact numbers.

    Raises:
        IntegratorError: `matrix` is not square, or an entry is no number.

    Example:
        >>> linear(matrix=[["-1/2", 3], [0, 1]]).field
        (-y1/2 + 3*y2, y2)
    """
    import sympy

    entries = _read_square(matrix)
    size = len(entries)
    y = sympy.symbols(f"y1:{size + 1}") if size > 1 else (sympy.Symbol("y"),)
    skew = all(entries[i][j] == -entries[j][i] for i in range(size) for j in range(i + 1))
    return Scene(
        {"y": size},
        field={str(y[i]): sympy.Add(*(a * x for a, x in zip(row, y, strict=True))) for i, row in enumerate(entries)},
        invariants={"squared_norm": sympy.Add(*(x**2 for x in y))} if skew else {},
        start={"y": [1] * size},
        name="linear",
        summary=SUMMARY,
        reference=REFERENCE,
    )


def _read_square(matrix: Any) -> list[list[sympy.Expr]]:
    rows = [items(row, f"row {i} of matrix") for i, row in enumerate(items(matrix, "matrix"), 1)]
    if not rows:
        raise IntegratorError("matrix must have at least one row, but was empty")
    for i, row in enumerate(rows, 1):
        if len(row) != len(rows):
            raise IntegratorError(f"matrix must be square, but row {i} of {len(rows)} has length {len(row)}")
    return [[read_formula(x, (), f"matrix[{i}][{j}]") for j, x in enumerate(row, 1)] for i, row in enumerate(rows, 1)]


SCENES = (("linear", linear, SUMMARY, REFERENCE, ("harmonic-oscillator",)),)
