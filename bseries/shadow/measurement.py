"""One pass over the states of a trajectory: the shadow energies of some orders, and their statistics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING

from bseries.exceptions import SeriesError
from bseries.shadow import kernels
from bseries.shadow.checks import check_finite
from bseries.shadow.formulas import LEAST_ORDER, ShadowFormula, shadow_formula
from bseries.shadow.report import ShadowReport
from bseries.shadow.states import States
from bseries.shadow.statistics import Statistics

if TYPE_CHECKING:
    import numpy as np

    from bseries.shadow.report import ShadowReport
    from bseries.shadow.sources import Source
    from bseries.shadow.states import States

USUAL_ORDER = 16
LEAST_VALUES = 16
"""Fewer shadow energies than that say nothing."""


class Measurement:
    """One pass over states.

    Args:
        pieces: The states.
        order: The largest order; None: what usual or short trajectories allow.
        h: The step size.
        source: Where the states come from.
        keep: Whether values are kept.
    """

    def __init__(self, pieces: Iterator[States], order: int | None, h: float, source: Source, keep: bool):

        self._pieces, self._h, self._source, self._kept = pieces, h, source, [] if keep else None
        self._head = next(pieces)
        self.orders = _orders(order, self._head.u.size, source)
        self._offset = float(self._head.u[0])
        self.statistics, self.done = Statistics(self.orders), 0

    def advance(self, check: Callable[[States, int], None]) -> Iterator[int]:
        """Go through the states; after each piece, how many there have been."""
        import numpy as np

        weights, works, products = formula_arrays([shadow_formula(order) for order in self.orders])
        halo = 2 * (weights.shape[1] - 1)
        before: States | None = None
        for piece in chain([self._head], self._pieces):
            fresh = piece._replace(u=piece.u - self._offset)  # what is left is rounded less
            states = fresh if before is None else States(*map(_joined, before, fresh))
            steps = states.u.size
            check(states, self.done - (steps - piece.u.size))
            self.done += piece.u.size
            if steps > halo:
                work = np.empty((works.shape[1], steps)), np.empty((products.shape[1], steps))
                out = np.empty((len(self.orders), steps - halo))
                kernels.shadow_values.compiled(
                    self._h, states.p, states.g, states.u, weights, works, products, *work, out
                )
                middle = self.done - steps + halo // 2
                check_finite(out, "shadow energies", middle, self._source)  # squares of finite numbers may overflow
                self.statistics.add(out)
                if self._kept is not None:
                    self._kept.append(out + self._offset)
                states = States(*(array[..., steps - halo :] for array in states))
            before = states
            yield self.done

    def report(self, start: float, rounding: float) -> ShadowReport:
        """What has been found, where the first state has this time, and energies may be off so far."""
        import numpy as np

        values = None
        if self._kept is not None:
            values = dict(zip(self.orders, np.concatenate(self._kept, axis=1), strict=True))
        known = self._offset, rounding, values
        return ShadowReport(self._source.label, self._h, start, self.done, self.statistics, *known)


def _joined(before: np.ndarray, piece: np.ndarray) -> np.ndarray:
    import numpy as np

    return np.concatenate((before, piece), axis=-1)


def formula_arrays(formulas: Sequence[ShadowFormula]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Formulas of several orders as the arrays `weights`, `works` and `products` of `kernels.shadow_values`."""
    import numpy as np

    reach = max(1, *(formula.reach for formula in formulas))  # so that neighbouring pieces overlap
    shifts = max(len(formula.works) for formula in formulas) + 1
    lags = max((j - i for formula in formulas for i, j in formula.products), default=0) + 1
    weights, works = np.zeros((len(formulas), reach + 1)), np.zeros((len(formulas), shifts))
    products = np.zeros((len(formulas), lags, 2 * reach + 1))
    for k, formula in enumerate(formulas):
        weights[k, : len(formula.potentials)] = [float(x) for x in formula.potentials]
        works[k, 1 : len(formula.works) + 1] = [float(x) for x in formula.works]
        for (i, j), value in formula.products.items():
            products[k, j - i, i + reach] = float(value)
    return weights, works, products


def _orders(order: int | None, states: int, source: Source) -> tuple[int, ...]:
    """The orders that are measured; `states` is how many there are if they are few."""
    wanted = range(LEAST_ORDER, (order or USUAL_ORDER) + 1, 2)
    there = tuple(k for k in wanted if states - 2 * max(1, k // 4) >= LEAST_VALUES)
    if not there:
        raise SeriesError(f"{source.label} must have at least {LEAST_VALUES + 2} states, but has {states}")
    if order is not None and there[-1] != order:
        raise SeriesError(f"order must be at most {there[-1]} for {states} states, but was {order}")
    return there
