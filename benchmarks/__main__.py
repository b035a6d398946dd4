"""`python -m benchmarks`: measure, print, and keep the figures."""

from __future__ import annotations

import os
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, TypeVar

import click

from .calibration import calibration_cases
from .cases import Case, cases
from .environment import environment
from .kinds import Measurement
from .report import collect, show, to_json, to_markdown
from .rivals import DEFAULT, rival_cases, rival_versions
from .stepping.figures import collect as collect_figures
from .stepping.figures import measurements
from .timing import Sample, interleave

Row = TypeVar("Row", Case, Measurement)


def chosen(rows: list[Row], pattern: str, full: bool) -> list[Row]:
    """The rows whose name contains the pattern; those that take a minute only in a full run."""
    return [row for row in rows if fnmatchcase(row.name, f"*{pattern}*") and (full or not row.full)]


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


def measure_figures(selected: list[Measurement]) -> list[dict[str, Any]]:
    """Take the measurements, with their names on stderr."""
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        return collect_figures(selected, status.update)


@click.command()
@click.option("--only", "pattern", default="", help="Only rows whose name contains this; * and ? are wildcards.")
@click.option("--rounds", default=5, show_default=True, type=click.IntRange(1), help="How often each row is sampled.")
@click.option(
    "--full", is_flag=True, help="Also what takes minutes: order 20, with 9 GB of memory, and 10⁷ and 10⁸ steps."
)
@click.option("--json", "json_file", type=click.Path(dir_okay=False), help="Write all figures to this file.")
@click.option("--output", "page", type=click.Path(dir_okay=False), help="Write the tables to this file as Markdown.")
@click.option("--rivals", "rivals", default=DEFAULT, type=click.Path(path_type=Path), help="Where they are installed.")
def main(pattern: str, rounds: int, full: bool, json_file: str | None, page: str | None, rivals: Path) -> None:
    """Measure what everything costs, beside other packages timed in the same run.

    Every row is the best of several rounds; in each round every row has its turn.
    """
    from rich.console import Console

    from integrators.files import atomic_write

    for path in filter(None, (json_file, page)):
        if not os.access(Path(path).absolute().parent, os.W_OK):  # said before minutes of work
            raise click.BadParameter(f"file must lie in a writable folder, but was {path!r}")
    surroundings = environment()
    selected = chosen(cases(), pattern, full)
    versions = rival_versions(rivals)
    others = chosen(rival_cases(rivals, versions), pattern, full)
    further = chosen(measurements(rivals), pattern, full)
    if not selected and not further:
        raise click.BadParameter(f"no row has a name like {pattern!r}", param_hint="--only")
    rows = [*calibration_cases(), *selected]
    samples = measure([*rows, *others], rounds)
    result = collect(rows, versions, samples, surroundings, measure_figures(further))
    show(result, Console())
    if json_file:
        atomic_write(json_file, to_json(result))
    if page:
        atomic_write(page, to_markdown(result))


if __name__ == "__main__":
    main(prog_name="python -m benchmarks")
