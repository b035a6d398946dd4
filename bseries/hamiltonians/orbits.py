"""Closed orbits of systems of two variables, and means along them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import mpmath
import numpy as np
import sympy

from bseries.exceptions import SeriesError
from bseries.fields.inputs import MpNumber
from integrators.core.errors import IntegratorError
from integrators.exact.functions import as_function
from integrators.reference.solution import first_step, reference_solution
from integrators.scenes.scene import Scene

DIGITS = 15  # digits of accuracy of means
WORKING_DIGITS = 30
LEAST_POINTS, MOST_POINTS = 64, 2**14
"""Points of the first and of the last trapezoidal sum; each further sum has twice as many."""


def mean_of_samples(samples: Callable[[int], Sequence[MpNumber]]) -> MpNumber:
    """The mean of a smooth periodic function, by the trapezoidal rule, which converges exponentially.

    `samples` gives the values at n equidistant points of a period, as numbers of mpmath. The mean is 0 if it is below
    10^−15 of the mean of absolute values.
    """
    with mpmath.workdps(WORKING_DIGITS):
        points, before = LEAST_POINTS, None
        while points <= MOST_POINTS:
            values = samples(points)
            mean, size = mpmath.fsum(values) / points, mpmath.fsum(map(abs, values)) / points
            least = size * mpmath.mpf(10) ** -DIGITS
            if before is not None and abs(mean - before) <= least:
                return mpmath.mpf(0) if abs(mean) <= least else mean
            points, before = 2 * points, mean
    raise SeriesError(f"rates must be smoother: {MOST_POINTS} points of an orbit do not give their mean")


GRID = 256
"""Number of times in a window at which a return is sought; at least half of them lie in the first period."""
FIRST_WINDOW, MOST_DOUBLINGS = 1 / 64, 16
"""First window, as a fraction of the shortest possible period, and the largest number of doublings."""
STEP_DIGITS = 15  # digits of a Taylor step; the first window is no longer than such a step
CORRECTIONS, CLOSED = 7, 1e-20
"""Newton steps from a guess of few digits to 30, and the largest remaining gap, relative to the size of the orbit."""
CERTAIN, AT_REST = 1e-15, 1e-13
"""Largest relative errors: of a period, and of a field that is only rounding error (a thousand units of roundoff)."""


class Orbit(NamedTuple):
    """A closed orbit of a scene of two variables."""

    scene: Scene
    y0: tuple[float, ...]
    period: MpNumber  # the time of a revolution, to 15 digits or (away from separatrices) about 25; 0 at an equilibrium
    revolutions: dict[int, int]  # the signed number of periods that each angle completes in that time

    @property
    def kind(self) -> str:
        """``"rotating"``, ``"oscillating"`` or ``"equilibrium"``."""
        if not self.period:
            return "equilibrium"
        return "rotating" if any(self.revolutions.values()) else "oscillating"

    def mean(self, formula: sympy.Expr) -> MpNumber:
        """The time average of a function; 0 if it is below 10^−15 of the average of absolute values."""
        symbols = self.scene.symbols
        if others := formula.free_symbols - set(symbols):
            raise SeriesError(f"method must have numbers for its parameters, but has {min(map(str, others))}")
        function = as_function(symbols, formula, "mpmath")
        with mpmath.workdps(WORKING_DIGITS):
            if not self.period:
                return mpmath.mpf(function(*self.y0))

            def samples(points: int) -> list[MpNumber]:
                times = [self.period * (j + 1) / points for j in range(points)]
                states = reference_solution(self.scene, times, y0=self.y0, full=True).numbers()
                return [mpmath.mpf(function(*y)) for y in states.T]

            return mean_of_samples(samples)


def closed_orbit(scene: Scene, y0: Sequence[float], periods: Mapping[int, sympy.Expr]) -> Orbit:
    """The closed orbit of a scene of two variables through a point, computed by Taylor series.

    No period is shorter than 2π/L, where L is the Lipschitz constant of the field in any units of the variables (J. A.
    Yorke, Proc. Amer. Math. Soc. 22 (1969) 509–512). The first window of time is a fraction of 2π/L, with L at the
    start in the units that make it least. It is at most a step of the Taylor series, since L may be much larger
    elsewhere on the orbit. The window is doubled until it contains a return. `periods` are those of angles, by index of
    the variable.
    """
    start = np.array(y0)
    field, window = _first_window(scene, start)
    searched = 0.0
    with mpmath.workdps(WORKING_DIGITS):
        numbers = {i: mpmath.mpf(str(period.evalf(WORKING_DIGITS))) for i, period in periods.items()}
        if not field.any():
            return Orbit(scene, tuple(y0), mpmath.mpf(0), dict.fromkeys(numbers, 0))
        for _ in range(MOST_DOUBLINGS):
            times = window * np.arange(1, GRID + 1) / GRID
            try:
                states = reference_solution(scene, times, y0=start, full=True).high
            except IntegratorError:
                break
            sizes = np.abs(states).max(axis=1)
            for guess in _candidates(times, states - start[:, None], field, numbers):
                if (found := _refined(scene, start, guess, field, numbers, sizes)) is not None:
                    return Orbit(scene, tuple(y0), *found)
            window, searched = 2 * window, window
    raise SeriesError(
        f"y0 must lie on a closed orbit, but from {list(y0)!s:.60} nothing returned up to t = {searched:.4g}, "
        "where the search ended"
    )


def _first_window(scene: Scene, start: np.ndarray) -> tuple[np.ndarray, float]:
    """The field at the start (0 if it is only rounding error), and the first window for a return."""
    at_start = dict(zip(scene.symbols, start.tolist(), strict=True))
    formulas = sympy.Matrix(scene.field)
    field, jacobian = (np.array(m.subs(at_start).tolist()) for m in (formulas, formulas.jacobian(scene.symbols)))
    try:
        field, sizes = field.astype(float).ravel(), np.abs(jacobian.astype(float))
    except TypeError:
        raise SeriesError(f"scene must have numbers for its parameters, but {scene.name} has symbols") from None
    at_rest = (np.abs(field) <= AT_REST * sizes @ (1 + np.abs(start))).all()
    # the least Frobenius norm of the Jacobian in any units of the variables
    lipschitz = float(np.linalg.norm(np.sqrt(sizes) * np.sqrt(sizes.T)))
    longest = FIRST_WINDOW * 2 * np.pi / lipschitz if lipschitz else 1.0
    return field * (not at_rest), first_step(scene, longest, y0=start, digits=STEP_DIGITS)


def _candidates(
    times: np.ndarray, away: np.ndarray, field: np.ndarray, periods: Mapping[int, MpNumber]
) -> Iterator[float]:
    """Times at which the section through the start is crossed in the direction of the field."""
    reduced = away.copy()
    for i, period in periods.items():
        reduced[i] -= float(period) * np.rint(away[i] / float(period))
    ahead = field / abs(field).max() @ reduced
    for k in np.flatnonzero((ahead[:-1] <= 0) & (ahead[1:] > 0)):
        yield times[k] - ahead[k] * (times[k + 1] - times[k]) / (ahead[k + 1] - ahead[k])


def _refined(
    scene: Scene, start: np.ndarray, guess: float, field: np.ndarray, periods: Mapping[int, MpNumber], sizes: np.ndarray
) -> tuple[MpNumber, dict[int, int]] | None:
    """The period and the revolutions, by Newton's method; None if the orbit does not close at that time.

    Near a saddle, rounding errors decide when a solution leaves it, and solutions with different rounding errors return
    at different times.
    """
    period = mpmath.mpf(guess)
    away, revolutions, error = _displacement(scene, start, period, periods)
    for _ in range(CORRECTIONS):
        period -= mpmath.fdot(away, field) / mpmath.fdot(field, field)
        if period <= 0:
            return None
        away, revolutions, error = _displacement(scene, start, period, periods)
    if mpmath.fdot(error, abs(field)) > CERTAIN * period * mpmath.fdot(field, field):
        raise SeriesError(
            f"y0 must lie on a closed orbit, but from {start.tolist()!s:.60} rounding decides when it returns, as on a "
            "separatrix"
        )
    return (period, revolutions) if all(abs(x) <= CLOSED * size for x, size in zip(away, sizes, strict=True)) else None


def _displacement(
    scene: Scene, start: np.ndarray, time: MpNumber, periods: Mapping[int, MpNumber]
) -> tuple[list[MpNumber], dict[int, int], np.ndarray]:
    """The displacement from the start after a time, modulo periods of angles; the numbers of periods; and the error."""
    solution, revolutions = reference_solution(scene, [time], y0=start, full=True), dict[int, int]()
    away = list(solution.numbers()[:, 0] - start)
    for i, period in periods.items():
        revolutions[i] = int(mpmath.nint(away[i] / period))
        away[i] -= revolutions[i] * period
    return away, revolutions, solution.error[:, 0]
