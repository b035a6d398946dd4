"""Reference solutions to about 30 digits, with an error bound: Taylor series in double-double arithmetic."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import pairwise
from math import ceil, copysign, frexp, ldexp, log
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

import mpmath
import numpy as np

from bseries_base.errors import shorten
from integrators.core.arguments import as_lists, items, read_whole
from integrators.core.errors import IntegratorError
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


class ReferenceSolution(NamedTuple):
    """A solution in double-double numbers, high + low, with an error bound.

    Attributes:
        high: The solution rounded to doubles, an array (variables, times).
        low: The remainder.
        error: A bound on the error, from a second solution perturbed in each step by more than rounding errors.

    Example:
        >>> import bseries as bs
        >>> solution = bs.reference_solution(bs.scene("pendulum"), [1, 2], full=True)
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
            >>> import bseries as bs
            >>> import mpmath
            >>> growth = bs.Scene({"y": 1}, field={"y": "y"}, start={"y": [1]})
            >>> print(mpmath.nstr(bs.reference_solution(growth, [1], full=True).numbers()[0, 0], 30))
            2.71828182845904523536028747135
        """
        with mpmath.workprec(2200):  # the sum of two doubles has fewer bits
            pairs = zip(self.high.flat, self.low.flat, strict=True)
            sums = [mpmath.mpf(float(high)) + mpmath.mpf(float(low)) for high, low in pairs]
        return np.array(sums, dtype=object).reshape(self.high.shape)


@overload
def reference_solution(
    scene: Scene | str, t: object, *, y0: object = None, t0: object = None, digits: int = 30,
    full: Literal[False] = False,
) -> np.ndarray: ...  # fmt: skip
@overload
def reference_solution(
    scene: Scene | str, t: object, *, y0: object = None, t0: object = None, digits: int = 30, full: Literal[True]
) -> ReferenceSolution: ...
def reference_solution(
    scene: Scene | str, t: object, *, y0: object = None, t0: object = None, digits: int = 30, full: bool = False
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
        >>> import bseries as bs
        >>> print(bs.reference_solution(bs.scene("kepler"), [1, 10]))
        [[-0.9...
        >>> bs.reference_solution(bs.Scene({"y": 1}, field={"y": "y^2"}, start={"y": [1]}), 2)
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
    start, origin = read_start(scene, y0, t0)
    times = read_times(t, origin)
    checked, wanted = with_checks(times, origin)
    y, elapsed = np.array([split(x) for x in start]), np.array([split(x - origin) for x in checked])
    about = scene.name, float(origin), float(times[-1])
    first = _solve(program, y, elapsed, digits, FIRST_UNITS[0], PERTURBATION, about)
    second = _solve(program, y, elapsed, digits + 2, FIRST_UNITS[1], 0.0, about)
    apart = np.abs((first[..., 0] - second[..., 0]) + (first[..., 1] - second[..., 1]))
    relative = np.divide(apart, second[..., 2], out=np.zeros_like(apart), where=apart > 0)
    error = SAFETY * np.maximum(np.maximum.accumulate(relative, axis=1), PERTURBATION) * second[..., 2]
    solution = ReferenceSolution(second[:, wanted, 0], second[:, wanted, 1], error[:, wanted])
    if full:
        return solution
    _check_certain(solution, scene, y[:, :1], [float(x) for x in times], digits)
    return solution.high


def first_step(scene: Scene, span: float, *, y0: object, digits: int) -> float:
    """The first step of `reference_solution`, at most the span, which is positive.

    If no step is possible, it is the shortest time that was tried.
    """
    from integrators.reference import taylor_series as taylor

    start, _ = read_start(scene, y0, None)
    program, y = taylor.taylor_program(scene), np.array([taylor.split(x) for x in start])
    order, times = _order(digits), np.array([[span, 0.0]])
    series, state = _initial_series(program, y, times, order, 1.0)
    status, values = taylor.RUNNING, np.empty((program.dimension, 1, 3))
    while status == taylor.RUNNING and not state[0]:
        _, status = taylor.advance(program, series, state, order, 0.0, 1, times, 0, values)
    if status == taylor.STUCK and (shorter := abs(float(state[2]))):  # a step is sought from there
        return first_step(scene, shorter, y0=y0, digits=digits)
    return float(state[0]) or span


def _solve(
    program: TaylorProgram, y: np.ndarray, times: np.ndarray, digits: int, first_unit: float, perturbation: float,
    about: tuple[str, float, float],
) -> np.ndarray:  # fmt: skip
    """The solution at times since the start, which have one sign and increase in size, and the size of each variable.

    Numbers are double-double; the size is the sum of the absolute terms of the series around each time. The error of a
    step is below 10^−digits of each variable, apart from rounding. `perturbation` is a relative change of each variable
    after each step, of random sign, and a relative extension of steps: they show the growth of random and of systematic
    errors. `about` is the name of the scene, the time of the start, and the last time, for messages.
    """
    from integrators.reference import taylor_series as taylor

    order = _order(digits)
    series, state = _initial_series(program, y, times, order, first_unit)
    values, (name, origin, end) = np.empty((program.dimension, len(times), 3)), about
    work = len(series) * order**2
    steps, most = max(1, int(WORK / work)), MOST_WORK / work
    index, status, done = 0, taylor.RUNNING, 0
    while status == taylor.RUNNING:
        index, status = taylor.advance(program, series, state, order, perturbation, steps, times, index, values)
        done += steps
        needed = done * (times[-1, 0] / state[0]) if status == taylor.RUNNING and done >= LEAST_STEPS else 0.0
        if needed > most:
            raise IntegratorError(
                f"t must end sooner, as the steps of {name} are so short that {end:.10g} would take about {needed:.1e} "
                f"of them, and at most {most:.1e} are allowed"
            )
    if status == taylor.STUCK:
        raise IntegratorError(
            f"t must end before {origin + float(state[0]):.10g}, beyond which the solution of {name} could not be "
            f"continued, but reached to {end:.10g}"
        )
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


def _read_number(value: object, argument: str) -> Fraction:
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


def read_start(scene: Scene, y0: object, t0: object) -> tuple[list[Fraction], Fraction]:
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


def read_times(t: Any, origin: Fraction) -> list[Fraction]:
    """The times, in one direction from the origin."""
    t = as_lists(t)
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


def with_checks(times: list[Fraction], origin: Fraction) -> tuple[list[Fraction], list[int]]:
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
