"""Modules made from generated source, and kept on disk so that numba finds its machine code again.

numba keeps machine code beside the file that a function comes from, and asks that file whether it has changed. So the
source goes to ``<cache>/<key>.py``, where the key covers all that the machine code depends on: the text, the sources of
the helpers that it calls (numba does not notice edits of those) and the version of this package. The cache is

- the directory that the environment variable ``BSERIES_CACHE`` names, else
- the user's own: ``$XDG_CACHE_HOME/bseries-engine`` or ``~/.cache/bseries-engine``, ``~/Library/Caches/bseries-engine``
  on macOS, ``%LOCALAPPDATA%\\bseries-engine`` on Windows; or, where that cannot be written,
- a temporary directory that goes when the process ends.

It may be deleted at any time; what is needed is made again. Nothing else removes old files from it.
Modules without machine code to keep need no file: they go when nothing uses them any more.
"""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from collections.abc import Sequence
from functools import cache
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from weakref import WeakValueDictionary

from .errors import IntegratorError
from .text_files import atomic_write

PACKAGE = "bseries-engine"
_LOCK = threading.RLock()
_PASSING: WeakValueDictionary[str, ModuleType] = WeakValueDictionary()


def load_module(
    source: str, *, helpers: Sequence[ModuleType | str | os.PathLike[str]] = (), keep: bool = True
) -> ModuleType:
    """The module with this source; the same source gives the same module.

    Args:
        source: The text of the module.
        helpers: Modules that it imports, or their files, whose edits must not go unnoticed.
        keep: Whether the module gets a file, so that functions in it may be compiled with ``cache=True``, and stays
            for as long as the process.

    Returns:
        The module, executed once: in this process, or, if it is not kept, for as long as anything holds it.

    Raises:
        IntegratorError: There is no directory to write to, not even a temporary one.

    Example:
        >>> module = load_module("def twice(x):\\n    return 2*x\\n")
        >>> module.twice(21)
        42
        >>> load_module("def twice(x):\\n    return 2*x\\n") is module
        True
    """
    data = source.encode()
    key = _key(data, [Path(getattr(helper, "__file__", None) or helper) for helper in helpers])  # type: ignore[arg-type]
    name = f"bseries_generated_{key}"
    with _LOCK:
        module = (sys.modules if keep else _PASSING).get(name)
        if module is None:
            module = _kept(name, _stored(f"{key}.py", data), data) if keep else _passing(name, data)
        return module


def cache_directory() -> Path:
    """Where generated modules are kept, if it can be written.

    Returns:
        The directory; it need not exist.
    """
    chosen = os.environ.get("BSERIES_CACHE")
    if chosen:
        return Path(chosen).expanduser().absolute()
    if sys.platform == "win32":
        parent = os.environ.get("LOCALAPPDATA") or "~/AppData/Local"
    elif sys.platform == "darwin":
        parent = "~/Library/Caches"
    else:
        parent = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(parent).expanduser().absolute() / PACKAGE


def _key(data: bytes, helpers: Sequence[Path]) -> str:
    texts = [package_version().encode(), *(path.read_bytes() for path in helpers), data]
    return hashlib.sha256(b"".join(hashlib.sha256(text).digest() for text in texts)).hexdigest()


@cache
def package_version() -> str:
    """The version of this package, empty where it is not installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(PACKAGE)
    except PackageNotFoundError:  # a checkout that is not installed
        return ""


def _stored(name: str, data: bytes) -> Path:
    """The path of a file with this name and content, written unless it is there."""
    for place in (cache_directory, _temporary_directory):
        try:
            directory = place()
            directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            _check_writable(directory / "__pycache__")
            path = directory / name
            if not path.is_file() or path.read_bytes() != data:
                atomic_write(path, data)
        except (OSError, RuntimeError, IntegratorError):  # Path.expanduser: there is no home
            continue
        return path
    chosen = os.environ.get("BSERIES_CACHE")
    raise IntegratorError(f"BSERIES_CACHE must be a directory that can be written, but was {chosen!r}")


def _check_writable(directory: Path) -> None:
    """Raise OSError unless numba will be able to write here: it refuses to compile where it cannot."""
    import tempfile

    directory.mkdir(exist_ok=True)
    tempfile.TemporaryFile(dir=directory).close()


@cache
def _temporary_directory() -> Path:
    """A directory that lives as long as the process."""
    import atexit
    import shutil
    import tempfile

    directory = tempfile.mkdtemp(prefix=f"{PACKAGE}-")
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    return Path(directory)


class _Loader(SourceFileLoader):
    """Executes the text in memory: neither a file nor Python's own bytecode beside it can have been changed.

    Tracebacks ask the loader for the text, too, where there is no file.
    """

    def __init__(self, name: str, path: Path, data: bytes):
        super().__init__(name, str(path))
        self._source = data

    def get_data(self, path: str) -> bytes:
        return self._source

    def path_stats(self, path: str) -> dict[str, float]:
        raise OSError  # no bytecode: nothing is read or written under __pycache__


def _kept(name: str, path: Path, data: bytes) -> ModuleType:
    """The module of a file; numba needs to find it in `sys.modules` while it runs."""
    loader = _Loader(name, path, data)
    spec = spec_from_file_location(name, path, loader=loader)
    assert spec is not None
    module = sys.modules[name] = module_from_spec(spec)
    try:
        loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _passing(name: str, data: bytes) -> ModuleType:
    """A module without a file, which nothing but its users holds."""
    loader = _Loader(name, Path(f"{name}.py"), data)
    module = module_from_spec(ModuleSpec(name, loader))
    loader.exec_module(module)
    _PASSING[name] = module
    return module
