"""Sweeps: a method with one step size after the other, and the curves that come of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from bseries.advice.measures import SOLUTION
from bseries.advice.timing import Timing
from bseries.advice.work_precision.candidates import Candidate
from bseries.advice.work_precision.outlooks import Outlook
from bseries.advice.work_precision.run_errors import UNSOLVED, Judge, RunErrors
from bseries.advice.work_precision.step_costs import step_costs
from integrators.bindings.scipy_bridge import right_hand_side

if TYPE_CHECKING:
    from integrators.scenes.scene import Scene


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


FIRST_STEP = 4.0
"""The first step size, in times |y|/|f| at the start."""
STEEP = 30.0
"""As soon as halving the step improves the error by more, √2 is the factor from there on."""
ROUNDING, PATIENCE = 1e-9, 2
"""Below this error rounding may decide; there so many steps in a row without a gain are the end."""
SAMPLE = 0.004
TIMED = 5
"""So many rows of a method are timed; what the steps of the others cost is read from a line through these."""
STIFF = 1e-4
"""If the first steps whose stages can be solved for have less error, solving limits the steps, not accuracy."""
LEAST_SECONDS = 5e-9
"""No step takes less; so sweeps of methods that always fail come to an end."""

SLOWEST, NUDGE = 10.0, 1e-6
"""How many times |f|/|f'f| a scale of time may be, and by what part of y it is moved to find f'f."""
LEAST_ERROR = 2.0**-60
"""Errors of 0, among logarithms."""
MEASURED = Outlook()
"""On nothing but what was measured."""

Swept = list[tuple[int, RunErrors]]


class Row(NamedTuple):
    """A step size of a method.

    Attributes:
        h: The step size.
        steps: How many steps the span takes.
        cost: CPU seconds for one of them, with no rounds of its own if it is interpolated; None if the run failed.
        errors: What was wrong in the end.
    """

    h: float
    steps: int
    cost: Timing | None
    errors: RunErrors

    @property
    def seconds(self) -> float | None:
        """CPU seconds for all steps, looking at nothing."""
        return None if self.cost is None else self.cost.seconds * self.steps


class Curve(NamedTuple):
    """The rows of one method, from large to small steps."""

    candidate: Candidate
    rows: tuple[Row, ...]

    def front(self, measure: str, ahead: Outlook = MEASURED) -> list[tuple[float, float]]:
        """Errors and seconds of the rows that no other of them beats in both, from the cheapest to the most precise.

        Args:
            measure: Which errors.
            ahead: On the longer runs whose errors are asked for; by default those measured.
        """
        errors = ((row.seconds, ahead.error(row.errors, measure)) for row in self.rows)
        return pareto_front(
            (max(error, LEAST_ERROR), seconds) for seconds, error in errors if seconds and error is not None
        )

    def seconds(self, error: float, measure: str = SOLUTION, ahead: Outlook = MEASURED) -> float | None:
        """CPU seconds for the span that reach an error, interpolated between rows; None if no row does."""
        return seconds_at(self.front(measure, ahead), error)

    def rounded(self, measure: str) -> set[int]:
        """The numbers of steps whose measured error is so small that rounding may decide it."""
        errors = ((row.steps, row.errors.error(measure)) for row in self.rows)
        return {steps for steps, error in errors if error is not None and error < ROUNDING}


def time_scale(scene: Scene) -> float:
    """|y|/|f(y)| at the start; the reciprocal of |f| if y is 0, and 1 in an equilibrium.

    Near to an equilibrium f is small, and says little of what happens later: ten times |f|/|f'f| bounds it.

    Example:
        >>> import bseries as bs
        >>> time_scale(bs.scene("linear")), round(time_scale(bs.scene("pendulum").with_start(p=[0], q=["pi"])), 3)
        (1.0, 10.0)
    """
    import numpy as np

    f, y = right_hand_side(scene), scene.y0
    here, size = f(0.0, y), float(np.linalg.norm(y)) or 1.0
    speed = float(np.linalg.norm(here))
    if not speed:
        return 1.0
    rate = float(np.linalg.norm(f(0.0, y + NUDGE * size / speed * here) - here)) / (NUDGE * size)
    return min(size / speed, SLOWEST / rate) if rate > 0 else size / speed


def sweep(judge: Judge, candidate: Candidate, finest: float, budget: float) -> tuple[Candidate, Swept]:
    """Numbers of steps and errors of one method, from large steps to small ones.

    Stages are found by fixed-point iteration. Where this, and not accuracy, is what limits the step, the scene is stiff
    for the method, and the sweep begins anew with Newton's method at hand.
    """
    swept = _sweep(judge, candidate, finest, budget)
    unsolved = [errors.failure is not None and UNSOLVED in errors.failure for _, errors in swept]
    first = next((errors.error(judge.available[0]) for _, errors in swept if errors.failure is None), 0.0)
    if any(unsolved) and first is not None and first < STIFF:
        candidate = candidate._replace(solver="auto")
        return candidate, _sweep(judge, candidate, finest, budget)
    return candidate, swept


def _sweep(judge: Judge, candidate: Candidate, finest: float, budget: float) -> Swept:
    measure = judge.available[0]
    steps = max(1, math.ceil(judge.span / (FIRST_STEP * time_scale(judge.scene))))
    found: Swept = []
    best, idle, factor = math.inf, 0, 2.0
    while True:
        errors = judge.run(candidate, steps)
        found.append((steps, errors))
        error = errors.error(measure)
        if error is not None:
            idle = idle + 1 if error > best / 1.2 and best < ROUNDING else 0
            factor = math.sqrt(2) if error * STEEP < best < math.inf else factor
            best = min(best, error)
            if error < finest or idle >= PATIENCE:
                break
        following = max(steps + 1, round(steps * factor))
        per_step = errors.seconds / steps if errors.failure is None and len(found) > 1 else LEAST_SECONDS
        too_long = errors.seconds > budget and len(found) > 1  # the first run compiles
        if too_long or max(per_step, LEAST_SECONDS) * following > budget:
            break
        steps = following
    return found


def timed_curves(judge: Judge, swept: Sequence[tuple[Candidate, Swept]]) -> list[Curve]:
    """The curves: rows with their times, taken in turn."""
    work = {
        f"{candidate.name} {steps}": judge.work(candidate, steps)
        for candidate, rows in swept
        for steps in _to_time([steps for steps, errors in rows if errors.failure is None])
    }
    costs = step_costs(work, sample=SAMPLE)
    curves = []
    for candidate, rows in swept:
        known = {steps: costs[key] for steps, _ in rows if (key := f"{candidate.name} {steps}") in costs}
        made = [Row(judge.span / n, n, None if e.failure else _cost(known, n), e) for n, e in rows]
        curves.append(Curve(candidate, tuple(made)))
    return curves


def _to_time(steps: Sequence[int]) -> list[int]:
    """The first, the last and some between."""
    if len(steps) <= TIMED:
        return list(steps)
    return [steps[round(k * (len(steps) - 1) / (TIMED - 1))] for k in range(TIMED)]


def _cost(known: dict[int, Timing], steps: int) -> Timing:
    """What a step costs, between rows that were timed by a straight line between logarithms."""
    if steps in known:
        return known[steps]
    below, above = max(n for n in known if n < steps), min(n for n in known if n > steps)
    part = math.log(steps / below) / math.log(above / below)
    values = zip(known[below][:3], known[above][:3], strict=True)
    seconds, low, high = (first * (last / first) ** part for first, last in values)
    return Timing(seconds, low, high, 0)
