"""A pilot under way: the exact flow from block to block, and solutions that receive kicks on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from integrators.steppers.states import StepError

from ..exceptions import SeriesError
from .structure_functions import gradient

if TYPE_CHECKING:
    import numpy as np

    from integrators import Scene

    from ..term_sizes import Reach
    from .modified_terms import ModifiedTerms

CHECKED = 512
"""As long as there are not so many grid points, errors are also computed with fewer terms."""
RESOLUTION = 6
"""Grid points in the time τ with τ² = |f|/|f'f'f + f"(f, f)/4| in which f turns at most: 1/ω for an oscillator."""
SUBSTEPS = 3
"""Steps of the flow between grid points."""
METHOD = "dop853"
PASSES, AT_ONCE, SETTLED = 10, 32, 1e-4
"""How often r is evaluated along the solution that it leads to, over how many points, and what the last may change."""
DISTANCE = 1e-9
"""How far, relative to its size, kicks take the second solution while f turns."""
FIRST_ORDER, FEWER_TERMS, FOLLOWED = range(3)
"""The solutions that receive kicks: small multiples of r with all powers, and with one less, and r itself."""
CANCELLED = 2.0**-46
"""Sums that are so small a part of their terms are 0 but for rounding."""


def exact_states(scene: Scene, y0: np.ndarray, spacing: float, points: int, t0: float) -> np.ndarray:
    """The exact flow at a grid point and so many next ones."""
    from integrators import integrate

    step = spacing / SUBSTEPS
    return integrate(scene, METHOD, h=step, steps=SUBSTEPS * points, save_every=SUBSTEPS, y0=y0, t0=t0).y


class Walk:
    """A pilot under way: the flow, and solutions that are kicked, as strongly as the first states tell."""

    def __init__(
        self, terms: ModifiedTerms, y0: np.ndarray, h: float, spacing: float, t0: float, reach: Reach, size: float
    ):
        import numpy as np

        from integrators.steppers.stepping import stepper

        self.spacing, self.done = spacing, 0
        self._terms, self._h, self._t0, self._last = terms, h, t0, y0
        scene = terms.field.scene
        self._stepper, self._gradient = stepper(scene, METHOD), gradient(scene)
        self.powers = _shrinking(reach, terms.powers)
        self.scale = DISTANCE * size / (abs(spacing) * RESOLUTION * sum(reach.sizes[k] for k in self.powers))
        first = y0[:, None]
        values = self._terms_at(first)
        whole, rates = values.sum(axis=0), self._rates(first, values)
        self._scales = self.scale, self.scale, 1.0
        self._kicked = [self._stepper.start(y0, h=spacing / SUBSTEPS, t0=t0) for _ in self._scales]
        for state, scale, r in zip(self._kicked, self._scales, (whole, self._fewer(values), whole), strict=True):
            state.values += scale * spacing / 2 * r[:, 0]
        nothing = np.zeros_like(first)
        self.pieces, self.checked = [(first, nothing, nothing, rates)], [nothing]

    def _terms_at(self, y: np.ndarray) -> np.ndarray:
        """The terms whose sum is r, (powers, variables, n)."""
        import numpy as np

        return self._terms.values(y)[: len(self.powers)] * self._h ** np.array(self.powers)[:, None, None]

    @staticmethod
    def _fewer(values: np.ndarray) -> np.ndarray:
        """r with one power less, if there are two."""
        return values[: max(1, len(values) - 1)].sum(axis=0)

    def _rates(self, y: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The rates of change of the energy by power, (powers, n); none without an energy."""
        import numpy as np

        if self._gradient is None:
            return np.empty((0, y.shape[1]))
        products = self._gradient(y) * values
        rates = products.sum(axis=1)
        rates[abs(rates) <= CANCELLED * abs(products).sum(axis=1)] = 0.0  # where the energy is conserved
        return rates

    def go_on(self, points: int) -> None:
        """Follow the flow for so many grid points."""
        t = self._t0 + self.done * self.spacing
        y = exact_states(self._terms.field.scene, self._last, self.spacing, points, t)[:, 1:]
        values = self._terms_at(y)
        errors = self._errors(FIRST_ORDER, values.sum(axis=0), y)
        self.pieces.append((y, errors, self._followed(y), self._rates(y, values)))
        if self.done < CHECKED:
            self.checked.append(self._errors(FEWER_TERMS, self._fewer(values), y))
        self._last, self.done = y[:, -1].copy(), self.done + points

    def _followed(self, y: np.ndarray) -> np.ndarray:
        """How far the solution that r itself is added to is from the flow; nan from where on that is not found.

        r is evaluated where the pass before has led: along the flow it would be a force with the period of the orbit,
        to which orbits lock that have a period of their own.
        """
        import numpy as np

        found = np.full(y.shape, np.nan)
        last = self.pieces[-1][2][:, -1:]
        if not np.isfinite(last).all():
            return found
        for first in range(0, y.shape[1], AT_ONCE):
            here, begin = slice(first, first + AT_ONCE), self._kicked[FOLLOWED]
            errors = last
            for _ in range(PASSES):
                self._kicked[FOLLOWED], before = begin.copy(), errors
                errors = self._errors(FOLLOWED, self._terms_at(y[:, here] + errors).sum(axis=0), y[:, here])
                if abs(errors - before).max() <= SETTLED * abs(errors).max():
                    break
            else:
                break
            found[:, here], last = errors, errors[:, -1:]
        return found

    def _errors(self, which: int, r: np.ndarray, y: np.ndarray) -> np.ndarray:
        """How far a kicked solution is from the flow, between the two halves of the kicks."""
        import numpy as np

        from .kicks import kick

        state, scale = self._kicked[which], self._scales[which]
        rows, first = np.empty((y.shape[1], len(y) + 1)), state.n
        rows[:, 0], rows[:, 1:] = len(y), scale * self.spacing / 2 * r.T
        steps = SUBSTEPS * len(rows)
        try:
            self._stepper.record(state, steps, o_every=SUBSTEPS, observer=kick.address, o_rows=rows)
        except StepError:
            if which != FOLLOWED:
                raise
            rows[(state.n - first) // SUBSTEPS :, 1:] = np.nan  # what r leads to may end where the flow does not
        return (rows[:, 1:].T - y) / scale


def _shrinking(reach: Reach, powers: tuple[int, ...]) -> tuple[int, ...]:
    """The powers of h whose terms shrink: two if there are, for of a single one nothing tells how good it is."""
    found = tuple(k for k in powers if k <= reach.optimal_power)
    if len(found) < min(2, len(powers)):
        before, power = [(0, *powers)[len(found) + i] for i in (0, 1)]
        if reach.sizes[power]:
            raise SeriesError(
                f"h must be small enough for the terms of the modified equation to shrink, but was {reach.h:g}, where "
                f"the one with h^{power} is {reach.sizes[power] / reach.sizes[before]:.1g} times that with h^{before}"
            )
    return found
