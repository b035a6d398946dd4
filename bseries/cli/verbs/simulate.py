"""`bseries simulate`: many steps of a method on a scene."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal, say
from bseries.cli.options.expectation import Expectation
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.scene_argument import takes_parts, takes_scene, takes_start
from bseries.cli.options.values import REAL, WholeNumber, takes_step
from bseries.cli.output import NO_LATEX, Output, PlotFile, complete_file, takes_output, takes_plot
from bseries_base.table import Table, number_column

if TYPE_CHECKING:
    from bseries.advice.predictions.prediction import Prediction
    from integrators import Method, Scene
    from integrators.runs.ensemble_results import EnsembleResult
    from integrators.runs.trajectory import Trajectory


NAMES = ("members", "workers", "processes", "scheduler", "seed", "temperature", "spread", "change", "keep")
"""Of the options of an ensemble."""


LOCAL = "local"


def takes_ensemble(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Add --ensemble and its options to a verb, which receives them as `many`; None without --ensemble."""

    @click.option("--ensemble", "members", type=WholeNumber(), metavar="K", help="Run from K random starts.")
    @click.option("--temperature", metavar="T", type=REAL, help="Draw the momenta of the starts at this temperature.")
    @click.option("--spread", metavar="S", type=REAL, help="Perturb the scene's start by normal deviates of this size.")
    @click.option("--seed", type=WholeNumber(), help="Seed of the random starts; by default 0.")
    @click.option("--change", metavar="KIND", help="Statistics of changes from each start: absolute or relative.")
    @click.option("--keep", type=WholeNumber(), metavar="K", help="Store the observations of the first K runs in FILE.")
    @click.option("--workers", type=WholeNumber(), metavar="N", help="Threads or processes; by default one per core.")
    @click.option("--processes", is_flag=True, help="Processes instead of threads.")
    @click.option(
        "--scheduler", metavar="ADDRESS",
        help="The cluster of this Dask scheduler, as in tcp://host:8786; or local, for --workers on this machine.",
    )  # fmt: skip
    @functools.wraps(verb)
    def read(**options: Any) -> Any:
        given = {name: options.pop(name) for name in NAMES}
        members, scheduler, spread = given["members"], given["scheduler"], given["spread"]
        if members is None:
            for name, value in given.items():
                if value is not None and value is not False:
                    raise Refusal(f"{name} must come with --ensemble K, but came without")
            return verb(many=None, **options)
        if members < 1:
            raise Refusal(f"ensemble must be a number of runs, 1 or more, but was {members}")
        if (given["temperature"] is None) == (spread is None):
            raise Refusal(
                "ensemble must come with either --temperature or --spread, which define the random starts, "
                f"but came with {'neither' if spread is None else 'both'}"
            )
        local = scheduler in (None, LOCAL)
        if scheduler is not None and (given["processes"] or not (local or given["workers"] is None)):
            raise Refusal("scheduler must come without --processes and, unless it is local, --workers, but did not")
        return verb(many=given | {name: given[name] or 0 for name in ("seed", "keep")}, **options)

    return read


def simulate_ensemble(
    many: dict[str, Any],
    scene: Scene,
    method: Method,
    effects: Sequence[str],
    *,
    to: str | None,
    predict: bool | None,
    plot: PlotFile,
    output: Output,
    **options: Any,
) -> Table:
    """Run an ensemble, store it if a file is given, and summarise it."""
    from bseries.scene_text import head, place
    from integrators.runs.ensembles import cluster_executor, ensemble
    from integrators.runs.random_starts import perturbed_start, thermal_momenta

    def expect(cost: float | None) -> Prediction:
        from bseries.advice.predictions.prediction import time_only

        return time_only(options["h"], options["steps"], "each run has a start of its own")

    if many["temperature"] is None:
        sample = perturbed_start(scene, many["spread"])
    else:
        sample = thermal_momenta(scene, many["temperature"])
    watch = Expectation(output.progress, expect, predict, beforehand=False)
    scheduler, workers, members = many["scheduler"], many["workers"], many["members"]
    pool: Any = nullcontext("processes" if many["processes"] else "threads")
    if scheduler is not None:
        pool = cluster_executor(None if scheduler == LOCAL else scheduler, workers=workers)
    with pool as executor:
        try:
            result = ensemble(
                method, scene, sample=sample, members=members, rng=many["seed"], change=many["change"],
                keep=many["keep"], final=True, executor=executor, workers=workers, progress=watch, **options,
            )  # fmt: skip
        except KeyboardInterrupt:
            folder = options.get("checkpoint")
            where = f"; the same command continues from {folder}" if folder else ""
            say("warning", f"stopped after {watch.done:,} of {members:,} runs{where}")
            raise
    if to is not None:
        result.save(to)
    plot.save(result.plot)
    facts = head("ensemble", method.name, scene, effects)
    return _table(result, many, watch, to, facts, place(method.name, scene, effects))


def _table(
    result: EnsembleResult, many: dict[str, Any], watch: Expectation, to: str | None, facts: dict[str, Any], where: str
) -> Table:
    """Statistics of each quantity; CSV has them at all times."""
    table = result.to_table()
    data = table.data()
    facts |= {key: data[key] for key in ("h", "steps", "t", "members")}
    facts |= {"seed": many["seed"], "change": many["change"], "file": to}
    facts |= watch.to_dict(None) | {key: data[key] for key in ("failures", "rows")}
    stored = [] if to is None else [f"{to} has the statistics at all times, and the last states."]
    title = where + table.title[table.title.index(": ") :]
    return table._replace(title=title, notes=[*table.notes, *stored, *watch.notes(None)], data=lambda: facts)


OBSERVATIONS = 1000
"""The default number of observations of runs that store no states, and of states for a plot of them."""


MOST_ROWS = 60
"""The most rows of printed tables; JSON has all."""


def takes_trajectory_file(write: Callable[..., None]) -> Callable[..., None]:
    """Make -o FILE.npz the trajectory file of a verb, whose summary goes to stdout; other files have the output."""

    @functools.wraps(write)
    def call(*, path: str | None, format_: str | None, **options: Any) -> None:
        if path is not None and path.lower().endswith(".npz"):
            write(path=None, format_=format_ or "table", to=path, **options)
        else:
            write(path=path, format_=format_, to=None, **options)

    return call


@click.command()
@takes_scene(as_argument=True)
@takes_method(as_option=True)
@takes_parts
@takes_step
@click.option("--steps", type=WholeNumber(), help="The number of steps.")
@click.option("--span", metavar="T", help="The time span, instead of --steps; the last step may end later.")
@takes_start
@click.option("--save-every", type=WholeNumber(), metavar="K", help="Store every K-th state in FILE; by default, all.")
@click.option(
    "--observe", "observe", metavar="NAME", multiple=True,
    help="energy, a first integral, or invariants for all that hold; repeatable.",
)  # fmt: skip
@click.option(
    "--observe-every", type=WholeNumber(), metavar="K", help="Observe every K-th state; by default those stored."
)
@click.option("--solver", metavar="NAME", default="auto", help="auto, fixed-point, or newton for stiff scenes.")
@click.option(
    "--checkpoint", metavar="FILE", shell_complete=complete_file, help="Continue from FILE if it exists, and update it."
)
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
    *,
    steps: int | None,
    span: str | None,
    start: dict[str, list[str]] | None,
    save_every: int | None,
    observe: Sequence[str],
    observe_every: int | None,
    predict: bool | None,
    to: str | None,
    many: dict[str, Any] | None,
    plot: PlotFile,
    output: Output,
    **common: Any,
) -> Table:
    """Integrate a scene with a method.

    Prints the initial and final states, and the errors of the energy or of the quantities named by --observe.
    -o FILE.npz stores the trajectory for NumPy: t, y (variables, times), observed/NAME. It is written during the run,
    so it may be larger than memory; -o FILE.csv has a line for each state. --plot draws the changes of observed
    quantities over time, such as the error of the energy; without any, the variables.

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
    from integrators.exact.arguments import step_count
    from integrators.runs.integration import integrate
    from integrators.steppers.states import StepError

    count = step_count(common["h"], steps, span)
    scene = scene if start is None else scene.with_start(**start)
    has_energy = scene.is_hamiltonian or scene.with_effects().is_hamiltonian
    common |= {"steps": count, "observe": list(observe) or ("energy" if has_energy else None)}
    if many is not None:
        if save_every is not None:
            raise Refusal(
                "save-every must be left out with --ensemble, which stores no intermediate states, but was given"
            )
        common |= {"observe_every": observe_every, "to": to, "predict": predict, "plot": plot, "output": output}
        return simulate_ensemble(many, scene, method, effects, **common)
    kept = save_every if save_every is not None or (to is None and not output.has_records) else 1
    if kept is None:
        interval = max(1, count // OBSERVATIONS)
        kept = interval if plot.path is not None and not common["observe"] else None
        observe_every = interval if observe_every is None else observe_every

    def expect(cost: float | None) -> Prediction:
        from bseries.advice.predictions.expected_errors import predict_run

        run = {key: value for key, value in common.items() if key != "checkpoint"}
        return predict_run(method, scene, seconds_per_step=cost, save_every=kept, observe_every=observe_every, **run)

    watch = Expectation(output.progress, expect, predict)
    try:
        run = integrate(method, scene, save_every=kept, observe_every=observe_every, progress=watch, to=to, **common)
    except StepError as error:
        raise Refusal(f"{error}" + (f"; the states before it are in {to}" if to else "")) from None
    except KeyboardInterrupt:
        checkpoint = common["checkpoint"]
        where = f"; the same command continues from {checkpoint}" if checkpoint else f"; {to} has these" if to else ""
        say("warning", f"stopped after {watch.done:,} of {count:,} steps{where}")
        raise
    if output.has_records and run.observed and run.observed_t is not run.t:
        raise Refusal("observe-every must be left out for csv, which has a line for each state, but was given")
    plot.save(lambda: run.plot(y=list(run.observed), change=bool(run.observed)))
    return _summary(run, scene, method, effects, count, watch, to)


def _summary(
    run: Trajectory,
    scene: Scene,
    method: Method,
    effects: Sequence[str],
    steps: int,
    watch: Expectation,
    to: str | None,
) -> Table:
    """The start, the end and the largest changes of a run, its cost, and a comparison with the prediction."""
    from bseries.scene_text import head, place
    from integrators.runs.trajectory import START_AND_END

    records, cost, notes = list(_records(run, scene)), watch.seconds_per_step, list[str]()
    lost = None
    if scene.is_hamiltonian:
        energies = (record for record in records if record["what"] == "energy")
        lost = next((r["change"] if r["relative"] is None else r["relative"] for r in energies), None)
    if run.observed:
        times = f"{len(run.observed_t):,} times"
        notes.append(f"change: the largest distance from the start, at {times}; relative: as a part of the start.")
    if len(records) > MOST_ROWS:
        notes.append(f"The first {MOST_ROWS} of {len(records):,} rows are shown; --format json has them all.")
    if cost is not None:
        notes.append(f"A step took {cost * 1e9:,.0f} ns." if cost < 1e-4 else f"A step took {cost * 1e3:,.2f} ms.")
    if to is not None:
        notes.append(f"{to} has {len(run.t):,} states.")
    facts = {**head("simulation", method.name, scene, effects), "h": run.h, "steps": steps}
    facts |= {"t": [float(run.t[0]), float(run.t[-1])], "seconds_per_step": cost}
    facts |= watch.to_dict(lost) | {"file": to, "rows": records}
    return Table(
        f"{place(method.name, scene, effects)}: {steps:,} steps of {run.h:g}, t = {run.t[0]:g} to {run.t[-1]:g}",
        (*START_AND_END, number_column("relative", ".3g")),
        records[:MOST_ROWS],
        [*notes, *watch.notes(lost)],
        data=lambda: facts,
        items="rows",
        records=run.to_table().records,
    )


def _records(run: Trajectory, scene: Scene) -> Iterator[dict[str, Any]]:
    """The records of the table of a run, with changes relative to the start; None for numbers that are not finite."""
    from bseries.advice.measures import energy_size

    for record in run.to_table().rows:
        if "change" in record:
            change, first = record["change"], record["start"]
            only_rounding = first and record["what"] == "energy" and energy_size(scene, run.y[:, 0]) != abs(first)
            known = change is not None and first and not only_rounding
            record = record | {"relative": change / abs(first) if known else None}
        yield record
