"""`python -m benchmarks.stepping ratios` and `… precision`: measure, print, and keep the figures."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

import click

from ..environment import environment
from ..report import times
from ..rivals import DEFAULT
from .c_steps import METHODS, STEP_SIZES
from .our_steps import our_steps_like_c
from .precision import BUDGET, OURS, PRECISE, RIVALS, Curve, all_curves, leads, problems
from .ratios import compare, means

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
    averages = means(cells)
    shown = list(dict.fromkeys(cell.scene for cell in cells))
    costs = [[name, *(f"{median(c.theirs) * 1e9:.3g}" for c in cells if c.method == name)] for name in averages]
    _show("C: ns a step", ["method", *shown], costs)
    rows = [
        [name, *(f"{c.ratio:.3f}" for c in cells if c.method == name), f"{averages[name]:.3f}"] for name in averages
    ]
    _show("Ours over C, and geometric mean", ["method", *shown, "mean"], rows)
    _keep(json_file, "stepping-ratios", cells=[cell._asdict() for cell in cells], means=averages)


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
    found: list[Curve] = []
    for problem in chosen:
        curves = all_curves(problem, rivals, methods, budget=budget)
        title = f"{problem.title}: ms to reach an error, and how many times as long others take"
        _show(title, ["error", OURS, *RIVALS], [_lead(row) for row in leads(curves)])
        found += curves
    if diagram:
        from .diagram import draw

        draw(found, chosen).savefig(diagram)
    _keep(json_file, "work-precision", curves=[curve.to_dict() for curve in found])


def _lead(row: dict[str, Any]) -> list[str]:
    mine = "–" if row[OURS] is None else f"{row[OURS] * 1e3:.3g}"
    return [f"{row['error']:.0e}", mine, *(times(row[kind]) for kind in RIVALS)]


def _show(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for heading in headings:
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def _keep(file: str | None, kind: str, **figures: Any) -> None:
    from integrators.files import atomic_write

    if file:
        result = {"schema": 1, "kind": kind, "environment": environment(), **figures}
        atomic_write(file, json.dumps(result, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main(prog_name="python -m benchmarks.stepping")
