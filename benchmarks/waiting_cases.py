"""What a person waits for: whole processes and calls with nothing compiled, and again."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import bseries as bs

from .kinds import GB, Figure, Measurement
from .timing import ROOT, run

WHEN = ("nothing compiled", "again", "once more")
"""Three processes, the first with an empty folder for machine code."""
REPORT = "\nfrom benchmarks.timing import peak_memory; print('', found, peak_memory())"
"""The end of every program: what it measured itself (None: its whole process is timed), and its peak memory."""
CALLS = """
from statistics import median
from time import perf_counter
import bseries as bs
times = []
for _ in range(15):
    begin = perf_counter()
    bs.modified_equation("explicit-midpoint", 9).coefficients()
    times.append(perf_counter() - begin)
found = median(times)
"""
FIRST = """
import bseries as bs
found = bs.modified_equation("explicit-midpoint", {order}).coefficients() and None
"""
ONE_CALL = """
from time import perf_counter
import bseries as bs, integrators
begin = perf_counter()
{call}
found = perf_counter() - begin
"""
COMMAND = """
import sys
from bseries.cli import main
sys.argv = ["bseries", *{arguments!r}]
try:
    main()
except SystemExit as ended:
    if ended.code:
        raise
found = None
"""
SCENES = """
import gc
import bseries as bs
def held():
    gc.collect()
    with open("/proc/self/status") as status:
        return int(status.read().partition("VmRSS:")[2].split()[0]) / 1000
for k in range({warm} + {many}):
    if k == {warm}:
        before = held()
    start = {{"p": [0], "q": ["3/2"]}}
    scene = bs.Scene({{"p": 1, "q": 1}}, hamiltonian=f"p^2/2 - {{k + 2}}*cos(q)/{{k + 3}}", start=start)
    {use}
found = (held() - before) / {many}
"""


class Wait(NamedTuple):
    """A program, with its bars: in seconds or another unit, with nothing compiled and later, and of bytes held."""

    name: str
    work: str
    program: str
    first: float | None
    later: float | None
    peak: float | None = None
    unit: str = "s"


def commanded(arguments: str) -> str:
    """The program of a command."""
    return COMMAND.format(arguments=arguments.split())


def waits() -> list[Wait]:
    """All programs."""
    scenes = {
        "made": Wait("scenes", "a scene kept by 2,000 of them", SCENES.format(warm=20, many=2000, use=""), 0.1, 0.1),
        "run": Wait(
            "scenes-run",
            "a scene kept by 40 of them that are run",
            SCENES.format(warm=20, many=40, use='bs.integrate("rk4", scene, h=0.1, steps=3)'),
            0.1,
            0.1,
        ),
    }
    return [
        Wait("calls", "explicit-midpoint, order 9, the median of 15 calls", CALLS, 3e-3, 3e-3),
        Wait("order-10", "explicit-midpoint, order 10, a process", FIRST.format(order=10), 1.5, 0.6),
        Wait("order-12", "explicit-midpoint, order 12, a process", FIRST.format(order=12), 4.0, 0.7),
        Wait(
            "csv",
            "bseries modified explicit-midpoint --order 15 --format csv",
            commanded("modified explicit-midpoint --order 15 --format csv"),
            None,
            8.0,
            0.5 * GB,
        ),
        Wait(
            "simulate",
            "bseries simulate pendulum, 1,000 steps of rk4",
            commanded("simulate pendulum --method rk4 --step 0.1 --steps 1000"),
            None,
            0.8,
        ),
        Wait("cost", "bseries cost kepler", commanded("cost kepler"), 25.0, 8.0),
        Wait(
            "repeated",
            "series(repeat(rk4, 1000), 6)",
            ONE_CALL.format(call='bs.series(integrators.repeat(bs.method("rk4"), 1000), 6).coefficients()'),
            1.0,
            1.0,
        ),
        Wait("bch", "bch(20, basis='lyndon')", ONE_CALL.format(call='bs.bch(20, basis="lyndon")'), None, 1.0, GB),
        *(wait._replace(unit="MB") for wait in scenes.values()),
    ]


def waited(wait: Wait) -> list[Figure]:
    """A program three times, each in a process of its own."""
    found, peaks = [], []
    with tempfile.TemporaryDirectory() as cache:
        for when in WHEN:
            value, peak = in_process(wait.program, cache)
            bar = wait.first if when == WHEN[0] else wait.later
            found.append(Figure(f"{wait.work}: {when}", value, bar, unit=wait.unit))
            peaks.append(peak)
    if wait.peak:
        found.append(Figure(f"{wait.work}: memory", peaks[-1] / 1e6, wait.peak / 1e6, unit="MB"))
    return found


def in_process(program: str, cache: str) -> tuple[float, float]:
    """What a program measured, or the seconds of its process, and its peak memory in bytes."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    seconds, printed = run([sys.executable, "-c", program + REPORT], {"PYTHONPATH": path, "BSERIES_CACHE": cache})
    value, peak = printed.split()[-2:]
    return seconds if value == "None" else float(value), float(peak)


def names_to_check() -> list[str]:
    """Every entry of the catalogue; of families the member with three stages."""
    return [f"{entry.name}3" if entry.is_family else entry.name for entry in bs.methods.catalogue()]


def slowest_checks(names: Sequence[str]) -> list[Figure]:
    """`bseries check`, once machine code is there (the best of three processes): the slowest method of each kind."""
    slowest: dict[bool, tuple[float, str]] = {}
    with tempfile.TemporaryDirectory() as cache:
        for name in names:
            method = bs.method(name)
            is_long = method.digits is not None and len(method.program.evaluations) >= 12
            seconds, _ = min(in_process(commanded(f"check {name}"), cache) for _ in range(3))
            slowest[is_long] = max(slowest.get(is_long, (0.0, "")), (seconds, name))
    kinds = {False: (1.5, "the slowest method"), True: (3.0, "the slowest in decimals with 12 and more stages")}
    return [
        Figure(f"bseries check, {kinds[is_long][1]}: {name}", seconds, kinds[is_long][0], unit="s")
        for is_long, (seconds, name) in slowest.items()
    ]


HARD = ("rk4", "gauss3", "dop853", "triple-jump4", "suzuki4", "blanes-moan6", "sofroniou-spaletta10")
"""Methods whose check takes longest, each of its kind."""


def measurements() -> list[Measurement]:
    """All rows."""
    return [
        *(Measurement(f"wait-{wait.name}", partial(waited, wait)) for wait in waits()),
        Measurement("wait-check", lambda: slowest_checks(HARD)),
        Measurement("wait-check-all", lambda: slowest_checks(names_to_check()), full=True),
    ]
