"""Object code of generated functions, compiled by numba's passes but outside its engine, which frees nothing."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache, partial
from types import FunctionType, MethodType
from typing import TYPE_CHECKING, Any, TypeAlias

from llvmlite import ir
from llvmlite.binding.ffi import ObjectRef
from numba.core.callconv import create_error_model
from numba.core.codegen import AOTCodeLibrary, JITCPUCodegen
from numba.core.compiler import Flags
from numba.core.compiler_lock import global_compiler_lock
from numba.core.environment import lookup_environment
from numba.core.registry import cpu_target
from numba.core.targetconfig import ConfigStack

from bseries_base.interrupts import outside_llvmlite
from bseries_base.lowering.units import Unit
from bseries_base.machine_code import FUNCTION, ObjectCode, c_address

if TYPE_CHECKING:
    from llvmlite.binding import ModuleRef
    from numba.core.typing.templates import Signature


Managers: TypeAlias = Any  # a pass manager, with other things in some versions of numba


class _Codegen(JITCPUCodegen):
    """Numba's optimisation and code for this processor, but no code in memory."""

    _library_class = AOTCodeLibrary

    def _add_module(self, module: ModuleRef) -> None:
        pass

    def _module_pass_manager(self, **options: object) -> Managers:
        return _freed(super()._module_pass_manager(**options))

    def _function_pass_manager(self, *module: ModuleRef, **options: object) -> Managers:  # old versions take one
        return _freed(super()._function_pass_manager(*module, **options))


def _freed(made: Managers) -> Managers:
    """Let a pass manager free its memory, 0.3 MB in all for a step; some versions of llvmlite do not."""
    manager = made[0] if isinstance(made, tuple) else made
    classes = (kind for kind in type(manager).__mro__ if kind is not ObjectRef and "_dispose" in vars(kind))
    manager._dispose = MethodType(vars(next(classes))["_dispose"], manager)
    return made


@cache
def _codegen() -> _Codegen:
    return _Codegen("objects")


def object_code(function: FunctionType, signature: Signature, **options: object) -> ObjectCode:
    """Compile a generated function to a C function.

    Args:
        function: The function; its source must be available.
        signature: Numba's types of the result and of the arguments.
        **options: Options of numba.
    """
    return written_code(partial(_write, function, signature), function.__name__, **options)


@outside_llvmlite()
@global_compiler_lock
def written_code(write: Callable[[Unit], None], name: str, **options: object) -> ObjectCode:
    """Compile the C function `FUNCTION` that `write` puts into an empty module, with options of numba."""
    typing: Any = cpu_target.typing_context
    target: Any = cpu_target.target_context
    flags = Flags()
    cpu_target.options.parse_as_flags(flags, options)
    typing.refresh()
    target.refresh()
    model = create_error_model(flags.error_model, target)
    context = target.subtarget(
        _internal_codegen=_codegen(), enable_nrt=True, error_model=model, fastmath=flags.fastmath
    )
    library = _codegen().create_library(name)
    module = library.create_ir_module(name)
    with ConfigStack().enter(flags), context.push_code_library(library):
        write(Unit(context, typing, module))
        context.post_lowering(module, library)
    library.add_ir_module(module)
    library.finalize()
    made = library.get_function(FUNCTION).module
    symbols = None if library.has_dynamic_globals else _symbols(made)
    if symbols is not None:
        return ObjectCode(symbols, library.emit_native_object())
    names = [variable.name for variable in made.global_variables]
    objects = {name: value for name in names if (value := lookup_environment(name)) is not None}
    return ObjectCode((), library.emit_native_object(), is_lasting=False, objects=objects)


def _write(function: FunctionType, signature: Signature, unit: Unit) -> None:
    """Write a function, and one that calls it by the conventions of C."""
    result, *arguments = map(unit.context.get_value_type, (signature.return_type, *signature.args))
    made = ir.Function(unit.module, ir.FunctionType(result, arguments), FUNCTION)
    builder = ir.IRBuilder(made.append_basic_block())
    inner, kind = unit.function(function, signature.args, signature.return_type)
    unit.inline_vector_functions()
    _, value = unit.context.call_conv.call_function(builder, inner, kind, signature.args, made.args)
    builder.ret(value)  # 0 after an error


def _symbols(module: ModuleRef) -> list[str] | None:
    """The functions of the C library that a module calls; None if it needs more, as functions of the user do."""
    if any(variable.is_declaration for variable in module.global_variables):
        return None
    found = set()
    for name in (function.name for function in module.functions if function.is_declaration):
        intrinsic = re.match(r"llvm\.(\w+)", name)  # the processor's, or else the C library's
        try:
            c_address(intrinsic[1] if intrinsic else name)
        except AttributeError:
            if not intrinsic:
                return None
        else:
            found.add(intrinsic[1] if intrinsic else name)
    return sorted(found)
