"""Errors expected of a run, extrapolated from a perturbation run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from bseries.advice.conservation import gradient
from bseries.advice.distances import energy_size, largest_size, norms, without_time
from bseries.advice.growth import (
    EVEN,
    REGULAR,
    agreed,
    disagreement,
    energy_after,
    is_unbounded,
    most_disagreement,
    parts_of,
    power,
    size_after,
    size_of_states_after,
)
from integrators.runs.observers import observers

if TYPE_CHECKING:
    import numpy as np

    from bseries.advice.prediction.perturbation_run import PerturbationRun
    from integrators import Scene


AGREEMENT = 2.0
"""Largest ratio of two estimates of an error."""
SIGNIFICANT = 1e-8
"""Smaller relative effects of the modified equation may be rounding of the perturbation run."""
SMALL = 0.02
"""Largest relative distance at which the nonlinear solution converges in a few iterations."""
ROUNDING = 1e-14
"""Smaller relative errors are dominated by rounding."""
LARGEST_CHANGE = 0.05
"""Largest relative drift of an energy on the same orbit; an oscillation may be as large as the energy."""
SAMPLES = 512
"""Number of states at which energies are compared."""
BOUND = 0.5
"""Errors reduced below this part by the bounds of the orbit have reached its size."""
NEAR = 1e-2
"""Largest displacement, relative to the size of the orbit, that is linear in the impulses."""
BEYOND = 2.0
"""Largest displacement of a variable, relative to its range, in motion of the same kind."""

NO_ENERGY = "there is no energy that the scene conserves"
TERMS_DIFFER = "terms of the modified equation up to h^{last} and one less lead to errors that differ by more than 2"
ANOTHER_ORBIT = "the energy changes so much that the orbit is another one"
UNKNOWN_GROWTH = "how it grows cannot be told from the time to t = {last:.3g}"
ONLY_ROUNDING = "rounding will be larger"
OF_HIGHER_ORDER = "to first order it does not change on this orbit, beside which it would"
NOT_SMALL = "the modified equation leads to another orbit, as in chaos or next to a separatrix"


class ExpectedError(NamedTuple):
    """An expected error, or the reason why it is unknown.

    Attributes:
        value: The error; None if unknown.
        reason: The reason, or a remark on the value; may be empty.

    Example:
        >>> print(ExpectedError(2.13e-7), ExpectedError(None, "there is no energy"))
        2.1e-07 unknown: there is no energy
    """

    value: float | None
    reason: str = ""

    def __str__(self) -> str:
        text = "unknown" if self.value is None else f"{self.value:.1e}"
        return f"{text}: {self.reason}" if self.reason else text

    @property
    def is_due_to_orbit(self) -> bool:
        """Whether the reason lies in the solution, and not in the method or its step."""
        unknown_growth = UNKNOWN_GROWTH.partition("{")[0]
        return self.reason in (ANOTHER_ORBIT, NOT_SMALL) or self.reason.startswith(unknown_growth)


def _with_rounding(value: float) -> ExpectedError:
    """A known error, with a remark if rounding is larger."""
    return ExpectedError(value, "" if value > ROUNDING else ONLY_ROUNDING)


def expected_energy_error(
    scene: Scene, run: PerturbationRun, times: float, y0: np.ndarray, drifts: bool, nearby: float
) -> ExpectedError:
    """The largest change of the energy.

    Args:
        scene: The scene.
        run: The perturbation run.
        times: The length of the run to predict, as a multiple.
        y0: The start.
        drifts: Whether energies may drift.
        nearby: The change of the energy near this orbit within the time scale.
    """
    if run.changes is None:
        return ExpectedError(None, NO_ENERGY)
    size = energy_size(scene, y0)
    expected, fewer = (
        energy_after(run.changes[:terms].sum(axis=0) / size, times, drifts=drifts)
        for terms in (len(run.changes), max(1, len(run.changes) - 1))
    )
    if expected.high < ROUNDING:
        is_higher = (nearby / size) ** 2 > ROUNDING  # second-order effects are about the square of first-order ones
        return ExpectedError(None, OF_HIGHER_ORDER) if is_higher else _with_rounding(expected.value)
    if disagreement(expected.value, fewer.value) > AGREEMENT:
        return ExpectedError(None, TERMS_DIFFER.format(last=run.powers[-1]))
    if expected.value * size > (LARGEST_CHANGE if drifts else 1.0) * _energy_of_orbit(scene, run):
        return ExpectedError(None, ANOTHER_ORBIT)
    if not _changes_linearly(scene, run, run.changes, size):
        return ExpectedError(None, NOT_SMALL)
    if expected.disagreement > most_disagreement(drifts):
        return ExpectedError(None, UNKNOWN_GROWTH.format(last=run.t[-1]))
    return _with_rounding(expected.value)


def _points_nearby(scene: Scene, run: PerturbationRun) -> int:
    """The number of points at which the nonlinear solution is near the flow."""
    import numpy as np

    sizes = norms(without_time(scene, run.nonlinear))
    away = np.flatnonzero(~(sizes <= SMALL * largest_size(without_time(scene, run.y))))
    return int(away[0]) if len(away) else len(sizes)


def _changes_linearly(scene: Scene, run: PerturbationRun, changes: np.ndarray, size: float) -> bool:
    """Whether the energy of the nonlinear solution changes as it does to first order."""
    import numpy as np

    energy, at = observers(scene, "energy"), np.linspace(0, _points_nearby(scene, run) - 1, SAMPLES).astype(int)
    there, here = (
        np.array([energy(t, y)[0] for t, y in zip(run.t[at], states[:, at].T, strict=True)])
        for states in (run.y + run.nonlinear, run.y)
    )
    nonlinear, linear = (float(abs(x).max()) / size for x in (there - here, changes.sum(axis=0)[at]))
    return max(nonlinear, linear) < SIGNIFICANT or disagreement(nonlinear, linear) <= AGREEMENT


def _energy_of_orbit(scene: Scene, run: PerturbationRun) -> float:
    """The mean of Σ |∂H/∂y_i · y_i| / 2, which is H for oscillators and independent of additive constants.

    Unbounded variables such as angles enter with their sizes.
    """
    import numpy as np

    slopes, places = abs(gradient(scene)(run.y)), np.minimum(abs(run.y), run.sizes[:, None])
    return float((slopes * places).sum(axis=0).mean() / 2)


def expected_solution_error(
    scene: Scene, run: PerturbationRun, times: float, drifts: bool, energy: ExpectedError
) -> ExpectedError:
    """The largest error of the solution, relative to the largest state of the whole run."""
    import numpy as np

    if energy.reason in (ANOTHER_ORBIT, NOT_SMALL):
        return energy
    seen, y = run.checked.shape[1], without_time(scene, run.y)
    if disagreement(*(norms(e).max() for e in (run.errors[:, :seen], run.checked))) > AGREEMENT:
        return ExpectedError(None, TERMS_DIFFER.format(last=run.powers[-1]))
    unbounded = np.array([is_unbounded(row) for row in y])
    ranges = np.where(unbounded, math.inf, np.ptp(y, axis=1))
    errors = _errors(scene, run, ranges)
    if errors is None:
        return ExpectedError(None, NOT_SMALL)
    grown, left = zip(*(_grown(errors, ranges, drifts, *part) for part in parts_of(y.shape[1], times)), strict=True)
    expected, states, ends = agreed(grown), size_of_states_after(y, times), min(left) < BOUND
    value = expected.value / states.value
    is_linear = run.displacement < NEAR * largest_size(without_time(scene, run.sizes[:, None]))
    has_no_bound = value > BOUND and bool(unbounded.any())  # for the errors of unbounded variables
    grows_evenly = expected.disagreement <= REGULAR and states.disagreement <= EVEN
    may_leave = ends and drifts and energy.reason == NO_ENERGY  # the method may leave the bounds of the orbit
    if not grows_evenly or has_no_bound or may_leave or not (ends or is_linear):
        return ExpectedError(None, UNKNOWN_GROWTH.format(last=run.t[-1]) + ", as in chaos")
    return ExpectedError(value, "as large as orbits are") if ends else _with_rounding(value)


def _errors(scene: Scene, run: PerturbationRun, ranges: np.ndarray) -> np.ndarray | None:
    """The errors, without the time; None if they are no longer of first order and unknown.

    While the nonlinear solution stays near the flow it gives the errors. Otherwise it decides whether the first-order
    errors are valid, within the bounds of the orbit.
    """
    import numpy as np

    errors, nonlinear = (without_time(scene, e) for e in (run.errors, run.nonlinear))
    size, known = largest_size(without_time(scene, run.y)), np.isfinite(nonlinear).all(axis=0)
    if (abs(nonlinear[:, known]).max(axis=1) > BEYOND * ranges + SIGNIFICANT * size).any():
        return None
    away, linear = (norms(np.minimum(abs(e[:, known]), ranges[:, None])).max() for e in (nonlinear, errors))
    if away <= SIGNIFICANT * size:
        return errors
    if away < SMALL * size:
        return nonlinear if known.all() else None
    return errors if disagreement(away, linear) <= REGULAR else None


def _grown(errors: np.ndarray, ranges: np.ndarray, drifts: bool, points: int, factor: float) -> tuple[float, float]:
    """The size of grown errors, and the part of it that remains within the ranges of the variables."""
    import numpy as np

    each = np.array([[size_after(abs(row[:points]), factor, power(drifts))] for row in errors])
    left = float(norms(np.minimum(each, ranges[:, None]))[0] / norms(each)[0]) if each.any() else 1.0
    return size_after(norms(errors)[:points], factor, power(drifts)) * left, left
