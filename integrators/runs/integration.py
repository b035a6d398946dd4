"""`integrate`: run a method over many steps, and store states and observed quantities."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from bseries_base.errors import shorten, shown, warn_user
from integrators.core.arguments import check_end, check_progress, read_steps
from integrators.core.errors import IntegratorError
from integrators.core.text_files import check_path
from integrators.exact.arguments import step_count
from integrators.methods.catalogue.registry import as_method
from integrators.methods.kinds.memory import LinearMultistep
from integrators.methods.programs.program import Method
from integrators.runs.observers import Observers, observers
from integrators.runs.starting import RUNGE_KUTTA, starting_values
from integrators.runs.storage import Checkpoint, Counts, FolderRecording, Recording, Rows, description, identity
from integrators.runs.trajectory import PART, Trajectory
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.model.blocks import TIME
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene
from integrators.steppers.states import State, StepError
from integrators.steppers.stepping import Stepper, stepper

CHUNK_NUMBERS = 2**21
"""Largest number of values recorded in one chunk of steps."""
CHUNK_SECONDS = 0.15
"""Time that compiled code runs between checks for Ctrl-C, progress and checkpoints."""
FIRST_CHUNK, MOST_GROWTH = 16, 8
"""Number of steps in the first chunk, and the largest factor from one chunk to the next."""


class OutputSteps(NamedTuple):
    """The steps after which something is stored: the start, every `every`-th step (None: no other), and the last."""

    every: int | None

    def between(self, before: int, n: int) -> int:
        """The number of `every`-th steps after step `before`, up to step `n`."""
        return 0 if self.every is None else n // self.every - before // self.every

    def includes(self, n: int) -> bool:
        """Whether step n is the start or an `every`-th step."""
        return n == 0 or (self.every is not None and n % self.every == 0)

    def count(self, steps: int) -> int:
        """The number of outputs in a run of `steps` steps."""
        return 1 + self.between(0, steps) + (not self.includes(steps))


class Run:
    """A run and its recording, which agree after every call that succeeds.

    `grids` are the steps whose states are stored, and those whose states are observed. `restart` is a copy of the state
    before the present call, which can be repeated after an interruption. `warning` is a sentence on the first
    observation that was not finite.
    """

    def __init__(
        self, stepper: Stepper, state: State, observer: Observers, grids: tuple[OutputSteps, ...], recording: Recording
    ):
        self.stepper, self.state, self.observer, self.recording = stepper, state, observer, recording
        self._grids, self.restart = grids, state.copy()
        self.warning: str | None = None

    def keep_first(self, states: np.ndarray) -> None:
        """Record the states of the start: one, or the starting values of a multistep method, up to the present one."""
        for n, y in enumerate(states, self.state.n + 1 - len(states)):
            t = self.state.t if n == self.state.n else self.state.t0 + n * self.state.h
            self._keep(t, y, [grid.includes(n) for grid in self._grids])

    def keep_last(self) -> None:
        """Record the present state, the last one, unless it has been recorded."""
        self._keep(self.state.t, self.state.y, [not grid.includes(self.state.n) for grid in self._grids])

    def _keep(self, t: float, y: np.ndarray, kept: Sequence[bool]) -> None:
        counts = Counts(*map(int, kept))
        rows = self.recording.room(counts)
        rows["y"][:], rows["t"][:] = y, t
        if counts.observed and "observed" in rows:
            rows["observed"][:], rows["observed_t"][:] = self.observer(t, y), t
        self._add(rows, counts)

    def advance(self, steps: int) -> int:
        """Make and record at most `steps` steps, as many as fit in a chunk, or until one fails; return their number."""
        state, before = self.state, self.state.n
        stored, observed = self._grids
        for grid, width in ((stored, len(state.y)), (observed, len(self.observer))):
            if grid.every is not None:
                steps = min(steps, grid.every * max(1, CHUNK_NUMBERS // max(1, width)))
        rows = self.recording.room(self._between(before, before + steps))
        try:
            self.stepper.record(
                state, steps, y_every=stored.every or 0, y_rows=rows["y"], y_times=rows["t"],
                o_every=(observed.every or 0) if len(self.observer) else 0,
                observer=self.observer.address, o_rows=rows.get("observed"), o_times=rows.get("observed_t"),
            )  # fmt: skip
        except StepError:  # after Ctrl-C, the state may not match its step number
            self._add(rows, self._between(before, state.n))
            raise
        self._add(rows, self._between(before, state.n))
        return steps

    def _between(self, before: int, n: int) -> Counts:
        """The number of rows that the steps after `before` up to `n` give."""
        return Counts(*(grid.between(before, n) for grid in self._grids))

    def _add(self, rows: Rows, counts: Counts) -> None:
        seen = rows.get("observed", np.empty(0))[: counts.observed]
        if self.warning is None and not np.isfinite(seen).all():
            row, column = np.argwhere(~np.isfinite(seen))[0]
            at = f"{seen[row, column]} at t = {rows['observed_t'][row]:g}"
            name = self.observer.names[column]
            self.warning = f"{name} must be finite at the states that are observed, but was {at}"
        self.recording.add(counts)
        self.restart = self.state.copy()


def integrate(
    method: Method | str,
    scene: Scene | str,
    *,
    h: float | str,
    steps: int | None = None,
    span: float | str | None = None,
    y0: object = None,
    t0: float = 0.0,
    start: object = RUNGE_KUTTA,
    parts: Parts | None = None,
    save_every: int | None = 1,
    observe: object = None,
    observe_every: int | None = None,
    compensated: bool = True,
    split: bool = True,
    solver: str = "auto",
    average_nodes: int | None = None,
    control: object = None,
    progress: Callable[[int, int], object] | bool | None = None,
    to: str | os.PathLike[str] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: float = 30.0,
) -> Trajectory:
    """Integrate a scene with a method, and store some of the states.

    Results depend neither on the division of the work into chunks nor on interruptions: a run resumed from a checkpoint
    ends bit for bit like an uninterrupted one. Times are t0 + n h, never sums.

    Args:
        h: The step size, a number or text such as ``"1/10"``; negative backwards in time.
        span: The length of time instead of `steps`; the last step may end later.
        y0: The start, (variables,), or values of some blocks or variables by name; by default that of
            the scene (at time `t0` if the time is among its variables).
        start: For a multistep method with k steps ``"runge-kutta"``, which makes the first k − 1 steps by a Runge–Kutta
            method of its order, or k starting values, (k, variables), in place of y0, such as those on its underlying
            one-step method (`bseries.memory.starting_values`).
        parts, compensated, split, solver, average_nodes, control: As for `stepper`.
        save_every: Store the start, every `save_every`-th state, and the last; None stores start and end only.
        observe: Quantities to observe, see `observers`: ``"energy"``, names of first integrals, ``"invariants"``,
            functions of (t, y); a list of these, or a mapping from names to them.
        observe_every: Observe the start, every `observe_every`-th state, and the last; by default the stored states.
        progress: Called with the number of steps made and the total; True writes the part that is made to stderr.
        to: A trajectory file. Rows are written during the run, to a folder with ``.part`` added to the name, which
            `load_trajectory` can read meanwhile; the file appears, complete, at the end.
        checkpoint: A file. If it exists, the run resumes from it; every argument except `steps`, `progress` and
            `checkpoint_every` must then be the same. It is written during the run and on interruption, and removed at
            the end; the states stored so far are in a folder as for `to`, or beside it.
        checkpoint_every: Seconds between checkpoints.

    Returns:
        The trajectory; a large one in a file is mapped into memory.

    Raises:
        StepError: A step failed. Its `trajectory` holds everything stored, up to the last good state; so does the file.
        IntegratorError: An argument is invalid, or the trajectory would not fit in memory or on disk.

    Warns:
        RuntimeWarning: An observation was not finite; the first such observation is named.

    Example:
        >>> import bseries as bs
        >>> run = bs.integrate("stormer-verlet", "pendulum", h=0.1, steps=1000, save_every=500, observe="energy")
        >>> print(run.t, run.y.shape)
        [  0.  50. 100.] (2, 3)
        >>> print(run.observed["energy"].round(3))
        [...]

    References:
        HLW, section VIII.5 (compensated summation).
    """
    method = as_method(method)
    scene = as_scene(scene)
    if control is not None and span is not None:
        raise IntegratorError(f"span must be left out with control, whose steps vary, but was {shown(span)}")
    steps = step_count(h, steps, span)
    save_every = None if save_every is None else read_steps(save_every, "save_every", 1)
    observe_every = save_every if observe_every is None else read_steps(observe_every, "observe_every", 1)
    numerics = dict[str, Any](compensated=compensated, split=split, solver=solver, average_nodes=average_nodes)
    compiled, observer = stepper(method, scene, parts=parts, control=control, **numerics), observers(scene, observe)
    first = None
    if isinstance(method, LinearMultistep):
        y0 = first = starting_values(method, scene, _start_of(scene, y0, t0, start), h, t0, start)
        if steps < method.steps - 1:
            raise IntegratorError(f"steps must be at least {method.steps - 1} for {method.name}, but was {steps}")
    elif not (isinstance(start, str) and start == RUNGE_KUTTA):
        raise IntegratorError(f"start must be left out for a one-step method, but was {shown(start)}")
    else:
        y0 = _start_of(scene, y0, t0, start)
    state = compiled.start(y0, h=h, t0=t0)
    if not len(state.control):  # variable steps have times of their own
        check_end(state.t0, state.h, steps)
    observer.check(state.t, state.y)
    if not isinstance(checkpoint_every, int | float) or not checkpoint_every >= 0:
        raise IntegratorError(f"checkpoint_every must be seconds, 0 or more, but was {shorten(repr(checkpoint_every))}")
    show = check_progress(progress)
    target = None if to is None else check_path(to, "to")
    path = None if checkpoint is None else check_path(checkpoint, "checkpoint")
    if path is not None and path == target:
        raise IntegratorError(f"checkpoint must be another file than to, but both were {shorten(path)}")
    options = {"h": state.h, "t0": state.t0, "save_every": save_every, "observe_every": observe_every}
    options |= {**numerics, "control": None if control is None else str(control)}
    saved = None
    if path is not None:
        begin = sha256((state.y if first is None else first).tobytes()).hexdigest()
        saved = Checkpoint(path, identity(compiled, observer, options, begin), checkpoint_every)
    is_resumed = saved is not None and saved.restore(state, steps)
    grids = OutputSteps(save_every), OutputSteps(observe_every)
    total = Counts(*(grid.count(steps) for grid in grids))
    about = {"variables": scene.variables, "observed": observer.names, "h": state.h}
    about["same_times"] = save_every == observe_every
    about["meta"] = description(compiled, observer, {"h": state.h, "t0": state.t0, "steps": steps} | options)
    counts = Counts(*(1 + grid.between(0, state.n) for grid in grids)) if is_resumed else None
    folder = path if target is None else target
    if folder is None:
        recording = Recording(about, total)
    else:
        recording = FolderRecording(about, total, folder + PART, target, counts)
    run = Run(compiled, state, observer, grids, recording)
    if not is_resumed:
        run.keep_first(state.y[None] if first is None else first)
    return _completed(run, steps, saved, show)


def _start_of(scene: Scene, y0: object, t0: float, start: object) -> object:
    """The start of a run: that of the scene at the time t0, unless it is given."""
    if isinstance(y0, Mapping):
        return scene.with_start(**y0).y0
    if y0 is not None or not isinstance(start, str):
        return y0
    y0 = scene.y0
    if TIME in scene.places:
        y0[scene.places[TIME]] = t0
    return y0


def _completed(
    run: Run, steps: int, checkpoint: Checkpoint | None, progress: Callable[[int, int], object] | None
) -> Trajectory:
    """Make all steps, in chunks of about `CHUNK_SECONDS`, and return the trajectory."""
    size = FIRST_CHUNK
    try:
        while run.state.n < steps:
            began = monotonic()
            made = run.advance(min(size, steps - run.state.n))
            size = max(1, int(made * min(MOST_GROWTH, CHUNK_SECONDS / max(monotonic() - began, 1e-9))))
            if progress is not None:
                progress(run.state.n, steps)
            if checkpoint is not None and checkpoint.is_due:
                run.recording.sync()
                checkpoint.write(run.state)
    except StepError as error:
        run.keep_last()
        error.trajectory = _closed(run, checkpoint)
        raise
    except BaseException:  # Ctrl-C, an error in `progress`, or a full disk
        if checkpoint is None:
            _closed(run, checkpoint)
        else:
            checkpoint.write(run.restart)
            run.recording.close()
        raise
    run.keep_last()
    if run.warning is not None:
        warn_user(run.warning, RuntimeWarning)
    return _closed(run, checkpoint)


def _closed(run: Run, checkpoint: Checkpoint | None) -> Trajectory:
    """The trajectory so far; checkpoint and working files are removed."""
    trajectory = run.recording.finish()
    if checkpoint is not None:
        checkpoint.remove()
    run.recording.clear()
    return trajectory
