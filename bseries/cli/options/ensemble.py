"""Ensembles, `bseries simulate … --ensemble K`: options, runs and summary."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from bseries.cli.application import Refusal, say
from bseries.cli.options.expectation import Expectation
from bseries.cli.options.values import REAL, WholeNumber
from bseries.cli.output import Output
from foundation.table import Table

if TYPE_CHECKING:
    from bseries.advice.predictions.prediction import Prediction
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import PlotFile
    from integrators import Scene
    from integrators.runs.ensemble_results import EnsembleResult

T = TypeVar("T")

LOCAL = "local"


class EnsembleOptions(NamedTuple):
    """The options of an ensemble."""

    members: int
    workers: int | None
    processes: bool
    scheduler: str | None
    seed: int
    temperature: float | None
    spread: float | None
    change: str | None
    keep: int


def takes_ensemble(verb: Callable[..., T]) -> Callable[..., T]:
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
    def read(**options: Any) -> T:
        given = {name: options.pop(name) for name in EnsembleOptions._fields}
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
        given |= {name: given[name] or 0 for name in ("seed", "keep")}
        return verb(many=EnsembleOptions(**given), **options)

    return read


def simulate_ensemble(
    many: EnsembleOptions,
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

    if many.temperature is None:
        sample = perturbed_start(scene, many.spread or 0.0)
    else:
        sample = thermal_momenta(scene, many.temperature)
    watch = Expectation(output.progress, expect, predict, beforehand=False)
    pool: Any = nullcontext("processes" if many.processes else "threads")
    if many.scheduler is not None:
        pool = cluster_executor(None if many.scheduler == LOCAL else many.scheduler, workers=many.workers)
    with pool as executor:
        try:
            result = ensemble(
                method, scene, sample=sample, members=many.members, seed=many.seed,
                change=many.change, keep=many.keep, final=True, executor=executor, workers=many.workers,
                progress=watch, **options,
            )  # fmt: skip
        except KeyboardInterrupt:
            folder = options.get("checkpoint")
            where = f"; the same command continues from {folder}" if folder else ""
            say("warning", f"stopped after {watch.done:,} of {many.members:,} runs{where}")
            raise
    if to is not None:
        result.save(to)
    plot.save(result.plot)
    facts = head("ensemble", method.name, scene, effects)
    return _table(result, many, watch, to, facts, place(method.name, scene, effects))


def _table(
    result: EnsembleResult, many: EnsembleOptions, watch: Expectation, to: str | None, facts: dict[str, Any], where: str
) -> Table:
    """Statistics of each quantity; CSV has them at all times."""
    table = result.to_table()
    data = table.data()
    facts |= {key: data[key] for key in ("h", "steps", "t", "members")}
    facts |= {"seed": many.seed, "change": many.change, "file": to}
    if watch.prediction is not None:
        facts |= {"prediction": watch.prediction.to_dict(), "outcome": watch.outcome(None)}
    facts |= {key: data[key] for key in ("failures", "rows")}
    stored = [] if to is None else [f"{to} has the statistics at all times, and the last states."]
    title = where + table.title[table.title.index(": ") :]
    return table._replace(title=title, notes=[*table.notes, *stored, *watch.notes(None)], data=lambda: facts)
