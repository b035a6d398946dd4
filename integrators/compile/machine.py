"""What generated steppers need below Python: memory on the stack, raw pointers, and the bits of a double.

Work arrays of literal size on the stack are as good as local variables: LLVM knows that nothing else points to them.
Functions that take pointers are inlined, or called, without the seven words that a NumPy array is made of.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic as numba_intrinsic

from foundation import machine_code

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
"""As in C with gcc: products and sums may fuse, 1/0 is infinite; sums are not reordered."""
NO_ARRAYS: dict[str, Any] = {"no_rewrites": True}
"""Generated steps have no expressions of arrays that numba would have to look for."""

intrinsic: Any = numba_intrinsic  # its functions are called without the typing context

compiled = njit(**OPTIONS)
inlined = njit(forceinline=True, **OPTIONS)
kept = machine_code.njit(sources=[Path(__file__)], **OPTIONS)


def inlined_as(*signature: Any) -> Any:
    """As `inlined`, for one signature: compiled once for all steppers, and not for each kind of literal arguments.

    Args:
        *signature: The types of the result and of the arguments.
    """
    result, *arguments = signature
    return machine_code.njit(result(*arguments), sources=[Path(__file__)], forceinline=True, **OPTIONS)


DOUBLES = types.CPointer(types.float64)
DOUBLE, WHOLE, TRUTH = types.float64, types.int64, types.boolean
STEPS = WHOLE(*[DOUBLES] * 6, DOUBLE, WHOLE, WHOLE)
steps_in_c = machine_code.cfunc(STEPS, **OPTIONS, **NO_ARRAYS)
"""Makes int64_t advance(double *state, *carry, *memory, *control, *numbers, *work, double h, int64_t steps, fresh)."""


CACHE_LINE = 64
"""Bytes. Vectors that lie across two lines cost a quarter of some steps, in one process and not in another."""


@intrinsic(prefer_literal=True)
def stack(typing_context: Any, size: Any) -> Any:
    """A pointer to `size` doubles, a literal number, that live as long as the function (or who it is inlined into)."""
    if not isinstance(size, types.IntegerLiteral):
        return None

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = cgutils.alloca_once(builder, ir.DoubleType(), size=ir.Constant(ir.IntType(64), size.literal_value))
        place.align = CACHE_LINE
        return place

    return DOUBLES(size), codegen


@intrinsic
def pointer(typing_context: Any, array: Any) -> Any:
    """A pointer to the first of a contiguous array's doubles."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(array)(context, builder, arguments[0]).data

    return DOUBLES(array), codegen


@intrinsic
def shifted(typing_context: Any, start: Any, offset: Any) -> Any:
    """The pointer `offset` doubles further."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.gep(arguments[0], [arguments[1]])

    return DOUBLES(DOUBLES, types.intp), codegen


@intrinsic
def bits(typing_context: Any, number: Any) -> Any:
    """The 64 bits of a double as an integer.

    Those of absolute values are ordered as the values are, with infinity and nan above all numbers; maxima of integers,
    unlike those of doubles, can be taken in any order, so that they are computed in vectors.
    """

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), codegen


@intrinsic
def fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c, rounded once: an instruction, or a function of the C library where there is none."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), codegen


@intrinsic
def value_of(typing_context: Any, number: Any) -> Any:
    """The double with these bits."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), codegen


@intrinsic
def call_observer(typing_context: Any, address: Any, t: Any, y: Any, out: Any) -> Any:
    """Call the C function void (double t, double *y, double *out) at an address."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        _call(builder, ir.VoidType(), arguments)
        return context.get_dummy_value()

    return types.void(types.int64, types.float64, DOUBLES, DOUBLES), codegen


@intrinsic
def call_steps(
    typing_context: Any, address: Any, state: Any, carry: Any, memory: Any, control: Any, numbers: Any, work: Any,
    h: Any, steps: Any, fresh: Any,
) -> Any:  # fmt: skip
    """Call what `steps_in_c` has made, at an address."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _call(builder, ir.IntType(64), arguments)

    return types.int64(types.int64, *[DOUBLES] * 6, types.float64, types.int64, types.int64), codegen


def _call(builder: Any, value: ir.Type, arguments: Any) -> Any:
    """Call a C function at an address, with the other arguments."""
    address, *others = arguments
    function = ir.FunctionType(value, [argument.type for argument in others]).as_pointer()
    return builder.call(builder.inttoptr(address, function), others)
