"""A run: steps made in chunks, and the rows that are kept of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from .recordings import Counts
from .steppers.states import StepError

if TYPE_CHECKING:
    from .observers import Observers
    from .recordings import Recording, Rows
    from .steppers.states import State
    from .steppers.stepping import Stepper

CHUNK_NUMBERS = 2**21
"""How many numbers are recorded in a chunk at most."""


class Grid(NamedTuple):
    """The start, every so many-th step, and the last.

    Attributes:
        every: How many; None: nothing between start and end.
    """

    every: int | None

    def between(self, before: int, n: int) -> int:
        """How many steps after one up to another are every so many-th."""
        return 0 if self.every is None else n // self.every - before // self.every

    def has(self, n: int) -> bool:
        """Whether a step is among them, even if it is not the last."""
        return n == 0 or (self.every is not None and n % self.every == 0)

    def count(self, steps: int) -> int:
        """How many there are in so many steps."""
        return 1 + self.between(0, steps) + (not self.has(steps))


class Run:
    """A run and its recording, which agree after every call that succeeds.

    Args:
        stepper: What makes the steps.
        state: Where the run is.
        seen: What is observed.
        stored: Which states are kept.
        observed: Which states are observed.
        recording: Where rows go.

    Attributes:
        mark: A copy of the state, and how many rows there were: what to go back to when a call was interrupted.
        gap: The first observation that was no finite number, as a sentence.
    """

    def __init__(
        self, stepper: Stepper, state: State, seen: Observers, stored: Grid, observed: Grid, recording: Recording
    ):
        self.stepper, self.state, self.seen, self.recording = stepper, state, seen, recording
        self._stored, self._observed = stored, observed
        self.mark = state.copy(), recording.counts
        self.gap: str | None = None

    def begin(self) -> None:
        """Keep the start."""
        self._keep_state(True, True)

    def end(self) -> None:
        """Keep the state where the run has ended."""
        self._keep_state(not self._stored.has(self.state.n), not self._observed.has(self.state.n))

    def _keep_state(self, store: bool, observe: bool) -> None:
        state, counts = self.state, Counts(int(store), int(observe))
        rows = self.recording.room(counts)
        rows.y[:], rows.t[:] = state.y, state.t
        if observe and rows.observed is not None and rows.observed_t is not None:
            rows.observed[:], rows.observed_t[:] = self.seen(state.t, state.y), state.t
        self._keep(rows, counts)

    def _keep(self, rows: Rows, counts: Counts) -> None:
        if self.gap is None:
            self.gap = _gap(rows, counts.observed, self.seen.names)
        self.recording.add(counts)
        self.mark = self.state.copy(), self.recording.counts

    def advance(self, steps: int) -> int:
        """Make steps, not more than can be recorded at once.

        Args:
            steps: How many.

        Returns:
            How many steps were made.

        Raises:
            StepError: A step failed; what is before it has been kept.
        """
        state, before = self.state, self.state.n
        for grid, width in ((self._stored, len(state.y)), (self._observed, len(self.seen))):
            if grid.every is not None:
                steps = min(steps, grid.every * max(1, CHUNK_NUMBERS // max(1, width)))
        rows = self.recording.room(self._between(before, before + steps))
        try:
            self.stepper.record(
                state,
                steps,
                y_every=self._stored.every or 0,
                y_rows=rows.y,
                y_times=rows.t,
                o_every=(self._observed.every or 0) if len(self.seen) else 0,
                observer=self.seen.address,
                o_rows=rows.observed,
                o_times=rows.observed_t,
            )
        except StepError:
            self._keep(rows, self._between(before, state.n))
            raise
        self._keep(rows, self._between(before, state.n))
        return steps

    def _between(self, before: int, n: int) -> Counts:
        """How many rows the steps after one up to another give."""
        return Counts(self._stored.between(before, n), self._observed.between(before, n))


def _gap(rows: Rows, count: int, names: Sequence[str]) -> str | None:
    """The first of so many observations that is no finite number, if there is one."""
    import numpy as np

    if rows.observed is None or rows.observed_t is None or np.isfinite(rows.observed[:count]).all():
        return None
    row, column = np.argwhere(~np.isfinite(rows.observed[:count]))[0]
    value, t = rows.observed[row, column], rows.observed_t[row]
    return f"{names[column]} must be finite at the states that are observed, but was {value} at t = {t:g}"
