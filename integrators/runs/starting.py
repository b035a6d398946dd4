"""Starting values of multistep methods."""

from __future__ import annotations

import numpy as np

from integrators.core.errors import IntegratorError
from integrators.methods.catalogue.registry import method as catalogue_method
from integrators.methods.kinds.memory import LinearMultistep
from integrators.scenes.scene import Scene
from integrators.steppers.multistep import read_starting_values
from integrators.steppers.stepping import stepper

RUNGE_KUTTA = "runge-kutta"


def starting_values(
    method: LinearMultistep, scene: Scene, y0: object, h: float | str, t0: float, start: object
) -> np.ndarray:
    """The k starting values, oldest first: those given, or the first steps of a Runge–Kutta method of the same order.

    Explicit methods of order up to 4 start with ``rk4``, others with Gauss's and implicit ones with Radau's methods.
    """
    if not isinstance(start, str):
        if y0 is not None:
            raise IntegratorError("y0 must be left out where start holds the starting values, but was given")
        return read_starting_values(method, start, scene.dimension, "start")
    if start != RUNGE_KUTTA:
        raise IntegratorError(
            f"start must be {RUNGE_KUTTA} or the starting values, such as those of memory.starting_values, but was "
            f"{start!r:.60}"
        )
    if not method.is_explicit:
        name = f"radau-iia{method.order // 2 + 1}"
    else:
        name = "rk4" if method.order <= 4 else f"gauss{(method.order + 1) // 2}"
    one_step = stepper(catalogue_method(name), scene)
    state = one_step.start(y0, h=h, t0=t0)
    states = [state.y.copy()]
    for _ in range(method.steps - 1):
        one_step.advance(state, 1)
        states.append(state.y.copy())
    return np.array(states)
