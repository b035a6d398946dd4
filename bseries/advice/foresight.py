"""By what factor errors get larger in longer runs, as far as the modified equation tells."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from integrators.errors import IntegratorError

from ..exceptions import SeriesError
from .durations import whole_steps
from .expected_error import ANOTHER_ORBIT, NOT_SMALL, UNTOLD, ExpectedError
from .measures import MODIFIED_ENERGY, SOLUTION
from .prediction import predict_run

if TYPE_CHECKING:
    from .run_errors import Judge
    from .sweeps import Curve


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
