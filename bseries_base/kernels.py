"""Kernels: functions that run in the interpreter or compiled by numba.

Importing numba takes a quarter of a second, and so does the first compiled call; the interpreter makes a table of a few
hundred trees in a millisecond. So kernels are compiled on demand.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterable
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bseries_base.machine_code import Compiled, has_numba

if TYPE_CHECKING:
    from ctypes import _CFunctionType

    from numba.core.ccallback import CFunc
    from numba.core.typing.templates import Signature


class Kernel:
    """A pure function of arrays with two implementations: ``py_func`` (any sequences and numbers) and ``compiled``.

    Kernels call other kernels by name, each implementation those of its kind. Callees must be in the same file, since
    the cache on disk detects edits of that file only; modules whose constants enter the machine code, or their files,
    are named as `sources` (see `bseries_base.machine_code`).
    """

    def __init__(self, function: Compiled, *, sources: Iterable[types.ModuleType | Path] = (), **options: object):
        self._options = options
        self._sources = tuple(sources)
        self._c_functions: dict[Signature, CFunc] = {}
        self._function = function
        update_wrapper(self, function)

    def __call__(self, *arguments: object) -> Any:
        """Run by the interpreter."""
        return self.py_func(*arguments)

    @cached_property
    def py_func(self) -> Compiled:
        """The kernel in the interpreter."""
        return self._bind(lambda kernel: kernel.py_func)

    @cached_property
    def compiled(self) -> Compiled:
        """The kernel compiled by numba, with cached machine code; it releases the GIL. Without numba, `py_func`."""
        if not has_numba():
            return self.py_func
        from bseries_base.machine_code import njit

        return njit(sources=self._sources, nogil=True, **self._options)(self._bind(lambda kernel: kernel.compiled))

    def c_function(self, signature: Signature) -> _CFunctionType:
        """The kernel as a C function, a ctypes object that compiled code can call.

        Numba compiles linked callees again with each caller, C functions only once.
        """
        if signature not in self._c_functions:
            from bseries_base.machine_code import cfunc

            function = self._bind(lambda kernel: kernel.compiled)
            # Keeps the code alive to which the ctypes object points.
            self._c_functions[signature] = cfunc(signature, sources=self._sources, **self._options)(function)
        return self._c_functions[signature].ctypes

    def interpreted(self, **names: object) -> Compiled:
        """The kernel in the interpreter, with global names redefined in it and its callees.

        With the elementary functions of mpmath instead of `math`, a kernel computes in any precision.
        """
        return self._bind(lambda kernel: kernel.interpreted(**names), **names)

    def _bind(self, choose: Callable[[Kernel], Compiled], **names: object) -> Compiled:
        function = self._function
        scope = {**function.__globals__, **names} if names else function.__globals__
        callees = {
            name: choose(scope[name]) for name in function.__code__.co_names if isinstance(scope.get(name), Kernel)
        }
        if not callees and not names:
            return function
        bound = types.FunctionType(function.__code__, {**scope, **callees}, function.__name__)
        return update_wrapper(bound, function)


kernel = Kernel
"""Marks a function as a kernel."""


def float_kernel(function: Compiled, *, sources: Iterable[types.ModuleType | Path] = ()) -> Kernel:
    """Mark a function as a floating-point kernel: products and sums may be fused, 1/0 is infinite as in C."""
    return Kernel(function, sources=sources, error_model="numpy", fastmath={"contract"})
