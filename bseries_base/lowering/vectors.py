"""Vectorisation of loops over entries of arrays.

LLVM unrolls short loops before it vectorises, and then seldom finds vectors. In generated functions, arrays with
different names do not overlap, so that entries of different arrays are known to be independent. Scattered or indexed
entries become permutations of vectors if the arrays stay in registers.
"""

# ruff: noqa: D102 (visit_X is documented by the class X in `ast`)
from __future__ import annotations

import ast
from collections.abc import Callable
from functools import reduce
from typing import Any, NoReturn, TypeAlias

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from bseries_base.lowering import MOST_PERMUTED, WIDTH
from bseries_base.lowering.expressions import OPERATORS, WHOLE, Builder, Expressions, Operand, Value

WORD, INDEX, NUMBER = ir.IntType(64), ir.IntType(32), ir.DoubleType()
ALIGNMENT = 8
"""Alignment of vectors in bytes: a vector may begin at any double."""
OPERATIONS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
FUNCTIONS = {"sqrt": "llvm.sqrt", "abs": "llvm.fabs", "fma": "llvm.fma"}
FEWEST, MOST = 8, 64
"""Lengths of loops vectorised here; LLVM unrolls shorter ones and vectorises longer ones."""
FEWEST_PERMUTED = 4
"""Least length of loops with scattered or indexed entries."""
LONG = 80
"""Instructions per vector beyond which vectors are computed in a loop, whatever their number."""
LEAST = -(2**63)
"""The least integer of 64 bits, from which maxima start."""


Vector: TypeAlias = Any  # an operand that is a vector; llvmlite does not declare which type an operand has


class UnsuitedError(Exception):
    """Obstacle to the vectorisation of a loop."""


class VectorLoop(ast.NodeVisitor):
    """Vectorises a loop whose writes are affine in the index, or tabulated, and carry no dependence.

    The loop may also assign local variables, and compute maxima over all entries. Expressions in its body become
    vectors of doubles or integers.

    Attributes:
        vectors: The local variables of the loop.
        first, width: The counter of the first lane, and the number of lanes.
        names: The variables that the loop assigns.
        base: The counter of the first lane in LLVM, if the vectors are computed in a loop.
        read, written: Triples (array, index, counter) of the entries so far.
        is_permuted: Whether some entries are scattered or indexed.
        maxima: Addresses of maxima by variable and width.
    """

    def __init__(self, scalars: Expressions, node: ast.For, counter: str):
        self.scalars, self.node, self.counter = scalars, node, counter
        self.builder: Builder = scalars.builder
        parts = (part for statement in node.body for part in ast.walk(statement))
        self.names = {part.id for part in parts if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}
        self.first, self.width = 0, 0
        self.base: Operand | None = None
        self.vectors: dict[str, Vector] = {}
        self.is_permuted = False
        self.read: set[tuple[str, int, int]] = set()
        self.written: set[tuple[str, int, int]] = set()
        self.maxima: dict[tuple[str, int], Operand] = {}

    def visit_BinOp(self, node: ast.BinOp) -> Vector:
        name = OPERATIONS.get(type(node.op))
        left, right = self._numbers(node.left, node.right)
        if name is None:
            raise UnsuitedError
        return getattr(self.builder, name)(left, right)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Vector:
        if not isinstance(node.op, ast.USub):
            raise UnsuitedError
        return self.builder.fneg(*self._numbers(node.operand))

    def visit_Call(self, node: ast.Call) -> Vector:
        function = self.scalars.known(ast.unparse(node.func))
        name = getattr(function, "_name", getattr(function, "__name__", ""))  # intrinsics have the former
        if name == "bits":
            return self.builder.bitcast(*self._numbers(*node.args), ir.VectorType(WORD, self.width))
        if name == "max":
            values = [self.visit(x) for x in node.args]
            if any(value.type.element != WORD for value in values):
                raise UnsuitedError
            return reduce(self.larger, values)
        if name not in FUNCTIONS:
            raise UnsuitedError
        values = self._numbers(*node.args)
        return self.intrinsic(FUNCTIONS[name], values)

    def visit_Subscript(self, node: ast.Subscript) -> Vector:
        constants = self._constants(node.value, "f")
        if constants is not None:
            self.is_permuted = True  # a loop in LLVM would need a lookup
            numbers = [ir.Constant(NUMBER, float(constants[place])) for place in self._indices(node.slice)]
            return constant_vector(NUMBER, numbers)
        start, places, are_apart = self.noted(node, self.read)
        if not are_apart:
            return self.builder.load(self.vector_at(start, places[0]), align=ALIGNMENT)
        vector = ir.Constant(ir.VectorType(NUMBER, self.width), ir.Undefined)
        for lane, place in enumerate(places):
            number = self.builder.load(self.builder.gep(start, [ir.Constant(WORD, place)]))
            vector = self.builder.insert_element(vector, number, ir.Constant(INDEX, lane))
        return vector

    def visit_Name(self, node: ast.Name) -> Vector:
        if node.id in self.vectors:
            return self.vectors[node.id]
        if node.id in self.names or node.id == self.counter:  # a variable assigned later carries a dependence
            raise UnsuitedError
        value = self.scalars.visit(node)
        if value.type != types.float64:
            raise UnsuitedError
        nothing = ir.Constant(ir.VectorType(NUMBER, self.width), ir.Undefined)
        one = self.builder.insert_element(nothing, value.llvm, ir.Constant(INDEX, 0))
        return self.builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(INDEX, self.width), None))

    def visit_Constant(self, node: ast.Constant) -> Vector:
        kind = {float: NUMBER, int: WORD}.get(type(node.value))
        if kind is None:  # a truth value or text
            raise UnsuitedError
        return constant_vector(kind, [ir.Constant(kind, node.value)] * self.width)

    def generic_visit(self, node: ast.AST) -> NoReturn:
        raise UnsuitedError

    def _numbers(self, *nodes: ast.expr) -> list[Vector]:
        """The values of expressions that are doubles."""
        values = [self.visit(node) for node in nodes]
        if any(value.type.element != NUMBER for value in values):
            raise UnsuitedError
        return values

    def noted(self, node: ast.Subscript, entries: set[tuple[str, int, int]]) -> tuple[Operand, list[int], bool]:
        """Record accesses to an array; return its pointer, the indices, and whether they are scattered or indexed."""
        if not isinstance(node.value, ast.Name):
            raise UnsuitedError
        array = self.scalars.visit(node.value)
        if array.type != types.CPointer(types.float64):
            raise UnsuitedError
        places = self._indices(node.slice)
        entries.update((node.value.id, place, self.first + lane) for lane, place in enumerate(places))
        are_consecutive = places == [*range(places[0], places[0] + self.width)]
        are_apart = not are_consecutive or any(isinstance(part, ast.Subscript) for part in ast.walk(node.slice))
        self.is_permuted |= are_apart
        return array.llvm, places, are_apart

    def vector_at(self, start: Operand, place: int) -> Operand:
        index = ir.Constant(WORD, place)
        if self.base is not None:
            index = self.builder.add(self.base, ir.Constant(WORD, place - self.first))
        return self.builder.bitcast(self.builder.gep(start, [index]), ir.VectorType(NUMBER, self.width).as_pointer())

    def _indices(self, index: ast.expr) -> list[int]:
        return [self._index_at(index, self.first + lane) for lane in range(self.width)]

    def _index_at(self, index: ast.expr, counter: int) -> int:
        """The index for one value of the counter."""
        match index:
            case ast.Name(name) if name == self.counter:
                return counter
            case ast.Constant(int(number)):
                return number
            case ast.BinOp(left, ast.Add() | ast.Sub() | ast.Mult() as operation, right):
                return OPERATORS[type(operation)](self._index_at(left, counter), self._index_at(right, counter))
            case ast.Subscript(name, inner):
                table = self._constants(name, "i")
                if table is not None:
                    return int(table[self._index_at(inner, counter)])
        raise UnsuitedError

    def _constants(self, node: ast.expr, kind: str) -> np.ndarray | None:
        """The constant array of doubles (f) or integers (i) that a name denotes; None for other names."""
        if not isinstance(node, ast.Name) or node.id in self.scalars.local:
            return None
        found = self.scalars.names.get(node.id)
        return found if isinstance(found, np.ndarray) and (found.ndim, found.dtype.kind) == (1, kind) else None

    def larger(self, one: Vector, other: Vector) -> Operand:
        return self.builder.select(self.builder.icmp_signed(">", other, one), other, one)

    def intrinsic(self, name: str, values: list[Vector], result: ir.Type | None = None) -> Vector:
        kind = values[0].type
        made = ir.FunctionType(result or kind, [kind] * len(values))
        name = f"{name}.v{kind.count}{kind.element.intrinsic_name}"
        return self.builder.call(cgutils.get_or_insert_function(self.builder.module, made, name), values)

    def write(self) -> bool:
        """Write the loop if it can be vectorised; otherwise write nothing and return False."""
        bounds = _bounds(self.node.iter)
        if bounds is None or bounds[1] - bounds[0] < FEWEST_PERMUTED or self.counter in self.names:
            return False
        written: list[ir.Instruction] = self.builder.block.instructions
        before = len(written)
        try:
            self._vector(bounds[0], min(WIDTH, bounds[1] - bounds[0]))
            strategy = self._strategy(bounds[1] - bounds[0], len(written) - before)
            del written[before:]
            for key in self.maxima:
                self._begin_maximum(key)
            strategy(*bounds)
        except UnsuitedError:
            del written[before:]
            return False
        self._finish()
        self.scalars.assign(self.counter, Value(WHOLE, ir.Constant(WORD, bounds[1] - 1)))
        return True

    def _strategy(self, count: int, instructions: int) -> Callable[[int, int], None]:
        """The strategy for a number of entries and of instructions per vector."""
        if self.is_permuted:
            if count > MOST_PERMUTED:
                raise UnsuitedError
            return self._permuted
        shifts = {(name, place - counter) for name, place, counter in self.written}
        for array, shift in {(name, place - counter) for name, place, counter in self.read} | shifts:
            if any(array == name and 0 < abs(shift - other) < count for name, other in shifts):
                raise UnsuitedError  # a dependence between entries
        if instructions > LONG and count > 2 * WIDTH:
            return self._in_a_loop
        if not FEWEST <= count <= MOST:
            raise UnsuitedError
        return self._one_by_one

    def _one_by_one(self, first: int, end: int) -> None:
        """Write the vectors one by one."""
        while first < end:
            self._vector(first, min(WIDTH, end - first))
            first += self.width

    def _permuted(self, first: int, end: int) -> None:
        """Write the vectors one by one, if no entry depends on another."""
        self._one_by_one(first, end)
        writers = {(name, place): counter for name, place, counter in self.written}
        if any(writers.get((name, place), counter) != counter for name, place, counter in self.read | self.written):
            raise UnsuitedError

    def _in_a_loop(self, first: int, end: int) -> None:
        """Write a loop over all vectors but the last."""
        last = first + (end - first - 1) // WIDTH * WIDTH
        begin, stop, step = (ir.Constant(WORD, number) for number in (first, last, WIDTH))
        with cgutils.for_range_slice(self.builder, begin, stop, step, inc=True) as (self.base, _):
            self._vector(first, WIDTH)
        self.base = None
        self._vector(last, end - last)

    def _vector(self, first: int, width: int) -> None:
        """Write the statements for consecutive values of the counter."""
        self.first, self.width, self.vectors = first, width, {}
        for statement in self.node.body:
            self.visit(statement)

    def _finish(self) -> None:
        """Assign local variables their last values, and maxima over all entries."""
        for name, vector in self.vectors.items():
            last = self.builder.extract_element(vector, ir.Constant(INDEX, self.width - 1))
            self.scalars.assign(name, Value(WHOLE if last.type == WORD else types.float64, last))
        for (name, _), place in self.maxima.items():
            now, vector = self.scalars.visit(ast.Name(name)).llvm, self.builder.load(place)
            largest = self.intrinsic("llvm.vector.reduce.smax", [vector], WORD)
            self.scalars.assign(name, Value(WHOLE, self.larger(now, largest)))

    def visit_Assign(self, node: ast.Assign) -> None:
        target, *others = node.targets
        if others:
            raise UnsuitedError
        match target, node.value:
            case ast.Name(name), ast.Call(ast.Name("max"), [ast.Name(first), values]) if (
                first == name and name not in self.vectors
            ):
                self._take_maximum(target, values)
            case ast.Name(name), _ if any(name == other for other, _ in self.maxima):
                raise UnsuitedError
            case ast.Name(name), value:
                self.vectors[name] = self.visit(value)
            case _, value:
                self._store(target, self.visit(value))

    def _take_maximum(self, name: ast.Name, values: ast.expr) -> None:
        found = self.visit(values)
        if found.type.element != WORD or self.scalars.visit(name).type != WHOLE:
            raise UnsuitedError
        key = name.id, self.width
        if key not in self.maxima:
            self.maxima[key] = cgutils.alloca_once(self.builder, found.type)
            self._begin_maximum(key)
        place = self.maxima[key]
        self.builder.store(self.larger(self.builder.load(place), found), place)

    def _begin_maximum(self, key: tuple[str, int]) -> None:
        """Initialise a maximum."""
        self.builder.store(constant_vector(WORD, [ir.Constant(WORD, LEAST)] * key[1]), self.maxima[key])

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        target = node.target
        if not isinstance(target, ast.Subscript):
            raise UnsuitedError
        self._store(target, self.visit(ast.BinOp(target, node.op, node.value)))

    def _store(self, target: ast.expr, value: Vector) -> None:
        if not isinstance(target, ast.Subscript) or value.type.element != NUMBER:
            raise UnsuitedError
        start, places, are_apart = self.noted(target, self.written)
        if not are_apart:
            self.builder.store(value, self.vector_at(start, places[0]), align=ALIGNMENT)
            return
        for lane, place in enumerate(places):
            number = self.builder.extract_element(value, ir.Constant(INDEX, lane))
            self.builder.store(number, self.builder.gep(start, [ir.Constant(WORD, place)]))


def _bounds(node: ast.expr) -> tuple[int, int] | None:
    """The bounds of a range, if they are literal and there is no step."""
    match node:
        case ast.Call(ast.Name("range"), [ast.Constant(int(end))]):
            return 0, end
        case ast.Call(ast.Name("range"), [ast.Constant(int(first)), ast.Constant(int(end))]):
            return first, end
    return None


def constant_vector(kind: ir.Type, numbers: list[ir.Constant]) -> ir.Constant:
    """A vector of constants."""
    return ir.Constant(ir.VectorType(kind, len(numbers)), numbers)
