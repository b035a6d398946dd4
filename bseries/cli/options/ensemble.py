"""Ensembles, `bseries simulate … --ensemble K`: options, runs and summary."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from bseries.cli.application import Refusal, say
from bseries.cli.options.expectation import Expectation
from bseries.cli.options.numbers import read_float
from bseries.cli.output import WholeNumber
from bseries.cli.progress import said_warnings
from bseries.table import Column, LazyRows, Table

if TYPE_CHECKING:
    from bseries.advice.prediction.run_prediction import Prediction
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output
    from integrators import Scene
    from integrators.runs.ensemble_results import EnsembleResult

T = TypeVar("T")

COLUMNS = (
    Column("what"), Column("mean at start", True), Column("mean at end", True), Column("std at end", True),
    Column("minimum", True), Column("maximum", True),
)  # fmt: skip
STATISTICS = ("mean", "std", "minimum", "maximum")
LOCAL = "local"
MOST_FAILURES = 5
"""The most failures that are named."""


class EnsembleOptions(NamedTuple):
    """The options of an ensemble."""

    members: int
    workers: int | None
    processes: bool
    scheduler: str | None
    seed: int
    temperature: str | None
    spread: str | None
    change: str | None
    keep: int


def takes_ensemble(verb: Callable[..., T]) -> Callable[..., T]:
    """Give a verb the option --ensemble and those that go with it; it gets `many`, None without --ensemble."""

    @click.option("--ensemble", "members", type=WholeNumber(), metavar="K", help="Run from K random starts.")
    @click.option("--temperature", metavar="T", help="Starts have momenta as at this temperature.")
    @click.option("--spread", metavar="S", help="Starts are the scene's plus normal numbers of this deviation.")
    @click.option("--seed", type=WholeNumber(), help="Of the random starts; by default 0.")
    @click.option("--change", metavar="KIND", help="Statistics of changes from each start: absolute or relative.")
    @click.option("--keep", type=WholeNumber(), metavar="K", help="Keep what was observed of the first K runs in FILE.")
    @click.option("--workers", type=WholeNumber(), metavar="N", help="Threads or processes; by default one a core.")
    @click.option("--processes", is_flag=True, help="Processes instead of threads.")
    @click.option(
        "--scheduler", metavar="ADDRESS",
        help="The cluster of this Dask scheduler, as in tcp://host:8786; or local, for one of --workers here.",
    )  # fmt: skip
    @functools.wraps(verb)
    def read(
        *, members: int | None, temperature: str | None, spread: str | None, seed: int | None, change: str | None,
        keep: int | None, workers: int | None, processes: bool, scheduler: str | None, **options: Any,
    ) -> T:  # fmt: skip
        given = {"temperature": temperature, "spread": spread, "seed": seed, "change": change, "keep": keep}
        given |= {"workers": workers, "processes": processes or None, "scheduler": scheduler}
        if members is None:
            for name, value in given.items():
                if value is not None:
                    raise Refusal(f"{name} must come with --ensemble K, but came without")
            return verb(many=None, **options)
        if members < 1:
            raise Refusal(f"ensemble must be a number of runs, 1 or more, but was {members}")
        if (temperature is None) == (spread is None):
            raise Refusal(
                "ensemble must come with either --temperature or --spread, which say how starts differ, "
                f"but came with {'neither' if spread is None else 'both'}"
            )
        if scheduler is not None and (processes or (workers is not None and scheduler != LOCAL)):
            raise Refusal("scheduler must come without --processes and, unless it is local, --workers, but did not")
        many = EnsembleOptions(
            members, workers, processes, scheduler, seed or 0, temperature, spread, change, keep or 0
        )
        return verb(many=many, **options)

    return read


def simulate_ensemble(
    many: EnsembleOptions,
    scene: Scene,
    method: Method,
    effects: Sequence[str],
    *,
    to: str | None,
    predict: bool | None,
    output: Output,
    **options: Any,
) -> Table:
    """Run an ensemble, keep it in a file if there is one, and summarise it.

    Args:
        many: The options of the ensemble.
        scene: The scene.
        method: The method.
        effects: The effects that are on.
        to: The file.
        predict: Whether to say how long it will take; None: if it takes long.
        output: The output, whose bar shows the progress.
        options: Further options of `integrators.runs.ensembles.ensemble`.
    """
    from bseries.scene_text import head, place
    from integrators.runs.ensembles import ensemble
    from integrators.runs.executors import cluster_executor

    def expect(cost: float | None) -> Prediction:
        from bseries.advice.prediction.run_prediction import time_only

        return time_only(options["h"], options["steps"], "each run has a start of its own")

    watch = Expectation(output.progress, expect, predict, beforehand=False)
    executor: Any = "processes" if many.processes else "threads"
    with ExitStack() as stack:
        if many.scheduler == LOCAL:
            executor = stack.enter_context(cluster_executor(workers=many.workers))
        elif many.scheduler is not None:
            executor = stack.enter_context(cluster_executor(many.scheduler))
        try:
            with said_warnings():
                result = ensemble(
                    scene, method, sample=_sample(many, scene), members=many.members, seed=many.seed,
                    change=many.change, keep=many.keep, final=True, executor=executor, workers=many.workers,
                    progress=watch, **options,
                )  # fmt: skip
        except KeyboardInterrupt:
            folder = options.get("checkpoint")
            where = f"; the same command goes on from {folder}" if folder else ""
            say("warning", f"stopped after {watch.done:,} of {many.members:,} runs{where}")
            raise
    if to is not None:
        result.save(to)
    facts = head("ensemble", method.name, scene, effects)
    return _table(result, many, watch, to, facts, place(method.name, scene, effects))


def _sample(many: EnsembleOptions, scene: Scene) -> Any:
    from integrators.runs.random_starts import perturbed_start, thermal_momenta

    if many.temperature is not None:
        return thermal_momenta(scene, read_float(many.temperature, "temperature"))
    return perturbed_start(scene, read_float(many.spread or "", "spread"))


def _table(
    result: EnsembleResult, many: EnsembleOptions, watch: Expectation, to: str | None, facts: dict[str, Any], where: str
) -> Table:
    """Statistics of each quantity; CSV has them at all times."""
    h, steps, times = result.meta["h"], result.meta["steps"], [float(result.t[0]), float(result.t[-1])]
    facts |= {"h": h, "steps": steps, "t": times, "members": many.members}
    facts |= {"seed": many.seed, "change": many.change, "file": to}
    if watch.prediction is not None:
        facts |= {"prediction": watch.prediction.to_dict(), "outcome": watch.outcome(None)}
    facts["failures"] = [{"member": f.member, "step": f.step, "t": f.t, "reason": f.reason} for f in result.failures]
    records = list(_records(result))
    return Table(
        f"{where}: {many.members:,} runs of {steps:,} steps of {h:g}, to t = {times[1]:g}",
        COLUMNS,
        [[record["what"], *(_shown(record[key]) for key in list(record)[1:])] for record in records],
        [*_notes(result, many, to), *watch.notes(None)],
        data=lambda: {**facts, "rows": records},
        items="rows",
        records=_statistics(result),
    )


def _records(result: EnsembleResult) -> Iterator[dict[str, Any]]:
    """Statistics of each quantity; None for numbers that are not finite."""
    import numpy as np

    def number(value: Any) -> float | None:
        return float(value) if np.isfinite(value) else None

    for name in result.names:
        mean, std = result.mean[name], result.std[name]
        known = result.count > 0
        yield {
            "what": name,
            "mean_at_start": number(mean[0]),
            "mean_at_end": number(mean[-1]),
            "std_at_end": number(std[-1]),
            "minimum": number(result.minimum[name][known].min(initial=np.inf)),
            "maximum": number(result.maximum[name][known].max(initial=-np.inf)),
        }


def _shown(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _notes(result: EnsembleResult, many: EnsembleOptions, to: str | None) -> Iterator[str]:
    what = "" if many.change is None else f" of {many.change} changes from each start"
    yield f"Statistics{what} at {len(result.t):,} times; minimum and maximum are over all of these."
    for failure in result.failures[:MOST_FAILURES]:
        yield f"Run {failure.member} failed: {failure.reason}."
    if len(result.failures) > MOST_FAILURES:
        yield f"{len(result.failures) - MOST_FAILURES:,} more runs failed."
    if to is not None:
        yield f"{to} has the statistics at all times, and the last states."


def _statistics(result: EnsembleResult) -> Table:
    """A row for each time."""
    names = [f"{name}_{key}" for name in result.names for key in STATISTICS]
    columns = [getattr(result, key)[name] for name in result.names for key in STATISTICS]

    def rows() -> Iterator[list[str]]:
        for k, (t, count) in enumerate(zip(result.t, result.count, strict=True)):
            yield [repr(float(t)), str(count), *(repr(float(column[k])) for column in columns)]

    return Table("", list(map(Column, ["t", "count", *names])), LazyRows(rows, len(result.t)))
