"""Observers that call functions of the user, in machine code that is freed with its last user.

Numba's own engine frees nothing: each function would take 0.9 MB for ever.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.compiler import Flags
from numba.core.errors import NumbaError
from numba.core.registry import cpu_target
from numba.core.typing.templates import signature
from numba.np.arrayobj import populate_array

from foundation.lowering.objects import written_code
from foundation.lowering.units import Unit
from foundation.machine_code import FUNCTION, MachineCode
from integrators.compile.black_boxes import numba_reason
from integrators.core.errors import IntegratorError, shorten

STATE = types.Array(types.float64, 1, "C", readonly=True)
PLAIN = {"nopython": True, "error_model": "numpy"}
"""Options of numba for functions that come without."""


def observer_code(
    functions: Mapping[int, tuple[str, Callable[..., object]]], dimension: int, formulas: int
) -> MachineCode:
    """Compile ``void observe(double t, double *y, double *out)``, which does not write what a function fails to give.

    Args:
        functions: The name and the function of (t, y), with y read-only, for entries of `out`.
        dimension: The length of y.
        formulas: The address of an observer that is called for the other entries, or 0.

    Raises:
        IntegratorError: Numba cannot compile a function, or its value is no number.
    """
    return MachineCode(written_code(partial(_write, functions, dimension, formulas), "observe"))


def _write(functions: Mapping[int, tuple[str, object]], dimension: int, formulas: int, unit: Unit) -> None:
    """Write the observer."""
    context: Any = unit.context
    double = ir.DoubleType()
    kind = ir.FunctionType(ir.VoidType(), [double, double.as_pointer(), double.as_pointer()])
    made = ir.Function(unit.module, kind, FUNCTION)
    builder: Any = ir.IRBuilder(made.append_basic_block())
    t, y, out = made.args
    state = context.make_array(STATE)(context, builder)
    length, size = (context.get_constant(types.intp, value) for value in (dimension, 8))
    populate_array(state, data=y, shape=[length], strides=[size], itemsize=size, meminfo=None)
    for k, (name, function) in functions.items():
        compiled = _compiled(context, builder, name, function)
        status, value = context.call_internal_no_propagate(
            builder, compiled.fndesc, compiled.signature, [t, state._getvalue()]
        )
        with cgutils.if_likely(builder, status.is_ok):
            number = context.cast(builder, value, compiled.signature.return_type, types.float64)
            builder.store(number, builder.gep(out, [context.get_constant(types.intp, k)]))
    if formulas:
        address = context.get_constant(types.intp, formulas)
        builder.call(builder.inttoptr(address, kind.as_pointer()), made.args)
    builder.ret_void()


def _compiled(context: Any, builder: Any, name: str, function: Any) -> Any:
    """Compile a function of (t, y), and link it."""
    flags = Flags()
    options = {**getattr(function, "targetoptions", PLAIN), "parallel": False}
    cpu_target.options.parse_as_flags(flags, options)
    try:
        plain, kinds = getattr(function, "py_func", function), signature(None, types.float64, STATE)
        compiled = context.compile_subroutine(builder, plain, kinds, flags=flags, caching=False)
    except (NumbaError, TypeError, AttributeError, ValueError) as error:
        raise IntegratorError(
            f"observe must have functions of (t, y) that numba can compile, but {shorten(name)} was not: "
            f"{numba_reason(error)}"
        ) from None
    value = compiled.signature.return_type
    if not isinstance(value, types.Float | types.Integer | types.Boolean):
        raise IntegratorError(
            f"observe must have functions whose value is a number, but that of {shorten(name)} is {value}"
        )
    return compiled
