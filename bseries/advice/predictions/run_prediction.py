"""Prediction of a run: its time from a calibration, its errors from the modified equation."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from bseries.advice.predictions.expected_errors import (
    NO_ENERGY,
    NOT_SMALL,
    ONLY_ROUNDING,
    expected_energy_error,
    expected_solution_error,
)
from bseries.advice.predictions.modified_terms import gradient, in_floats, modified_terms
from bseries.advice.predictions.perturbation_run import perturbation_run
from bseries.advice.predictions.prediction import ExpectedError, Prediction
from bseries.advice.predictions.prediction import seconds_per_step as calibrated
from bseries.analysis.structure import symplecticity
from bseries.exceptions import SeriesError
from integrators.core.arguments import check_end
from integrators.core.errors import IntegratorError
from integrators.exact.arguments import read_positive, step_count
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

Errors: TypeAlias = tuple[ExpectedError, ExpectedError, tuple[int, ...], float]

LEFT_OUT = "to", "checkpoint", "progress"
"""Options of `integrate` that a prediction refuses, since it must not change the files of the run."""
CHECKED = 512
"""Impulses up to which the perturbation run is repeated with one term less: several periods."""
SPEEDS = 256
"""Number of states at which speeds of variables are compared: several in each period."""
FARTHEST = 9
"""Largest order at which the structure of the method is checked; trees with more nodes take seconds."""


def predict_run(
    method: Method | str,
    scene: Scene | str,
    *,
    h: Any,
    steps: int | None = None,
    span: Any = None,
    y0: Any = None,
    t0: float = 0.0,
    parts: Mapping[str, Any] | None = None,
    seconds_per_step: float | None = None,
    timed: bool = True,
    **options: Any,
) -> Prediction:
    """The expected time and errors of a run.

    The time is measured on a part of the run, by the same code. Errors come from a solution of the modified equation
    y' = f(y) + h^p f_{p+1}(y) + … beside the exact flow: over the whole run, or over a part of it, with a growth law of
    regular motion for the rest.

    Known errors should be within a factor of 3 (`docs/prediction.md` lists motions where they are not). They are
    unknown if terms of the modified equation do not decrease at this step size, if two truncations lead to errors that
    differ by more than a factor of 2, if parts of the time followed lead to errors at the end that differ by more than
    a factor of 1.5, as in chaos, or if the energy drifts so far that the orbit itself would change.

    Args:
        method: The method, or its name.
        scene: The scene.
        h: The step size; negative backwards in time.
        steps: The number of steps.
        span: The length of time instead of `steps`; the last step may end later.
        y0: The start; by default that of the scene.
        t0: The time at the start.
        parts: The assignment of the method's parts to the scene, as for `integrate`.
        seconds_per_step: The time of a step, if known.
        timed: Whether to predict the time.
        **options: Further options of `integrate`, such as `observe` and `save_every`, except files and `progress`.

    Raises:
        IntegratorError: An argument is invalid; a StepError if one of the first steps fails.
        TypeError: `integrate` has no option of this name.

    Example:
        >>> import bseries as bs
        >>> found = predict_run("stormer-verlet", bs.scene("pendulum"), h=0.1, steps=10**8)
        >>> print(found.energy, found.powers, 1 < found.seconds < 1000)
        2.8e-02 (2, 4) True
        >>> print(found.solution)
        2.0e+00: of the size of the orbit

    References:
        HLW, sections IX.8 (energy), X.3 (linear growth of errors); E. Hairer, lecture on long-time behaviour.
    """
    method = as_method(method)
    scene = as_scene(scene)
    from inspect import signature

    from integrators import integrate

    run = {"h": h, "y0": y0, "t0": t0, "parts": parts, **options}
    for name in LEFT_OUT:
        if options.get(name) is not None:
            raise IntegratorError(f"{name} must be left out, since a prediction writes nothing, but was given")
    signature(integrate).bind(scene, method, steps=steps, **run)  # a TypeError for unknown options
    steps = step_count(h, steps, span)
    control = options.get("control")
    state = stepper(method, scene, parts=parts, control=control).start(y0, h=h, t0=t0)
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
) -> Errors:
    """The errors of energy and solution, the powers of h, and the part of the time covered by the perturbation run."""

    def unknown(reason: str) -> Errors:
        return ExpectedError(None, reason), ExpectedError(None, reason), (), 0.0

    def zero(reason: str, powers: tuple[int, ...]) -> Errors:
        exact = ExpectedError(0.0, reason)
        return exact if scene.is_hamiltonian else ExpectedError(None, NO_ENERGY), exact, powers, 1.0

    if control is not None:
        return unknown("the modified equation is that of constant steps")
    span, fewer = h * steps, None
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # infinities are reported below
            terms = modified_terms(method, scene, parts)
            if not terms.powers or not steps:
                return zero("only rounding", ())
            if (order := _first_not_symplectic(method, terms.field.order)) is not None:
                terms = modified_terms(method, scene, parts, order=order)
            slopes = gradient(scene)
            run = perturbation_run(terms, slopes, y0, h, span, t0)
            if run is None:
                return zero(ONLY_ROUNDING, terms.powers)
            if not run.is_complete:
                return unknown(NOT_SMALL)
            if len(run.powers) > 1:
                less = terms._replace(powers=run.powers[:-1])
                fewer = perturbation_run(less, None, y0, h, span, t0, most=CHECKED)
            if not np.isfinite(run.errors).all():
                return unknown("terms of the modified equation are not finite along the solution")
            is_hamiltonian, times = terms.is_hamiltonian(run.y), max(1.0, float(span / run.t[-1]))
            along = None if slopes is None else slopes(run.y)
            moves = terms.moves(run.y[:, :: max(1, run.y.shape[1] // SPEEDS)])
            energy = expected_energy_error(scene, run, along, moves, times, y0, is_hamiltonian)
            solution = expected_solution_error(scene, run, fewer, span, energy, 1 if is_hamiltonian else 2)
    except StepError as error:
        return unknown(f"the solution could not be computed beyond t = {error.t:.3g}")
    except (IntegratorError, SeriesError) as error:
        return unknown(str(error))
    return energy, solution, run.powers, float(1 / times)


def _first_not_symplectic(method: Method, order: int) -> int | None:
    """The order of terms that show that a method is not symplectic, if the first ones do not.

    A pseudo-symplectic method has Hamiltonian terms up to a later one, which lets energies drift: that one is included,
    and one more to assess it. Methods of several parts are not checked: they have too many trees, and the known ones
    are made from flows or from the steps of a method, which are symplectic as a whole or not.

    References:
        A. Aubry, P. Chartier, Pseudo-symplectic Runge–Kutta methods, BIT 38 (1998) 439–461, doi:10.1007/BF02510253.
    """
    if order >= FARTHEST or len(method.names) > 1 or getattr(method, "is_symplectic", False):
        return None
    found = symplecticity(in_floats(method) if method.digits is not None else method, FARTHEST).order
    return found + 2 if order <= found < FARTHEST else None
