"""The figures on time stepping that are rows of `python -m benchmarks`, each with its bar."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from typing import Any

from integrators.executors import available_cores

from ..kinds import Figure, Measurement
from .c_steps import GAUSS, METHODS, STEP_SIZES
from .costs import MEMBERS, OBSERVE_EVERY, compile_times, ensemble_speedup, memory, observing
from .our_steps import our_steps_like_c
from .precision import OURS, all_curves, leads, problems
from .ratios import compare, means
from .rounding import STARTS, rounding

ROUNDED = (
    ("stormer-verlet-kdk", {}, True),
    ("gauss3", {}, True),
    ("stormer-verlet-kdk", {"compensated": False}, False),
    ("gauss3", {"split": False}, False),
    ("gauss3", {"compensated": False}, False),
)
"""Methods with their options, and whether they shall reach the bars; the others show what these options are for."""

LEADS = {
    "kepler": {"scipy": (50.0, 1e-10), "rebound, leapfrog": (1.0, 1e-10), "heyoka": (1.0, 1e-7)},
    "outer-solar-system": {"scipy": (50.0, 1e-10), "rebound, leapfrog": (1.0, 1e-10), "heyoka": (1.0, 1e-10)},
}
"""How many times as long others shall take at least, at every error of energy from 1e-3 to the one given."""


def over_c(rounds: int = 9) -> list[Figure]:
    """Ratios to C."""
    averages = means(compare(our_steps_like_c, rounds=rounds))
    work = f"a step over the same in C, mean over {len(STEP_SIZES)} scenes"
    return [Figure(f"{name}: {work}", averages[name], 1.10 if name in GAUSS else 1.05) for name in METHODS]


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


def leading(rivals: Path) -> list[Figure]:
    """The least leads over packages installed in a virtual environment."""
    found = []
    for problem in problems():
        rows = leads(all_curves(problem, rivals))
        for kind, (bar, last) in LEADS[problem.name].items():
            within = [row for row in rows if row["error"] > last / 2]
            ratios = [row[kind] if row[OURS] else 0.0 for row in within if not row[OURS] or row[kind] is not None]
            if ratios:
                work = f"{problem.title}: time of {kind} over ours, least for energy errors from 1e-03 to {last:.0e}"
                found.append(Figure(work, min(ratios), bar, at_least=True))
    return found


def measurements(rivals: Path) -> list[Measurement]:
    """All that can be measured here: some need gcc, or `distributed`, or two cores, or other packages."""
    found = [
        Measurement("stepping-memory", lambda: held(10**7)),
        Measurement("stepping-memory-full", lambda: held(10**8), full=True),
        Measurement("stepping-compile", lambda: compiling(loaded=True)),
        Measurement("stepping-compile-fresh", lambda: compiling(loaded=False), full=True),
        Measurement("stepping-observed", observed, full=True),
        Measurement("stepping-precision", lambda: leading(rivals), full=True),
    ]
    if shutil.which("gcc"):
        found += [
            Measurement("stepping-c", over_c, full=True),
            Measurement("stepping-rounding", lambda: rounded(10**6)),
            Measurement("stepping-rounding-full", lambda: rounded(10**7), full=True),
        ]
    if available_cores() >= 2:
        found.append(Measurement("stepping-threads", shared("threads", 1.90, 3 * 10**5), full=True))
        if importlib.util.find_spec("distributed"):
            found.append(Measurement("stepping-dask", shared("dask", 1.70, 3 * 10**5), full=True))
    return found


def collect(chosen: list[Measurement], progress: Callable[[str], None]) -> list[dict[str, Any]]:
    """Measure, one after the other: plain data for JSON."""
    found = []
    for measurement in chosen:
        progress(measurement.name)
        found += [{"name": measurement.name, **figure._asdict()} for figure in measurement.measure()]
    return found
