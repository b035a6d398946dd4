"""Members of an ensemble: their common arguments, and the run of each or of a block of them."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from itertools import repeat
from time import monotonic
from typing import Any

import numpy as np

from integrators.core.errors import IntegratorError, shorten
from integrators.methods.programs.program import Method
from integrators.runs.ensemble_results import Block, Failure, member_statistics, merged_blocks
from integrators.runs.observers import Observers
from integrators.scenes.scene import Scene
from integrators.steppers.states import State, StepError
from integrators.steppers.stepping import Stepper, stepper

PATIENCE = 0.1
"""Seconds between checks whether the ensemble was cancelled."""


@dataclass(eq=False)
class Members:
    """The common arguments of all members, see `ensemble`; pickled as bytes that each process unpacks once.

    Setting `is_stopped` cancels members that run in threads.
    """

    scene: Scene
    method: Method
    h: float
    steps: int
    t0: float
    options: Mapping[str, Any]
    observers: Observers
    observe_every: int
    change: Sequence[str | None]
    sample: Callable[[np.random.Generator], Any] | None
    seed: int
    keep: int
    final: bool

    def __post_init__(self) -> None:
        self.is_stopped = False
        self._chunk = 1000  # steps between checks of `is_stopped`

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.packed,)

    @cached_property
    def packed(self) -> bytes:
        """The pickled arguments; functions of the user are pickled by value, lambdas included."""
        from numba import cloudpickle

        try:
            return cloudpickle.dumps([getattr(self, field.name) for field in fields(self)])
        except Exception as error:  # objects of the user may raise anything
            raise IntegratorError(
                "sample and observe must be functions that can be sent to other processes, but were not: "
                f"{shorten(str(error), 120)}"
            ) from None

    @cached_property
    def stepper(self) -> Stepper:
        """The compiled steps."""
        return stepper(self.method, self.scene, **self.options)

    @cached_property
    def step_numbers(self) -> np.ndarray:
        """The observed steps: 0, every `observe_every`-th, and the last."""
        return np.append(np.arange(0, self.steps, self.observe_every), self.steps) if self.steps else np.zeros(1, int)

    def sizes(self, members: range) -> dict[str, int]:
        """Lengths of the axes of the arrays of a block."""
        kept = max(0, min(len(members), self.keep - members.start))
        sizes = {"times": len(self.step_numbers), "quantities": len(self.observers), "variables": self.scene.dimension}
        return {**sizes, "kept": kept, "ends": len(members) if self.final else 0}

    def start(self, member: int, y0: Any) -> State:
        """A member before its first step, from its start or, where `y0` is None, from a drawn one."""
        start = y0 if self.sample is None else self.sample(member_generator(self.seed, member))
        if start is None:
            raise IntegratorError("sample must give the start of a member, but gave None")
        return self.stepper.start(start, h=self.h, t0=self.t0)

    def run(self, state: State, values: np.ndarray) -> None:
        """Make all steps of a member in place, and write the observations, (times, quantities), until a step fails."""
        observer = self.observers
        values[0] = observer(state.t, state.y)
        while state.n < self.steps:
            if self.is_stopped:
                raise CancelledError
            began, chunk = monotonic(), self._chunk
            self.stepper.record(
                state, min(chunk, self.steps - state.n), o_every=self.observe_every if observer else 0,
                observer=observer.address, o_rows=values[1 + state.n // self.observe_every :],
            )  # fmt: skip
            is_short = monotonic() - began < PATIENCE / 2
            self._chunk = min(chunk * 2, self.steps) if is_short else max(1, chunk // 2)
        values[-1] = observer(state.t, state.y)

    def changed(self, values: np.ndarray) -> np.ndarray:
        """The quantities, or their changes since the start, depending on `change`."""
        result = values.copy()
        with np.errstate(all="ignore"):  # initial values may be zero
            for k, change in enumerate(self.change):
                if change is not None:
                    result[:, k] -= values[0, k]
                if change == "relative":
                    result[:, k] /= values[0, k]
        return result

    def result(self, member: int, y0: Any) -> Block:
        """The run of one member, as a block."""
        values = np.full((len(self.step_numbers), len(self.observers)), np.nan)
        end, rows, failures = np.full(self.scene.dimension, np.nan), 0, list[Failure]()
        state = None
        try:
            state = self.start(member, y0)
            self.run(state, values)
            rows, end = len(values), state.y
        except StepError as error:
            rows = (error.step - 1) // self.observe_every + 1
            failures = [Failure(member, error.step, error.t, tuple(error.y.tolist()), str(error))]
        except Exception as error:
            if state is not None:
                raise
            failures = [Failure(member, 0, self.t0, None, shorten(f"start: {error or type(error).__name__}", 300))]
        values = self.changed(values)
        series, ends = values[None][: int(member < self.keep)], end[None][: int(self.final)]
        return Block(member_statistics(values, rows), series, ends, tuple(failures))


@lru_cache(maxsize=4)
def _restored(packed: bytes) -> Members:
    return Members(*pickle.loads(packed))


def member_generator(seed: int, member: int) -> np.random.Generator:
    """The generator of a member: that of ``SeedSequence(seed).spawn(…)[member]``, made directly.

    Example:
        >>> import numpy as np
        >>> third = np.random.SeedSequence(7).spawn(3)[2]
        >>> member_generator(7, 2).random() == np.random.default_rng(third).random()
        True
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(member,)))


def run_block(work: Members, members: range, starts: np.ndarray | None) -> Block:
    """Run a block of members from their starts; None: they are drawn."""
    own = repeat(None, len(members)) if starts is None else starts
    return merged_blocks(work.result(member, y0) for member, y0 in zip(members, own, strict=True))
