"""The work of one task of an ensemble: run the members of a block, and collect their statistics."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import CancelledError
from functools import cached_property, lru_cache
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.core.errors import IntegratorError, shorten
from integrators.runs.ensemble_statistics import Gathering, Statistics, member_statistics
from integrators.runs.executors import MOST_LOSSES
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    import numpy as np

    from integrators.methods.program.program import Method
    from integrators.runs.observers import Observers
    from integrators.scenes.scene import Scene
    from integrators.steppers.states import State
    from integrators.steppers.stepping import Stepper

PATIENCE = 0.1
"""Seconds between checks whether the ensemble was cancelled."""


class Failure(NamedTuple):
    """A member that did not reach the end.

    Attributes:
        member: Its number, from 0.
        step: The step that failed, from 1; 0 if there was no start, None if the worker was lost.
        t: The time before that step, if known.
        y: The state before that step, if known.
        reason: The cause.
    """

    member: int
    step: int | None
    t: float | None
    y: tuple[float, ...] | None
    reason: str


class Block(NamedTuple):
    """The results of a block of members.

    Attributes:
        statistics: Statistics over the members.
        series: The observations of the members to be kept, (members, times, quantities).
        ends: The last states, (members, variables), nan for failed members; no rows if they are not saved.
        failures: The failed members.
    """

    statistics: Statistics
    series: np.ndarray
    ends: np.ndarray
    failures: tuple[Failure, ...]


class Settings(NamedTuple):
    """The common arguments of all members; see `ensemble`."""

    scene: Scene
    method: Method
    h: float
    steps: int
    t0: float
    options: Mapping[str, Any]
    observers: Observers
    observe_every: int
    change: tuple[str | None, ...]
    sample: Callable[[np.random.Generator], Any] | None
    seed: int
    keep: int
    final: bool


class Members:
    """The members of an ensemble, pickled as one byte string that each process unpacks once.

    Attributes:
        settings: The common arguments.
        is_stopped: Set to cancel members that run in threads.
    """

    def __init__(self, *settings: Any):
        self.settings = Settings(*settings)
        self.is_stopped = False
        self._chunk = 1000  # steps between checks of `is_stopped`

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.packed,)

    @cached_property
    def packed(self) -> bytes:
        """The pickled settings; functions of the user are pickled by value, lambdas included.

        Raises:
            IntegratorError: Something cannot be pickled.
        """
        from numba import cloudpickle

        try:
            return cloudpickle.dumps(tuple(self.settings))
        except Exception as error:  # objects of the user may raise anything
            raise IntegratorError(
                "sample and observe must be functions that can be sent to other processes, but were not: "
                f"{shorten(str(error), 120)}"
            ) from None

    @cached_property
    def stepper(self) -> Stepper:
        """The compiled steps."""
        return stepper(self.settings.scene, self.settings.method, **self.settings.options)

    @cached_property
    def step_numbers(self) -> np.ndarray:
        """The observed steps: 0, every `observe_every`-th, and the last."""
        import numpy as np

        steps, every = self.settings.steps, self.settings.observe_every
        return np.append(np.arange(0, steps, every), steps) if steps else np.zeros(1, int)

    def start(self, member: int, y0: Any) -> State:
        """A member before its first step.

        Args:
            member: Its number.
            y0: Its start, (variables,), unless it is drawn.

        Raises:
            IntegratorError: The start is not one finite number for each variable.
            Exception: Any error of `sample`.
        """
        s = self.settings
        start = y0 if s.sample is None else s.sample(member_generator(s.seed, member))
        if start is None and s.sample is not None:
            raise IntegratorError("sample must give the start of a member, but gave None")
        return self.stepper.start(start, h=s.h, t0=s.t0)

    def run(self, state: State, values: np.ndarray) -> None:
        """Make all steps of a member.

        Args:
            state: Its start, replaced by its last state.
            values: Receives the observations, (times, quantities).

        Raises:
            StepError: A step failed; earlier observations are filled in.
        """
        s, observer = self.settings, self.settings.observers
        values[0] = observer(state.t, state.y)
        while state.n < s.steps:
            if self.is_stopped:
                raise CancelledError
            began, chunk = monotonic(), self._chunk
            self.stepper.record(
                state, min(chunk, s.steps - state.n), o_every=s.observe_every if observer else 0,
                observer=observer.address, o_rows=values[1 + state.n // s.observe_every :],
            )  # fmt: skip
            is_short = monotonic() - began < PATIENCE / 2
            self._chunk = min(chunk * 2, s.steps) if is_short else max(1, chunk // 2)
        values[-1] = observer(state.t, state.y)

    def changes(self, values: np.ndarray) -> np.ndarray:
        """The quantities, or their changes since the start, as the settings say."""
        import numpy as np

        result = values.copy()
        with np.errstate(all="ignore"):  # initial values may be zero
            for k, change in enumerate(self.settings.change):
                if change is not None:
                    result[:, k] -= values[0, k]
                if change == "relative":
                    result[:, k] /= values[0, k]
        return result


@lru_cache(maxsize=4)
def _restored(packed: bytes) -> Members:
    return Members(*pickle.loads(packed))


def member_generator(seed: int, member: int) -> np.random.Generator:
    """The generator of a member: that of ``SeedSequence(seed).spawn(…)[member]``, made directly.

    Args:
        seed: The seed of the ensemble.
        member: The number of the member, from 0.

    Example:
        >>> import numpy as np
        >>> third = np.random.SeedSequence(7).spawn(3)[2]
        >>> member_generator(7, 2).random() == np.random.default_rng(third).random()
        True
    """
    import numpy as np

    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(member,)))


def run_block(number: int, members: Members, first: int, starts: Iterable[np.ndarray | None]) -> Block:
    """Run the members of a block.

    Args:
        number: The number of the block, its key in `Workers.run`.
        members: All members.
        first: The number of the first member of the block.
        starts: The start of each member; None if it is drawn.
    """
    import numpy as np

    s, starts = members.settings, list(starts)
    shape = len(members.step_numbers), len(s.observers)
    gathering, failures = Gathering(len(starts)), []
    series = np.full((_kept(s, first, len(starts)), *shape), np.nan)
    ends = np.full((len(starts) if s.final else 0, s.scene.dimension), np.nan)
    for k, start in enumerate(starts):
        values = np.full(shape, np.nan)
        state, rows = None, 0
        try:
            state = members.start(first + k, start)
            members.run(state, values)
            rows = len(values)
        except StepError as error:
            rows = (error.step - 1) // s.observe_every + 1
            failures.append(Failure(first + k, error.step, error.t, tuple(error.y.tolist()), str(error)))
        except Exception as error:
            if state is not None:
                raise
            failures.append(Failure(first + k, 0, s.t0, None, shorten(f"start: {error or type(error).__name__}", 300)))
        values = members.changes(values)
        gathering.add(k, member_statistics(values, rows))
        if k < len(series):
            series[k] = values
        if s.final and state is not None and state.n == s.steps:
            ends[k] = state.y
    assert gathering.total is not None
    return Block(gathering.total, series, ends, tuple(failures))


def lost_block(members: Members, first: int, count: int) -> Block:
    """The result of a block whose workers were lost: failures only."""
    import numpy as np

    s = members.settings
    nothing = np.full((len(members.step_numbers), len(s.observers)), np.nan)
    reason = f"its worker was lost {MOST_LOSSES} times"
    return Block(
        member_statistics(nothing, rows=0),
        np.full((_kept(s, first, count), *nothing.shape), np.nan),
        np.full((count if s.final else 0, s.scene.dimension), np.nan),
        tuple(Failure(k, None, None, None, reason) for k in range(first, first + count)),
    )


def block_sizes(members: Members, span: range) -> dict[str, int]:
    """Lengths of the axes of the arrays of a block."""
    s = members.settings
    sizes = {"times": len(members.step_numbers), "quantities": len(s.observers), "variables": s.scene.dimension}
    return {**sizes, "kept": _kept(s, span.start, len(span)), "ends": len(span) if s.final else 0}


def _kept(settings: Settings, first: int, count: int) -> int:
    """The number of members of a block whose series are kept."""
    return max(0, min(count, settings.keep - first))
