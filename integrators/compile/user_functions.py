"""Observers and black boxes: functions of the user in machine code that is freed with its last user.

Numba's own engine frees nothing: each function would take 0.9 MB for ever.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.compiler import Flags
from numba.core.registry import cpu_target
from numba.core.typing.templates import signature
from numba.np.arrayobj import populate_array

from bseries_base.errors import shorten
from bseries_base.lowering.expressions import Builder, Operand, Value
from bseries_base.lowering.objects import written_code
from bseries_base.lowering.units import Unit
from bseries_base.machine_code import FUNCTION, MachineCode
from integrators.core.errors import IntegratorError
from integrators.scenes.model.black_boxes import BlackBox

if TYPE_CHECKING:
    from numba.core.callconv import Status
    from numba.core.compiler import CompileResult

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


class _Calls:
    """Writes calls of functions of the user into a new function ``void name(...)`` of a module."""

    def __init__(self, unit: Unit, kind: ir.FunctionType, name: str):
        self.context, self.made = unit.context, ir.Function(unit.module, kind, name)
        self.builder: Builder = ir.IRBuilder(self.made.append_basic_block())

    def number(self, value: int) -> Operand:
        """A constant integer."""
        return self.context.get_constant(types.intp, value)

    def array(self, kind: types.Array, start: Operand, length: int) -> Operand:
        """An array of doubles in memory."""
        made = self.context.make_array(kind)(self.context, self.builder)
        shape, strides = [self.number(length)], [self.number(8)]
        populate_array(made, data=start, shape=shape, strides=strides, itemsize=strides[0], meminfo=None)
        return made._getvalue()

    def compiled(self, function: object, kinds: Sequence[types.Type], what: str) -> CompileResult:
        """Compile and link a function for these types of arguments; a sentence begins with `what` if it cannot be."""
        flags = Flags()
        options = {**getattr(function, "targetoptions", PLAIN), "parallel": False}
        cpu_target.options.parse_as_flags(flags, options)
        plain = getattr(function, "py_func", function)
        try:
            return self.context.compile_subroutine(
                self.builder, plain, signature(None, *kinds), flags=flags, caching=False
            )
        except Exception as error:  # numba passes on those of others
            raise IntegratorError(f"{what}: {_reason(error)}") from None

    def call(self, compiled: CompileResult, values: Sequence[Operand]) -> tuple[Status, Operand]:
        """Call a compiled function; gives its status and its value."""
        return self.context.call_internal_no_propagate(self.builder, compiled.fndesc, compiled.signature, values)

    def go_on_if(self, condition: Operand, other: ir.Block) -> None:
        """Go on in a new block under a condition, and else in another one."""
        following = self.made.append_basic_block()
        self.builder.cbranch(condition, following, other)
        self.builder.position_at_end(following)


def _write(functions: Mapping[int, tuple[str, object]], dimension: int, formulas: int, unit: Unit) -> None:
    """Write the observer."""
    double = ir.DoubleType()
    kind = ir.FunctionType(ir.VoidType(), [double, double.as_pointer(), double.as_pointer()])
    calls = _Calls(unit, kind, FUNCTION)
    builder = calls.builder
    t, y, out = calls.made.args
    state = calls.array(STATE, y, dimension)
    for k, (name, function) in functions.items():
        what = f"observe must have functions of (t, y) that numba can compile, but {shorten(name)} was not"
        compiled = calls.compiled(function, [types.float64, STATE], what)
        given = compiled.signature.return_type
        if not isinstance(given, types.Float | types.Integer | types.Boolean):
            raise IntegratorError(
                f"observe must have functions whose value is a number, but that of {shorten(name)} is {given}"
            )
        status, value = calls.call(compiled, [t, state])
        with cgutils.if_likely(builder, status.is_ok):
            number = unit.context.cast(builder, value, given, types.float64)
            builder.store(number, builder.gep(out, [calls.number(k)]))
    if formulas:
        builder.call(builder.inttoptr(calls.number(formulas), kind.as_pointer()), calls.made.args)
    builder.ret_void()


Store: TypeAlias = Callable[[types.Type], Callable[..., None]]
"""Gives a function of Python that stores values of a type of numba behind the arguments of a black box."""


def write_call(box: BlackBox, store: Store, report: int, unit: Unit, builder: Builder, a: Value) -> Value:
    """Write a call of a black box, whose code becomes a part of the module."""
    name = f"box_{box.key}"
    made = unit.module.globals.get(name)
    if made is None:
        made = write_values(box, store, report, name, unit)
        made.linkage = "internal"
    builder.call(made, [a.llvm])
    return Value(types.none, unit.context.get_dummy_value())


def write_values(box: BlackBox, store: Store, report: int, name: str, unit: Unit) -> ir.Function:
    """Write ``void name(double *a)``, which puts the values of a black box after its arguments.

    Args:
        box: The black box.
        store: Gives the function that stores its value.
        report: The address of a C function of the same array, which is called after an error.
        name: The name of the function.
        unit: The module.
    """
    context = unit.context
    kind = ir.FunctionType(ir.VoidType(), [ir.DoubleType().as_pointer()])
    calls = _Calls(unit, kind, name)
    builder = calls.builder
    (a,) = calls.made.args
    failed, done = calls.made.append_basic_block(), calls.made.append_basic_block()
    arguments = _arguments(calls, box, a)
    what = f"function must be one that numba can compile, but {box.name} was not"
    compiled = calls.compiled(box.function, [x.type for x in arguments], what)
    value_type = compiled.signature.return_type
    put = calls.compiled(store(value_type), [VALUES, value_type], what)
    status, value = calls.call(compiled, [x.llvm for x in arguments])
    calls.go_on_if(status.is_ok, failed)
    status, _ = calls.call(put, [calls.array(VALUES, a, box.total), value])
    context.nrt.decref(builder, value_type, value)
    builder.cbranch(status.is_ok, done, failed)
    builder.position_at_end(failed)
    with cgutils.for_range(builder, calls.number(box.size)) as loop:
        place = builder.add(loop.index, calls.number(box.inputs))
        builder.store(ir.Constant(ir.DoubleType(), float("nan")), builder.gep(a, [place]))
    address = context.add_dynamic_addr(builder, report, box.name)  # so that this code is not kept on disk
    builder.call(builder.bitcast(address, kind.as_pointer()), [a])
    builder.branch(done)
    builder.position_at_end(done)
    builder.ret_void()
    return calls.made


def _arguments(calls: _Calls, box: BlackBox, a: Operand) -> list[Value]:
    """All arguments of the function, in its order; others have their defaults."""

    def read(place: int, length: int) -> Value:
        start = calls.builder.gep(a, [calls.number(place)])
        return (
            Value(VALUES, calls.array(VALUES, start, length))
            if length
            else Value(types.float64, calls.builder.load(start))
        )

    given, named = box.bound(read)
    found = []
    parameters = inspect.signature(getattr(box.function, "py_func", box.function)).parameters
    for k, parameter in enumerate(parameters.values()):
        omitted = types.Omitted(parameter.default)
        unset = Value(omitted, calls.context.get_constant_undef(omitted))
        found.append(given[k] if k < len(given) else named.get(parameter.name, unset))
    return found


def _reason(error: Exception) -> str:
    """The reason why numba does not compile a function, in one line."""
    lines = (line.strip() for line in re.sub(r"\x1b\[[0-9;]*m", "", str(error)).splitlines())
    found = [line for line in lines if line and not line.startswith("Failed in nopython mode")]
    return shorten(found[0].rstrip("."), 200) if found else type(error).__name__
