"""Arrays in NPZ archives: aligned for mapping into memory, and checked by their headers before data is read.

A reader specifies the arrays by `Form`s. Headers give kinds, shapes and sizes, so a wrong file is refused at once.
Compressed arrays can be much larger than their file, and are refused beyond the memory available.
"""

from __future__ import annotations

import json
import math
import os
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING, Any, Literal, NamedTuple

from bseries_base.errors import shorten
from bseries_base.memory import refuse_beyond_memory
from integrators.core.errors import IntegratorError
from integrators.core.text_files import replacing

if TYPE_CHECKING:
    import numpy as np

LARGE = 2**26
"""Bytes from which an array is memory-mapped, and the limit of compressed text."""
MOST_TEXT = 2**30
"""Bytes of other text."""
MOST_HEADER = 10_000
ALIGNMENT = 64
LOCAL_HEADER, ZIP64_FIELD = 30, 20
"""Bytes before the name of a ZIP member, and of the field with its sizes."""
PADDING = 0xD935
"""Identifier of a padding field in a ZIP archive."""
KINDS = {"f": "doubles", "i": "whole numbers", "fiu": "real numbers", "U": "text"}
JSON_NAMES = {
    dict: "a table", list: "a list", str: "text", int: "a whole number", float: "a number", bool: "true or false",
    type(None): "null",
}  # fmt: skip
DAMAGE = (
    OSError, ValueError, EOFError, OverflowError, MemoryError, RecursionError, NotImplementedError,
    zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip
"""Errors that reading a damaged file may raise."""


class Form(NamedTuple):
    """Specification of a stored array: kinds of numbers, as NumPy's letters, and lengths or names of equal lengths."""

    kinds: str
    shape: tuple[int | str, ...] = ()


TEXT = Form("U")


class Header(NamedTuple):
    """The header of a stored array: type, shape, order (C or F), and where its numbers start, in bytes."""

    dtype: np.dtype
    shape: tuple[int, ...]
    order: Literal["F", "C"]
    start: int

    @property
    def size(self) -> int:
        """Bytes of its numbers."""
        return math.prod(self.shape) * self.dtype.itemsize


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, object]) -> None:
    """Write an NPZ file, piece by piece, in constant memory; it replaces an old one when it is complete."""
    import numpy as np

    with replacing(path) as file, zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy")  # dated 1980: equal content gives equal files
            member.external_attr = 0o600 << 16
            before = file.tell() + LOCAL_HEADER + len(member.filename.encode()) + ZIP64_FIELD + 4
            fill = -before % ALIGNMENT
            member.extra = struct.pack(f"<HH{fill}x", PADDING, fill)
            with archive.open(member, "w", force_zip64=True) as target:
                np.lib.format.write_array(target, np.asarray(array), allow_pickle=False)


@contextmanager
def reading(sentence: str) -> Iterator[None]:
    """Turn the errors of a damaged file into an `IntegratorError`: the sentence, followed by the reason."""
    try:
        yield
    except IntegratorError:
        raise
    except DAMAGE as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise IntegratorError(f"{sentence}: {shorten(reason, 200)}") from None


def read_rows(path: str, *width: int) -> np.ndarray:
    """The complete rows in a file of plain doubles, (rows, *width); mapped into memory if large."""
    import numpy as np

    shape = os.path.getsize(path) // (8 * max(math.prod(width), 1)), *width
    size = math.prod(shape)
    return (
        np.memmap(path, float, "r", shape=shape) if 8 * size >= LARGE else np.fromfile(path, count=size).reshape(shape)
    )


class StoredArrays:
    """The arrays of an NPZ file by name.

    An `IntegratorError` on a file that cannot be read begins with `sentence`, which says what the file must be.
    """

    def __init__(self, path: str, sentence: str):
        self._path, self._sentence = path, sentence
        self._headers: dict[str, Header] = {}
        with reading(sentence):
            if os.path.exists(path) and not os.path.isfile(path):
                raise ValueError("it is a folder" if os.path.isdir(path) else "it is a pipe or a device")
            self._archive = zipfile.ZipFile(path)
            members = self._archive.infolist()
            if sum(member.compress_size for member in members) > os.path.getsize(path):
                raise ValueError("its arrays overlap")
        self.members = {member.filename.removesuffix(".npy"): member for member in members}

    def _array(self, name: str) -> np.ndarray:
        import numpy as np

        header = self._header(name)
        if header.size >= LARGE and header.dtype.kind != "U" and not self._is_packed(name):
            start = self._start(self.members[name]) + header.start
            return np.memmap(self._path, header.dtype, "r", start, header.shape, header.order)
        with self._open(name) as file:
            return np.lib.format.read_array(file, allow_pickle=False, max_header_size=MOST_HEADER)

    def _is_packed(self, name: str) -> bool:
        return self.members[name].compress_type != zipfile.ZIP_STORED

    def read(self, forms: Mapping[str, Form], sizes: Mapping[str, int] | None = None) -> dict[str, Any]:
        """Arrays by name; arrays of text as text or lists of text.

        All headers are checked, in the order of `forms`, before the first array is read; `sizes` are the named lengths
        that are known.
        """
        known = dict(sizes or {})
        with reading(self._sentence):
            for name, form in forms.items():
                self._check(name, form, known)
            packed = sum(self._header(name).size for name in forms if self._is_packed(name))
            refuse_beyond_memory(packed, ValueError, "what is compressed")
            arrays = {name: self._array(name) for name in forms}
            return {name: _text(x, name) if forms[name].kinds == "U" else x for name, x in arrays.items()}

    def _check(self, name: str, form: Form, sizes: dict[str, int]) -> None:
        """Refuse an array whose header does not match a form; new named lengths are added to `sizes`."""
        if name not in self.members:
            raise ValueError(f"it has no array {name}")
        header = self._header(name)
        fits = len(header.shape) == len(form.shape)
        named = zip(form.shape, header.shape, strict=fits)
        shape = tuple(sizes.setdefault(n, there) if isinstance(n, str) else n for n, there in named)
        if not fits or header.shape != shape or header.dtype.kind not in form.kinds:
            needed = ", ".join(str(sizes.get(n, n) if isinstance(n, str) else n) for n in form.shape)
            raise ValueError(
                f"{name} must be {KINDS[form.kinds]} in the shape ({needed}), but was {header.dtype} in {header.shape}"
            )

    def _open(self, name: str) -> IO[bytes]:
        member = self.members[name]
        if member.flag_bits & 1 or member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{name} must be stored or deflated, but was encrypted or compressed in another way")
        return self._archive.open(member)

    def _header(self, name: str) -> Header:
        """The header of an array, which must declare numbers or text that the file has."""
        from numpy.lib import format as npy

        if name in self._headers:
            return self._headers[name]
        member = self.members[name]
        with self._open(name) as file:
            try:
                readers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
                shape, is_fortran, dtype = readers[npy.read_magic(file)](file, max_header_size=MOST_HEADER)
            except Exception as error:  # Python's parser may raise anything
                raise ValueError(f"{name} must be an array of numbers or text, but was not: {error!s:.100}") from None
            header = Header(dtype, shape, "F" if is_fortran else "C", file.tell())
        if dtype.kind not in "biufU" or min(shape, default=0) < 0:
            raise ValueError(f"{name} must be an array of numbers or text, but was {dtype} in {shape}")
        there = member.file_size - header.start
        if there != header.size:
            raise ValueError(f"{name} must have {header.size} bytes of numbers, but has {there}")
        if dtype.kind == "U" and header.size > (LARGE if self._is_packed(name) else MOST_TEXT):
            raise ValueError(f"{name} must be shorter text, but would take {header.size} bytes")
        self._headers[name] = header
        return header

    def _start(self, member: zipfile.ZipInfo) -> int:
        """The place of a member's data in the archive."""
        with open(self._path, "rb") as file:
            file.seek(member.header_offset + LOCAL_HEADER - 4)
            lengths = struct.unpack("<HH", file.read(4))
        return member.header_offset + LOCAL_HEADER + sum(lengths)


def _text(array: np.ndarray, name: str) -> object:
    """An array of text as text or lists of text."""
    try:
        array.tobytes().decode("utf-32-be" if array.dtype.str.startswith(">") else "utf-32-le")
    except UnicodeDecodeError:
        raise ValueError(f"{name} must be text, but has numbers that are no letters") from None
    return array.tolist()


def read_json(text: str, form: object, name: str) -> Any:
    """The content of JSON text, checked against a form."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError(f"{name} must hold JSON, not too deeply nested, but did not") from None
    _check_json(value, form, name)
    return value


def _check_json(value: object, form: object, name: str) -> None:
    """Refuse a value that does not match a form."""
    if isinstance(form, tuple):
        for choice in form[:-1]:
            with suppress(ValueError):
                _check_json(value, choice, name)
                return
        _check_json(value, form[-1], name)
    elif isinstance(form, dict) and isinstance(value, dict):
        for key, inner in form.items():
            _check_json(value.get(key), inner, f"{name}.{key}")
    elif isinstance(form, list) and isinstance(value, list):
        for entry in value:
            _check_json(entry, form[0], f"an entry of {name}")
    else:
        kind = form if isinstance(form, type) else type(form)
        if not isinstance(value, kind) or (kind is bool) != isinstance(value, bool):
            was = shorten(json.dumps(value, ensure_ascii=False))
            raise ValueError(f"{name} must be {JSON_NAMES[kind]}, but was {was}")
