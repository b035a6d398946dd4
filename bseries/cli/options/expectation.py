"""Predictions for long runs of `bseries simulate`, and their comparison with the outcome."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import perf_counter
from typing import TYPE_CHECKING, Any

from bseries.advice.predictions.prediction import SECONDS, Stopwatch

if TYPE_CHECKING:
    from bseries.advice.predictions.prediction import Prediction
    from bseries.cli.output import Progress

LONG = 5.0
"""Runs of more seconds are predicted by default."""
LEAST_SECONDS, COMPARABLE = 0.01, 0.1
"""Least duration for a measured time, and for its comparison with a prediction: one time slice of a scheduler, and ten
of them."""


class Expectation:
    """The progress of a run and its prediction, calibrated by the first steps.

    `predict` is a function from seconds per step to a prediction; if it can measure these itself, `beforehand`, it is
    also called with None. Without `wanted`, long runs only are predicted.
    """

    def __init__(
        self,
        progress: Progress,
        predict: Callable[[float | None], Prediction],
        wanted: bool | None,
        *,
        beforehand: bool = True,
    ):
        self.watch, self.prediction = Stopwatch(), None
        self._show, self._say, self._predict, self._pause = progress.update, progress.say, predict, 0.0
        self._asked, self._is_open, self._least = bool(wanted), wanted is not False, 0.0 if wanted else LONG
        if wanted and beforehand:
            self._is_open = False
            self._announce(None)

    def __call__(self, done: int, total: int) -> None:
        """Record the progress; `integrate` calls this."""
        self.watch(done, total)
        self._show(done, total)
        if self._is_open and done >= total and self._asked and self.watch.seconds <= SECONDS:
            self._is_open = False
            self._say(f"bseries: expected: nothing, since all was done within {SECONDS:g} s")
        if self._is_open and self.watch.seconds > SECONDS:
            self._is_open = False
            cost = self.watch.seconds / self.watch.steps
            left = total - done
            if self.watch.seconds + cost * left > self._least:
                began = perf_counter()
                self._announce(cost, self.watch.seconds + cost * left)
                self._pause = perf_counter() - began if left else 0.0  # after the last step nothing waits for it

    def _announce(self, cost: float | None, seconds: float | None = None) -> None:
        """Print the prediction; a run from a checkpoint makes fewer steps."""
        self.prediction = self._predict(cost)
        if seconds is not None:
            self.prediction = self.prediction._replace(seconds=seconds)
        self._say(f"bseries: expected: {self.prediction}")

    @property
    def done(self) -> int:
        """The number of steps so far."""
        return self.watch.done

    @property
    def seconds(self) -> float:
        """Seconds of the steps, without the time for the prediction."""
        return self.watch.seconds - self._pause

    @property
    def seconds_per_step(self) -> float | None:
        """None if there were too few."""
        return self.seconds / self.watch.steps if self.seconds > LEAST_SECONDS else None

    def to_dict(self, energy_error: float | None) -> dict[str, Any]:
        """The prediction and the outcome as plain data, with the relative error of the energy if known."""
        if self.prediction is None:
            return {}
        outcome = {"seconds": self.seconds, "energy_error": energy_error}
        return {"prediction": self.prediction.to_dict(), "outcome": outcome}

    def notes(self, energy_error: float | None) -> Iterator[str]:
        """Sentences that compare the outcome with the prediction."""
        from bseries.advice.predictions.prediction import duration

        if self.prediction is None:
            return
        expected, parts = self.prediction, []
        if expected.seconds is not None and self.seconds > COMPARABLE:
            ratio = 100 * (self.seconds / expected.seconds - 1)
            parts.append(
                f"took {duration(self.seconds, 2)} (expected: {duration(expected.seconds, 2)}, {ratio:+.0f} %)"
            )
        if energy_error is not None:
            parts.append(f"relative energy error {energy_error:.1e} (expected: {expected.energy})")
        if expected.solution.value is not None:
            parts.append(f"relative solution error not measured (expected: {expected.solution})")
        if parts:
            yield f"Met and expected: {'; '.join(parts)}."
        if expected.basis and (expected.energy.value, expected.solution.value) != (None, None):
            yield f"Errors were expected {expected.basis}."
