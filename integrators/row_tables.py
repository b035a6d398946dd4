"""Rows of numbers, one after the other: in memory, or in a NumPy file that grows."""

from __future__ import annotations

import os
import struct
from typing import IO, TYPE_CHECKING, TypeAlias

from .errors import IntegratorError
from .expressions import shorten

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
