"""Modules made from generated source, in memory.

The name of a module is a key that covers all that machine code depends on: the text, the sources of the helpers that it
calls (numba does not notice edits of those) and the version of this package; `foundation.machine_code` keeps the code
of its functions under it. Modules without machine code to keep go when nothing uses them any more.
"""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from collections.abc import Sequence
from importlib.abc import SourceLoader
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType
from weakref import WeakValueDictionary

from foundation.machine_code import package_version

_LOCK = threading.RLock()
_PASSING: WeakValueDictionary[str, ModuleType] = WeakValueDictionary()


def load_module(
    source: str, *, helpers: Sequence[ModuleType | str | os.PathLike[str]] = (), keep: bool = True
) -> ModuleType:
    """The module with this source; the same source gives the same module.

    Args:
        source: The text of the module.
        helpers: Modules that it imports, or their files, whose edits must not go unnoticed.
        keep: Whether the module stays for as long as the process, as machine code that is kept on disk needs it to.

    Returns:
        The module, executed once: in this process, or, if it is not kept, for as long as anything holds it.

    Example:
        >>> module = load_module("def twice(x):\\n    return 2*x\\n")
        >>> module.twice(21)
        42
        >>> load_module("def twice(x):\\n    return 2*x\\n") is module
        True
    """
    data = source.encode()
    name = f"bseries_generated_{_key(data, [Path(getattr(helper, '__file__', None) or helper) for helper in helpers])}"  # type: ignore[arg-type]
    modules = sys.modules if keep else _PASSING
    with _LOCK:
        module = modules.get(name)
        if module is None:
            loader = _Loader(data)
            module = modules[name] = module_from_spec(ModuleSpec(name, loader))
            try:
                loader.exec_module(module)
            except BaseException:
                del modules[name]
                raise
        return module


def _key(data: bytes, helpers: Sequence[Path]) -> str:
    texts = [package_version().encode(), *(path.read_bytes() for path in helpers), data]
    return hashlib.sha256(b"".join(hashlib.sha256(text).digest() for text in texts)).hexdigest()


class _Loader(SourceLoader):
    """Executes a text in memory; tracebacks ask it for the text, and so does `foundation.machine_code`."""

    def __init__(self, data: bytes):
        self._source = data

    def get_filename(self, fullname: str) -> str:
        return f"{fullname}.py"

    def get_data(self, path: str) -> bytes:
        return self._source
