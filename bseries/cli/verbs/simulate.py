"""`bseries simulate`: many steps of a method on a scene."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal, say
from bseries.cli.options.ensemble import simulate_ensemble, takes_ensemble
from bseries.cli.options.expectation import Expectation
from bseries.cli.options.method_argument import takes_method_option
from bseries.cli.options.numbers import read_given
from bseries.cli.options.plot import takes_plot
from bseries.cli.options.scene_argument import read_parts, read_start, takes_parts, takes_scene
from bseries.cli.output import NO_LATEX, WholeNumber, takes_output

if TYPE_CHECKING:
    from fractions import Fraction

    from bseries.advice.predictions.prediction import Prediction
    from bseries.cli.options.ensemble import EnsembleOptions
    from bseries.cli.options.method_argument import Method
    from bseries.cli.options.plot import PlotFile
    from bseries.cli.output import Output
    from foundation.table import Table
    from integrators import Scene

OBSERVATIONS = 1000
"""The default number of observations of runs that store no states, and of states for a plot of them."""


def takes_trajectory_file(write: Callable[..., None]) -> Callable[..., None]:
    """Make -o the trajectory file of a verb; the summary is always written to stdout."""

    @functools.wraps(write)
    def call(*, path: str | None, format_: str | None, **options: Any) -> None:
        if path is not None and not path.lower().endswith(".npz"):
            raise Refusal(f"output must end in .npz, but was {path!r:.60}; the summary goes to stdout")
        write(path=None, format_=format_ or "table", to=path, **options)

    return call


@click.command()
@takes_scene(as_argument=True)
@takes_method_option
@takes_parts
@click.option("--step", metavar="H", help="The step size, as in 0.1 or 1/10; negative to integrate backwards.")
@click.option("--steps", type=WholeNumber(), help="The number of steps.")
@click.option("--span", metavar="T", help="The time span, instead of --steps; the last step may end later.")
@click.option("--start", metavar="TEXT", help='Start values by block, as in "p=0;q=-3/2".')
@click.option("--save-every", type=WholeNumber(), metavar="K", help="Store every K-th state in FILE; by default, all.")
@click.option(
    "--observe", "observe", metavar="NAME", multiple=True,
    help="energy, a first integral, or invariants for all that hold; repeatable.",
)  # fmt: skip
@click.option(
    "--observe-every", type=WholeNumber(), metavar="K", help="Observe every K-th state; by default those stored."
)
@click.option("--solver", metavar="NAME", default="auto", help="auto, fixed-point, or newton for stiff scenes.")
@click.option("--checkpoint", metavar="FILE", help="Continue from FILE if it exists, and update it.")
@click.option(
    "--predict/--no-predict",
    "predict",
    default=None,
    help="Predict time and errors first; by default for runs of more than a few seconds.",
)
@takes_ensemble
@takes_plot
@takes_trajectory_file
@functools.partial(takes_output, formats=NO_LATEX)
def simulate(
    scene: Scene,
    method: Method,
    effects: Sequence[str],
    parts: str | None,
    step: str | None,
    steps: int | None,
    span: str | None,
    start: str | None,
    save_every: int | None,
    observe: Sequence[str],
    observe_every: int | None,
    solver: str,
    checkpoint: str | None,
    predict: bool | None,
    to: str | None,
    many: EnsembleOptions | None,
    plot: PlotFile,
    output: Output,
) -> Table:
    """Integrate a scene with a method.

    Prints the initial and final states, and the errors of the energy or of the quantities named by --observe.
    -o FILE.npz stores the trajectory for NumPy: t, y (variables, times), observed/NAME. It is written during the run,
    so it may be larger than memory; --format csv prints it. --plot draws the changes of observed quantities over time,
    such as the error of the energy; without any, the variables.

    --ensemble K integrates from K random starts, given by --temperature or --spread, on all cores. The result is
    statistics of the observed quantities; they do not depend on the number of cores. --checkpoint then names a folder.

    Before a run of more than a few seconds, a line on stderr predicts its time, and the errors of energy and solution
    from the modified equation. The notes below the result compare them with the outcome.

    With --checkpoint, an interrupted run continues when the same command is given again, with the same result.

    \b
    Examples:
      bseries simulate pendulum --method stormer-verlet --step 0.1 --steps 1000
      bseries simulate kepler --method rk4 --step 1/100 --span 200 --plot energy.pdf
      bseries simulate kepler --method gauss3 --step 1/100 --span 20 --observe energy --observe angular_momentum
      bseries simulate pendulum --method rk4 --effect damping --step 0.1 --steps 50 --format csv
      bseries simulate toda --method yoshida6 --step 0.05 --steps 2000 --save-every 10 -o toda.npz
      bseries simulate --hamiltonian "p^2/2 + q^4/4" --start "p=0;q=1" --method gauss2 --step 0.1 --steps 100
      bseries simulate lennard-jones --method stormer-verlet --step 0.005 --steps 2000 --ensemble 400 --temperature 0.1
    """
    from bseries.advice.run_summary import run_summary
    from integrators.exact.arguments import step_count
    from integrators.runs.integration import integrate
    from integrators.steppers.states import StepError

    h = _number(step, "step")
    count = step_count(h, steps, span)
    if start is not None:
        scene = read_start(start, scene)
    common: dict[str, Any] = {
        "h": h,
        "steps": count,
        "parts": read_parts(parts, method, scene),
        "observe": list(observe) or _energy(scene),
        "solver": solver,
        "checkpoint": checkpoint,
    }
    if many is not None:
        if save_every is not None:
            raise Refusal(
                "save-every must be left out with --ensemble, which stores no intermediate states, but was given"
            )
        return simulate_ensemble(
            many,
            scene,
            method,
            effects,
            observe_every=observe_every,
            to=to,
            predict=predict,
            plot=plot,
            output=output,
            **common,
        )
    kept = save_every if save_every is not None or (to is None and not output.has_records) else 1
    if kept is None:
        kept, observe_every = _few(count, observe_every, of_states=plot.path is not None and not common["observe"])

    def expect(cost: float | None) -> Prediction:
        from bseries.advice.predictions.run_prediction import predict_run

        run = {key: value for key, value in common.items() if key != "checkpoint"}
        return predict_run(method, scene, seconds_per_step=cost, save_every=kept, observe_every=observe_every, **run)

    watch = Expectation(output.progress, expect, predict)
    try:
        run = integrate(method, scene, save_every=kept, observe_every=observe_every, progress=watch, to=to, **common)
    except StepError as error:
        raise Refusal(f"{error}" + (f"; the states before it are in {to}" if to else "")) from None
    except KeyboardInterrupt:
        where = f"; the same command continues from {checkpoint}" if checkpoint else f"; {to} has these" if to else ""
        say("warning", f"stopped after {watch.done:,} of {count:,} steps{where}")
        raise
    if output.has_records and run.observed and run.observed_t is not run.t:
        raise Refusal("observe-every must be left out for csv, which has a line for each state, but was given")
    plot.save(lambda: run.plot(y=list(run.observed), change=bool(run.observed)))
    return _with_outcome(run_summary(run, scene, method.name, count, effects=effects), scene, watch, to, len(run.t))


def _number(text: str | None, option: str) -> Fraction:
    """The number given by an option: exact if it is rational, else rounded to a double."""
    from fractions import Fraction

    value = read_given(text, option)
    return value if isinstance(value, Fraction) else Fraction(float(value))


def _few(count: int, observe_every: int | None, *, of_states: bool) -> tuple[int | None, int | None]:
    """Intervals of stored states and of observations where no states are asked for."""
    interval = max(1, count // OBSERVATIONS)
    return interval if of_states else None, interval if observe_every is None else observe_every


def _energy(scene: Scene) -> str | None:
    """The default of --observe."""
    return "energy" if scene.is_hamiltonian or scene.with_effects().is_hamiltonian else None


def _with_outcome(summary: Table, scene: Scene, watch: Expectation, to: str | None, states: int) -> Table:
    """The summary of a run with its cost, its file, and a comparison with the prediction."""
    from bseries.advice.run_summary import energy_error

    facts = dict(summary.data())
    records, cost = facts.pop("rows"), watch.seconds_per_step
    lost = energy_error(records) if scene.is_hamiltonian else None
    notes = []
    if cost is not None:
        notes.append(f"A step took {cost * 1e9:,.0f} ns." if cost < 1e-4 else f"A step took {cost * 1e3:,.2f} ms.")
    if to is not None:
        notes.append(f"{to} has {states:,} states.")
    facts["seconds_per_step"] = cost
    if watch.prediction is not None:
        facts |= {"prediction": watch.prediction.to_dict(), "outcome": watch.outcome(lost)}
    facts |= {"file": to, "rows": records}
    return summary.extended([*notes, *watch.notes(lost)])._replace(data=lambda: facts)
