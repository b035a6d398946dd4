"""What errors of a run become in a longer one, by the laws of `growth`: those of its method and of its solution."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from .growth import REGULAR, energy_after, from_parts, most_disagreement, power, size_after

if TYPE_CHECKING:
    from .run_errors import Judge, RunErrors
    from .sweeps import Curve


class Outlook(NamedTuple):
    """A longer span than was measured, and what decides how errors of a method grow until its end.

    Attributes:
        times: How many times as long.
        drifts: Whether the energy drifts, or may.
        growth: How many times as large states get; None if that cannot be told.

    Example:
        >>> import numpy as np
        >>> from bseries.advice.run_errors import RunErrors
        >>> run = RunErrors(solution=1e-6, courses={"solution": np.linspace(0, 1e-6, 200)})
        >>> [f"{Outlook(10.0, growth=size).error(run, 'solution'):.0e}" for size in (1.0, 10.0)]
        ['1e-05', '1e-06']
    """

    times: float = 1.0
    drifts: bool = False
    growth: float | None = 1.0

    def error(self, run: RunErrors, measure: str) -> float | None:
        """The error at the end; None if the run has none, or how it grows on is not clear.

        Args:
            run: The shorter run.
            measure: The name of the error, as for `RunErrors.error`.
        """
        found = run.error(measure)
        if found is None or self.times <= 1:
            return found
        course, times = run.courses[measure], self.times
        if measure != "solution":
            change = energy_after(course, times, drifts=self.drifts)
            return change.value if change.disagreement <= most_disagreement(self.drifts) else None
        error = from_parts(lambda n, factor: size_after(course[:n], factor, power(self.drifts)), len(course), times)
        return error.value / self.growth if self.growth and error.disagreement <= REGULAR else None

    def law(self, measure: str) -> str:
        """How errors grow, in words."""
        if measure != "solution":
            return f"the energy {'drifts' if self.drifts else 'does not drift'}"
        larger = "" if self.growth in (None, 1.0) else f", and states get {self.growth:.3g} times as large"
        return f"errors grow like {'t^2' if self.drifts else 't'} at most{larger}"


def outlook(judge: Judge, curve: Curve, times: float) -> Outlook:
    """The outlook on errors of a method.

    Args:
        judge: What measured them.
        curve: The method and its rows, of which the finest is looked at.
        times: How many times as long runs shall be.
    """
    if times <= 1:
        return Outlook()
    steps = [row.steps for row in curve.rows if row.errors.failure is None]
    drifts = not steps or judge.drifts(curve.candidate, max(steps))
    return Outlook(times, drifts, judge.growth(times))
