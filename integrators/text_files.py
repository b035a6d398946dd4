"""Text in and out: reading with a limit, and writing so that no half-written file is ever seen."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

from .errors import IntegratorError
from .expressions import shorten

if TYPE_CHECKING:
    from typing import IO

MAX_BYTES = 10_000_000


def read_text(source: str | os.PathLike[str] | IO[Any]) -> tuple[str, str]:
    """The text of a file, and its name for messages.

    Args:
        source: a path, or an open file of text or bytes.

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
            raw = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise IntegratorError(f"{shorten(label, 200)} must be a readable file, but was not: {reason}") from None
    if len(raw) > MAX_BYTES:
        raise IntegratorError(f"{shorten(label, 200)} must have at most {MAX_BYTES} bytes, but has more")
    text = _decode(raw, label) if isinstance(raw, bytes) else raw
    if "\0" in text:
        raise IntegratorError(f"{shorten(label, 200)} must be text, but was binary")
    return text, label


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
        temporary = os.path.join(os.path.dirname(target), f".{os.urandom(8).hex()}.tmp")
        with open(temporary, "xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        if os.path.isfile(target):
            os.chmod(temporary, os.stat(target).st_mode & 0o7777)
        os.replace(temporary, target)
    except IntegratorError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise IntegratorError(f"{shorten(name, 200)} must be a writable file, but was not: {reason}") from None
    finally:
        if temporary is not None and os.path.lexists(temporary):
            os.unlink(temporary)


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
