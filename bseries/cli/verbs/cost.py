"""`bseries cost`: what accuracy costs on a scene, and which method and step to take."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import is_tableau_file, read_method
from bseries.cli.options.numbers import read_float
from bseries.cli.options.plot import PlotFile, takes_plot
from bseries.cli.options.scene_argument import read_start, takes_scene
from bseries.cli.output import NO_LATEX, Output, takes_output
from foundation.table import Table

if TYPE_CHECKING:
    from bseries.advice.work_precision.precision_curves import WorkPrecision
    from bseries.advice.work_precision.recommendation import Recommendation
    from integrators import Scene


USUAL = (1e-3, 1e-6, 1e-9)
"""The errors that methods are recommended for where none is given."""


@click.command()
@takes_scene(as_argument=True)
@click.option(
    "--methods",
    metavar="NAMES",
    help="Names or tableau files with commas between, or all; by default, those known to be good.",
)  # fmt: skip
@click.option("--span", metavar="T", help="How long runs are; by default, some periods of the motion.")
@click.option("--start", metavar="TEXT", help='Start values by block, as in "p=0;q=-3/2".')
@click.option("--errors", metavar="A:B", default="1e-3:1e-12", show_default=True, help="The errors of interest.")
@click.option("--measure", metavar="NAME", default="all", help="solution or energy; by default, both.")
@click.option(
    "--error", "wanted", metavar="E", multiple=True, help="An accuracy to recommend a method for; repeatable."
)
@click.option("--budget", metavar="S", help="CPU seconds for the longest run of a method; by default, 0.2.")
@takes_plot
@functools.partial(takes_output, formats=NO_LATEX)
def cost(
    scene: Scene,
    effects: Sequence[str],
    methods: str | None,
    span: str | None,
    start: str | None,
    errors: str,
    measure: str,
    wanted: Sequence[str],
    budget: str | None,
    plot: PlotFile,
    output: Output,
) -> Table:
    """CPU time against error on a scene, for many methods and steps.

    Runs methods that suit the scene over a range of steps, measures errors of the solution (against a reference) and
    of the energy, and times the steps in separate runs. Prints the CPU time for each power of ten of the error (empty
    where a method does not reach it), the cheapest one with *, and recommends a method and a step for each --error.
    --plot draws the diagram; --format csv and json have all runs.

    \b
    Examples:
      bseries cost kepler
      bseries cost kepler --error 1e-8 --plot kepler.png
      bseries cost pendulum --methods stormer-verlet,rk4,gauss3 --span 100 --errors 1e-2:1e-8
      bseries cost henon-heiles --measure energy --error 1e-6 --budget 1
      bseries cost kepler --effect relativity --format json -o kepler.json
      bseries cost --hamiltonian "p^2/2 + q^4/4" --start "p=0;q=1" --methods stormer-verlet,gauss4,mine.toml
    """
    from bseries.advice.work_precision.precision_curves import BUDGET, draw, work_precision

    if start is not None:
        scene = read_start(start, scene)
    limits = _errors(errors)
    goals = [_positive(text, "error") for text in wanted]
    found = work_precision(
        _methods(methods),
        scene,
        span=None if span is None else _positive(span, "span"),
        errors=limits,
        measure=measure,
        budget=BUDGET if budget is None else _positive(budget, "budget"),
        progress=output.progress.update,
    )
    plot.save(lambda: draw(found.curves, found.errors, found.measures, found.title))
    if output.has_records:
        return found.to_table()
    goals = goals or [error for error in USUAL if limits[1] <= error <= limits[0]] or [limits[0]]
    return found.to_table({error: _choice(found, error) for error in goals})


def _methods(text: str | None) -> list[Any] | str:
    """The methods of a list: names, or files with tableaux."""
    if text is None or text.strip() == "all":
        return "auto" if text is None else "all"
    names = (name.strip() for name in text.split(",") if name.strip())
    return [read_method(name, {}, ()) if is_tableau_file(name) else name for name in names]


def _positive(text: str, option: str) -> float:
    number = read_float(text, option)
    if not number > 0:
        raise Refusal(f"{option} must be positive, but was {text!r:.60}")
    return number


def _errors(text: str) -> tuple[float, float]:
    """The two errors of A:B, the larger one first."""
    from bseries.advice.work_precision.precision_curves import check_errors

    pieces = text.split(":")
    if len(pieces) != 2:
        raise Refusal(f"errors must be A:B, as in 1e-3:1e-12, but was {text!r:.60}")
    first, second = sorted((read_float(piece, "errors") for piece in pieces), reverse=True)
    return check_errors((first, second))


def _choice(found: WorkPrecision, error: float) -> Recommendation | str:
    """The recommendation for an error, or why there is none."""
    from integrators import IntegratorError

    try:
        return found.best(error)
    except IntegratorError as refusal:
        return str(refusal)
