"""Work for a given precision: curves of error against CPU time, ours and those of other packages."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from math import inf, log, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs

from .problems import Point, Problem, measure, step_counts

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

    from .c_steps import Run

WORKER = Path(__file__).with_name("rival_worker.py")
PACKAGES = ("scipy", "rebound", "heyoka")
ERRORS = tuple(10.0**-k for k in range(3, 14))
BUDGET = 1.0
"""A curve ends with its first run that takes longer: CPU seconds."""
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}


class Curve(NamedTuple):
    """What one method needs on one problem: a point for every step size or tolerance."""

    package: str
    method: str
    problem: str
    points: list[Point]

    def seconds(self, error: float) -> float | None:
        """CPU seconds that reach this error, between points by a straight line between logarithms.

        A point counts if no other is both faster and more precise. For an error larger than all, it is the least time
        measured; for one smaller than all, None.
        """
        front = _front(self.points)
        if not front or error < front[-1].error:
            return None
        if error >= front[0].error:
            return front[0].seconds
        after = next(k for k, point in enumerate(front) if point.error <= error)
        rough, fine = front[after - 1], front[after]
        part = log(rough.error / error) / log(rough.error / fine.error)
        return rough.seconds * (fine.seconds / rough.seconds) ** part

    def to_dict(self) -> dict[str, Any]:
        """The curve for JSON."""
        return {**self._asdict(), "points": [list(point) for point in self.points]}


def _front(points: Iterable[Point]) -> list[Point]:
    """The points that no other beats in both, from the fastest to the most precise."""
    front: list[Point] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.error)):
        if 0 < point.error < (front[-1].error if front else inf):
            front.append(point)
    return front


def best(curves: Iterable[Curve], error: float) -> float | None:
    """The least CPU seconds in which one of these curves reaches an error; None if none does."""
    return min((t for curve in curves if (t := curve.seconds(error)) is not None), default=None)


def problems() -> list[Problem]:
    """Kepler's with eccentricity 0.6 over 200 periods, and the outer solar system over a million days."""
    kepler, solar = bs.scene("kepler"), bs.scene("outer-solar-system")
    parameters: Any = solar.parameters
    masses = [float(m) for m in parameters["m"]]
    return [
        Problem("kepler", "Kepler, e = 0.6, 200 periods", [1.0], 1.0, *_start(kepler, [1.0]), 400 * pi, 4000),
        Problem(
            "outer-solar-system",
            "outer solar system, 10⁶ days",
            masses,
            float(parameters["G"]),
            *_start(solar, masses),
            1e6,
            1000,
        ),
    ]


def _start(scene: Any, masses: Sequence[float]) -> tuple[list[float], list[float]]:
    p, q = scene.y0.reshape(2, -1)
    return q.tolist(), _velocities(p, masses).tolist()


def _velocities(p: np.ndarray, masses: Sequence[float]) -> np.ndarray:
    import numpy as np

    return p / np.repeat(masses, p.shape[-1] // len(masses))


def our_curve(
    problem: Problem, method: str, run: Run, *, package: str = "ours", octaves: int = 9, budget: float = BUDGET
) -> Curve:
    """The curve of a fixed-step method of ours on the scene that bears the problem's name."""
    import numpy as np

    start, size = bs.scene(problem.name).y0, len(problem.positions)

    def at(steps: float) -> tuple[float, Callable[[], Callable[[], None]]]:
        n, h = int(steps), problem.span / steps

        def work() -> Callable[[], None]:
            y = start.copy()
            return lambda: run(y, h, n)

        y, done, seen = start.copy(), 0, []
        for look in problem.looks(n):
            run(y, h, look - done)
            seen.append(y.copy())
            done = look
        states = np.array(seen)
        return problem.energy_error(states[:, size:], _velocities(states[:, :size], problem.masses)), work

    return Curve(package, method, problem.name, measure(step_counts(problem, octaves), at, budget))


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
        [python, WORKER], input=task, capture_output=True, text=True, env={**os.environ, **ONE_THREAD}
    )
    if ended.returncode:
        raise RuntimeError(f"{package} on {problem.name} failed: {ended.stderr.strip().rpartition(chr(10))[2]}")
    answer = json.loads(ended.stdout)
    name = f"{package} {answer['version']}"
    return [
        Curve(name, method, problem.name, [Point(*point) for point in points])
        for method, points in answer["curves"].items()
    ]


def leads(ours: Sequence[Curve], others: Mapping[str, Sequence[Curve]]) -> list[dict[str, Any]]:
    """How many times faster ours reaches each error than the best method of each of the others; None if either fails."""
    rows = []
    for error in ERRORS:
        mine = best(ours, error)
        row: dict[str, Any] = {"error": error, "ours": mine}
        for name, curves in others.items():
            theirs = best(curves, error)
            row[name] = theirs / mine if theirs is not None and mine is not None else None
        rows.append(row)
    return rows
