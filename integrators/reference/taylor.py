"""Taylor series of solutions in double-double arithmetic, at given times."""

from __future__ import annotations

from math import ceil, copysign, frexp, ldexp, log
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from integrators.reference.taylor_program import TaylorProgram

WORK = 3e8
"""Operations on coefficients in one call of compiled code, so that Python can be interrupted every second."""


MOST_WORK = 3e11
"""Operations on coefficients in all, about a quarter of an hour."""
LEAST_STEPS = 1000
"""So many steps show how long the others will be: towards a singularity they shrink by a constant factor."""


class Stuck(Exception):
    """No step is possible; the argument is the time since the start."""


class TooManySteps(Exception):
    """Steps are too short; the arguments are about how many there would be, and how many are allowed."""


def solve(
    program: TaylorProgram, y: np.ndarray, times: np.ndarray, digits: int, first_unit: float, kick: float
) -> np.ndarray:
    """The solution at some times.

    Args:
        program: The operations of a scene.
        y: The start (variables, 2), double-double numbers.
        times: Times since the start (n, 2), double-double numbers of one sign that grow in size.
        digits: The error of a step is below 10^−digits of each variable, but for rounding.
        first_unit: What the first step is tried with, in parts of the last time.
        kick: By what part of itself each variable is changed after each step, up or down, and each step made longer, to
            show what errors do that are random, and what those do that are always the same.

    Returns:
        An array (variables, n, 3): double-double numbers, and the size of the variable in the step around each time,
        the sum of the absolute terms of its series.

    Raises:
        Stuck: The solution could not be continued.
        TooManySteps: At the pace of the steps made so far, the work would be more than `MOST_WORK`.
    """
    import numpy as np

    from integrators.reference import taylor_kernels as kernels

    order = order_for(digits)
    series, state = _begun(program, y, times, order, first_unit)
    values = np.empty((program.dimension, len(times), 3))
    work = len(series) * order**2
    steps, most = max(1, int(WORK / work)), MOST_WORK / work
    index, status, done = 0, kernels.RUNNING, 0
    while status == kernels.RUNNING:
        index, status = kernels.advance(program, series, state, order, kick, steps, times, index, values)
        done += steps
        needed = done * (times[-1, 0] / state[0]) if status == kernels.RUNNING and done >= LEAST_STEPS else 0.0
        if needed > most:
            raise TooManySteps(needed, most)
    if status == kernels.STUCK:
        raise Stuck(float(state[0]))
    return values


def first_step(program: TaylorProgram, y: np.ndarray, span: float, digits: int) -> float:
    """The first step of the solution, at most the span, which is positive; all of it where no step is possible."""
    import numpy as np

    from integrators.reference import taylor_kernels as kernels

    order, times = order_for(digits), np.array([[span, 0.0]])
    series, state = _begun(program, y, times, order, 1.0)
    status, values = kernels.RUNNING, np.empty((program.dimension, 1, 3))
    while status == kernels.RUNNING and not state[0]:
        _, status = kernels.advance(program, series, state, order, 0.0, 1, times, 0, values)
    return float(state[0]) or span


def _begun(
    program: TaylorProgram, y: np.ndarray, times: np.ndarray, order: int, first_unit: float
) -> tuple[np.ndarray, np.ndarray]:
    """The series with the start in its first coefficients, and the state before the first step."""
    import numpy as np

    series = np.zeros((program.dimension + 1 + len(program.operations), order + 1, 2))
    series[: program.dimension, 0] = y
    span = float(times[-1, 0])
    return series, np.array([0.0, 0.0, copysign(ldexp(first_unit, frexp(span)[1]), span)])


def order_for(digits: int) -> int:
    """The order at which a step of radius/e² leaves an error of 10^−digits (Jorba and Zou, 2005, section 3.2)."""
    return ceil(1 + digits * log(10) / 2)
