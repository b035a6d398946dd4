"""Reference solutions of fields without formulas: steps of high order, halved until the solution settles.

Taylor series need formulas. Values of the field suffice for the method of order 8 of Dormand and Prince, in doubles
with compensated sums. The difference of the last two solutions bounds the error of the steps: where the field has kinks
it shrinks slowly. That of rounding is seen from a solution whose steps and states are changed by as much.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from integrators.scenes.scene import Scene

METHOD = "dop853"
FIRST_STEPS, MOST_HALVINGS = 64, 14
"""The number of steps of the first solution, if there are fewer times, and how often it is doubled."""
STRETCH, NUDGE, NUDGES = 2.0**-52, 2.0**-51, 32
"""Relative changes of the step size, and of the state at some times, that show the growth of rounding errors."""
UNIT, SETTLED = 2.0**-53, 4.0
"""The unit roundoff, and the difference of solutions in such units that more steps would not reduce."""
SAFETY = 4.0


def solution_by_halving(
    scene: Scene, y0: Sequence[float], origin: float, times: Sequence[float], digits: int
) -> tuple[np.ndarray, np.ndarray]:
    """The solution at times in one direction from the origin, and bounds of its errors, both (variables, times).

    Steps are halved until the difference of two solutions is below 10^−digits of the largest value of each block, or
    below the effect of rounding errors, or `MOST_HALVINGS` times.

    Raises:
        IntegratorError: The solution ends before the last time.
    """
    import numpy as np

    known: np.ndarray | None = None
    found: tuple[np.ndarray, np.ndarray] | None = None
    failed: StepError | None = None
    for halving in range(MOST_HALVINGS + 1):
        try:
            values, nudged = (_solution(scene, y0, origin, times, halving, nudge) for nudge in (0, 1))
        except StepError as error:
            known, failed = None, error
            continue
        if known is not None:
            of_steps, of_rounding = (np.maximum.accumulate(np.abs(values - x), axis=1) for x in (known, nudged))
            sizes = _sizes(values, scene)
            found = values, SAFETY * (of_steps + of_rounding + UNIT * np.abs(values))
            least = max(10.0**-digits / SAFETY, SETTLED * UNIT) * sizes
            if (of_steps[:, -1:] <= np.maximum(SAFETY * of_rounding[:, -1:], least)).all():
                break
        known = values
    if found is None:
        raise IntegratorError(
            f"t must end where {FIRST_STEPS << MOST_HALVINGS} steps of {METHOD} reach the solution of {scene.name}, "
            f"but reached to {times[-1]:g}: {failed}"
        ) from failed
    return found


def _solution(
    scene: Scene, y0: Sequence[float], origin: float, times: Sequence[float], halving: int, nudge: int
) -> np.ndarray:
    """The solution by whole numbers of steps between times, doubled for each halving, with or without a nudge."""
    import numpy as np

    made: Any = stepper(METHOD, scene)
    y, values = np.array(y0, dtype=float), np.empty((len(y0), len(times)))
    longest, random = abs(times[-1] - origin) / FIRST_STEPS, np.random.default_rng(1)
    for k, (before, after) in enumerate(pairwise([origin, *times])):
        if after != before:
            count = ceil(abs(after - before) / longest) << halving
            state = made.start(y, h=(after - before) / count * (1 + nudge * STRETCH), t0=before)
            made.advance(state, count)
            y = state.y
        if k % ceil(len(times) / NUDGES) == 0:
            y = y * (1 + nudge * NUDGE * random.choice([-1.0, 1.0], len(y)))
        values[:, k] = y
    return values


def _sizes(values: np.ndarray, scene: Scene) -> np.ndarray:
    """The largest value of the block of each variable, (variables, 1)."""
    import numpy as np

    rows = [np.full(block.dimension, np.abs(values[block.offset : block.end]).max()) for block in scene.blocks]
    return np.maximum(np.concatenate(rows), np.finfo(float).tiny)[:, None]
