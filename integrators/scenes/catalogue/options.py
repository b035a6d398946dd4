"""Exact options of built-in scenes: counts, positive numbers, rows of numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten
from integrators.scenes.model.formulas import read_formula

if TYPE_CHECKING:
    import sympy

LARGEST = 10**100


def read_count(value: Any, argument: str, least: int, most: int) -> int:
    """A whole number within limits, given as a number or as text.

    Example:
        >>> read_count("9", "particles", 2, 1000)
        9
    """
    number = read_formula(value, (), argument)
    if not (number.is_Integer and least <= number <= most):
        raise IntegratorError(f"{argument} must be an integer from {least} to {most}, but was {shorten(str(value))}")
    return int(number)


def read_positive(value: Any, argument: str, *, or_zero: bool = False) -> sympy.Expr:
    """An exact positive number, or zero where allowed, whose squares and products are in the range of doubles.

    Example:
        >>> read_positive(0.1, "sigma")
        1/10
    """
    number = read_formula(value, (), argument)
    if not (1 <= number * LARGEST <= LARGEST**2 or (or_zero and number == 0)):
        raise IntegratorError(
            f"{argument} must be {'0 or ' * or_zero}a number from 1e-100 to 1e100, but was {shorten(str(value))}"
        )
    return number


def read_rows(value: Any, argument: str, count: int) -> list[tuple[sympy.Expr, ...]]:
    """A row of exact numbers for each of `count` bodies."""
    rows = [items(row, f"row {k} of {argument}") for k, row in enumerate(items(value, argument), 1)]
    if len(rows) != count:
        raise IntegratorError(f"{argument} must have a row for each of the {count} bodies, but had {len(rows)} rows")
    return [
        tuple(read_formula(x, (), f"{argument}[{k}][{i}]") for i, x in enumerate(row, 1))
        for k, row in enumerate(rows, 1)
    ]
