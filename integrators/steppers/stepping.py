"""Stepper: a method on a scene, compiled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from foundation.memory import refuse_beyond_memory
from integrators.compile.lowering import SOURCES
from integrators.compile.modules import load_module
from integrators.compile.scene_source import compiled_scene
from integrators.core.errors import IntegratorError, shorten
from integrators.core.immutable import cached_method
from integrators.methods.catalogue.registry import method as named
from integrators.methods.program.program import Method
from integrators.scenes.scene import Scene
from integrators.steppers.adaptive import read_control, start_control
from integrators.steppers.averages import MOST_NODES
from integrators.steppers.nodes import Nodes
from integrators.steppers.run_input import (
    check_end,
    check_rows,
    parts_key,
    read_number,
    read_vector,
    read_whole,
    rows_from,
)
from integrators.steppers.source import KERNELS, Text, stepper_text
from integrators.steppers.states import State, StepError
from integrators.steppers.structure import Structure, method_pieces

if TYPE_CHECKING:
    import numpy as np


MOST_STEPS = 2**63 - 1
SOLVERS = ("auto", "fixed-point", "newton")


class Stepper:
    """Compiled steps of a method on a scene; made by `stepper`.

    Attributes:
        scene: The scene.
        method: The method.
        source: The source of the compiled steps, those that a run begins with.
        control: The function of step sizes; None if all are the same.

    Example:
        >>> from integrators import scene
        >>> made = stepper(scene("kepler"), "gauss2")
        >>> made
        <Stepper gauss2 on kepler>
        >>> "while done < steps:" in made.source
        True
    """

    def __init__(self, scene: Scene, method: Method, parts: Any, control: Any, options: Mapping[str, Any]):
        self.scene, self.method = scene, method
        self.control = control
        self._nodes = Nodes(method, Structure(scene, method_pieces(method, scene, parts)))
        self._options = dict(options)
        solver = self._options.pop("solver")
        self._is_free = solver == "auto"
        self._first_solver = "fixed-point" if self._is_free else solver
        text = self._text(self._first_solver)
        self.source = text.source
        self._known_numbers: dict[tuple[float, str], np.ndarray] = {}

    @cached_method
    def _text(self, solver: str) -> Text:
        return stepper_text(self._nodes, solver=solver, control=self.control, **self._options)

    @cached_method
    def _address(self, solver: str) -> int:
        """The address of the compiled steps (see `integrators.compile.machine.steps_in_c`)."""
        helpers = [str(find_spec(module).origin) for module in (*KERNELS, "integrators.steppers.adaptive")]  # pyright: ignore[reportOptionalMemberAccess]
        return load_module(self._text(solver).source, helpers=[*helpers, *SOURCES]).in_c.address

    def __repr__(self) -> str:
        return f"<Stepper {self.method.name} on {self.scene.name}>"

    def start(self, y0: Sequence[float] | np.ndarray | None = None, *, h: float, t0: float = 0.0) -> State:
        """A run before its first step.

        Args:
            y0: The start, (variables,); by default that of the scene.
            h: The step size, positive or negative; with variable steps the factor ε of h = ε σ(y).
            t0: The time at the start.

        Raises:
            IntegratorError: A number is missing or not finite, h is zero, or σ is not positive at y0.
        """
        import numpy as np

        y = self.scene.y0 if y0 is None else read_vector(y0, self.scene.dimension)
        step, time = read_number(h, "h"), read_number(t0, "t0")
        if step == 0:
            raise IntegratorError(f"h must not be zero, but was {step:g}")
        state = State(np.ascontiguousarray(y), step, time, self._text(self._first_solver).memory, self._first_solver)
        if self.control is not None:
            state.control = start_control(self.control, self.scene, state.y, time)
        return state

    def restart(self, state: State, *, y: Sequence[float] | np.ndarray | None = None, h: float | None = None) -> State:
        """A run that begins where another one is.

        Args:
            state: The other one, which stays as it is.
            y: Another state in place of its own.
            h: Another step size, such as −h for the way back.

        Returns:
            The run, with n = 0 at the present time.

        Example:
            >>> from integrators import scene
            >>> verlet = stepper(scene("pendulum"), "stormer-verlet")
            >>> state = verlet.start([0, 1], h=0.1)
            >>> verlet.advance(state, 10)
            >>> back = verlet.restart(state, h=-state.h)
            >>> verlet.advance(back, 10)
            >>> print(back.t, back.y.round(14) + 0.0)
            0.0 [0. 1.]
        """
        begun = self.start(state.y if y is None else y, h=state.h if h is None else h, t0=state.t)
        if self.control is not None and y is None:
            begun.control = state.control.copy()  # the density of steps belongs to the way back, too
        return begun

    def advance(self, state: State, steps: int) -> None:
        """Make steps, in place.

        Args:
            state: The run; if a step fails, it is left where that step began.
            steps: How many steps.

        Raises:
            StepError: A step did not converge, or its end was not finite.
        """
        steps = self._checked(state, steps)
        while steps > 0:
            before = state.copy()
            if self._run(state, steps):
                break
            steps -= self._go_back(state, before, steps)
            self._change_solver(state)

    def record(
        self,
        state: State,
        steps: int,
        *,
        y_every: int = 0,
        y_rows: np.ndarray | None = None,
        y_times: np.ndarray | None = None,
        o_every: int = 0,
        observer: int = 0,
        o_rows: np.ndarray | None = None,
        o_times: np.ndarray | None = None,
    ) -> None:
        """Make steps, store states and observe them.

        Args:
            state: The run; if a step fails, it is left where that step began, and the rows up to there are written.
            steps: How many steps.
            y_every: Steps from one stored state to the next, counted from the start of the run; 0 stores none.
            y_rows: A contiguous array (rows, variables) with a row for each state to be stored.
            y_times: An array (rows,) for their times, which are not t0 + n h where step sizes vary.
            o_every: The same for the observer.
            observer: The address of a C function ``void (double t, double *y, double *out)``.
            o_rows: A contiguous array (rows, numbers that the observer writes).
            o_times: An array (rows,) for the times of these.

        Raises:
            StepError: A step did not converge, or its end was not finite.
        """
        steps, first = self._checked(state, steps), state.n
        for every, rows, times, width, name in (
            (y_every, y_rows, y_times, self.scene.dimension, "y"),
            (o_every, o_rows, o_times, None, "o"),
        ):
            check_rows(rows, times, (first + steps) // every - first // every if every else 0, width, name)
        if o_every and (not observer or o_rows is None):
            raise IntegratorError("observer must be the address of a function, with o_rows, where o_every is given")
        while steps > 0:
            before = state.copy()
            stored = *rows_from(y_every, y_rows, y_times, state.n, first), observer
            if self._run(state, steps, *stored, *rows_from(o_every, o_rows, o_times, state.n, first)):
                break
            steps -= self._go_back(state, before, steps)
            self._change_solver(state)

    def repeat(self, state: State, steps: int, times: int) -> None:
        """Make the same steps so many times, to see what they cost; the run stays where it is.

        Args:
            state: The run.
            steps: How many steps, all of which can be made.
            times: How often.

        Raises:
            IntegratorError: Not all steps could be made by the solver of the state.

        Example:
            >>> from integrators import scene
            >>> verlet = stepper(scene("pendulum"), "stormer-verlet")
            >>> state = verlet.start(h=0.1)
            >>> verlet.repeat(state, 10, 1000)
            >>> state.n
            0
        """
        from integrators.steppers.recording import repeated

        steps, to = self._checked(state, steps), state.copy()
        times = read_whole(times, "times", "a whole number, 0 or more", 0, MOST_STEPS)
        made = repeated(
            self._address(state.solver), state.values, state.carry, state.memory, state.control,
            to.values, to.carry, to.memory, to.control, self._numbers(state),
            self._work(state), state.h, steps, int(state.is_fresh), times,
        )  # fmt: skip
        if made < times:
            raise IntegratorError(f"steps must be so few that all can be made, but {steps} could not")

    def _run(self, state: State, steps: int, *stored: Any) -> bool:
        """Make steps; whether all could be made, with finite numbers at the end.

        Args:
            state: The run.
            steps: How many steps.
            *stored: The last arguments of `recorded`; by default nothing is stored.
        """
        import numpy as np

        from integrators.steppers.recording import recorded

        made = recorded(
            self._address(state.solver), state.values, state.carry, state.memory, state.control, self._numbers(state),
            self._work(state), state.h, state.t0, state.n, steps, int(state.is_fresh),
            *stored or (*rows_from(0, None, None, 0, 0), 0, *rows_from(0, None, None, 0, 0)),
        )  # fmt: skip
        state.n += made
        state.is_fresh = False
        return made == steps and bool(np.isfinite(state.y).all())

    def _work(self, state: State) -> np.ndarray:
        """The work arrays of a step, as one."""
        import numpy as np

        size = self._text(state.solver).work
        refuse_beyond_memory(8 * size, IntegratorError, f"scene must be smaller: a step on {self.scene.name}")
        return np.empty(size)

    def _checked(self, state: State, steps: int) -> int:
        """The number of steps, if they can be made from a state."""
        text = self._text(state.solver)
        if (len(state.values), len(state.memory)) != (self.scene.dimension, text.memory):
            raise IntegratorError(f"state must be one that {self!r} has started, but was another one's")
        steps = read_whole(steps, "steps", "a whole number, 0 or more", 0, MOST_STEPS)
        if self.control is None:
            check_end(state.t0, state.h, state.n + steps)
        return steps

    def _numbers(self, state: State) -> np.ndarray:
        """What the compiled steps need that depends on h only."""
        import numpy as np

        key = state.h, state.solver
        found = self._known_numbers.get(key)
        if found is None:
            parts = [np.ravel(make(state.h)) for make in self._text(state.solver).numbers]
            found = np.concatenate([*parts, np.empty(0)])
            self._known_numbers = {key: found}
        return found

    def _go_back(self, state: State, before: State, steps: int) -> int:
        """Go back to where a step fails that is among the next ones; how many steps can be made before it.

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
        return good

    def _can_change(self, state: State) -> bool:
        """Whether a run may go on with Newton's method, if a dense matrix of its size can be had."""
        if not self._is_free or state.solver != "fixed-point" or not self._text(state.solver).iterates:
            return False
        try:
            self._text("newton")
        except IntegratorError:
            return False
        return True

    def _change_solver(self, state: State) -> None:
        """Go on with Newton's method where fixed-point iteration does not converge and no solver was asked for."""
        trial = state.copy()
        self._run(trial, 1)
        converges = trial.n > state.n
        if not converges and self._can_change(state):
            state.solver = "newton"
            return
        reason = "did not end in finite numbers" if converges else "did not converge"
        if not converges and self.control is not None and not self._text(state.solver).iterates:
            reason = "would have had no positive size"
        state.is_fresh = True
        step = f"step {state.n + 1}, from t = {state.t:g},"
        message = (
            f"y0 must be where the field of {self.scene.name} is finite, but {step} began where it is not"
            if state.n == 0 and not self._is_defined(state.values)
            else f"h must be small enough for {self.method.name} on {self.scene.name}, but with h = {state.h:g} "
            f"{step} {reason}"
        )
        raise StepError(message, state.n + 1, state.t, state.y.copy())

    def _is_defined(self, y: np.ndarray) -> bool:
        """Whether the field is finite at a state."""
        import numpy as np

        slope = np.empty_like(y)
        compiled_scene(self.scene).field(y, slope)
        return bool(np.isfinite(slope).all())


def stepper(
    scene: Scene,
    method: Method | str,
    *,
    parts: Mapping[str, Any] | None = None,
    compensated: bool = True,
    split: bool = True,
    solver: str = "auto",
    average_nodes: int | None = None,
    control: Any = None,
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
        solver: How implicit stages are found: ``fixed-point``, ``newton`` for stiff scenes, or ``auto``: by fixed-point
            iteration until it does not converge, and from there on by Newton's method.
        average_nodes: The number of Gauss's nodes for averages of fields that are no polynomials, 10 by default.
        control: A function σ of the variables, as a formula: steps then have sizes near ε σ(y), where ε is what is
            given as h, and a symmetric method stays reversible (see `integrators.steppers.adaptive`).

    Returns:
        The stepper; the same one for the same arguments.

    Raises:
        IntegratorError: The scene or the method has symbols, they do not fit, or there is no such solver.

    Example:
        >>> from integrators import method, scene
        >>> verlet = stepper(scene("pendulum"), "stormer-verlet")
        >>> state = verlet.start([0, 1], h=0.1)
        >>> verlet.advance(state, 10)
        >>> print(state.t, state.y)
        1.0 [-0.75439329  0.59986611]
    """
    if not isinstance(scene, Scene):
        raise IntegratorError(f"scene must be a Scene, but was {shorten(repr(scene))}")
    if isinstance(method, str):
        method = named(method)
    if not isinstance(method, Method):
        raise IntegratorError(f"method must be a method or its name, but was {shorten(repr(method))}")
    if solver not in SOLVERS:
        raise IntegratorError(f"solver must be one of {', '.join(SOLVERS)}, but was {shorten(repr(solver))}")
    for argument, value in (("compensated", compensated), ("split", split)):
        if not isinstance(value, bool):
            raise IntegratorError(f"{argument} must be True or False, but was {shorten(repr(value))}")
    if average_nodes is not None and (type(average_nodes) is not int or not 1 <= average_nodes <= MOST_NODES):
        given = shorten(repr(average_nodes))
        raise IntegratorError(f"average_nodes must be an integer from 1 to {MOST_NODES}, but was {given}")
    options = {"compensated": compensated, "split": split, "solver": solver, "average_nodes": average_nodes}
    formula = None if control is None else read_control(control, scene)
    return _stepper(scene, scene.name, method, parts_key(parts), formula, tuple(options.items()))


@lru_cache(maxsize=256)
def _stepper(
    scene: Scene, name: str, method: Any, parts: Any, control: Any, options: tuple[tuple[str, Any], ...]
) -> Stepper:
    return Stepper(scene, method, None if parts is None else dict(parts), control, dict(options))
