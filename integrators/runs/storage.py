"""Trajectory storage: memory or disk."""

from __future__ import annotations

import json
import os
import shutil
import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from foundation.memory import refuse_beyond_memory
from integrators.core.errors import IntegratorError, shorten
from integrators.core.stored_arrays import reading
from integrators.core.text_files import atomic_write, lock
from integrators.runs.trajectory import RUN, Trajectory, load_trajectory, read_run

if TYPE_CHECKING:
    import numpy as np

HEADER = 128
"""Bytes before the numbers of an NPY file, enough for any number of rows."""


class MemoryTable:
    """Rows in memory, allocated at once.

    Args:
        width: Length of a row; None if a row is one number.
        capacity: The largest number of rows.

    Attributes:
        count: The number of rows.
    """

    def __init__(self, width: int | None, capacity: int):
        import numpy as np

        self.count, self._rows = 0, np.empty(_shape(capacity, width))

    def room(self, rows: int) -> np.ndarray:
        """An array for the next rows."""
        return self._rows[self.count : self.count + rows]

    def add(self, rows: int) -> None:
        """Add rows that were written to the array from `room`."""
        self.count += rows

    def array(self) -> np.ndarray:
        """The rows, as columns of an array."""
        return self._rows[: self.count].T


class FileTable:
    """Rows in an NPY file, as columns of an array in Fortran order; the header is valid at any time.

    Args:
        path: The file.
        width: Length of a row; None if a row is one number.
        count: The number of rows to resume from; later rows are cut off.

    Attributes:
        count: The number of rows.

    Raises:
        IntegratorError: The file has fewer rows.
    """

    def __init__(self, path: str, width: int | None, count: int = 0):
        self.count, self._width = count, width
        self._file: IO[bytes] = open(path, "r+b" if count else "w+b", buffering=0)  # noqa: SIM115
        end = HEADER + 8 * count * (width or 1)
        if count and os.fstat(self._file.fileno()).st_size < end:
            self._file.close()
            raise IntegratorError(f"{shorten(path, 200)} must have {count} rows to resume from, but has fewer")
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
        """Write the header, and move to the end of the file."""
        shape = (self.count,) if self._width is None else (self._width, self.count)
        text = f"{{'descr': '<f8', 'fortran_order': True, 'shape': {shape}, }}"
        self._file.seek(0)
        self._file.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", HEADER - 10) + f"{text:<{HEADER - 11}}\n".encode())
        self._file.seek(0, os.SEEK_END)

    def sync(self) -> None:
        """Flush to disk, so that rows survive a power failure."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _shape(rows: int, width: int | None) -> tuple[int, ...]:
    return (rows,) if width is None else (rows, width)


LOCK = "lock"
"""The file that a run keeps locked in its folder."""


class Counts(NamedTuple):
    """Numbers of stored states and of observations."""

    stored: int = 0
    observed: int = 0


class Rows(NamedTuple):
    """Arrays of states, their times, observations, and their times."""

    y: np.ndarray
    t: np.ndarray
    observed: np.ndarray | None = None
    observed_t: np.ndarray | None = None


class Contents(NamedTuple):
    """The contents of a recording.

    Attributes:
        variables: The names of the variables.
        names: The names of the observed quantities.
        h: The step size.
        same_times: Whether exactly the stored states are observed.
        meta: The scene, the method and the options of the run.
        total: The final numbers of rows.
    """

    variables: Sequence[str]
    names: Sequence[str]
    h: float
    same_times: bool
    meta: Mapping[str, Any]
    total: Counts

    @property
    def size(self) -> int:
        """Bytes of all rows."""
        return 8 * sum((width or 1) * rows for width, rows in self.tables(self.total).values())

    def tables(self, counts: Counts) -> dict[str, tuple[int | None, int]]:
        """The width and the number of rows of each table; times are written last."""
        tables: dict[str, tuple[int | None, int]] = {"y": (len(self.variables), counts.stored)}
        if self.names:
            tables |= {"observed": (len(self.names), counts.observed), "observed_t": (None, counts.observed)}
        return {**tables, "t": (None, counts.stored)}


class Recording:
    """The rows of a run, in memory.

    Raises:
        IntegratorError: They would not fit in memory.
    """

    _tables: Mapping[str, Any]

    def __init__(self, contents: Contents):
        _check_memory(contents)
        self.contents = contents
        self._tables = {key: MemoryTable(*size) for key, size in contents.tables(contents.total).items()}

    @property
    def counts(self) -> Counts:
        """The numbers of rows."""
        observed = self._tables.get("observed_t")
        return Counts(self._tables["t"].count, 0 if observed is None else observed.count)

    def room(self, rows: Counts) -> Rows:
        """Arrays for the next states and observations."""
        sizes = self.contents.tables(rows)
        return Rows(**{key: self._tables[key].room(size) for key, (_, size) in sizes.items()})

    def add(self, rows: Counts) -> None:
        """Add rows that were written to the arrays from `room`."""
        for key, (_, size) in self.contents.tables(rows).items():
            self._tables[key].add(size)

    def cut(self, counts: Counts) -> None:
        """Keep only the first rows."""
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

    def sync(self) -> None:
        """Flush to disk, if there is one."""

    def close(self) -> None:
        """Close the files, from which the run can be resumed."""

    def clear(self) -> None:
        """Remove working files after the trajectory is made."""


class FolderRecording(Recording):
    """The rows of a run, in files in a folder.

    Args:
        contents: Its contents.
        folder: The folder; files left by another run are replaced.
        target: The final trajectory file; None: the trajectory is returned in memory.
        counts: The numbers of rows to resume from; None starts a new recording.

    Raises:
        IntegratorError: The disk is full, or the folder is not writable, belongs to another run, or has too few rows.
    """

    def __init__(self, contents: Contents, folder: str, target: str | None, counts: Counts | None = None):
        self.contents, self._folder, self._target = contents, folder, target
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
                sentence = f"{shorten(folder, 200)} must have the rows of the run to resume from, but has not"
                with reading(sentence):
                    if _invariable(read_run(folder)) != _invariable(run):
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
        """Refuse what does not fit on the disk; with a target, twice: the file is made from the folder."""
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
        """Keep only the first rows, whatever was being written."""
        self.close()
        self._lock = _locked(self._folder)
        self._open(counts)

    def sync(self) -> None:
        """Flush to disk."""
        for table in self._tables.values():
            table.sync()

    def close(self) -> None:
        """Close the files and the lock."""
        for table in self._tables.values():
            table.close()
        self._lock.close()

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
        for path in (*map(self._path, Rows._fields), *(os.path.join(self._folder, name) for name in (RUN, LOCK))):
            if os.path.exists(path):
                os.unlink(path)
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


def _check_memory(contents: Contents) -> None:
    """Refuse before the first step a trajectory that would not fit in memory."""
    refuse_beyond_memory(
        contents.size, IntegratorError, "save_every must be larger, or `to` a file, since what is kept"
    )


def _invariable(run: Mapping[str, Any]) -> Any:
    """The description of a run without the entries that may change when it is resumed."""
    meta = {key: value for key, value in run["meta"].items() if key not in ("steps", "version")}
    return json.loads(json.dumps({**run, "meta": meta}))
