"""Which arguments of sin, exp, … to take as basic, so that all others are integer combinations of them.

Functions of rationally independent arguments are algebraically independent, and those of integer combinations follow by
the addition theorems: sin 2q, sin 3q and cos q are polynomials in sin q and cos q.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from .sparse_polynomials import total

if TYPE_CHECKING:
    from .sparse_polynomials import Number, Terms


class Lattice:
    """The integer combinations of some polynomials, given by a basis in echelon form (one row for each pivot).

    Args:
        priority: Pivots are the monomials where this is largest.

    Example:
        >>> lattice = Lattice()
        >>> for vector in ({1: 2}, {1: 3}, {1: 1, 0: 5}):
        ...     lattice.insert(vector)
        >>> lattice.coordinates({1: 4, 0: -10})
        [({1: 1}, 4), ({0: 5}, -2)]
    """

    def __init__(self, priority: Callable[[int], Any] = int) -> None:
        self._priority = priority
        self._rows: dict[int, Terms] = {}

    def insert(self, vector: Terms) -> None:
        """Make the lattice the smallest one that also holds this vector, by Euclid's algorithm on every pivot."""
        while vector:
            pivot = max(vector, key=self._priority)
            row = self._rows.get(pivot)
            if row is None:
                self._rows[pivot] = vector
                return
            vector = _reduced(vector, row, vector[pivot] // row[pivot])
            if pivot in vector:
                self._rows[pivot], vector = vector, row

    def coordinates(self, vector: Terms) -> list[tuple[Terms, int]]:
        """Rows and integers whose combination the vector is; what they leave over becomes a row, if it can."""
        found: list[tuple[Terms, int]] = []
        while vector:
            pivot = max(vector, key=self._priority)
            row = self._rows.setdefault(pivot, vector)
            if vector[pivot] % row[pivot]:
                return [*found, (vector, 1)]
            multiple = int(vector[pivot] // row[pivot])
            found.append((row, multiple))
            vector = _reduced(vector, row, multiple)
        return found


def _reduced(vector: Terms, row: Terms, multiple: Number) -> Terms:
    return total([(1, vector), (-multiple, row)])
