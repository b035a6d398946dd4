"""Low-level intrinsics of generated steps: memory on the stack, pointers, bits of doubles, C calls.

LLVM optimises arrays of literal size on the stack like local variables, since nothing else points to them. Pointers are
cheaper arguments than NumPy arrays, which consist of seven words.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any, TypeAlias

from bseries_base import machine_code
from bseries_base.extras import missing_package

try:
    from llvmlite import ir
    from numba import njit, types
    from numba.core import cgutils
    from numba.core.typing.ctypes_utils import from_ctypes
    from numba.extending import intrinsic as numba_intrinsic
except ImportError as error:  # in a browser
    raise missing_package("numba", "steps on a scene", error) from None

from bseries_base.lowering.expressions import Operand
from bseries_base.lowering.objects import object_code
from integrators.compile.c_functions import STEPS, CFunction

if TYPE_CHECKING:
    from numba.core.base import BaseContext
    from numba.core.typing.templates import Signature

    from bseries_base.machine_code import ObjectCode

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
"""As in C with gcc: products and sums may fuse, 1/0 is infinite, sums are not reordered."""
intrinsic: Any = numba_intrinsic  # numba passes the typing context itself

Intrinsic: TypeAlias = "tuple[Signature, Callable[..., ir.Value]]"
"""The signature of an intrinsic, and the function that writes its code."""

compiled = njit(**OPTIONS)
inlined = njit(forceinline=True, **OPTIONS)
kept = machine_code.njit(sources=[Path(__file__)], **OPTIONS)


def inlined_as(*signature: types.Type) -> machine_code.Decorator:
    """As `inlined`, but compiled once, for one signature (result, *arguments), whatever arguments are literal."""
    result, *arguments = signature
    return machine_code.njit(result(*arguments), sources=[Path(__file__)], forceinline=True, **OPTIONS)


DOUBLES = types.CPointer(types.float64)
DOUBLE, WHOLE, TRUTH = types.float64, types.int64, types.boolean


def in_c(prototype: CFunction) -> Callable[[FunctionType], Callable[[], ObjectCode]]:
    """Turn a generated function into one that compiles it to a C function (see `integrators.compile.c_functions`).

    Args:
        prototype: The type of the C function, made by `ctypes.CFUNCTYPE`.
    """
    return lambda function: partial(object_code, function, signature_of(prototype), **OPTIONS)


def signature_of(prototype: CFunction) -> Signature:
    """Numba's types of the result and of the arguments of a C function."""
    made = prototype()
    return from_ctypes(made.restype)(*map(from_ctypes, made.argtypes))


CACHE_LINE = 64
"""Bytes; vectors across two lines would slow down some steps by a quarter, in some processes only."""


@intrinsic(prefer_literal=True)
def stack(typing_context: object, size: types.Type) -> Intrinsic | None:
    """A pointer to `size` doubles, a literal number, with the lifetime of the function or of its inlining caller."""
    if not isinstance(size, types.IntegerLiteral):
        return None

    def emit(builder: ir.IRBuilder, _: object) -> ir.Value:
        place = cgutils.alloca_once(builder, ir.DoubleType(), size=ir.Constant(ir.IntType(64), size.literal_value))
        place.align = CACHE_LINE
        return place

    return _emitted(DOUBLES(size), emit)


@intrinsic
def pointer(typing_context: object, array: types.Array) -> Intrinsic:
    """A pointer to the data of a contiguous array of doubles."""

    def codegen(
        context: BaseContext, builder: ir.IRBuilder, signature: object, arguments: Sequence[ir.Value]
    ) -> ir.Value:
        return context.make_array(array)(context, builder, arguments[0]).data

    return DOUBLES(array), codegen


@intrinsic
def shifted(typing_context: object, start: object, offset: object) -> Intrinsic:
    """The pointer `offset` doubles further."""
    return _emitted(DOUBLES(DOUBLES, types.intp), lambda builder, start, offset: builder.gep(start, [offset]))


@intrinsic
def bits(typing_context: object, number: object) -> Intrinsic:
    """The 64 bits of a double as an integer.

    The order of nonnegative doubles is that of their bits, with infinity and nan at the top. Maxima of integers, unlike
    those of doubles, may be reordered, and hence vectorised.
    """
    return _emitted(WHOLE(DOUBLE), lambda builder, number: builder.bitcast(number, ir.IntType(64)))


@intrinsic
def fma(typing_context: object, a: object, b: object, c: object) -> Intrinsic:
    """a b + c, rounded once, by an instruction or the C library."""
    return _emitted(DOUBLE(DOUBLE, DOUBLE, DOUBLE), lambda builder, a, b, c: builder.fma(a, b, c))


@intrinsic
def value_of(typing_context: object, number: object) -> Intrinsic:
    """The double with these bits."""
    return _emitted(DOUBLE(WHOLE), lambda builder, number: builder.bitcast(number, ir.DoubleType()))


@intrinsic
def call_observer(typing_context: object, address: object, t: object, y: object, out: object) -> Intrinsic:
    """Call the C function void (double t, double *y, double *out) at an address."""
    return types.void(WHOLE, DOUBLE, DOUBLES, DOUBLES), _called


@intrinsic
def call_values(typing_context: object, address: object, values: object) -> Intrinsic:
    """Call the C function void (double *values) at an address."""
    return types.void(WHOLE, DOUBLES), _called


@intrinsic
def call_steps(
    typing_context: object, address: object, state: object, compensation: object, memory: object, control: object,
    numbers: object, work: object, h: object, steps: object, fresh: object,
) -> Intrinsic:  # fmt: skip
    """Call the C function of steps at an address."""
    signature = WHOLE(WHOLE, *signature_of(STEPS).args)
    return _emitted(signature, lambda builder, *arguments: _call(builder, ir.IntType(64), *arguments))


def _emitted(signature: Signature, emit: Callable[..., ir.Value]) -> Intrinsic:
    """An intrinsic from its signature and a function of the builder and the arguments."""
    return signature, lambda context, builder, signature, arguments: emit(builder, *arguments)


def _called(context: BaseContext, builder: ir.IRBuilder, signature: object, arguments: Sequence[Operand]) -> ir.Value:
    """Write the call of a C function without a value."""
    _call(builder, ir.VoidType(), *arguments)
    return context.get_dummy_value()


def _call(builder: ir.IRBuilder, value: ir.Type, address: Operand, *arguments: Operand) -> ir.Value:
    """Call a C function at an address."""
    function = ir.FunctionType(value, [argument.type for argument in arguments]).as_pointer()
    return builder.call(builder.inttoptr(address, function), arguments)
