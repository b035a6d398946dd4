"""One step of any method, as plain as possible: what a program means, evaluation by evaluation.

Slow, in doubles or in as many digits as wanted; compiled steppers are compared with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError, shorten
from integrators.reference.plain_fields import block_parts as block_parts
from integrators.reference.plain_stepper import Stepper

if TYPE_CHECKING:
    from integrators.methods.program.program import Method
    from integrators.reference.plain_arithmetic import Vector
    from integrators.reference.plain_fields import ByPart


def plain_step(
    method: Method,
    field: ByPart,
    y: Sequence[Any],
    h: Any,
    *,
    derivative: ByPart | None = None,
    flows: ByPart | None = None,
    digits: int | None = None,
) -> Vector:
    """One step of a method, computed by its definition.

    Implicit stages are solved by fixed-point iteration, or else by Newton's method, until the increments stagnate;
    flows and averages of the field are computed numerically until they do not change.

    Args:
        method: a method of any kind, without symbols.
        field: the field, a function of y that gives a sequence of numbers; for a method with several parts a function
            for each part, as a mapping or in their order. Parts that are blocks of variables are zero elsewhere:
            `block_parts` makes them. A kind of method for special fields (`max_children`) needs such a field.
        y: the start of the step.
        h: the step size, of any sign.
        derivative: f′(y)v as a function of y and v, like `field`; parts may be left out. What is not given is computed:
            by complex steps for doubles, so that f must be analytic and take complex numbers, and by differences of
            double precision for mpmath.
        flows: the exact flow of a part as a function of y and the time, like `field`; parts may be left out.
        digits: None for doubles; else the number of digits to compute with, and `field` must compute with mpmath.

    Returns:
        The end of the step: an array of doubles, or of mpmath's numbers.

    Raises:
        IntegratorError: an argument does not fit, stages cannot be solved for, or what is computed is not finite.

    Example:
        >>> from integrators import method
        >>> print(plain_step(method("rk4"), lambda y: [-y[1], y[0]], [1, 0], 0.1))
        [0.99500417 0.09983333]
        >>> verlet, field = method("stormer-verlet"), lambda y: [-y[1], y[0]]
        >>> print(plain_step(verlet, block_parts(field, {"p": [0], "q": [1]}), [1, 0], "1/10", digits=30))
        [mpf('0.995') mpf('0.1')]
    """
    stepper = Stepper(method, field, y, h, derivative, flows, digits)
    with stepper.arithmetic.working():
        return stepper.step(stepper.start)


def plain_steps(
    method: Method,
    field: ByPart,
    y: Sequence[Any],
    h: Any,
    steps: int,
    *,
    derivative: ByPart | None = None,
    flows: ByPart | None = None,
    digits: int | None = None,
) -> Vector:
    """Several steps of a method, each as `plain_step` makes it.

    Args:
        method: a method of any kind, without symbols.
        field: the field, or its parts.
        y: the start.
        h: the step size.
        steps: how many steps.
        derivative: the derivative of the field, or of its parts.
        flows: the exact flows of parts.
        digits: None for doubles; else the number of digits to compute with.

    Returns:
        An array with one row for each component of y, and one column for the start and each step.

    Raises:
        IntegratorError: as for `plain_step`; the message says in which step.

    Example:
        >>> from integrators import method
        >>> print(plain_steps(method("explicit-euler"), lambda y: -y, [1], 0.5, 3))
        [[1.    0.5   0.25  0.125]]
    """
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 0:
        raise IntegratorError(f"steps must be 0, 1, 2, …, but was {shorten(repr(steps))}")
    import numpy as np

    stepper = Stepper(method, field, y, h, derivative, flows, digits)
    columns = [stepper.start]
    with stepper.arithmetic.working():
        for n in range(1, steps + 1):
            try:
                columns.append(stepper.step(columns[-1]))
            except IntegratorError as error:
                raise IntegratorError(f"{error}, in step {n}") from None
    return np.array(columns).T
