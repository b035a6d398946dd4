"""Calibration: the time of a step, measured by `integrate` on a part of the run; durations as text."""

from __future__ import annotations

import warnings
from time import perf_counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from integrators import Scene
    from integrators.methods.programs.program import Method

SECONDS = 0.3
"""Duration of the timed part: some time slices of the scheduler."""
FIRST_STEPS, GROWTH = 64, 4
"""Steps of the first trial, and the factor to the next, so that the last one takes less than four times `SECONDS`/2."""


class Stopwatch:
    """Progress function of `integrate` that measures the time of steps, without compilation before the first one.

    `done` is the number of steps so far, `steps` that since the first record, `seconds` the time of the latter.
    """

    def __init__(self) -> None:
        self.done, self.steps, self.seconds = 0, 0, 0.0
        self._first: tuple[int, float] | None = None

    def __call__(self, done: int, total: int) -> None:
        """Record the progress of a run."""
        self.done, now = done, (done, perf_counter())
        self._first = self._first or now
        self.steps, self.seconds = now[0] - self._first[0], now[1] - self._first[1]


def seconds_per_step(scene: Scene, method: Method | str, steps: int, **options: Any) -> float | None:
    """Seconds per step of a run, including observations and storage; None if there are too few steps to measure.

    Runs that are shorter than the timed part are repeated. The options are those of `integrate`.
    """
    from integrators import integrate

    def run(count: int) -> Stopwatch:
        watch = Stopwatch()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # left to the run itself
            integrate(method, scene, steps=count, progress=watch, **options)
        return watch

    count, watch = FIRST_STEPS, run(min(FIRST_STEPS, steps))
    while watch.seconds <= SECONDS / 2 and count < steps:
        count *= GROWTH
        watch = run(min(count, steps))
    if not watch.steps:
        return None
    costs, began = [watch.seconds / watch.steps], perf_counter()
    while watch.seconds <= SECONDS / 2 and perf_counter() - began < SECONDS:
        watch = run(steps)
        costs.append(watch.seconds / watch.steps)
    return sorted(costs)[len(costs) // 2]


UNITS = ((1e-9, "ns"), (1e-6, "µs"), (1e-3, "ms"), (1.0, "s"))


def duration(seconds: float, digits: int = 3) -> str:
    """A duration as text, in a suitable unit.

    Example:
        >>> [duration(x) for x in (4.567e-5, 0.0123, 9.999, 61.2, 8000.0)]
        ['45.7 µs', '12.3 ms', '10 s', '61.2 s', '2 h 13 min']
    """
    if seconds >= 600:
        minutes = round(seconds / 60)
        return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
    size, unit = next((u for u in UNITS if seconds < 999.5 * u[0]), UNITS[-1])  # 999.5 is rounded to 1000
    return f"{seconds / size:.{digits if seconds < 100 * size else 3}g} {unit}"
