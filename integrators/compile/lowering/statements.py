"""Statements of generated functions in LLVM."""

# ruff: noqa: D102 (what visits a node is documented by the node's class in `ast`)
from __future__ import annotations

import ast
import operator
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from integrators.compile.lowering.expressions import UNSIGNED, WHOLE, Expressions, Value
from integrators.compile.lowering.syntax import refuse
from integrators.compile.lowering.vectors import VectorLoop

if TYPE_CHECKING:
    from integrators.compile.lowering.units import Unit


class Statements(Expressions):
    """Writes the body of a function.

    Args:
        unit: The functions that this one belongs to.
        made: The function in LLVM.
        function: The function of Python.
        result: The type of the function's value.
    """

    def __init__(self, unit: Unit, made: Any, function: Any, result: Any):
        super().__init__(unit, made, function)
        self.result = result
        self.loops: list[tuple[Any, Any]] = []
        self.has_vectors = False

    def write(self, tree: ast.FunctionDef, arguments: Sequence[Any]) -> None:
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
        elif not self._has_ended():  # all that comes here has returned
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

    def _return(self, value: Any) -> None:
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
        if VectorLoop(self, node).write():
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
        builder: Any = self.builder
        flags = ["nsw" if kind == WHOLE else "nuw"]
        builder.store(builder.add(now, ir.Constant(ir.IntType(64), step), flags=flags), counter)
        self.builder.branch(head)
        self.builder.position_at_end(after)

    def _loop(self, statements: Iterable[ast.stmt], body: Any, following: Any, after: Any) -> None:
        """The body of a loop, with the blocks that continue and break lead to; the last is the one to go on with."""
        self.builder.position_at_end(body)
        self.loops.append((following, after))
        self._write(statements)
        self._go_on(following)
        self.loops.pop()
        self.builder.position_at_end(after)

    def _go_on(self, block: Any) -> None:
        """Go to a block, unless break, continue or return have left this one."""
        if not self._has_ended():
            self.builder.branch(block)

    def _has_ended(self) -> bool:
        block: Any = self.builder.block
        return block.is_terminated

    def _store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self.assign(target.id, value)
            return
        if not isinstance(target, ast.Subscript):
            refuse(target)
        array = self.visit(target.value)
        if not isinstance(array.type, types.CPointer):
            self._call(operator.setitem, array, self.visit(target.slice), value)
        else:
            self.builder.store(self._kept(value, array.type.dtype), self._place(array, target.slice))

    def assign(self, name: str, value: Value) -> None:
        """Give a variable a value."""
        known = self.variables.get(name)
        if known is None or isinstance(known.type, types.CPointer) != isinstance(value.type, types.CPointer):
            place = cgutils.alloca_once(self.builder, value.llvm.type, name=name)
            known = self.variables[name] = Value(value.type, place)
        self.builder.store(self._kept(value, known.type), known.llvm)
