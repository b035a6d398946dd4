"""Reference solutions with error bounds: to about 30 digits by Taylor series, in doubles from values of the field.

Taylor series in double-double arithmetic need formulas. Values of the field suffice for the method of order 8 of
Dormand and Prince, in doubles with compensated sums. Its steps are halved until the solution settles. The difference of
the last two solutions bounds the error of the steps: where the field has kinks it shrinks slowly. That of rounding is
seen from a solution whose steps and states are changed by as much.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import pairwise
from math import ceil, copysign, frexp, ldexp, log
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

import mpmath
import numpy as np

from integrators.core.arguments import items, read_whole
from integrators.core.errors import IntegratorError, shorten
from integrators.exact.entries import is_sympy, read_entry, symbol_names
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.model.blocks import TIME
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    from integrators.reference.taylor_series import TaylorProgram

MAX_DIGITS = 31
LARGEST = 10**300
CERTAIN = 2.0**-50
"""Relative error allowed in solutions returned as doubles."""
NOISE = 2.0**-84
"""Allowed error of a variable relative to the largest of its block, for variables that vanish by symmetry."""
FIRST_UNITS = 2.0**-10, 2.0**-16
"""First trial steps of the two solutions, as fractions of the time."""
CHECKS = 16
"""Least number of times before the first one requested at which the two solutions are compared."""
PERTURBATION = 2.0**-104
"""Relative change of each variable of the first solution after each step, larger than rounding errors."""
SAFETY = 4.0
"""Factor of the bounds: differences of two solutions are estimates of their errors."""
WORK = 3e8
"""Operations on coefficients in one call of compiled code: about a second, the delay of Ctrl-C."""
MOST_WORK = 1e10
"""Total operations on coefficients in one of the two solutions: about half a minute."""
LEAST_STEPS = 1000
"""Steps before their total is extrapolated: towards a singularity they shrink by a constant factor."""
METHOD, MOST_DIGITS = "dop853", 15
FIRST_STEPS, MOST_HALVINGS = 64, 14
"""The number of steps of the first solution in doubles, if there are fewer times, and how often it is doubled."""
STRETCH, NUDGE, NUDGES = 2.0**-52, 2.0**-51, 32
"""Relative changes of the step size, and of the state at some times, that show the growth of rounding errors."""
UNIT, SETTLED = 2.0**-53, 4.0
"""The unit roundoff, and the difference of solutions in such units that more steps would not reduce."""


class ReferenceSolution(NamedTuple):
    """A solution in double-double numbers, high + low, with an error bound.

    Attributes:
        high: The solution rounded to doubles, an array (variables, times).
        low: The remainder.
        error: A bound on the error, from a second solution perturbed in each step by more than rounding errors.

    Example:
        >>> from integrators import scene
        >>> solution = reference_solution(scene("pendulum"), [1, 2], full=True)
        >>> solution.high.shape, bool((solution.error < 1e-29).all())
        ((2, 2), True)
    """

    high: np.ndarray
    low: np.ndarray
    error: np.ndarray

    def __repr__(self) -> str:
        variables, times = self.high.shape
        return f"<ReferenceSolution: {variables} variables, {times} times, error at most {self.error.max():.1e}>"

    def numbers(self) -> np.ndarray:
        """The exact sums high + low as mpmath numbers.

        Example:
            >>> import mpmath
            >>> from integrators import Scene
            >>> growth = Scene({"y": 1}, field={"y": "y"}, start={"y": [1]})
            >>> print(mpmath.nstr(reference_solution(growth, [1], full=True).numbers()[0, 0], 30))
            2.71828182845904523536028747135
        """
        with mpmath.workprec(2200):  # the sum of two doubles has fewer bits
            pairs = zip(self.high.flat, self.low.flat, strict=True)
            sums = [mpmath.mpf(float(high)) + mpmath.mpf(float(low)) for high, low in pairs]
        return np.array(sums, dtype=object).reshape(self.high.shape)


@overload
def reference_solution(
    scene: Scene | str, t: Any, *, y0: Any = None, t0: Any = None, digits: int = 30, full: Literal[False] = False
) -> np.ndarray: ...
@overload
def reference_solution(
    scene: Scene | str, t: Any, *, y0: Any = None, t0: Any = None, digits: int = 30, full: Literal[True]
) -> ReferenceSolution: ...
def reference_solution(
    scene: Scene | str, t: Any, *, y0: Any = None, t0: Any = None, digits: int = 30, full: bool = False
) -> np.ndarray | ReferenceSolution:
    """The solution of a scene to full double precision, by Taylor series in double-double arithmetic.

    The Taylor coefficients come from the scene's formulas, in numbers of about 31 digits. Steps are chosen from the
    last coefficients; the requested times are inserted into the series and do not influence the steps. The problem is
    solved twice, with different orders and steps. The difference alone could be below the error: rounding errors of
    both solutions are of the same size, and may agree or cancel; those of the start, of parameters and of 1/n are even
    equal. So one of the two is perturbed in each step by more than rounding errors, and the largest relative difference
    so far, also at times between the start and t, bounds the error at t. The bound is too large where errors shrink
    again, as near a stable equilibrium.

    Scenes of compiled functions have no series; `integrators.settled_solution` needs values of the field only.

    Args:
        scene: The scene; its parameters must be numbers.
        t: The times, in one direction from `t0`; a number counts as one time.
        y0: The start, a number for each variable; by default that of the scene. Text and fractions are exact; a double
            is its exact binary value, not the decimal it prints as.
        t0: The time of the start; by default the scene's variable t if it has one, else 0.
        digits: The accuracy of a step, in digits of each variable, up to 31.
        full: Whether to return all digits, and an error bound.

    Returns:
        An array (variables, times) of doubles, correct to rounding; or, if `full`, a `ReferenceSolution`.

    Raises:
        IntegratorError: An argument is invalid, the solution ends before the last time, or (unless `full`) its error
            exceeds the precision of doubles.

    Example:
        >>> from integrators import scene
        >>> print(reference_solution(scene("kepler"), [1, 10]))
        [[-0.9...
        >>> from integrators import Scene
        >>> reference_solution(Scene({"y": 1}, field={"y": "y^2"}, start={"y": [1]}), 2)
        Traceback (most recent call last):
            ...
        integrators.core.errors.IntegratorError: t must end before 1, beyond which the solution of scene could not be
        continued, but reached to 2

    References:
        À. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
        methods, Experimental Mathematics 14 (2005) 99–117, doi:10.1080/10586458.2005.10128904.
    """
    scene = as_scene(scene)
    digits = read_whole(digits, "digits", f"a whole number from 1 to {MAX_DIGITS}", 1, MAX_DIGITS)
    from integrators.reference.taylor_series import split, taylor_program

    program = taylor_program(scene)
    start, origin = _read_start(scene, y0, t0)
    times = _read_times(t, origin)
    checked, wanted = _with_checks(times, origin)
    y, elapsed = np.array([split(x) for x in start]), np.array([split(x - origin) for x in checked])
    try:
        first = _solve(program, y, elapsed, digits, FIRST_UNITS[0], PERTURBATION)
        second = _solve(program, y, elapsed, digits + 2, FIRST_UNITS[1], 0.0)
    except Stuck as stuck:
        end = float(origin) + stuck.args[0]
        raise IntegratorError(
            f"t must end before {end:.10g}, beyond which the solution of {scene.name} could not be continued, "
            f"but reached to {float(times[-1]):.10g}"
        ) from None
    except TooManySteps as refused:
        needed, most = refused.args
        raise IntegratorError(
            f"t must end sooner, as the steps of {scene.name} are so short that {float(times[-1]):.10g} would take "
            f"about {needed:.1e} of them, and at most {most:.1e} are allowed"
        ) from None
    apart = np.abs((first[..., 0] - second[..., 0]) + (first[..., 1] - second[..., 1]))
    relative = np.divide(apart, second[..., 2], out=np.zeros_like(apart), where=apart > 0)
    error = SAFETY * np.maximum(np.maximum.accumulate(relative, axis=1), PERTURBATION) * second[..., 2]
    solution = ReferenceSolution(second[:, wanted, 0], second[:, wanted, 1], error[:, wanted])
    if full:
        return solution
    _check_certain(solution, scene, y[:, :1], [float(x) for x in times], digits)
    return solution.high


def first_step(scene: Scene, span: float, *, y0: Any, digits: int) -> float:
    """The first step of `reference_solution`, at most the span, which is positive.

    If no step is possible, it is the shortest time that was tried.

    Example:
        >>> from integrators import Scene
        >>> fast = Scene({"y": 1}, field={"y": "1 + y^2"})
        >>> print(f"{first_step(fast, 1.0, y0=[0], digits=15):.3f}")
        0.176
    """
    from integrators.reference import taylor_series as taylor

    start, _ = _read_start(scene, y0, None)
    program, y = taylor.taylor_program(scene), np.array([taylor.split(x) for x in start])
    order, times = _order(digits), np.array([[span, 0.0]])
    series, state = _initial_series(program, y, times, order, 1.0)
    status, values = taylor.RUNNING, np.empty((program.dimension, 1, 3))
    while status == taylor.RUNNING and not state[0]:
        _, status = taylor.advance(program, series, state, order, 0.0, 1, times, 0, values)
    if status == taylor.STUCK and (shorter := abs(float(state[2]))):  # a step is sought from there
        return first_step(scene, shorter, y0=y0, digits=digits)
    return float(state[0]) or span


class Stuck(Exception):
    """No step is possible; the argument is the time since the start."""


class TooManySteps(Exception):
    """Steps are too short; the arguments are their approximate number, and the number allowed."""


def _solve(
    program: TaylorProgram, y: np.ndarray, times: np.ndarray, digits: int, first_unit: float, perturbation: float
) -> np.ndarray:
    """The solution at times since the start, which have one sign and increase in size, and the size of each variable.

    Numbers are double-double; the size is the sum of the absolute terms of the series around each time. The error of a
    step is below 10^−digits of each variable, apart from rounding. `perturbation` is a relative change of each variable
    after each step, of random sign, and a relative extension of steps: they show the growth of random and of systematic
    errors.
    """
    from integrators.reference import taylor_series as taylor

    order = _order(digits)
    series, state = _initial_series(program, y, times, order, first_unit)
    values = np.empty((program.dimension, len(times), 3))
    work = len(series) * order**2
    steps, most = max(1, int(WORK / work)), MOST_WORK / work
    index, status, done = 0, taylor.RUNNING, 0
    while status == taylor.RUNNING:
        index, status = taylor.advance(program, series, state, order, perturbation, steps, times, index, values)
        done += steps
        needed = done * (times[-1, 0] / state[0]) if status == taylor.RUNNING and done >= LEAST_STEPS else 0.0
        if needed > most:
            raise TooManySteps(needed, most)
    if status == taylor.STUCK:
        raise Stuck(float(state[0]))
    return values


def _initial_series(
    program: TaylorProgram, y: np.ndarray, times: np.ndarray, order: int, first_unit: float
) -> tuple[np.ndarray, np.ndarray]:
    """The series, with the start in its first coefficients, and the state before the first step."""
    series = np.zeros((program.dimension + 1 + len(program.operations), order + 1, 2))
    series[: program.dimension, 0] = y
    span = float(times[-1, 0])
    return series, np.array([0.0, 0.0, copysign(ldexp(first_unit, frexp(span)[1]), span)])


def _order(digits: int) -> int:
    """The order at which a step of radius/e² has the error 10^−digits (Jorba and Zou, 2005, section 3.2)."""
    return ceil(1 + digits * log(10) / 2)


def _read_number(value: Any, argument: str) -> Fraction:
    """A number as a fraction, exact or to 60 digits; a double is its exact binary value."""
    from integrators.reference.taylor_series import fraction_of

    if isinstance(value, str) or is_sympy(value):  # as in scenes: pi/2, cos(11/10)
        names = () if isinstance(value, str) else symbol_names([value])
        entry: Any = read_formula(value, names, argument)
    else:
        entry = value if hasattr(value, "_mpf_") else read_entry(value, argument)
    if names := symbol_names([entry]):
        raise IntegratorError(f"{argument} must be a number, but has the symbol {shorten(names[0])!r}")
    number = Fraction(entry) if isinstance(entry, float) else fraction_of(entry)
    if abs(number) > LARGEST:
        raise IntegratorError(f"{argument} must be at most 10^300 in size, but was {shorten(str(value))}")
    return number


def _read_start(scene: Scene, y0: Any, t0: Any) -> tuple[list[Fraction], Fraction]:
    """The start and its time."""
    origin = None if t0 is None else _read_number(t0, "t0")
    clock = scene.places.get(TIME)
    if y0 is None:
        if scene.start is None:
            raise IntegratorError(f"y0 must be given, as {scene.name} has no start, but was not")
        start = [_read_number(value, "y0") for value in scene.start]
        if clock is not None and origin is not None:
            start[clock] = origin
    else:
        entries = items(y0, "y0")
        if len(entries) != scene.dimension:
            raise IntegratorError(f"y0 must have a number for each variable, {scene.dimension}, but had {len(entries)}")
        start = [_read_number(value, f"y0[{k}]") for k, value in enumerate(entries, 1)]
    if clock is None:
        return start, origin or Fraction(0)
    if origin not in (None, start[clock]):
        raise IntegratorError(f"t0 must be the variable t of y0, {start[clock]}, but was {origin}")
    return start, start[clock]


def _read_times(t: Any, origin: Fraction) -> list[Fraction]:
    """The times, in one direction from the origin."""
    t = t.tolist() if hasattr(t, "tolist") else t
    single = isinstance(t, str) or not isinstance(t, Iterable)
    times = [_read_number(x, f"t[{k}]") for k, x in enumerate([t] if single else items(t, "t"), 1)]
    if not times:
        raise IntegratorError("t must have at least one time, but had none")
    direction = 1 if times[-1] >= origin else -1
    for k, (before, after) in enumerate(pairwise([origin, *times]), 1):
        if direction * (after - before) < 0:
            raise IntegratorError(
                f"t must go in one direction from t0, but t[{k}] is {float(after)} and comes after {float(before)}"
            )
    return times


def _with_checks(times: list[Fraction], origin: Fraction) -> tuple[list[Fraction], list[int]]:
    """The times with further ones before and between them, and the indices of the requested ones."""
    checked, wanted, later = list[Fraction](), list[int](), -(-CHECKS // len(times))
    for before, after in pairwise([origin, *times]):
        parts = later if checked else CHECKS
        checked += (before + (after - before) * k / parts for k in range(1, parts + 1))
        wanted.append(len(checked) - 1)
    return checked, wanted


def _check_certain(
    solution: ReferenceSolution, scene: Scene, start: np.ndarray, times: Sequence[float], digits: int
) -> None:
    """Refuse a solution whose error is visible in doubles."""
    sizes = np.abs(np.hstack([start, solution.high])).max(axis=1)
    blocks = np.concatenate([np.full(b.dimension, sizes[b.offset : b.end].max()) for b in scene.blocks])
    allowed = np.maximum(max(CERTAIN, 10.0 ** (3 - digits)) * sizes, NOISE * blocks)
    uncertain = np.argwhere((solution.error > allowed[:, None]).T)
    if len(uncertain):
        k, i = uncertain[0]
        raise IntegratorError(
            f"t must end before {times[k]:.10g}, where {scene.variables[i]} is only known within "
            f"{solution.error[i, k]:.1g} (full=True gives it nevertheless), but reached to {times[-1]:.10g}"
        )


def settled_solution(
    scene: Scene | str, t: Any, *, y0: Any = None, t0: Any = None, digits: int = MOST_DIGITS
) -> ReferenceSolution:
    """The solution of a scene in doubles with an error bound, from values of its field only.

    `reference_solution` gives all digits, but needs formulas.

    Args:
        scene: The scene; its parameters must be numbers.
        t: The times, in one direction from `t0`; a number counts as one time.
        y0: The start, a number for each variable; by default that of the scene.
        t0: The time of the start; by default the scene's variable t if it has one, else 0.
        digits: Steps are halved until the difference of two solutions is below 10^−digits of the largest value of each
            block; up to 15. It may stay larger, as the bound tells, where rounding errors grow or the field jumps.

    Returns:
        The solution; its `low` is zero.

    Raises:
        IntegratorError: An argument is invalid, or the solution ends before the last time.

    Example:
        >>> from integrators import scene_from_function
        >>> def rate(y):
        ...     return -y[0] if y[0] > 0 else 0.0
        >>> found = settled_solution(scene_from_function(rate, [1]), [1])
        >>> print(found.high[0, 0].round(12), bool(found.error.max() < 1e-14))
        0.367879441171 True

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.5 (the method).
    """
    scene = as_scene(scene)
    digits = read_whole(digits, "digits", f"a whole number from 1 to {MOST_DIGITS}", 1, MOST_DIGITS)
    start, origin = _read_start(scene, y0, t0)
    times, wanted = _with_checks(_read_times(t, origin), origin)
    high, error = _settled(scene, [*map(float, start)], float(origin), [*map(float, times)], digits)
    return ReferenceSolution(high[:, wanted], np.zeros((len(high), len(wanted))), error[:, wanted])


def _settled(
    scene: Scene, y0: Sequence[float], origin: float, times: Sequence[float], digits: int
) -> tuple[np.ndarray, np.ndarray]:
    """The solution at times in one direction from the origin, and bounds of its errors, both (variables, times)."""
    from integrators.steppers.states import StepError

    known: np.ndarray | None = None
    found: tuple[np.ndarray, np.ndarray] | None = None
    failed: StepError | None = None
    for halving in range(MOST_HALVINGS + 1):
        try:
            values, nudged = (_solution(scene, y0, origin, times, halving, nudge) for nudge in (0, 1))
        except StepError as error:
            known, failed = None, error
            continue
        if known is not None:
            of_steps, of_rounding = (np.maximum.accumulate(np.abs(values - x), axis=1) for x in (known, nudged))
            blocks = ((b.dimension, np.abs(values[b.offset : b.end]).max()) for b in scene.blocks)
            sizes = np.concatenate([np.full(size, largest) for size, largest in blocks])[:, None]
            found = values, SAFETY * (of_steps + of_rounding + UNIT * np.abs(values))
            least = max(10.0**-digits / SAFETY, SETTLED * UNIT) * np.maximum(sizes, np.finfo(float).tiny)
            if (of_steps[:, -1:] <= np.maximum(SAFETY * of_rounding[:, -1:], least)).all():
                break
        known = values
    if found is None:
        raise IntegratorError(
            f"t must end where {FIRST_STEPS << MOST_HALVINGS} steps of {METHOD} reach the solution of {scene.name}, "
            f"but reached to {times[-1]:g}: {failed}"
        ) from failed
    return found


def _solution(
    scene: Scene, y0: Sequence[float], origin: float, times: Sequence[float], halving: int, nudge: int
) -> np.ndarray:
    """The solution by whole numbers of steps between times, doubled for each halving, with or without a nudge."""
    from integrators.steppers.stepping import stepper

    made: Any = stepper(METHOD, scene)
    y, values = np.array(y0, dtype=float), np.empty((len(y0), len(times)))
    longest, random = abs(times[-1] - origin) / FIRST_STEPS, np.random.default_rng(1)
    for k, (before, after) in enumerate(pairwise([origin, *times])):
        if after != before:
            count = ceil(abs(after - before) / longest) << halving
            state = made.start(y, h=(after - before) / count * (1 + nudge * STRETCH), t0=before)
            made.advance(state, count)
            y = state.y
        if k % ceil(len(times) / NUDGES) == 0:
            y = y * (1 + nudge * NUDGE * random.choice([-1.0, 1.0], len(y)))
        values[:, k] = y
    return values
