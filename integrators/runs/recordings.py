"""Where what is kept of a run goes while it lasts: arrays in memory, or files in a folder."""

from __future__ import annotations

import json
import os
import shutil
import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeAlias

from foundation.memory import refuse_beyond_memory
from integrators.core.errors import IntegratorError, shorten
from integrators.core.stored_arrays import reading
from integrators.core.text_files import atomic_write, lock
from integrators.runs.trajectory import RUN, Trajectory, load_trajectory, read_run

if TYPE_CHECKING:
    import numpy as np

    Table: TypeAlias = "MemoryTable | FileTable"


HEADER = 128
"""Bytes before the numbers of a NumPy file; room for a count of any length."""


class MemoryTable:
    """Rows in memory, allocated at once.

    Args:
        width: How many numbers a row has; None where it is one number.
        capacity: How many rows there can be.

    Attributes:
        count: How many rows there are.
    """

    def __init__(self, width: int | None, capacity: int):
        import numpy as np

        self.count, self._rows = 0, np.empty(_shape(capacity, width))

    def room(self, rows: int) -> np.ndarray:
        """An array for the next rows."""
        return self._rows[self.count : self.count + rows]

    def add(self, rows: int) -> None:
        """Keep rows that have been written to what `room` gave."""
        self.count += rows

    def array(self) -> np.ndarray:
        """What is there, one column for each row."""
        return self._rows[: self.count].T


class FileTable:
    """Rows in a file, which is the transposed array in Fortran's order. Its header tells what is there at any time.

    Args:
        path: The file.
        width: How many numbers a row has; None where it is one number.
        count: How many rows to go on from; what comes after them is cut off.

    Attributes:
        count: How many rows there are.

    Raises:
        IntegratorError: The file has fewer rows.
    """

    def __init__(self, path: str, width: int | None, count: int = 0):
        self.count, self._width = count, width
        self._file: IO[bytes] = open(path, "r+b" if count else "w+b", buffering=0)  # noqa: SIM115
        end = HEADER + 8 * count * (width or 1)
        if count and os.fstat(self._file.fileno()).st_size < end:
            self._file.close()
            raise IntegratorError(f"{shorten(path, 200)} must have {count} rows to go on from, but has fewer")
        self._file.truncate(end)
        self._write_header()

    def room(self, rows: int) -> np.ndarray:
        """An array that `add` writes to the file."""
        import numpy as np

        self._next = np.empty(_shape(rows, self._width))
        return self._next

    def add(self, rows: int) -> None:
        """Write rows, then the header that counts them."""
        if rows:
            view = self._next[:rows].data.cast("B")
            while len(view):
                view = view[self._file.write(view) :]
            self.count += rows
            self._write_header()

    def _write_header(self) -> None:
        """Write the header, and go to the end."""
        shape = (self.count,) if self._width is None else (self._width, self.count)
        text = f"{{'descr': '<f8', 'fortran_order': True, 'shape': {shape}, }}"
        self._file.seek(0)
        self._file.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", HEADER - 10) + f"{text:<{HEADER - 11}}\n".encode())
        self._file.seek(0, os.SEEK_END)

    def sync(self) -> None:
        """Make sure that what is there survives a loss of power."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _shape(rows: int, width: int | None) -> tuple[int, ...]:
    return (rows,) if width is None else (rows, width)


LOCK = "lock"
"""The file that a run holds locked in its folder."""


class Counts(NamedTuple):
    """How many states are stored, and how many observations."""

    stored: int = 0
    observed: int = 0


class Rows(NamedTuple):
    """Arrays for rows: of states, their times, observations, and their times."""

    y: np.ndarray
    t: np.ndarray
    observed: np.ndarray | None = None
    observed_t: np.ndarray | None = None


class Contents(NamedTuple):
    """What a recording is of.

    Attributes:
        variables: The names of the variables.
        names: What is observed.
        h: The step size.
        same_times: Whether every stored state is observed, and none between.
        meta: What the trajectory says of itself.
        total: How many rows there will be.
    """

    variables: Sequence[str]
    names: Sequence[str]
    h: float
    same_times: bool
    meta: Mapping[str, Any]
    total: Counts

    @property
    def size(self) -> int:
        """Bytes of all the rows."""
        return 8 * sum((width or 1) * rows for width, rows in self.tables(self.total).values())

    def tables(self, counts: Counts) -> dict[str, tuple[int | None, int]]:
        """The width and the number of rows of each table; times come after what happened then."""
        tables: dict[str, tuple[int | None, int]] = {"y": (len(self.variables), counts.stored)}
        if self.names:
            tables |= {"observed": (len(self.names), counts.observed), "observed_t": (None, counts.observed)}
        return {**tables, "t": (None, counts.stored)}


class Recording:
    """Rows of a run, in tables.

    Args:
        contents: What they are.
    """

    _tables: Mapping[str, Any]

    def __init__(self, contents: Contents):
        self.contents = contents

    @property
    def counts(self) -> Counts:
        """How many rows there are."""
        seen = self._tables.get("observed_t")
        return Counts(self._tables["t"].count, 0 if seen is None else seen.count)

    def room(self, rows: Counts) -> Rows:
        """Arrays for the next states and observations."""
        sizes = self.contents.tables(rows)
        return Rows(**{key: self._tables[key].room(size) for key, (_, size) in sizes.items()})

    def add(self, rows: Counts) -> None:
        """Keep so many rows of what has been written there."""
        for key, (_, size) in self.contents.tables(rows).items():
            self._tables[key].add(size)

    def cut(self, counts: Counts) -> None:
        """Keep only so many rows."""
        raise NotImplementedError

    def sync(self) -> None:
        """Make sure that what is there survives a loss of power, if it can."""

    def close(self) -> None:
        """Leave what is there to be gone on from, if it can be."""

    def finish(self) -> Trajectory:
        """The trajectory."""
        raise NotImplementedError

    def clear(self) -> None:
        """Take away what is left when the trajectory has been made."""


class MemoryRecording(Recording):
    """A recording in memory.

    Raises:
        IntegratorError: There is not enough.
    """

    def __init__(self, contents: Contents):
        super().__init__(contents)
        _check_memory(contents)
        self._tables = {key: MemoryTable(*size) for key, size in contents.tables(contents.total).items()}

    def cut(self, counts: Counts) -> None:
        """Keep only so many rows."""
        for key, (_, rows) in self.contents.tables(counts).items():
            self._tables[key].count = rows

    def finish(self) -> Trajectory:
        """The trajectory."""
        contents, arrays = self.contents, {key: table.array() for key, table in self._tables.items()}
        return Trajectory(
            arrays["t"],
            arrays["y"],
            h=contents.h,
            variables=contents.variables,
            observed=dict(zip(contents.names, arrays.get("observed", ()), strict=True)),
            observed_t=None if contents.same_times else arrays.get("observed_t"),
            meta=contents.meta,
        )


class FolderRecording(Recording):
    """A recording in files that grow in a folder.

    Args:
        contents: What it is of.
        folder: The folder; what another run has left there is replaced.
        target: The file that the trajectory goes to in the end; without one it goes to memory.
        counts: How many rows to go on from; None begins anew.

    Raises:
        IntegratorError: The disk is full, or the folder cannot be written, is of another run, or has too few rows.
    """

    def __init__(self, contents: Contents, folder: str, target: str | None, counts: Counts | None = None):
        super().__init__(contents)
        self._folder, self._target = folder, target
        if target is None:
            _check_memory(contents)
        run = {"variables": contents.variables, "observed": contents.names, "h": contents.h}
        run |= {"same_times": contents.same_times, "meta": contents.meta}
        path = os.path.join(folder, RUN)
        if target is not None and os.path.exists(target) and not os.path.isfile(target):
            what = "a folder" if os.path.isdir(target) else "a pipe or a device"
            raise IntegratorError(f"to must be a file, but {shorten(target, 200)} was {what}")
        try:
            if counts is None:
                self._check_room()
                if not os.path.isdir(folder):
                    os.mkdir(folder)
            else:
                sentence = f"{shorten(folder, 200)} must have the rows of the run to go on from, but has not"
                with reading(sentence):
                    if _lasting(read_run(folder)) != _lasting(run):
                        raise ValueError(f"its {RUN} is of another run")
            self._lock = _locked(folder)
            try:
                atomic_write(path, json.dumps(run, ensure_ascii=False))
                self._open(counts or Counts())
            except BaseException:
                self._lock.close()
                raise
        except OSError as error:
            what = f"{shorten(folder, 200)} must be a folder that can be written"
            raise IntegratorError(f"{what}, but was not: {error.strerror}") from None

    def _check_room(self) -> None:
        """Refuse what the disk cannot hold twice: the trajectory is made of the folder."""
        needed = self.contents.size * (1 if self._target is None else 2)
        free = shutil.disk_usage(os.path.dirname(os.path.abspath(self._folder))).free
        if needed > free:
            raise IntegratorError(
                f"save_every must be larger, since {needed / 1e9:.1f} GB of disk would be needed, "
                f"but {free / 1e9:.1f} GB are free"
            )

    def _open(self, counts: Counts) -> None:
        sizes = self.contents.tables(counts)
        self._tables = {key: FileTable(self._path(key), *size) for key, size in sizes.items()}

    def _path(self, key: str) -> str:
        return os.path.join(self._folder, f"{key}.npy")

    def cut(self, counts: Counts) -> None:
        """Keep only so many rows, whatever was being written."""
        self.close()
        self._lock = _locked(self._folder)
        self._open(counts)

    def sync(self) -> None:
        """Make sure that what is there survives a loss of power."""
        for table in self._tables.values():
            table.sync()

    def close(self) -> None:
        """Leave what is there to be gone on from."""
        for table in self._tables.values():
            table.close()
        self._lock.close()

    def finish(self) -> Trajectory:
        """The trajectory, in its file and mapped from there, or in memory."""
        self.close()
        trajectory = load_trajectory(self._folder)
        if self._target is None:
            return trajectory.copy()
        trajectory.save(self._target)
        return load_trajectory(self._target)

    def clear(self) -> None:
        """Take the folder away."""
        for path in (*map(self._path, Rows._fields), *(os.path.join(self._folder, name) for name in (RUN, LOCK))):
            if os.path.exists(path):
                os.unlink(path)
        with suppress(OSError):  # there is something else in it
            os.rmdir(self._folder)


def _locked(folder: str) -> IO[bytes]:
    """An open file that keeps other runs out of a folder until it is closed, or the process ends.

    Raises:
        IntegratorError: Another run is there.
    """
    file = open(os.path.join(folder, LOCK), "wb")  # noqa: SIM115  # it stays open
    with suppress(OSError):  # runs are not kept apart where there are no locks
        if lock(file):
            return file
        file.close()
        raise IntegratorError(f"{shorten(folder, 200)} must be of one run, but another one is writing there")
    return file


def _check_memory(contents: Contents) -> None:
    """Refuse before the first step what would not fit in the end."""
    refuse_beyond_memory(
        contents.size, IntegratorError, "save_every must be larger, or `to` a file, since what is kept"
    )


def _lasting(run: Mapping[str, Any]) -> Any:
    """What is said of a run, without what may be another when it goes on."""
    meta = {key: value for key, value in run["meta"].items() if key not in ("steps", "version")}
    return json.loads(json.dumps({**run, "meta": meta}))
