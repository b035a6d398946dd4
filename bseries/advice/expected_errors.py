"""The errors to expect of a run: from the first terms of the modified equation along the exact flow."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

from integrators import IntegratorError, StepError

from ..exceptions import SeriesError
from .conservation import energy_rate_beside, may_drift
from .energy_errors import expected_energy_error
from .expected_error import NO_ENERGY, ONLY_ROUNDING, ExpectedError
from .solution_errors import expected_solution_error

if TYPE_CHECKING:
    import numpy as np

    from integrators import Scene

    from ..coefficients import Method


def expected_errors(
    scene: Scene, method: Method, h: float, steps: int, y0: np.ndarray, t0: float, parts: Any, control: Any
) -> tuple[ExpectedError, ExpectedError, tuple[int, ...], float]:
    """The errors of energy and solution, the powers of h, and the part of the time that was gone through."""
    import numpy as np

    from .modified_terms import modified_terms
    from .pilot import pilot
    from .pilot_walk import RESOLUTION

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
