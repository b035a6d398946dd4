"""CPU times: medians over interleaved rounds, costs of compiled steps."""

from __future__ import annotations

import datetime
import importlib.metadata
import math
import os
import platform
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median, quantiles
from time import thread_time
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.methods.programs.program import Method
from integrators.scenes.scene import Scene
from integrators.steppers.states import State, StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    import numpy as np


PACKAGES = ("bseries-engine", "numpy", "numba", "sympy")


def machine() -> dict[str, str]:
    """Date, processor, system and versions, as text."""
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    return {
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "processor": f"{_processor()}, {os.cpu_count()} cores, load {load} at the start",
        "system": f"{platform.system()} {platform.machine()}",
        "versions": f"Python {platform.python_version()}, {versions}",
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


class Rounds(NamedTuple):
    """How many rounds of samples are taken."""

    least: int = 5
    """Quartiles inside the range need five samples."""
    most: int = 15
    """These limit the time on a noisy machine."""
    spread: float = 0.1
    """Distance of the quartiles, relative to the median, above which further rounds follow: recommendations may exceed
    the least time by this part."""


ROUNDS = Rounds()
SAMPLE = 0.02
"""Seconds of steps in one sample: more than the time slice of a scheduler, and thousands of ticks of the clock."""
TICK = 1e-9
"""Resolution of the clock, in seconds."""
MOST_STEPS = 2**20
"""Most steps of a sample: a millisecond for steps of one nanosecond."""


@dataclass(frozen=True)
class Timing:
    """A measured time."""

    seconds: float  # the median of all rounds
    low: float  # the lower quartile
    high: float  # the upper quartile
    rounds: int

    @property
    def spread(self) -> float:
        """The distance of the quartiles, relative to the median."""
        return (self.high - self.low) / self.seconds if self.seconds else 0.0


def summary(samples: list[float]) -> Timing:
    """Median and quartiles of samples."""
    low, _, high = quantiles(samples, n=4, method="inclusive") if len(samples) > 1 else samples * 3
    return Timing(median(samples), low, high, len(samples))


class Work(NamedTuple):
    """Steps to time."""

    scene: Scene
    method: Method | str
    h: float  # affects the cost of implicit steps
    y0: np.ndarray | None = None  # by default the start of the scene
    options: Mapping[str, Any] = {}  # of `integrators.stepper`
    most_steps: int = MOST_STEPS  # of a sample; longer samples start again


def step_costs(work: Mapping[str, Work], *, sample: float = SAMPLE) -> dict[str, Timing]:
    """CPU seconds per step for several kinds of steps, compiled and warm, measured in interleaved rounds.

    Other load on the machine then affects one round and not one kind. After the least number of rounds, only kinds with
    a wide spread have further ones. All samples begin at the same start.
    """
    runs = {name: _Run(entry, sample) for name, entry in work.items()}
    samples: dict[str, list[float]] = {name: [] for name in work}
    for done in range(ROUNDS.most):
        for name, run in runs.items():
            if done < ROUNDS.least or summary(samples[name]).spread > ROUNDS.spread:
                samples[name].append(run.sample() / (run.steps * run.repeats))
    return {name: summary(taken) for name, taken in samples.items()}


class _Run:
    """A fixed number of steps from a fixed start."""

    def __init__(self, work: Work, sample: float):
        self._stepper = stepper(work.method, work.scene, **work.options)
        self._start = self._stepper.start(work.y0, h=work.h)
        self.steps, self.repeats = 1, 1
        self._made(1)  # compiles, so that the next call measures a step
        seconds, end = self._made(1)
        while seconds < sample and self.steps < work.most_steps:
            # A tenth more, so that the next run suffices; at most four times as many, since short times are inaccurate.
            growth = min(4.0, 1.1 * sample / max(seconds, TICK))
            wanted = min(math.ceil(self.steps * growth), work.most_steps)
            try:
                seconds, end = self._made(wanted)
            except StepError:  # keep the number of steps that succeeded
                break
            self.steps = wanted
        self._parts = self._separated(work, end.solver)
        self.sample()
        for _ in range(2):  # the second time from more repetitions
            self.repeats = math.ceil(self.repeats * sample / max(self.sample(), TICK))

    def sample(self) -> float:
        """Seconds for the steps, repeated if the run is short."""
        begin = thread_time()
        for start, steps in self._parts:
            self._stepper.repeat(start, steps, self.repeats)
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
        first = stepper(work.method, work.scene, **{**work.options, "solver": self._start.solver})
        after = self._start.copy()
        with suppress(StepError):  # the state before the failed step remains
            first.advance(after, self.steps)
        after.solver, after.is_fresh = last, after.n == 0
        parts = [(self._start, after.n), (after, self.steps - after.n)]
        return [(state, steps) for state, steps in parts if steps]
