"""`bseries effects`: influence of the effects of a scene on a run, and their cost."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.expectation import Expectation
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.scene_argument import takes_parts, takes_scene, takes_start
from bseries.cli.options.values import EXACT, WholeNumber, takes_step
from bseries.cli.output import Output, PlotFile, Progress, takes_output, takes_plot
from bseries_base.table import Table

if TYPE_CHECKING:
    from bseries.advice.predictions.prediction import Prediction
    from integrators import Method, Scene


@click.command()
@takes_scene(as_argument=True, compare=True)
@takes_method(as_option=True)
@partial(takes_parts, check=False)
@takes_step
@click.option("--span", metavar="T", type=EXACT, help="The length of the run; without it, only the costs of effects.")
@click.option("--accept", metavar="E", type=EXACT, help="The accepted error; by default, that of the method itself.")
@click.option("--measure", metavar="NAME", help="The error that E bounds: solution (by default) or energy.")
@takes_start
@click.option("--solver", metavar="NAME", default="auto", help="auto, fixed-point, or newton for stiff scenes.")
@click.option("--order", type=WholeNumber(), help="Without --span: the largest number of nodes of trees; by default 6.")
@takes_plot
@takes_output
def effects(
    scene: Scene | str,
    method: Method,
    *,
    effects: Sequence[str],
    span: Any,
    accept: Any,
    measure: str | None,
    order: int | None,
    plot: PlotFile,
    output: Output,
    **options: Any,
) -> Table:
    """Influence and cost of the effects of a scene, and the effects that can be left out.

    Runs the scene with all effects, with each one alone and without each one. Prints the influence of each effect on
    the solution and on the energy (the Hamiltonian without effects), its part of the time of a step, and the error
    of the method itself. Effects whose influence, with a margin, stays below the accepted error are left out, and a run
    without them checks that the result changes by no more than promised.

    Without --span: time for a step and for an evaluation of the field, and how many trees the modified equation needs,
    against the number of effects that are on. --plot draws influences, or times.

    \b
    Examples:
      bseries effects kepler --method rk4 --step 0.02 --span 6 --accept 0.05
      bseries effects kepler --method rk4 --step 0.02 --span 6 --measure energy --effect drag --parameter gamma=1e-6
      bseries effects outer-solar-system --method stormer-verlet --step 20 --span 4000 --effect saturn --effect pluto
      bseries effects kepler --method rk4 --step 0.02 --effect oblateness --effect drag
    """
    from bseries.advice.effects.costs import ORDER, effect_costs
    from bseries.advice.effects.influences import effect_influence
    from bseries.advice.measures import SOLUTION
    from bseries.advice.timing import machine

    options["effects"] = effects or None
    if span is None:
        for name, given in (("accept", accept), ("measure", measure)):
            if given is not None:
                raise Refusal(f"span must be given with --{name}, since influences grow with it, but was not")
        costs = effect_costs(method, scene, order=ORDER if order is None else order, **options)
        plot.save(costs.plot)
        return costs.to_table().extended(machine=machine())
    if order is not None:
        raise Refusal("order must be left out with --span, which counts no trees, but was given")
    watch = FirstRun(output.progress, options["h"], span)
    options |= {"measure": SOLUTION if measure is None else measure, "span": span, "accept": accept, "progress": watch}
    report = effect_influence(method, scene, **options)
    plot.save(report.plot)
    return report.to_table().extended(machine=machine())


class FirstRun:
    """The progress of all runs; their time is predicted from the first one.

    Further runs begin with compilation, which would count as the cost of steps.
    """

    def __init__(self, progress: Progress, h: Any, span: Any):
        self._show, self._h, self._span = progress.update, h, span
        self.watch, self._total = Expectation(progress, self._predict, None), 0

    def __call__(self, done: int, total: int) -> None:
        """Update the number of completed steps; called by `effect_influence`."""
        self._total = total
        (self.watch if done <= self._steps else self._show)(done, total)

    @cached_property
    def _steps(self) -> int:
        from bseries.advice.measures import whole_steps

        return whole_steps(float(self._span), float(self._h))

    def _predict(self, cost: float | None) -> Prediction:
        from bseries.advice.predictions.prediction import time_only

        return time_only(self._h, self._total, "they are the result of the measurement")
