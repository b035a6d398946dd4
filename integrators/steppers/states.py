"""State of a run, and the error of a failed step."""

from __future__ import annotations

from typing import Any

import numpy as np

from integrators.core.errors import IntegratorError
from integrators.steppers.adaptive import TIME


class StepError(IntegratorError):
    """Failure of a step.

    Attributes:
        step: The number of the step, from 1.
        t: The time at its start.
        y: The state at its start.
        trajectory: The `Trajectory` of `integrate` up to then; None without `integrate`.

    Example:
        >>> import bseries as bs
        >>> try:
        ...     bs.integrate("rk4", bs.parse_scene("y' = y^2"), y0=[1], h=0.01, steps=200)
        ... except bs.integrators.StepError as error:
        ...     print(error.step, error.t, repr(error.trajectory))
        103 1.02 <Trajectory of rk4 on scene: 103 states from t = 0 to 1.02>
    """

    def __init__(self, message: str, step: int, t: float, y: np.ndarray, trajectory: Any = None):
        super().__init__(message)
        self.step, self.t, self.y, self.trajectory = step, t, y, trajectory

    def __reduce__(self) -> tuple[object, ...]:
        return StepError, (str(self), self.step, self.t, self.y, self.trajectory)


class State:
    """State of a run, from which it continues identically to the last bit.

    Steps keep data for the next step that belong to y and h; only steps and `restart` may change these.

    Attributes:
        values: The state of the system, (variables,), for compiled steps to change; `y` shows it.
        carry: The compensation: rounding errors of the sums that y does not contain, (variables,).
        memory: Stage derivatives of the last step that the next one uses.
        control: For variable steps their density, its rate, the time and its compensation; otherwise empty.
        n: The number of steps so far.
        step_size: The step size `h`; for variable steps the factor ε of h = ε σ(y).
        t0: The time at n = 0.
        is_fresh: Whether `memory` is still to be computed.
        solver: The solver of implicit stages from here on: ``fixed-point`` or ``newton``.

    Example:
        >>> import bseries as bs
        >>> verlet = bs.stepper("stormer-verlet", bs.scene("pendulum"))
        >>> state = verlet.start(h=0.1)
        >>> verlet.advance(state, 5)
        >>> other = state.copy()
        >>> verlet.advance(state, 5)
        >>> verlet.advance(other, 5)
        >>> print(state.t, (state.y == other.y).all())
        1.0 True
    """

    __slots__ = ("carry", "control", "is_fresh", "memory", "n", "solver", "step_size", "t0", "values")

    def __init__(self, y: np.ndarray, h: float, t0: float, memory: int, solver: str):
        self.values, self.carry, self.memory = y, np.zeros(len(y)), np.zeros(memory)
        self.control = np.zeros(0)
        self.n, self.step_size, self.t0, self.is_fresh, self.solver = 0, h, t0, True, solver

    def __repr__(self) -> str:
        return f"<State after {self.n:,} steps, t = {self.t:g}: {len(self.values)} variables>"

    @property
    def y(self) -> np.ndarray:
        """The state of the system, (variables,), read-only."""
        view = self.values.view()
        view.flags.writeable = False
        return view

    @property
    def h(self) -> float:
        """The step size."""
        return self.step_size

    @property
    def t(self) -> float:
        """The time: t0 + n h, or the compensated sum of variable steps."""
        return float(self.control[TIME]) if len(self.control) else self.t0 + self.n * self.h

    def copy(self) -> State:
        """An independent copy."""
        other = State.__new__(State)
        other.assign(self)
        return other

    def assign(self, other: State) -> None:
        """Become a copy of another state."""
        for name in self.__slots__:
            value = getattr(other, name)
            setattr(self, name, value.copy() if hasattr(value, "copy") else value)
