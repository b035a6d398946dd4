"""Loops over entries of arrays, written as operations on vectors.

LLVM unrolls a loop over few entries before it looks for vectors, and then seldom finds them. In generated functions
arrays of different names do not overlap, so that it is known here which loops can be written in vectors; entries that
lie apart, or are looked up in a table, become permutations of vectors wherever an array can stay in registers.
"""

# ruff: noqa: D102 (what visits a node is documented by the node's class in `ast`)
from __future__ import annotations

import ast
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from .expressions import WHOLE, Value

if TYPE_CHECKING:
    from .statements import Statements

FEWEST, MOST = 8, 128
"""Entries of a loop that is written in vectors; LLVM unrolls shorter ones, and sees to longer ones itself."""
FEWEST_PERMUTED = 4
"""Entries where some are looked up in a table, or lie apart."""
WIDTH = 8
"""Entries of a vector; a processor that has no such long ones takes several."""
WORD, INDEX, NUMBER = ir.IntType(64), ir.IntType(32), ir.DoubleType()
ALIGNMENT = 8
"""Bytes: a vector may begin at any double."""
OPERATIONS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
CALLS = {"sqrt": "llvm.sqrt", "abs": "llvm.fabs", "fma": "llvm.fma"}
"""What generated functions call by these names."""


class UnsuitedError(Exception):
    """Something in a loop that is not written in vectors."""


class VectorLoop(ast.NodeVisitor):
    """Writes a loop over entries.

    Its statements set entries of arrays, at the counter or so far from it, to values that depend on no other entry of
    these; or they set local variables; or they take a maximum over all entries.

    Args:
        scalars: Writes what does not depend on the counter.
        node: The loop.
    """

    def __init__(self, scalars: Statements, node: Any):
        self.scalars, self.node, self.counter = scalars, node, node.target.id
        self.builder: Any = scalars.builder
        names = (item for item in ast.walk(node) if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store))
        self.names = {item.id for item in names}
        self.local: dict[str, Any] = {}
        self.permutes = False  # until an entry is read or written that lies apart from the others
        self.maxima: dict[str, list[Any]] = {}
        self.read: set[tuple[str, int, int]] = set()
        self.written: set[tuple[str, int, int]] = set()

    def write(self) -> bool:
        """Write the loop, if it is one over entries; otherwise nothing is written."""
        bounds = _bounds(self.node.iter)
        if bounds is None or not FEWEST_PERMUTED <= bounds[1] - bounds[0] <= MOST:
            return False
        written: list[Any] = self.builder.block.instructions
        before = len(written)
        try:
            self._entries(*bounds)
        except UnsuitedError:
            del written[before:]
            return False
        self._end()
        self.scalars.assign(self.counter, Value(WHOLE, ir.Constant(WORD, bounds[1] - 1)))
        return True

    def _entries(self, first: int, end: int) -> None:
        few = end - first < FEWEST
        while first < end:
            self.first = first
            self.width = min(WIDTH, end - first)
            self.local = {}
            for statement in self.node.body:
                self.visit(statement)
            first += self.width
        if few and not self.permutes:
            raise UnsuitedError
        writers = {(name, place): counter for name, place, counter in self.written}
        if any(writers.get((name, place), counter) != counter for name, place, counter in self.read | self.written):
            raise UnsuitedError

    def _end(self) -> None:
        """Local variables are what they are for the last entry, and maxima are those of all entries."""
        for name, vector in self.local.items():
            last = self.builder.extract_element(vector, ir.Constant(INDEX, self.width - 1))
            self.scalars.assign(name, Value(WHOLE if last.type == WORD else types.float64, last))
        for name, vectors in self.maxima.items():
            largest = [self._across(reduce(self._larger, same)) for same in _of_same_width(vectors)]
            now = self.scalars.visit(ast.Name(name)).llvm
            self.scalars.assign(name, Value(WHOLE, reduce(self._larger, largest, now)))

    def visit_Assign(self, node: Any) -> None:
        (target,) = node.targets
        if not isinstance(target, ast.Name):
            self._store(target, self.visit(node.value))
        elif _is_maximum(node.value, target.id) and target.id not in self.local:
            self._take_maximum(target, node.value.args[1])
        elif target.id in self.maxima:
            raise UnsuitedError
        else:
            self.local[target.id] = self.visit(node.value)

    def _take_maximum(self, name: ast.Name, values: ast.expr) -> None:
        found = self.visit(values)
        if found.type.element != WORD or self.scalars.visit(name).type != WHOLE:
            raise UnsuitedError
        self.maxima.setdefault(name.id, []).append(found)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        target = node.target
        if not isinstance(target, ast.Subscript):
            raise UnsuitedError
        self._store(target, self.visit(ast.BinOp(target, node.op, node.value)))

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        name = OPERATIONS.get(type(node.op))
        left, right = self._numbers(node.left, node.right)
        if name is None:
            raise UnsuitedError
        return getattr(self.builder, name)(left, right)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        if not isinstance(node.op, ast.USub):
            raise UnsuitedError
        return self.builder.fneg(*self._numbers(node.operand))

    def visit_Call(self, node: ast.Call) -> Any:
        name = ast.unparse(node.func)
        if name == "bits":
            return self.builder.bitcast(*self._numbers(*node.args), ir.VectorType(WORD, self.width))
        if name == "max":
            values = [self.visit(x) for x in node.args]
            if any(value.type.element != WORD for value in values):
                raise UnsuitedError
            return reduce(self._larger, values)
        if name not in CALLS:
            raise UnsuitedError
        values = self._numbers(*node.args)
        return self._intrinsic(CALLS[name], values[0].type, values)

    def visit_Subscript(self, node: ast.Subscript) -> Any:
        constants = self._constants(node.value, "f")
        if constants is not None:
            numbers = [ir.Constant(NUMBER, float(constants[place])) for place in self._places(node.slice)]
            return _constant(NUMBER, numbers)
        start, places = self._noted(node, self.read)
        if _are_consecutive(places) and not _looks_up(node.slice):
            return self.builder.load(self._vector_at(start, places[0]), align=ALIGNMENT)
        self.permutes = True
        vector = ir.Constant(ir.VectorType(NUMBER, self.width), ir.Undefined)
        for lane, place in enumerate(places):
            number = self.builder.load(self.builder.gep(start, [ir.Constant(WORD, place)]))
            vector = self.builder.insert_element(vector, number, ir.Constant(INDEX, lane))
        return vector

    def visit_Name(self, node: ast.Name) -> Any:
        if node.id in self.local:
            return self.local[node.id]
        if node.id in self.names:  # the counter, or what depends on the entry before
            raise UnsuitedError
        value = self.scalars.visit(node)
        if value.type != types.float64:
            raise UnsuitedError
        return self._everywhere(value.llvm)

    def visit_Constant(self, node: ast.Constant) -> Any:
        kind = {float: NUMBER, int: WORD}.get(type(node.value))
        if kind is None:  # a truth value, or a text
            raise UnsuitedError
        return _constant(kind, [ir.Constant(kind, node.value)] * self.width)

    def generic_visit(self, node: ast.AST) -> Any:
        raise UnsuitedError

    def _numbers(self, *nodes: ast.expr) -> list[Any]:
        """The values of expressions that are doubles."""
        values = [self.visit(node) for node in nodes]
        if any(value.type.element != NUMBER for value in values):
            raise UnsuitedError
        return values

    def _store(self, target: ast.expr, value: Any) -> None:
        if not isinstance(target, ast.Subscript) or value.type.element != NUMBER:
            raise UnsuitedError
        start, places = self._noted(target, self.written)
        if _are_consecutive(places):
            self.builder.store(value, self._vector_at(start, places[0]), align=ALIGNMENT)
            return
        self.permutes = True
        for lane, place in enumerate(places):
            number = self.builder.extract_element(value, ir.Constant(INDEX, lane))
            self.builder.store(number, self.builder.gep(start, [ir.Constant(WORD, place)]))

    def _noted(self, node: ast.Subscript, entries: set[tuple[str, int, int]]) -> tuple[Any, list[int]]:
        """Where an array begins, and the places of the entries that are read or written, which are noted."""
        if not isinstance(node.value, ast.Name):
            raise UnsuitedError
        array = self.scalars.visit(node.value)
        if not isinstance(array.type, types.CPointer):
            raise UnsuitedError
        places = self._places(node.slice)
        entries.update((node.value.id, place, self.first + lane) for lane, place in enumerate(places))
        return array.llvm, places

    def _vector_at(self, start: Any, place: int) -> Any:
        kind = ir.VectorType(NUMBER, self.width)
        return self.builder.bitcast(self.builder.gep(start, [ir.Constant(WORD, place)]), kind.as_pointer())

    def _places(self, index: ast.expr) -> list[int]:
        return [self._place(index, self.first + lane) for lane in range(self.width)]

    def _place(self, index: ast.expr, counter: int) -> int:
        """An index, for one value of the counter."""
        match index:
            case ast.Name(name) if name == self.counter:
                return counter
            case ast.Constant(int(number)):
                return number
            case ast.BinOp(left, ast.Add(), right):
                return self._place(left, counter) + self._place(right, counter)
            case ast.BinOp(left, ast.Sub(), right):
                return self._place(left, counter) - self._place(right, counter)
            case ast.BinOp(left, ast.Mult(), right):
                return self._place(left, counter) * self._place(right, counter)
            case ast.Subscript(name, inner):
                table = self._constants(name, "i")
                if table is not None:
                    return int(table[self._place(inner, counter)])
        raise UnsuitedError

    def _constants(self, node: ast.expr, kind: str) -> np.ndarray | None:
        """The constant array of the module, of doubles (f) or integers (i), if the name is that of one."""
        if not isinstance(node, ast.Name) or node.id in self.scalars.local:
            return None
        found = self.scalars.names.get(node.id)
        return found if isinstance(found, np.ndarray) and (found.ndim, found.dtype.kind) == (1, kind) else None

    def _everywhere(self, number: Any) -> Any:
        """A vector of equal numbers."""
        nothing = ir.Constant(ir.VectorType(NUMBER, self.width), ir.Undefined)
        one = self.builder.insert_element(nothing, number, ir.Constant(INDEX, 0))
        return self.builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(INDEX, self.width), None))

    def _larger(self, one: Any, other: Any) -> Any:
        return self.builder.select(self.builder.icmp_signed(">", other, one), other, one)

    def _across(self, vector: Any) -> Any:
        """The largest entry of a vector."""
        return self._intrinsic("llvm.vector.reduce.smax", vector.type, [vector], WORD)

    def _intrinsic(self, name: str, kind: Any, values: list[Any], result: Any = None) -> Any:
        made = ir.FunctionType(result or kind, [kind] * len(values))
        name = f"{name}.v{kind.count}{kind.element.intrinsic_name}"
        return self.builder.call(cgutils.get_or_insert_function(self.builder.module, made, name), values)


def _bounds(node: ast.expr) -> tuple[int, int] | None:
    """The first number and the end of a range, if they are written out and there is no step."""
    match node:
        case ast.Call(ast.Name("range"), [ast.Constant(int(end))]):
            return 0, end
        case ast.Call(ast.Name("range"), [ast.Constant(int(first)), ast.Constant(int(end))]):
            return first, end
    return None


def _constant(kind: Any, numbers: list[Any]) -> Any:
    return ir.Constant(ir.VectorType(kind, len(numbers)), numbers)


def _looks_up(index: ast.expr) -> bool:
    return any(isinstance(part, ast.Subscript) for part in ast.walk(index))


def _are_consecutive(places: list[int]) -> bool:
    return places == [*range(places[0], places[0] + len(places))]


def _is_maximum(node: ast.expr, name: str) -> bool:
    """Whether a value is the larger one of a variable and another value."""
    match node:
        case ast.Call(ast.Name("max"), [ast.Name(first), _]):
            return first == name
    return False


def _of_same_width(vectors: list[Any]) -> list[list[Any]]:
    return [[x for x in vectors if x.type.count == width] for width in {x.type.count: None for x in vectors}]
