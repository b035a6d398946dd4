"""Syntax trees of generated functions, and LLVM code of expressions and variables."""

# ruff: noqa: D102 (visit_X is documented by the class X in `ast`)
from __future__ import annotations

import ast
import builtins
import inspect
import linecache
import operator
from collections.abc import Callable, Sequence
from textwrap import dedent
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, Protocol, TypeAlias

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import _Intrinsic  # pyright: ignore[reportPrivateImportUsage]

from bseries_base.syntax_trees import compiled_tree, syntax_tree

if TYPE_CHECKING:
    from numba.core.cpu import CPUContext
    from numba.core.typing.context import BaseContext as TypingContext
    from numba.core.typing.templates import Signature

OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.LShift: operator.lshift,
    ast.RShift: operator.rshift, ast.BitOr: operator.or_, ast.BitAnd: operator.and_, ast.USub: operator.neg,
    ast.Not: operator.not_, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
}  # fmt: skip
EXTREMES: dict[object, Callable[..., bool]] = {max: operator.gt, min: operator.lt}
WHOLE, UNSIGNED = types.int64, types.uint64


def refuse(node: ast.AST, reason: str = "is not lowered") -> NoReturn:
    """Raise NotImplementedError for a construct that is not supported."""
    raise NotImplementedError(f"{ast.unparse(node)!r:.200} {reason}")


def tree_of(function: FunctionType) -> ast.FunctionDef:
    """The syntax tree of a function."""
    code = function.__code__
    lines = linecache.getlines(code.co_filename, function.__globals__)  # also of modules outside `sys.modules`
    parsed = syntax_tree(dedent("".join(inspect.getblock(lines[code.co_firstlineno - 1 :]))))
    tree = next(ast.iter_child_nodes(parsed))
    if not isinstance(tree, ast.FunctionDef):
        refuse(tree)
    tree.decorator_list = []
    compiled = compiled_tree(ast.Module([tree], [])).co_consts
    found = next(constant for constant in compiled if isinstance(constant, CodeType))
    if (found.co_code, found.co_names) != (code.co_code, code.co_names):
        raise NotImplementedError(
            f"{function.__name__} must be lowered from the file it was loaded from, which changed"
        )
    for node in ast.walk(tree):
        match node:
            case ast.For(orelse=[_, *_]) | ast.While(orelse=[_, *_]):
                refuse(node, "has an else")
            case ast.For(iter=loop) if not (isinstance(loop, ast.Call) and ast.unparse(loop.func) == "range"):
                refuse(node, "is over no range")
            case ast.Call(args=given, keywords=named) if named or any(isinstance(x, ast.Starred) for x in given):
                refuse(node, "has more than positional arguments")
            case ast.Call(func=called) if getattr(called, "id", None) in (None, *code.co_varnames):
                refuse(node, "calls a name that is no function of the module")
            case ast.Compare(ops=[_, _, *_]):
                refuse(node, "compares more than two")
    return tree


NumbaType: TypeAlias = Any  # a type or a signature, where numba's classes do not declare its attributes
Builder: TypeAlias = Any  # an `ir.IRBuilder`, whose decorators hide the arguments and results of its methods
Operand: TypeAlias = ir.NamedValue | ir.Constant
"""What instructions of LLVM take and give."""


class Value(NamedTuple):
    """A value in LLVM with its numba type."""

    type: types.Type
    llvm: Operand


class Written(NamedTuple):
    """A function of a module that writes its own code where it is called."""

    write: Callable[..., Value]  # of the unit, the builder and the arguments


class Functions(Protocol):
    """The functions that expressions call, in one module (see `units`)."""

    context: CPUContext
    typing: TypingContext

    def implementation(
        self, function: object, arguments: tuple[types.Type, ...]
    ) -> tuple[Signature, Callable[..., Operand]]:
        """Numba's signature and implementation of a function for these types of arguments."""
        ...

    def call(self, builder: ir.IRBuilder, function: FunctionType, values: Sequence[Value]) -> Value:
        """Call a Python function in LLVM."""
        ...


class Expressions(ast.NodeVisitor):
    """Writes the expressions in the body of a function.

    Names are variables in memory, which LLVM moves to registers. Each keeps the type of its first value, except that
    it may change between a pointer and a number. The `unit` (see `units`) provides the functions that they call.
    """

    def __init__(self, unit: Functions, made: ir.Function, function: FunctionType):
        self.unit, self.made = unit, made
        self.names, self.local = function.__globals__, frozenset(function.__code__.co_varnames)
        # memory for variables, then constants of the module, then everything else
        entry, constants, begin = self.block(), self.block(), self.block()
        self.constants, self.builder = ir.IRBuilder(constants), ir.IRBuilder(begin)
        self.jumps = (entry, constants), (constants, begin)
        self.variables: dict[str, Value] = {}

    def block(self) -> ir.Block:
        """A new block of instructions."""
        return self.made.append_basic_block()

    def generic_visit(self, node: ast.AST) -> NoReturn:
        refuse(node)

    def visit_Name(self, node: ast.Name) -> Value:
        known = self.variables.get(node.id)
        if known is None:
            if node.id in self.local:
                refuse(node, "is read before it is written")
            value = self._constant(self.known(node.id))
            place = cgutils.alloca_once(self.constants, value.llvm.type, name=node.id)
            self.constants.store(value.llvm, place)
            known = self.variables[node.id] = Value(value.type, place)
        return Value(known.type, self.builder.load(known.llvm))

    def visit_Constant(self, node: ast.Constant) -> Value:
        return self._constant(node.value)

    def visit_Attribute(self, node: ast.Attribute) -> Value:
        if not isinstance(node.value, ast.Name) or node.value.id in self.local:
            refuse(node)
        return self._constant(getattr(self.known(node.value.id), node.attr))

    def visit_Tuple(self, node: ast.Tuple) -> Value:
        items = self._items(node)
        kind: NumbaType = types.BaseTuple.from_types([item.type for item in items])
        return Value(kind, self.unit.context.make_tuple(self.builder, kind, [item.llvm for item in items]))

    def visit_Subscript(self, node: ast.Subscript) -> Value:
        array = self.visit(node.value)
        if not isinstance(array.type, types.CPointer):
            return self._call(operator.getitem, array, self.visit(node.slice))
        return Value(array.type.dtype, self.builder.load(self._place(array, node.slice)))

    def visit_BinOp(self, node: ast.BinOp) -> Value:
        return self._call(self._operator(node), self.visit(node.left), self.visit(node.right))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:
        return self._call(self._operator(node), self.visit(node.operand))

    def visit_Compare(self, node: ast.Compare) -> Value:
        (operation,), (right,) = node.ops, node.comparators
        if isinstance(operation, ast.In) and isinstance(right, ast.Tuple):
            return self.visit(ast.BoolOp(ast.Or(), [ast.Compare(node.left, [ast.Eq()], [x]) for x in right.elts]))
        if type(operation) not in OPERATORS:
            refuse(node)
        return self._call(OPERATORS[type(operation)], self.visit(node.left), self.visit(right))

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:
        first, *others = node.values
        for other in others:  # conditional expressions check the types
            yes, no = (other, ast.Constant(False)) if isinstance(node.op, ast.And) else (ast.Constant(True), other)
            first = ast.IfExp(first, yes, no)
        return self.visit(first)

    def visit_IfExp(self, node: ast.IfExp) -> Value:
        then, other, after = self.block(), self.block(), self.block()
        self.builder.cbranch(self._truth(node.test), then, other)
        ends = []
        for block, expression in ((then, node.body), (other, node.orelse)):
            self.builder.position_at_end(block)
            ends.append((self.visit(expression), self.builder.block))
            self.builder.branch(after)
        self.builder.position_at_end(after)
        (value, _), (another, _) = ends
        if value.type != another.type:
            refuse(node, f"is a {value.type} or a {another.type}")
        chosen = self.builder.phi(value.llvm.type)
        for end, block in ends:
            chosen.add_incoming(end.llvm, block)
        return Value(value.type, chosen)

    def visit_Call(self, node: ast.Call) -> Value:
        function = self.known(ast.unparse(node.func))
        arguments = [self.visit(x) for x in node.args]
        if isinstance(function, _Intrinsic):
            for k, x in enumerate(node.args):
                if isinstance(x, ast.Constant) and type(x.value) is int:  # it may need a literal number
                    arguments[k] = arguments[k]._replace(type=types.literal(x.value))
        if function in EXTREMES:
            if len({x.type for x in arguments}) > 1:
                refuse(node, "compares several types")
            chosen, *others = arguments
            for other in others:
                exceeds = self._call(EXTREMES[function], other, chosen).llvm
                chosen = Value(chosen.type, self.builder.select(exceeds, other.llvm, chosen.llvm))
            return chosen
        if isinstance(function, Written):
            return function.write(self.unit, self.builder, *arguments)
        if not isinstance(function, FunctionType):
            return self._call(function, *arguments)
        return self.unit.call(self.builder, function, arguments)

    def assign(self, name: str, value: Value) -> None:
        """Assign a value to a variable."""
        known = self.variables.get(name)
        if known is None or isinstance(known.type, types.CPointer) != isinstance(value.type, types.CPointer):
            place = cgutils.alloca_once(self.builder, value.llvm.type, name=name)
            known = self.variables[name] = Value(value.type, place)
        self.builder.store(self._kept(value, known.type), known.llvm)

    def _operator(self, node: ast.BinOp | ast.UnaryOp | ast.AugAssign) -> Callable[..., Any]:
        return OPERATORS[type(node.op)] if type(node.op) in OPERATORS else refuse(node)

    def _items(self, node: ast.expr) -> list[Value]:
        """The values of a tuple."""
        if isinstance(node, ast.Tuple):
            return [self.visit(x) for x in node.elts]
        value = self.visit(node)
        return [*map(Value, value.type.types, cgutils.unpack_tuple(self.builder, value.llvm))]

    def _place(self, pointer: Value, index: ast.expr) -> Operand:
        """The address of an entry."""
        return self.builder.gep(pointer.llvm, [self._cast(self.visit(index), WHOLE)])

    def _truth(self, node: ast.expr) -> Operand:
        value = self.visit(node)
        return self.unit.context.is_true(self.builder, value.type, value.llvm)

    def known(self, name: str) -> object:
        """The value of a name in the module."""
        return self.names[name] if name in self.names else getattr(builtins, name)

    def _constant(self, value: object) -> Value:
        kind = types.unliteral(self.unit.typing.resolve_value_type(value))
        return Value(kind, self.unit.context.get_constant_generic(self.constants, kind, value))

    def _call(self, function: object, *arguments: Value) -> Value:
        """Call a function of numba."""
        signature, call = self.unit.implementation(function, tuple(x.type for x in arguments))
        values = [self._cast(x, kind) for x, kind in zip(arguments, signature.args, strict=True)]
        return Value(types.unliteral(signature.return_type), call(self.builder, values))

    def _kept(self, value: Value, kind: types.Type) -> Operand:
        """Convert a value to the type of a variable that can hold it."""
        given = types.unliteral(value.type)
        if not _can_hold(kind, given):
            raise NotImplementedError(f"a {given} is no {kind}")
        return self._cast(value, kind)

    def _cast(self, value: Value, kind: types.Type) -> Operand:
        if value.type == kind:
            return value.llvm
        return self.unit.context.cast(self.builder, value.llvm, value.type, kind)


def _can_hold(kind: NumbaType, given: NumbaType) -> bool:
    """Whether a type can represent the values of another; integers become doubles, as in Python."""
    if kind == given:
        return True
    parts, others = getattr(kind, "types", None), getattr(given, "types", None)  # of tuples
    if parts is not None and others is not None:
        return len(parts) == len(others) and all(map(_can_hold, parts, others))
    if kind == types.float64:
        return given == types.boolean or given in types.number_domain
    if kind not in types.integer_domain or given not in types.integer_domain:
        return kind in types.integer_domain and given == types.boolean
    return given.signed <= kind.signed and given.bitwidth + (kind.signed > given.signed) <= kind.bitwidth
