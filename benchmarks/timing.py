"""Samples of time and memory, and rounds in which every case has its turn."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import NamedTuple, TypeAlias

ROOT = Path(__file__).resolve().parent.parent
SAMPLE = 0.05
"""Seconds of calls for one sample of something quick."""
BATCH = 0.001
"""Seconds of a batch of calls: of single ones the least is what the clock gets wrong, which may be nothing at all."""
BUDGET = 10.0
"""A case that has used so many seconds gets no further round."""


class Sample(NamedTuple):
    """Seconds taken, and bytes held at the peak where that is measured."""

    seconds: float
    peak: int | None = None


Sampler: TypeAlias = Callable[[], Sample]


def time_calls(
    function: Callable[[], object], least: float = SAMPLE, clock: Callable[[], float] = perf_counter
) -> Sample:
    """Seconds of a call in the fastest of as many batches as fit into `least` seconds, one call at least."""
    fastest, count = float("inf"), 1
    begin = clock()
    while True:
        start = clock()
        for _ in range(count):
            function()
        now = clock()
        if now - start >= BATCH:
            fastest = min(fastest, (now - start) / count)
        if now - begin >= least:
            return Sample(fastest if fastest < float("inf") else (now - start) / count)
        if now - start < BATCH:
            count *= 2


def run(command: Sequence[str], environment: Mapping[str, str] | None = None) -> tuple[float, str]:
    """Run a whole process: the seconds until it has ended, and what it printed.

    The working directory is an empty one and byte code may be kept, as for a user who runs an installed package.
    """
    variables = {**os.environ, **(environment or {})}
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    with tempfile.TemporaryDirectory() as empty:
        start = perf_counter()
        ended = subprocess.run(command, capture_output=True, text=True, env=variables, cwd=empty)
        seconds = perf_counter() - start
    if ended.returncode:
        last_line = ended.stderr.strip().rpartition("\n")[2]
        raise RuntimeError(f"{' '.join(command)!r:.200} failed: {last_line}")
    return seconds, ended.stdout


def peak_memory() -> int:
    """The most memory this process has held, in bytes.

    Linux hands `ru_maxrss` down from the process that started this one, so its own mark is read where there is one.
    """
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        import resource
        import sys

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024


def interleave(
    samplers: Mapping[str, Sampler], rounds: int, progress: Callable[[int, str], None], budget: float = BUDGET
) -> dict[str, list[Sample]]:
    """Sample every case once a round, so that a busy minute of the machine spoils one round and not one case."""
    samples: dict[str, list[Sample]] = {name: [] for name in samplers}
    spent = dict.fromkeys(samplers, 0.0)
    for done in range(rounds):
        for name, sampler in samplers.items():
            if spent[name] > budget:
                continue
            progress(done, name)
            start = perf_counter()
            samples[name].append(sampler())
            spent[name] += perf_counter() - start
    return samples


def best(samples: Sequence[Sample]) -> Sample:
    """The least time, and the least peak, of several samples."""
    peaks = [sample.peak for sample in samples if sample.peak is not None]
    return Sample(min(sample.seconds for sample in samples), min(peaks, default=None))
