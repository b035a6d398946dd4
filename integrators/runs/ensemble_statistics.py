"""Mean, variance and extremes over the members of an ensemble, reproducible to the last bit.

Floating-point sums depend on their order, so the order is fixed: members are the leaves of a binary tree, in the order
of their numbers, and the statistics of two neighbours are merged into their parent. Members 2^k·j … 2^k·(j + 1) − 1
form one subtree, so blocks of 2^k members can be computed anywhere, in any order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np


class Statistics(NamedTuple):
    """Statistics of quantities over some members.

    Attributes:
        count: The number of members at each time, (times,).
        mean: The mean, (times, quantities).
        squares: The sum of squared deviations from the mean, (times, quantities).
        minimum: The smallest value, (times, quantities).
        maximum: The largest value, (times, quantities).
    """

    count: np.ndarray  # type: ignore[assignment]  # not the method of tuples
    mean: np.ndarray
    squares: np.ndarray
    minimum: np.ndarray
    maximum: np.ndarray

    @property
    def variance(self) -> np.ndarray:
        """The unbiased variance, squares / (count − 1); nan where there are fewer than two members."""
        import numpy as np

        freedom = (self.count - 1.0)[:, None]
        return np.divide(self.squares, freedom, out=np.full_like(self.squares, np.nan), where=freedom > 0)


def member_statistics(values: np.ndarray, rows: int) -> Statistics:
    """The statistics of one member.

    Args:
        values: Its quantities, (times, quantities).
        rows: The number of times that it reached; later rows of `values` are ignored.
    """
    import numpy as np

    there = np.arange(len(values)) < rows
    known = there[:, None]
    mean = np.where(known, values, 0.0)
    least, largest = np.where(known, values, np.inf), np.where(known, values, -np.inf)
    return Statistics(there.astype(np.int64), mean, np.zeros_like(mean), least, largest)


def merged(a: Statistics, b: Statistics) -> Statistics:
    """The statistics over both sets of members.

    References:
        T. F. Chan, G. H. Golub, R. J. LeVeque, Amer. Statist. 37 (1983) 242–247, doi:10.1080/00031305.1983.10483115.
    """
    import numpy as np

    count = a.count + b.count
    weight = (b.count / np.maximum(count, 1))[:, None]
    with np.errstate(invalid="ignore", over="ignore"):  # quantities may be infinite
        gap = b.mean - a.mean
        mean = a.mean + gap * weight
        squares = a.squares + b.squares + gap * (a.count[:, None] * weight) * gap
    return Statistics(count, mean, squares, np.minimum(a.minimum, b.minimum), np.maximum(a.maximum, b.maximum))


class Gathering:
    """Merge of the statistics of leaves 0 … count − 1, added in any order.

    Only subtrees that wait for their neighbours are kept.

    Args:
        count: The number of leaves: members, or blocks of members.

    Attributes:
        total: The statistics of all leaves; None until all are added.

    Example:
        >>> import numpy as np
        >>> gathering = Gathering(3)
        >>> for k in (2, 0, 1):
        ...     gathering.add(k, member_statistics(np.array([[k + 1.0]]), rows=1))
        >>> gathering.total.mean.item(), gathering.total.variance.item()
        (2.0, 1.0)
    """

    def __init__(self, count: int):
        self._count = count
        self._waiting: dict[tuple[int, int], Statistics] = {}
        self.total: Statistics | None = None

    def add(self, leaf: int, statistics: Statistics) -> None:
        """Add the statistics of a leaf, and merge all subtrees that it completes."""
        level, index, count = 0, leaf, self._count
        while count > 1:
            neighbour = index ^ 1
            if neighbour < count:
                other = self._waiting.pop((level, neighbour), None)
                if other is None:
                    self._waiting[level, index] = statistics
                    return
                statistics = merged(statistics, other) if index < neighbour else merged(other, statistics)
            level, index, count = level + 1, index // 2, (count + 1) // 2
        self.total = statistics
