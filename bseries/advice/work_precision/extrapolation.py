"""Outlooks on longer runs, from the modified equation or from what was measured, if the motion has turned once."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bseries.advice.distances import largest_size, without_time
from bseries.advice.growth import EVEN, goes_on
from bseries.advice.measures import MODIFIED_ENERGY, SOLUTION, whole_steps
from bseries.advice.prediction.expected_errors import ANOTHER_ORBIT, NOT_SMALL, UNTOLD, ExpectedError
from bseries.advice.prediction.prediction import predict_run
from bseries.advice.work_precision.outlooks import Outlook
from bseries.exceptions import SeriesError
from integrators.core.errors import IntegratorError
from integrators.runs.integration import integrate

if TYPE_CHECKING:
    import numpy as np

    from bseries.advice.work_precision.candidates import Candidate
    from bseries.advice.work_precision.run_errors import Judge
    from bseries.advice.work_precision.sweeps import Curve


SWING = 1 / 3
"""A variable has turned back when it went so much of its range in the other direction."""
REVERSALS = 2
"""At a turn's end a variable has turned back so often; it may do so once in half a turn, as sin t for t < π."""
STILL = 1e-9
"""Variables that move by a smaller part of the largest state do not move."""
AT_REST = 1e-2
"""Variables that move by less in the second half of the time than this part of their range have come to rest."""


def first_turn(y: np.ndarray) -> float:
    """The part of the time in which every variable turned once, 0 if none has to, and inf if there was too little.

    Those with bounds have to go to and fro; those that go on and on, as angles do, have to do so in their pace.
    Those that stay, come to rest, or go on evenly have no turns.

    Args:
        y: States (variables, n) without the time, at equidistant times from 0 on.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 4 * np.pi, 401)
        >>> y = np.array([np.sin(t), np.cos(t), 7 * t, 7 * t - np.sin(t)])
        >>> round(first_turn(y), 2), first_turn(y[:, :210]), first_turn(y[2:3])
        (0.6, inf, 0.0)
    """
    import numpy as np

    still = STILL * largest_size(y)
    return max((_first_turn(row) for row in y if np.ptp(row) > still), default=0.0)


def _first_turn(row: np.ndarray) -> float:
    """The part of the time that a variable takes."""
    import numpy as np

    if goes_on(row):
        row = np.diff(row)
        if np.ptp(row) <= (EVEN - 1) * abs(row.mean()):
            return 0.0
    elif np.ptp(row[len(row) // 2 :]) <= AT_REST * np.ptp(row):
        return 0.0
    return _reversed(row) / (len(row) - 1)


def _reversed(row: np.ndarray) -> float:
    """The index where a variable has turned back often enough; inf if it never has."""
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
"""How many steps of a method are looked at, until one leads to an error that is so near the wanted one."""


def foreseen(judge: Judge, curve: Curve, length: float, error: float, measure: str) -> float | None:
    """By what factor an error grows, with a step that leads to about the one that is wanted.

    Args:
        judge: What measured errors.
        curve: The method and its rows.
        length: The length of the longer run.
        error: The error wanted in the end.
        measure: Its name.

    Returns:
        As `factor`.
    """
    rounded = curve.rounded(measure)
    errors = {row.steps: row.errors.error(measure) for row in curve.rows if row.steps not in rounded}
    known = {steps: size for steps, size in errors.items() if size}
    if not known:
        return None

    def nearest(size: float) -> int:
        return min(known, key=lambda n: abs(math.log(known[n] / size)))

    found: dict[int, float | None] = {}
    steps = nearest(error * judge.span / length if measure == SOLUTION else error)  # it grows linearly, mostly
    while steps not in found:
        found[steps] = growth = factor(judge, curve, steps, known[steps], length, measure)
        if growth is None or not math.isfinite(growth) or len(found) == TRIALS:
            break
        off = known[steps] * growth / error
        if 1 / NEAR < off < NEAR:
            break
        steps = nearest(known[steps] / off)  # if the factor stays as it is
    return found[steps]


def factor(judge: Judge, curve: Curve, steps: int, known: float, length: float, measure: str) -> float | None:
    """How many times as large as in the time measured an error is at the end of a longer run.

    Args:
        judge: What measured it.
        curve: The method.
        steps: The number of steps of the shorter run.
        known: Its error.
        length: The length of the longer run.
        measure: The name of the error.

    Returns:
        The factor; infinite if the modified equation says that this cannot be known, as in chaos; None if it says
        nothing: modifying integrators, methods of too high an order, steps that are too large for its terms.
    """
    candidate, h = curve.candidate, judge.span / steps
    if candidate.is_modifying or measure == MODIFIED_ENERGY:
        return None
    try:
        found = predict_run(candidate.scene, candidate.method, h=h, steps=whole_steps(length, h), timed=False)
    except (IntegratorError, SeriesError):
        return None
    expected = found.solution if measure == SOLUTION else found.energy
    if expected.value is None:
        return math.inf if _is_untold(expected) else None
    return expected.value / known if expected.value > 0 else None  # only rounding


def _is_untold(expected: ExpectedError) -> bool:
    """Whether an error is unknown because of the solution, and not because of the method or its step."""
    return expected.reason in (ANOTHER_ORBIT, NOT_SMALL) or expected.reason.startswith(UNTOLD.partition("{")[0])


LOOKS = 400
"""At about how many times it is looked whether the motion turns."""


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

    work = judge.work(candidate, steps)
    every = max(1, steps // LOOKS)
    run = integrate(work.scene, work.method, h=work.h, steps=steps, y0=work.y0, save_every=every, **work.options)
    return without_time(judge.scene, run.y[: judge.scene.dimension, : 1 + steps // every])
