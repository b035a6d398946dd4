"""What shadow energies say about a trajectory: is the step small enough, does the energy drift, what step would do."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from ..exceptions import SeriesError
from .arguments import finite_number
from .statistics import OrderStatistics, Statistics

if TYPE_CHECKING:
    import numpy as np

GAIN = 1.25
"""A higher order must lower the scatter by this factor to be of use."""
LOSS = 3.0
"""From so many times the least scatter on, an order is worse."""
SIGNIFICANT = 3.0
"""Standard errors from which on a drift is one."""
ROUNDINGS = 4
"""Scatter of so many roundings of the energy is called rounding."""


class ShadowReport:
    """The modified energies of a trajectory; made by `shadow_energy`.

    Attributes:
        label: What the trajectory is called.
        h: The step size.
        start: The time of the first state.
        states: How many states there are.
        rows: For each order its statistics: `order`, `mean`, `deviation` (half the range), `scatter` (about a line),
            `gap` (half the range of the difference to the order before), `drift` with its `drift_error`.
        values: The energies by order, if they were kept, at the times `times`.

    Example:
        >>> from integrators import integrate, scene
        >>> from bseries import shadow_energy
        >>> report = shadow_energy(integrate(scene("pendulum"), "stormer-verlet", h=0.1, steps=4000))
        >>> report.has_drift, report.limit
        (False, 'rounding')
        >>> print(f"{report.largest_step:.2f}, {report.step_for(1e-4):.4f}")
        1.44, 0.0320
    """

    def __init__(
        self,
        label: str,
        h: float,
        start: float,
        states: int,
        statistics: Statistics,
        offset: float,
        rounding: float,
        values: Mapping[int, np.ndarray] | None,
    ):
        self.label, self.h, self.start, self.states, self.values = label, h, start, states, values
        self.rows = tuple(row._replace(mean=row.mean + offset) for row in statistics.results(h))
        self._statistics = statistics
        self._rounding = rounding

    def __repr__(self) -> str:
        return (
            f"<ShadowReport of {self.label}: orders 2 to {self.rows[-1].order}, {self.states:,} states, h = {self.h:g}>"
        )

    def __str__(self) -> str:
        from .sentences import report_text

        return report_text(self)

    @property
    def best(self) -> OrderStatistics:
        """The lowest order beyond which nothing is gained: no higher one scatters much less."""
        for row, higher in zip(self.rows, self._least_above(), strict=True):
            if row.scatter <= GAIN * higher:
                return row
        return self.rows[-1]

    def _least_above(self) -> Iterator[float]:
        """For each order the least scatter of this and all higher ones."""
        scatters = [row.scatter for row in self.rows]
        return (min(scatters[k:]) for k in range(len(scatters)))

    @property
    def limit(self) -> str:
        """What keeps the best order from being better.

        ``rounding``: that it scatters as numbers are rounded; ``order``: that no higher one was asked for; ``step``:
        that higher orders scatter more, since the step is large; ``slow``: changes that no order explains, such as the
        sum of many roundings, or forces that jump.
        """
        best = self.best
        if best.scatter <= ROUNDINGS * self._rounding:
            return "rounding"
        if best.order == self.rows[-1].order:
            return "order"
        return "step" if self.rows[-1].scatter > LOSS * best.scatter else "slow"

    @property
    def noise_floor(self) -> float | None:
        """The scatter below which no order comes; None if it was not reached."""
        return None if self.limit == "order" else self.best.scatter

    @property
    def has_drift(self) -> bool:
        """Whether the best order drifts by more than three standard errors."""
        return abs(self.best.drift) > SIGNIFICANT * self.best.drift_error

    @property
    def gaps(self) -> dict[int, float]:
        """By power 2k of h, how much the orders 2k and 2k + 2 differ, up to the best order."""
        best = self.best.order
        return {low.order: high.gap or 0.0 for low, high in pairwise(self.rows) if high.order <= best}

    @property
    def largest_step(self) -> float | None:
        """The step size at which order 4 would be no steadier than the energy: a larger one has no shadow energy.

        Orders 2 and 4 differ by a multiple of h^2, orders 4 and 6 by one of h^4; at this step they would be equal. A
        rule of thumb; None if fewer orders are of use.
        """
        gaps = list(self.gaps.values())[:2]
        return self.h * (gaps[0] / gaps[1]) ** 0.5 if len(gaps) == 2 and gaps[1] > 0 else None

    def step_for(self, bound: float) -> float:
        """The largest step with which the energy would stay within ± a bound of the middle of its range.

        The deviation of the energy from its shadow is the sum of the gaps between orders, which go like h^2, h^4, ….
        Never beyond `largest_step`, where this ceases to hold.

        Args:
            bound: The bound, in units of energy.

        Raises:
            SeriesError: The bound is not positive, or no higher order explains how the energy changes.
        """
        limit = finite_number(bound, "bound")
        if limit <= 0:
            raise SeriesError(f"bound must be a positive energy, but was {bound!r:.60}")
        # gap factor^power / limit = (rate factor)^power stays at most 1, however large the limit
        rates = {power: gap ** (1 / power) / limit ** (1 / power) for power, gap in self.gaps.items() if gap}
        if not rates:
            raise SeriesError("bound must be on an energy whose changes a higher order explains, but none does")
        low, high = 0.0, 1 / max(rates.values())
        for _ in range(60):
            middle = 0.5 * (low + high)
            fits = sum((rate * middle) ** power for power, rate in rates.items()) <= 1
            low, high = (middle, high) if fits else (low, middle)
        most = self.largest_step
        return self.h * (low if most is None else min(low, most / self.h))

    @property
    def times(self) -> np.ndarray:
        """The times of `values`."""
        import numpy as np

        count = self._statistics.count
        return self.start + self.h * (np.arange(count) + (self.states - count) // 2)

    def blocks(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (blocks,), and mean, least and largest values there, (orders, blocks, 3), less the first value."""
        import numpy as np

        found, size = self._statistics.blocks(), self._statistics.size
        reach = (self.states - self._statistics.count) // 2
        return self.start + self.h * (reach + size * (np.arange(found.shape[1]) + 0.5) - 0.5), found

    def to_dict(self) -> dict[str, Any]:
        """The report as JSON can hold it."""
        return {
            "schema": 1,
            "kind": "shadow",
            "trajectory": self.label,
            "h": self.h,
            "states": self.states,
            "t": [self.start, self.start + self.h * (self.states - 1)],
            "best_order": self.best.order,
            "limit": self.limit,
            "noise_floor": self.noise_floor,
            "drift": {"value": self.best.drift, "error": self.best.drift_error, "significant": self.has_drift},
            "largest_step": self.largest_step,
            "rows": [row._asdict() for row in self.rows],
        }

    def save_plot(self, path: str | os.PathLike[str]) -> None:
        """Draw the shadow energies over time.

        Args:
            path: A file whose suffix tells the format: ``.png``, ``.svg`` or ``.pdf``.

        Raises:
            SeriesError: The format is another, or there is no such folder.
            IntegratorError: The file cannot be written, or matplotlib is missing.
        """
        from .picture import save_picture

        save_picture(self, path)
