"""How errors grow: means over smooth windows of time, and the law that they follow.

Along regular motions, near integrable systems and away from resonances, an error is a sum of quasi-periodic functions
times powers of t: up to t for the solution of a method that has a modified Hamiltonian, or is symmetric on a reversible
system; up to t² for others, whose energy and hence frequencies drift. Of chaotic motions none of this holds.
Means over windows that fade smoothly at both ends see nothing of the oscillations, faster than any power of their
length, and are polynomials of the time. So are those of variables that go on and on, as angles do, and like t at most.

References:
    HLW, sections X.3 and XI.3 (linear growth of errors of symplectic and symmetric methods); S. Das, Y. Saiki,
    E. Sander, J. A. Yorke, Quantitative quasiperiodicity, Nonlinearity 30 (2017) 4111–4140,
    doi:10.1088/1361-6544/aa84c2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, NamedTuple

from bseries.advice.distances import largest_size

if TYPE_CHECKING:
    import numpy as np

WINDOWS = 12
WINDOW = 0.3
"""The length of a window, as a part of the time."""
FADED = 0.5
"""Errors whose mean square has fallen by this factor in the end do not grow on."""
NEGLIGIBLE = 1e-8
"""Windows whose mean square is a smaller part of the largest tell nothing of a law: it would have to vanish there."""
PARTS = 1.0, 0.8, 0.65, 0.5
"""Parts of the time that must lead to the same expectations."""
REGULAR = 1.5
"""If parts lead to errors that differ by more than this factor, how they grow on is unknown."""
STEADY = 2.0
"""The same for errors of energies that do not drift: a part may have missed the largest oscillation."""
EVEN = 1.05
"""The same for variables that go on: a few turns tell their pace, and what only seems to go on betrays itself."""
GOES_ON = 1.5
"""Variables whose range grows by more in the second half of the time have no bounds."""


class Extrapolated(NamedTuple):
    """What is expected after a longer time than was seen.

    Attributes:
        value: From all that was seen.
        low: The least value from a part of it only.
        high: The largest one.
    """

    value: float
    low: float
    high: float

    @property
    def disagreement(self) -> float:
        """The largest over the smallest."""
        return disagreement(self.low, self.high)


def disagreement(*values: float) -> float:
    """The largest over the smallest of several values, 1 or more."""
    low, high = min(values), max(values)
    return 1.0 if low == high else high / low if low > 0 else math.inf


def from_parts(predict: Callable[[int, float], float], points: int, times: float) -> Extrapolated:
    """What is expected after so many times the time that was seen, from several parts of that.

    Args:
        predict: Makes a value from so many points and a factor.
        points: The number of points.
        times: The factor; 1 asks for what was seen.
    """
    return agreed(predict(*part) for part in parts_of(points, times))


def parts_of(points: int, times: float) -> list[tuple[int, float]]:
    """The parts of what was seen that are looked at, the whole first: the numbers of points, and the factors."""
    if times <= 1:
        return [(points, 1.0)]
    return [(max(2, round(part * points)), times / part) for part in PARTS]


def power(drifts: bool) -> int:
    """The power of t that errors of the solution grow with at most in regular motion."""
    return 2 if drifts else 1


def energy_after(changes: np.ndarray, times: float, *, drifts: bool) -> Extrapolated:
    """The largest change of an energy after so many times the time that was seen, from several parts of it."""
    return from_parts(lambda n, factor: change_after(changes[:n], factor, drifts=drifts), len(changes), times)


def most_disagreement(drifts: bool) -> float:
    """By what factor what parts tell of an energy may differ."""
    return REGULAR if drifts else STEADY


def agreed(values: Iterable[float]) -> Extrapolated:
    """What is expected from the whole, and the least and the most from any part."""
    values = tuple(values)
    return Extrapolated(values[0], min(values), max(values))


def window_means(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over smooth windows of values at equidistant times from 0 to 1, and the times of the windows.

    Example:
        >>> import numpy as np
        >>> x = np.linspace(0, 1, 4001)
        >>> centres, means = window_means(3 * x + np.cos(1000 * x))
        >>> bool(abs(means - 3 * centres).max() < 1e-5)
        True
    """
    import numpy as np

    length = max(3, round(WINDOW * len(values)))
    inside = np.linspace(-1, 1, length + 2)[1:-1]
    weights = np.exp(-1 / (1 - inside**2))
    weights /= weights.sum()
    starts = np.linspace(0, len(values) - length, WINDOWS).astype(int)
    means = np.array([weights @ values[k : k + length] for k in starts])
    return (starts + (length - 1) / 2) / (len(values) - 1), means


def size_after(errors: np.ndarray, times: float, power: int) -> float:
    """The largest error after so many times the time that was seen.

    It grows like the polynomial that the means of its square over windows are, and like t at least: where few turns
    were seen means are not free of oscillations yet, and such a polynomial may fall. Only errors that have faded stay.

    Args:
        errors: Sizes of errors at equidistant times from 0 on.
        times: The factor, 1 or more.
        power: The power of t that they grow with at most, 1 or 2.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 100, 2001)
        >>> f"{size_after(t * (2 + np.sin(t)) * 1e-9, 1000.0, 1):.1e}"
        '3.0e-04'
    """
    import numpy as np

    largest, middle = float(errors.max()), len(errors) // 2
    if times <= 1 or not largest or not math.isfinite(largest):
        return largest
    if len(errors) < WINDOWS:
        return largest * times**power
    errors = errors / largest
    centres, means = window_means(errors**2)
    if means[-1] < FADED * means.max():
        return largest
    tells = means > NEGLIGIBLE * means.max()
    centres, means = centres[tells], means[tells]
    columns = centres[:, None] ** np.arange(2 * power + 1) / means[:, None]
    law = np.linalg.lstsq(columns, np.ones(len(means)), rcond=None)[0]
    seen, later = (np.polynomial.polynomial.polyval(x, law) for x in (np.linspace(0, 1, len(errors))[middle:], times))
    peak = float((errors[middle:] / np.sqrt(np.maximum(seen, means.min() / 2))).max())
    return largest * max(times, peak * max(float(later), 0.0) ** 0.5)


def change_after(changes: np.ndarray, times: float, *, drifts: bool) -> float:
    """The largest change after so many times the time that was seen: an oscillation, and a drift where there can be.

    Args:
        changes: The changes at equidistant times from 0 on.
        times: The factor, 1 or more.
        drifts: Whether there can be a drift.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 100, 2001)
        >>> round(change_after(np.sin(t) ** 2 + 1e-3 * t, 1000.0, drifts=True))
        101
    """
    import numpy as np

    largest = float(abs(changes).max())
    if not drifts or times <= 1:
        return largest
    if len(changes) < WINDOWS:
        return largest * times
    centres, means = window_means(changes)
    slope = float(np.polyfit(centres, means, 1)[0])
    rest = changes - slope * np.linspace(0, 1, len(changes))
    return float(max(abs(rest).max(), abs(rest + slope * times).max()))


def goes_on(values: np.ndarray) -> bool:
    """Whether a variable has no bounds, but moves on and on.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 100, 2001)
        >>> goes_on(np.cos(t)), goes_on(0.2 * t + np.cos(t))
        (False, True)
    """
    import numpy as np

    return bool(np.ptp(values) > GOES_ON * np.ptp(values[: len(values) // 2 + 1]))


def size_of_states_after(y: np.ndarray, times: float) -> Extrapolated:
    """The largest norm of states after so many times the time that was seen, from several parts of it.

    Variables with bounds stay as large as they were, others go on at the mean pace of the part.

    Args:
        y: States (variables, n) without the time, at equidistant times from 0 on.
        times: The factor, 1 or more.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 100, 2001)
        >>> f"{size_of_states_after(np.array([np.cos(t), 0.2 * t + np.sin(t)]), 100.0).value:.0f}"
        '2000'
    """
    size, each = largest_size(y), abs(y).max(axis=1)
    on = [k for k, row in enumerate(y) if goes_on(row)]
    now = largest_size(each[:, None])

    def later(points: int, factor: float) -> float:
        sizes = each.copy()
        sizes[on] = [change_after(y[k, :points], factor, drifts=True) for k in on]
        return size * (largest_size(sizes[:, None]) / now)

    return from_parts(later, y.shape[1], times)
