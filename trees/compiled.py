"""The decorator of all kernels: one source, compiled by numba when it pays, plain Python otherwise.

Importing numba costs a quarter of a second and the first compiled call as much again, while a table of a few hundred
trees is done in a millisecond by the interpreter. So a kernel is an ordinary function of sequences until somebody asks
for the compiled one.
"""

from __future__ import annotations

import sys
import types
from collections.abc import Callable, Iterable
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import Any


class Kernel:
    """A pure function of arrays with two executions: ``py_func`` (any sequences, any numbers) and ``compiled``.

    Inside a kernel other kernels are called by name; each execution finds its own kind of the callee. Callees must
    live in the same file, because the cache on disk notices edits of that file only; modules whose constants go
    into machine code are named as `sources`, or their files are (see `foundation.machine_code`).
    """

    def __init__(
        self, function: Callable[..., Any], *, sources: Iterable[types.ModuleType | Path] = (), **options: Any
    ):
        self._options = options
        self._sources = tuple(sources)
        self._c_functions: dict[Any, Any] = {}
        self.__name__ = function.__name__
        self.__doc__ = function.__doc__
        self.__wrapped__ = function
        self._function = function

    def __call__(self, *arguments: Any) -> Any:
        """Run by the interpreter."""
        return self.py_func(*arguments)

    @cached_property
    def py_func(self) -> Callable[..., Any]:
        """The kernel run by the interpreter."""
        return self._bind(lambda kernel: kernel.py_func)

    @cached_property
    def compiled(self) -> Callable[..., Any]:
        """The kernel compiled by numba (machine code is kept on disk; the GIL is released while it runs)."""
        from foundation.machine_code import njit

        return njit(sources=self._sources, nogil=True, **self._options)(self._bind(lambda kernel: kernel.compiled))

    def c_function(self, signature: Any) -> Any:
        """The kernel as a C function, a ctypes object that compiled code can call.

        A callee that numba links is compiled again with each of its callers; a C function is compiled once.
        """
        if signature not in self._c_functions:
            from foundation.machine_code import cfunc

            function = self._bind(lambda kernel: kernel.compiled)
            # Holds the code that ctypes only points to.
            self._c_functions[signature] = cfunc(signature, sources=self._sources, **self._options)(function)
        return self._c_functions[signature].ctypes

    def interpreted(self, **names: Any) -> Callable[..., Any]:
        """The kernel run by the interpreter, here and in its callees with other things behind some global names.

        With the elementary functions of mpmath in place of those of `math`, a kernel computes in any precision.
        """
        return self._bind(lambda kernel: kernel.interpreted(**names), **names)

    def _bind(self, choose: Callable[[Kernel], Callable[..., Any]], **names: Any) -> Callable[..., Any]:
        function = self._function
        scope = {**function.__globals__, **names} if names else function.__globals__
        callees = {
            name: choose(scope[name]) for name in function.__code__.co_names if isinstance(scope.get(name), Kernel)
        }
        if not callees and not names:
            return function
        bound = types.FunctionType(function.__code__, {**scope, **callees}, function.__name__)
        return update_wrapper(bound, function)


def kernel(function: Callable[..., Any]) -> Kernel:
    """Mark a function as a kernel."""
    return Kernel(function)


def float_kernel(function: Callable[..., Any], *, sources: Iterable[types.ModuleType | Path] = ()) -> Kernel:
    """Mark a function as a kernel of floating-point numbers: products and sums may fuse, 1/0 is infinite as in C.

    Args:
        function: The function.
        sources: Modules, or their files, on which its machine code depends.
    """
    return Kernel(function, sources=sources, error_model="numpy", fastmath={"contract"})


def compiling_pays(work: float) -> bool:
    """Whether so many elementary operations are better done by compiled kernels.

    The interpreter does some five million a second. Once numba is loaded its fixed cost is paid.
    """
    return work > 1e6 or "numba" in sys.modules
