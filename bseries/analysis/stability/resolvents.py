"""Determinant and adjugate of I + rA as polynomials in r, by the method of Faddeev and Le Verrier."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from math import lcm
from typing import Any

Rows = Sequence[Sequence[Any]]


def characteristic(matrix: Rows) -> list[Any]:
    """The coefficients of det(I + rA), ascending.

    Example:
        >>> [str(d) for d in characteristic([[Fraction(1, 2), Fraction(0)], [Fraction(1), Fraction(1, 3)]])]
        ['1', '5/6', '1/6']
    """
    whole, scale = to_integers(matrix)
    return [over(determinant, scale**k) for k, (determinant, _) in enumerate(adjugate_terms(whole))]


def to_integers(matrix: Rows) -> tuple[Rows, int]:
    """A rational matrix times its common denominator, and that; any other as it is, and 1."""
    if not all(isinstance(a, Fraction) for row in matrix for a in row):
        return matrix, 1
    scale = lcm(*(a.denominator for row in matrix for a in row))
    return [[int(a * scale) for a in row] for row in matrix], scale


def over(value: Any, denominator: int) -> Any:
    """An integer divided by a denominator; another element is what it is, its denominator being 1."""
    return Fraction(value, denominator) if isinstance(value, int) else value


def adjugate_terms(matrix: Rows) -> Iterator[tuple[Any, list[list[Any]]]]:
    """The coefficients of r^k, k = 0 … s, in det(I + rA) and in the adjugate C(r) of I + rA, which has degree s − 1.

    From (I + rA) C = d I follow C_k = d_k I − A C_{k−1} and k d_k = tr(A C_{k−1}); with an integer matrix everything
    stays integer.
    """
    size = len(matrix)
    zero: Any = 0 if all(isinstance(a, int) for row in matrix for a in row) else Fraction(0)
    sparse = [[(j, a) for j, a in enumerate(row) if a] for row in matrix]
    determinant: Any = zero + 1
    product = [[zero] * size for _ in range(size)]
    for k in range(size + 1):
        if k:
            trace = sum((product[i][i] for i in range(size)), zero)
            determinant = trace // k if isinstance(trace, int) else trace / k
        adjugate = [[-value for value in row] for row in product]
        for i, row in enumerate(adjugate):
            row[i] = row[i] + determinant
        yield determinant, adjugate
        columns = list(zip(*adjugate, strict=True))
        product = [[sum([a * column[m] for m, a in row], zero) for column in columns] for row in sparse]
