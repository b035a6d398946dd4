"""Timing: medians over interleaved rounds, with more rounds while their spread is wide."""

from __future__ import annotations

import datetime
import importlib.metadata
import os
import platform
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median, quantiles
from time import thread_time
from typing import NamedTuple

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


LEAST_ROUNDS, MOST_ROUNDS = 5, 15
WIDE_SPREAD = 0.1
"""Distance of the quartiles, relative to the median, above which there are further rounds."""


class Timing(NamedTuple):
    """A measured time.

    Attributes:
        seconds: The median of all rounds.
        low: The lower quartile.
        high: The upper quartile.
        rounds: The number of rounds.
    """

    seconds: float
    low: float
    high: float
    rounds: int

    @property
    def spread(self) -> float:
        """The distance of the quartiles, relative to the median."""
        return (self.high - self.low) / self.seconds if self.seconds else 0.0

    def scaled(self, factor: float) -> Timing:
        """The time for a multiple of the work."""
        return Timing(self.seconds * factor, self.low * factor, self.high * factor, self.rounds)


def summary(samples: list[float]) -> Timing:
    """Median and quartiles of samples."""
    low, _, high = quantiles(samples, n=4, method="inclusive") if len(samples) > 1 else samples * 3
    return Timing(median(samples), low, high, len(samples))


def time_in_turn(
    tasks: Mapping[str, Callable[[], object]],
    *,
    least_rounds: int = LEAST_ROUNDS,
    most_rounds: int = MOST_ROUNDS,
    clock: Callable[[], float] = thread_time,
) -> dict[str, Timing]:
    """Time all tasks in interleaved rounds, so that a busy moment of the machine affects one round and not one task.

    After `least_rounds` only those whose spread is wide have further ones.

    Args:
        tasks: Functions without arguments, compiled and warm.
        least_rounds: The least number of rounds.
        most_rounds: The largest number of rounds.
        clock: The clock; by default the CPU time of this thread.

    Example:
        >>> found = time_in_turn({"a sum": lambda: sum(range(1000))})
        >>> found["a sum"].low <= found["a sum"].seconds <= found["a sum"].high
        True
    """
    samples: dict[str, list[float]] = {name: [] for name in tasks}
    for done in range(most_rounds):
        for name, task in tasks.items():
            if done < least_rounds or summary(samples[name]).spread > WIDE_SPREAD:
                begin = clock()
                task()
                samples[name].append(clock() - begin)
    return {name: summary(taken) for name, taken in samples.items()}
