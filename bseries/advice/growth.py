"""Extrapolation of errors in time: means over smooth windows, and the error growth fits that they give.

For regular motion, near integrable systems and away from resonances, an error is a sum of quasi-periodic functions
times powers of t: up to t for the solution of a method that has a modified Hamiltonian, or is symmetric on a reversible
system; up to t² for others, whose energy and hence frequencies drift. For chaotic motion none of this holds.
A mean with a smooth weight that vanishes at both ends of a window suppresses the oscillations faster than any power of
the window's length, and leaves a polynomial in time. The same is true of variables that grow at most linearly, such as
angles.

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
"""Length of a window, relative to the time observed."""
FADED = 0.5
"""Errors whose mean square ends below this part of its maximum do not grow further."""
NEGLIGIBLE = 1e-8
"""Windows whose mean square is a smaller part of the maximum are left out of the fit."""
PARTS = 1.0, 0.8, 0.65, 0.5
"""Parts of the time observed that must give the same estimate."""
REGULAR = 1.5
"""Largest ratio of the estimates from these parts."""
STEADY = 2.0
"""The same for energies without drift: the largest oscillation may be outside a part."""
EVEN = 1.05
"""The same for unbounded variables: a few periods determine their mean velocity."""
UNBOUNDED = 1.5
"""A variable whose range grows by a larger factor in the second half of the time is unbounded."""


class Estimate(NamedTuple):
    """Estimate for a time longer than the one observed.

    Attributes:
        value: From all data.
        low: The least value from a part of the data.
        high: The largest one.
    """

    value: float
    low: float
    high: float

    @property
    def disagreement(self) -> float:
        """The ratio of the largest to the least value."""
        return disagreement(self.low, self.high)


def disagreement(*values: float) -> float:
    """The ratio of the largest to the least value."""
    low, high = min(values), max(values)
    return 1.0 if low == high else high / low if low > 0 else math.inf


def from_parts(predict: Callable[[int, float], float], points: int, times: float) -> Estimate:
    """Estimate after a multiple of the time observed, from several parts of the data.

    Args:
        predict: Gives a value from the first n points and a factor.
        points: The number of points.
        times: The multiple; 1 means the time observed.
    """
    return agreed(predict(*part) for part in parts_of(points, times))


def parts_of(points: int, times: float) -> list[tuple[int, float]]:
    """Numbers of points of the parts, the whole first, and the multiple of time for each."""
    if times <= 1:
        return [(points, 1.0)]
    return [(max(2, round(part * points)), times / part) for part in PARTS]


def power(drifts: bool) -> int:
    """Largest power of t in the growth of solution errors for regular motion."""
    return 2 if drifts else 1


def energy_after(changes: np.ndarray, times: float, *, drifts: bool) -> Estimate:
    """Estimate of the largest energy change after a multiple of the time observed."""
    return from_parts(lambda n, factor: change_after(changes[:n], factor, drifts=drifts), len(changes), times)


def most_disagreement(drifts: bool) -> float:
    """Largest accepted ratio of energy estimates from different parts."""
    return REGULAR if drifts else STEADY


def agreed(values: Iterable[float]) -> Estimate:
    """The first value, which is from all data, with the least and the largest one."""
    values = tuple(values)
    return Estimate(values[0], min(values), max(values))


def window_means(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres of windows, and smooth means over them, of values at equidistant times from 0 to 1.

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
    """Largest error after a multiple of the time observed.

    A polynomial is fitted to the window means of the squared error. Growth is at least linear, since after few periods
    the means still oscillate and the polynomial may decrease; only errors that have faded stay as they are.

    Args:
        errors: Sizes of errors at equidistant times from 0 on.
        times: The multiple, 1 or more.
        power: The largest power of t in their growth, 1 or 2.

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
    used = means > NEGLIGIBLE * means.max()
    centres, means = centres[used], means[used]
    columns = centres[:, None] ** np.arange(2 * power + 1) / means[:, None]
    fit = np.linalg.lstsq(columns, np.ones(len(means)), rcond=None)[0]
    seen, later = (np.polynomial.polynomial.polyval(x, fit) for x in (np.linspace(0, 1, len(errors))[middle:], times))
    peak = float((errors[middle:] / np.sqrt(np.maximum(seen, means.min() / 2))).max())
    return largest * max(times, peak * max(float(later), 0.0) ** 0.5)


def change_after(changes: np.ndarray, times: float, *, drifts: bool) -> float:
    """Largest change after a multiple of the time observed: an oscillation plus, if there can be one, a drift.

    Args:
        changes: The changes at equidistant times from 0 on.
        times: The multiple, 1 or more.
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


def is_unbounded(values: np.ndarray) -> bool:
    """Whether the range of a variable keeps growing.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 100, 2001)
        >>> is_unbounded(np.cos(t)), is_unbounded(0.2 * t + np.cos(t))
        (False, True)
    """
    import numpy as np

    return bool(np.ptp(values) > UNBOUNDED * np.ptp(values[: len(values) // 2 + 1]))


def size_of_states_after(y: np.ndarray, times: float) -> Estimate:
    """Largest norm of states after a multiple of the time observed.

    Bounded variables keep their size; unbounded ones continue at their mean velocity.

    Args:
        y: States (variables, n) without the time, at equidistant times from 0 on.
        times: The multiple, 1 or more.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 100, 2001)
        >>> f"{size_of_states_after(np.array([np.cos(t), 0.2 * t + np.sin(t)]), 100.0).value:.0f}"
        '2000'
    """
    size, each = largest_size(y), abs(y).max(axis=1)
    unbounded = [k for k, row in enumerate(y) if is_unbounded(row)]
    now = largest_size(each[:, None])

    def later(points: int, factor: float) -> float:
        sizes = each.copy()
        sizes[unbounded] = [change_after(y[k, :points], factor, drifts=True) for k in unbounded]
        return size * (largest_size(sizes[:, None]) / now)

    return from_parts(later, y.shape[1], times)
