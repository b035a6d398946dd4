"""`bseries effects`: which effects of a scene matter for a run, and what they cost."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import click

from bseries.advice.measures import SOLUTION, whole_steps
from bseries.cli import table
from bseries.cli.application import Refusal
from bseries.cli.options.expectation import Expectation
from bseries.cli.options.numbers import read_given
from bseries.cli.options.scene_argument import (
    complete_effect,
    complete_scene,
    is_path,
    load_file,
    read_part_names,
    read_start_values,
    read_values,
    takes_parts,
)
from bseries.cli.output import WholeNumber, takes_output
from bseries.cli.table import Column
from bseries.cli.verbs.simulate import takes_method_option

if TYPE_CHECKING:
    from bseries.advice.effects.costs import CostRow, EffectCosts
    from bseries.advice.effects.report import EffectReport, EffectRow, Influence
    from bseries.advice.prediction.prediction import Prediction
    from bseries.advice.timing import Timing
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output
    from bseries.cli.progress import Progress


COLUMNS = (
    Column("effect"),
    Column("solution", True),
    Column("energy", True),
    Column("alone", True),
    Column("step", True),
    Column("±", True),
    Column("advice"),
)
COST_COLUMNS = (
    Column("on", True),
    Column("effects"),
    Column("step", True),
    Column("±", True),
    Column("field", True),
    Column("±", True),
    Column("trees", True),
    Column("of", True),
)
EXPLANATION = (
    "solution, energy: what leaving an effect out of all changes, relative to the size of the state and to the energy "
    "at the start; alone: what it does to the solution by itself; step: CPU time that it adds to a step."
)
CSV = (
    *("effect", "solution", "energy", "alone_solution", "alone_energy"),
    *("seconds", "uncertainty", "leave_out"),
)
COST_CSV = (
    *("on", "effects", "step_seconds", "step_low", "step_high", "field_seconds", "field_low", "field_high"),
    *("trees", "all_trees"),
)


def write_report(report: EffectReport, output: Output) -> Iterable[str]:
    """Influences, their costs and the recommendation, in any format but JSON."""
    if output.format == "csv":
        return table.csv(CSV, _report_values(report))
    title = f"Effects of {report.scene}, {report.method}: {report.steps:,} steps of {report.h:g}"
    return _written(output, COLUMNS, list(_rows(report)), title, [EXPLANATION, *_times(report), *report.advice()])


def write_costs(costs: EffectCosts, output: Output) -> Iterable[str]:
    """What effects cost, in any format but JSON."""
    if output.format == "csv":
        return table.csv(COST_CSV, map(_cost_values, costs))
    notes = [
        "step, field: CPU time for a step and for an evaluation of the field; ±: half the distance of the quartiles.",
        f"trees: those to order {costs.order} that the modified equation of {costs.method} needs there.",
    ]
    title = f"Cost of effects of {costs.scene}, {costs.method}"
    return _written(output, COST_COLUMNS, list(map(_cost_row, costs)), title, notes)


def _written(
    output: Output, columns: Sequence[Column], rows: Sequence[table.Row], title: str, notes: Sequence[str]
) -> Iterable[str]:
    if output.format == "latex":
        return [table.latex(columns, (list(map(table.latex_text, row)) for row in rows))]
    return output.listing(columns, rows, title, notes)


def _report_values(report: EffectReport) -> Iterator[table.Row]:
    """The numbers of each effect, and in a row without a name the error of the method."""
    for row in report.rows:
        leave_out = str(row.name in report.leave_out).lower()
        yield table.values(row.name, *row.left_out, *row.alone, row.seconds, row.uncertainty, leave_out)
    yield table.values(None, *report.own_error, None, None, None, None, None)


def _cost_values(row: CostRow) -> table.Row:
    """The numbers of some effects; names are separated by spaces."""
    times = (*row.step[:3], *row.field[:3])
    return table.values(len(row.effects), " ".join(row.effects), *times, row.trees, row.all_trees)


def _rows(report: EffectReport) -> Iterator[table.Row]:
    """A row for each effect, and one for the method itself."""
    for row in report.rows:
        kept = "leave out" if row.name in report.leave_out else "keep"
        yield [row.name, *_influence(row.left_out), f"{row.alone.solution:.2g}", *_added(row), kept]
    yield ["(error of the method)", *_influence(report.own_error), "", "", "", ""]


def _influence(found: Influence) -> list[str]:
    return [f"{found.solution:.2g}", "" if found.energy is None else f"{found.energy:.2g}"]


def _added(row: EffectRow) -> list[str]:
    return ["", ""] if row.seconds is None else [f"{row.seconds * 1e9:+.1f} ns", f"{(row.uncertainty or 0) * 1e9:.1f}"]


def _times(report: EffectReport) -> Iterator[str]:
    """What steps cost with no effects, all, and those that are recommended."""
    times = ((name, found) for name, found in report.times.items() if found is not None)
    yield "A step takes " + ", ".join(f"{found.seconds * 1e9:,.1f} ns with {name}" for name, found in times) + "."


def _cost_row(row: CostRow) -> table.Row:
    trees = ["" if count is None else f"{count:,}" for count in (row.trees, row.all_trees)]
    return [str(len(row.effects)), ", ".join(row.effects), *_timing(row.step), *_timing(row.field), *trees]


def _timing(found: Timing) -> list[str]:
    return [f"{found.seconds * 1e9:,.1f} ns", f"{(found.high - found.low) / 2 * 1e9:.1f}"]


@click.command()
@click.argument("scene_source", metavar="SCENE", required=False, shell_complete=complete_scene)
@takes_method_option
@takes_parts
@click.option("--step", metavar="H", help="The step size, as in 0.1 or 1/10; negative backwards in time.")
@click.option("--span", metavar="T", help="How long the run is; without it, only what effects cost.")
@click.option("--accept", metavar="E", help="The error that is accepted; by default, that of the method itself.")
@click.option("--measure", metavar="NAME", help="What E is an error of: solution (by default) or energy.")
@click.option(
    "--effect", "effects", metavar="NAME", multiple=True, shell_complete=complete_effect,
    help="An effect to look at; repeatable; by default, all.",
)  # fmt: skip
@click.option(
    "--parameter", "parameters", metavar="NAME=VALUE", multiple=True,
    help="Value of a parameter or option of the scene or of an effect; repeatable.",
)  # fmt: skip
@click.option("--start", metavar="TEXT", help='Start values by block, as in "p=0;q=-3/2".')
@click.option("--solver", metavar="NAME", default="auto", help="auto, fixed-point, or newton for stiff scenes.")
@click.option("--order", type=WholeNumber(), help="Without --span: how many nodes trees have at most; by default 6.")
@takes_output
def effects(
    scene_source: str | None,
    method: Method,
    parts: str | None,
    step: str | None,
    span: str | None,
    accept: str | None,
    measure: str | None,
    effects: Sequence[str],
    parameters: Sequence[str],
    start: str | None,
    solver: str,
    order: int | None,
    output: Output,
) -> Iterable[str]:
    """Which effects of a scene matter, what they cost, and which can be left out.

    Runs the scene with all effects, with each one alone and without each one, and compares: what an effect changes in
    the solution and in the energy (the Hamiltonian without effects), what it adds to the time of a step, and the error
    of the method itself. Effects whose influence, with a margin, stays below the accepted error are left out, and a run
    without them checks that the result changes by no more than promised.

    Without --span: time for a step and for an evaluation of the field, and how many trees the modified equation needs,
    against the number of effects that are on.

    \b
    Examples:
      bseries effects kepler --method rk4 --step 0.02 --span 6 --accept 0.05
      bseries effects kepler --method rk4 --step 0.02 --span 6 --measure energy --effect drag --parameter gamma=1e-6
      bseries effects outer-solar-system --method stormer-verlet --step 20 --span 4000 --effect saturn --effect pluto
      bseries effects kepler --method rk4 --step 0.02 --effect oblateness --effect drag
    """
    if scene_source is None:
        raise Refusal("SCENE must be given: a name from `bseries scenes`, a .toml file, or - for one on standard input")
    common: dict[str, Any] = {
        "h": read_given(step, "step"),
        "effects": effects or None,
        "parameters": read_values(parameters),
        "start": None if start is None else read_start_values(start),
        "parts": None if parts is None else read_part_names(parts),
        "solver": solver,
    }
    scene = load_file(scene_source) if is_path(scene_source) else scene_source
    if span is None:
        for name, given in (("accept", accept), ("measure", measure)):
            if given is not None:
                raise Refusal(f"span must be given with --{name}, since influences grow with it, but was not")
        return _costs(scene, method, common, order, output)
    if order is not None:
        raise Refusal("order must be left out with --span, which looks at no trees, but was given")
    from bseries.advice.effects.influences import effect_influence
    from bseries.advice.timing import machine

    length = read_given(span, "span")
    report = effect_influence(
        scene,
        method,
        span=length,
        accept=None if accept is None else read_given(accept, "accept"),
        measure=SOLUTION if measure is None else measure,
        progress=FirstRun(output.progress, common["h"], length),
        **common,
    )
    if output.format == "json":
        return [table.json({**report.to_dict(), "machine": machine()}, "rows")]
    return write_report(report, output)


class FirstRun:
    """The progress of all runs, of which the first tells how long they will take.

    Before each further one there is something to compile, which steps would seem to cost.

    Args:
        progress: Shows progress, and says what is expected.
        h: The step size.
        span: How long a run is.

    Attributes:
        watch: What is expected, from the first run.
    """

    def __init__(self, progress: Progress, h: Any, span: Any):
        self._show, self._h, self._span = progress.update, h, span
        self.watch, self._total = Expectation(progress, self._predict, None), 0

    def __call__(self, done: int, total: int) -> None:
        """Note how many steps are made of all; what `effect_influence` calls."""
        self._total = total
        (self.watch if done <= self._steps else self._show)(done, total)

    @cached_property
    def _steps(self) -> int:
        return whole_steps(float(self._span), float(self._h))

    def _predict(self, cost: float | None) -> Prediction:
        from bseries.advice.prediction.prediction import time_only

        return time_only(self._h, self._total, "they are what is to be measured")


def _costs(scene: Any, method: Method, common: dict[str, Any], order: int | None, output: Output) -> Iterable[str]:
    """What effects cost, in any format."""
    from bseries.advice.effects.costs import ORDER, effect_costs
    from bseries.advice.timing import machine

    costs = effect_costs(scene, method, order=ORDER if order is None else order, **common)
    if output.format == "json":
        return [table.json({**costs.to_dict(), "machine": machine()}, "rows")]
    return write_costs(costs, output)
