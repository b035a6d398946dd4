"""What is measured: the rows of the table, each with its bar."""

from __future__ import annotations

import shutil
import sys
import sysconfig
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bseries as bs
from bseries import BSeries
from trees import table as tables

from . import algebra_cases, hamiltonian_cases, scene_cases
from .kinds import GB, Case
from .timing import ROOT, Sample, Sampler, run, time_calls

if TYPE_CHECKING:
    from integrators.methods.programs.program import Method

FLOAT_MIDPOINT = ([[0, 0], [0.5, 0]], [0.0, 1.0])


def at_hand(method: str | Method, order: int, read: Callable[[BSeries], Any] | None = None) -> Callable[[], Sampler]:
    """The modified equation with table and splits at hand; `read` says how the coefficients are taken out."""

    def prepare() -> Sampler:
        chosen: Any = bs.method(method) if isinstance(method, str) else method

        def work() -> object:
            b = bs.modified_equation(chosen, order)
            return read(b) if read else b

        def sample() -> Sample:
            next(tables.tree_table(order, len(chosen.partitions)).cut_chunks())  # the next case may have thrown it away
            return time_calls(work)

        work()
        return sample

    return prepare


def from_table(method: str, order: int) -> Callable[[], Sampler]:
    """The modified equation, `Fraction`s out, with nothing at hand but compiled kernels."""

    def prepare() -> Sampler:
        chosen = bs.method(method)

        def work() -> object:
            tables.kept_table.cache_clear()
            return bs.modified_equation(chosen, order).coefficients()

        work()
        return lambda: time_calls(work)

    return prepare


def of_series(method: Method, order: int) -> Callable[[], Sampler]:
    """The modified equation on the table of a series, for tables so large that none is kept for the next caller."""

    def prepare() -> Sampler:
        flow = bs.series(method, order)
        bs.modified_equation(flow)
        return lambda: time_calls(lambda: bs.modified_equation(flow))

    return prepare


def fresh(domain: str, order: int) -> Callable[[], Sampler]:
    """A process that computes the modified equation of the explicit midpoint rule from nothing."""

    def sample() -> Sample:
        seconds, printed = run(
            [sys.executable, "-m", "benchmarks.fresh", domain, str(order)], {"PYTHONPATH": str(ROOT)}
        )
        return Sample(seconds, int(printed))

    return lambda: sample


def process(*command: str) -> Callable[[], Sampler]:
    """A whole process."""
    return lambda: lambda: Sample(run(command)[0])


def first_run(*arguments: str) -> Callable[[], Sampler]:
    """A whole process that imports the packages for the first time: without any byte code of theirs."""
    start = "import sys; from bseries.cli import main; main()" if arguments else "import bseries"

    def sample() -> Sample:
        with tempfile.TemporaryDirectory() as folder:
            for package in ("trees", "integrators", "bseries"):
                shutil.copytree(ROOT / package, Path(folder, package), ignore=shutil.ignore_patterns("__pycache__"))
            return Sample(run([sys.executable, "-c", start, *arguments], {"PYTHONPATH": folder})[0])

    return lambda: sample


def cases() -> list[Case]:
    """All rows."""
    midpoint, fractions = "explicit-midpoint", BSeries.coefficients
    floats = bs.RungeKutta(*FLOAT_MIDPOINT)
    return [
        Case("midpoint-9", f"{midpoint}, order 9, integers out", at_hand(midpoint, 9), 0.2e-3),
        Case("midpoint-9-all", f"{midpoint}, order 9, table and 486 Fractions made", from_table(midpoint, 9), 3e-3),
        Case("midpoint-7-all", f"{midpoint}, order 7, table and 85 Fractions made", from_table(midpoint, 7)),
        Case("midpoint-12", f"{midpoint}, order 12, integers out", at_hand(midpoint, 12), 5e-3),
        Case("midpoint-15", f"{midpoint}, order 15, integers out", at_hand(midpoint, 15), 0.15),
        Case("midpoint-18", f"{midpoint}, order 18, integers out", of_series(bs.method(midpoint), 18), 8.0),
        Case(
            "midpoint-20-float",
            f"{midpoint}, order 20, float64, all from nothing",
            fresh("float", 20),
            60,
            4.5 * GB,
            True,
        ),
        Case("midpoint-20", f"{midpoint}, order 20, exact, all from nothing", fresh("exact", 20), 300, 9 * GB, True),
        Case("dormand-prince-12", "dormand-prince54, order 12, integers out", at_hand("dormand-prince54", 12), 0.05),
        Case("dormand-prince-15", "dormand-prince54, order 15, integers out", at_hand("dormand-prince54", 15), 2.0),
        Case("gauss5", "gauss5, order 10, Fractions out", at_hand("gauss5", 10, fractions), 0.02),
        Case("crouzeix3", "crouzeix3, order 7, algebraic numbers out", at_hand("crouzeix3", 7, fractions), 1.0),
        Case("sdirk2", "sdirk2, order 6, expressions in gamma out", at_hand("sdirk2", 6, fractions), 2.0),
        Case(
            "sdirk2-general",
            "sdirk2-general, order 6, expressions in gamma and c2 out",
            at_hand("sdirk2-general", 6, fractions),
            2.0,
        ),
        Case("verlet", "stormer-verlet-kdk, order 8, 24,314 integers out", at_hand("stormer-verlet-kdk", 8), 0.05),
        Case(
            "verlet-fractions",
            "stormer-verlet-kdk, order 8, 24,314 Fractions out",
            at_hand("stormer-verlet-kdk", 8, fractions),
        ),
        Case("float-9", "explicit midpoint rule, order 9, float64", at_hand(floats, 9)),
        Case("float-12", "explicit midpoint rule, order 12, float64", at_hand(floats, 12)),
        Case("float-15", "explicit midpoint rule, order 15, float64", at_hand(floats, 15)),
        Case("float-18", "explicit midpoint rule, order 18, float64", of_series(floats, 18)),
        *algebra_cases.cases(),
        *scene_cases.cases(),
        *hamiltonian_cases.cases(),
        *(Case(name, work, prepare, bar, interpreted=True) for name, work, prepare, bar in whole_processes()),
    ]


def whole_processes() -> list[tuple[str, str, Callable[[], Sampler], float]]:
    """Name, work, sampler and bar of commands and imports."""
    command = str(Path(sysconfig.get_path("scripts"), "bseries"))
    modified = ("modified", "rk4", "--order", "6")
    return [
        ("help", "bseries --help", process(command, "--help"), 0.15),
        ("help-first", "bseries --help, first run", first_run("--help"), 0.15),
        ("import", 'python -c "import bseries"', process(sys.executable, "-c", "import bseries"), 0.15),
        ("import-first", 'python -c "import bseries", first run', first_run(), 0.15),
        ("modified", "bseries modified rk4 --order 6", process(command, *modified), 0.4),
        ("modified-first", "bseries modified rk4 --order 6, first run", first_run(*modified), 0.4),
    ]
