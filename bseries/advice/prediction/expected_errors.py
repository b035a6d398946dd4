"""The errors to expect of a run: from the first terms of the modified equation along the exact flow."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.conservation import energy_rate_beside, gradient, may_drift
from bseries.advice.distances import energy_size, largest_size, norms, without_time
from bseries.advice.growth import (
    EVEN,
    REGULAR,
    agreed,
    disagreement,
    energy_after,
    goes_on,
    most_disagreement,
    parts_of,
    power,
    size_after,
    size_of_states_after,
)
from bseries.advice.modified_terms import modified_terms
from bseries.advice.prediction.perturbation_run import RESOLUTION, pilot
from bseries.exceptions import SeriesError
from integrators import IntegratorError, StepError
from integrators.runs.observers import observers

if TYPE_CHECKING:
    import numpy as np

    from bseries.advice.prediction.perturbation_run import Pilot
    from integrators import Scene
    from integrators.methods.program.program import Method


AGREEMENT = 2.0
"""Two ways to an expected error may differ by this factor."""
TELLING = 1e-8
"""If the modified equation leads away by so much of a state or an energy, that is no rounding of the pilot."""
SMALL = 0.02
"""As long as it leads no further away, in parts of a state, that solution can be made in a few passes."""
ROUNDING = 1e-14
"""Below such relative errors rounding decides."""

NO_ENERGY = "there is no energy that the scene conserves"
TERMS_DIFFER = "terms of the modified equation up to h^{last} and one less lead to errors that differ by more than 2"
ANOTHER_ORBIT = "the energy changes so much that the orbit is another one"
UNTOLD = "how it grows cannot be told from the time to t = {last:.3g}"
ONLY_ROUNDING = "rounding will be larger"
OF_HIGHER_ORDER = "to first order it does not change on this orbit, beside which it would"
NOT_SMALL = "the modified equation leads to another orbit, as in chaos or next to a separatrix"


class ExpectedError(NamedTuple):
    """An error that is expected, or why it cannot be known.

    Attributes:
        value: The error; None where it cannot be known.
        reason: Why not, or what is to be said of the value; empty if nothing.

    Example:
        >>> print(ExpectedError(2.13e-7), ExpectedError(None, "there is no energy"))
        2.1e-07 unknown: there is no energy
    """

    value: float | None
    reason: str = ""

    def __str__(self) -> str:
        text = "unknown" if self.value is None else f"{self.value:.1e}"
        return f"{text}: {self.reason}" if self.reason else text


def with_rounding(value: float) -> ExpectedError:
    """An error that is known, unless rounding is larger."""
    return ExpectedError(value, "" if value > ROUNDING else ONLY_ROUNDING)


LARGEST_CHANGE = 0.05
"""An energy that drifts by a larger part of what it is made of makes another orbit; one that oscillates, by all."""
SAMPLES = 512
"""At so many states energies are compared."""


def expected_energy_error(
    scene: Scene, found: Pilot, times: float, y0: np.ndarray, drifts: bool, beside: float
) -> ExpectedError:
    """The largest change of the energy.

    Args:
        scene: The scene.
        found: The pilot.
        times: How many times as long the run is.
        y0: The start.
        drifts: Whether energies may drift.
        beside: By how much it would change beside this orbit, while f turns.
    """
    if found.changes is None:
        return ExpectedError(None, NO_ENERGY)
    size = energy_size(scene, y0)
    expected, fewer = (
        energy_after(found.changes[:terms].sum(axis=0) / size, times, drifts=drifts)
        for terms in (len(found.changes), max(1, len(found.changes) - 1))
    )
    if expected.high < ROUNDING:
        is_higher = (beside / size) ** 2 > ROUNDING  # what is of second order is about the square of what is of first
        return ExpectedError(None, OF_HIGHER_ORDER) if is_higher else with_rounding(expected.value)
    if disagreement(expected.value, fewer.value) > AGREEMENT:
        return ExpectedError(None, TERMS_DIFFER.format(last=found.powers[-1]))
    if expected.value * size > (LARGEST_CHANGE if drifts else 1.0) * _energy_of_orbit(scene, found):
        return ExpectedError(None, ANOTHER_ORBIT)
    if not _changes_linearly(scene, found, found.changes, size):
        return ExpectedError(None, NOT_SMALL)
    if expected.disagreement > most_disagreement(drifts):
        return ExpectedError(None, UNTOLD.format(last=found.t[-1]))
    return with_rounding(expected.value)


def _followed(scene: Scene, found: Pilot) -> int:
    """How many points the solution that the modified equation leads to stays near to the flow."""
    import numpy as np

    sizes = norms(without_time(scene, found.followed))
    away = np.flatnonzero(~(sizes <= SMALL * largest_size(without_time(scene, found.y))))
    return int(away[0]) if len(away) else len(sizes)


def _changes_linearly(scene: Scene, found: Pilot, changes: np.ndarray, size: float) -> bool:
    """Whether the energy of that solution changes as it does to first order."""
    import numpy as np

    energy, at = observers(scene, "energy"), np.linspace(0, _followed(scene, found) - 1, SAMPLES).astype(int)
    there, here = (
        np.array([energy(t, y)[0] for t, y in zip(found.t[at], states[:, at].T, strict=True)])
        for states in (found.y + found.followed, found.y)
    )
    followed, linear = (float(abs(x).max()) / size for x in (there - here, changes.sum(axis=0)[at]))
    return max(followed, linear) < TELLING or disagreement(followed, linear) <= AGREEMENT


def _energy_of_orbit(scene: Scene, found: Pilot) -> float:
    """What the energy of an orbit is made of: the mean of Σ |∂H/∂y_i · y_i| / 2, which for oscillators is H.

    Unlike H it does not vanish where a constant is added. Angles go on, and count with their sizes only.
    """
    import numpy as np

    slopes, places = abs(gradient(scene)(found.y)), np.minimum(abs(found.y), found.sizes[:, None])
    return float((slopes * places).sum(axis=0).mean() / 2)


LOST = 0.5
"""What is left of errors by the bounds of an orbit, if they are beyond it."""
NEAR = 1e-2
"""How far, relative to the size of the orbit, a kicked solution may get for its distance to be linear in the kicks."""
BEYOND = 2.0
"""No variable gets further away, in parts of the range where it moves, as long as the motion is of the same kind."""


def expected_solution_error(
    scene: Scene, found: Pilot, times: float, drifts: bool, energy: ExpectedError
) -> ExpectedError:
    """The largest error of the solution, relative to the largest state of the whole run.

    Args:
        scene: The scene.
        found: The pilot.
        times: How many times as long the run is.
        drifts: Whether what is conserved may drift.
        energy: The error of the energy.
    """
    import numpy as np

    if energy.reason in (ANOTHER_ORBIT, NOT_SMALL):
        return energy
    seen, y = found.checked.shape[1], without_time(scene, found.y)
    if disagreement(*(norms(e).max() for e in (found.errors[:, :seen], found.checked))) > AGREEMENT:
        return ExpectedError(None, TERMS_DIFFER.format(last=found.powers[-1]))
    on = np.array([goes_on(row) for row in y])
    ranges = np.where(on, math.inf, np.ptp(y, axis=1))
    errors = _errors(scene, found, ranges)
    if errors is None:
        return ExpectedError(None, NOT_SMALL)
    grown, left = zip(*(_grown(errors, ranges, drifts, *part) for part in parts_of(y.shape[1], times)), strict=True)
    expected, states, ends = agreed(grown), size_of_states_after(y, times), min(left) < LOST
    value = expected.value / states.value
    is_linear = found.kicked < NEAR * largest_size(without_time(scene, found.sizes[:, None]))
    is_lost = value > LOST and bool(on.any())  # nothing says where errors of variables that go on will end
    grows_evenly = expected.disagreement <= REGULAR and states.disagreement <= EVEN
    is_unbound = ends and drifts and energy.reason == NO_ENERGY  # the method may leave what bounds the orbit
    if not grows_evenly or is_lost or is_unbound or not (ends or is_linear):
        return ExpectedError(None, UNTOLD.format(last=found.t[-1]) + ", as in chaos")
    return ExpectedError(value, "as large as orbits are") if ends else with_rounding(value)


def _errors(scene: Scene, found: Pilot, ranges: np.ndarray) -> np.ndarray | None:
    """The errors, without the time; None if they are no longer of first order, and what they are then is not known.

    Where the solution that r was added to is near all the time, it knows them best. When it is away, it says whether
    those of first order are right, up to what the bounds of the orbit make of both.
    """
    import numpy as np

    errors, followed = (without_time(scene, e) for e in (found.errors, found.followed))
    size, known = largest_size(without_time(scene, found.y)), np.isfinite(followed).all(axis=0)
    if (abs(followed[:, known]).max(axis=1) > BEYOND * ranges + TELLING * size).any():
        return None
    away, linear = (norms(np.minimum(abs(e[:, known]), ranges[:, None])).max() for e in (followed, errors))
    if away <= TELLING * size:
        return errors
    if away < SMALL * size:
        return followed if known.all() else None
    return errors if disagreement(away, linear) <= REGULAR else None


def _grown(errors: np.ndarray, ranges: np.ndarray, drifts: bool, points: int, factor: float) -> tuple[float, float]:
    """The size that errors have grown to, and the part of it that the ranges where variables move leave.

    Args:
        errors: The errors.
        ranges: The range of each variable, infinite where it goes on.
        drifts: Whether what is conserved may drift.
        points: How many points tell how they grow.
        factor: How many times as long they grow.
    """
    import numpy as np

    each = np.array([[size_after(abs(row[:points]), factor, power(drifts))] for row in errors])
    left = float(norms(np.minimum(each, ranges[:, None]))[0] / norms(each)[0]) if each.any() else 1.0
    return size_after(norms(errors)[:points], factor, power(drifts)) * left, left


def expected_errors(
    scene: Scene, method: Method, h: float, steps: int, y0: np.ndarray, t0: float, parts: Any, control: Any
) -> tuple[ExpectedError, ExpectedError, tuple[int, ...], float]:
    """The errors of energy and solution, the powers of h, and the part of the time that was gone through."""
    import numpy as np

    def unknown(reason: str) -> tuple[ExpectedError, ExpectedError, tuple[int, ...], float]:
        return ExpectedError(None, reason), ExpectedError(None, reason), (), 0.0

    def nothing(reason: str, powers: tuple[int, ...]) -> tuple[ExpectedError, ExpectedError, tuple[int, ...], float]:
        exact = ExpectedError(0.0, reason)
        return exact if scene.is_hamiltonian else ExpectedError(None, NO_ENERGY), exact, powers, 1.0

    if control is not None:
        return unknown("the modified equation is that of constant steps")
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # what is not finite is seen below
            terms = modified_terms(method, scene, parts)
            if not terms.powers or not steps:
                return nothing("only rounding", ())
            found = pilot(terms, y0, h, h * steps, t0)
    except StepError as error:
        return unknown(f"the solution could not be followed beyond t = {error.t:.3g}")
    except (IntegratorError, SeriesError) as error:
        return unknown(str(error))
    if found is None:
        return nothing(ONLY_ROUNDING, terms.powers)
    if not np.isfinite(found.errors).all():
        return unknown("terms of the modified equation are not finite along the solution")
    drifts = may_drift(terms, found.y)
    times = max(1.0, h * steps / found.t[-1])
    beside = energy_rate_beside(terms, found.y, h) * RESOLUTION * abs(found.t[1])
    energy = expected_energy_error(scene, found, times, y0, drifts, beside)
    solution = expected_solution_error(scene, found, times, drifts, energy)
    return energy, solution, found.powers, float(1 / times)
