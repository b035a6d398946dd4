"""Text in and out: reading with a limit, and writing so that no half-written file is ever seen."""

from __future__ import annotations

import os
from contextlib import nullcontext
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

    The content goes to a new file beside it, which then takes its name; links are followed, permissions kept.

    Args:
        path: the file.
        content: bytes, or text to be written as UTF-8.

    Raises:
        IntegratorError: the file cannot be written.
    """
    name = os.fspath(path)
    temporary = None
    try:
        data = content if isinstance(content, bytes) else content.encode()
        target = os.path.realpath(name)
        if os.path.exists(target) and not os.path.isfile(target) and not os.path.isdir(target):
            with open(target, "wb") as device:  # a pipe or a device has no content to protect
                device.write(data)
            return
        if os.path.isfile(target) and not os.access(target, os.W_OK):
            raise PermissionError(13, "Permission denied")
        temporary = os.path.join(os.path.dirname(target), f".{os.urandom(8).hex()}.tmp")
        with open(temporary, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if os.path.isfile(target):
            os.chmod(temporary, os.stat(target).st_mode & 0o7777)
        os.replace(temporary, target)
    except (OSError, ValueError) as error:
        _remove(temporary)
        reason = getattr(error, "strerror", None) or str(error)
        raise IntegratorError(f"{shorten(name, 200)} must be a writable file, but was not: {reason}") from None
    except BaseException:
        _remove(temporary)
        raise


def _remove(path: str | None) -> None:
    if path is not None and os.path.lexists(path):
        os.unlink(path)
