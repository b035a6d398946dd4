"""Work–precision curves: errors and CPU times of a method over a range of step sizes, and their extrapolation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from bseries.advice.growth import PARTS, REGULAR, energy_after, from_parts, most_disagreement, power, size_after
from bseries.advice.measures import SOLUTION

if TYPE_CHECKING:
    from bseries.advice.timing import Timing
    from bseries.advice.work_precision.candidates import Candidate
    from bseries.advice.work_precision.run_errors import RunErrors

LEAST_ERROR = 2.0**-60
"""Replaces errors of 0 in logarithms."""
ROUNDING = 1e-9
"""Smaller errors may be dominated by rounding."""
Point = TypeVar("Point", bound=tuple)
"""An error, the CPU seconds for it, and further entries."""


def pareto_front(points: Iterable[Point]) -> list[Point]:
    """The points that no other one beats in both error and time, from the fastest to the most precise.

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
    """CPU seconds for an error, interpolated linearly between the logarithms of a front's points.

    Errors larger than all give the least time of the front, errors smaller than all None.

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


class Extrapolation(NamedTuple):
    """A run longer than those measured, and the data that determine how errors of a method grow until its end.

    Attributes:
        times: The length, as a multiple of the time measured.
        drifts: Whether the energy drifts, or may.
        growth: The factor by which the size of states grows; None if unknown.
        period: The part of the time measured that contains a period of the motion; infinite if none does.
        factor: The growth of the error by the modified equation: infinite if it says that this cannot be known, None
            if it gives no answer and error growth fits are used.

    Example:
        >>> import numpy as np
        >>> from bseries.advice.work_precision.run_errors import RunErrors
        >>> run = RunErrors(solution=1e-6, courses={"solution": np.linspace(0, 1e-6, 200)})
        >>> [f"{Extrapolation(10.0, growth=size).error(run, 'solution'):.0e}" for size in (1.0, 10.0)]
        ['1e-05', '1e-06']
    """

    times: float = 1.0
    drifts: bool = False
    growth: float | None = 1.0
    period: float = 0.0
    factor: float | None = None

    def is_possible(self, measure: str) -> bool:
        """Whether the time measured suffices to determine how errors grow.

        A bounded energy error needs one period of data. An error growth fit is accepted if parts of the time agree on
        it, the shortest of which must then contain a period: parts of one period may agree and be wrong.
        """
        return self.times <= 1 or self.period <= (min(PARTS) if measure == SOLUTION or self.drifts else 1.0)

    def error(self, run: RunErrors, measure: str) -> float | None:
        """The error of a run extrapolated to the end; None if it has none or its growth is not determined."""
        found = run.error(measure)
        if found is None or self.times <= 1:
            return found
        if self.factor is not None:
            return found * self.factor if math.isfinite(self.factor) else None
        if not self.is_possible(measure):
            return None
        course, times = run.courses[measure], self.times
        if measure != SOLUTION:
            change = energy_after(course, times, drifts=self.drifts)
            return change.value if change.disagreement <= most_disagreement(self.drifts) else None
        error = from_parts(lambda n, factor: size_after(course[:n], factor, power(self.drifts)), len(course), times)
        return error.value / self.growth if self.growth and error.disagreement <= REGULAR else None

    def description(self, measure: str) -> str:
        """How errors grow, in words."""
        if self.factor is not None:
            return "the modified equation tells"
        if measure != SOLUTION:
            return f"the energy {'drifts' if self.drifts else 'does not drift'}"
        larger = "" if self.growth in (None, 1.0) else f", and states get {self.growth:.3g} times as large"
        return f"errors of regular motion grow like {'t^2' if self.drifts else 't'} at most{larger}"


MEASURED = Extrapolation()
"""No extrapolation: the errors measured."""


class Row(NamedTuple):
    """One step size of a method.

    Attributes:
        h: The step size.
        steps: The number of steps for the span.
        cost: CPU seconds for a step, with 0 rounds if interpolated; None if the run failed.
        errors: The errors of the run.
    """

    h: float
    steps: int
    cost: Timing | None
    errors: RunErrors

    @property
    def seconds(self) -> float | None:
        """CPU seconds for all steps, without observations."""
        return None if self.cost is None else self.cost.seconds * self.steps


class Curve(NamedTuple):
    """The rows of one method, from large to small steps."""

    candidate: Candidate
    rows: tuple[Row, ...]

    def front(self, measure: str, extrapolation: Extrapolation = MEASURED) -> list[tuple[float, float]]:
        """Errors and seconds of the rows that no other row beats in both, from the cheapest to the most precise."""
        errors = ((row.seconds, extrapolation.error(row.errors, measure)) for row in self.rows)
        return pareto_front(
            (max(error, LEAST_ERROR), seconds) for seconds, error in errors if seconds and error is not None
        )

    def seconds(self, error: float, measure: str = SOLUTION, extrapolation: Extrapolation = MEASURED) -> float | None:
        """CPU seconds over the span for an error, interpolated between rows; None if no row reaches it."""
        return seconds_at(self.front(measure, extrapolation), error)

    def rounded(self, measure: str) -> set[int]:
        """Numbers of steps whose measured error may be dominated by rounding."""
        errors = ((row.steps, row.errors.error(measure)) for row in self.rows)
        return {steps for steps, error in errors if error is not None and error < ROUNDING}
