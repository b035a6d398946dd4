"""What a run takes and how wrong it will be: from a calibration of its own steps, and from the modified equation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.measures import duration
from bseries.advice.prediction.calibration import seconds_per_step as calibrated
from bseries.advice.prediction.expected_errors import ExpectedError, expected_errors
from integrators.core.arguments import check_end, read_positive, read_steps
from integrators.core.errors import IntegratorError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    from integrators import Scene
    from integrators.methods.program.program import Method

LEFT_OUT = "to", "checkpoint", "progress"
"""Options of `integrate` that a prediction has no use for: it must not touch the files of the run."""


class Prediction(NamedTuple):
    """What is expected of a run; made by `predict_run`.

    Attributes:
        h: The step size.
        steps: The number of steps.
        seconds: How long they take on this machine; None if that was not asked for, or there are too few to tell.
        energy: The largest change of the energy, relative to what it is at the start where that is not 0.
        solution: The largest distance from the exact solution, relative to the largest state of the whole run.
        powers: The powers of h in the modified equation that errors come from; none where there are none.
        pilot: How much of the time of the run was gone through, from 0 to 1; the rest is extrapolated.

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
        """On what expected errors rest."""
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
    """A prediction without errors, and why."""
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
    """What a run will take, and how wrong it will be.

    The time is that of a part of the run, made by the same code. Errors come from the modified equation
    y' = f(y) + h^p f_{p+1}(y) + …, whose first terms are taken as a small perturbation along the exact flow: over the
    whole run, or over a pilot of it and then by the law that they follow. Methods whose terms are Hamiltonian, or
    reversible by a reflection of the orbit to itself, have energy errors that do not grow and, in regular motion,
    solution errors that grow linearly.

    Where errors are given they should be within a factor of 3 (`docs/prediction.md` names motions where they have been
    found not to be). Where they cannot be known the prediction says so: if terms of
    the modified equation do not shrink at this step size, if two truncations lead to errors that differ by more than a
    factor of 2, if four parts of the pilot lead to errors at the end that differ by more than a factor of 1.5 (2 for
    energies that do not drift), as in chaos, or if the energy drifts so far that the orbit itself would change.

    Args:
        scene: The scene.
        method: The method, or its name.
        h: The step size; negative backwards in time.
        steps: How many steps.
        y0: The start; by default that of the scene.
        t0: The time at the start.
        parts: What the parts of the method are in the scene.
        seconds_per_step: What a step costs, if that is known.
        timed: Whether the time is to be predicted.
        **options: All else that `integrate` will be called with, such as `observe` and `save_every`, but for files and
            `progress`.

    Returns:
        The prediction.

    Raises:
        IntegratorError: An argument does not fit; as a StepError, one of the first steps fails.
        TypeError: `integrate` has no such option.

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
    signature(integrate).bind(scene, method, steps=steps, **run)  # a TypeError for options that there are not
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
    errors = expected_errors(scene, method, state.h, steps, np.array(state.y), t0, parts, control)
    return Prediction(state.h, steps, seconds, *errors)
