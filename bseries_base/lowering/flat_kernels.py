"""Kernels of numbers and flat arrays, whose machine code on disk is loaded without numba."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, cached_property, partial
from hashlib import sha256
from pathlib import Path
from threading import RLock
from types import FunctionType
from typing import Any, TypeAlias

from bseries_base import machine_code
from bseries_base.kernels import Kernel
from bseries_base.lowering import SOURCES
from bseries_base.machine_code import Compiled, ObjectCode, has_numba

Kinds: TypeAlias = tuple[str | type[float] | type[int], ...]
"""Of arguments: the characters of the types of arrays, and types of numbers."""


class FlatKernel(Kernel):
    """A kernel of numbers and flat arrays.

    It is compiled by `bseries_base.lowering`, and its machine code on disk is loaded without numba. Callees are of the
    same kind; they may return integers, if they are annotated so. Arrays with different names must not overlap.
    """

    def __init__(self, function: Compiled):
        super().__init__(function)
        self._loaded: dict[Kinds, Callable[..., int | None]] = {}
        self._loading = RLock()

    @cached_property
    def compiled(self) -> Compiled:
        """The kernel for contiguous arrays, integers of 64 bits and doubles. Without numba, `py_func`."""
        return self._run if has_numba() else self.py_func

    def _run(self, *arguments: Any) -> int | None:
        kinds = tuple([x.dtype.char if hasattr(x, "dtype") and x.ndim else type(x) for x in arguments])
        call = self._loaded.get(kinds)
        if call is None:
            with self._loading:  # threads that meet a new kernel at once compile it once
                call = self._loaded.get(kinds) or self._load(kinds)
                self._loaded[kinds] = call
        return call(*[address_of(x) if kind.__class__ is str else x for x, kind in zip(arguments, kinds, strict=True)])

    def _load(self, kinds: Kinds) -> Callable[..., int | None]:
        """The C function for arguments of these kinds."""
        digests = [_digest(source) for source in sorted(self.files() | {*SOURCES})]
        key = f"{self._function.__module__}.{self._function.__qualname__} {kinds} {' '.join(digests)}"
        made = machine_code.c_function(key, partial(_object_code, self.py_func, kinds))
        types = [
            ctypes.c_void_p if isinstance(kind, str) else ctypes.c_double if kind is float else ctypes.c_int64
            for kind in kinds
        ]
        return made.function(ctypes.CFUNCTYPE(ctypes.c_int64 if _gives_integer(self.py_func) else None, *types))

    def files(self) -> set[Path]:
        """The files of the kernel and of all that it calls, on which its machine code depends."""
        code, names = self._function.__code__, self._function.__globals__
        callees = (names.get(name) for name in code.co_names)
        others = (callee.files() for callee in callees if isinstance(callee, FlatKernel))
        return {Path(code.co_filename)}.union(*others)


def address_of(array: Any) -> int | None:
    """The address of the entries: in the object of an array, what follows the header of every object.

    It is the first field of NumPy's C structure of an array, and read in a sixth of the time that
    ``__array_interface__`` takes, which for twenty arrays is longer than a kernel on a few hundred trees.
    """
    return ctypes.c_void_p.from_address(id(array) + object.__basicsize__).value


@cache
def _digest(source: Path) -> str:
    return sha256(source.read_bytes()).hexdigest()


def _gives_integer(function: Compiled) -> bool:
    return function.__annotations__.get("return") in (int, "int")


def _object_code(function: FunctionType, kinds: Kinds) -> ObjectCode:
    """Machine code for arguments of these kinds, by the passes of LLVM."""
    import numpy as np
    from numba import from_dtype, types

    from bseries_base.lowering.objects import object_code

    given = [
        types.CPointer(from_dtype(np.dtype(kind))) if isinstance(kind, str)
        else types.float64 if kind is float
        else types.int64
        for kind in kinds
    ]  # fmt: skip
    result = types.int64 if _gives_integer(function) else types.void
    return object_code(function, result(*given), nogil=True, error_model="numpy")


flat_kernel = FlatKernel
"""Marks a function as a flat kernel."""

FEW_PRODUCTS = 900
"""Products of numbers that take the interpreter most of a millisecond; NumPy and llvmlite load in a hundred."""


def machine_code_pays(products: int) -> bool:
    """Whether machine code should do work of this size: the choice depends on the work alone."""
    return products > FEW_PRODUCTS and has_numba()
