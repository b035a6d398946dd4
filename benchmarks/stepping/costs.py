"""What comes on top of a step: observing it, compiling it, memory, and sharing the work among cores."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs

from ..timing import ROOT
from ..timing import run as run_process
from .c_steps import STEP_SIZES
from .our_steps import our_steps
from .ratios import SAMPLE, compare, means

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import numpy as np

    from .c_steps import Run

OBSERVED = ("stormer-verlet-kdk", "yoshida6", "gauss3")
OBSERVE_EVERY = 100
COMPILED = ("stormer-verlet", "rk4", "gauss3", "yoshida6")
MEMBERS, SPREAD = 400, 0.01


def observed_steps(scene: str, method: str) -> Run:
    """Steps with compensated summation, and energy observed after every 100th."""
    from integrators.runs.observers import observers

    model = bs.scene(scene)
    stepper, energy = bs.stepper(method, model), observers(model, "energy")

    def run(y: np.ndarray, h: float, steps: int) -> None:
        import numpy as np

        state, rows = stepper.start(y.tolist(), h=h), np.empty((steps // OBSERVE_EVERY, 1))
        stepper.record(state, steps, o_every=OBSERVE_EVERY, observer=energy.address, o_rows=rows)
        y[:] = state.y

    return run


def unobserved_steps(scene: str, method: str) -> Run:
    """The same with neither."""
    return our_steps(scene, method, compensated=False)


def observing(
    scenes: Iterable[str] = tuple(STEP_SIZES),
    methods: Iterable[str] = OBSERVED,
    rounds: int = 9,
    sample: float = SAMPLE,
) -> dict[str, float]:
    """How many times as long steps take that are compensated and observed: for each method a mean over scenes."""
    cells = compare(observed_steps, unobserved_steps, scenes=scenes, methods=methods, rounds=rounds, sample=sample)
    return means(cells)


class Growth(NamedTuple):
    """Bytes held at the peak: with everything imported and compiled, and after a short and a long run."""

    imported: int
    short: int
    long: int


def memory(steps: int) -> Growth:
    """Memory of a run of the pendulum that is observed, and of one a hundred times shorter that is as often."""
    return Growth(*_child("memory", str(steps)))


class CompileTime(NamedTuple):
    """Seconds from a scene and a method to the end of the first step."""

    scene: str
    method: str
    first: float
    cached: float


def compile_times(
    scenes: Iterable[str] = tuple(STEP_SIZES), methods: Iterable[str] = COMPILED, *, loaded: bool
) -> list[CompileTime]:
    """Compiling, with an empty cache and with machine code from the cache.

    Args:
        scenes: The scenes.
        methods: The methods.
        loaded: Whether SymPy, numba and whatever else is imported have been, by a step on another scene. Otherwise
            each pair has a process of its own, that has imported nothing but `bseries`.
    """
    pairs = [f"{scene}:{method}" for scene in scenes for method in methods]
    shared = [["loaded", *pairs]] if loaded else [["fresh", pair] for pair in pairs]
    with tempfile.TemporaryDirectory() as folder:
        variables = {"BSERIES_CACHE": folder}
        first, cached = ([t for task in shared for t in _child(*task, **variables)] for _ in range(2))
    names = [pair.partition(":") for pair in pairs]
    return [CompileTime(name[0], name[2], *times) for name, *times in zip(names, first, cached, strict=True)]


def _child(*arguments: str, **variables: str) -> list[Any]:
    """What `fresh_steps.py` prints, in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.stepping.fresh_steps", *arguments]
    return json.loads(run_process(command, {"PYTHONPATH": str(ROOT), **variables})[1])


def ensemble_speedup(kind: str, *, steps: int, members: int = MEMBERS, rounds: int = 3) -> float:
    """How many times as fast two workers run an ensemble of Lennard-Jones atoms as one: the median over rounds.

    Args:
        kind: ``threads``, or ``dask`` for its local cluster, whose start is not counted.
        steps: The steps of each member.
        members: How many there are.
        rounds: How often both are timed, in turn.
    """
    with _workers(kind, 1) as one, _workers(kind, 2) as two:
        timers = [_ensemble_timer(options, steps, members) for options in (one, two)]
        for timer in timers:
            timer()  # workers load what they need
        seconds = [[timer() for timer in timers] for _ in range(rounds)]
    return median(alone / together for alone, together in seconds)


def _ensemble_timer(options: dict[str, Any], steps: int, members: int) -> Callable[[], float]:
    scene = bs.scene("lennard-jones")
    start = bs.runs.perturbed_start(scene, SPREAD)

    def timer() -> float:
        begin = perf_counter()
        bs.ensemble(
            "stormer-verlet", scene, h=STEP_SIZES[scene.name], steps=steps, sample=start, members=members, **options
        )
        return perf_counter() - begin

    return timer


@contextmanager
def _workers(kind: str, count: int) -> Iterator[dict[str, Executor | str | int]]:
    """The options of `bseries.ensemble` for so many workers."""
    if kind == "threads":
        yield {"executor": kind, "workers": count}
        return
    with bs.runs.cluster_executor(workers=count) as executor:
        yield {"executor": executor}
