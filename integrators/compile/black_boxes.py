"""Machine code of black boxes: functions of Python in generated code.

Generated code passes one array, with room for the values after the arguments. A function that fails cannot raise an
error through machine code of steps: its values are nan, and its error is kept for the thread, see `failure`.
"""

from __future__ import annotations

import ctypes
import math
import re
import threading
import warnings
from collections.abc import Callable, Hashable, Iterator, Sequence
from types import FunctionType
from typing import TYPE_CHECKING, Any, NoReturn, cast
from weakref import WeakValueDictionary

import numpy as np

from foundation.extras import optional_module
from integrators.compile.function_keys import function_key
from integrators.compile.modules import load_module
from integrators.compile.printer import indented
from integrators.core.errors import IntegratorError, shorten, shown
from integrators.core.immutable import cached_method
from integrators.scenes.model.black_boxes import BlackBox, BoxArgument, Entry, box_of
from integrators.scenes.model.formulas import as_float
from integrators.scenes.model.system import System
from integrators.scenes.particles.expansion import filled

if TYPE_CHECKING:
    from numba import types

_DISPATCHERS: WeakValueDictionary[Hashable, Any] = WeakValueDictionary()
_FAILURE = threading.local()

SOURCE = '''\
"""A function of Python in generated code."""

from numba import carray, njit
from integrators.compile.machine import OPTIONS

NAN = float("nan")


def bound(function, report):
    """The functions that put values after the arguments: of an array, and of a pointer, without errors."""

    @njit(**OPTIONS)
    def evaluate(a):
{lines}

    @njit(**OPTIONS)
    def call(p):
        a = carray(p, {total})
        failed = False
        try:
            evaluate(a)
        except Exception:
            failed = True
        if failed:
            report(p)
            for k in range({inputs}, {total}):
                a[k] = NAN

    return evaluate, call
'''


def black_box(
    function: Callable[..., object], name: str, arguments: Sequence[BoxArgument], shape: Sequence[int],
    jacobian: BlackBox | None = None,
) -> BlackBox:  # fmt: skip
    """Compile a function of Python, or take one that numba has compiled.

    Raises:
        IntegratorError: Numba cannot compile it, or its value has another type or length.

    Warns:
        RuntimeWarning: It returns a list.
    """
    from numba import types

    box = BlackBox(dispatcher_of(function), name, arguments, shape, jacobian)
    _compiled(box)
    if isinstance(_value_type(box), types.List):
        message = f"{name} should return a tuple: with the list that it returns, steps take several times as long"
        warnings.warn(message, RuntimeWarning, stacklevel=2)
    return box


def dispatcher_of(function: object) -> Any:
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


def kernel(key: str) -> Callable[..., None]:
    """The function of generated code with this key, call(p) of a pointer."""
    return _compiled(box_of(key))[1]


@cached_method
def _compiled(box: BlackBox) -> tuple[Callable[[np.ndarray], None], Callable[..., None]]:
    """The functions of an array and of a pointer. They live as long as the box: machine code calls `report`."""
    stored = _stored(_value_type(box), "values", box.shape, str(box.inputs), box)
    lines = [f"values = function({', '.join(_arguments(box))})", *stored]
    text = SOURCE.format(lines="\n".join(indented(indented(lines))), total=box.total, inputs=box.inputs)

    @ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_double))
    def report(numbers: object) -> None:
        values = np.ctypeslib.as_array(numbers, (box.inputs,)).copy()
        try:
            evaluated(box, values)
        except Exception as error:
            _FAILURE.error = box.name, values, error.with_traceback(None)  # which would keep the run

    return load_module(text, keep=False).bound(box.function, report)


def _arguments(box: BlackBox) -> Iterator[str]:
    """The arguments of the call, slices and entries of the array a."""
    start = 0
    for keyword, length in box.arguments:
        text = f"a[{start}:{start + length}]" if length else f"a[{start}]"
        yield f"{keyword}={text}" if keyword else text
        start += max(1, length)


def _value_type(box: BlackBox) -> types.Type:
    """Numba's type of the value."""
    from numba import types

    number, array = types.float64, types.Array(types.float64, 1, "C")
    given = tuple(array if length else number for keyword, length in box.arguments if not keyword)
    named = {keyword: array if length else number for keyword, length in box.arguments if keyword}
    try:
        return types.Dispatcher(box.function).get_call_type(box.function.typingctx, given, named).return_type
    except Exception as error:  # numba passes on those of others
        raise IntegratorError(
            f"function must be one that numba can compile, but {box.name} was not: {numba_reason(error)}"
        ) from error


def numba_reason(error: Exception) -> str:
    """The reason why numba does not compile a function, in one line."""
    lines = (line.strip() for line in re.sub(r"\x1b\[[0-9;]*m", "", str(error)).splitlines())
    found = [line for line in lines if line and not line.startswith("Failed in nopython mode")]
    return shorten(found[0].rstrip("."), 200) if found else type(error).__name__


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
        parts = tuple(cast(Any, kind))
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
    numbers = np.concatenate([values, np.empty(box.size)])
    _compiled(box)[0](numbers)
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
        arguments: Any
        box, _, *arguments = filled(cast(Any, entry), scene).args
        box = cast(BlackBox, box)
        point = np.array([values[x] if x in values else as_float(x) for x in arguments])
        try:
            found = evaluated(box, point)
        except Exception as error:
            raise IntegratorError(_failure_text(box.name, point, error)) from error
        if not np.isfinite(found).all():
            raise IntegratorError(f"y0 must be where {box.name} is finite, but its value was {shown(found.tolist())}")
