"""Prediction of a run: its time from a calibration, its errors from the modified equation.

Errors come from a perturbation run over the whole run, or over a part of it; nothing is extrapolated.

References:
    HLW, section IX.8 (modified equations and energies).
"""

from __future__ import annotations

import math
import warnings
from inspect import signature
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from bseries.advice.measures import energy_size, largest_size, norms, without_time
from bseries.advice.predictions.modified_terms import gradient, in_floats, modified_terms
from bseries.advice.predictions.perturbation_run import PerturbationRun, perturbation_run
from bseries.advice.predictions.prediction import ExpectedError, Prediction
from bseries.advice.predictions.prediction import seconds_per_step as calibrated
from bseries.analysis.structure import symplecticity
from bseries.fields.inputs import Numeral, Point
from bseries_base.errors import BSeriesError
from integrators.core.arguments import check_end
from integrators.core.errors import IntegratorError
from integrators.exact.arguments import read_positive, step_count
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.runs.integration import integrate
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

Errors: TypeAlias = tuple[ExpectedError, ExpectedError, tuple[int, ...], float]

LEFT_OUT = "to", "checkpoint", "progress"
"""Options of `integrate` that a prediction refuses, since it must not change the files of the run."""
FARTHEST = 9
"""Largest order at which the structure of the method is checked; trees with more nodes take seconds."""
AGREEMENT = 2.0
"""Largest ratio of energy errors with all terms and with one less: the next term changes less, and predictions may be
off by a factor of 3."""
ROUNDING = 1e-14
"""Smaller relative errors are dominated by rounding, some tens of units in the last place."""

NO_ENERGY = "there is no energy that the scene conserves"
TERMS_DIFFER = "terms of the modified equation up to h^{last} and one less lead to errors that differ by more than 2"
ANOTHER_ORBIT = "the energy changes so much that the orbit is another one"
CHAOTIC = "it grows to the size of the orbit faster than in regular motion, as in chaos"
ONLY_ROUNDING = "rounding will be larger"
NOT_SMALL = "the modified equation leads to another orbit, as in chaos or next to a separatrix"


class RegularMotion(NamedTuple):
    """Limits of errors in regular motion: beyond them the motion is chaotic, or the orbit another one.

    Errors of regular motion grow at most quadratically until they reach the size of the orbit; in chaos they grow
    exponentially. Each limit leaves room for the motion named beside it; together they are checked by the 66 runs of
    the benchmarks ``prediction*``, see `docs/prediction.md`.
    """

    range_growth: float = 1.5
    """Of the range of a variable in the second half of the time, beyond which it is unbounded: an angle at constant
    pace has a factor of 2, an oscillation 1."""
    linear: float = 1e-2
    """Relative distance up to which errors are proportional to r: the neglected part is about its square."""
    free: float = 0.1
    """Part of the orbit's size up to which errors grow freely; larger ones begin to be bounded by it."""
    same_orbit: float = 2.0
    """Distance in a variable as a multiple of its range: twice that of any two solutions within the range."""
    large: float = 0.5
    """Part of the orbit's size from which on errors are called of that size."""
    growth: float = 6.0
    """Of an error in the second half of the time: quadratic growth has a factor of 4, and half of the factor of 3
    allowed for predictions is left to oscillations."""
    transient: int = 10 * 38
    """Impulses in ten periods: in fewer, errors up to half of the orbit's size may grow faster without chaos."""


REGULAR = RegularMotion()


def predict_run(
    method: Method | str,
    scene: Scene | str,
    *,
    h: float | str,
    steps: int | None = None,
    span: Numeral | None = None,
    y0: Point | None = None,
    t0: float = 0.0,
    parts: Parts | None = None,
    seconds_per_step: float | None = None,
    timed: bool = True,
    **options: Any,
) -> Prediction:
    """The expected time and errors of a run.

    The time is measured on a part of the run, by the same code. Errors come from a solution of the modified equation
    y' = f(y) + h^p f_{p+1}(y) + … beside the exact flow, over the whole run, or over the part of it that takes some
    seconds to follow, about 400 periods; `Prediction.covered` is this part. Errors later in the run may be larger.

    Known errors should be within a factor of 3 (`docs/prediction.md` lists motions where they are not). They are
    unknown if terms of the modified equation do not decrease at this step size, if two truncations lead to energies
    that differ by more than a factor of 2, in chaos, or if the energy changes so far that the orbit is another one.

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
        >>> found = bs.predict_run("stormer-verlet", bs.scene("pendulum"), h=0.1, steps=10**8)
        >>> print(found.energy, found.powers, 1 < found.seconds < 1000)
        2.8e-02 (2, 4) True
        >>> found.covered < 1e-3
        True

    References:
        HLW, section IX.8 (energy); E. Hairer, lecture on long-time behaviour.
    """
    method = as_method(method)
    scene = as_scene(scene)
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
    scene: Scene,
    method: Method,
    h: float,
    steps: int,
    y0: np.ndarray,
    t0: float,
    parts: Parts | None,
    control: object,
) -> Errors:
    """The errors of energy and solution, the powers of h, and the part of the time covered by the perturbation run."""

    def both(value: float | None, reason: str, powers: tuple[int, ...] = ()) -> Errors:
        found = ExpectedError(value, reason)
        energy = found if value is None or scene.is_hamiltonian else ExpectedError(None, NO_ENERGY)
        return energy, found, powers, 0.0 if value is None else 1.0

    if control is not None:
        return both(None, "the modified equation is that of constant steps")
    span = h * steps
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # infinities are reported below
            terms = modified_terms(method, scene, parts)
            if not terms.powers or not steps:
                return both(0.0, "only rounding")
            if (order := _first_not_symplectic(method, terms.field.order)) is not None:
                terms = modified_terms(method, scene, parts, order=order)
            energy_gradient = gradient(scene)
            run = perturbation_run(terms, energy_gradient, y0, h, span, t0)
            if run is None:
                return both(0.0, ONLY_ROUNDING, terms.powers)
            if not run.is_complete:
                return both(None, NOT_SMALL)
            if not np.isfinite(run.errors).all():
                return both(None, "terms of the modified equation are not finite along the solution")
            along = None if energy_gradient is None else energy_gradient(run.y)
            moves = terms.moves(run.y[:, :: max(1, run.y.shape[1] // 256)])  # several states in each period
            energy = expected_energy_error(scene, run, along, moves, y0)
            solution = expected_solution_error(scene, run, energy)
    except StepError as error:
        return both(None, f"the solution could not be computed beyond t = {error.t:.3g}")
    except BSeriesError as error:
        return both(None, str(error))
    return energy, solution, run.powers, min(1.0, float(run.t[-1] / span))


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


def expected_energy_error(
    scene: Scene, run: PerturbationRun, energy_gradient: np.ndarray | None, moves: np.ndarray, y0: np.ndarray
) -> ExpectedError:
    """The largest change of the energy during a perturbation run.

    `energy_gradient` is ∇H along the run, `moves` the distance that each variable moves within the time scale.
    """
    if run.changes is None or energy_gradient is None:
        return ExpectedError(None, NO_ENERGY)
    changes, size = run.changes, energy_size(scene, y0)
    expected = float(abs(changes.sum(axis=0)).max()) / size
    fewer = float(abs(changes[: max(1, len(changes) - 1)].sum(axis=0)).max()) / size
    if expected < ROUNDING:
        return ExpectedError(expected, ONLY_ROUNDING)
    if max(expected, fewer) > AGREEMENT * min(expected, fewer):
        return ExpectedError(None, TERMS_DIFFER.format(last=run.powers[-1]))
    # The energy of the orbit is the mean of Σ |∂H/∂y_i · (y_i − ȳ_i)| / 2, which is H for oscillators.
    away = np.minimum(abs(run.y - run.y.mean(axis=1)[:, None]), moves[:, None])  # unbounded variables count with moves
    if expected * size > float((abs(energy_gradient) * away).sum(axis=0).mean() / 2):
        return ExpectedError(None, ANOTHER_ORBIT)
    return ExpectedError(expected)


def expected_solution_error(scene: Scene, run: PerturbationRun, energy: ExpectedError) -> ExpectedError:
    """The largest error of the solution during a perturbation run, relative to the largest state."""
    if energy.reason in (ANOTHER_ORBIT, NOT_SMALL):
        return energy
    y, errors = without_time(scene, run.y), without_time(scene, run.errors)
    sizes, largest = norms(errors), largest_size(y)
    unbounded = np.ptp(y, axis=1) > REGULAR.range_growth * np.ptp(y[:, : y.shape[1] // 2 + 1], axis=1)
    ranges = np.where(unbounded, math.inf, np.ptp(y, axis=1))
    beyond = abs(errors).max(axis=1) > REGULAR.same_orbit * ranges + REGULAR.linear * largest
    if run.factor == 1 and beyond.any():
        return ExpectedError(None, NOT_SMALL)
    orbit = largest_size(np.where(unbounded, abs(y).max(axis=1), ranges)[:, None])
    expected = float(sizes.max()) / largest
    away = run.factor * sizes > REGULAR.linear * largest if run.factor > 1 else sizes > REGULAR.free * orbit
    if run.factor > 1 and away.any():
        return ExpectedError(None, CHAOTIC)
    free = int(np.argmax(away)) if away.any() else 0
    is_large = sizes.max() > REGULAR.large * orbit
    is_regular = free >= 2 and sizes[:free].max() <= REGULAR.growth * sizes[: free // 2 + 1].max()
    if not is_regular and (is_large or free > REGULAR.transient):
        return ExpectedError(None, CHAOTIC)
    if is_large:
        return ExpectedError(expected, "of the size of the orbit")
    return ExpectedError(expected, "" if expected > ROUNDING else ONLY_ROUNDING)
