"""What errors of a run become in a longer one: as the modified equation tells, or by the laws of `growth`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from .distances import without_time
from .foresight import foreseen
from .growth import PARTS, REGULAR, energy_after, from_parts, most_disagreement, power, size_after
from .measures import SOLUTION
from .turns import first_turn

if TYPE_CHECKING:
    import numpy as np

    from .candidates import Candidate
    from .run_errors import Judge, RunErrors
    from .sweeps import Curve

LOOKS = 400
"""At about how many times it is looked whether the motion turns."""


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
        >>> from bseries.advice.run_errors import RunErrors
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


def best_outlook(judge: Judge, curve: Curve, length: float, error: float, measure: str) -> Outlook:
    """The outlook on the error of a method, by the modified equation if it tells.

    Args:
        judge: What measured errors.
        curve: The method and its rows.
        length: How long runs shall be.
        error: The error that they shall meet.
        measure: Its name.
    """
    times = length / judge.span
    found = foreseen(judge, curve, length, error, measure) if times > 1 else None
    return outlook(judge, curve, times) if found is None else Outlook(times, factor=found)


def outlook(judge: Judge, curve: Curve, times: float) -> Outlook:
    """The outlook on errors of a method, by the laws that they follow.

    Args:
        judge: What measured them.
        curve: The method and its rows, of which the finest is looked at.
        times: How many times as long runs shall be.
    """
    if times <= 1:
        return Outlook()
    finest = max((row.steps for row in curve.rows if row.errors.failure is None), default=None)
    if finest is None:
        return Outlook(times, drifts=True, growth=None, turn=math.inf)
    turn = first_turn(_states(judge, curve.candidate, finest))
    return Outlook(times, judge.drifts(curve.candidate, finest), judge.growth(times), turn)


def _states(judge: Judge, candidate: Candidate, steps: int) -> np.ndarray:
    """The states (variables, n) of a run at equidistant times, without the time."""
    from integrators.loop import integrate

    work = judge.work(candidate, steps)
    every = max(1, steps // LOOKS)
    run = integrate(work.scene, work.method, h=work.h, steps=steps, y0=work.y0, save_every=every, **work.options)
    return without_time(judge.scene, run.y[: judge.scene.dimension, : 1 + steps // every])
