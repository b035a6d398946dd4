"""Expected errors from a perturbation run, and growth laws for the time beyond it.

For regular motion, near integrable systems and away from resonances, an error is a sum of quasi-periodic functions
times powers of t: up to t for the solution of a method with a modified Hamiltonian, or a symmetric one on a reversible
system; up to t² for others, whose energy and hence frequencies drift. In chaos errors grow exponentially, and there is
no law.

References:
    HLW, sections X.3 and XI.3 (linear growth of errors of symplectic and symmetric methods); S. Das, Y. Saiki,
    E. Sander, J. A. Yorke, Quantitative quasiperiodicity, Nonlinearity 30 (2017) 4111–4140,
    doi:10.1088/1361-6544/aa84c2 (smooth weights).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bseries.advice.measures import energy_size, largest_size, norms, without_time
from bseries.advice.predictions.perturbation_run import PerturbationRun
from bseries.advice.predictions.prediction import ExpectedError
from integrators.scenes.scene import Scene

PARTS = 1.0, 0.75, 0.5
"""Parts of the observed time that must lead to the same error at the end."""
REGULAR = 1.5
"""Largest ratio of these errors: half of the factor of 3 allowed for predictions."""
AGREEMENT = 2.0
"""Largest ratio of errors with all terms and with one less; by the same argument, as the next term changes less."""
STATES = 128
"""States among which the largest distance on the orbit is found: they miss the extremes of an oscillation by about
(2π/128)², some tenths of a per cent."""
FIRST_PART, SAMPLES = 1 / 8, 64
"""Start of the fit of the growth, which excludes the first period, and its number of times."""
UNBOUNDED = 1.5
"""A variable whose range grows by a larger factor in the second half of the time is unbounded: the factor of an angle
at constant pace is 2, and that of an oscillation 1."""
LINEAR = 1e-2
"""Largest relative distance that is proportional to r up to about its square."""
NEAR = 0.1
"""Errors up to this part of the size of the orbit grow freely; larger ones begin to be bounded by it."""
BEYOND = 2.0
"""Largest distance of a variable, as a multiple of its range, between motions of the same kind: twice the distance that
two solutions within that range can have."""
BOUND = 0.5
"""Errors up to this part of the size of the orbit are returned unchanged; larger ones are replaced by the size of the
orbit if they grew regularly. Errors of unbounded variables are not bounded."""
LARGEST_CHANGE = 0.05
"""Largest relative drift of an energy on one orbit: a frequency then changes by some per cent, and a law by as much."""
ROUNDING = 1e-14
"""Smaller relative errors are dominated by rounding, some tens of units in the last place."""

NO_ENERGY = "there is no energy that the scene conserves"
TERMS_DIFFER = "terms of the modified equation up to h^{last} and one less lead to errors that differ by more than 2"
ANOTHER_ORBIT = "the energy changes so much that the orbit is another one"
UNKNOWN_GROWTH = "its growth cannot be determined from the time to t = {last:.3g}"
ONLY_ROUNDING = "rounding will be larger"
NOT_SMALL = "the modified equation leads to another orbit, as in chaos or next to a separatrix"


class Estimate(NamedTuple):
    """A value at the end of a run, and the ratio of the largest to the least one from parts of the data."""

    value: float
    disagreement: float = 1.0


def disagreement(*values: float) -> float:
    """The ratio of the largest to the least value."""
    low, high = min(values), max(values)
    return 1.0 if low == high else high / low if low > 0 else math.inf


def from_parts(law: Callable[[int, float], float], points: int, times: float) -> Estimate:
    """The estimate of a law, a function of a number of points and the multiple of their time, at the end of a run."""
    if times <= 1:
        return Estimate(law(points, 1.0))
    values = [law(max(2, round(part * points)), times / part) for part in PARTS]
    return Estimate(values[0], disagreement(*values))


def size_after(sizes: np.ndarray, times: float, power: int) -> float:
    """The largest of some sizes after a multiple of the time observed, by a polynomial through their running maximum.

    Its degree is the largest power of t in their growth, 1 or 2.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 100, 2001)
        >>> f"{size_after(t * (2 + np.sin(t)) * 1e-9, 1000.0, 1):.1e}"
        '3.0e-04'
    """
    largest = np.maximum.accumulate(sizes)
    last = float(largest[-1])
    if times <= 1 or not last or not math.isfinite(last):
        return last
    count = len(sizes) - 1
    at = np.unique(np.linspace(FIRST_PART * count, count, SAMPLES).astype(int))
    if len(at) <= power + 1:
        return last * times**power
    fit = np.polynomial.Polynomial.fit(at / count, largest[at] / last, power)
    if power > 1 and fit.convert().coef[-1] < 0:
        return size_after(sizes, times, power - 1)
    return last * max(1.0, float(fit(times)))


def change_after(changes: np.ndarray, times: float) -> float:
    """The largest change after a multiple of the time observed: an oscillation plus a drift.

    The drift is a mean of slopes with a smooth weight that vanishes at both ends, so that oscillations cancel faster
    than any power of the time.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 100, 2001)
        >>> round(change_after(np.sin(t) ** 2 + 1e-3 * t, 1000.0))
        101
    """
    if times <= 1:
        return float(abs(changes).max())
    t = np.linspace(-1, 1, len(changes) + 2)[1:-1]
    weights = t * np.exp(-1 / (1 - t**2))
    drift = 2 * float(weights @ changes / (weights @ t))
    rest = changes - drift * np.linspace(0, 1, len(changes))
    return float(max(abs(rest).max(), abs(rest + drift * times).max()))


def expected_energy_error(
    scene: Scene,
    run: PerturbationRun,
    slopes: np.ndarray | None,
    moves: np.ndarray,
    times: float,
    y0: np.ndarray,
    is_hamiltonian: bool,
) -> ExpectedError:
    """The largest change of the energy, after a multiple of the time of the perturbation run.

    `slopes` is ∇H along the run, `moves` the distance that each variable moves within the time scale. Where terms are
    Hamiltonian, energies do not drift.
    """
    if run.changes is None or slopes is None:
        return ExpectedError(None, NO_ENERGY)
    all_changes = run.changes / energy_size(scene, y0)
    seen = float(abs(all_changes.sum(axis=0)).max())
    if seen * times < ROUNDING:
        return ExpectedError(seen, ONLY_ROUNDING)

    def estimate(terms: int) -> Estimate:
        changes = all_changes[:terms].sum(axis=0)
        found = from_parts(lambda n, factor: change_after(changes[:n], factor), len(changes), times)
        if found.disagreement > REGULAR and is_hamiltonian:
            return Estimate(float(abs(changes).max()))
        return found

    expected, fewer = estimate(len(all_changes)), estimate(max(1, len(all_changes) - 1))
    if disagreement(expected.value, fewer.value) > AGREEMENT:
        return ExpectedError(None, TERMS_DIFFER.format(last=run.powers[-1]))
    most = 1.0 if is_hamiltonian else LARGEST_CHANGE
    if expected.value * energy_size(scene, y0) > most * _energy_of_orbit(run, slopes, moves):
        return ExpectedError(None, ANOTHER_ORBIT)
    if expected.disagreement > REGULAR:
        return ExpectedError(None, UNKNOWN_GROWTH.format(last=run.t[-1]))
    return _with_rounding(expected.value)


def _energy_of_orbit(run: PerturbationRun, slopes: np.ndarray, moves: np.ndarray) -> float:
    """The mean of Σ |∂H/∂y_i · (y_i − ȳ_i)| / 2, which is H for oscillators and independent of additive constants.

    Unbounded variables count with the distance that they move while others change by their size.
    """
    away = np.minimum(abs(run.y - run.y.mean(axis=1)[:, None]), moves[:, None])
    return float((abs(slopes) * away).sum(axis=0).mean() / 2)


def expected_solution_error(
    scene: Scene, run: PerturbationRun, fewer: PerturbationRun | None, span: float, energy: ExpectedError, power: int
) -> ExpectedError:
    """The largest error of the solution, relative to the largest state of the whole run of length `span`.

    `fewer` is the beginning of a perturbation run with one term less, `power` the largest power of t in the growth of
    errors in regular motion.
    """
    if energy.reason in (ANOTHER_ORBIT, NOT_SMALL):
        return energy
    y, errors = without_time(scene, run.y), without_time(scene, run.errors)
    sizes = norms(errors)
    if fewer is not None:
        others = norms(without_time(scene, fewer.errors))
        if disagreement(sizes[: len(others)].max(), others.max()) > AGREEMENT:
            return ExpectedError(None, TERMS_DIFFER.format(last=run.powers[-1]))
    unbounded = np.ptp(y, axis=1) > UNBOUNDED * np.ptp(y[:, : y.shape[1] // 2 + 1], axis=1)  # ranges keep growing
    ranges = np.where(unbounded, math.inf, np.ptp(y, axis=1))
    if run.factor == 1 and (abs(errors).max(axis=1) > BEYOND * ranges + LINEAR * largest_size(y)).any():
        return ExpectedError(None, NOT_SMALL)
    orbit = largest_size(np.where(unbounded, abs(y).max(axis=1), ranges)[:, None])
    away = run.factor * sizes > LINEAR * largest_size(y) if run.factor > 1 else sizes > NEAR * orbit
    free = int(np.argmax(away)) if away.any() else len(away)
    times = abs(span / run.t[free - 1]) if free > 1 else math.inf
    unknown = ExpectedError(None, UNKNOWN_GROWTH.format(last=run.t[free - 1]) + ", as in chaos")
    if run.factor == 1 and abs(run.t[-1]) >= abs(span):
        if sizes.max() <= BOUND * orbit:
            return _with_rounding(float(sizes.max()) / largest_size(y))
        is_regular = sizes[:free].max() <= REGULAR * 2**power * sizes[: free // 2 + 1].max()
        return (
            ExpectedError(float(sizes.max()) / largest_size(y), "of the size of the orbit") if is_regular else unknown
        )

    some = y[:, np.linspace(0, y.shape[1] - 1, STATES).astype(int)]
    bound = math.inf if unbounded.any() else float(norms(some[:, :, None] - some[:, None, :]).max())

    def grown(points: int, factor: float) -> float:
        return min(size_after(sizes[:points], factor, power), bound)

    def largest(points: int, factor: float) -> float:
        """The largest norm of a state, to which unbounded variables grow."""
        seen = y[:, :points]
        now = abs(seen).max(axis=1)
        later = np.where(unbounded, [size_after(abs(row), factor, 1) for row in seen], now)
        return largest_size(seen) * (largest_size(later[:, None]) / largest_size(now[:, None]))

    expected, states = from_parts(grown, free, times), from_parts(largest, y.shape[1], abs(span / run.t[-1]))
    value, ends = expected.value / states.value, expected.value == bound
    has_no_bound = value > BOUND and bool(unbounded.any())
    may_leave = ends and power > 1 and energy.reason == NO_ENERGY  # the method may leave the bounds of the orbit
    if max(expected.disagreement, states.disagreement) > REGULAR or has_no_bound or may_leave:
        return unknown
    return ExpectedError(value, "of the size of the orbit") if ends else _with_rounding(value)


def _with_rounding(value: float) -> ExpectedError:
    """A known error, with a remark if rounding is larger."""
    return ExpectedError(value, "" if value > ROUNDING else ONLY_ROUNDING)
