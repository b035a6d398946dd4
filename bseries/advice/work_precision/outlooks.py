"""What errors of measured runs grow to in longer runs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from bseries.advice.growth import PARTS, REGULAR, energy_after, from_parts, most_disagreement, power, size_after
from bseries.advice.measures import SOLUTION

if TYPE_CHECKING:
    from bseries.advice.work_precision.run_errors import RunErrors


class Outlook(NamedTuple):
    """A longer span than was measured, and what decides how errors of a method grow until its end.

    Attributes:
        times: How many times as long.
        drifts: Whether the energy drifts, or may.
        growth: How many times as large states get; None if that cannot be told.
        turn: The part of the time measured in which the motion turned once; infinite if it did not.
        factor: How many times as large the error asked for gets, by the modified equation; infinite if it says that
            this cannot be known, None if it says nothing, so that the laws count.

    Example:
        >>> import numpy as np
        >>> from bseries.advice.work_precision.run_errors import RunErrors
        >>> run = RunErrors(solution=1e-6, courses={"solution": np.linspace(0, 1e-6, 200)})
        >>> [f"{Outlook(10.0, growth=size).error(run, 'solution'):.0e}" for size in (1.0, 10.0)]
        ['1e-05', '1e-06']
    """

    times: float = 1.0
    drifts: bool = False
    growth: float | None = 1.0
    turn: float = 0.0
    factor: float | None = None

    def tells(self, measure: str) -> bool:
        """Whether enough was measured to tell how errors grow.

        Of energies that do not drift a turn shows all. Laws of growth are believed if parts of the time lead to the
        same, the shortest of which then has to have a turn: parts of one turn may well agree, and be wrong.

        Args:
            measure: The name of the error.
        """
        return self.times <= 1 or self.turn <= (min(PARTS) if measure == SOLUTION or self.drifts else 1.0)

    def error(self, run: RunErrors, measure: str) -> float | None:
        """The error at the end; None if the run has none, or how it grows on is not clear.

        Args:
            run: The shorter run.
            measure: The name of the error, as for `RunErrors.error`.
        """
        found = run.error(measure)
        if found is None or self.times <= 1:
            return found
        if self.factor is not None:
            return found * self.factor if math.isfinite(self.factor) else None
        if not self.tells(measure):
            return None
        course, times = run.courses[measure], self.times
        if measure != SOLUTION:
            change = energy_after(course, times, drifts=self.drifts)
            return change.value if change.disagreement <= most_disagreement(self.drifts) else None
        error = from_parts(lambda n, factor: size_after(course[:n], factor, power(self.drifts)), len(course), times)
        return error.value / self.growth if self.growth and error.disagreement <= REGULAR else None

    def law(self, measure: str) -> str:
        """How errors grow, in words."""
        if self.factor is not None:
            return "the modified equation tells"
        if measure != SOLUTION:
            return f"the energy {'drifts' if self.drifts else 'does not drift'}"
        larger = "" if self.growth in (None, 1.0) else f", and states get {self.growth:.3g} times as large"
        return f"errors of regular motion grow like {'t^2' if self.drifts else 't'} at most{larger}"
