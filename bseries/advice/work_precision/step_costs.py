"""What a step costs: CPU time of compiled steps of several methods, in turn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from time import thread_time
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.timing import Timing, time_in_turn
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    import numpy as np

    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene
    from integrators.steppers.states import State

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
    return {name: found[name].scaled(1 / (run.steps * run.repeats)) for name, run in runs.items()}


class _Run:
    """Steps from a start, always the same number of them."""

    def __init__(self, work: Work, sample: float):

        self._stepper = stepper(work.scene, work.method, **work.options)
        self._start = self._stepper.start(work.y0, h=work.h)
        self.steps, self.repeats = 1, 1
        self._made(1)  # what is to be compiled is, so that the next one shows what a step takes
        seconds, end = self._made(1)
        while seconds < sample and self.steps < work.most_steps:
            growth = min(4.0, 1.1 * sample / max(seconds, 1e-9))
            wanted = min(math.ceil(self.steps * growth), work.most_steps)
            try:
                seconds, end = self._made(wanted)
            except StepError:  # so far the run cannot go: so many steps as could be made have to do
                break
            self.steps = wanted
        self._parts = self._separated(work, end.solver)
        self.sample()
        self.repeats = max(1, math.ceil(sample / max(self._repeated(), 1e-9)))
        self.repeats = max(1, math.ceil(self.repeats * sample / max(self._repeated(), 1e-9)))

    def sample(self) -> None:
        """Make the steps, again and again if a run can only be short."""
        for start, steps in self._parts:
            self._stepper.repeat(start, steps, self.repeats)

    def _repeated(self) -> float:
        begin = thread_time()
        self.sample()
        return thread_time() - begin

    def _made(self, steps: int) -> tuple[float, State]:
        """Seconds for a run, and its end."""
        state, begin = self._start.copy(), thread_time()
        self._stepper.advance(state, steps)
        return thread_time() - begin, state

    def _separated(self, work: Work, last: str) -> list[tuple[State, int]]:
        """The steps before the solver changes and those after it, each with where they begin.

        From the first step that fixed-point iteration does not find on, a run goes on with Newton's method, which need
        not find those before.

        Args:
            work: The steps.
            last: The solver at the end of the run.
        """

        if last == self._start.solver:
            return [(self._start, self.steps)]
        first = stepper(work.scene, work.method, **{**work.options, "solver": self._start.solver})
        after = self._start.copy()
        with suppress(StepError):  # which leaves the run where that step begins
            first.advance(after, self.steps)
        after.solver, after.is_fresh = last, after.n == 0
        parts = [(self._start, after.n), (after, self.steps - after.n)]
        return [(state, steps) for state, steps in parts if steps]
