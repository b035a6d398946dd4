"""The errors to expect of a run: from the first terms of the modified equation along the exact flow."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators import IntegratorError, StepError

from ..exceptions import SeriesError
from .distances import energy_size, largest_size, without_time
from .growth import REGULAR, Extrapolated, agreed, change_after, disagreement, from_parts, parts_of, size_after

if TYPE_CHECKING:
    import numpy as np

    from integrators import Scene

    from ..coefficients import Method
    from .pilot import Pilot

AGREEMENT = 2.0
"""Two ways to an expected error may differ by this factor."""
LOST = 0.5
"""What is left of errors by the bounds of an orbit, if they are beyond it."""
LARGEST_CHANGE = 0.05
"""An energy that changes by a larger part makes another orbit."""
ROUNDING = 1e-14
"""Below such relative errors rounding decides."""
STEADY = 1.5
"""Variables whose range grows by more in the second half of a pilot have no bounds."""


NO_ENERGY = "there is no energy that the scene conserves"
TERMS_DIFFER = "terms of the modified equation up to h^{last} and one less lead to errors that differ by more than 2"
ANOTHER_ORBIT = "the energy changes so much that the orbit is another one"


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


def expected_errors(
    scene: Scene, method: Method, h: float, steps: int, y0: np.ndarray, t0: float, parts: Any, control: Any
) -> tuple[ExpectedError, ExpectedError, tuple[int, ...], float]:
    """The errors of energy and solution, the powers of h, and the part of the time that was gone through."""
    import numpy as np

    from .modified_terms import modified_terms
    from .pilot import pilot

    def unknown(reason: str) -> tuple[ExpectedError, ExpectedError, tuple[int, ...], float]:
        return ExpectedError(None, reason), ExpectedError(None, reason), (), 0.0

    if control is not None:
        return unknown("the modified equation is that of constant steps")
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # what is not finite is seen below
            terms = modified_terms(method, scene, parts)
            if not terms.powers or not steps:
                exact = ExpectedError(0.0, "only rounding")
                return exact if scene.is_hamiltonian else ExpectedError(None, NO_ENERGY), exact, (), 1.0
            found = pilot(terms, y0, h, h * steps, t0)
    except StepError as error:
        return unknown(f"the solution could not be followed beyond t = {error.t:.3g}")
    except (IntegratorError, SeriesError) as error:
        return unknown(str(error))
    if not np.isfinite(found.errors).all():
        return unknown("terms of the modified equation are not finite along the solution")
    drifts = not terms.is_hamiltonian(found.y, found.powers)
    times = max(1.0, h * steps / found.t[-1])
    energy = _energy(scene, found, times, y0, drifts)
    solution = _solution(scene, found, times, drifts, energy)
    return energy, solution, found.powers, float(1 / times)


def _energy(scene: Scene, found: Pilot, times: float, y0: np.ndarray, drifts: bool) -> ExpectedError:
    """The largest change of the energy."""
    if found.changes is None:
        return ExpectedError(None, NO_ENERGY)
    changes = found.changes / energy_size(scene, y0)

    def extrapolated(terms: int) -> Extrapolated:
        total = changes[:terms].sum(axis=0)
        return from_parts(lambda n, factor: change_after(total[:n], factor, drifts=drifts), len(total), times)

    expected = extrapolated(len(changes))
    if expected.high < ROUNDING:
        return _with_rounding(expected.value)
    if len(changes) > 1 and disagreement(expected.value, extrapolated(len(changes) - 1).value) > AGREEMENT:
        return ExpectedError(None, TERMS_DIFFER.format(last=found.powers[-1]))
    if drifts and expected.value > LARGEST_CHANGE:
        return ExpectedError(None, ANOTHER_ORBIT)
    if expected.disagreement > (REGULAR if drifts else AGREEMENT):
        return ExpectedError(None, f"how it grows cannot be told from the time to t = {found.t[-1]:.3g}")
    return _with_rounding(expected.value)


def _solution(scene: Scene, found: Pilot, times: float, drifts: bool, energy: ExpectedError) -> ExpectedError:
    """The largest error of the solution."""
    import numpy as np

    if energy.reason == ANOTHER_ORBIT:
        return energy
    seen, power = found.checked.shape[1], 2 if drifts else 1
    errors, y = found.errors, without_time(scene, found.y)
    if disagreement(*(_norms(e).max() for e in (errors[:, :seen], found.checked))) > AGREEMENT:
        return ExpectedError(None, TERMS_DIFFER.format(last=found.powers[-1]))
    sizes, ranges = _norms(errors), np.array([_range(row) for row in y])
    variables = [abs(row) for row in without_time(scene, errors)]

    def bounded(points: int, factor: float) -> tuple[float, float]:
        """The size, and the part of it that is left when no variable is off by more than the range where it moves."""
        each = np.array([size_after(row[:points], factor, power) for row in variables])
        left = float(_norms(np.minimum(each, ranges)) / _norms(each)) if each.any() else 1.0
        return size_after(sizes[:points], factor, power), left

    free, left = zip(*(bounded(*part) for part in parts_of(len(sizes), times)), strict=True)
    expected = agreed(size * least for size, least in zip(free, left, strict=True))
    if expected.disagreement > REGULAR or not found.is_linear:
        return ExpectedError(None, f"how it grows cannot be told from the time to t = {found.t[-1]:.3g}, as in chaos")
    value = expected.value / largest_size(y)
    return ExpectedError(value, "as large as orbits are") if min(left) < LOST else _with_rounding(value)


def _norms(y: np.ndarray) -> np.ndarray:
    import numpy as np

    return np.linalg.norm(y, axis=0)


def _range(values: np.ndarray) -> float:
    """How far a variable moves; infinite if it moves on and on."""
    middle = len(values) // 2 + 1
    whole, before = (float(x.max() - x.min()) for x in (values, values[:middle]))
    return whole if whole <= STEADY * before else math.inf


def _with_rounding(value: float) -> ExpectedError:
    return ExpectedError(value, "" if value > ROUNDING else "rounding will be larger")
