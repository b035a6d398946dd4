"""Predictions of runs: expected errors, or why they are unknown, and the time of a step from a part of the run."""

from __future__ import annotations

import warnings
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries_base.table import Table, as_html, fact_table

if TYPE_CHECKING:
    from integrators import Scene
    from integrators.methods.programs.program import Method

SECONDS = 0.3
"""Duration of the timed part: some time slices of the scheduler."""


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

    count, watch = 64, run(min(64, steps))
    while watch.seconds <= SECONDS / 2 and count < steps:
        count *= 4  # so that the last trial takes less than four times `SECONDS`/2
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


class ExpectedError(NamedTuple):
    """An expected error, or the reason why it is unknown.

    Attributes:
        value: The error; None if unknown.
        reason: The reason, or a remark on the value; may be empty.

    Example:
        >>> import bseries as bs
        >>> print(bs.advice.ExpectedError(2.13e-7), bs.advice.ExpectedError(None, "there is no energy"))
        2.1e-07 unknown: there is no energy
    """

    value: float | None
    reason: str = ""

    def __str__(self) -> str:
        text = "unknown" if self.value is None else f"{self.value:.1e}"
        return f"{text}: {self.reason}" if self.reason else text


class Prediction(NamedTuple):
    """Expected time and errors of a run; made by `predict_run`.

    Attributes:
        h: The step size.
        steps: The number of steps.
        seconds: The time on this machine; None if not requested, or if there are too few steps to measure it.
        energy: The largest change of the energy, relative to its value at the start if that is not 0.
        solution: The largest distance from the exact solution, relative to the largest state in that part.
        powers: The powers of h in the modified equation from which the errors follow; may be empty.
        covered: The part of the run, from 0 to 1, that the perturbation run covers, and over which errors are expected.

    Example:
        >>> import bseries as bs
        >>> print(bs.predict_run("gauss2", bs.scene("henon-heiles"), h=0.1, steps=1000, timed=False))
        relative energy error 1.8e-07, relative solution error 2.8e-05 (from the modified equation to h^6)
    """

    h: float
    steps: int
    seconds: float | None
    energy: ExpectedError
    solution: ExpectedError
    powers: tuple[int, ...]
    covered: float

    @property
    def basis(self) -> str:
        """The origin of expected errors."""
        if not self.powers:
            return ""
        rest = "" if self.covered >= 1 else f", over the first {100 * self.covered:.2g} % of the time"
        return f"from the modified equation to h^{self.powers[-1]}{rest}"

    def __str__(self) -> str:
        time = [] if self.seconds is None else [duration(self.seconds, 2)]
        errors = [f"relative energy error {self.energy}", f"relative solution error {self.solution}"]
        if self.energy == self.solution and self.energy.value is None:
            errors = [f"errors {self.energy}"]
        return ", ".join([*time, *errors]) + (f" ({self.basis})" if self.basis else "")

    def __repr__(self) -> str:
        return f"<Prediction of {self.steps:,} steps of {self.h:g}: {self}>"

    def to_table(self) -> Table:
        """The prediction as a table."""
        time = None if self.seconds is None else duration(self.seconds, 2)
        errors = [("relative energy error", str(self.energy)), ("relative solution error", str(self.solution))]
        facts = [("step size", self.h), ("steps", self.steps), ("time", time), *errors, ("basis", self.basis or None)]
        return fact_table("Prediction of a run", facts)._replace(data=self.to_dict)

    _repr_html_ = as_html

    def to_dict(self) -> dict[str, Any]:
        """The prediction as plain data."""
        errors = {"energy_error": self.energy._asdict(), "solution_error": self.solution._asdict()}
        facts = {key: value for key, value in self._asdict().items() if key not in ("energy", "solution")}
        return {"schema": 1, "kind": "prediction", **facts, **errors, "powers": list(self.powers)}


def time_only(h: float, steps: int, reason: str, seconds: float | None = None) -> Prediction:
    """A prediction with unknown errors, and the reason."""
    unknown = ExpectedError(None, reason)
    return Prediction(float(h), steps, seconds, unknown, unknown, (), 0.0)
