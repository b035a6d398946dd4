"""Fronts of work and precision: the points that no other beats in both, and what lies between them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TypeVar

Point = TypeVar("Point", bound=tuple)
"""An error, the seconds that it takes, and whatever else belongs to them."""


def pareto_front(points: Iterable[Point]) -> list[Point]:
    """The points that no other beats in both, from the fastest to the most precise.

    Args:
        points: Tuples that begin with an error and its seconds.

    Example:
        >>> pareto_front([(1e-3, 1.0), (1e-2, 2.0), (1e-6, 4.0), (1e-5, 8.0)])
        [(0.001, 1.0), (1e-06, 4.0)]
    """
    kept: list[Point] = []
    for point in sorted(points, key=lambda point: (point[1], point[0])):
        if not kept or point[0] < kept[-1][0]:
            kept.append(point)
    return kept


def seconds_at(front: Sequence[tuple], error: float) -> float | None:
    """The seconds that reach an error, between points of a front by a straight line between logarithms.

    For an error larger than all, they are the least of the front; for one smaller than all, None.

    Example:
        >>> front = [(1e-2, 1.0), (1e-6, 4.0)]
        >>> round(seconds_at(front, 1e-4), 12), seconds_at(front, 1.0), seconds_at(front, 1e-9)
        (2.0, 1.0, None)
    """
    if not front or error < front[-1][0]:
        return None
    after = next(k for k, point in enumerate(front) if point[0] <= error)
    if after == 0:
        return front[0][1]
    (rough, fast), (fine, slow) = front[after - 1][:2], front[after][:2]
    return fast * (slow / fast) ** (math.log(rough / error) / math.log(rough / fine))
