"""Calibration: the time of a step with all observations, measured on a part of the run by `integrate`."""

from __future__ import annotations

import warnings
from time import perf_counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from integrators import Scene
    from integrators.methods.program.program import Method

SECONDS = 0.3
"""Duration of the timed part."""
FIRST_STEPS, GROWTH = 64, 8


class Stopwatch:
    """Progress function of `integrate` that measures the time of steps, without compilation before the first one."""

    def __init__(self) -> None:
        self._first, self._last = (0, 0.0), (0, 0.0)

    def __call__(self, done: int, total: int) -> None:
        """Record the progress of a run."""
        self._last = done, perf_counter()
        if not self._first[0]:
            self._first = self._last

    @property
    def done(self) -> int:
        """The number of steps so far."""
        return self._last[0]

    @property
    def seconds(self) -> float:
        """The time since the first record."""
        return self._last[1] - self._first[1]

    @property
    def steps(self) -> int:
        """The number of steps in this time."""
        return self._last[0] - self._first[0]


def seconds_per_step(scene: Scene, method: Method | str, steps: int, **options: Any) -> float | None:
    """Seconds per step of a run, including observations and storage; None if there are too few steps to measure.

    Runs that are shorter than the part that counts are repeated.

    Args:
        scene: The scene.
        method: The method, or its name.
        steps: The number of steps of the run.
        **options: All else that `integrate` is called with.

    Example:
        >>> import bseries as bs
        >>> 0 < seconds_per_step(bs.scene("pendulum"), "stormer-verlet", 10**6, h=0.1, save_every=None) < 1e-4
        True
    """
    from integrators import integrate

    def run(count: int) -> Stopwatch:
        watch = Stopwatch()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # left to the run itself
            integrate(scene, method, steps=count, progress=watch, **options)
        return watch

    count, watch = FIRST_STEPS, run(min(FIRST_STEPS, steps))
    while watch.seconds <= SECONDS / 2 and count < steps:
        # After the first trials the time is known well enough to reach the target.
        wanted = int(count * SECONDS / max(watch.seconds, 1e-9))
        count = min(GROWTH * count, max(wanted, count + 1))
        watch = run(min(count, steps))
    if not watch.steps:
        return None
    costs, began = [watch.seconds / watch.steps], perf_counter()
    while watch.seconds <= SECONDS / 2 and perf_counter() - began < SECONDS:
        watch = run(steps)
        costs.append(watch.seconds / watch.steps)
    return sorted(costs)[len(costs) // 2]
