"""Prediction of a run: its time from a calibration, its errors from the modified equation."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.conservation import energy_rate_nearby, may_drift
from bseries.advice.measures import duration
from bseries.advice.modified_terms import modified_terms
from bseries.advice.prediction.calibration import seconds_per_step as calibrated
from bseries.advice.prediction.expected_errors import (
    NO_ENERGY,
    ONLY_ROUNDING,
    ExpectedError,
    expected_energy_error,
    expected_solution_error,
)
from bseries.advice.prediction.perturbation_run import perturbation_run
from bseries.exceptions import SeriesError
from integrators.core.arguments import check_end, read_positive, read_steps
from integrators.core.errors import IntegratorError
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    import numpy as np

    from integrators import Scene
    from integrators.methods.program.program import Method

LEFT_OUT = "to", "checkpoint", "progress"
"""Options of `integrate` that a prediction refuses: it must not touch the files of the run."""


class Prediction(NamedTuple):
    """Expected time and errors of a run; made by `predict_run`.

    Attributes:
        h: The step size.
        steps: The number of steps.
        seconds: The time on this machine; None if not requested, or if there are too few steps to measure it.
        energy: The largest change of the energy, relative to its value at the start if that is not 0.
        solution: The largest distance from the exact solution, relative to the largest state of the whole run.
        powers: The powers of h in the modified equation that the errors come from; may be empty.
        pilot: The part of the run covered by the perturbation run, from 0 to 1; the rest is extrapolated.

    Example:
        >>> import bseries as bs
        >>> print(bs.predict_run(bs.scene("henon-heiles"), "gauss2", h=0.1, steps=1000, timed=False))
        relative energy error 1.8e-07, relative solution error 2.8e-05 (from the modified equation to h^6)
    """

    h: float
    steps: int
    seconds: float | None
    energy: ExpectedError
    solution: ExpectedError
    powers: tuple[int, ...]
    pilot: float

    @property
    def basis(self) -> str:
        """The origin of expected errors, in words."""
        if not self.powers:
            return ""
        rest = "" if self.pilot >= 1 else f", extrapolated from {100 * self.pilot:.2g} % of the time"
        return f"from the modified equation to h^{self.powers[-1]}{rest}"

    def __str__(self) -> str:
        time = [] if self.seconds is None else [duration(self.seconds, 2)]
        errors = [f"relative energy error {self.energy}", f"relative solution error {self.solution}"]
        if self.energy == self.solution and self.energy.value is None:
            errors = [f"errors {self.energy}"]
        return ", ".join([*time, *errors]) + (f" ({self.basis})" if self.basis else "")

    def to_dict(self) -> dict[str, Any]:
        """The prediction as plain data."""
        return {
            "schema": 1,
            "kind": "prediction",
            "h": self.h,
            "steps": self.steps,
            "seconds": self.seconds,
            "energy_error": self.energy._asdict(),
            "solution_error": self.solution._asdict(),
            "powers": list(self.powers),
            "pilot": self.pilot,
        }


def time_only(h: Any, steps: int, reason: str, seconds: float | None = None) -> Prediction:
    """A prediction with unknown errors, and the reason."""
    unknown = ExpectedError(None, reason)
    return Prediction(float(h), steps, seconds, unknown, unknown, (), 0.0)


def predict_run(
    scene: Scene,
    method: Method | str,
    *,
    h: Any,
    steps: int,
    y0: Any = None,
    t0: float = 0.0,
    parts: Mapping[str, Any] | None = None,
    seconds_per_step: float | None = None,
    timed: bool = True,
    **options: Any,
) -> Prediction:
    """Time and errors to expect of a run.

    The time is measured on a part of the run, by the same code. Errors come from the modified equation
    y' = f(y) + h^p f_{p+1}(y) + …, whose first terms are a small perturbation along the exact flow: over the whole
    run, or over a part of it with an error growth fit for the rest. Methods whose terms are Hamiltonian, or reversible
    by a reflection of the orbit to itself, have bounded energy errors and, in regular motion, solution errors that grow
    linearly.

    Known errors should be within a factor of 3 (`docs/prediction.md` lists motions where they are not). They are
    unknown if terms of the modified equation do not decrease at this step size, if two truncations lead to errors that
    differ by more than a factor of 2, if four parts of the perturbation run lead to errors at the end that differ by
    more than a factor of 1.5 (2 for energies that do not drift), as in chaos, or if the energy drifts so far that the
    orbit itself would change.

    Args:
        scene: The scene.
        method: The method, or its name.
        h: The step size; negative backwards in time.
        steps: The number of steps.
        y0: The start; by default that of the scene.
        t0: The time at the start.
        parts: The assignment of the method's parts to the scene, as for `integrate`.
        seconds_per_step: The time of a step, if known.
        timed: Whether to predict the time.
        **options: Further options of `integrate`, such as `observe` and `save_every`, except files and `progress`.

    Returns:
        The prediction.

    Raises:
        IntegratorError: An argument does not fit; as a StepError, one of the first steps fails.
        TypeError: `integrate` has no option of this name.

    Example:
        >>> import bseries as bs
        >>> found = predict_run(bs.scene("pendulum"), "stormer-verlet", h=0.1, steps=10**8)
        >>> print(found.energy, found.powers, 1 < found.seconds < 1000)
        2.8e-02 (2, 4) True
        >>> print(found.solution)
        2.2e+00: as large as orbits are

    References:
        HLW, sections IX.8 (energy), X.3 (linear growth of errors); E. Hairer, lecture on long-time behaviour.
    """
    from inspect import signature

    import numpy as np

    from integrators import integrate
    from integrators import method as named

    run = {"h": h, "y0": y0, "t0": t0, "parts": parts, **options}
    for name in LEFT_OUT:
        if options.get(name) is not None:
            raise IntegratorError(f"{name} must be left out, since a prediction writes nothing, but was given")
    signature(integrate).bind(scene, method, steps=steps, **run)  # a TypeError for unknown options
    steps = read_steps(steps, "steps", 0)
    method = named(method) if isinstance(method, str) else method
    control = options.get("control")
    state = stepper(scene, method, parts=parts, control=control).start(y0, h=h, t0=t0)
    if control is None:
        check_end(state.t0, state.h, steps)
    seconds = None
    if seconds_per_step is not None:
        seconds = steps * read_positive(seconds_per_step, "seconds_per_step")
    elif timed and (cost := calibrated(scene, method, steps, **run)) is not None:
        seconds = steps * cost
    errors = _expected_errors(scene, method, state.h, steps, np.array(state.y), t0, parts, control)
    return Prediction(state.h, steps, seconds, *errors)


def _expected_errors(
    scene: Scene, method: Method, h: float, steps: int, y0: np.ndarray, t0: float, parts: Any, control: Any
) -> tuple[ExpectedError, ExpectedError, tuple[int, ...], float]:
    """The errors of energy and solution, the powers of h, and the part of the time covered by the perturbation run."""
    import numpy as np

    def unknown(reason: str) -> tuple[ExpectedError, ExpectedError, tuple[int, ...], float]:
        return ExpectedError(None, reason), ExpectedError(None, reason), (), 0.0

    def zero(reason: str, powers: tuple[int, ...]) -> tuple[ExpectedError, ExpectedError, tuple[int, ...], float]:
        exact = ExpectedError(0.0, reason)
        return exact if scene.is_hamiltonian else ExpectedError(None, NO_ENERGY), exact, powers, 1.0

    if control is not None:
        return unknown("the modified equation is that of constant steps")
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # infinities are reported below
            terms = modified_terms(method, scene, parts)
            if not terms.powers or not steps:
                return zero("only rounding", ())
            run = perturbation_run(terms, y0, h, h * steps, t0)
    except StepError as error:
        return unknown(f"the solution could not be followed beyond t = {error.t:.3g}")
    except (IntegratorError, SeriesError) as error:
        return unknown(str(error))
    if run is None:
        return zero(ONLY_ROUNDING, terms.powers)
    if not np.isfinite(run.errors).all():
        return unknown("terms of the modified equation are not finite along the solution")
    drifts, times = may_drift(terms, run.y), max(1.0, h * steps / run.t[-1])
    nearby = energy_rate_nearby(terms, run.y, h) * run.time_scale
    energy = expected_energy_error(scene, run, times, y0, drifts, nearby)
    solution = expected_solution_error(scene, run, times, drifts, energy)
    return energy, solution, run.powers, float(1 / times)
