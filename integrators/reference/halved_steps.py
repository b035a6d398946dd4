"""Solutions with error bounds from values of the field: steps of high order, halved until the solution settles.

Taylor series need formulas. The method of order 8 of Dormand and Prince needs only values of the field. It runs in
doubles with compensated sums. The difference of the last two solutions bounds the discretisation error, which decreases
slowly where the field has kinks. A solution with perturbed step sizes and states shows the rounding error.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil

import numpy as np

from integrators.core.arguments import read_whole
from integrators.core.errors import IntegratorError
from integrators.reference.solution import ReferenceSolution, read_start, read_times, with_checks
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

METHOD, MOST_DIGITS = "dop853", 15
FIRST_STEPS, MOST_HALVINGS = 64, 14
"""The number of steps of the first solution, which is larger if there are more times, and of its doublings."""
STEP_CHANGE, STATE_CHANGE, MOST_CHANGES = 2.0**-52, 2.0**-51, 32
"""Relative perturbations that show how rounding errors grow: of the step size, and of the state at that many times."""
UNIT, SETTLED = 2.0**-53, 4.0
"""The unit roundoff, and its multiple below which more steps do not reduce the difference of solutions."""
SAFETY = 4.0
"""Factor of the bound, since the difference of two solutions only estimates their errors."""


def settled_solution(
    scene: Scene | str, t: object, *, y0: object = None, t0: object = None, digits: int = MOST_DIGITS
) -> ReferenceSolution:
    """The solution of a scene in doubles with an error bound, from values of its field only.

    `reference_solution` gives all digits, but needs formulas.

    Args:
        scene: The scene; its parameters must be numbers.
        t: The times, in one direction from `t0`; a number counts as one time.
        y0: The start, a number for each variable; by default that of the scene.
        t0: The time of the start; by default the scene's variable t if it has one, else 0.
        digits: Steps are halved until the difference of two solutions is below 10^−digits of the largest value of each
            block; up to 15. Where rounding errors grow or the field jumps, it may stay larger; the bound shows this.

    Returns:
        The solution; its `low` is zero.

    Raises:
        IntegratorError: An argument is invalid, or the solution ends before the last time.

    Example:
        >>> import bseries as bs
        >>> def rate(y):
        ...     return -y[0] if y[0] > 0 else 0.0
        >>> found = bs.integrators.settled_solution(bs.scene_from_function(rate, [1]), [1])
        >>> print(found.high[0, 0].round(12), bool(found.error.max() < 1e-14))
        0.367879441171 True

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.5 (the method).
    """
    scene = as_scene(scene)
    digits = read_whole(digits, "digits", f"a whole number from 1 to {MOST_DIGITS}", 1, MOST_DIGITS)
    start, origin = read_start(scene, y0, t0)
    times, wanted = with_checks(read_times(t, origin), origin)
    problem = scene, [*map(float, start)], float(origin), [*map(float, times)]
    known: np.ndarray | None = None
    found: tuple[np.ndarray, np.ndarray] | None = None
    failed: StepError | None = None
    for halving in range(MOST_HALVINGS + 1):
        try:
            values, perturbed = (_solution(*problem, halving, is_perturbed) for is_perturbed in (False, True))
        except StepError as error:
            known, failed = None, error
            continue
        if known is not None:
            of_steps, of_rounding = (np.maximum.accumulate(np.abs(values - x), axis=1) for x in (known, perturbed))
            blocks = ((b.dimension, np.abs(values[b.offset : b.end]).max()) for b in scene.blocks)
            sizes = np.concatenate([np.full(size, largest) for size, largest in blocks])[:, None]
            found = values, SAFETY * (of_steps + of_rounding + UNIT * np.abs(values))
            least = max(10.0**-digits / SAFETY, SETTLED * UNIT) * np.maximum(sizes, np.finfo(float).tiny)
            if (of_steps[:, -1:] <= np.maximum(SAFETY * of_rounding[:, -1:], least)).all():
                break
        known = values
    if found is None:
        raise IntegratorError(
            f"t must end where {FIRST_STEPS << MOST_HALVINGS} steps of {METHOD} reach the solution of {scene.name}, "
            f"but reached to {float(times[-1]):g}: {failed}"
        ) from failed
    high, error = found
    return ReferenceSolution(high[:, wanted], np.zeros((len(high), len(wanted))), error[:, wanted])


def _solution(
    scene: Scene, y0: Sequence[float], origin: float, times: Sequence[float], halving: int, is_perturbed: bool
) -> np.ndarray:
    """The solution, with a whole number of steps between times, which each halving doubles."""
    made = stepper(METHOD, scene)
    y, values = np.array(y0, dtype=float), np.empty((len(y0), len(times)))
    longest, random = abs(times[-1] - origin) / FIRST_STEPS, np.random.default_rng(1)
    for k, (before, after) in enumerate(pairwise([origin, *times])):
        if after != before:
            count = ceil(abs(after - before) / longest) << halving
            state = made.start(y, h=(after - before) / count * (1 + is_perturbed * STEP_CHANGE), t0=before)
            made.advance(state, count)
            y = state.y
        if k % ceil(len(times) / MOST_CHANGES) == 0:
            y = y * (1 + is_perturbed * STATE_CHANGE * random.choice([-1.0, 1.0], len(y)))
        values[:, k] = y
    return values
