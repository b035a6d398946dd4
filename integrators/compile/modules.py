"""Modules in memory from generated source.

The name of a module contains a hash of everything its machine code depends on: the text, the sources of imported
helpers (whose edits numba does not notice) and the version of this package. `bseries_base.machine_code` caches the code
of its functions under this name.
"""

from __future__ import annotations

import linecache
import os
import sys
from collections.abc import Sequence
from hashlib import sha256
from importlib.abc import SourceLoader
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType
from typing import Any
from weakref import WeakValueDictionary, finalize

from bseries_base.forks import MODULES
from bseries_base.machine_code import package_version

_PASSING: WeakValueDictionary[str, ModuleType] = WeakValueDictionary()


def load_module(
    source: str, *, helpers: Sequence[ModuleType | str | os.PathLike[str]] = (), keep: bool = True
) -> ModuleType:
    """Load generated source as a module; the same source gives the same module.

    Example:
        >>> module = load_module("def twice(x):\\n    return 2*x\\n")
        >>> module.twice(21)
        42
        >>> load_module("def twice(x):\\n    return 2*x\\n") is module
        True
    """
    name, modules = module_name(source, helpers), sys.modules if keep else _PASSING
    with MODULES:
        module = modules.get(name)
        if module is None:
            loader = _Loader(source.encode())
            module = modules[name] = module_from_spec(ModuleSpec(name, loader))
            try:
                loader.exec_module(module)
            except BaseException:
                del modules[name]
                raise
            if not keep:
                finalize(module, linecache.cache.pop, loader.get_filename(name), None)
        return module


def module_name(source: str, helpers: Sequence[ModuleType | str | os.PathLike[str]] = ()) -> str:
    """The name of the module of a source, and of everything its machine code depends on."""
    paths: list[Any] = [getattr(helper, "__file__", None) or helper for helper in helpers]
    texts = [package_version().encode(), *(Path(path).read_bytes() for path in paths), source.encode()]
    return f"bseries_generated_{sha256(b''.join(sha256(text).digest() for text in texts)).hexdigest()}"


class _Loader(SourceLoader):
    """Executes source in memory, and returns it to tracebacks and `bseries_base.machine_code`."""

    def __init__(self, data: bytes):
        self._source = data

    def get_filename(self, fullname: str) -> str:
        return f"{fullname}.py"

    def get_data(self, path: str) -> bytes:
        return self._source
