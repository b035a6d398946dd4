"""The two problems on which work is compared with precision, and how both are measured.

Runs in this package's interpreter and in that of the other packages (`rival_worker.py`), so it knows only NumPy.
Energy is looked at where the first step at or after each of 2,000 equidistant instants ends, by all alike, in a run of
its own: the run that is timed looks at nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import log, sqrt
from time import process_time
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import numpy as np

INSTANTS = 2000
ROUNDING = 1e-11
"""Below this, an error that does not fall is one of rounding."""
OCTAVES = 10
"""How often the smallest number of steps is doubled at most."""
REPEAT = 0.1
"""A run is repeated until this many seconds are used, and the fastest counts."""


class Problem(NamedTuple):
    """Bodies that attract each other, or, if there is one mass only, a body about a fixed centre of attraction 1.

    Positions and velocities are flat, body after body; the run ends at `span`, and takes at least `steps` steps. Each
    number of steps is about `finer` times the one before.
    """

    name: str
    title: str
    masses: list[float]
    gravity: float
    positions: list[float]
    velocities: list[float]
    span: float
    steps: int
    finer: float = sqrt(2)

    def energy_error(self, positions: Any, velocities: Any) -> float:
        """The largest relative change of energy since the start in these states, one a row; infinite if not finite."""
        import numpy as np

        with np.errstate(all="ignore"):
            energies = self._energies(np.atleast_2d(positions), np.atleast_2d(velocities))
            start = self._energies(np.array([self.positions]), np.array([self.velocities]))[0]
            error = float(np.max(np.abs(energies / start - 1)))
        return error if np.isfinite(error) else float("inf")

    def _energies(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        import numpy as np

        bodies = len(self.masses)
        x, m = q.reshape(len(q), bodies, -1), np.array(self.masses)
        kinetic = (v.reshape(x.shape) ** 2).sum(axis=2) @ m / 2
        if bodies == 1:
            return kinetic - 1 / np.sqrt((q**2).sum(axis=1))
        i, j = np.triu_indices(bodies, 1)
        distances = np.sqrt(((x[:, i] - x[:, j]) ** 2).sum(axis=2))
        return kinetic - self.gravity * (m[i] * m[j] / distances).sum(axis=1)

    def looks(self, steps: int) -> Iterator[int]:
        """How many of `steps` equal steps end at or after each instant, none twice."""
        last = 0
        for k in range(1, INSTANTS + 1):
            n = -(-k * steps // INSTANTS)
            if n > last:
                yield n
                last = n

    def instants(self) -> list[float]:
        """The instants."""
        return [self.span * k / INSTANTS for k in range(1, INSTANTS + 1)]


class Point(NamedTuple):
    """One run: the largest relative error of energy, CPU seconds, and its step size or tolerance."""

    error: float
    seconds: float
    setting: float


def measure(
    settings: Iterable[float], run: Callable[[float], tuple[float, Callable[[], Any]]], budget: float
) -> list[Point]:
    """A curve: a point for each setting, from rough to fine.

    It ends where a run takes longer than `budget` seconds, or where rounding errors stop the gain in precision; what
    is too rough to come to an end is left out. `run(setting)` gives the error, infinite for that, and a function that
    makes ready and returns the work to be timed.
    """
    points: list[Point] = []
    for setting in settings:
        error, prepare = run(setting)
        if error == float("inf"):
            continue
        rounding = bool(points) and points[-1].error <= error < ROUNDING
        points.append(Point(error, fastest(prepare), setting))
        if rounding or points[-1].seconds > budget:
            break
    return points


def fastest(prepare: Callable[[], Callable[[], Any]]) -> float:
    """CPU seconds of the fastest of several runs, each made ready before its clock starts."""
    least, used = float("inf"), 0.0
    while True:
        work = prepare()
        begin = process_time()
        work()
        seconds = process_time() - begin
        least, used = min(least, seconds), used + seconds
        if used >= REPEAT:
            return least


def first_after(problem: Problem, times: np.ndarray) -> np.ndarray:
    """For each instant, the index of the first step that ends at or after it, none twice."""
    import numpy as np

    found = np.searchsorted(times, np.array(problem.instants()) * (1 - 1e-12))
    return np.unique(np.minimum(found, len(times) - 1))


def step_counts(problem: Problem) -> list[int]:
    """Numbers of steps for methods of fixed steps."""
    return [round(problem.steps * problem.finer**k) for k in range(round(OCTAVES * log(2, problem.finer)) + 1)]


def tolerances(first: int, last: int) -> list[float]:
    """10^-first … 10^-last."""
    return [10.0**-k for k in range(first, last + 1)]
