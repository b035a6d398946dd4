"""`bseries effects`: which effects of a scene matter for a run, and what they cost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import click

from ..advice.durations import whole_steps
from ..advice.measures import SOLUTION
from . import layout
from .application import Refusal
from .effects_output import write_costs, write_report
from .expectation import Expectation
from .number_option import read_given
from .output import WholeNumber, takes_output
from .scene_argument import (
    complete_effect,
    complete_scene,
    is_path,
    load_file,
    read_part_names,
    read_start_values,
    read_values,
    takes_parts,
)
from .simulate_verb import takes_method_option

if TYPE_CHECKING:
    from ..advice.prediction import Prediction
    from .method_argument import Method
    from .output import Output
    from .progress import Progress


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
    from ..advice.effect_influences import effect_influence
    from ..advice.machine import machine

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
        return [layout.json({**report.to_dict(), "machine": machine()}, "rows")]
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
        from ..advice.prediction import time_only

        return time_only(self._h, self._total, "they are what is to be measured")


def _costs(scene: Any, method: Method, common: dict[str, Any], order: int | None, output: Output) -> Iterable[str]:
    """What effects cost, in any format."""
    from ..advice.effect_cost_rows import ORDER, effect_costs
    from ..advice.machine import machine

    costs = effect_costs(scene, method, order=ORDER if order is None else order, **common)
    if output.format == "json":
        return [layout.json({**costs.to_dict(), "machine": machine()}, "rows")]
    return write_costs(costs, output)
