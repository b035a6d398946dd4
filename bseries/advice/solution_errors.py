"""The error of the solution to expect of a run, from a pilot of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .distances import largest_size, norms, without_time
from .expected_error import (
    AGREEMENT,
    ANOTHER_ORBIT,
    NO_ENERGY,
    NOT_SMALL,
    SMALL,
    TELLING,
    TERMS_DIFFER,
    UNTOLD,
    ExpectedError,
    with_rounding,
)
from .growth import EVEN, REGULAR, agreed, disagreement, goes_on, parts_of, power, size_after, size_of_states_after

if TYPE_CHECKING:
    import numpy as np

    from integrators import Scene

    from .pilot import Pilot

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
