"""Extrapolation of measured errors to longer runs, by the modified equation or by error growth fits."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from bseries.advice.distances import largest_size
from bseries.advice.growth import EVEN, is_unbounded
from bseries.advice.measures import MODIFIED_ENERGY, SOLUTION, whole_steps
from bseries.advice.work_precision.curves import Extrapolation
from bseries.exceptions import SeriesError
from integrators.core.errors import IntegratorError

if TYPE_CHECKING:
    import numpy as np

    from bseries.advice.prediction.run_prediction import Prediction
    from bseries.advice.work_precision.curves import Curve
    from bseries.advice.work_precision.run_errors import Judge

    Predict: TypeAlias = Callable[..., Prediction]
    """The signature of `predict_run`."""


SWING = 1 / 3
"""A variable has reversed when it has moved back by this part of its range."""
REVERSALS = 2
"""Reversals in a period; half a period may have one, as sin t for t < π."""
STILL = 1e-9
"""Variables with a smaller range, relative to the largest state, are constant."""
AT_REST = 1e-2
"""Variables that use a smaller part of their range in the second half of the time have come to rest."""


def first_period(y: np.ndarray) -> float:
    """The part of the time in which every variable completes a period; 0 if none has periods, inf if it is too short.

    Bounded variables must reverse twice, unbounded ones such as angles must do so in their velocity. Variables that
    are constant, come to rest, or grow at a constant rate have no period.

    Args:
        y: States (variables, n) without the time, at equidistant times from 0 on.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 4 * np.pi, 401)
        >>> y = np.array([np.sin(t), np.cos(t), 7 * t, 7 * t - np.sin(t)])
        >>> round(first_period(y), 2), first_period(y[:, :210]), first_period(y[2:3])
        (0.6, inf, 0.0)
    """
    import numpy as np

    still = STILL * largest_size(y)
    return max((_period_of_variable(row) for row in y if np.ptp(row) > still), default=0.0)


def _period_of_variable(row: np.ndarray) -> float:
    """The part of the time in which one variable completes a period."""
    import numpy as np

    if is_unbounded(row):
        row = np.diff(row)
        if np.ptp(row) <= (EVEN - 1) * abs(row.mean()):
            return 0.0
    elif np.ptp(row[len(row) // 2 :]) <= AT_REST * np.ptp(row):
        return 0.0
    return _last_reversal(row) / (len(row) - 1)


def _last_reversal(row: np.ndarray) -> float:
    """The index at which a variable has reversed often enough; inf if it does not."""
    import numpy as np

    swing, reversals, direction = SWING * float(np.ptp(row)), 0, 0
    low = high = row[0]
    for k, value in enumerate(row):
        low, high = min(low, value), max(high, value)
        falls, rises = direction >= 0 and value <= high - swing, direction <= 0 and value >= low + swing
        if falls or rises:
            reversals += direction != 0
            direction = -1 if falls else 1
            low = high = value
        if reversals == REVERSALS:
            return k
    return math.inf


TRIALS, NEAR = 4, 2.0
"""Most step sizes tried for the growth factor, and the ratio to the wanted error at which the search stops."""


class Goal(NamedTuple):
    """An error tolerance for a run, and the sources of measured and predicted errors.

    Attributes:
        judge: Measures the errors of runs.
        predict: Predicts the errors of a run; `predict_run`.
        length: The length of the run, at least that of the runs measured.
        error: The tolerance.
        measure: The name of the error.
    """

    judge: Judge
    predict: Predict
    length: float
    error: float
    measure: str

    @property
    def times(self) -> float:
        """The length, as a multiple of the time measured."""
        return self.length / self.judge.span


def predicted_factor(goal: Goal, curve: Curve) -> float | None:
    """`growth_factor` for a step size that leads to about the tolerance."""
    measure, error = goal.measure, goal.error
    rounded = curve.rounded(measure)
    errors = {row.steps: row.errors.error(measure) for row in curve.rows if row.steps not in rounded}
    known = {steps: size for steps, size in errors.items() if size}
    if not known:
        return None

    def nearest(size: float) -> int:
        return min(known, key=lambda n: abs(math.log(known[n] / size)))

    found: dict[int, float | None] = {}
    steps = nearest(error * goal.judge.span / goal.length if measure == SOLUTION else error)  # for linear growth
    while steps not in found:
        found[steps] = growth = growth_factor(goal, curve, steps, known[steps])
        if growth is None or not math.isfinite(growth) or len(found) == TRIALS:
            break
        ratio = known[steps] * growth / error
        if 1 / NEAR < ratio < NEAR:
            break
        steps = nearest(known[steps] / ratio)  # for the same factor
    return found[steps]


def growth_factor(goal: Goal, curve: Curve, steps: int, known: float) -> float | None:
    """The ratio of the error at the end of a longer run, by the modified equation, to the error measured.

    Args:
        goal: The longer run.
        curve: The method.
        steps: The number of steps of the shorter run.
        known: Its error.

    Returns:
        The factor; infinite if it cannot be known, as in chaos; None if the modified equation gives no answer: for
        modifying integrators, methods of too high an order, and step sizes at which its terms do not decrease.
    """
    candidate, h = curve.candidate, goal.judge.span / steps
    if candidate.is_modifying or goal.measure == MODIFIED_ENERGY:
        return None
    try:
        found = goal.predict(candidate.scene, candidate.method, h=h, steps=whole_steps(goal.length, h), timed=False)
    except (IntegratorError, SeriesError):
        return None
    expected = found.solution if goal.measure == SOLUTION else found.energy
    if expected.value is None:
        return math.inf if expected.is_due_to_orbit else None
    return expected.value / known if expected.value > 0 else None  # only rounding


def best_extrapolation(goal: Goal, curve: Curve) -> Extrapolation:
    """Extrapolation by the modified equation if it gives an answer, else by error growth fits."""
    times = goal.times
    found = predicted_factor(goal, curve) if times > 1 else None
    return fitted_extrapolation(goal.judge, curve, times) if found is None else Extrapolation(times, factor=found)


def fitted_extrapolation(judge: Judge, curve: Curve, times: float) -> Extrapolation:
    """Extrapolation by error growth fits, with the period and the drift seen in the finest run.

    Args:
        judge: The source of measured errors.
        curve: The method and its rows.
        times: The length of the longer run, as a multiple of the time measured.
    """
    if times <= 1:
        return Extrapolation()
    finest = max((row.steps for row in curve.rows if row.errors.failure is None), default=None)
    if finest is None:
        return Extrapolation(times, drifts=True, growth=None, period=math.inf)
    period = first_period(judge.states(curve.candidate, finest))
    return Extrapolation(times, judge.drifts(curve.candidate, finest), judge.growth(times), period)
