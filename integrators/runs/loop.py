"""`integrate`: many steps, of which some states are kept, and quantities observed on the way."""

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
from integrators.runs.recordings import Contents, Counts, FolderRecording, MemoryRecording
from integrators.runs.trajectory import PART
from integrators.scenes.model.blocks import TIME
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    from integrators.methods.program.program import Method
    from integrators.runs.observers import Observers
    from integrators.runs.recordings import Recording, Rows
    from integrators.runs.trajectory import Trajectory
    from integrators.scenes.scene import Scene
    from integrators.steppers.states import State
    from integrators.steppers.stepping import Stepper


CHUNK_NUMBERS = 2**21
"""How many numbers are recorded in a chunk at most."""


class Grid(NamedTuple):
    """The start, every so many-th step, and the last.

    Attributes:
        every: How many; None: nothing between start and end.
    """

    every: int | None

    def between(self, before: int, n: int) -> int:
        """How many steps after one up to another are every so many-th."""
        return 0 if self.every is None else n // self.every - before // self.every

    def has(self, n: int) -> bool:
        """Whether a step is among them, even if it is not the last."""
        return n == 0 or (self.every is not None and n % self.every == 0)

    def count(self, steps: int) -> int:
        """How many there are in so many steps."""
        return 1 + self.between(0, steps) + (not self.has(steps))


class Run:
    """A run and its recording, which agree after every call that succeeds.

    Args:
        stepper: What makes the steps.
        state: Where the run is.
        seen: What is observed.
        stored: Which states are kept.
        observed: Which states are observed.
        recording: Where rows go.

    Attributes:
        mark: A copy of the state, and how many rows there were: what to go back to when a call was interrupted.
        gap: The first observation that was no finite number, as a sentence.
    """

    def __init__(
        self, stepper: Stepper, state: State, seen: Observers, stored: Grid, observed: Grid, recording: Recording
    ):
        self.stepper, self.state, self.seen, self.recording = stepper, state, seen, recording
        self._stored, self._observed = stored, observed
        self.mark = state.copy(), recording.counts
        self.gap: str | None = None

    def begin(self) -> None:
        """Keep the start."""
        self._keep_state(True, True)

    def end(self) -> None:
        """Keep the state where the run has ended."""
        self._keep_state(not self._stored.has(self.state.n), not self._observed.has(self.state.n))

    def _keep_state(self, store: bool, observe: bool) -> None:
        state, counts = self.state, Counts(int(store), int(observe))
        rows = self.recording.room(counts)
        rows.y[:], rows.t[:] = state.y, state.t
        if observe and rows.observed is not None and rows.observed_t is not None:
            rows.observed[:], rows.observed_t[:] = self.seen(state.t, state.y), state.t
        self._keep(rows, counts)

    def _keep(self, rows: Rows, counts: Counts) -> None:
        if self.gap is None:
            self.gap = _gap(rows, counts.observed, self.seen.names)
        self.recording.add(counts)
        self.mark = self.state.copy(), self.recording.counts

    def advance(self, steps: int) -> int:
        """Make steps, not more than can be recorded at once.

        Args:
            steps: How many.

        Returns:
            How many steps were made.

        Raises:
            StepError: A step failed; what is before it has been kept.
        """
        state, before = self.state, self.state.n
        for grid, width in ((self._stored, len(state.y)), (self._observed, len(self.seen))):
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
                o_every=(self._observed.every or 0) if len(self.seen) else 0,
                observer=self.seen.address,
                o_rows=rows.observed,
                o_times=rows.observed_t,
            )
        except StepError:
            self._keep(rows, self._between(before, state.n))
            raise
        self._keep(rows, self._between(before, state.n))
        return steps

    def _between(self, before: int, n: int) -> Counts:
        """How many rows the steps after one up to another give."""
        return Counts(self._stored.between(before, n), self._observed.between(before, n))


def _gap(rows: Rows, count: int, names: Sequence[str]) -> str | None:
    """The first of so many observations that is no finite number, if there is one."""
    import numpy as np

    if rows.observed is None or rows.observed_t is None or np.isfinite(rows.observed[:count]).all():
        return None
    row, column = np.argwhere(~np.isfinite(rows.observed[:count]))[0]
    value, t = rows.observed[row, column], rows.observed_t[row]
    return f"{names[column]} must be finite at the states that are observed, but was {value} at t = {t:g}"


CHUNK_SECONDS = 0.15
"""How long compiled code runs before Ctrl-C, progress and checkpoints have their turn."""
FIRST_CHUNK, MOST_GROWTH = 16, 8


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
    """Make steps of a method on a scene, and keep some of the states.

    Results depend neither on how the work is cut into chunks nor on whether it was interrupted: a run that goes on from
    a checkpoint ends bit for bit as one in one piece. Times are t0 + n h, never sums.

    Args:
        scene: The scene.
        method: The method, or its name.
        h: The step size; negative backwards in time.
        steps: How many steps.
        y0: The start, (variables,); by default that of the scene (at time `t0` if the time is among its variables).
        t0: The time at the start.
        parts: What the parts of the method are in the scene; see `stepper`.
        save_every: Keep the start, every so many-th state, and the last; None keeps start and end only.
        observe: What to observe; see `observers`: ``"energy"``, names of first integrals, ``"invariants"``, functions
            of (t, y); a list of these, or a mapping of names to them.
        observe_every: Observe the start, every so many-th state, and the last; by default those that are kept.
        compensated: Whether rounding errors of sums are carried on.
        split: Whether coefficients of implicit methods are split, so that their rounding causes no drift.
        solver: How implicit stages are found: ``auto``, ``fixed-point`` or ``newton``; see `stepper`.
        average_nodes: How many nodes the quadrature of averages of the field has; see `stepper`.
        control: A function σ(y) as text, for steps of variable size h σ(y); see `stepper`.
        progress: Called with the number of steps made and of all.
        to: A trajectory file. Rows go to the disk as they come, to a folder with ``.part`` added to the name, and
            `load_trajectory` reads it meanwhile; in the end the file is put in its place at once.
        checkpoint: A file. If it is there, the run goes on from it; everything but `steps`, `progress` and
            `checkpoint_every` must then be as it was. It is written while the run lasts, and when it is interrupted,
            and goes when it ends; states kept so far are in a folder as for `to`, or beside it.
        checkpoint_every: Seconds between checkpoints.

    Returns:
        The trajectory; that of a file is mapped into memory if it is large.

    Raises:
        StepError: A step failed. Its `trajectory` has what was kept, with the last good state; so has the file.
        IntegratorError: An argument cannot be used, or what is to be kept would not fit.

    Warns:
        RuntimeWarning: Something observed was no finite number; the first of these is named.

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
    numerics: dict[str, Any] = {
        "compensated": compensated,
        "split": split,
        "solver": solver,
        "average_nodes": average_nodes,
    }
    made, seen = stepper(scene, method, parts=parts, control=control, **numerics), observers(scene, observe)
    state = made.start(_start(scene, t0) if y0 is None else y0, h=h, t0=t0)
    if not len(state.control):  # variable steps have times of their own
        check_end(state.t0, state.h, steps)
    seen.check(state.t, state.y)
    options = {"h": state.h, "t0": state.t0, "steps": steps, "save_every": save_every, "observe_every": observe_every}
    options |= {**numerics, "control": None if control is None else str(control)}
    if not isinstance(checkpoint_every, int | float) or not checkpoint_every >= 0:
        raise IntegratorError(f"checkpoint_every must be seconds, 0 or more, but was {shorten(repr(checkpoint_every))}")
    check_progress(progress)
    target, path = _path(to, "to"), _path(checkpoint, "checkpoint")
    if path is not None and path == target:
        raise IntegratorError(f"checkpoint must be another file than to, but both were {shorten(path)}")
    kept = None if path is None else Checkpoint(path, identity(made, seen, options, state), checkpoint_every)
    counts = None if kept is None else kept.restore(state, steps)
    stored, observed = Grid(save_every), Grid(observe_every)
    contents = Contents(
        variables=scene.variables,
        names=seen.names,
        h=state.h,
        same_times=save_every == observe_every,
        meta=description(made, seen, options),
        total=Counts(stored.count(steps), observed.count(steps)),
    )
    folder = path if target is None else target
    recording = (
        MemoryRecording(contents) if folder is None else FolderRecording(contents, folder + PART, target, counts)
    )
    run = Run(made, state, seen, stored, observed, recording)
    if counts is None:
        run.begin()
    return _completed(run, steps, kept, progress)


def _completed(
    run: Run, steps: int, checkpoint: Checkpoint | None, progress: Callable[[int, int], object] | None
) -> Trajectory:
    """The trajectory of a run when all its steps are made."""
    try:
        _make_steps(run, steps, checkpoint, progress)
    except StepError as error:
        run.end()
        error.trajectory = _closed(run, checkpoint)
        raise
    except BaseException:  # Ctrl-C, or an error of `progress`: the rows of the present chunk may be half written
        state, counts = run.mark
        run.recording.cut(counts)
        if checkpoint is None:
            _closed(run, checkpoint)
        else:
            checkpoint.write(state, counts)
            run.recording.close()
        raise
    run.end()
    if run.gap is not None:
        warnings.warn(run.gap, RuntimeWarning, stacklevel=3)
    return _closed(run, checkpoint)


def _make_steps(
    run: Run, steps: int, checkpoint: Checkpoint | None, progress: Callable[[int, int], object] | None
) -> None:
    """Make all steps in chunks of about the same time, whose lengths change nothing in the results."""
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
    """The trajectory so far; nothing is left to go on from."""
    trajectory = run.recording.finish()
    if checkpoint is not None:
        checkpoint.remove()
    run.recording.clear()
    return trajectory


def _path(value: Any, argument: str) -> str | None:
    return None if value is None else check_path(value, argument)


def _start(scene: Scene, t0: float) -> Any:
    """The start of a scene, at a time."""
    y = scene.y0
    if TIME in scene.places:
        y[scene.places[TIME]] = t0
    return y
