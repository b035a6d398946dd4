"""C functions in generated source: their types, and their machine code from the cache on disk.

Machine code that is on disk is loaded and called without numba, whose import takes a quarter of a second. It is freed
with the last user of a function.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias
from weakref import WeakValueDictionary

import numpy as np

from bseries_base import machine_code
from bseries_base.forks import MODULES
from bseries_base.lowering import SOURCES
from bseries_base.machine_code import MachineCode, ObjectCode
from integrators.compile.modules import load_module, module_name

_WHOLE, _DOUBLE, _DOUBLES = ctypes.c_int64, ctypes.c_double, ctypes.POINTER(ctypes.c_double)
CFunction: TypeAlias = "type[ctypes._CFunctionType]"
STEPS = ctypes.CFUNCTYPE(_WHOLE, *[_DOUBLES] * 6, _DOUBLE, _WHOLE, _WHOLE)
"""int64_t advance(double *state, *compensation, *memory, *control, *numbers, *work, double h, int64_t steps, fresh)."""
OBSERVER = ctypes.CFUNCTYPE(None, _DOUBLE, _DOUBLES, _DOUBLES)
"""void observe(double t, double *y, double *out)."""
_ROWS = _WHOLE, _DOUBLES, _WHOLE, _DOUBLES, _WHOLE
RECORDED = ctypes.CFUNCTYPE(
    _WHOLE, _WHOLE, *[_DOUBLES] * 6, _WHOLE, _WHOLE, _DOUBLE, _DOUBLE, *[_WHOLE] * 4, *_ROWS, *_ROWS
)
REPEATED = ctypes.CFUNCTYPE(_WHOLE, _WHOLE, *[_DOUBLES] * 10, _WHOLE, _WHOLE, _WHOLE, _DOUBLE, _WHOLE, _WHOLE, _WHOLE)
"""See `integrators.steppers.recording`."""
_OWN = (*SOURCES, Path(__file__), Path(__file__).with_name("machine.py"))
_Data = ctypes.c_double * 0
Pointer: TypeAlias = ctypes.Array[ctypes.c_double] | None
"""An argument of a C function."""
_IN_MEMORY: WeakValueDictionary[str, MachineCode] = WeakValueDictionary()


def c_function(source: str, name: str, *, helpers: Sequence[Path] = ()) -> MachineCode:
    """The machine code of a C function in generated source.

    Args:
        source: The text of a module.
        name: The function, decorated by `integrators.compile.machine.in_c`.
        helpers: The files on which its code depends, besides those of this room.

    Example:
        >>> code = c_function('''
        ... from integrators.compile.c_functions import OBSERVER
        ... from integrators.compile.machine import in_c
        ...
        ... @in_c(OBSERVER)
        ... def observe(t, y, out):
        ...     out[0] = t*y[1]
        ... ''', "observe")
        >>> y, out = np.array([1.0, 2.0]), np.empty(1)
        >>> code.function(OBSERVER)(3.0, data(y), data(out))
        >>> print(out)
        [6.]
    """
    helpers = *_OWN, *helpers
    key = f"{module_name(source, helpers)}.{name}"

    def compiled() -> ObjectCode:
        module = load_module(source, helpers=helpers, keep=False)
        return getattr(module, name)()

    found = _IN_MEMORY.get(key)
    if found is None:
        made = machine_code.c_function(key, compiled)
        with MODULES:  # threads that made it at once all take the first, which lives as long as one of them uses it
            found = _IN_MEMORY.setdefault(key, made)
    return found


def data(array: np.ndarray) -> Pointer:
    """A pointer to the data of a contiguous array of doubles that may be written; None if it is empty."""
    return _Data.from_buffer(array) if array.size else None  # pyright: ignore[reportArgumentType]
