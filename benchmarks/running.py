"""A run: rows in rounds, then one part after another."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from fnmatch import fnmatchcase
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple, TypeVar

from .calibration import calibration_cases
from .cases import cases
from .environment import environment
from .kinds import Case, Measurement, Row, Study
from .parts import PARTS
from .results import Result, collect
from .rivals import rival_cases, rival_versions
from .texts import duration
from .timing import Sample, interleave

Named = TypeVar("Named", Case, Measurement, Study)


def chosen(rows: Iterable[Named], pattern: str, full: bool) -> list[Named]:
    """The rows whose name contains the pattern; those that take minutes only in a full run."""
    return [row for row in rows if fnmatchcase(row.name, f"*{pattern}*") and (full or not row.full)]


def is_empty(pattern: str, full: bool) -> bool:
    """Whether nothing is chosen."""
    studies = [study for part in PARTS for study in part.studies]
    measurements = [measurement for part in PARTS for measurement in part.measurements()]
    return not (chosen(cases(), pattern, full) or chosen(studies, pattern, full) or chosen(measurements, pattern, full))


def run(pattern: str, full: bool, rounds: int, rivals: Path) -> Result:
    """Measure everything that is chosen.

    Args:
        pattern: What names contain; * and ? are wildcards.
        full: Whether to measure also what takes minutes.
        rounds: How often each row is sampled.
        rivals: The virtual environment of other packages.

    Returns:
        The result (see `results.collect`).
    """
    surroundings, clocked = environment(), Clocked()
    rows = [*calibration_cases(), *chosen(cases(), pattern, full)]
    versions = rival_versions(rivals)
    others = chosen(rival_cases(rivals, versions), pattern, full)
    samples = clocked("rows", lambda: measure([*rows, *others], rounds))
    measured = measure_parts(pattern, full, rivals, clocked)
    surroundings["took"] = clocked.sum()
    result = collect(rows, versions, samples, surroundings, measured.figures, measured.studies)
    result["failed"], result["seconds"] = measured.failed, clocked.seconds
    return result


def measure(selected: list[Case], rounds: int) -> dict[str, list[Sample]]:
    """Prepare the cases and sample them in turn, with a bar on stderr."""
    import numba  # noqa: F401  (once it is loaded, kernels run compiled)
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("preparing", total=rounds * len(selected))

        def progress(done: int, name: str) -> None:
            bar.update(task, advance=1, description=f"round {done + 1}: {name}")

        samplers = {}
        for case in selected:
            bar.update(task, description=f"preparing {case.name}")
            samplers[case.name] = case.prepare()
        return interleave(samplers, rounds, progress)


class Measured(NamedTuple):
    """The figures of measurements, the rows of studies, and what those that failed said, under their names."""

    figures: list[Row]
    studies: dict[str, list[Row]]
    failed: dict[str, str]


def measure_parts(pattern: str, full: bool, rivals: Path, clocked: Clocked) -> Measured:
    """Measure one part after the other, with names on stderr; what fails does not cost the others their figures."""
    from rich.console import Console

    measured = Measured([], {}, {})
    with Console(stderr=True).status("") as status:
        for part in PARTS:
            for entry in [*chosen(part.studies, pattern, full), *chosen(part.measurements(), pattern, full)]:
                status.update(entry.name)
                try:
                    _measure_entry(entry, part.title, rivals, clocked, measured)
                except Exception as error:
                    measured.failed[entry.name] = f"{type(error).__name__}: {error}"
    return measured


def _measure_entry(entry: Study | Measurement, title: str, rivals: Path, clocked: Clocked, measured: Measured) -> None:
    if isinstance(entry, Study):
        measured.studies[entry.name] = clocked(entry.name, lambda: entry.measure(rivals))
        return
    for figure in clocked(entry.name, entry.measure):
        measured.figures.append({"part": title, "name": entry.name, **figure._asdict()})


class Clocked:
    """Calls functions, and notes how long each took: by the clock, and in CPU time.

    Attributes:
        seconds: Both, under the names.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, tuple[float, float]] = {}

    def __call__(self, name: str, function: Callable[[], Any]) -> Any:
        begin, cpu = perf_counter(), _cpu_seconds()
        found = function()
        self.seconds[name] = perf_counter() - begin, _cpu_seconds() - cpu
        return found

    def sum(self) -> str:
        """All together."""
        seconds, cpu = (sum(column) for column in zip(*self.seconds.values(), strict=True))
        return f"{duration(seconds)}, of CPU time {duration(cpu)}"


def _cpu_seconds() -> float:
    """Of this process and its children."""
    return sum(os.times()[:4])
