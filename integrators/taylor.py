"""Taylor series of solutions in double-double arithmetic, at given times."""

from __future__ import annotations

from math import ceil, copysign, frexp, ldexp, log
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from .taylor_program import TaylorProgram

WORK = 3e8
"""Operations on coefficients in one call of compiled code, so that Python can be interrupted every second."""


class Stuck(Exception):
    """No step is possible; the argument is the time since the start."""


def solve(program: TaylorProgram, y: np.ndarray, times: np.ndarray, digits: int, first_unit: float) -> np.ndarray:
    """The solution at some times.

    Args:
        program: The operations of a scene.
        y: The start (variables, 2), double-double numbers.
        times: Times since the start (n, 2), double-double numbers of one sign that grow in size.
        digits: The error of a step is below 10^−digits of each variable, but for rounding.
        first_unit: What the first step is tried with, in parts of the last time.

    Returns:
        An array (variables, n, 2).

    Raises:
        Stuck: The solution could not be continued.
    """
    import numpy as np

    from . import taylor_kernels as kernels

    order = order_for(digits)
    registers = program.dimension + 1 + len(program.operations)
    series = np.zeros((registers, order + 1, 2))
    series[: program.dimension, 0] = y
    values = np.empty((program.dimension, len(times), 2))
    span = float(times[-1, 0])
    unit = ldexp(first_unit, frexp(span)[1])
    state = np.array([0.0, 0.0, copysign(unit, span)])
    steps = max(1, int(WORK / (registers * order**2)))
    index, status = 0, kernels.RUNNING
    while status == kernels.RUNNING:
        index, status = kernels.advance(program, series, state, order, steps, times, index, values)
    if status == kernels.STUCK:
        raise Stuck(float(state[0]))
    return values


def order_for(digits: int) -> int:
    """The order at which a step of radius/e² leaves an error of 10^−digits (Jorba and Zou, 2005, section 3.2)."""
    return ceil(1 + digits * log(10) / 2)
