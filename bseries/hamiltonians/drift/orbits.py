"""Closed orbits of systems of two variables, and means along them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exceptions import SeriesError
from integrators.core.errors import IntegratorError
from integrators.reference.solution import first_step, reference_solution

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from integrators.scenes.scene import Scene


DIGITS = 15
"""Digits that means are certain to."""
WORKING_DIGITS = 30
LEAST_POINTS, MOST_POINTS = 64, 2**14


def mean_of_samples(samples: Callable[[int], Sequence[Any]]) -> Any:
    """The mean of a smooth periodic function, by the trapezoidal rule: for such functions it converges exponentially.

    Args:
        samples: Gives the values at so many equally spaced points of a period, as numbers of mpmath.

    Returns:
        The mean; 0 where it is below 10^−15 of the mean size.

    Raises:
        SeriesError: The points that are allowed do not suffice.

    Example:
        >>> import mpmath
        >>> f = lambda x: 1 / (2 + mpmath.cos(x))
        >>> mean = mean_of_samples(lambda n: [f(2 * mpmath.pi * j / n) for j in range(n)])
        >>> print(mpmath.nstr(mean * mpmath.sqrt(3), 15))
        1.0
    """
    import mpmath

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
"""At how many times a return is looked for: in the last window a period has at least half as many."""
FIRST_WINDOW, MOST_DOUBLINGS = 1 / 64, 16
"""The first window, at most so much of the shortest period there can be, and how often it is doubled."""
STEP_DIGITS = 15
"""A step of a Taylor series with so many digits is no longer than the first window, either."""
CORRECTIONS, CLOSED, CERTAIN, AT_REST = 7, 1e-20, 1e-15, 1e-13


class Orbit(NamedTuple):
    """A closed orbit of a scene of two variables.

    Attributes:
        scene: The scene.
        y0: Where it starts.
        period: The time of a revolution, to 15 digits or (away from separatrices) some 25; 0 at an equilibrium.
        turns: How often the variables that are angles go round in that time, with their signs.
    """

    scene: Scene
    y0: tuple[float, ...]
    period: Any
    turns: dict[int, int]

    @property
    def kind(self) -> str:
        """``"rotating"``, ``"oscillating"`` or ``"equilibrium"``."""
        if not self.period:
            return "equilibrium"
        return "rotating" if any(self.turns.values()) else "oscillating"

    def mean(self, formula: sympy.Expr) -> Any:
        """The mean of a function over time; 0 where it is below 10^−15 of the mean size.

        Raises:
            SeriesError: The formula has parameters, or changes too fast.
        """
        import mpmath
        import sympy

        symbols = self.scene.symbols
        if others := formula.free_symbols - set(symbols):
            raise SeriesError(f"method must have numbers for its parameters, but has {min(map(str, others))}")
        function = sympy.lambdify(symbols, formula, "mpmath", cse=True)
        with mpmath.workdps(WORKING_DIGITS):
            if not self.period:
                return mpmath.mpf(function(*self.y0))

            def samples(points: int) -> list[Any]:
                times = [self.period * (j + 1) / points for j in range(points)]
                return [mpmath.mpf(function(*y)) for y in _states(self.scene, self.y0, times)]

            return mean_of_samples(samples)


def closed_orbit(scene: Scene, y0: Sequence[float], periods: Mapping[int, sympy.Expr]) -> Orbit:
    """The orbit of a scene of two variables through a point, followed by Taylor series until it closes.

    No period is shorter than 2π/L, L being the Lipschitz constant of the field. Windows of time begin with a part of
    that, L taken at the start, or with a step of the Taylor series where L is much larger elsewhere on the orbit. They
    are doubled until there is a return in one.

    Args:
        scene: The scene.
        y0: The point.
        periods: Those of the variables that are angles, by their places.

    Raises:
        SeriesError: The orbit does not close, or takes too long; rounding decides when it returns, as on a separatrix;
            or a parameter has no value.

    Example:
        >>> import bseries as bs, mpmath
        >>> orbit = closed_orbit(bs.scene("pendulum"), (0.0, 1.0), {})
        >>> orbit.kind, abs(orbit.period - 4 * mpmath.ellipk(mpmath.sin(0.5) ** 2)) < 1e-14
        ('oscillating', True)

    References:
        J. A. Yorke, Proc. Amer. Math. Soc. 22 (1969) 509–512, doi:10.1090/S0002-9939-1969-0245916-7.
    """
    import mpmath
    import numpy as np

    start = np.array(y0)
    field, window = _first_window(scene, start)
    with mpmath.workdps(WORKING_DIGITS):
        lengths = {i: mpmath.mpf(str(period.evalf(WORKING_DIGITS))) for i, period in periods.items()}
        if not field.any():
            return Orbit(scene, tuple(y0), mpmath.mpf(0), dict.fromkeys(lengths, 0))
        for _ in range(MOST_DOUBLINGS):
            times = window * np.arange(1, GRID + 1) / GRID
            try:
                states = reference_solution(scene, times, y0=start, full=True).high
            except IntegratorError:
                break
            for guess in _candidates(times, states - start[:, None], field, lengths):
                if (found := _refined(scene, start, guess, field, lengths)) is not None:
                    return Orbit(scene, tuple(y0), *found)
            window *= 2
    raise SeriesError(
        f"y0 must lie on a closed orbit, but from {list(y0)!s:.60} nothing returned up to t = {window:.4g}"
    )


def _states(scene: Scene, y0: Any, times: Sequence[Any]) -> np.ndarray:
    """The solution at some times as numbers of mpmath, a row for each time."""

    return reference_solution(scene, times, y0=y0, full=True).numbers().T


def _first_window(scene: Scene, start: np.ndarray) -> tuple[np.ndarray, float]:
    """The field at the start (0 if it is but rounding errors), and where to look first for a return."""
    import numpy as np
    import sympy

    at_start = dict(zip(scene.symbols, start.tolist(), strict=True))
    formulas = sympy.Matrix(scene.field)
    field, slopes = (np.array(m.subs(at_start).tolist()) for m in (formulas, formulas.jacobian(scene.symbols)))
    try:
        field, steepest = field.astype(float).ravel(), float(np.linalg.norm(slopes.astype(float)))
    except TypeError:
        raise SeriesError(f"scene must have numbers for its parameters, but {scene.name} has symbols") from None
    at_rest = np.linalg.norm(field) <= AT_REST * steepest * (1 + np.linalg.norm(start))
    longest = FIRST_WINDOW * 2 * np.pi / steepest if steepest else 1.0
    return field * (not at_rest), first_step(scene, longest, y0=start, digits=STEP_DIGITS)


def _candidates(times: np.ndarray, away: np.ndarray, field: np.ndarray, lengths: Mapping[int, Any]) -> Iterator[float]:
    """Times at which the section through the start is crossed in the direction of the field."""
    import numpy as np

    reduced = away.copy()
    for i, length in lengths.items():
        reduced[i] -= float(length) * np.rint(away[i] / float(length))
    ahead = field @ reduced
    for k in np.flatnonzero((ahead[:-1] <= 0) & (ahead[1:] > 0)):
        yield times[k] - ahead[k] * (times[k + 1] - times[k]) / (ahead[k + 1] - ahead[k])


def _refined(
    scene: Scene, start: np.ndarray, guess: float, field: np.ndarray, lengths: Mapping[int, Any]
) -> tuple[Any, dict[int, int]] | None:
    """The period and the turns, by Newton's method; None if the orbit does not close at that time.

    Near a saddle rounding errors grow until they decide when a solution leaves it. Two solutions with different
    rounding errors then do not return together.
    """
    import mpmath
    import numpy as np

    period = mpmath.mpf(guess)
    away, turns, error = _displacement(scene, start, period, lengths)
    for _ in range(CORRECTIONS):
        period -= mpmath.fdot(away, field) / mpmath.fdot(field, field)
        if period <= 0:
            return None
        away, turns, error = _displacement(scene, start, period, lengths)
    if np.linalg.norm(error) > CERTAIN * float(period) * np.linalg.norm(field):
        raise SeriesError(
            f"y0 must lie on a closed orbit, but from {start.tolist()!s:.60} rounding decides when it returns, as on a "
            "separatrix"
        )
    return (period, turns) if max(map(abs, away)) <= CLOSED * max(1, *map(abs, start)) else None


def _displacement(
    scene: Scene, start: np.ndarray, time: Any, lengths: Mapping[int, Any]
) -> tuple[list[Any], dict[int, int], np.ndarray]:
    """How far the solution is from its start after a time but for turns, these turns, and the error."""
    import mpmath

    solution, turns = reference_solution(scene, [time], y0=start, full=True), dict[int, int]()
    away = list(solution.numbers()[:, 0] - start)
    for i, length in lengths.items():
        turns[i] = int(mpmath.nint(away[i] / length))
        away[i] -= turns[i] * length
    return away, turns, solution.error
