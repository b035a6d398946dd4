"""Forks that wait: a child has the locks that other threads hold, but not the threads, which release them.

Its first import or compilation would wait for ever for one that another thread had begun. So a fork waits until these
are at an end.
"""

from __future__ import annotations

import concurrent.futures.thread  # noqa: F401  # with `logging`: their own handlers of forks come before those below
import logging  # noqa: F401
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, suppress
from functools import cached_property
from importlib import import_module
from types import ModuleType

OWN = frozenset({"bseries", "bseries_base", "integrators", "trees"})
PACKAGES = OWN | {"llvmlite", "mpmath", "numba", "numpy", "sympy"}
"""Packages whose import is waited for: those that first uses import."""
MODULES = threading.RLock()
"""Held while generated modules are executed; taken before numba's lock."""
SYNTAX = threading.RLock()
"""Held while syntax trees are made; taken after numba's lock."""
_held: list[ExitStack] = []


def _loaded(packages: frozenset[str]) -> Iterator[tuple[str, ModuleType]]:
    """The modules of some packages, with those that are being imported."""
    for name, module in [*sys.modules.items()]:
        if module is not None and name.partition(".")[0] in packages:
            yield name, module


def _imports() -> set[str]:
    """The modules that are being imported."""
    return {x for x, module in _loaded(PACKAGES) if getattr(getattr(module, "__spec__", None), "_initializing", False)}


def _wait() -> None:
    """Wait for imports and compilations in other threads, and take the locks, so that no more begin."""
    own = set[str]()  # what this thread itself is importing does not end
    while True:
        for name in _imports() - own:
            with suppress(ImportError):
                import_module(name)
            own.add(name)
        with ExitStack() as locks:
            for lock in _locks():
                locks.enter_context(lock)
            if _imports() <= own:
                _held.append(locks.pop_all())
                return


def _locks() -> Iterator[AbstractContextManager[object]]:
    """The locks, in the order in which other threads take them."""
    yield MODULES
    if "numba.core.compiler_lock" in sys.modules:
        yield import_module("numba.core.compiler_lock").global_compiler_lock
    yield SYNTAX
    if "llvmlite.binding.ffi" in sys.modules:
        yield import_module("llvmlite.binding.ffi").lib._lock


def _go_on() -> None:
    """Give the locks back."""
    _held.pop().close()


def _begin() -> None:
    """Give the locks back in the child; in Python 3.11 cached properties have locks, too, which are made anew."""
    _go_on()
    for _, module in _loaded(OWN):
        for kind in [value for value in vars(module).values() if isinstance(value, type)]:
            for value in vars(kind).values():
                if isinstance(value, cached_property) and hasattr(value, "lock"):
                    value.lock = threading.RLock()  # type: ignore[attr-defined]


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_wait, after_in_parent=_go_on, after_in_child=_begin)
