"""Text files: reading with a size limit, atomic writing, JSON and TOML with exact numbers."""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from decimal import Decimal, InvalidOperation
from typing import IO, Any, NoReturn

from bseries_base.errors import shorten, shown, suggestion
from bseries_base.interrupts import uninterrupted
from integrators.core.errors import IntegratorError

MAX_BYTES = 10_000_000
FORMATS = ("json", "toml")
LARGEST_NUMBER = 2**53
"""Larger integers are written as text, since other readers may convert numbers to doubles."""
MOST_DIGITS = 4300
"""Of an integer; Python's conversion takes quadratic time."""
MOST_PARTS = 100
"""Of a dotted key; the parser takes quadratic memory."""
MOST_NAMES = 100_000
"""Parts of all keys and headers; the parser takes a kilobyte for each."""
PART = r"""(?:[\w-]++|"(?:[^"\\\n]++|\\[^\n])*+"?|'[^'\n]*+'?)"""
TOKEN = (
    r'''"""(?:[^"\\]++|\\.|"{1,2}+(?!"))*+(?:"{3,5}|\Z)|[']{3}.*?(?:[']{3,5}|\Z)|#[^\n]*+'''
    rf"|(?P<key>{PART}(?:[ \t]*+\.[ \t]*+{PART})*+)(?P<named>[ \t]*+[=\]])?+"
)
"""Multi-line strings, comments, and anything that may be a key; what names something ends at = or ]."""


def read_text(source: str | os.PathLike[str] | IO[str] | IO[bytes], most: int = MAX_BYTES) -> tuple[str, str]:
    """The text of a path or open file of at most `most` bytes, and its name for messages."""
    is_path = isinstance(source, str | os.PathLike)
    label = os.fspath(source) if is_path else str(getattr(source, "name", "input"))
    if not is_path and not hasattr(source, "read"):
        raise IntegratorError(f"source must be a path or an open file, but was {shown(source)}")
    try:
        with open(label, "rb") if is_path else nullcontext(source) as file:
            raw = file.read(most + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise IntegratorError(f"{shorten(label, 200)} must be a readable file, but was not: {reason}") from None
    if len(raw) > most:
        raise IntegratorError(f"{shorten(label, 200)} must have at most {most} bytes, but has more")
    try:
        text = raw.decode("utf-8-sig") if isinstance(raw, bytes) else raw
    except UnicodeDecodeError as error:
        raise IntegratorError(
            f"{shorten(label, 200)} must be UTF-8 text, but byte {error.start + 1} was 0x{raw[error.start]:02x}"
        ) from None
    if "\0" in text:
        raise IntegratorError(f"{shorten(label, 200)} must be text, but was binary")
    return text, label


@contextmanager
def errors_from(source: str) -> Iterator[None]:
    """Prefix the message of every error with its source: a file, or a place in it."""
    try:
        yield
    except RecursionError:
        raise IntegratorError(f"{shorten(source, 200)}: nesting must be flat, but was too deep") from None
    except IntegratorError as error:
        raise IntegratorError(f"{shorten(source, 200)}: {error}") from None


def read_lines(file: IO[str] | IO[bytes], label: str) -> Iterator[str]:
    """The lines of an open file of text or bytes, of any total length."""
    while line := file.readline(MAX_BYTES + 1):
        if len(line) > MAX_BYTES:
            raise IntegratorError(f"{label} must have lines of at most {MAX_BYTES} bytes, but one has more")
        yield line.decode() if isinstance(line, bytes) else line


def atomic_write(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file atomically: after an interruption it is complete or unchanged."""
    with replacing(path) as file:
        file.write(content if isinstance(content, bytes) else content.encode())


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[IO[bytes]]:
    """Temporary file that replaces another when complete; links are followed, permissions kept.

    A pipe or a device is written directly.
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
        with ExitStack() as opened:
            with uninterrupted():
                file = opened.enter_context(_temporary_file(target))
                temporary = file.name
            yield file
            file.flush()
            os.fsync(file.fileno())
            if os.path.isfile(target):
                os.chmod(temporary, os.stat(target).st_mode & 0o7777)
            if os.name != "nt":  # while locked, so that `remove_unfinished` spares it
                os.replace(temporary, target)
        if os.name == "nt":  # Windows cannot rename an open file
            os.replace(temporary, target)
    except IntegratorError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise IntegratorError(f"{shorten(name, 200)} must be a writable file, but was not: {reason}") from None
    finally:
        if temporary is not None:
            with uninterrupted(), suppress(FileNotFoundError):
                os.unlink(temporary)


def remove_unfinished(path: str) -> None:
    """Remove temporary files of a file left by killed processes."""
    folder, start = _unfinished(path)
    with suppress(OSError):  # the folder is not readable
        for name in os.listdir(folder):
            if name.startswith(start) and name.endswith(".tmp"):
                with suppress(OSError), open(os.path.join(folder, name), "r+b") as file:
                    if lock(file):  # no process is writing it
                        os.unlink(file.name)


def _temporary_file(target: str) -> IO[bytes]:
    """A new temporary file in the folder of the target, locked while open."""
    while True:
        file = open("".join([os.path.join(*_unfinished(target)), os.urandom(8).hex(), ".tmp"]), "xb")  # noqa: SIM115
        try:
            if lock(file) and os.path.exists(file.name):
                return file
        except OSError:  # a file system without locks, where `remove_unfinished` removes nothing
            return file
        file.close()  # another process removed it before it was locked


def _unfinished(path: str) -> tuple[str, str]:
    """The folder of a file, and the prefix of its temporary files."""
    folder, name = os.path.split(os.path.realpath(path))
    return folder, f".{zlib.crc32(os.fsencode(name)):08x}-"


def lock(file: IO[bytes]) -> bool:
    """Lock a file open for writing until it is closed or the process ends; False if another process holds the lock."""
    try:
        import fcntl
    except ImportError:  # not POSIX: open files cannot be removed there
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def check_path(path: object, argument: str) -> str:
    """A path as text."""
    if not isinstance(path, str | os.PathLike):
        raise IntegratorError(f"{argument} must be a path, but was {shown(path)}")
    name = os.fspath(path)
    if not isinstance(name, str) or not name or "\0" in name:
        raise IntegratorError(f"{argument} must be a path, but was {shown(name)}")
    return name


def parse_json(text: str) -> Any:
    """The content of JSON text, decimals as `Decimal`; repeated keys, NaN and infinity are refused."""
    import json

    try:
        return json.loads(
            text, parse_int=_integer, parse_float=Decimal, parse_constant=_refuse, object_pairs_hook=_unique
        )
    except IntegratorError:
        raise
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise IntegratorError(f"content must be JSON, but was not at {where}: {error.msg}") from None
    except ValueError as error:
        raise IntegratorError(f"content must be JSON of reasonable size, but was not: {error}") from None
    except InvalidOperation:
        raise IntegratorError("numbers must have exponents of reasonable size, but one had not") from None


def _integer(text: str) -> int:
    if len(text) > MOST_DIGITS:
        raise ValueError(f"an integer has {len(text)} digits")
    return int(text)


def _refuse(name: str) -> NoReturn:
    raise IntegratorError(f"numbers must be finite, but one was {name}")


def _unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    found: dict[str, object] = {}
    for key, value in pairs:
        if key in found:
            raise IntegratorError(f"keys must be unique, but {shorten(key)!r} was repeated")
        found[key] = value
    return found


def parse_toml(text: str) -> Any:
    """The content of TOML text, decimals as `Decimal`."""
    import tomllib

    if re.search(rf"(?<!\w)[\d_]{{{MOST_DIGITS + 1}}}", text):
        raise IntegratorError(f"numbers must have at most {MOST_DIGITS} digits in a row, but one has more")
    total = 0
    for token in re.finditer(TOKEN, text, re.DOTALL):
        parts = len(re.findall(PART, token["key"] or ""))
        total += parts if token["named"] else 0
        if parts > MOST_PARTS:
            raise IntegratorError(f"content must have keys of at most {MOST_PARTS} parts, but one has more")
        if total > MOST_NAMES:
            raise IntegratorError(f"content must have at most {MOST_NAMES} parts in all keys, but has more")
    try:
        return tomllib.loads(text, parse_float=Decimal)
    except ValueError as error:
        raise IntegratorError(f"content must be TOML, but was not: {error}") from None
    except InvalidOperation:
        raise IntegratorError("numbers must have exponents of reasonable size, but one had not") from None


def check_keys(data: object, known: Iterable[str], argument: str) -> None:
    """Refuse data that is not a table or has unknown keys; the message suggests a similar known key."""
    if not isinstance(data, dict):
        raise IntegratorError(f"{argument} must be a table of keys and values, but was {shown(data)}")
    for key in data:
        if key not in known:
            near = suggestion(key, known)
            raise IntegratorError(
                f"{argument} must have the keys {', '.join(known)} only, but had {shorten(key)!r}{near}"
            )


def json_text(value: object, indent: str = "") -> str:
    """JSON with one key, or one row of a matrix, per line."""
    import json

    deeper = indent + "  "
    if isinstance(value, Mapping):
        lines = [f"{deeper}{json.dumps(k, ensure_ascii=False)}: {json_text(v, deeper)}" for k, v in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list) and value and isinstance(value[0], list):
        return "[\n" + ",\n".join(deeper + json_text(row) for row in value) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
