"""`integrate`: run a method over many steps, and store states and observed quantities."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.core.arguments import check_end, check_progress, read_steps
from integrators.core.errors import IntegratorError, shorten
from integrators.core.text_files import check_path
from integrators.runs.checkpoints import Checkpoint, description, identity
from integrators.runs.observers import observers
from integrators.runs.storage import Contents, Counts, FolderRecording, Recording
from integrators.runs.trajectory import PART
from integrators.scenes.model.blocks import TIME
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    from integrators.methods.program.program import Method
    from integrators.runs.observers import Observers
    from integrators.runs.storage import Rows
    from integrators.runs.trajectory import Trajectory
    from integrators.scenes.scene import Scene
    from integrators.steppers.states import State
    from integrators.steppers.stepping import Stepper

CHUNK_NUMBERS = 2**21
"""Largest number of values recorded in one chunk of steps."""
CHUNK_SECONDS = 0.15
"""Time that compiled code runs between checks for Ctrl-C, progress and checkpoints."""
FIRST_CHUNK, MOST_GROWTH = 16, 8


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
        return self.so_far(steps) + (not self.includes(steps))

    def so_far(self, n: int) -> int:
        """The number of outputs up to step n of a run that goes on."""
        return 1 + self.between(0, n)


class Run:
    """A run and its recording, which agree after every call that succeeds.

    Args:
        stepper: The compiled steps.
        state: The present state.
        observer: The observed quantities.
        stored: The steps whose states are stored.
        observed: The steps whose states are observed.
        recording: Storage of states and observations.

    Attributes:
        restart: A copy of the state and the number of rows, to return to after an interrupted call.
        warning: A sentence on the first observation that was not finite.
    """

    def __init__(
        self,
        stepper: Stepper,
        state: State,
        observer: Observers,
        stored: OutputSteps,
        observed: OutputSteps,
        recording: Recording,
    ):
        self.stepper, self.state, self.observer, self.recording = stepper, state, observer, recording
        self._stored, self._observed = stored, observed
        self.restart = state.copy(), recording.counts
        self.warning: str | None = None

    def begin(self) -> None:
        """Record the start."""
        self._keep_state(True, True)

    def end(self) -> None:
        """Record the last state, unless it has been."""
        self._keep_state(not self._stored.includes(self.state.n), not self._observed.includes(self.state.n))

    def _keep_state(self, store: bool, observe: bool) -> None:
        state, counts = self.state, Counts(int(store), int(observe))
        rows = self.recording.room(counts)
        rows.y[:], rows.t[:] = state.y, state.t
        if observe and rows.observed is not None and rows.observed_t is not None:
            rows.observed[:], rows.observed_t[:] = self.observer(state.t, state.y), state.t
        self._keep(rows, counts)

    def _keep(self, rows: Rows, counts: Counts) -> None:
        if self.warning is None:
            self.warning = _nonfinite_observation(rows, counts.observed, self.observer.names)
        self.recording.add(counts)
        self.restart = self.state.copy(), self.recording.counts

    def advance(self, steps: int) -> int:
        """Make and record at most `steps` steps, as many as fit in one chunk; return their number.

        Raises:
            StepError: A step failed; everything before it is recorded.
        """
        state, before = self.state, self.state.n
        for grid, width in ((self._stored, len(state.y)), (self._observed, len(self.observer))):
            if grid.every is not None:
                steps = min(steps, grid.every * max(1, CHUNK_NUMBERS // max(1, width)))
        rows = self.recording.room(self._between(before, before + steps))
        try:
            self.stepper.record(
                state,
                steps,
                y_every=self._stored.every or 0,
                y_rows=rows.y,
                y_times=rows.t,
                o_every=(self._observed.every or 0) if len(self.observer) else 0,
                observer=self.observer.address,
                o_rows=rows.observed,
                o_times=rows.observed_t,
            )
        except StepError:
            self._keep(rows, self._between(before, state.n))
            raise
        self._keep(rows, self._between(before, state.n))
        return steps

    def _between(self, before: int, n: int) -> Counts:
        """The number of rows from the steps after `before`, up to step `n`."""
        return Counts(self._stored.between(before, n), self._observed.between(before, n))


def _nonfinite_observation(rows: Rows, count: int, names: Sequence[str]) -> str | None:
    """A sentence on the first of `count` observations that is not finite, if any."""
    import numpy as np

    if rows.observed is None or rows.observed_t is None or np.isfinite(rows.observed[:count]).all():
        return None
    row, column = np.argwhere(~np.isfinite(rows.observed[:count]))[0]
    value, t = rows.observed[row, column], rows.observed_t[row]
    return f"{names[column]} must be finite at the states that are observed, but was {value} at t = {t:g}"


def integrate(
    scene: Scene,
    method: Method | str,
    *,
    h: float,
    steps: int,
    y0: Any = None,
    t0: float = 0.0,
    parts: Mapping[str, Any] | None = None,
    save_every: int | None = 1,
    observe: Any = None,
    observe_every: int | None = None,
    compensated: bool = True,
    split: bool = True,
    solver: str = "auto",
    average_nodes: int | None = None,
    control: Any = None,
    progress: Callable[[int, int], object] | None = None,
    to: str | os.PathLike[str] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: float = 30.0,
) -> Trajectory:
    """Integrate a scene with a method, and store some of the states.

    Results depend neither on the division of the work into chunks nor on interruptions: a run resumed from a checkpoint
    ends bit for bit like an uninterrupted one. Times are t0 + n h, never sums.

    Args:
        scene: The scene.
        method: The method, or its name.
        h: The step size; negative backwards in time.
        steps: The number of steps.
        y0: The start, (variables,); by default that of the scene (at time `t0` if the time is among its variables).
        t0: The time at the start.
        parts: The parts of the scene that the parts of the method stand for; see `stepper`.
        save_every: Store the start, every `save_every`-th state, and the last; None stores start and end only.
        observe: Quantities to observe, see `observers`: ``"energy"``, names of first integrals, ``"invariants"``,
            functions of (t, y); a list of these, or a mapping from names to them.
        observe_every: Observe the start, every `observe_every`-th state, and the last; by default the stored states.
        compensated: Whether to use compensated summation.
        split: Whether to split the coefficients of implicit methods, so that their rounding causes no drift.
        solver: The solver for implicit stages: ``auto``, ``fixed-point`` or ``newton``; see `stepper`.
        average_nodes: The number of quadrature nodes for averages of the field; see `stepper`.
        control: A function σ(y) as text, for steps of variable size h σ(y); see `stepper`.
        progress: Called with the number of steps made and the total.
        to: A trajectory file. Rows are written as they come, to a folder with ``.part`` added to the name, which
            `load_trajectory` can read meanwhile; the file appears, complete, at the end.
        checkpoint: A file. If it exists, the run resumes from it; every argument except `steps`, `progress` and
            `checkpoint_every` must then be the same. It is written during the run and on interruption, and removed at
            the end; the states stored so far are in a folder as for `to`, or beside it.
        checkpoint_every: Seconds between checkpoints.

    Returns:
        The trajectory; if it is large and in a file, mapped into memory.

    Raises:
        StepError: A step failed. Its `trajectory` holds everything stored, up to the last good state; so does the file.
        IntegratorError: An argument is invalid, or the trajectory would not fit in memory or on disk.

    Warns:
        RuntimeWarning: An observation was not finite; the first such observation is named.

    Example:
        >>> from integrators import scene
        >>> run = integrate(scene("pendulum"), "stormer-verlet", h=0.1, steps=1000, save_every=500, observe="energy")
        >>> print(run.t, run.y.shape)
        [  0.  50. 100.] (2, 3)
        >>> print(run.observed["energy"].round(3))
        [...]

    References:
        HLW, section VIII.5 (compensated summation).
    """
    steps = read_steps(steps, "steps", 0)
    save_every = None if save_every is None else read_steps(save_every, "save_every", 1)
    observe_every = save_every if observe_every is None else read_steps(observe_every, "observe_every", 1)
    numerics = dict[str, Any](compensated=compensated, split=split, solver=solver, average_nodes=average_nodes)
    compiled, observer = stepper(scene, method, parts=parts, control=control, **numerics), observers(scene, observe)
    state = compiled.start(_start(scene, t0) if y0 is None else y0, h=h, t0=t0)
    if not len(state.control):  # variable steps have times of their own
        check_end(state.t0, state.h, steps)
    observer.check(state.t, state.y)
    options = {"h": state.h, "t0": state.t0, "steps": steps, "save_every": save_every, "observe_every": observe_every}
    options |= {**numerics, "control": None if control is None else str(control)}
    if not isinstance(checkpoint_every, int | float) or not checkpoint_every >= 0:
        raise IntegratorError(f"checkpoint_every must be seconds, 0 or more, but was {shorten(repr(checkpoint_every))}")
    check_progress(progress)
    target = None if to is None else check_path(to, "to")
    path = None if checkpoint is None else check_path(checkpoint, "checkpoint")
    if path is not None and path == target:
        raise IntegratorError(f"checkpoint must be another file than to, but both were {shorten(path)}")
    saved = None if path is None else Checkpoint(path, identity(compiled, observer, options, state), checkpoint_every)
    stored, observed = OutputSteps(save_every), OutputSteps(observe_every)
    counts = None
    if saved is not None:
        counts = saved.restore(
            state, steps, lambda n: Counts(stored.so_far(n), observed.so_far(n) if observer.names else 0)
        )
    contents = Contents(
        variables=scene.variables,
        names=observer.names,
        h=state.h,
        same_times=save_every == observe_every,
        meta=description(compiled, observer, options),
        total=Counts(stored.count(steps), observed.count(steps)),
    )
    folder = path if target is None else target
    recording = Recording(contents) if folder is None else FolderRecording(contents, folder + PART, target, counts)
    run = Run(compiled, state, observer, stored, observed, recording)
    if counts is None:
        run.begin()
    return _completed(run, steps, saved, progress)


def _completed(
    run: Run, steps: int, checkpoint: Checkpoint | None, progress: Callable[[int, int], object] | None
) -> Trajectory:
    """Make all steps, and return the trajectory."""
    try:
        _make_steps(run, steps, checkpoint, progress)
    except StepError as error:
        run.end()
        error.trajectory = _closed(run, checkpoint)
        raise
    except BaseException:  # Ctrl-C, or an error in `progress`: the rows of this chunk may be incomplete
        state, counts = run.restart
        run.recording.cut(counts)
        if checkpoint is None:
            _closed(run, checkpoint)
        else:
            checkpoint.write(state, counts)
            run.recording.close()
        raise
    run.end()
    if run.warning is not None:
        warnings.warn(run.warning, RuntimeWarning, stacklevel=3)
    return _closed(run, checkpoint)


def _make_steps(
    run: Run, steps: int, checkpoint: Checkpoint | None, progress: Callable[[int, int], object] | None
) -> None:
    """Make all steps, in chunks of about `CHUNK_SECONDS`; results do not depend on the chunks."""
    size = FIRST_CHUNK
    while run.state.n < steps:
        began = monotonic()
        made = run.advance(min(size, steps - run.state.n))
        size = max(1, int(made * min(MOST_GROWTH, CHUNK_SECONDS / max(monotonic() - began, 1e-9))))
        if progress is not None:
            progress(run.state.n, steps)
        if checkpoint is not None and checkpoint.is_due:
            run.recording.sync()
            checkpoint.write(run.state, run.recording.counts)


def _closed(run: Run, checkpoint: Checkpoint | None) -> Trajectory:
    """The trajectory so far; checkpoint and working files are removed."""
    trajectory = run.recording.finish()
    if checkpoint is not None:
        checkpoint.remove()
    run.recording.clear()
    return trajectory


def _start(scene: Scene, t0: float) -> Any:
    """The start of a scene at time t0."""
    y = scene.y0
    if TIME in scene.places:
        y[scene.places[TIME]] = t0
    return y
