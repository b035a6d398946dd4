"""`python -m benchmarks.stepping ratios` and `… precision`: measure, print, and keep the figures."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..environment import environment
from ..kinds import Table
from ..report import show_table
from ..rivals import DEFAULT
from .c_steps import METHODS, STEP_SIZES
from .our_steps import our_steps_like_c
from .precision import BUDGET, PRECISE, all_curves, problems
from .ratios import compare, means
from .studies import precision_tables, ratio_tables, row_of

PROBLEMS = ("kepler", "outer-solar-system")
json_option = click.option(
    "--json", "json_file", type=click.Path(dir_okay=False), help="Write the figures to this file."
)


@click.group()
def main() -> None:
    """Time stepping beside C and beside other packages."""


@main.command()
@click.option("--scene", "scenes", multiple=True, type=click.Choice([*STEP_SIZES]), help="Only this; may be repeated.")
@click.option("--method", "methods", multiple=True, type=click.Choice(METHODS), help="Only this; may be repeated.")
@click.option("--rounds", default=9, show_default=True, type=click.IntRange(1), help="How often each is sampled.")
@json_option
def ratios(scenes: Sequence[str], methods: Sequence[str], rounds: int, json_file: str | None) -> None:
    """What a step costs, as a ratio to C written by hand."""
    if shutil.which("gcc") is None:
        raise click.UsageError("gcc must be installed, but was not found")
    cells = compare(our_steps_like_c, scenes=scenes or tuple(STEP_SIZES), methods=methods or METHODS, rounds=rounds)
    _show(ratio_tables([row_of(cell) for cell in cells]))
    _keep(json_file, "stepping-ratios", cells=[cell._asdict() for cell in cells], means=means(cells))


@main.command()
@click.option("--rivals", default=DEFAULT, type=click.Path(path_type=Path), help="Where other packages are installed.")
@click.option("--problem", "names", multiple=True, type=click.Choice(PROBLEMS), help="Only this; may be repeated.")
@click.option("--method", "methods", multiple=True, default=PRECISE, help="A method of ours; may be repeated.")
@click.option(
    "--budget", default=BUDGET, show_default=True, help="CPU seconds; a curve ends with its first longer run."
)
@click.option("--diagram", type=click.Path(dir_okay=False), help="Draw the curves to this file.")
@json_option
def precision(
    rivals: Path,
    names: Sequence[str],
    methods: Sequence[str],
    budget: float,
    diagram: str | None,
    json_file: str | None,
) -> None:
    """CPU time that a given error of energy takes."""
    chosen = [problem for problem in problems() if not names or problem.name in names]
    found = [curve for problem in chosen for curve in all_curves(problem, rivals, methods, budget=budget)]
    rows = [curve.to_dict() for curve in found]
    _show(precision_tables(rows))
    if diagram:
        from .diagram import draw

        draw(found, chosen).savefig(diagram)
    _keep(json_file, "work-precision", curves=rows)


def _show(tables: Sequence[Table]) -> None:
    from rich.console import Console

    for table in tables:
        show_table(table, Console())


def _keep(file: str | None, kind: str, **figures: Any) -> None:
    from integrators.core.text_files import atomic_write

    if file:
        result = {"schema": 1, "kind": kind, "environment": environment(), **figures}
        atomic_write(file, json.dumps(result, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main(prog_name="python -m benchmarks.stepping")
