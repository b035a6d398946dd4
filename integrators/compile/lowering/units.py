"""Functions in LLVM that call one another, and what they call of numba's."""

from __future__ import annotations

import ast
import inspect
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from llvmlite.ir.instructions import AllocaInstr
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from integrators.compile.lowering.expressions import Value
from integrators.compile.lowering.statements import Statements
from integrators.compile.lowering.syntax import tree_of

MOST_COPIED = 20_000
"""Instructions of all copies of a function, before LLVM unrolls its loops."""
MOST_STACK = 8192
"""Doubles in the arrays of all copies: they do not share their memory, and the stack of a thread may be small."""


class Unit:
    """Functions that go to one LLVM module.

    Args:
        context: Numba's target.
        typing: Numba's signatures.
        module: The LLVM module.
    """

    def __init__(self, context: Any, typing: Any, module: Any):
        self.context, self.typing, self.module = context, typing, module
        self._functions: dict[Any, tuple[Any, Any]] = {}
        self._calls: Counter[Any] = Counter()
        self._in_vectors: list[Any] = []
        self._known: dict[Any, tuple[Any, Any]] = {}

    def function(self, function: Any, arguments: tuple[Any, ...], result: Any = None) -> tuple[Any, Any]:
        """A function of Python in LLVM, and the type of its value.

        Args:
            function: The function, whose source can be had.
            arguments: The types of its arguments.
            result: The type of its value; by default a double, or nothing if it returns nothing.
        """
        key = function, arguments, result
        if key not in self._functions:
            tree = tree_of(function)
            gives = any(isinstance(node, ast.Return) for node in ast.walk(tree))
            result = result or (types.float64 if gives else types.none)
            convention = self.context.call_conv
            kind = convention.get_function_type(result, arguments)
            made = ir.Function(self.module, kind, self.module.get_unique_name(function.__name__))
            made.linkage = "internal"
            convention.decorate_function(made, list(inspect.signature(function).parameters), arguments)
            self._functions[key] = made, result
            statements = Statements(self, made, function, result)
            statements.write(tree, arguments)
            if statements.has_vectors:
                self._in_vectors.append(made)
        return self._functions[key]

    def settle(self) -> None:
        """All functions are written: those with vectors are copied to where they are called, if they are short enough.

        The vectors that they read and write can then stay in registers; LLVM would copy short functions only.
        """
        for made in self._in_vectors:
            instructions = [line for block in made.blocks for line in block.instructions]
            stack = sum(map(_entries, instructions))
            if self._calls[made] * len(instructions) <= MOST_COPIED and self._calls[made] * stack <= MOST_STACK:
                made.attributes.add("alwaysinline")

    def implementation(self, function: Any, arguments: tuple[Any, ...]) -> tuple[Any, Any]:
        """Numba's signature of a function for these types of arguments, and what calls it with a builder and values."""
        key = function, arguments
        if key not in self._known:
            kind = self.typing.resolve_value_type(function)
            signature = self.typing.resolve_function_type(kind, arguments, {})
            self._known[key] = signature, self.context.get_function(kind, signature)
        return self._known[key]

    def call(self, builder: Any, function: Any, values: Sequence[Value], result: Any = None) -> Value:
        """Call a function of Python in LLVM."""
        kinds = tuple(value.type for value in values)
        made, result = self.function(function, kinds, result)
        self._calls[made] += 1
        convention = self.context.call_conv
        status, value = convention.call_function(builder, made, result, kinds, [value.llvm for value in values])
        with cgutils.if_unlikely(builder, status.is_error):  # nothing raises but what numba has been told to let raise
            convention.return_status_propagate(builder, status)
        return Value(result, value)


def _entries(instruction: Any) -> int:
    """How many entries an instruction makes room for on the stack."""
    if not isinstance(instruction, AllocaInstr):
        return 0
    return instruction.operands[0].constant if instruction.operands else 1


def lowered(signature: Any = None) -> Callable[[Any], Any]:
    """A generated function as an intrinsic, which functions that numba compiles can call.

    Args:
        signature: The types of its value and of its arguments; by default it returns nothing, and its arguments are of
            any types.

    Example:
        >>> from numba import njit, types
        >>> @lowered(types.float64(types.float64, types.int64))
        ... def power(x, n):
        ...     product = 1.0
        ...     for _ in range(n):
        ...         product *= x
        ...     return product
        >>> @njit
        ... def cube(x):
        ...     return power(x, 3)
        >>> cube(2.0)
        8.0
    """

    def made(function: Any) -> Any:
        def typed(typing: Any, *arguments: Any) -> Any:
            def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
                unit = Unit(context, typing, builder.module)
                arguments = [Value(*pair) for pair in zip(signature.args, values, strict=True)]
                value = unit.call(builder, function, arguments, signature.return_type).llvm
                unit.settle()
                return value

            return signature or types.none(*arguments), codegen

        (first, *_), names = inspect.signature(typed).parameters.values(), inspect.signature(function).parameters
        typed.__name__ = function.__name__
        typed.__signature__ = inspect.Signature([first, *names.values()])  # type: ignore[attr-defined]
        return intrinsic(typed)

    return made
