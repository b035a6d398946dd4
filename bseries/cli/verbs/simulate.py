"""`bseries simulate`: many steps of a method on a scene."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli import table
from bseries.cli.application import Refusal, say
from bseries.cli.options.ensemble import simulate_ensemble, takes_ensemble
from bseries.cli.options.expectation import Expectation
from bseries.cli.options.method_argument import complete_method, read_method
from bseries.cli.options.numbers import read_given
from bseries.cli.options.scene_argument import head, place, read_parts, read_start, takes_parts, takes_scene
from bseries.cli.output import NO_LATEX, WholeNumber, takes_output
from bseries.cli.progress import said_warnings
from bseries.cli.table import Column

if TYPE_CHECKING:
    from fractions import Fraction

    from bseries.advice.prediction.prediction import Prediction
    from bseries.cli.options.ensemble import EnsembleOptions
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output
    from integrators import Scene
    from integrators.runs.trajectory import Trajectory

COLUMNS = (Column("what"), Column("start", True), Column("end", True), Column("change", True), Column("relative", True))
LOOKS = 1000
"""How often something is observed where states are not kept."""
MOST_ROWS = 60


def takes_method_option(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Give a verb the option --method and those that go with it; it gets `method`."""

    @click.option(
        "--method", "source", metavar="METHOD", help="A name, a tableau file, or -.", shell_complete=complete_method
    )
    @click.option("--A", "A", metavar="ROWS", help='Stage matrix inline, as in "0,0;1/2,0".')
    @click.option("--b", "b", metavar="ROW", help='Weights inline, as in "0,1".')
    @click.option("--c", "c", metavar="ROW", help="Nodes inline; by default the row sums of A.")
    @click.option(
        "--set", "settings", metavar="NAME=VALUE", multiple=True, help="Value of a parameter of the method; repeatable."
    )
    @functools.wraps(verb)
    def read(*, source: Any, A: Any, b: Any, c: Any, settings: Any, **options: Any) -> Any:
        inline = {key: value for key, value in {"A": A, "b": b, "c": c}.items() if value is not None}
        method = read_method(source, inline, settings)
        if method is None:
            raise Refusal("method must be given: --method with a name such as rk4 or a tableau file, or --A and --b")
        return verb(method=method, **options)

    return read


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
) -> Iterable[str]:
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
    kept = save_every if save_every is not None or (to is None and output.format != "csv") else 1
    if observe_every is None and kept is None:
        observe_every = max(1, count // LOOKS)

    def expect(cost: float | None) -> Prediction:
        from bseries.advice.prediction.prediction import predict_run

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
    return _text(run, scene, method, effects, count, watch, to, output)


def _number(text: str | None, option: str) -> Fraction:
    """The number that an option gives, exactly; irrational ones to as many digits as doubles have."""
    from fractions import Fraction

    value = read_given(text, option)
    return value if isinstance(value, Fraction) else Fraction(float(value))


def _steps(h: Fraction, steps: int | None, span: str | None) -> int:
    """How many steps there are to make."""
    if (steps is None) == (span is None):
        raise Refusal(f"steps or span must be given, but {'neither was' if steps is None else 'both were'}")
    if steps is not None:
        return steps
    length = _number(span, "span")
    if h == 0 or length < 0:
        raise Refusal(f"span must not be negative, and step not zero, but they were {length} and {h}")
    return math.ceil(length / abs(h))


def _energy(scene: Scene) -> str | None:
    """What is observed where nothing is asked for."""
    return "energy" if scene.is_hamiltonian or scene.with_effects().is_hamiltonian else None


def _text(
    run: Trajectory,
    scene: Scene,
    method: Method,
    effects: Sequence[str],
    steps: int,
    watch: Expectation,
    to: str | None,
    output: Output,
) -> Iterable[str]:
    """The answer in any format."""
    if output.format == "csv":
        return _csv(run)
    records, cost = list(_records(run, scene)), watch.seconds_per_step
    lost = _energy_error(records) if scene.is_hamiltonian else None
    title = f"{place(method, scene, effects)}: {steps:,} steps of {run.h:g}, t = {run.t[0]:g} to {run.t[-1]:g}"
    if output.format == "json":
        facts = head("simulation", method, scene, effects)
        facts |= {"h": run.h, "steps": steps, "t": [float(run.t[0]), float(run.t[-1])], "seconds_per_step": cost}
        if watch.prediction is not None:
            facts |= {"prediction": watch.prediction.to_dict(), "outcome": watch.outcome(lost)}
        return [table.json({**facts, "file": to, "rows": records}, "rows")]
    rows = [_row(record) for record in records]
    notes = [*_notes(run, rows, cost, to), *watch.notes(lost)]
    shown = rows[:MOST_ROWS]
    if output.format == "markdown":
        return [table.markdown(COLUMNS, shown, title=title, notes=notes)]
    text = table.text(COLUMNS, shown, output.width)
    return [table.paragraphs([title, ""], output.width), text, table.paragraphs(["", *notes], output.width)]


def _records(run: Trajectory, scene: Scene) -> Iterator[dict[str, Any]]:
    """What was observed and all variables, at the start and at the end; None for numbers that are not finite."""
    for name, values in run.observed.items():
        first, last = _finite(values[0]), _finite(values[-1])
        change = None if first is None else _finite(abs(values - first).max())
        is_size = first and not (name == "energy" and _is_rounding(first, run, scene))
        relative = change / abs(first) if change is not None and first and is_size else None
        yield {"what": name, "start": first, "end": last, "change": change, "relative": relative}
    for name, values in zip(run.variables, run.y, strict=True):
        yield {"what": name, "start": float(values[0]), "end": float(values[-1])}


def _is_rounding(energy: float, run: Trajectory, scene: Scene) -> bool:
    """Whether an energy at the start would be 0 but for rounding, so that nothing is relative to it."""
    from bseries.advice.distances import energy_size

    return energy_size(scene, run.y[:, 0]) != abs(energy)


def _energy_error(records: Sequence[dict[str, Any]]) -> float | None:
    """The largest change of the energy, relative to the start if that is not 0 but for rounding."""
    for record in records:
        if record["what"] == "energy":
            return record["change"] if record["relative"] is None else record["relative"]
    return None


def _finite(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None


def _row(record: dict[str, Any]) -> table.Row:
    forms = {"start": ".15g", "end": ".15g", "change": ".3g", "relative": ".3g"}
    cells = ("" if record.get(key) is None else format(record[key], form) for key, form in forms.items())
    return [record["what"], *cells]


def _notes(run: Trajectory, rows: Sequence[table.Row], cost: float | None, to: str | None) -> Iterator[str]:
    if run.observed:
        count = len(run.observed_t)
        yield f"change: the largest distance from the start, at {count:,} times; relative: as a part of the start."
    if len(rows) > MOST_ROWS:
        yield f"The first {MOST_ROWS} of {len(rows):,} rows are shown; --format json has them all."
    if cost is not None:
        yield f"A step took {cost * 1e9:,.0f} ns." if cost < 1e-4 else f"A step took {cost * 1e3:,.2f} ms."
    if to is not None:
        yield f"{to} has {len(run.t):,} states."


def _csv(run: Trajectory) -> Iterator[str]:
    """The trajectory, a line for each time."""
    if run.observed and run.observed_t is not run.t:
        raise Refusal("observe-every must be left out for csv, which has a line for each state, but was given")
    columns = [run.t, *run.y, *run.observed.values()]
    lines = ([repr(float(column[k])) for column in columns] for k in range(len(run.t)))
    return table.csv(["t", *run.variables, *run.observed], lines)
