"""Text in and out: reading with a limit, and writing so that no half-written file is ever seen."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import IO, Any

from integrators.core.errors import IntegratorError, shorten

MAX_BYTES = 10_000_000


def read_text(source: str | os.PathLike[str] | IO[Any], most: int = MAX_BYTES) -> tuple[str, str]:
    """The text of a file, and its name for messages.

    Args:
        source: a path, or an open file of text or bytes.
        most: how many bytes it may have; of more nothing is read.

    Returns:
        The text and the name.

    Raises:
        IntegratorError: the file cannot be read, is too large, or is no UTF-8 text.
    """
    is_path = isinstance(source, str | os.PathLike)
    label = os.fspath(source) if is_path else str(getattr(source, "name", "input"))
    if not is_path and not hasattr(source, "read"):
        raise IntegratorError(f"source must be a path or an open file, but was {shorten(repr(source))}")
    try:
        with open(label, "rb") if is_path else nullcontext(source) as file:
            raw = file.read(most + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise IntegratorError(f"{shorten(label, 200)} must be a readable file, but was not: {reason}") from None
    if len(raw) > most:
        raise IntegratorError(f"{shorten(label, 200)} must have at most {most} bytes, but has more")
    text = _decode(raw, label) if isinstance(raw, bytes) else raw
    if "\0" in text:
        raise IntegratorError(f"{shorten(label, 200)} must be text, but was binary")
    return text, label


def read_lines(file: IO[Any], label: str) -> Iterator[str]:
    """The lines of a file that may be of any length, one by one.

    Args:
        file: the open file, of text or bytes.
        label: what messages call it.

    Raises:
        IntegratorError: a line is longer than `MAX_BYTES`.
        UnicodeDecodeError: it is no UTF-8 text.
    """
    while line := file.readline(MAX_BYTES + 1):
        if len(line) > MAX_BYTES:
            raise IntegratorError(f"{label} must have lines of at most {MAX_BYTES} bytes, but one has more")
        yield line.decode() if isinstance(line, bytes) else line


def _decode(raw: bytes, label: str) -> str:
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise IntegratorError(
            f"{shorten(label, 200)} must be UTF-8 text, but byte {error.start + 1} was 0x{raw[error.start]:02x}"
        ) from None


def atomic_write(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file so that it is either complete or as it was before, whatever interrupts.

    Args:
        path: the file.
        content: bytes, or text to be written as UTF-8.

    Raises:
        IntegratorError: the file cannot be written.
    """
    with replacing(path) as file:
        file.write(content if isinstance(content, bytes) else content.encode())


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[IO[bytes]]:
    """A new file beside another, which takes its name when all is written; links are followed, permissions kept.

    A pipe or a device has no content to protect, and is written to itself.

    Args:
        path: the file.

    Raises:
        IntegratorError: the file cannot be written.
    """
    name = check_path(path, "path")
    temporary = None
    try:
        target = os.path.realpath(name)
        if os.path.exists(target) and not os.path.isfile(target) and not os.path.isdir(target):
            with open(target, "wb") as device:
                yield device
            return
        if os.path.isfile(target) and not os.access(target, os.W_OK):
            raise PermissionError(13, "Permission denied")
        remove_unfinished(target)
        with _beside(target) as file:
            temporary = file.name
            yield file
            file.flush()
            os.fsync(file.fileno())
            if os.path.isfile(target):
                os.chmod(temporary, os.stat(target).st_mode & 0o7777)
            if os.name != "nt":  # while it is locked, so that nobody takes it for unfinished
                os.replace(temporary, target)
        if os.name == "nt":  # there an open file keeps its name
            os.replace(temporary, target)
    except IntegratorError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise IntegratorError(f"{shorten(name, 200)} must be a writable file, but was not: {reason}") from None
    finally:
        if temporary is not None:
            with suppress(FileNotFoundError):
                os.unlink(temporary)


def remove_unfinished(path: str) -> None:
    """Remove what processes that were killed have left of a file they were writing.

    Args:
        path: the file.
    """
    folder, start = _unfinished(path)
    with suppress(OSError):  # a folder that may not be listed
        for name in os.listdir(folder):
            if name.startswith(start) and name.endswith(".tmp"):
                with suppress(OSError), open(os.path.join(folder, name), "r+b") as file:
                    if lock(file):  # nobody is writing
                        os.unlink(file.name)


def _beside(target: str) -> IO[bytes]:
    """A new file beside a target, locked while it is open."""
    while True:
        file = open("".join([os.path.join(*_unfinished(target)), os.urandom(8).hex(), ".tmp"]), "xb")  # noqa: SIM115
        try:
            if lock(file) and os.path.exists(file.name):
                return file
        except OSError:  # a file system without locks, where nobody removes it
            return file
        file.close()  # another process has taken it for unfinished before it was locked


def _unfinished(path: str) -> tuple[str, str]:
    """The folder where a file is written, and how the names of files begin that will take its name."""
    folder, name = os.path.split(os.path.realpath(path))
    return folder, f".{zlib.crc32(os.fsencode(name)):08x}-"


def lock(file: IO[bytes]) -> bool:
    """Lock a file that is open for writing until it is closed or the process ends; False if another one has done so.

    Raises:
        OSError: The file system has no locks.
    """
    try:
        import fcntl
    except ImportError:  # not a POSIX system, where files that are open cannot be removed
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def check_path(path: Any, argument: str) -> str:
    """A path as text.

    Args:
        path: what a user gives.
        argument: what messages call it.

    Raises:
        IntegratorError: it is none.
    """
    if not isinstance(path, str | os.PathLike):
        raise IntegratorError(f"{argument} must be a path, but was {shorten(repr(path))}")
    name = os.fspath(path)
    if not isinstance(name, str) or not name or "\0" in name:
        raise IntegratorError(f"{argument} must be a path, but was {shorten(repr(name))}")
    return name
