"""The figures on time stepping that are rows of `python -m benchmarks`, each with its bar."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable
from operator import attrgetter

from integrators.runs.ensembles import available_cores

from ..kinds import Figure, Measurement
from .costs import MEMBERS, OBSERVE_EVERY, compile_times, ensemble_speedup, memory, observing
from .rounding import STARTS, rounding

ROUNDED = (
    ("stormer-verlet-kdk", {}, True),
    ("gauss3", {}, True),
    ("stormer-verlet-kdk", {"compensated": False}, False),
    ("gauss3", {"split": False}, False),
    ("gauss3", {"compensated": False}, False),
)
"""Methods with their options, and whether they shall reach the bars; the others show what these options are for."""


def observed(rounds: int = 9) -> list[Figure]:
    """What observing costs."""
    work = f"compensated, energy observed every {OBSERVE_EVERY} steps, over the same without"
    return [Figure(f"{name}: {work}", ratio, 1.10) for name, ratio in observing(rounds=rounds).items()]


def rounded(steps: int) -> list[Figure]:
    """What rounding does to energy; the bar for its size is one for 10⁷ steps."""
    found = []
    for method, options, is_bound in ROUNDED:
        run = rounding(method, steps, **options)
        how = "".join(f", {name}={value}" for name, value in options.items())
        work = f"{method}{how}: rounding part of the relative energy error, Kepler, {steps:.0e} steps, {STARTS} starts"
        bars = (1e-13, 0.6, 3.0) if is_bound else (None, None, None)
        values = {"rms": float(run.rms[-1]), "growth exponent": run.exponent, "mean in standard errors": run.bias}
        found += [Figure(f"{work}, {what}", x, bar) for (what, x), bar in zip(values.items(), bars, strict=True)]
    return found


def held(steps: int) -> list[Figure]:
    """Memory of a long run."""
    growth = memory(steps)
    work = f"{steps:.0e} steps of the pendulum with an observer: memory above"
    return [
        Figure(f"{work} the imported baseline", (growth.long - growth.imported) / 1e6, 150.0, unit="MB"),
        Figure(f"{work} that of a hundredth of the steps", (growth.long - growth.short) / 1e6, unit="MB"),
    ]


def compiling(*, loaded: bool) -> list[Figure]:
    """The worst times to a first step."""
    times = compile_times(loaded=loaded)
    after = "libraries loaded" if loaded else "after import bseries"
    found = []
    for how, which, bar in (("nothing cached", "first", 2.0), ("cached", "cached", 0.3)):
        worst = max(times, key=attrgetter(which))
        work = f"stepper and first step, {how}, {after}, worst of {len(times)}: {worst.method} on {worst.scene}"
        found.append(Figure(work, getattr(worst, which), bar, unit="s"))
    return found


def shared(kind: str, bar: float, steps: int) -> Callable[[], list[Figure]]:
    """Two workers over one."""

    def measure() -> list[Figure]:
        work = f"{MEMBERS} trajectories of lennard-jones, {steps:.0e} steps: speed-up by two workers, {kind}"
        return [Figure(work, ensemble_speedup(kind, steps=steps), bar, at_least=True)]

    return measure


def measurements() -> list[Measurement]:
    """All that can be measured here: some need gcc, or `distributed`, or two cores."""
    found = [
        Measurement("stepping-memory", lambda: held(10**7)),
        Measurement("stepping-memory-full", lambda: held(10**8), full=True),
        Measurement("stepping-compile", lambda: compiling(loaded=True)),
        Measurement("stepping-compile-fresh", lambda: compiling(loaded=False), full=True),
        Measurement("stepping-observed", observed),
    ]
    if shutil.which("gcc"):
        found += [
            Measurement("stepping-rounding", lambda: rounded(10**6)),
            Measurement("stepping-rounding-full", lambda: rounded(10**7), full=True),
        ]
    if available_cores() >= 2:
        found.append(Measurement("stepping-threads", shared("threads", 1.90, 3 * 10**5), full=True))
        if importlib.util.find_spec("distributed"):
            found.append(Measurement("stepping-dask", shared("dask", 1.70, 3 * 10**5), full=True))
    return found
