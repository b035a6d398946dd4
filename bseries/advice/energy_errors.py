"""The error of the energy to expect of a run, from a pilot of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .distances import energy_size, largest_size, norms, without_time
from .expected_error import (
    AGREEMENT,
    ANOTHER_ORBIT,
    NO_ENERGY,
    NOT_SMALL,
    OF_HIGHER_ORDER,
    ROUNDING,
    SMALL,
    TELLING,
    TERMS_DIFFER,
    UNTOLD,
    ExpectedError,
    with_rounding,
)
from .growth import disagreement, energy_after, most_disagreement
from .structure_functions import gradient

if TYPE_CHECKING:
    import numpy as np

    from integrators import Scene

    from .pilot import Pilot

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

    from integrators.observers import observers

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
