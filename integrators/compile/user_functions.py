"""Observers and black boxes: functions of the user in machine code that is freed with its last user.

Numba's own engine frees nothing: each function would take 0.9 MB for ever.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.compiler import Flags
from numba.core.registry import cpu_target
from numba.core.typing.templates import signature
from numba.np.arrayobj import populate_array

from bseries_base.errors import shorten
from bseries_base.lowering.expressions import Value
from bseries_base.lowering.objects import written_code
from bseries_base.lowering.units import Unit
from bseries_base.machine_code import FUNCTION, MachineCode
from integrators.core.errors import IntegratorError
from integrators.scenes.model.black_boxes import BlackBox

STATE, VALUES = types.Array(types.float64, 1, "C", readonly=True), types.Array(types.float64, 1, "C")
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
    state = _array(context, builder, STATE, y, dimension)
    for k, (name, function) in functions.items():
        what = f"observe must have functions of (t, y) that numba can compile, but {shorten(name)} was not"
        compiled = _compiled(context, builder, function, [types.float64, STATE], what)
        value = compiled.signature.return_type
        if not isinstance(value, types.Float | types.Integer | types.Boolean):
            raise IntegratorError(
                f"observe must have functions whose value is a number, but that of {shorten(name)} is {value}"
            )
        status, value = _called(context, builder, compiled, [t, state])
        with cgutils.if_likely(builder, status.is_ok):
            number = context.cast(builder, value, compiled.signature.return_type, types.float64)
            builder.store(number, builder.gep(out, [context.get_constant(types.intp, k)]))
    if formulas:
        address = context.get_constant(types.intp, formulas)
        builder.call(builder.inttoptr(address, kind.as_pointer()), made.args)
    builder.ret_void()


def write_call(box: BlackBox, store: Callable[[Any], Any], report: int, unit: Unit, builder: Any, a: Value) -> Value:
    """Write a call of a black box, whose code becomes a part of the module."""
    name = f"box_{box.key}"
    made = unit.module.globals.get(name)
    if made is None:
        made = write_values(box, store, report, name, unit)
        made.linkage = "internal"
    builder.call(made, [a.llvm])
    return Value(types.none, unit.context.get_dummy_value())


def write_values(box: BlackBox, store: Callable[[Any], Any], report: int, name: str, unit: Unit) -> Any:
    """Write ``void name(double *a)``, which puts the values of a black box after its arguments.

    Args:
        box: The black box.
        store: Gives a function of Python that stores values of a type of numba.
        report: The address of a C function of the same array, which is called after an error.
        name: The name of the function.
        unit: The module.
    """
    context: Any = unit.context
    kind = ir.FunctionType(ir.VoidType(), [ir.DoubleType().as_pointer()])
    made = ir.Function(unit.module, kind, name)
    builder: Any = ir.IRBuilder(made.append_basic_block())
    (a,) = made.args
    failed, done = made.append_basic_block(), made.append_basic_block()
    kinds, values = _arguments(context, builder, box, a)
    what = f"function must be one that numba can compile, but {box.name} was not"
    compiled = _compiled(context, builder, box.function, kinds, what)
    value_type = compiled.signature.return_type
    put = _compiled(context, builder, store(value_type), [VALUES, value_type], what)
    status, value = _called(context, builder, compiled, values)
    _continue_if(builder, status.is_ok, failed)
    status, _ = _called(context, builder, put, [_array(context, builder, VALUES, a, box.total), value])
    context.nrt.decref(builder, value_type, value)
    builder.cbranch(status.is_ok, done, failed)
    builder.position_at_end(failed)
    with cgutils.for_range(builder, context.get_constant(types.intp, box.size)) as loop:
        place = builder.add(loop.index, context.get_constant(types.intp, box.inputs))
        builder.store(ir.Constant(ir.DoubleType(), float("nan")), builder.gep(a, [place]))
    address = context.add_dynamic_addr(builder, report, box.name)  # so that this code is not kept on disk
    builder.call(builder.bitcast(address, kind.as_pointer()), [a])
    builder.branch(done)
    builder.position_at_end(done)
    builder.ret_void()
    return made


def _continue_if(builder: Any, condition: Any, other: Any) -> None:
    """Go on in a new block under a condition, and else in another one."""
    following = builder.append_basic_block()
    builder.cbranch(condition, following, other)
    builder.position_at_end(following)


def _arguments(context: Any, builder: Any, box: BlackBox, a: Any) -> tuple[list[Any], list[Any]]:
    """The types and the values of all arguments of the function, in its order; others have their defaults."""
    given, named, place = list[Any](), dict[str, Any](), 0
    for keyword, length in box.arguments:
        start = builder.gep(a, [context.get_constant(types.intp, place)])
        pair = (
            (VALUES, _array(context, builder, VALUES, start, length))
            if length
            else (types.float64, builder.load(start))
        )
        if keyword:
            named[keyword] = pair
        else:
            given.append(pair)
        place += max(1, length)
    pairs = []
    for k, parameter in enumerate(
        inspect.signature(getattr(box.function, "py_func", box.function)).parameters.values()
    ):
        omitted = types.Omitted(parameter.default)
        unset = omitted, context.get_constant_undef(omitted)
        pairs.append(given[k] if k < len(given) else named.get(parameter.name, unset))
    return [kind for kind, _ in pairs], [value for _, value in pairs]


def _array(context: Any, builder: Any, kind: Any, start: Any, length: int) -> Any:
    """An array of doubles in memory."""
    made = context.make_array(kind)(context, builder)
    count, size = (context.get_constant(types.intp, value) for value in (length, 8))
    populate_array(made, data=start, shape=[count], strides=[size], itemsize=size, meminfo=None)
    return made._getvalue()


def _called(context: Any, builder: Any, compiled: Any, values: Sequence[Any]) -> tuple[Any, Any]:
    """Call a compiled function; gives its status and its value."""
    return context.call_internal_no_propagate(builder, compiled.fndesc, compiled.signature, values)


def _compiled(context: Any, builder: Any, function: Any, kinds: Sequence[Any], what: str) -> Any:
    """Compile a function for these types of arguments, and link it; a sentence begins with `what` if it cannot be."""
    flags = Flags()
    options = {**getattr(function, "targetoptions", PLAIN), "parallel": False}
    cpu_target.options.parse_as_flags(flags, options)
    plain = getattr(function, "py_func", function)
    try:
        return context.compile_subroutine(builder, plain, signature(None, *kinds), flags=flags, caching=False)
    except Exception as error:  # numba passes on those of others
        raise IntegratorError(f"{what}: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    """The reason why numba does not compile a function, in one line."""
    lines = (line.strip() for line in re.sub(r"\x1b\[[0-9;]*m", "", str(error)).splitlines())
    found = [line for line in lines if line and not line.startswith("Failed in nopython mode")]
    return shorten(found[0].rstrip("."), 200) if found else type(error).__name__
