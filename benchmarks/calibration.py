"""Fixed amounts of work, by which runs on different machines, and on a busy one, can be compared."""

from __future__ import annotations

from collections.abc import Callable

from bseries_base.kernels import kernel

from .cases import Case
from .timing import Sampler, time_calls

COMPILED_STEPS, INTERPRETED_STEPS = 10_000_000, 500_000


@kernel
def logistic_map(steps):
    """Iterates of x ↦ 3.9 x (1 − x): each waits for the one before, so neither memory nor vector width matters."""
    x = 0.5
    for _ in range(steps):
        x = 3.9 * x * (1.0 - x)
    return x


def calibration_cases() -> list[Case]:
    """The same loop compiled, and run by the interpreter, sampled in every round like everything else."""
    return [
        Case(
            "calibration/compiled",
            "calibration loop, compiled",
            _prepare(lambda: logistic_map.compiled, COMPILED_STEPS),
        ),
        Case(
            "calibration/interpreted",
            "calibration loop, interpreted",
            _prepare(lambda: logistic_map.py_func, INTERPRETED_STEPS),
        ),
    ]


def _prepare(choose: Callable[[], Callable[[int], float]], steps: int) -> Callable[[], Sampler]:
    def prepare() -> Sampler:
        loop = choose()
        loop(steps)
        return lambda: time_calls(lambda: loop(steps))

    return prepare
