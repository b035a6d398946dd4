"""What a step costs: CPU time of compiled steps of several methods, in turn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from time import thread_time
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.steppers.states import StepError

from .timing import LEAST_ROUNDS, Timing, time_in_turn

if TYPE_CHECKING:
    import numpy as np

    from integrators.scenes.base import Scene

    from ..coefficients import Method

SAMPLE = 0.02
"""Seconds of steps in one sample."""
MOST_STEPS = 2**20


class Work(NamedTuple):
    """Steps to be timed.

    Attributes:
        scene: The scene.
        method: The method, or its name.
        h: The step size: what implicit steps cost depends on it.
        y0: The start; by default that of the scene.
        options: Further options of `integrators.stepper`.
        most_steps: No sample goes on for more steps than this: it begins again.
    """

    scene: Scene
    method: Method | str
    h: float
    y0: np.ndarray | None = None
    options: Mapping[str, Any] = {}
    most_steps: int = MOST_STEPS


def step_costs(work: Mapping[str, Work], *, sample: float = SAMPLE) -> dict[str, Timing]:
    """CPU seconds for one step, for each of several kinds of steps, compiled and warmed up.

    Each sample begins at the start again, so that all do the same.

    Args:
        work: What to time.
        sample: The seconds that one sample shall take.

    Raises:
        IntegratorError: A method does not fit its scene; as a StepError, a step failed.

    Example:
        >>> import bseries as bs
        >>> found = step_costs({"leapfrog": Work(bs.scene("pendulum"), "stormer-verlet", 0.1)})
        >>> 0 < found["leapfrog"].seconds < 1e-3
        True
    """
    runs = {name: _Run(entry, sample) for name, entry in work.items()}
    found = time_in_turn({name: run.sample for name, run in runs.items()})
    return {name: found[name].less(run.call).scaled(1 / (run.steps * run.repeats)) for name, run in runs.items()}


class _Run:
    """Steps from a start, always the same number of them."""

    def __init__(self, work: Work, sample: float):
        from integrators.steppers.stepping import stepper

        self.work, self.steps, self.repeats = work, 1, 1
        self._stepper = stepper(work.scene, work.method, **work.options)
        self.steps_again()  # what is to be compiled is
        seconds = self._seconds()
        while seconds < sample and self.steps < work.most_steps:
            before, growth = self.steps, min(4.0, 1.1 * sample / max(seconds, 1e-9))
            self.steps = min(math.ceil(before * growth), work.most_steps)
            try:
                seconds = self._seconds()
            except StepError:  # so far the run cannot go: so many steps as could be made have to do
                self.steps = before
                break

        self.repeats = max(1, math.ceil(sample / max(seconds, 1e-9) - 0.5))
        self.call = self.repeats * min(self._seconds(0) for _ in range(LEAST_ROUNDS))

    def sample(self) -> None:
        """Make the steps, again and again if a run can only be short."""
        for _ in range(self.repeats):
            self.steps_again()

    def steps_again(self, steps: int | None = None) -> None:
        """Make the steps, or some of them."""
        state = self._stepper.start(self.work.y0, h=self.work.h)
        self._stepper.advance(state, self.steps if steps is None else steps)

    def _seconds(self, steps: int | None = None) -> float:
        begin = thread_time()
        self.steps_again(steps)
        return thread_time() - begin
