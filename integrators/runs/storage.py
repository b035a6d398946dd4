"""Storage of a run: its rows, in memory or appended to the files of a folder, its identity, and its checkpoint."""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from time import monotonic
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bseries_base.errors import shorten
from bseries_base.machine_code import PACKAGE, package_version
from bseries_base.memory import refuse_beyond_memory
from bseries_base.table import Document
from integrators.core.arguments import MOST_STEPS
from integrators.core.errors import IntegratorError
from integrators.core.immutable import cached_method
from integrators.core.stored_arrays import TEXT, Form, StoredArrays, read_json, reading, write_arrays
from integrators.core.text_files import atomic_write, lock, remove_unfinished
from integrators.methods.kinds.files import dumps_method
from integrators.methods.programs.program import Method, program_text
from integrators.runs.observers import Observers
from integrators.runs.trajectory import ROWS, RUN, Trajectory, load_trajectory, read_run, row_widths, trajectory_of
from integrators.scenes.scene import Scene
from integrators.steppers.states import State

if TYPE_CHECKING:
    from integrators.steppers.stepping import Stepper

LOCK = "lock"
"""The file that a run keeps locked in its folder."""


class Counts(NamedTuple):
    """Numbers of stored states and of observations."""

    stored: int = 0
    observed: int = 0


Rows = Mapping[str, np.ndarray]
"""Arrays of states, y, their times, t, and if there are any of observations, observed, and their times, observed_t."""


def _shapes(run: Document, rows: Counts) -> dict[str, tuple[int, ...]]:
    """The shape of each array with this many rows."""
    counts = {"y": rows.stored, "t": rows.stored, "observed": rows.observed, "observed_t": rows.observed}
    return {key: (counts[key], *width) for key, width in row_widths(run).items()}


def _arrays(shapes: Mapping[str, tuple[int, ...]]) -> dict[str, np.ndarray]:
    """Arrays for rows; observed values are nan until they are written, which an observer that fails does not do."""
    return {key: np.full(shape, np.nan) if key == "observed" else np.empty(shape) for key, shape in shapes.items()}


def _size(run: Document, rows: Counts) -> int:
    """Bytes of all rows."""
    return 8 * sum(map(math.prod, _shapes(run, rows).values()))


def _check_memory(size: int) -> None:
    """Refuse before the first step a trajectory that would not fit in memory."""
    refuse_beyond_memory(size, IntegratorError, "save_every must be larger, or `to` a file, since the stored run")


class Recording:
    """The rows of a run, in memory; `run` is the content of `RUN`, and `total` are the final numbers of rows."""

    def __init__(self, run: Document, total: Counts):
        _check_memory(_size(run, total))
        self.counts, self._run = Counts(), run
        self._rows = _arrays(_shapes(run, total))

    def room(self, rows: Counts) -> Rows:
        """Arrays for the next states and observations."""
        before, shapes = _shapes(self._run, self.counts), _shapes(self._run, rows)
        return {key: array[before[key][0] :][: shapes[key][0]] for key, array in self._rows.items()}

    def add(self, rows: Counts) -> None:
        """Count rows that were written to the arrays from `room`."""
        self.counts = Counts(*map(sum, zip(self.counts, rows, strict=True)))

    def finish(self) -> Trajectory:
        """The trajectory of all rows."""
        shapes = _shapes(self._run, self.counts)
        return trajectory_of(self._run, {key: rows[: shapes[key][0]] for key, rows in self._rows.items()})

    def sync(self) -> None:
        """Flush to disk, if there is one."""

    def close(self) -> None:
        """Close the files, from which the run can be resumed."""

    def clear(self) -> None:
        """Remove working files after the trajectory is made."""


class FolderRecording(Recording):
    """The rows of a run, appended to files in a folder, of which `load_trajectory` reads the complete rows.

    On a full disk an error names the folder; a memory map of preallocated files would end the process by a signal.
    The run resumes from numbers of rows, `counts`; if these are None, files left by another run are replaced. At the
    end the trajectory goes to the file `target`; if this is None, it is returned in memory.
    """

    def __init__(self, run: Document, total: Counts, folder: str, target: str | None, counts: Counts | None = None):
        self.counts, self._run, self._folder, self._target = counts or Counts(), run, folder, target
        self._files: dict[str, IO[bytes]] = {}
        if target is None:
            _check_memory(_size(run, total))
        elif os.path.exists(target) and not os.path.isfile(target):
            what = "a folder" if os.path.isdir(target) else "a pipe or a device"
            raise IntegratorError(f"to must be a file, but {shorten(target, 200)} was {what}")
        with self._writing():
            if counts is None:
                needed = _size(run, total) * (1 if target is None else 2)  # the file is made from the folder
                free = shutil.disk_usage(os.path.dirname(os.path.abspath(folder))).free
                if needed > free:
                    raise IntegratorError(
                        f"save_every must be larger, since {needed / 1e9:.1f} GB of disk would be needed, "
                        f"but {free / 1e9:.1f} GB are free"
                    )
                if not os.path.isdir(folder):
                    os.mkdir(folder)
            else:
                with reading(f"{shorten(folder, 200)} must have the rows of the run to resume from, but has not"):
                    if _invariable(read_run(folder)) != _invariable(run):
                        raise ValueError(f"its {RUN} is of another run")
            self._lock = _locked(folder)
            try:
                atomic_write(os.path.join(folder, RUN), json.dumps(run, ensure_ascii=False))
                for key, shape in _shapes(run, self.counts).items():
                    self._open(key, 8 * math.prod(shape))
            except BaseException:
                self.close()
                raise

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Refuse a folder in which the system cannot write."""
        try:
            yield
        except OSError as error:
            what = f"{shorten(self._folder, 200)} must be a folder that can be written"
            raise IntegratorError(f"{what}, but was not: {error.strerror}") from None

    def _open(self, key: str, size: int) -> None:
        """Open the file of an array, and remove everything beyond the rows to resume from."""
        path = os.path.join(self._folder, ROWS[key])
        self._files[key] = open(path, "r+b" if size else "wb", buffering=0)  # noqa: SIM115  # `close` does it
        if self._files[key].seek(0, os.SEEK_END) < size:
            raise IntegratorError(f"{shorten(path, 200)} must have the rows to resume from, but has fewer")
        self._files[key].truncate(size)
        self._files[key].seek(size)

    def room(self, rows: Counts) -> Rows:
        """Arrays for the next states and observations."""
        self._rows = _arrays(_shapes(self._run, rows))
        return self._rows

    def add(self, rows: Counts) -> None:
        """Append rows that were written to the arrays from `room`; times come last, so rows with times are complete."""
        with self._writing():
            for key, shape in _shapes(self._run, rows).items():
                left = self._rows[key][: shape[0]].data.cast("B") if shape[0] else b""
                while left:
                    left = left[self._files[key].write(left) :]
        super().add(rows)

    def sync(self) -> None:
        """Flush to disk, so that rows survive a power failure."""
        for file in self._files.values():
            os.fsync(file.fileno())

    def close(self) -> None:
        """Close the files and the lock."""
        for file in (*self._files.values(), self._lock):
            file.close()

    def finish(self) -> Trajectory:
        """The trajectory, mapped from its file, or in memory."""
        self.close()
        trajectory = load_trajectory(self._folder)
        if self._target is None:
            return trajectory.copy()
        trajectory.save(self._target)
        return load_trajectory(self._target)

    def clear(self) -> None:
        """Remove the folder."""
        for name in (*ROWS.values(), RUN, LOCK):
            with suppress(FileNotFoundError):
                os.unlink(os.path.join(self._folder, name))
        with suppress(OSError):  # it holds other files
            os.rmdir(self._folder)


def _locked(folder: str) -> IO[bytes]:
    """Lock a folder until the returned file is closed; refused if another run holds the lock."""
    file = open(os.path.join(folder, LOCK), "wb")  # noqa: SIM115  # it stays open
    with suppress(OSError):  # file systems without locks
        if lock(file):
            return file
        file.close()
        raise IntegratorError(f"{shorten(folder, 200)} must be of one run, but another one is writing there")
    return file


def _invariable(run: Document) -> Any:
    """The description of a run without the entries that may change when it is resumed."""
    meta = {key: value for key, value in run["meta"].items() if key not in ("steps", "version")}
    return json.loads(json.dumps({**run, "meta": meta}))


DIGESTS = ("start", "compiled steps")
"""Entries of an identity that messages do not show."""
VECTORS = ("values", "carry", "memory", "control")
"""Arrays of a `State`."""
HEAD = {"n": int, "is_fresh": bool, "solver": str, "run": dict}


def description(compiled: Stepper, observer: Observers, options: dict[str, object]) -> Document:
    """The scene, the method and the options, as JSON values; without a date, so that runs can be compared."""
    return {
        "scene": json.loads(_scene(compiled.scene)),
        "method": json.loads(_method(compiled.method)),
        "observe": list(observer.names),
        **options,
        "version": f"{PACKAGE} {package_version()}".rstrip(),
    }


@cached_method
def _scene(scene: Scene) -> str:
    """The name and the content of a scene file, as JSON."""
    try:
        return json.dumps({"name": scene.name} | scene.to_dict())
    except IntegratorError:  # a formula too long for a file
        return json.dumps({"name": scene.name, "active": list(scene.active)})


@cached_method
def _method(method: Method) -> str:
    """The content of a tableau file, or the program of a method without a tableau, as JSON."""
    try:
        return json.dumps({"name": method.name} | json.loads(dumps_method(method, "json")))  # type: ignore[arg-type]
    except IntegratorError:
        return json.dumps({"name": method.name, "program": program_text(method.program).splitlines()})


def identity(compiled: Stepper, observer: Observers, options: dict[str, object], start: str) -> Document:
    """Everything that must be the same when a run or an ensemble resumes, as JSON values; `start` is a hash."""
    names = {"scene": compiled.scene.name, "method": compiled.method.name, "observe": list(observer.names)}
    digests = {"start": start, "compiled steps": sha256(compiled.source.encode()).hexdigest()}
    return json.loads(json.dumps(names | options | digests))


def check_identity(found: Document, wanted: Document, what: str) -> None:
    """Refuse to resume another run; the message contains the difference."""
    for key in (*wanted, *found):
        if found.get(key) != wanted.get(key):
            was, wants = (shorten(json.dumps(run.get(key), ensure_ascii=False)) for run in (found, wanted))
            was = "other ones" if key in DIGESTS else f"{was} and not {wants}"
            raise IntegratorError(f"checkpoint must be {what}, but had as {key} {was}")


class Checkpoint:
    """The file from which a run with this identity resumes, due again `every` seconds after it was written."""

    def __init__(self, path: str, run: Document, every: float):
        self.path, self._run, self._every = path, run, every
        self._last = monotonic()

    @property
    def is_due(self) -> bool:
        """Whether the last checkpoint is old enough."""
        return monotonic() - self._last >= self._every

    def write(self, state: State) -> None:
        """Write a state; the old file is replaced by a complete one."""
        head = {"n": state.n, "is_fresh": bool(state.is_fresh), "solver": state.solver, "run": self._run}
        arrays = {"head": json.dumps(head, ensure_ascii=False)} | {name: getattr(state, name) for name in VECTORS}
        write_arrays(self.path, arrays | {"digest": checksum(arrays)})
        self._last = monotonic()

    def restore(self, state: State, steps: int) -> bool:
        """Overwrite the start of a run by the state in the file, which must be of this run; False if there is none."""
        if not os.path.exists(self.path):
            return False
        sentence = f"checkpoint must be a file of a run, but {shorten(self.path, 200)} was not"
        with reading(sentence):
            arrays = StoredArrays(self.path, sentence)
            text = arrays.read({"head": TEXT, "digest": TEXT})
            head = read_json(text["head"], HEAD, "head")
            check_identity(head["run"], self._run, "of the same run")
            vectors = arrays.read(
                {name: Form("f", (name,)) for name in VECTORS}, {name: len(getattr(state, name)) for name in VECTORS}
            )
            is_state = 0 <= head["n"] <= MOST_STEPS and head["solver"] in (state.solver, "newton")
            is_finite = all(np.isfinite(vector).all() for vector in vectors.values())
            if text["digest"] != checksum({"head": text["head"], **vectors}) or not is_state or not is_finite:
                raise ValueError("its content was not written by a run")
        for name, vector in vectors.items():
            setattr(state, name, np.array(vector, dtype=float))
        state.n, state.is_fresh, state.solver = head["n"], head["is_fresh"], head["solver"]
        if state.n > steps:
            raise IntegratorError(f"steps must be at least the {state.n} of the checkpoint, but was {steps}")
        return True

    def remove(self) -> None:
        """Remove the file, if it exists."""
        remove_unfinished(self.path)
        if os.path.exists(self.path):
            os.unlink(self.path)


def checksum(arrays: Document) -> str:
    """A hash that detects changes of a checkpoint."""
    found = sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        found.update(f"{name} {array.dtype.str} {array.shape} ".encode() + array.tobytes())
    return found.hexdigest()
