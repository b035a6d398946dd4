"""Machine code of black boxes: functions of Python in generated code.

Generated code passes one array, with room for the values after the arguments. A function that fails cannot raise an
error through machine code of steps: its values are nan, and its error is kept for the thread, see `failure`. Machine
code lives as long as the steps that contain it, or, where it is called from elsewhere, as the black box.
"""

from __future__ import annotations

import ctypes
import math
import threading
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import lru_cache, partial
from types import FunctionType
from typing import TYPE_CHECKING, Any, NoReturn, cast
from weakref import WeakValueDictionary

import numpy as np

from bseries_base.errors import shorten, shown, warn_user
from bseries_base.extras import optional_module
from bseries_base.machine_code import FUNCTION, Compiled, MachineCode
from integrators.compile.c_functions import data
from integrators.compile.function_keys import function_key
from integrators.compile.modules import load_module
from integrators.compile.printer import indented
from integrators.core.errors import IntegratorError
from integrators.core.immutable import cached_method
from integrators.scenes.model.black_boxes import BlackBox, BoxArgument, Entry, box_of
from integrators.scenes.model.formulas import as_float
from integrators.scenes.model.system import System
from integrators.scenes.particles.expansion import filled

if TYPE_CHECKING:
    from numba import types

    from bseries_base.lowering.expressions import Written
    from integrators.compile.user_functions import Store

_DISPATCHERS: WeakValueDictionary[Hashable, Compiled] = WeakValueDictionary()
_FAILURE = threading.local()
_LISTED = set[str]()  # keys of functions that return lists

VALUES = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_double))
"""void call(double *a)."""

SOURCE = '''\
"""The values of a function of Python, put after its arguments."""


def store(a, values):
{lines}
'''


def black_box(
    function: Compiled, name: str, arguments: Sequence[BoxArgument], shape: Sequence[int],
    jacobian: BlackBox | None = None,
) -> BlackBox:  # fmt: skip
    """Compile a function of Python, or one that numba has compiled, with its options.

    Raises:
        IntegratorError: Numba cannot compile it, or its value has another type or length.

    Warns:
        RuntimeWarning: It returns a list.
    """
    box = BlackBox(dispatcher_of(function), name, arguments, shape, jacobian)
    compiled_box(box)
    if box.key in _LISTED:
        message = f"{name} should return a tuple: with the list that it returns, steps take several times as long"
        warn_user(message, RuntimeWarning)
    return box


def dispatcher_of(function: Compiled) -> Compiled:
    """The function as one of numba; the same one for functions with the same text and frozen values."""
    numba = optional_module("numba", "a function without formulas")
    if hasattr(function, "py_func") and hasattr(function, "get_call_template"):  # made by numba's decorators
        return function
    if not isinstance(function, FunctionType):
        raise IntegratorError(f"function must be made by def or lambda to be compiled, but was {shown(function)}")
    key = function_key(function)
    found = _DISPATCHERS.get(key)
    if found is None:
        from integrators.compile.machine import OPTIONS

        found = _DISPATCHERS[key] = numba.njit(**OPTIONS)(function)
    return found


def written(key: str) -> Written:
    """The black box with this key, in code that is lowered with its callers."""
    from bseries_base.lowering.expressions import Written
    from integrators.compile.user_functions import write_call

    return Written(partial(write_call, *_parts(box_of(key))))


def address_of(key: str) -> int:
    """The address of the C function of the black box with this key, which whoever knows it must keep."""
    return _kept(box_of(key)).address


@cached_method
def _kept(box: BlackBox) -> MachineCode:
    """The C function, kept by the box."""
    return compiled_box(box)


@lru_cache(maxsize=8)  # not kept by the box: SymPy's caches keep hundreds of these
def compiled_box(box: BlackBox) -> MachineCode:
    """The C function of a black box; the last ones are kept."""
    from bseries_base.lowering.objects import written_code
    from integrators.compile.user_functions import write_values

    return MachineCode(written_code(partial(write_values, *_parts(box), FUNCTION), FUNCTION))


def _parts(box: BlackBox) -> tuple[BlackBox, Store, int]:
    """What code of a black box is written from: it, what stores its values, and the address of `report`."""
    return box, partial(_store, box), ctypes.cast(_report(box), ctypes.c_void_p).value or 0


@cached_method
def _report(box: BlackBox) -> Any:
    """The C function that is called where the function of Python fails; it lives as long as the box."""
    key = box.key

    @VALUES
    def report(numbers: Any) -> None:
        box = box_of(key)
        values = np.ctypeslib.as_array(numbers, (box.inputs,)).copy()
        _FAILURE.error = box.name, values, _error(box, values)

    return report


def _error(box: BlackBox, values: np.ndarray) -> Exception:
    """The error that the function raises at some arguments, as one of Python."""
    given, named = box.bound(lambda place, length: values[place : place + length] if length else float(values[place]))
    try:
        with np.errstate(all="ignore"):
            getattr(box.function, "py_func", box.function)(*given, **named)
    except Exception as error:
        return error.with_traceback(None)  # which would keep the run
    return ValueError(f"it must return {_size_text(box)}, but returned another number")


def _store(box: BlackBox, kind: types.Type) -> Callable[..., None]:
    """The function of Python that puts a value of numba's type behind the arguments in an array."""
    from numba import types

    if isinstance(kind, types.List):
        _LISTED.add(box.key)
    lines = _stored(kind, "values", box.shape, str(box.inputs), box)
    return load_module(SOURCE.format(lines="\n".join(indented(lines))), keep=False).store


def _stored(kind: types.Type, text: str, shape: Sequence[int], place: str, box: BlackBox) -> list[str]:
    """Statements that store a value, or a part of it, of numba's type `kind` from a place on."""
    from numba import types

    if isinstance(kind, types.Float | types.Integer | types.Boolean) and (not shape or box.shape == (1,)):
        return [f"a[{place}] = {text}"]
    if not shape:
        _refuse_value(box, kind)
    size, depth = shape[0], len(box.shape) - len(shape)
    inner = math.prod(shape[1:])
    if isinstance(kind, types.BaseTuple):
        parts = tuple(cast("Iterable[types.Type]", kind))
        if len(parts) != size:
            _refuse_value(box, kind)
        return [
            line
            for k, item in enumerate(parts)
            for line in _stored(item, f"{text}[{k}]", shape[1:], f"{place} + {k * inner}", box)
        ]
    if isinstance(kind, types.Array) and kind.ndim == len(shape):
        item = kind.dtype if kind.ndim == 1 else kind.copy(ndim=kind.ndim - 1)
    elif isinstance(kind, types.List):
        item = kind.dtype
    else:
        _refuse_value(box, kind)
    lines = _stored(item, f"{text}[i{depth}]", shape[1:], f"{place} + {inner}*i{depth}", box)
    error = f'raise ValueError("it must return {_size_text(box)}, but returned another number")'
    return [f"if len({text}) != {size}:", f"    {error}", f"for i{depth} in range({size}):", *indented(lines)]


def _size_text(box: BlackBox) -> str:
    """How many numbers a black box must return, in words."""
    return "one number" if box.size == 1 else " times ".join(map(str, box.shape)) + " numbers"


def _refuse_value(box: BlackBox, kind: types.Type) -> NoReturn:
    """Refuse a value of numba's type `kind`."""
    raise IntegratorError(f"function must return {_size_text(box)}, but {box.name} returned the type {shown(kind)}")


def evaluated(box: BlackBox, values: np.ndarray) -> np.ndarray:
    """The value of a black box, with the errors that it raises."""
    numbers, code = np.concatenate([values, np.empty(box.size)]), compiled_box(box)
    forget_failure()
    VALUES(code.address)(data(numbers))
    if _FAILURE.error is not None:
        raise _FAILURE.error[-1]
    return numbers[box.inputs :]


def forget_failure() -> None:
    """Forget the error of an earlier call in this thread."""
    _FAILURE.error = None


def failure() -> IntegratorError | None:
    """The error of a call in this thread since `forget_failure`, in a sentence; None if there was none."""
    found = getattr(_FAILURE, "error", None)
    if found is None:
        return None
    error = IntegratorError(_failure_text(*found))
    error.__cause__ = found[-1]
    return error


def _failure_text(name: str, values: np.ndarray, error: Exception) -> str:
    """The sentence on an error that a function raised at some arguments."""
    at = shorten(", ".join(f"{x:g}" for x in values))
    return f"{name} must have a value at ({at}), but raised {type(error).__name__}: {shorten(str(error), 200)}"


def check_start(scene: System) -> None:
    """Evaluate the black boxes of a scene at its start.

    Raises:
        IntegratorError: One raises an error there, or is not finite.
    """
    values = {symbol: as_float(value) for symbol, value in zip(scene.symbols, scene.start or (), strict=True)}
    entries = {x.args[0]: x for summand in scene.summands for x in summand.formula.atoms(Entry)}
    for entry in entries.values():
        box, _, *arguments = cast(Entry, filled(entry, scene)).args
        point = np.array([values[x] if x in values else as_float(x) for x in arguments])
        try:
            found = evaluated(box, point)
        except Exception as error:
            raise IntegratorError(_failure_text(box.name, point, error)) from error
        if not np.isfinite(found).all():
            raise IntegratorError(f"y0 must be where {box.name} is finite, but its value was {shown(found.tolist())}")
