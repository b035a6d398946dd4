"""Work for a given precision: curves of error against CPU time, ours and those of other packages."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterable, Sequence
from math import inf, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs
from bseries.advice.work_precision.sweeps import pareto_front, seconds_at

from .c_steps import METHODS, CFailure
from .our_steps import LIKE_C, our_steps_like_c
from .problems import Point, Problem, first_after, measure, step_counts

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

    from .c_steps import Run

WORKER = Path(__file__).with_name("rival_worker.py")
OURS = "ours"
PACKAGES = ("scipy", "rebound", "heyoka")
RIVALS = {
    "scipy": ("scipy", ""),
    "rebound, leapfrog": ("rebound", "leapfrog"),
    "rebound": ("rebound", ""),
    "heyoka": ("heyoka", ""),
}
"""What ours is compared with: a package, and how the names of its methods begin."""
PRECISE = (
    *METHODS,
    *("gauss5", "gauss6", "chin4c", "blanes-moan-rkn6-11", "blanes-casas-rkn8"),
    *("kahan-li8", "sofroniou-spaletta8", "sofroniou-spaletta10"),
)
CONTROLS = {"kepler": "(q1^2 + q2^2)^(1/2)"}
"""Where variable steps pay: their sizes are near ε times this, the distance from the centre."""
CONTROLLED = ("blanes-moan-rkn6-11", "gauss4", "gauss6")
"""The methods that are also run with variable steps: symmetric, as these steps need it to be reversible."""
MOST_STEPS = 20
"""A run of variable steps with more than so many times the expected number has lost the orbit."""
ERRORS = tuple(10.0**-k for k in range(3, 14))
BUDGET = 2.0
"""A curve ends with its first run that takes longer: CPU seconds."""
TIMEOUT = 1800.0
"""Seconds after which a package is given up."""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class Curve(NamedTuple):
    """What one method needs on one problem: a point for every step size or tolerance."""

    package: str
    version: str
    method: str
    problem: str
    points: list[Point]

    @property
    def front(self) -> list[Point]:
        """The points that no other beats in both; an error of 0 was not seen, and an infinite one is a lost orbit."""
        return pareto_front(point for point in self.points if 0 < point.error < inf)

    def seconds(self, error: float) -> float | None:
        """CPU seconds that reach this error, between the points of the front."""
        return seconds_at(self.front, error)

    def to_dict(self) -> dict[str, Any]:
        """The curve for JSON."""
        return {**self._asdict(), "points": [list(point) for point in self.points]}


def best(curves: Iterable[Curve], error: float) -> float | None:
    """The least CPU seconds in which one of these curves reaches an error; None if none does."""
    return min((t for curve in curves if (t := curve.seconds(error)) is not None), default=None)


def problems() -> list[Problem]:
    """Kepler's with eccentricity 0.6 over 200 periods, and the outer solar system over a million days."""
    kepler, solar = bs.scene("kepler"), bs.scene("outer-solar-system")
    parameters: Any = solar.parameters
    masses = [float(m) for m in parameters["m"]]
    return [
        Problem("kepler", "Kepler, e = 0.6, 200 periods", [1.0], 1.0, *_start(kepler, [1.0]), 400 * pi, 2000),
        Problem(
            "outer-solar-system",
            "outer solar system, 10⁶ days",
            masses,
            float(parameters["G"]),
            *_start(solar, masses),
            1e6,
            250,
        ),
    ]


def _start(scene: Any, masses: Sequence[float]) -> tuple[list[float], list[float]]:
    p, q = scene.y0.reshape(2, -1)
    return q.tolist(), _velocities(p, masses).tolist()


def _velocities(p: np.ndarray, masses: Sequence[float]) -> np.ndarray:
    import numpy as np

    return p / np.repeat(masses, p.shape[-1] // len(masses))


def all_curves(
    problem: Problem, rivals: Path, methods: Iterable[str] = PRECISE, *, budget: float = BUDGET
) -> list[Curve]:
    """Our curves, and those of the packages that are installed in a virtual environment."""
    names = list(methods)
    curves = [our_curve(problem, name, our_steps_like_c(problem.name, name), budget=budget) for name in names]
    if problem.name in CONTROLS:
        control = CONTROLS[problem.name]
        curves += [controlled_curve(problem, name, control, budget=budget) for name in names if name in CONTROLLED]
    return curves + [curve for package in PACKAGES for curve in rival_curves(rivals, package, problem, budget=budget)]


def our_curve(problem: Problem, method: str, run: Run, *, package: str = OURS, budget: float = BUDGET) -> Curve:
    """The curve of a method of ours, on the scene that bears the problem's name; `run` makes its steps."""
    import numpy as np

    start, size = bs.scene(problem.name).y0, len(problem.positions)

    def at(steps: float) -> tuple[float, Callable[[], Callable[[], None]]]:
        n, h = int(steps), problem.span / steps

        def work() -> Callable[[], None]:
            y = start.copy()
            return lambda: run(y, h, n)

        y, done, seen = start.copy(), 0, []
        try:
            for look in problem.looks(n):
                run(y, h, look - done)
                seen.append(y.copy())
                done = look
        except (CFailure, bs.integrators.StepError):
            return inf, work
        states = np.array(seen)
        return problem.energy_error(states[:, size:], _velocities(states[:, :size], problem.masses)), work

    return Curve(package, "", method, problem.name, measure(step_counts(problem), at, budget))


def controlled_curve(problem: Problem, method: str, control: str, *, budget: float = BUDGET) -> Curve:
    """The curve of a method of ours with reversible steps of sizes near ε σ(y), for ε = span/n in place of n steps.

    Args:
        problem: The problem.
        method: The method's name.
        control: The formula of σ.
        budget: CPU seconds; the curve ends with its first run that takes longer.
    """
    stepper = bs.stepper(method, bs.scene(problem.name), control=control, **LIKE_C)

    def at(steps: float) -> tuple[float, Callable[[], Callable[[], None]]]:
        epsilon = problem.span / steps

        def work() -> Callable[[], None]:
            state = stepper.start(h=epsilon)
            return lambda: stepper.advance(state, count)

        try:
            times, states = _all_steps(stepper, epsilon, problem.span, int(steps))
        except bs.integrators.StepError:
            return inf, work
        if times[-1] < problem.span * (1 - 1e-12):
            return inf, work
        seen = states[first_after(problem, times)]
        count, size = len(times), len(problem.positions)
        return problem.energy_error(seen[:, size:], _velocities(seen[:, :size], problem.masses)), work

    return Curve(OURS, "", f"{method}, σ = {control}", problem.name, measure(step_counts(problem), at, budget))


def _all_steps(stepper: Any, epsilon: float, span: float, chunk: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and states after every step up to the first that ends at or after `span`, or until there are too many."""
    import numpy as np

    state, chunks = stepper.start(h=epsilon), []
    while state.t < span and len(chunks) < MOST_STEPS:
        times, rows = np.empty(chunk), np.empty((chunk, len(state.y)))
        stepper.record(state, chunk, y_every=1, y_rows=rows, y_times=times)
        chunks.append((times, rows))
    times, rows = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    count = int(np.searchsorted(times, span * (1 - 1e-12))) + 1
    return times[:count], rows[:count]


def rival_curves(environment: Path, package: str, problem: Problem, *, budget: float = BUDGET) -> list[Curve]:
    """The curves of a package installed in this virtual environment; none if it is not.

    Raises:
        RuntimeError: The package is there, but its run fails.
    """
    python = environment.resolve() / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    task = json.dumps({"package": package, "problem": problem._asdict(), "budget": budget})
    look = f"import importlib.util as u, sys; sys.exit(u.find_spec({package!r}) is None)"
    if not python.exists() or subprocess.run([python, "-c", look], capture_output=True).returncode:
        return []
    ended = subprocess.run(
        [python, WORKER],
        input=task,
        capture_output=True,
        text=True,
        env={**os.environ, **ONE_THREAD},
        timeout=TIMEOUT,
    )
    if ended.returncode:
        raise RuntimeError(f"{package} on {problem.name} failed: {ended.stderr.strip().rpartition(chr(10))[2]}")
    answer = json.loads(ended.stdout)
    return [
        Curve(package, answer["version"], method, problem.name, [Point(*point) for point in points])
        for method, points in answer["curves"].items()
    ]


def leads(curves: Sequence[Curve]) -> list[dict[str, Any]]:
    """For each error the least CPU seconds of ours, and how many times as long the best of each kind of rival takes.

    None where one of the two does not reach the error. The curves are those of one problem.
    """
    rows = []
    for error in ERRORS:
        mine = best((curve for curve in curves if curve.package == OURS), error)
        row: dict[str, Any] = {"error": error, OURS: mine}
        for kind, (package, method) in RIVALS.items():
            theirs = best((c for c in curves if c.package == package and c.method.startswith(method)), error)
            row[kind] = theirs / mine if theirs is not None and mine is not None else None
        rows.append(row)
    return rows
