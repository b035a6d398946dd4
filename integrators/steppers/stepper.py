"""Stepper: a method on a scene, compiled. State: all that a run goes on from."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from ..errors import IntegratorError
from ..expressions import shorten
from ..modules import load_module
from ..program import Program
from ..scenes.base import Scene
from ..scenes.degrees import Piece
from ..scenes.parts import pieces_of
from .nodes import Nodes
from .source import stepper_text
from .structure import Structure

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np

    from ..program_method import Method


class StepError(IntegratorError):
    """A step that could not be made.

    Attributes:
        step: Its number, from 1.
        t: The time at which it began.
        y: The state at which it began.
    """

    def __init__(self, message: str, step: int, t: float, y: np.ndarray):
        super().__init__(message)
        self.step, self.t, self.y = step, t, y

    def __reduce__(self) -> tuple[Any, ...]:
        return StepError, (str(self), self.step, self.t, self.y)


class State:
    """Where a run is: a copy of it goes on bit for bit as the run itself.

    Attributes:
        y: The state of the system, (variables,).
        carry: Rounding errors of the sums so far that are not yet in y, (variables,).
        memory: Slopes of the last step that the next one uses.
        n: The number of steps so far.
        h: The step size.
        t0: The time at n = 0.
        is_fresh: Whether `memory` is still to be computed.
    """

    __slots__ = ("carry", "h", "is_fresh", "memory", "n", "t0", "y")

    def __init__(self, y: np.ndarray, h: float, t0: float, memory: int):
        import numpy as np

        self.y, self.carry, self.memory = y, np.zeros(len(y)), np.zeros(memory)
        self.n, self.h, self.t0, self.is_fresh = 0, h, t0, True

    @property
    def t(self) -> float:
        """The time t0 + n h."""
        return self.t0 + self.n * self.h

    def copy(self) -> State:
        """A state that does not change when this one does."""
        other = State.__new__(State)
        other.assign(self)
        return other

    def assign(self, other: State) -> None:
        """Become a copy of another state."""
        self.y, self.carry, self.memory = other.y.copy(), other.carry.copy(), other.memory.copy()
        self.n, self.h, self.t0, self.is_fresh = other.n, other.h, other.t0, other.is_fresh


class Stepper:
    """Compiled steps of a method on a scene; made by `stepper`.

    Attributes:
        scene: The scene.
        method: The method.
        source: The source of the compiled steps.
    """

    def __init__(self, scene: Scene, method: Method, parts: Any, compensated: bool, split: bool, solver: str):
        self.scene, self.method = scene, method
        nodes = Nodes(method, Structure(scene, _pieces(method, scene, parts)))
        text = stepper_text(nodes, compensated=compensated, split=split, solver=solver)
        self.source, self._memory, self._work_size, self._number_makers = text
        self._known_numbers: dict[float, np.ndarray] = {}

    @property
    def _compiled(self) -> Any:
        """The module with the functions ``advance`` and ``record``."""
        from . import iteration, machine, recording

        return load_module(self.source, helpers=[iteration, machine, recording])

    def __repr__(self) -> str:
        return f"<Stepper {self.method.name} on {self.scene.name}>"

    def start(self, y0: Sequence[float] | None = None, *, h: float, t0: float = 0.0) -> State:
        """A run before its first step.

        Args:
            y0: The start, (variables,); by default that of the scene.
            h: The step size, positive or negative.
            t0: The time at the start.

        Raises:
            IntegratorError: A number is missing or not finite, or h is zero.
        """
        import numpy as np

        y = self.scene.y0 if y0 is None else _vector(y0, self.scene.dimension)
        step, time = _number(h, "h"), _number(t0, "t0")
        if step == 0:
            raise IntegratorError("h must not be zero, but was")
        return State(np.ascontiguousarray(y), step, time, self._memory)

    def advance(self, state: State, steps: int) -> None:
        """Make steps, in place.

        Args:
            state: The run; if a step fails, it is left where that step began.
            steps: How many steps.

        Raises:
            StepError: A step did not converge, or its end was not finite.
        """
        before = state.copy()
        if not self._run(state, steps):
            self._stop(state, before, steps)

    def record(
        self,
        state: State,
        steps: int,
        *,
        y_every: int = 0,
        y_rows: np.ndarray | None = None,
        o_every: int = 0,
        observer: int = 0,
        o_rows: np.ndarray | None = None,
    ) -> None:
        """Make steps, store states and observe them.

        Args:
            state: The run; if a step fails, it is left where that step began, and the rows up to there are written.
            steps: How many steps.
            y_every: Steps from one stored state to the next, counted from the start of the run; 0 stores none.
            y_rows: A contiguous array (rows, variables) with a row for each state to be stored.
            o_every: The same for the observer.
            observer: The address of a C function ``void (double t, double *y, double *out)``.
            o_rows: A contiguous array (rows, numbers that the observer writes).

        Raises:
            StepError: A step did not converge, or its end was not finite.
        """
        import numpy as np

        nothing = np.empty((0, 0))
        before = state.copy()
        made = self._compiled.record(
            state.y, state.carry, state.memory, self._numbers(state.h), np.empty(self._work_size), state.h,
            state.t0, state.n, steps, state.is_fresh, y_every, nothing if y_rows is None else y_rows, o_every, observer,
            nothing if o_rows is None else o_rows,
        )  # fmt: skip
        state.n += made
        state.is_fresh = False
        if made < steps or not np.isfinite(state.y).all():
            self._stop(state, before, steps)

    def _numbers(self, h: float) -> np.ndarray:
        """What the compiled steps need that depends on h only."""
        import numpy as np

        if h not in self._known_numbers:
            parts = [np.ravel(make(h)) for make in self._number_makers]
            self._known_numbers = {h: np.concatenate([*parts, np.empty(0)])}
        return self._known_numbers[h]

    def _run(self, state: State, steps: int) -> bool:
        """Make steps; whether all could be made, with finite numbers at the end."""
        import numpy as np

        made = self._compiled.advance(
            state.y, state.carry, state.memory, self._numbers(state.h), np.empty(self._work_size), state.h, steps,
            state.is_fresh,
        )  # fmt: skip
        state.n += made
        state.is_fresh = False
        return made == steps and bool(np.isfinite(state.y).all())

    def _stop(self, state: State, before: State, steps: int) -> None:
        """Go back to where a step fails that is among the next ones, and say so.

        What has become infinite or nan stays so, and steps can be made again bit for bit: halving finds the step.
        """
        state.assign(before)
        good, bad = 0, steps
        while bad - good > 1:
            middle, kept = (bad - good) // 2, state.copy()
            if self._run(state, middle):
                good += middle
            else:
                bad = good + middle
                state.assign(kept)
        self._fail(state)

    def _fail(self, state: State) -> None:
        trial = state.copy()
        self._run(trial, 1)
        reason = "did not converge" if trial.n == state.n else "did not end in finite numbers"
        state.is_fresh = True
        raise StepError(
            f"h must be small enough for {self.method.name} on {self.scene.name}, but with h = {state.h:g} step "
            f"{state.n + 1}, from t = {state.t:g}, {reason}",
            state.n + 1,
            state.t,
            state.y.copy(),
        )


def stepper(
    scene: Scene,
    method: Method | str,
    *,
    parts: Mapping[str, Any] | None = None,
    compensated: bool = True,
    split: bool = True,
    solver: str = "fixed-point",
) -> Stepper:
    """Compiled steps of a method on a scene.

    Args:
        scene: The scene.
        method: The method, or its name.
        parts: What the parts of the method are: maps each to a block of the scene, a list of blocks, or a part of its
            field. By default those of the same name; a, b are the two blocks of a scene that has two.
        compensated: Whether rounding errors of the sums y + increment are carried on, so that they do not pile up.
        split: Whether coefficients of implicit methods are split into short heads and tails, so that their rounding
            errors do not cause a drift.
        solver: How implicit stages are found: ``fixed-point`` or, for stiff scenes, ``newton``.

    Returns:
        The stepper; the same one for the same arguments.

    Raises:
        IntegratorError: The scene or the method has symbols, or they do not fit.

    Example:
        >>> from integrators import method, scene
        >>> verlet = stepper(scene("pendulum"), "stormer-verlet")
        >>> state = verlet.start([0, 1], h=0.1)
        >>> verlet.advance(state, 10)
        >>> print(state.t, state.y)
        1.0 [-0.76868473  0.60038403]
    """
    if not isinstance(scene, Scene):
        raise IntegratorError(f"scene must be a Scene, but was {shorten(repr(scene))}")
    if isinstance(method, str):
        from ..methods import method as named

        method = named(method)
    if not isinstance(getattr(method, "program", None), Program):
        raise IntegratorError(f"method must be a method or its name, but was {shorten(repr(method))}")
    key = None if parts is None else tuple((k, v if isinstance(v, str) else tuple(v)) for k, v in parts.items())
    return _stepper(scene, method, key, compensated, split, solver)


@lru_cache(maxsize=256)
def _stepper(scene: Scene, method: Any, parts: Any, compensated: bool, split: bool, solver: str) -> Stepper:
    return Stepper(scene, method, None if parts is None else dict(parts), compensated, split, solver)


def _pieces(method: Method, scene: Scene, parts: Any) -> list[Piece]:
    """The pieces of the field for the parts of a method; an auxiliary matrix is the Jacobian of the whole field."""
    auxiliary = getattr(method.program, "auxiliary", ())
    names = [name for name in method.names if name not in auxiliary]
    own = dict(zip(names, pieces_of(names, scene, parts), strict=True))
    pieces = [own.get(name, Piece()) for name in method.names]
    return pieces if len(pieces) == 1 else [*pieces, Piece()]


def _number(value: Any, argument: str) -> float:
    import math

    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise IntegratorError(f"{argument} must be a finite number, but was {shorten(repr(value))}")
    return number


def _vector(values: Any, dimension: int) -> np.ndarray:
    import numpy as np

    try:
        vector = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        vector = np.array(np.nan)
    if vector.shape != (dimension,) or not np.isfinite(vector).all():
        raise IntegratorError(f"y0 must hold {dimension} finite numbers, but was {shorten(repr(values))}")
    return vector
