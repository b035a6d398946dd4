"""Where a run of steps is, and how a step fails."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError
from integrators.steppers.adaptive import TIME

if TYPE_CHECKING:
    import numpy as np


class StepError(IntegratorError):
    """A step that could not be made.

    Attributes:
        step: Its number, from 1.
        t: The time at which it began.
        y: The state at which it began.
        trajectory: The `Trajectory` that `integrate` has kept until then; None for steps made without it.

    Example:
        >>> from integrators import integrate, parse_scene
        >>> try:
        ...     integrate(parse_scene("y' = y^2"), "rk4", y0=[1], h=0.01, steps=200)
        ... except StepError as error:
        ...     print(error.step, error.t, error.trajectory)
        103 1.02 <Trajectory of rk4 on scene: 103 states from t = 0 to 1.02>
    """

    def __init__(self, message: str, step: int, t: float, y: np.ndarray, trajectory: Any = None):
        super().__init__(message)
        self.step, self.t, self.y, self.trajectory = step, t, y, trajectory

    def __reduce__(self) -> tuple[Any, ...]:
        return StepError, (str(self), self.step, self.t, self.y, self.trajectory)


class State:
    """Where a run is: a copy of it goes on bit for bit as the run itself.

    What a step leaves for the next one belongs to y and h, so these change by steps or by `restart` only.

    Attributes:
        values: The state of the system, (variables,), for compiled steps to change; `y` shows it.
        carry: Rounding errors of the sums so far that are not yet in y, (variables,).
        memory: Slopes of the last step that the next one uses.
        control: With variable steps their density, its rate, the time and its rounding errors so far; else empty.
        n: The number of steps so far.
        step_size: The step size `h`; with variable steps the factor ε of h = ε σ(y).
        t0: The time at n = 0.
        is_fresh: Whether `memory` is still to be computed.
        solver: How implicit stages are found from here on: ``fixed-point`` or ``newton``.

    Example:
        >>> from integrators import scene, stepper
        >>> verlet = stepper(scene("pendulum"), "stormer-verlet")
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
        import numpy as np

        self.values, self.carry, self.memory = y, np.zeros(len(y)), np.zeros(memory)
        self.control = np.zeros(0)
        self.n, self.step_size, self.t0, self.is_fresh, self.solver = 0, h, t0, True, solver

    @property
    def y(self) -> np.ndarray:
        """The state of the system, (variables,), to be read."""
        view = self.values.view()
        view.flags.writeable = False
        return view

    @property
    def h(self) -> float:
        """The step size."""
        return self.step_size

    @property
    def t(self) -> float:
        """The time: t0 + n h, or with variable steps the compensated sum of these."""
        return float(self.control[TIME]) if len(self.control) else self.t0 + self.n * self.h

    def copy(self) -> State:
        """A state that does not change when this one does."""
        other = State.__new__(State)
        other.assign(self)
        return other

    def assign(self, other: State) -> None:
        """Become a copy of another state."""
        for name in self.__slots__:
            value = getattr(other, name)
            setattr(self, name, value.copy() if hasattr(value, "copy") else value)
