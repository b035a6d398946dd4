"""`bseries simulate`: many steps of a method on a scene."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal, say
from bseries.cli.options.ensemble import simulate_ensemble, takes_ensemble
from bseries.cli.options.expectation import Expectation
from bseries.cli.options.method_argument import takes_method_option
from bseries.cli.options.numbers import read_given
from bseries.cli.options.scene_argument import read_parts, read_start, takes_parts, takes_scene
from bseries.cli.output import NO_LATEX, WholeNumber, takes_output
from bseries.cli.progress import said_warnings

if TYPE_CHECKING:
    from fractions import Fraction

    from bseries.advice.prediction.run_prediction import Prediction
    from bseries.cli.options.ensemble import EnsembleOptions
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output
    from bseries.table import Table
    from integrators import Scene

LOOKS = 1000
"""The number of observations where states are not kept."""


def takes_trajectory_file(write: Callable[..., None]) -> Callable[..., None]:
    """Let -o be the file of the trajectory; the summary goes to stdout in any case."""

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
@click.option("--step", metavar="H", help="The step size, as in 0.1 or 1/10; negative backwards in time.")
@click.option("--steps", type=WholeNumber(), help="How many steps.")
@click.option("--span", metavar="T", help="How long, instead of --steps; the last step may go beyond.")
@click.option("--start", metavar="TEXT", help='Start values by block, as in "p=0;q=-3/2".')
@click.option("--save-every", type=WholeNumber(), metavar="K", help="Keep every K-th state in FILE; by default, all.")
@click.option(
    "--observe", "observe", metavar="NAME", multiple=True,
    help="energy, a first integral, or invariants for all of these that hold; repeatable.",
)  # fmt: skip
@click.option("--observe-every", type=WholeNumber(), metavar="K", help="Observe every K-th state, not those kept.")
@click.option("--solver", metavar="NAME", default="auto", help="auto, fixed-point, or newton for stiff scenes.")
@click.option("--checkpoint", metavar="FILE", help="Go on from FILE if it is there, and write it meanwhile.")
@click.option(
    "--predict/--no-predict",
    "predict",
    default=None,
    help="Say beforehand how long it takes and what errors to expect; by default of runs longer than some seconds.",
)
@takes_ensemble
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
    output: Output,
) -> Table:
    """Many steps of a method on a scene.

    Prints where the run began and ended, and what became of the energy or of what --observe names. -o FILE.npz keeps
    the trajectory, which NumPy reads: t, y (variables, times), observed/NAME. It is written while the run lasts, so
    that it may be larger than memory; --format csv prints it.

    With --ensemble K there are K runs, from random starts that --temperature or --spread describe, on all cores; the
    answer is statistics of what is observed, the same whoever computes them. --checkpoint then names a folder.

    Of a run that takes more than some seconds a line on stderr says beforehand how long it will take, and what errors
    of energy and solution to expect from the modified equation; the notes say how well that was met.

    With --checkpoint, a run that was stopped in any way goes on when the same command is given again, and ends as if it
    had never been stopped.

    \b
    Examples:
      bseries simulate pendulum --method stormer-verlet --step 0.1 --steps 1000
      bseries simulate kepler --method gauss3 --step 1/100 --span 20 --observe energy --observe angular_momentum
      bseries simulate pendulum --method rk4 --effect damping --step 0.1 --steps 50 --format csv
      bseries simulate toda --method yoshida6 --step 0.05 --steps 2000 --save-every 10 -o toda.npz
      bseries simulate --hamiltonian "p^2/2 + q^4/4" --start "p=0;q=1" --method gauss2 --step 0.1 --steps 100
      bseries simulate lennard-jones --method stormer-verlet --step 0.005 --steps 2000 --ensemble 400 --temperature 0.1
    """
    from bseries.advice.run_summary import run_summary
    from integrators.runs.integration import integrate
    from integrators.steppers.states import StepError

    h = _number(step, "step")
    count = _steps(h, steps, span)
    if start is not None:
        scene = read_start(start, scene)
    common: dict[str, Any] = {
        "h": h,
        "steps": count,
        "parts": None if parts is None else read_parts(parts, method, scene),
        "observe": list(observe) or _energy(scene),
        "solver": solver,
        "checkpoint": checkpoint,
    }
    if many is not None:
        if save_every is not None:
            raise Refusal(
                "save-every must be left out with --ensemble, which keeps no states on the way, but was given"
            )
        return simulate_ensemble(
            many, scene, method, effects, observe_every=observe_every, to=to, predict=predict, output=output, **common
        )
    kept = save_every if save_every is not None or (to is None and not output.has_records) else 1
    if observe_every is None and kept is None:
        observe_every = max(1, count // LOOKS)

    def expect(cost: float | None) -> Prediction:
        from bseries.advice.prediction.run_prediction import predict_run

        run = {key: value for key, value in common.items() if key != "checkpoint"}
        return predict_run(scene, method, seconds_per_step=cost, save_every=kept, observe_every=observe_every, **run)

    watch = Expectation(output.progress, expect, predict)
    try:
        with said_warnings():
            run = integrate(
                scene, method, save_every=kept, observe_every=observe_every, progress=watch, to=to, **common
            )
    except StepError as error:
        raise Refusal(f"{error}" + (f"; what was kept is in {to}" if to else "")) from None
    except KeyboardInterrupt:
        where = f"; the same command goes on from {checkpoint}" if checkpoint else f"; {to} ends there" if to else ""
        say("warning", f"stopped after {watch.done:,} of {count:,} steps{where}")
        raise
    if output.has_records and run.observed and run.observed_t is not run.t:
        raise Refusal("observe-every must be left out for csv, which has a line for each state, but was given")
    return _with_outcome(run_summary(run, scene, method.name, count, effects=effects), scene, watch, to, len(run.t))


def _number(text: str | None, option: str) -> Fraction:
    """The number that an option gives, exactly; irrational ones to as many digits as doubles have."""
    from fractions import Fraction

    value = read_given(text, option)
    return value if isinstance(value, Fraction) else Fraction(float(value))


def _steps(h: Fraction, steps: int | None, span: str | None) -> int:
    """The number of steps."""
    if (steps is None) == (span is None):
        raise Refusal(f"steps or span must be given, but {'neither was' if steps is None else 'both were'}")
    if steps is not None:
        return steps
    length = _number(span, "span")
    if h == 0 or length < 0:
        raise Refusal(f"span must not be negative, and step not zero, but they were {length} and {h}")
    return math.ceil(length / abs(h))


def _energy(scene: Scene) -> str | None:
    """The default of --observe."""
    return "energy" if scene.is_hamiltonian or scene.with_effects().is_hamiltonian else None


def _with_outcome(summary: Table, scene: Scene, watch: Expectation, to: str | None, states: int) -> Table:
    """The summary of a run with its cost and its file, and with errors and times beside the expected ones."""
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
