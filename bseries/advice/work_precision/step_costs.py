"""Cost of a step: CPU time of compiled steps of several methods, in interleaved rounds."""

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
    """Steps to time.

    Attributes:
        scene: The scene.
        method: The method, or its name.
        h: The step size, which affects the cost of implicit steps.
        y0: The start; by default that of the scene.
        options: Further options of `integrators.stepper`.
        most_steps: The most steps of a sample; longer samples start again.
    """

    scene: Scene
    method: Method | str
    h: float
    y0: np.ndarray | None = None
    options: Mapping[str, Any] = {}
    most_steps: int = MOST_STEPS


def step_costs(work: Mapping[str, Work], *, sample: float = SAMPLE) -> dict[str, Timing]:
    """CPU seconds per step for several kinds of steps, compiled and warmed up.

    Each sample begins at the start again, so that all do the same.

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
    """A fixed number of steps from a fixed start."""

    def __init__(self, work: Work, sample: float):

        self._stepper = stepper(work.scene, work.method, **work.options)
        self._start = self._stepper.start(work.y0, h=work.h)
        self.steps, self.repeats = 1, 1
        self._made(1)  # compiles, so that the next call measures a step
        seconds, end = self._made(1)
        while seconds < sample and self.steps < work.most_steps:
            growth = min(4.0, 1.1 * sample / max(seconds, 1e-9))
            wanted = min(math.ceil(self.steps * growth), work.most_steps)
            try:
                seconds, end = self._made(wanted)
            except StepError:  # keep the number of steps that succeeded
                break
            self.steps = wanted
        self._parts = self._separated(work, end.solver)
        self.sample()
        self.repeats = max(1, math.ceil(sample / max(self._repeated(), 1e-9)))
        self.repeats = max(1, math.ceil(self.repeats * sample / max(self._repeated(), 1e-9)))

    def sample(self) -> None:
        """Make the steps, repeatedly if the run is short."""
        for start, steps in self._parts:
            self._stepper.repeat(start, steps, self.repeats)

    def _repeated(self) -> float:
        begin = thread_time()
        self.sample()
        return thread_time() - begin

    def _made(self, steps: int) -> tuple[float, State]:
        """Seconds for a run, and its final state."""
        state, begin = self._start.copy(), thread_time()
        self._stepper.advance(state, steps)
        return thread_time() - begin, state

    def _separated(self, work: Work, last: str) -> list[tuple[State, int]]:
        """The steps before and after the change of the solver, each with its first state.

        After the first step at which fixed-point iteration fails, a run continues with Newton's method, which may fail
        for the steps before.
        """

        if last == self._start.solver:
            return [(self._start, self.steps)]
        first = stepper(work.scene, work.method, **{**work.options, "solver": self._start.solver})
        after = self._start.copy()
        with suppress(StepError):  # which leaves the state before the failed step
            first.advance(after, self.steps)
        after.solver, after.is_fresh = last, after.n == 0
        parts = [(self._start, after.n), (after, self.steps - after.n)]
        return [(state, steps) for state, steps in parts if steps]
