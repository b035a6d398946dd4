"""What a step of a run costs, all included: from a part of the run, made by `integrate` itself."""

from __future__ import annotations

import warnings
from time import perf_counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from integrators import Scene
    from integrators.methods.program.program import Method

SECONDS = 0.3
"""The time of the part that counts."""
FIRST_STEPS, GROWTH = 64, 8


class Stopwatch:
    """What steps cost, without what comes before the first of them: compiling. It is what `integrate` calls."""

    def __init__(self) -> None:
        self._first, self._last = (0, 0.0), (0, 0.0)

    def __call__(self, done: int, total: int) -> None:
        """Note how far a run is."""
        self._last = done, perf_counter()
        if not self._first[0]:
            self._first = self._last

    @property
    def done(self) -> int:
        """The number of steps so far."""
        return self._last[0]

    @property
    def seconds(self) -> float:
        """How long it has run."""
        return self._last[1] - self._first[1]

    @property
    def steps(self) -> int:
        """How many steps were made in that time."""
        return self._last[0] - self._first[0]


def seconds_per_step(scene: Scene, method: Method | str, steps: int, **options: Any) -> float | None:
    """Seconds for one of so many steps, with all that is observed and kept; None if there are too few to tell.

    Runs that are shorter than the part that counts are repeated.

    Args:
        scene: The scene.
        method: The method, or its name.
        steps: How many steps the run is to have.
        **options: All else that `integrate` is called with.

    Raises:
        IntegratorError: An argument does not fit; as a StepError, a step failed.

    Example:
        >>> import bseries as bs
        >>> 0 < seconds_per_step(bs.scene("pendulum"), "stormer-verlet", 10**6, h=0.1, save_every=None) < 1e-4
        True
    """
    from integrators import integrate

    def run(count: int) -> Stopwatch:
        watch = Stopwatch()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the run itself will say what is not finite
            integrate(scene, method, steps=count, progress=watch, **options)
        return watch

    count, watch = FIRST_STEPS, run(min(FIRST_STEPS, steps))
    while watch.seconds <= SECONDS / 2 and count < steps:
        # Beyond the first trials the time is known well enough to hit it.
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
