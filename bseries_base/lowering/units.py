"""LLVM code of statements and functions, and the decorator for generated functions."""

# ruff: noqa: D102 (visit_X is documented by the class X in `ast`)
from __future__ import annotations

import ast
import inspect
import operator
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from types import FunctionType
from typing import TYPE_CHECKING, Any

from llvmlite import ir
from llvmlite.ir.instructions import AllocaInstr
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from bseries_base.lowering.expressions import (
    UNSIGNED,
    WHOLE,
    Builder,
    Expressions,
    Functions,
    NumbaType,
    Operand,
    Value,
    refuse,
    tree_of,
)
from bseries_base.lowering.vectors import VectorLoop

if TYPE_CHECKING:
    from numba.core.cpu import CPUContext
    from numba.core.typing.context import BaseContext as TypingContext
    from numba.core.typing.templates import Signature

MOST_COPIED = 20_000
"""Most instructions in all inlined copies of a function, before LLVM unrolls its loops."""
MOST_STACK = 8192
"""Most doubles in the arrays of all inlined copies, which do not share memory on the stack."""


class Statements(Expressions):
    """Writes the body of a function."""

    def __init__(self, unit: Functions, made: ir.Function, function: FunctionType, result: types.Type):
        super().__init__(unit, made, function)
        self.result = result
        self.loops: list[tuple[ir.Block, ir.Block]] = []
        self.has_vectors = False

    def write(self, tree: ast.FunctionDef, arguments: Sequence[types.Type]) -> None:
        """Write the whole function."""
        context = self.unit.context
        values = context.get_arg_packer(arguments).from_arguments(
            self.builder, context.call_conv.get_arguments(self.made)
        )
        for argument, kind, value in zip(tree.args.args, arguments, values, strict=True):
            self.assign(argument.arg, Value(kind, value))
        self._write(tree.body)
        if not self._has_ended() and self.result is types.none:
            self._return(context.get_dummy_value())
        elif not self._has_ended():  # every path has returned
            self.builder.unreachable()
        for block, following in self.jumps:
            ir.IRBuilder(block).branch(following)

    def _write(self, statements: Iterable[ast.stmt]) -> None:
        for statement in statements:
            if not self._has_ended():
                self.visit(statement)

    def visit_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):  # a docstring
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        if len(node.targets) == 1 and isinstance(node.targets[0], ast.Tuple):
            for item, value in zip(node.targets[0].elts, self._items(node.value), strict=True):
                self._store(item, value)
            return
        value = self.visit(node.value)
        for target in node.targets:
            if isinstance(target, ast.Tuple):
                refuse(node)
            self._store(target, value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        now = self.visit(node.target)
        self._store(node.target, self._call(self._operator(node), now, self.visit(node.value)))

    def visit_Return(self, node: ast.Return) -> None:
        if node.value is None:
            refuse(node)
        self._return(self._kept(self.visit(node.value), self.result))

    def _return(self, value: Operand) -> None:
        context = self.unit.context
        context.call_conv.return_value(self.builder, context.get_return_value(self.builder, self.result, value))

    def visit_Break(self, node: ast.Break) -> None:
        self.builder.branch(self.loops[-1][1])

    def visit_Continue(self, node: ast.Continue) -> None:
        self.builder.branch(self.loops[-1][0])

    def visit_If(self, node: ast.If) -> None:
        then, other, after = self.block(), self.block(), self.block()
        self.builder.cbranch(self._truth(node.test), then, other)
        for block, statements in ((then, node.body), (other, node.orelse)):
            self.builder.position_at_end(block)
            self._write(statements)
            self._go_on(after)
        self.builder.position_at_end(after)

    def visit_While(self, node: ast.While) -> None:
        head, body, after = self.block(), self.block(), self.block()
        self.builder.branch(head)
        self.builder.position_at_end(head)
        self.builder.cbranch(self._truth(node.test), body, after)
        self._loop(node.body, body, head, after)

    def visit_For(self, node: ast.For) -> None:
        if not isinstance(node.iter, ast.Call) or not isinstance(node.target, ast.Name):
            refuse(node)
        if VectorLoop(self, node, node.target.id).write():
            self.has_vectors = True
            return
        bounds = [self.visit(x) for x in node.iter.args[:2]]
        step = ast.literal_eval(node.iter.args[2]) if len(node.iter.args) == 3 else 1
        kinds = {bound.type for bound in bounds}
        if not kinds <= {WHOLE} and (not kinds <= {UNSIGNED} or step < 0):
            refuse(node.iter, "goes through several types, or down where nothing is below 0")
        kind = min(kinds, key=str)
        first, end = [self._constant(0), *bounds][-2:]
        last = self._cast(end, kind)
        head, body, after, following = self.block(), self.block(), self.block(), self.block()
        counter = cgutils.alloca_once(self.builder, ir.IntType(64))
        self.builder.store(self._cast(first, kind), counter)
        self.builder.branch(head)
        self.builder.position_at_end(head)
        now = self.builder.load(counter)
        compare = self.builder.icmp_signed if kind == WHOLE else self.builder.icmp_unsigned
        self.builder.cbranch(compare("<" if step > 0 else ">", now, last), body, after)
        self.builder.position_at_end(body)
        self.assign(node.target.id, Value(kind, now))
        self._loop(node.body, body, following, after)
        self.builder.position_at_end(following)
        flags = ["nsw" if kind == WHOLE else "nuw"]
        builder: Builder = self.builder
        builder.store(builder.add(now, ir.Constant(ir.IntType(64), step), flags=flags), counter)
        self.builder.branch(head)
        self.builder.position_at_end(after)

    def _loop(self, statements: Iterable[ast.stmt], body: ir.Block, following: ir.Block, after: ir.Block) -> None:
        """The body of a loop; `continue` leads to the block `following`, and `break` to `after`."""
        self.builder.position_at_end(body)
        self.loops.append((following, after))
        self._write(statements)
        self._go_on(following)
        self.loops.pop()
        self.builder.position_at_end(after)

    def _go_on(self, block: ir.Block) -> None:
        """Branch to a block, unless the present block has ended."""
        if not self._has_ended():
            self.builder.branch(block)

    def _has_ended(self) -> bool:
        block = self.builder.block
        return block is not None and block.is_terminated

    def _store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self.assign(target.id, value)
            return
        if not isinstance(target, ast.Subscript):
            refuse(target)
        array = self.visit(target.value)
        if not isinstance(array.type, types.CPointer):
            self._call(operator.setitem, array, self.visit(target.slice), value)
            return
        kind = array.type.dtype
        are_whole = kind in types.integer_domain and value.type in types.integer_domain  # arrays may be narrower
        number = self._cast(value, kind) if are_whole else self._kept(value, kind)
        self.builder.store(number, self._place(array, target.slice))


class Unit:
    """Functions in one LLVM module, and those of numba that they call, each looked up once for its argument types."""

    def __init__(self, context: CPUContext, typing: TypingContext, module: ir.Module):
        self.context, self.typing, self.module = context, typing, module
        self._known: dict[Hashable, tuple[Signature, Callable[..., Operand]]] = {}
        self._functions: dict[Hashable, tuple[ir.Function, types.Type]] = {}
        self._calls: Counter[ir.Function] = Counter()
        self._in_vectors: list[ir.Function] = []

    def implementation(
        self, function: object, arguments: tuple[types.Type, ...]
    ) -> tuple[Signature, Callable[..., Operand]]:
        """Numba's signature and implementation of a function for these types of arguments."""
        key = function, arguments
        if key not in self._known:
            kind = self.typing.resolve_value_type(function)
            signature: NumbaType = self.typing.resolve_function_type(kind, arguments, {})
            self._known[key] = signature, self.context.get_function(kind, signature)
        return self._known[key]

    def function(
        self, function: FunctionType, arguments: tuple[types.Type, ...], result: types.Type | None = None
    ) -> tuple[ir.Function, types.Type]:
        """The LLVM function of a Python function, and the type of its result.

        The result is by default a double, an integer if the function says so, or none if it returns nothing; its source
        must be available.
        """
        key = function, arguments, result
        if key not in self._functions:
            tree = tree_of(function)
            gives = any(isinstance(node, ast.Return) for node in ast.walk(tree))
            number = types.int64 if function.__annotations__.get("return") in (int, "int") else types.float64
            result = result or (number if gives else types.none)
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

    def inline_vector_functions(self) -> None:
        """Mark functions with vectors for inlining unless they are too long, so that vectors stay in registers."""
        for made in self._in_vectors:
            instructions = [line for block in made.blocks for line in block.instructions]
            arrays = [line.operands for line in instructions if isinstance(line, AllocaInstr)]
            stack = sum(operands[0].constant if operands else 1 for operands in arrays)
            if self._calls[made] * len(instructions) <= MOST_COPIED and self._calls[made] * stack <= MOST_STACK:
                made.attributes.add("alwaysinline")

    def call(
        self, builder: ir.IRBuilder, function: FunctionType, values: Sequence[Value], result: types.Type | None = None
    ) -> Value:
        """Call a Python function in LLVM."""
        kinds = tuple(value.type for value in values)
        made, result = self.function(function, kinds, result)
        self._calls[made] += 1
        convention = self.context.call_conv
        status, value = convention.call_function(builder, made, result, kinds, [value.llvm for value in values])
        with cgutils.if_unlikely(builder, status.is_error):  # raised only by functions of numba
            convention.return_status_propagate(builder, status)
        return Value(result, value)


def lowered(signature: Signature | None = None) -> Callable[[FunctionType], Any]:
    """Turn a generated function into an intrinsic that functions compiled by numba can call.

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

    def made(function: FunctionType) -> Any:
        def typed(typing: TypingContext, *arguments: types.Type) -> tuple[Signature, Callable[..., Operand]]:
            def codegen(
                context: CPUContext, builder: ir.IRBuilder, signature: Signature, values: Sequence[Operand]
            ) -> Operand:
                unit = Unit(context, typing, builder.module)
                arguments = [Value(*pair) for pair in zip(signature.args, values, strict=True)]
                value = unit.call(builder, function, arguments, signature.return_type).llvm
                unit.inline_vector_functions()
                return value

            return signature or types.none(*arguments), codegen

        (first, *_), names = inspect.signature(typed).parameters.values(), inspect.signature(function).parameters
        typed.__name__ = function.__name__
        typed.__signature__ = inspect.Signature([first, *names.values()])  # type: ignore[attr-defined]
        return intrinsic(typed)

    return made
