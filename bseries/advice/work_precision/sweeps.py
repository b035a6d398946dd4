"""Sweeps: runs of a method with decreasing step sizes, and the curves made from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from bseries.advice.timing import Timing
from bseries.advice.work_precision.curves import ROUNDING, Curve, Row
from bseries.advice.work_precision.step_costs import step_costs
from integrators.bindings.scipy_bridge import right_hand_side

if TYPE_CHECKING:
    from bseries.advice.work_precision.candidates import Candidate
    from bseries.advice.work_precision.run_errors import Judge, RunErrors
    from integrators.scenes.scene import Scene

    Swept = list[tuple[int, RunErrors]]

FIRST_STEP = 4.0
"""The first step size, as a multiple of `time_scale`."""
STEEP = 30.0
"""If halving the step improves the error by a larger factor, steps shrink by √2 from there on."""
PATIENCE = 2
"""A sweep ends after this many steps without gain below `ROUNDING`."""
SAMPLE = 0.004
TIMED = 5
"""Number of rows of a method that are timed; costs of the others are interpolated."""
STIFF = 1e-4
"""If the largest step with solvable stages has a smaller error, the solver and not accuracy limits the step."""
LEAST_SECONDS = 5e-9
"""Lower bound for the time of a step, so that sweeps of methods that always fail end."""
SLOWEST, NUDGE = 10.0, 1e-6
"""Bound of the time scale in multiples of |f|/|f'f|, and the relative difference that gives f'f."""


def time_scale(scene: Scene) -> float:
    """|y|/|f(y)| at the start; 1/|f| if y is 0, and 1 in an equilibrium.

    Near an equilibrium f is small and not representative: ten times |f|/|f'f| is a bound.

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

    Stages are found by fixed-point iteration. If that and not accuracy limits the step, the scene is stiff for the
    method, and the sweep is repeated with Newton's method as an alternative.
    """
    swept = _sweep(judge, candidate, finest, budget)
    first = next((errors.error(judge.available[0]) for _, errors in swept if errors.failure is None), 0.0)
    if any(errors.is_unsolved for _, errors in swept) and first is not None and first < STIFF:
        candidate = candidate._replace(solver="auto")
        return candidate, _sweep(judge, candidate, finest, budget)
    return candidate, swept


def _sweep(judge: Judge, candidate: Candidate, finest: float, budget: float) -> Swept:
    """Runs with decreasing steps until the error is below `finest`, no longer falls, or the budget is spent."""
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
    """The curves of several sweeps, timed in interleaved rounds."""
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
    """The first, the last and some numbers of steps between."""
    if len(steps) <= TIMED:
        return list(steps)
    return [steps[round(k * (len(steps) - 1) / (TIMED - 1))] for k in range(TIMED)]


def _cost(known: dict[int, Timing], steps: int) -> Timing:
    """The cost of a step, interpolated linearly between the logarithms of timed rows."""
    if steps in known:
        return known[steps]
    below, above = max(n for n in known if n < steps), min(n for n in known if n > steps)
    part = math.log(steps / below) / math.log(above / below)
    values = zip(known[below][:3], known[above][:3], strict=True)
    seconds, low, high = (first * (last / first) ** part for first, last in values)
    return Timing(seconds, low, high, 0)
