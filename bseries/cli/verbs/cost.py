"""`bseries cost`: what accuracy costs on a scene, and which method and step to take."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import SUFFIXES, read_method
from bseries.cli.options.scene_argument import takes_scene, takes_start
from bseries.cli.options.values import POSITIVE, REAL, is_file
from bseries.cli.output import NO_LATEX, Output, PlotFile, takes_output, takes_plot
from bseries_base.table import Table

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
@click.option("--span", metavar="T", type=POSITIVE, help="How long runs are; by default, some periods of the motion.")
@takes_start
@click.option("--errors", metavar="A:B", default="1e-3:1e-12", show_default=True, help="The errors of interest.")
@click.option("--measure", metavar="NAME", default="all", help="solution or energy; by default, both.")
@click.option(
    "--error", "wanted", metavar="E", type=POSITIVE, multiple=True,
    help="An accuracy to recommend a method for; repeatable.",
)  # fmt: skip
@click.option("--against", metavar="WHAT", default="seconds", help="The cost in --plot: seconds, or evaluations of f.")
@click.option("--budget", metavar="S", type=POSITIVE, help="CPU seconds for the longest run; by default, 0.2.")
@takes_plot
@functools.partial(takes_output, formats=NO_LATEX)
def cost(
    scene: Scene,
    *,
    effects: object,
    methods: str | None,
    start: dict[str, list[str]] | None,
    errors: str,
    wanted: Sequence[float],
    against: str,
    budget: float | None,
    plot: PlotFile,
    output: Output,
    **options: Any,
) -> Table:
    """CPU time against error on a scene, for many methods and steps.

    Runs methods that suit the scene over a range of steps, measures errors of the solution (against a reference) and
    of the energy, and times the steps in separate runs. Prints the CPU time for each power of ten of the error (empty
    where a method does not reach it), the cheapest one with *, and recommends a method and a step for each --error.
    --plot draws the diagram; --format csv and json have all runs, with evaluations of f, too.

    \b
    Examples:
      bseries cost kepler
      bseries cost kepler --error 1e-8 --plot kepler.png
      bseries cost pendulum --methods stormer-verlet,rk4,gauss3 --span 100 --errors 1e-2:1e-8
      bseries cost henon-heiles --measure energy --error 1e-6 --budget 1
      bseries cost kepler --effect relativity --format json -o kepler.json
      bseries cost --hamiltonian "p^2/2 + q^4/4" --start "p=0;q=1" --methods stormer-verlet,gauss4,mine.toml
    """
    from bseries.advice.work_precision.precision_curves import BUDGET, COSTS, check_errors, draw, work_precision

    if against not in COSTS:
        raise Refusal(f"against must be one of {', '.join(COSTS)}, but was {against!r:.60}")
    if against != "seconds" and plot.path is None:
        raise Refusal("against must come with --plot, but came without; --format csv has both costs")
    scene = scene if start is None else scene.with_start(**start)
    pieces = errors.split(":")
    if len(pieces) != 2:
        raise Refusal(f"errors must be A:B, as in 1e-3:1e-12, but was {errors!r:.60}")
    loosest, finest = check_errors(sorted((REAL.read(piece, "errors") for piece in pieces), reverse=True))
    options |= {"errors": (loosest, finest), "budget": budget or BUDGET, "progress": output.progress.update}
    names = [name.strip() for name in (methods or "").split(",") if name.strip()]
    given: Any = [read_method(name) if is_file(name, SUFFIXES) else name for name in names]
    chosen = "auto" if methods is None else "all" if names == ["all"] else given
    found = work_precision(chosen, scene, **options)
    plot.save(lambda: draw(found.curves, found.errors, found.measures, found.title, against))
    if output.has_records:
        return found.to_table()
    goals = wanted or [error for error in USUAL if finest <= error <= loosest] or [loosest]
    return found.to_table({error: _choice(found, error) for error in goals})


def _choice(found: WorkPrecision, error: float) -> Recommendation | str:
    """The recommendation for an error, or why there is none."""
    from integrators import IntegratorError

    try:
        return found.best(error)
    except IntegratorError as refusal:
        return str(refusal)
