"""The reference solution of a scene: to some 30 digits, with an estimate of its error, for checking everything else."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten
from integrators.exact.entries import is_sympy, read_entry, symbol_names
from integrators.reference import taylor
from integrators.reference.taylor import Stuck, TooManySteps, solve
from integrators.scenes.model.blocks import TIME
from integrators.scenes.model.formulas import read_formula

if TYPE_CHECKING:
    import numpy as np

    from integrators.scenes.scene import Scene

MAX_DIGITS = 31
LARGEST = 10**300
CERTAIN = 2.0**-50
"""Relative errors that doubles need not show."""
NOISE = 2.0**-84
"""What a variable may be off in parts of the largest in its block: one that vanishes by symmetry is all rounding."""
FIRST_UNITS = 2.0**-10, 2.0**-16
"""With what parts of the time the two solutions begin that are compared."""


CHECKS = 16
"""At how many times before the first one wanted, at least, the two solutions are compared."""
KICK = 2.0**-104
"""By what part of itself each variable of the first solution is changed after each step; rounding does less."""
SAFETY = 4.0


class ReferenceSolution(NamedTuple):
    """A solution in double-double numbers: high + low, known up to error.

    Attributes:
        high: The solution as doubles, an array (variables, times).
        low: What is missing in them.
        error: A bound on the error, from a second solution that is disturbed in each step by more than rounding.

    Example:
        >>> from integrators import scene
        >>> solution = reference_solution(scene("pendulum"), [1, 2], full=True)
        >>> solution.high.shape, bool((solution.error < 1e-29).all())
        ((2, 2), True)
    """

    high: np.ndarray
    low: np.ndarray
    error: np.ndarray

    def numbers(self) -> np.ndarray:
        """The solution as numbers of mpmath, exactly as it is.

        Example:
            >>> import mpmath
            >>> from integrators import Scene
            >>> growth = Scene({"y": 1}, field={"y": "y"}, start={"y": [1]})
            >>> print(mpmath.nstr(reference_solution(growth, [1], full=True).numbers()[0, 0], 30))
            2.71828182845904523536028747135
        """
        import mpmath
        import numpy as np

        with mpmath.workprec(2200):  # the difference of two doubles has no more bits
            pairs = zip(self.high.flat, self.low.flat, strict=True)
            sums = [mpmath.mpf(float(high)) + mpmath.mpf(float(low)) for high, low in pairs]
        found = np.empty(len(sums), dtype=object)
        found[:] = sums
        return found.reshape(self.high.shape)


@overload
def reference_solution(
    scene: Scene, t: Any, *, y0: Any = None, t0: Any = None, digits: int = 30, full: Literal[False] = False
) -> np.ndarray: ...
@overload
def reference_solution(
    scene: Scene, t: Any, *, y0: Any = None, t0: Any = None, digits: int = 30, full: Literal[True]
) -> ReferenceSolution: ...
def reference_solution(
    scene: Scene, t: Any, *, y0: Any = None, t0: Any = None, digits: int = 30, full: bool = False
) -> np.ndarray | ReferenceSolution:
    """The exact solution of a scene, for practical purposes: by Taylor series in double-double arithmetic.

    The Taylor coefficients come from the scene's formulas, in numbers of some 31 digits. Steps are chosen from the
    last coefficients, and the times wanted are inserted in the series, so that they have no influence on the steps.
    The problem is solved twice, with other orders and steps. Rounding errors of both are of one size, and may agree or
    cancel, and roundings of the start, of parameters and of 1/n are even the same; so the difference alone can be below
    the error. Therefore one of the two is disturbed by more than rounding errors in each step, and the largest relative
    difference so far, at times between the start and t as well, bounds the error at t. Where errors shrink again, as on
    the way to an equilibrium, the bound is too large.

    Args:
        scene: The scene; its parameters must be numbers.
        t: The times, in one direction from `t0`; a number counts as one time.
        y0: The start, a number for each variable: the scene's own by default. Text and fractions are exact, a double
            is the number that it is, not the decimal that it prints as.
        t0: The time of the start: by default the scene's variable t if it has one, else 0.
        digits: A step is exact to so many digits of each variable, up to 31.
        full: Whether to return all digits, and an estimate of their error.

    Returns:
        An array (variables, times) of doubles, as good as all digits; or, if `full`, a `ReferenceSolution`.

    Raises:
        IntegratorError: An argument does not fit, the solution ends before the last time, or (unless `full`) its error
            has grown so that doubles are no longer certain.

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
    if isinstance(digits, bool) or not isinstance(digits, int) or not 1 <= digits <= MAX_DIGITS:
        raise IntegratorError(f"digits must be a whole number from 1 to {MAX_DIGITS}, but was {shorten(repr(digits))}")
    import numpy as np

    from integrators.reference.double_double import split
    from integrators.reference.taylor_program import taylor_program

    program = taylor_program(scene)
    start, origin = _read_start(scene, y0, t0)
    times = _read_times(t, origin)
    checked, wanted = _with_checks(times, origin)
    y, elapsed = np.array([split(x) for x in start]), np.array([split(x - origin) for x in checked])
    try:
        first = solve(program, y, elapsed, digits, FIRST_UNITS[0], KICK)
        second = solve(program, y, elapsed, digits + 2, FIRST_UNITS[1], 0.0)
    except Stuck as stuck:
        end = float(origin) + stuck.args[0]
        raise IntegratorError(
            f"t must end before {end:.10g}, beyond which the solution of {scene.name} could not be continued, "
            f"but reached to {float(times[-1]):.10g}"
        ) from None
    except TooManySteps as refused:
        needed, most = refused.args
        raise IntegratorError(
            f"t must end sooner, as the steps of {scene.name} are so short that some {needed:.1e} would lead to "
            f"{float(times[-1]):.10g}, and at most {most:.1e} are made"
        ) from None
    apart = np.abs((first[..., 0] - second[..., 0]) + (first[..., 1] - second[..., 1]))
    relative = np.divide(apart, second[..., 2], out=np.zeros_like(apart), where=apart > 0)
    error = SAFETY * np.maximum(np.maximum.accumulate(relative, axis=1), KICK) * second[..., 2]
    solution = ReferenceSolution(second[:, wanted, 0], second[:, wanted, 1], error[:, wanted])
    if full:
        return solution
    _check_certain(solution, scene, y[:, :1], [float(x) for x in times], digits)
    return solution.high


def first_step(scene: Scene, span: float, *, y0: Any, digits: int) -> float:
    """The first step that `reference_solution` takes, at most the span; all of it where no step is possible.

    Example:
        >>> from integrators import Scene
        >>> fast = Scene({"y": 1}, field={"y": "1 + y^2"})
        >>> print(f"{first_step(fast, 1.0, y0=[0], digits=15):.3f}")
        0.176
    """
    import numpy as np

    from integrators.reference.double_double import split
    from integrators.reference.taylor_program import taylor_program

    start, _ = _read_start(scene, y0, None)
    return taylor.first_step(taylor_program(scene), np.array([split(x) for x in start]), span, digits)


def _read_number(value: Any, argument: str) -> Fraction:
    """An exact number, or one with all digits that count; a double is the number that it is."""
    from integrators.reference.taylor_program import fraction_of

    if isinstance(value, str) or is_sympy(value):  # as scenes have them: pi/2, cos(11/10)
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
    """The start, and its time."""
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
    """The times with others before and between them, and the places of those wanted."""
    checked, wanted, later = list[Fraction](), list[int](), -(-CHECKS // len(times))
    for before, after in pairwise([origin, *times]):
        parts = later if checked else CHECKS
        checked += (before + (after - before) * k / parts for k in range(1, parts + 1))
        wanted.append(len(checked) - 1)
    return checked, wanted


def _check_certain(
    solution: ReferenceSolution, scene: Scene, start: np.ndarray, times: Sequence[float], digits: int
) -> None:
    """Refuse a solution whose error doubles would show."""
    import numpy as np

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
