"""Loops over entries of arrays, written as operations on vectors.

LLVM unrolls a loop over few entries before it looks for vectors, and then seldom finds them. In generated functions
arrays of different names do not overlap, so that it is known here which loops can be written in vectors; entries that
lie apart, or are looked up in a table, become permutations of vectors wherever an array can stay in registers.
"""

# ruff: noqa: D102 (what visits a node is documented by the node's class in `ast`)
from __future__ import annotations

import ast
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from integrators.compile.lowering import MOST_PERMUTED, WIDTH
from integrators.compile.lowering.expressions import WHOLE, Value
from integrators.compile.lowering.vector_expressions import (
    ALIGNMENT,
    INDEX,
    NUMBER,
    WORD,
    UnsuitedError,
    VectorExpressions,
    constant_vector,
)

if TYPE_CHECKING:
    from integrators.compile.lowering.statements import Statements

FEWEST, MOST = 8, 64
"""Entries of loops that are written so: shorter ones LLVM unrolls, longer ones it vectorises itself."""
FEWEST_PERMUTED = 4
"""The fewest where entries lie apart, or are looked up in a table."""
LONG = 80
"""Instructions for a vector from which on the vectors are made by a loop, however many they are."""
LEAST = -(2**63)


class VectorLoop(VectorExpressions):
    """Writes a loop over entries.

    Its statements set entries of arrays, at places that follow from the counter, to values that depend on no entry set
    for another counter; or they set local variables; or they take a maximum over all entries.

    Args:
        scalars: Writes what does not depend on the counter.
        node: The loop.
    """

    def __init__(self, scalars: Statements, node: Any):
        super().__init__(scalars, node)
        self.maxima: dict[tuple[str, int], Any] = {}  # places in memory, by the variable and the width

    def write(self) -> bool:
        """Write the loop, if it is one over entries; otherwise nothing is written."""
        bounds = _bounds(self.node.iter)
        if bounds is None or bounds[1] - bounds[0] < FEWEST_PERMUTED or self.counter in self.names:
            return False
        written: list[Any] = self.builder.block.instructions
        before = len(written)
        try:
            self._vector(bounds[0], min(WIDTH, bounds[1] - bounds[0]))
            way = self._way(bounds[1] - bounds[0], len(written) - before)
            del written[before:]
            for key in self.maxima:
                self._begin_maximum(key)
            way(*bounds)
        except UnsuitedError:
            del written[before:]
            return False
        self._end()
        self.scalars.assign(self.counter, Value(WHOLE, ir.Constant(WORD, bounds[1] - 1)))
        return True

    def _way(self, count: int, instructions: int) -> Callable[[int, int], None]:
        """How so many entries are written, if a vector takes so many instructions."""
        if self.is_permuted:
            if count > MOST_PERMUTED:
                raise UnsuitedError
            return self._permuted
        shifts = {(name, place - counter) for name, place, counter in self.written}
        for array, shift in {(name, place - counter) for name, place, counter in self.read} | shifts:
            if any(array == name and 0 < abs(shift - other) < count for name, other in shifts):
                raise UnsuitedError  # an entry depends on another one
        if instructions > LONG and count > 2 * WIDTH:
            return self._in_a_loop
        if not FEWEST <= count <= MOST:
            raise UnsuitedError
        return self._one_by_one

    def _one_by_one(self, first: int, end: int) -> None:
        """The vectors one behind the other."""
        while first < end:
            self._vector(first, min(WIDTH, end - first))
            first += self.width

    def _permuted(self, first: int, end: int) -> None:
        """The vectors one behind the other, if no entry depends on another one."""
        self._one_by_one(first, end)
        writers = {(name, place): counter for name, place, counter in self.written}
        if any(writers.get((name, place), counter) != counter for name, place, counter in self.read | self.written):
            raise UnsuitedError

    def _in_a_loop(self, first: int, end: int) -> None:
        """All vectors but the last one by a loop."""
        last = first + (end - first - 1) // WIDTH * WIDTH
        begin, stop, step = (ir.Constant(WORD, number) for number in (first, last, WIDTH))
        with cgutils.for_range_slice(self.builder, begin, stop, step, inc=True) as (self.base, _):
            self._vector(first, WIDTH)
        self.base = None
        self._vector(last, end - last)

    def _vector(self, first: int, width: int) -> None:
        """The statements, for so many values of the counter."""
        self.first, self.width, self.vectors = first, width, {}
        for statement in self.node.body:
            self.visit(statement)

    def _end(self) -> None:
        """Local variables are what they are for the last entry, and maxima are those of all entries."""
        for name, vector in self.vectors.items():
            last = self.builder.extract_element(vector, ir.Constant(INDEX, self.width - 1))
            self.scalars.assign(name, Value(WHOLE if last.type == WORD else types.float64, last))
        for (name, _), place in self.maxima.items():
            now = self.scalars.visit(ast.Name(name)).llvm
            self.scalars.assign(name, Value(WHOLE, self.larger(now, self._across(self.builder.load(place)))))

    def visit_Assign(self, node: Any) -> None:
        target, *others = node.targets
        if others:
            raise UnsuitedError
        if not isinstance(target, ast.Name):
            self._store(target, self.visit(node.value))
        elif _is_maximum(node.value, target.id) and target.id not in self.vectors:
            self._take_maximum(target, node.value.args[1])
        elif any(name == target.id for name, _ in self.maxima):
            raise UnsuitedError
        else:
            self.vectors[target.id] = self.visit(node.value)

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
        """The maximum of nothing."""
        self.builder.store(constant_vector(WORD, [ir.Constant(WORD, LEAST)] * key[1]), self.maxima[key])

    def _across(self, vector: Any) -> Any:
        """The largest entry of a vector."""
        return self.intrinsic("llvm.vector.reduce.smax", vector.type, [vector], WORD)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        target = node.target
        if not isinstance(target, ast.Subscript):
            raise UnsuitedError
        self._store(target, self.visit(ast.BinOp(target, node.op, node.value)))

    def _store(self, target: ast.expr, value: Any) -> None:
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
    """The first number and the end of a range, if they are written out and there is no step."""
    match node:
        case ast.Call(ast.Name("range"), [ast.Constant(int(end))]):
            return 0, end
        case ast.Call(ast.Name("range"), [ast.Constant(int(first)), ast.Constant(int(end))]):
            return first, end
    return None


def _is_maximum(node: ast.expr, name: str) -> bool:
    """Whether a value is the larger one of a variable and another value."""
    match node:
        case ast.Call(ast.Name("max"), [ast.Name(first), _]):
            return first == name
    return False
