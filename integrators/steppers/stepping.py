"""Steppers: compilation from a method and a scene to machine code, steps, recording, and the change of solver."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache, lru_cache
from typing import TypeAlias

import numpy as np

from bseries_base.errors import shorten, shown
from bseries_base.memory import refuse_beyond_memory
from integrators.compile.black_boxes import failure, forget_failure
from integrators.compile.c_functions import RECORDED, REPEATED, CFunction, Pointer, c_function, data
from integrators.compile.scene_source import compiled_scene
from integrators.core.arguments import check_end, read_whole
from integrators.core.errors import IntegratorError
from integrators.core.immutable import cached_method
from integrators.exact.arguments import read_number, read_vector
from integrators.methods.catalogue.registry import as_method
from integrators.methods.kinds.memory import LinearMultistep
from integrators.methods.programs.program import Method
from integrators.methods.tableaux.registers import RegisterForm
from integrators.methods.tableaux.runge_kutta import RungeKutta
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.particles.parts import Parts, Piece, check_kind, pieces_of
from integrators.scenes.scene import Scene
from integrators.steppers.adaptive import read_control, start_control
from integrators.steppers.flows import MOST_NODES
from integrators.steppers.implicit_stages import SOLVERS
from integrators.steppers.multistep import MultistepNodes, past_vectors, read_starting_values
from integrators.steppers.plan import Nodes, plan
from integrators.steppers.register_steps import register_source
from integrators.steppers.source import HELPERS, StepSource, source_of, step_source
from integrators.steppers.states import State, StepError
from integrators.steppers.step_model import Options
from integrators.steppers.structure import Structure

MOST_STEPS = 2**63 - 1
NOTHING = (0, *[0, None, 0, None, 0] * 2)
"""The last arguments of `recorded` where nothing is stored."""


def compile_step(method: Method, scene: Scene, parts: Parts | None, options: Options) -> StepSource:
    """Compile one step of a method on a scene.

    ::

        method, scene
            │   analysis        structure.py       blocks of variables, and what each piece of the field does to them
            ▼
        Structure
            │   plan            plan.py            evaluations by block, their order, implicit groups, reuse
            ▼
          Plan
            │   source          source.py          the loop over steps, memory
            │                   writer.py          arrays, linear combinations; calls of the field and its derivatives
            │                   flows.py, implicit_stages.py    the other kinds of evaluations
            ▼
        StepSource
            │   machine code    compile.modules    module from source
            │                bseries_base.lowering   LLVM code of the module; LLVM's code is cached on disk
            ▼
        int64_t advance(double *state, ...)

    A method in a form with registers is its own plan (`register_steps`).
    """
    if isinstance(method, LinearMultistep):
        structure = Structure(scene, pieces_of(method.names, scene, parts))
        return step_source(structure, plan(MultistepNodes(method, structure), stagger=False), options)
    structure = Structure(scene, method_pieces(method, scene, parts))
    if isinstance(method, RungeKutta) and method.form is not None:
        return register_source(structure, method.form, options)
    step = plan(Nodes(method, structure), stagger=options.control is None)
    return step_source(structure, step, options)


def method_pieces(method: Method, scene: Scene, parts: Parts | None) -> list[Piece]:
    """The pieces of the field for the parts of a method; an auxiliary matrix is the Jacobian of the whole field."""
    auxiliary = method.program.auxiliary
    names = [name for name in method.names if name not in auxiliary]
    own = dict(zip(names, pieces_of(names, scene, parts), strict=True))
    pieces = [own.get(name, Piece()) for name in method.names]
    if not auxiliary:  # an auxiliary matrix has no B-series
        check_kind(method.name, method.program.max_children, pieces, scene)
    return pieces if len(pieces) == 1 else [*pieces, Piece()]


class Stepper:
    """Compiled steps of a method on a scene; made by `stepper`.

    Attributes:
        method: The method.
        scene: The scene.
        source: The source of the steps, with the solver with which a run begins.
        control: The step size function; None for constant steps.

    Example:
        >>> import bseries as bs
        >>> made = bs.stepper("gauss2", bs.scene("kepler"))
        >>> made
        <Stepper gauss2 on kepler>
        >>> "while done < steps:" in made.source
        True
    """

    def __init__(self, scene: Scene, method: Method, parts: Parts | None, options: Options):
        self.scene, self.method, self.control = scene, method, options.control
        self._parts, self._options = parts, options
        self._is_free = options.solver == "auto"
        self._first_solver = "fixed-point" if self._is_free else options.solver
        self.source = self._compiled(self._first_solver).text
        self._known_numbers: dict[tuple[float, str], np.ndarray] = {}

    def __reduce__(self) -> tuple[object, ...]:
        return Stepper, (self.scene, self.method, self._parts, self._options)

    @cached_method
    def _compiled(self, solver: str) -> StepSource:
        return compile_step(self.method, self.scene, self._parts, self._options._replace(solver=solver))

    def __repr__(self) -> str:
        return f"<Stepper {self.method.name} on {self.scene.name}>"

    @property
    def iterates(self) -> bool:
        """Whether stages are solved for by iteration, so that the cost of a step depends on its size."""
        return self._compiled(self._first_solver).iterates

    def start(self, y0: object = None, *, h: float | str, t0: float = 0.0) -> State:
        """Start a run.

        Args:
            y0: The initial values, (variables,); by default those of the scene. For a multistep method with k steps its
                k starting values, (k, variables): the run begins at the last one, with n = k − 1.
            h: The step size, positive or negative; with variable steps the factor ε of h = ε σ(y).
            t0: The time at the start.

        Raises:
            IntegratorError: A number is missing or not finite, h is zero, or σ is not positive at y0.
        """
        step, time = read_number(h, "h"), read_number(t0, "t0")
        if step == 0:
            raise IntegratorError(f"h must not be zero, but was {step:g}")
        memory, states = self._compiled(self._first_solver).memory, None
        if isinstance(self.method, LinearMultistep):
            states = read_starting_values(self.method, y0, self.scene.dimension)
            y = states[-1].copy()
        else:
            y = self.scene.y0 if y0 is None else read_vector(y0, "y0", self.scene.dimension)
        state = State(np.ascontiguousarray(y), step, time, memory, self._first_solver)
        if self.control is not None:
            state.control = start_control(self.control, self.scene, state.y, time)
        if isinstance(self.method, LinearMultistep) and states is not None:
            entries = list(self._compiled(self._first_solver).past)
            vectors = past_vectors(self.method, states, step, compiled_scene(self.scene).field)
            past = np.concatenate([*(x[entries] for x in vectors), np.empty(0)])
            state.memory[memory - len(past) :] = past
            state.n = len(states) - 1
        return state

    def restart(self, state: State, *, y: Sequence[float] | np.ndarray | None = None, h: float | None = None) -> State:
        """Start a run at the present state of another.

        Args:
            state: The other run, which is not changed.
            y: Other initial values.
            h: Another step size, such as −h to go back in time.

        Returns:
            The run, with n = 0 at the present time.

        Example:
            >>> import bseries as bs
            >>> verlet = bs.stepper("stormer-verlet", bs.scene("pendulum"))
            >>> state = verlet.start([0, 1], h=0.1)
            >>> verlet.advance(state, 10)
            >>> back = verlet.restart(state, h=-state.h)
            >>> verlet.advance(back, 10)
            >>> print(back.t, back.y.round(14) + 0.0)
            0.0 [0. 1.]
        """
        begun = self.start(state.y if y is None else y, h=state.h if h is None else h, t0=state.t)
        if self.control is not None and y is None:
            begun.control = state.control.copy()  # going back needs the density of steps, too
        return begun

    def advance(self, state: State, steps: int) -> None:
        """Make steps, in place.

        Args:
            state: The run; if a step fails, it remains at the start of that step.
            steps: The number of steps.

        Raises:
            StepError: A step did not converge, or its end was not finite.
        """
        self._make(state, self._checked(state, steps), lambda n: NOTHING)

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
            state: The run; if a step fails, it remains at the start of that step, with all earlier rows written.
            steps: The number of steps.
            y_every: Steps between stored states, counted from the start of the run; 0 stores none.
            y_rows: A contiguous array (rows, variables) for the stored states.
            y_times: An array (rows,) for their times, which differ from t0 + n h for variable steps.
            o_every: Steps between calls of the observer.
            observer: The address of a C function ``void (double t, double *y, double *out)``.
            o_rows: A contiguous array (rows, outputs of the observer).
            o_times: An array (rows,) for the times of the observer.

        Raises:
            StepError: A step did not converge, or its end was not finite.
        """
        steps, first = self._checked(state, steps), state.n
        for every, rows, times, width, name in (
            (y_every, y_rows, y_times, self.scene.dimension, "y"),
            (o_every, o_rows, o_times, None, "o"),
        ):
            every = read_whole(every, f"{name}_every", "a whole number, 0 or more", 0, MOST_STEPS)
            check_rows(rows, times, (first + steps) // every - first // every if every else 0, width, name)
        if o_every and (not observer or o_rows is None):
            raise IntegratorError("observer must be the address of a function, with o_rows, where o_every is given")

        def stored(n: int) -> tuple[object, ...]:
            rows = rows_from(y_every, y_rows, y_times, n, first)
            return observer, *rows, *rows_from(o_every, o_rows, o_times, n, first)

        self._make(state, steps, stored)

    def repeat(self, state: State, steps: int, times: int) -> None:
        """Repeat the same steps to measure their cost, without changing the run.

        Args:
            state: The run.
            steps: The number of steps, all of which must succeed.
            times: The number of repetitions.

        Raises:
            IntegratorError: Not all steps could be made by the solver of the state.

        Example:
            >>> import bseries as bs
            >>> verlet = bs.stepper("stormer-verlet", bs.scene("pendulum"))
            >>> state = verlet.start(h=0.1)
            >>> verlet.repeat(state, 10, 1000)
            >>> state.n
            0
        """
        steps, to = self._checked(state, steps), state.copy()
        times = read_whole(times, "times", "a whole number, 0 or more", 0, MOST_STEPS)
        code = self._compiled(state.solver).code  # kept while it runs
        made = _loop("repeated", REPEATED)(
            code.address, *_pointers(state), *_pointers(to), *self._arrays(state),
            len(state.values), len(state.memory), len(state.control), state.h, steps, state.is_fresh, times,
        )  # fmt: skip
        if made < times:
            raise IntegratorError(f"steps must be so few that all can be made, but {steps} could not")

    def _make(self, state: State, steps: int, stored: Callable[[int], tuple[object, ...]]) -> None:
        """Make steps, with a change of solver if needed; `stored` maps n to the last arguments of `recorded`."""
        while steps > 0:
            before = state.copy()
            if self._run(state, steps, stored(state.n)):
                break
            steps -= self._go_back(state, before, steps)
            self._change_solver(state)

    def _run(self, state: State, steps: int, stored: tuple[object, ...] = NOTHING) -> bool:
        """Make steps, with the last arguments of `recorded`; whether all succeeded with finite numbers."""
        code = self._compiled(state.solver).code  # kept while it runs
        made = _loop("recorded", RECORDED)(
            code.address, *_pointers(state), *self._arrays(state),
            len(state.values), len(state.control) > 0, state.h, state.t0, state.n, steps, state.is_fresh,
            *stored,
        )  # fmt: skip
        state.n += made
        state.is_fresh = False
        return made == steps and bool(np.isfinite(state.y).all())

    def _checked(self, state: State, steps: int) -> int:
        """The number of steps, after checks of the arguments."""
        memory = self._compiled(state.solver).memory
        sizes = len(state.values), len(state.memory), len(state.control) > 0
        if sizes != (self.scene.dimension, memory, self.control is not None):
            raise IntegratorError(f"state must be one that {self!r} has started, but was another one's")
        steps = read_whole(steps, "steps", "a whole number, 0 or more", 0, MOST_STEPS)
        if self.control is None:
            check_end(state.t0, state.h, state.n + steps)
        return steps

    def _arrays(self, state: State) -> tuple[Pointer, Pointer]:
        """The numbers in compiled steps that depend on h only, and memory for work arrays."""
        key, source = (state.h, state.solver), self._compiled(state.solver)
        numbers = self._known_numbers.get(key)
        if numbers is None:  # other threads may replace what is known, with another solver
            numbers = np.concatenate([*(np.ravel(make(state.h)) for make in source.numbers), np.empty(0)])
            self._known_numbers = {key: numbers}
        what = f"scene must be smaller: a step on {self.scene.name}"
        refuse_beyond_memory(8 * source.work, IntegratorError, what)
        return data(numbers), data(np.empty(source.work))

    def _go_back(self, state: State, before: State, steps: int) -> int:
        """Move to the start of the step that fails, and return the number of steps before it.

        Steps are reproducible to the bit, and infinity and nan persist, so that bisection finds the step.
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

    def _change_solver(self, state: State) -> None:
        """Continue with Newton's method if fixed-point iteration failed and the solver is free; otherwise raise."""
        trial = state.copy()
        forget_failure()
        self._run(trial, 1)
        raised = failure()
        converges, iterates = trial.n > state.n, self._compiled(state.solver).iterates
        if not converges and iterates and self._is_free and state.solver == "fixed-point":
            with suppress(IntegratorError):  # its dense matrix does not fit in memory
                self._compiled("newton")
                state.solver = "newton"
                return
        reason = "did not end in finite numbers" if converges else "did not converge"
        if not converges and self.control is not None and not iterates:
            reason = "would have had no positive size"
        state.is_fresh = True
        step, value = f"step {state.n + 1}, from t = {state.t:g},", np.zeros_like(state.values)
        if state.n == 0:
            compiled_scene(self.scene).field(state.values, value)
        if raised is not None:
            message = f"{raised}, in {step.rstrip(',')}"
        elif not np.isfinite(value).all():
            message = f"y0 must be where the field of {self.scene.name} is finite, but {step} began where it is not"
        else:
            message = f"h must be small enough for {self.method.name} on {self.scene.name}, but with h = {state.h:g} "
            message += f"{step} {reason}"
        raise StepError(message, state.n + 1, state.t, state.y.copy()) from raised


def stepper(
    method: Method | str,
    scene: Scene,
    *,
    parts: Parts | None = None,
    compensated: bool = True,
    split: bool = True,
    solver: str = "auto",
    average_nodes: int | None = None,
    control: object = None,
) -> Stepper:
    """Compile steps of a method on a scene.

    Args:
        method: The method, or its name.
        scene: The scene.
        parts: The meaning of the parts of the method: maps each to a block of the scene, a list of blocks, or a part
            of its field. By default those of the same name; a, b are the two blocks of a scene that has two.
        compensated: Whether the sums y + increment are compensated, so that rounding errors do not accumulate.
        split: Whether coefficients of implicit methods are split into short heads and tails, so that their rounding
            errors do not cause a drift.
        solver: The solver of implicit stages: ``fixed-point``; ``newton`` for stiff scenes; or ``auto``, which is
            fixed-point iteration until it fails to converge, and from then on Newton's method.
        average_nodes: The number of Gauss nodes for averages of fields that are no polynomials, 10 by default.
        control: A function σ of the variables, as a formula, for steps of size near ε σ(y), where ε is the argument h;
            a symmetric method stays reversible (see `integrators.steppers.adaptive`).

    Returns:
        The stepper; the same object for the same arguments.

    Raises:
        IntegratorError: The scene or the method has symbols, they do not fit, or the solver is unknown.

    Example:
        >>> import bseries as bs
        >>> verlet = bs.stepper("stormer-verlet", bs.scene("pendulum"))
        >>> state = verlet.start([0, 1], h=0.1)
        >>> verlet.advance(state, 10)
        >>> print(state.t, state.y)
        1.0 [-0.75439329  0.59986611]
    """
    method, scene = as_method(method), as_scene(scene)
    if not isinstance(method, Method):
        raise IntegratorError(f"method must be a method or its name, but was {shorten(repr(method))}")
    if solver not in ("auto", *SOLVERS):
        raise IntegratorError(f"solver must be one of auto, {', '.join(SOLVERS)}, but was {shorten(repr(solver))}")
    for argument, value in (("compensated", compensated), ("split", split)):
        if not isinstance(value, bool):
            raise IntegratorError(f"{argument} must be True or False, but was {shorten(repr(value))}")
    if average_nodes is not None and (type(average_nodes) is not int or not 1 <= average_nodes <= MOST_NODES):
        given = shorten(repr(average_nodes))
        raise IntegratorError(f"average_nodes must be an integer from 1 to {MOST_NODES}, but was {given}")
    if control is not None and isinstance(method, LinearMultistep):
        raise IntegratorError(f"control must be None for a multistep method, but was {shown(control)}")
    formula = None if control is None else read_control(control, scene)
    options = Options(solver, compensated, split, average_nodes, formula)
    form = method.form if isinstance(method, RungeKutta) else None  # methods of two forms are equal
    return kept_stepper(scene, scene.name, method, parts_key(parts), options, form)


PartsKey: TypeAlias = tuple[tuple[str, str | tuple[str, ...]], ...]


@lru_cache(maxsize=256)
def kept_stepper(
    scene: Scene, name: str, method: Method, parts: PartsKey | None, options: Options, form: RegisterForm | None = None
) -> Stepper:
    """The stepper; the last ones that were made are kept."""
    return Stepper(scene, method, None if parts is None else dict(parts), options)


def parts_key(parts: Parts | None) -> PartsKey | None:
    """The argument `parts` of `stepper` as a hashable key."""
    if parts is None:
        return None
    if isinstance(parts, Mapping):
        values = list(parts.values())
        if all(isinstance(v, str) or (isinstance(v, Sequence) and all(isinstance(x, str) for x in v)) for v in values):
            return tuple((name, v if isinstance(v, str) else tuple(v)) for name, v in parts.items())
    raise IntegratorError(f"parts must map the method's parts to names of blocks or parts, but was {shown(parts)}")


def check_rows(rows: np.ndarray | None, times: np.ndarray | None, count: int, width: int | None, name: str) -> None:
    """Refuse arrays too small or of the wrong kind for compiled code to write to."""
    for array, dimensions, argument in ((rows, 2, f"{name}_rows"), (times, 1, f"{name}_times")):
        if array is None:
            if count and argument.endswith("rows"):
                raise IntegratorError(f"{argument} must be given with {name}_every, but was not")
            continue
        fits = isinstance(array, np.ndarray) and array.dtype == np.float64 and array.ndim == dimensions
        fits = fits and array.flags.c_contiguous and array.flags.writeable
        if not fits or len(array) < count or (dimensions == 2 and width not in (None, array.shape[1])):
            raise IntegratorError(
                f"{argument} must be a contiguous array of doubles with {count} rows"
                f"{f' of {width}' if dimensions == 2 and width else ''}, but was {shown(array)}"
            )


def rows_from(every: int, rows: np.ndarray | None, times: np.ndarray | None, n: int, first: int) -> tuple[object, ...]:
    """Arguments of `recorded`: store each `every`-th step after step n in arrays that begin after step `first`."""
    row = n // every - first // every if every else 0
    places = (None if array is None else data(array[row:]) for array in (rows, times))
    return every, next(places), 0 if rows is None else rows.shape[1], next(places), times is not None


def _pointers(state: State) -> list[Pointer]:
    """The data of a state, as arguments of steps."""
    return [data(array) for array in (state.values, state.carry, state.memory, state.control)]


@cache
def _loop(name: str, prototype: CFunction) -> Callable[..., int]:
    """A loop over steps (see `integrators.steppers.recording`)."""
    path = source_of("integrators.steppers.recording")
    return c_function(path.read_text(encoding="utf-8"), name, helpers=HELPERS).function(prototype)
