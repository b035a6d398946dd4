"""Residual and Jacobian of order conditions as compiled functions, for solvers and optimisers.

Coefficients and stage matrices form one vector, the values of operations another, with `stages` entries for each
operation; tables hold offsets into these vectors. Sizes and offsets are unsigned: without checks for negative indices
the inner loops are vectorised.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bseries.conditions.condition_program import IMAGE, ONE, PRODUCT, PULLBACK, VECTOR, ConditionProgram
from bseries.conditions.formulas import named_blocks, read_arrays, stage_matrices
from bseries.exceptions import SeriesError
from bseries_base.kernels import kernel

Tables = tuple[np.ndarray, ...]


@kernel
def stage_vectors(stages, kind, left, right, coefficients, value):
    """Compute the values of all operations."""
    for k in range(len(kind)):
        at = k * stages
        x = left[k]
        y = right[k]
        if kind[k] == PRODUCT:
            for i in range(stages):
                value[at + i] = value[x + i] * value[y + i]
        elif kind[k] == IMAGE:
            for i in range(stages):
                row = x + i * stages
                total = 0.0
                for j in range(stages):
                    total += coefficients[row + j] * value[y + j]
                value[at + i] = total
        elif kind[k] == PULLBACK:
            for i in range(stages):
                value[at + i] = 0.0
            for i in range(stages):
                row = x + i * stages
                above = value[y + i]
                for j in range(stages):
                    value[at + j] += coefficients[row + j] * above
        elif kind[k] == ONE:
            for i in range(stages):
                value[at + i] = 1.0
        else:
            for i in range(stages):
                value[at + i] = coefficients[x + i]


@kernel
def sums(stages, starts, factor, left, right, coefficients, value, result):
    """Add Σ factor · (vector · stage vector) to the result of each equation."""
    for k in range(len(result)):
        total = 0.0
        for term in range(starts[k], starts[k + 1]):
            x = left[term]
            y = right[term]
            product = 0.0
            for i in range(stages):
                product += coefficients[x + i] * value[y + i]
            total += factor[term] * product
        result[k] += total


@kernel
def gradients(stages, starts, factor, left, right, target, is_matrix, value, columns, derivatives, result):
    """The Jacobian, row by row: sum the derivatives with respect to all coefficients, and copy the free `columns`.

    A term is factor · x yᵀ, added to the matrix whose entries begin at `target`, or factor · x, added to a vector.
    """
    for k in range(len(result)):
        for at in range(len(derivatives)):
            derivatives[at] = 0.0
        for term in range(starts[k], starts[k + 1]):
            x = left[term]
            y = right[term]
            if is_matrix[term]:
                for i in range(stages):
                    slope = factor[term] * value[x + i]
                    at = target[term] + i * stages
                    for j in range(stages):
                        derivatives[at + j] += slope * value[y + j]
            else:
                for i in range(stages):
                    derivatives[target[term] + i] += factor[term] * value[x + i]
        for column in range(len(columns)):
            result[k, column] = derivatives[columns[column]]


class Unknown(NamedTuple):
    """A free coefficient: its argument and its index there, from 0."""

    argument: str
    at: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.argument}[{', '.join(map(str, self.at))}]"


def _floats(array: ArrayLike, name: str) -> np.ndarray:
    try:
        return np.asarray(array, float)
    except (TypeError, ValueError):
        raise SeriesError(f"{name} must be an array of numbers, but was {array!r:.60}") from None


def _columns(rows: Sequence[Sequence[tuple[float, ...]]], width: int) -> Tables:
    """Where each row of terms begins, their factors, and their other entries, which are offsets."""
    factor, *offsets = np.array([term for row in rows for term in row]).reshape(-1, width).T
    starts = np.cumsum([0, *map(len, rows)], dtype=np.uint64)
    return starts, factor.copy(), *(column.astype(np.uint64) for column in offsets)


class CompiledConditions:
    """Order conditions for a number of stages, as compiled functions of floats.

    Stage vectors and adjoint vectors are computed once for all trees. With n conditions and U unknowns the Jacobian has
    8·n·U bytes; each edge costs one outer product, s² multiplications. All 1,205 conditions to order 10 with s = 17:
    2.95 MB, about 2.6 million multiplications.

    Attributes:
        stages: The number of stages.
        unknowns: The free coefficients, in the order of the columns: argument by argument, row by row.

    Example:
        >>> import bseries as bs
        >>> f = bs.order_conditions("runge-kutta", 2, explicit=True).compile(stages=2)
        >>> f.residual([[0, 0], [0.5, 0]], [0, 1])
        array([0., 0.])
        >>> print(*f.unknowns)
        A[1, 0] b[0] b[1]
        >>> f.jacobian([[0, 0], [0.5, 0]], [0, 1])
        array([[0. , 1. , 1. ],
               [1. , 0. , 0.5]])
    """

    def __init__(self, program: ConditionProgram, stages: int):
        self.stages = stages
        self._program = program
        entries = named_blocks(program, stages, lambda block, at: Unknown(block.argument.name, (*block.stack, *at)))
        *self._starts, self._size = map(int, np.cumsum([0, *(block.size for block in entries)]))
        self._blocks = [(slice(at, at + x.size), x.shape) for at, x in zip(self._starts, entries, strict=True)]
        flat = np.concatenate([block.ravel() for block in entries])
        self.unknowns: tuple[Unknown, ...] = tuple(entry for entry in flat if entry)
        self._columns = np.flatnonzero(flat).astype(np.uint64)
        self._excluded = np.flatnonzero(flat == 0)

    def __repr__(self) -> str:
        return f"<CompiledConditions: {len(self._program.equations)} conditions, {len(self.unknowns)} unknowns>"

    def pack(self, *arrays: ArrayLike) -> np.ndarray:
        """The unknowns as one vector, from arrays of coefficients."""
        return self._read(arrays)[self._columns]

    def unpack(self, unknowns: ArrayLike) -> tuple[np.ndarray, ...]:
        """The arrays for a vector of unknowns; entries that are not free are zero.

        Example:
            >>> import bseries as bs
            >>> f = bs.order_conditions("runge-kutta", 2, explicit=True).compile(stages=2)
            >>> A, b = f.unpack([0.5, 0.0, 1.0])
            >>> A.tolist(), b.tolist()
            ([[0.0, 0.0], [0.5, 0.0]], [0.0, 1.0])
        """
        given = np.asarray(unknowns, float)
        if given.shape != (len(self.unknowns),):
            raise SeriesError(f"unknowns must be {len(self.unknowns)} numbers, but had the shape {given.shape}")
        flat = np.zeros(self._size)
        flat[self._columns] = given
        shapes = [argument.shape(self.stages) for argument in self._program.arguments]
        parts = np.split(flat, np.cumsum([math.prod(shape) for shape in shapes])[:-1])
        return tuple(part.reshape(shape) for part, shape in zip(parts, shapes, strict=True))

    def residual(self, *arrays: ArrayLike) -> np.ndarray:
        """Left-hand sides minus right-hand sides.

        Args:
            *arrays: The arrays named by the conditions' `arguments`, A and b for Runge–Kutta methods. Entries excluded
                by the structure are ignored.

        Returns:
            One float for each condition.

        Raises:
            SeriesError: The arrays do not fit.
        """
        operations, terms, right = self._residual_tables
        coefficients, value = self._evaluated(arrays, operations)
        result = -right
        sums.compiled(np.uint64(self.stages), *terms, coefficients, value, result)
        return result

    def jacobian(self, *arrays: ArrayLike) -> np.ndarray:
        """Derivatives of the residual with respect to the `unknowns`.

        The arrays are those of `residual`. There is a row for each condition, a column for each unknown.
        """
        operations, terms = self._jacobian_tables
        _, value = self._evaluated(arrays, operations)
        result = np.empty((len(self._program.equations), len(self.unknowns)))
        derivatives = np.empty(self._size)
        gradients.compiled(np.uint64(self.stages), *terms, value, self._columns, derivatives, result)
        return result

    def _read(self, arrays: Sequence[ArrayLike]) -> np.ndarray:
        """All entries of all arrays."""
        return np.concatenate([x.ravel() for x in read_arrays(self._program, arrays, self.stages, _floats)])

    def _evaluated(self, arrays: Sequence[ArrayLike], operations: Tables) -> tuple[np.ndarray, np.ndarray]:
        """The coefficients, followed by the stage matrices, and the values of operations."""
        flat = self._read(arrays)
        flat[self._excluded] = 0.0
        blocks = [flat[places].reshape(shape) for places, shape in self._blocks]
        matrices = stage_matrices(self._program, blocks)
        coefficients = np.concatenate([flat, *map(np.ravel, matrices)])
        value = np.empty(len(operations[0]) * self.stages)
        stage_vectors.compiled(np.uint64(self.stages), *operations, coefficients, value)
        return coefficients, value

    @cached_property
    def _residual_tables(self) -> tuple[Tables, Tables, np.ndarray]:
        """The tables of `stage_vectors` and `sums`, and the right-hand sides."""
        s, starts, equations = self.stages, self._starts, self._program.equations
        rows = [[(float(x.factor), starts[x.block], x.value * s) for x in e.summands] for e in equations]
        return self._operations(self._program.size), _columns(rows, 3), np.array([float(x.right) for x in equations])

    @cached_property
    def _jacobian_tables(self) -> tuple[Tables, Tables]:
        """The tables of `stage_vectors` and `gradients`."""
        s, starts = self.stages, self._starts
        rows = [
            [(float(t.factor), t.x * s, max(t.y, 0) * s, starts[t.block], t.y >= 0) for t in terms]
            for terms in self._program.gradients  # appends operations
        ]
        return self._operations(len(self._program.operations)), _columns(rows, 5)

    def _operations(self, count: int) -> Tables:
        """Kinds of the first operations, and offsets of their operands."""
        s, rows = self.stages, []
        for kind, x, y in self._program.operations[:count]:
            left = self._size + x * s**2 if kind in (IMAGE, PULLBACK) else self._starts[x] if kind == VECTOR else x * s
            rows.append((kind, left, y * s))
        return tuple(np.ascontiguousarray(np.array(rows, np.uint64).T))
