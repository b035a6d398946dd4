"""Arrays in NPZ archives and folders of NPY files: headers are checked before data is read.

A reader specifies the arrays by `Form`s. Headers give kinds, shapes and sizes, so a wrong file is refused at once.
Compressed arrays can be much larger than their file: beyond `LARGE` bytes they are unpacked to disk.
"""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import stat
import struct
import sys
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from integrators.core.errors import IntegratorError, shorten

if TYPE_CHECKING:
    import numpy as np

LARGE = 2**26
"""Bytes from which an array is memory-mapped, and the limit of bytes unpacked in memory per file."""
MOST_TEXT = 2**30
"""Bytes of an array of text."""
MOST_HEADER = 10_000
MOST_DIMENSIONS = 32
LOCAL_HEADER = 30
CHUNK = 2**20
DESCRIPTION = re.compile(
    r"(?=.*'descr': *'([<>|=]?[biufU]\d{1,9})')(?=.*'fortran_order': *(True|False))(?=.*'shape': *\(([\d, ]*)\))"
)
"""The three entries of a header, in any order."""
KINDS = {"f": "doubles", "i": "whole numbers", "iu": "whole numbers", "fiu": "real numbers", "b": "flags", "U": "text"}
JSON_NAMES = {
    dict: "a table", list: "a list", str: "text", int: "a whole number", float: "a number", bool: "true or false",
    type(None): "null",
}  # fmt: skip
FINITE = -sys.float_info.max, sys.float_info.max
DAMAGE = (
    OSError, ValueError, EOFError, OverflowError, MemoryError, RecursionError, NotImplementedError,
    zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip
"""Errors that reading a damaged file may raise."""


class Form(NamedTuple):
    """Specification of a stored array.

    Attributes:
        kinds: The allowed kinds of numbers, as NumPy's letters.
        shape: The lengths; equal names mean equal lengths.
        limits: The least and the largest number; None if unchecked, as for arrays too large to be scanned.
    """

    kinds: str
    shape: tuple[int | str, ...] = ()
    limits: tuple[float, float] | None = FINITE


TEXT = Form("U", limits=None)


class Header(NamedTuple):
    """The header of a stored array.

    Attributes:
        dtype: The type of its numbers.
        shape: Its lengths.
        order: The memory layout, C or F.
        start: The offset of the numbers in bytes.
    """

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    order: Any
    start: int

    @property
    def size(self) -> int:
        """The size of the numbers in bytes."""
        return math.prod(self.shape) * self.dtype.itemsize


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


class StoredArrays(Mapping[str, "np.ndarray"]):
    """The arrays of an NPZ file, or of the NPY files in a folder, by name, each read on access.

    Args:
        path: The file or folder.
        sentence: The beginning of error messages, which says what it must be.

    Raises:
        IntegratorError: It cannot be read; all methods raise it, too.
    """

    def __init__(self, path: str, sentence: str):
        self._path, self._sentence, self._unpack_limit = path, sentence, LARGE
        self._archive: zipfile.ZipFile | None = None
        self._headers: dict[str, Header] = {}
        with reading(sentence):
            if os.path.isdir(path):
                files = [name for name in sorted(os.listdir(path)) if name.endswith(".npy")]
            elif stat.S_ISREG(os.stat(path).st_mode):
                self._archive = zipfile.ZipFile(path)
                members = self._archive.infolist()
                files = [member.filename for member in members]
                if sum(member.compress_size for member in members) > os.path.getsize(path):
                    raise ValueError("its arrays overlap")
            else:
                raise ValueError("it is a pipe or a device")
        self._files = {name.removesuffix(".npy"): name for name in files}

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)

    def __contains__(self, name: object) -> bool:
        return name in self._files

    def __getitem__(self, name: str) -> np.ndarray:
        file = self._files[name]
        with reading(self._sentence):
            return self._load(name, file)

    def read(self, forms: Mapping[str, Form], sizes: Mapping[str, int] | None = None) -> dict[str, Any]:
        """Arrays by name; arrays of text as text or lists of text.

        Args:
            forms: Their specifications. All headers are checked, in this order, before the first array is read.
            sizes: Known values of named lengths.
        """
        known = dict(sizes or {})
        with reading(self._sentence):
            for name, form in forms.items():
                self._check(name, form, known)
        return {name: self._value(name, form) for name, form in forms.items()}

    def _check(self, name: str, form: Form, sizes: dict[str, int]) -> None:
        """Refuse an array whose header does not match a form; new named lengths are added to `sizes`."""
        if name not in self:
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

    def _value(self, name: str, form: Form) -> Any:
        """An array, its numbers checked against the limits of a form."""
        array = self[name]
        with reading(self._sentence):
            if form.kinds == "U":
                code = "utf-32-be" if array.dtype.str.startswith(">") else "utf-32-le"
                try:
                    array.tobytes().decode(code)
                except UnicodeDecodeError:
                    raise ValueError(f"{name} must be text, but has numbers that are no letters") from None
                return array.tolist()
            if form.limits is not None:
                least, most = form.limits
                if not ((array >= least) & (array <= most)).all():
                    raise ValueError(f"{name} must be from {least:g} to {most:g}, but was not")
        return array

    @contextmanager
    def _open(self, name: str) -> Iterator[tuple[IO[bytes], int, bool]]:
        """The file of an array, its size in bytes, and whether it is compressed."""
        file = self._files[name]
        if self._archive is None:
            with open(os.path.join(self._path, file), "rb") as plain:
                yield plain, os.fstat(plain.fileno()).st_size, False
            return
        member = self._archive.getinfo(file)
        if member.flag_bits & 1 or member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{name} must be stored or deflated, but was encrypted or compressed in another way")
        with self._archive.open(member) as packed:
            yield packed, member.file_size, member.compress_type != zipfile.ZIP_STORED

    def _header(self, name: str) -> Header:
        """The header of an array."""
        if name not in self._headers:
            with self._open(name) as (file, size, is_packed):
                header = read_header(file, name)
            there = size - header.start  # in a folder, files may grow
            if there < header.size or (there > header.size and self._archive is not None):
                raise ValueError(f"{name} must have {header.size} bytes of numbers, but has {there}")
            if header.dtype.kind == "U" and header.size > (self._unpack_limit if is_packed else MOST_TEXT):
                raise ValueError(f"{name} must be shorter text, but would take {header.size} bytes")
            self._headers[name] = header
        return self._headers[name]

    def _load(self, name: str, file_name: str) -> np.ndarray:
        """An array: read, or memory-mapped if large, after unpacking to disk if compressed."""
        import numpy as np

        header = self._header(name)
        dtype, shape, order = header.dtype, header.shape, header.order
        if not header.size:
            return np.zeros(shape, dtype, order)
        with self._open(name) as (file, _, is_packed):
            if (header.size < LARGE and (not is_packed or header.size <= self._unpack_limit)) or dtype.kind == "U":
                self._unpack_limit -= header.size if is_packed else 0
                file.read(header.start)
                return np.frombuffer(_exactly(file, header.size, name), dtype).reshape(shape, order=order)
            if is_packed:
                return _unpacked(file, header, name)
        path, offset = self._path, header.start
        if self._archive is None:
            path = os.path.join(path, file_name)
        else:
            offset += _offset(path, self._archive.getinfo(file_name))
        return np.memmap(path, dtype=dtype, mode="r", offset=offset, shape=shape, order=order)


def read_header(file: IO[bytes], name: str) -> Header:
    """The header of an NPY file, which is read from its beginning.

    Raises:
        ValueError: The file does not declare an array of numbers or text; the message calls it `name`.
    """
    import numpy as np

    magic = file.read(8)
    width = 2 if magic[6:7] == b"\x01" else 4
    length = int.from_bytes(file.read(width), "little")
    if magic[:6] != b"\x93NUMPY" or length > MOST_HEADER:
        raise ValueError(f"{name} must be an array of NumPy, but was not")
    text = file.read(length).decode("latin-1")
    found = DESCRIPTION.match(text)
    if found is None:
        raise ValueError(f"{name} must be an array of numbers or text, but was {text.strip()!r:.60}")
    kind, is_fortran, lengths = found.groups()
    shape = tuple(map(int, re.findall(r"\d+", lengths)))
    try:
        dtype = np.dtype(kind)
    except TypeError:
        raise ValueError(f"{name} must be an array of numbers or text, but was of the kind {kind}") from None
    if len(shape) > MOST_DIMENSIONS or math.prod(max(n, 1) for n in shape) * dtype.itemsize >= 2**62:
        raise ValueError(f"{name} must be an array that fits an address space, but has the shape ({lengths:.60})")
    return Header(dtype, shape, "F" if is_fortran == "True" else "C", 8 + width + length)


def _exactly(file: IO[bytes], size: int, name: str) -> bytearray:
    """The next `size` bytes of a file."""
    data = bytearray(size)
    rest = memoryview(data)
    while rest:
        count = file.readinto(rest[:CHUNK])  # type: ignore[attr-defined]
        if not count:
            raise ValueError(f"{name} must have {size} bytes of numbers, but has fewer")
        rest = rest[count:]
    return data


def _unpacked(packed: IO[bytes], header: Header, name: str) -> np.ndarray:
    """A compressed array, unpacked to an unnamed file and memory-mapped."""
    from tempfile import TemporaryFile, gettempdir

    import numpy as np

    free = shutil.disk_usage(gettempdir()).free
    if header.start + header.size > free:
        raise ValueError(f"{name} would take {header.size / 1e9:.1f} GB of disk, but {free / 1e9:.1f} GB are free")
    with TemporaryFile() as file:
        shutil.copyfileobj(packed, file)
        file.flush()
        return np.memmap(
            file, dtype=header.dtype, mode="r", offset=header.start, shape=header.shape, order=header.order
        )


def _offset(path: str, member: zipfile.ZipInfo) -> int:
    """The offset of a member's data in an archive."""
    with open(path, "rb") as file:
        file.seek(member.header_offset + LOCAL_HEADER - 4)
        lengths = struct.unpack("<HH", file.read(4))
    return member.header_offset + LOCAL_HEADER + sum(lengths)


def read_json(text: str, form: Any, name: str) -> Any:
    """The content of JSON text, checked against a form.

    Args:
        text: The text.
        form: A type; None; a dictionary of forms for the keys that matter, where a missing one is None; a list of one
            form for all entries; or a tuple of forms of which one must fit.
        name: Its name in messages.

    Raises:
        ValueError: It is no JSON, is nested too deeply, or does not match the form.

    Example:
        >>> read_json('{"names": ["p", "q"], "h": null}', {"names": [str], "h": (None, float)}, "head")
        {'names': ['p', 'q'], 'h': None}
    """
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError(f"{name} must hold JSON, not too deeply nested, but did not") from None
    reason = _misfit(value, form, name)
    if reason is not None:
        raise ValueError(reason)
    return value


def _misfit(value: Any, form: Any, name: str) -> str | None:
    """Why a value does not match a form; None if it does."""
    found: Iterator[str | None]
    if isinstance(form, tuple):
        reasons = [_misfit(value, choice, name) for choice in form]
        return None if None in reasons else reasons[-1]
    if isinstance(form, dict) and isinstance(value, dict):
        found = (_misfit(value.get(key), inner, f"{name}.{key}") for key, inner in form.items())
        return next(filter(None, found), None)
    if isinstance(form, list) and isinstance(value, list):
        found = (_misfit(entry, form[0], f"an entry of {name}") for entry in value)
        return next(filter(None, found), None)
    kind = form if isinstance(form, type) else type(form)
    if isinstance(value, kind) and (kind is bool) == isinstance(value, bool):
        return None
    return f"{name} must be {JSON_NAMES[kind]}, but was {shorten(json.dumps(value, ensure_ascii=False))}"
