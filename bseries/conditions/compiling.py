"""Residual and Jacobian of order conditions as compiled functions, for solvers and optimisers.

The values of operations are stored consecutively, `stages` numbers each. `reach[m·stages + i]` is the number of leading
entries of row i of matrix m that may be nonzero. Sizes and columns are unsigned: without checks for negative indices
the inner loops are vectorised.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.conditions.condition_program import IMAGE, ONE, PRODUCT, PULLBACK
from bseries.conditions.layout import layout
from bseries.exceptions import SeriesError
from trees.compiled import kernel

if TYPE_CHECKING:
    import numpy as np

    from bseries.conditions.condition_program import EquationSystem, EquationTerm


@kernel
def stage_vectors(last, stages, kind, left, right, matrices, reach, vectors, value):
    """Values of the operations 0 … last−1."""
    for k in range(last):
        at = k * stages
        x = left[k] * stages
        y = right[k] * stages
        if kind[k] == PRODUCT:
            for i in range(stages):
                value[at + i] = value[x + i] * value[y + i]
        elif kind[k] == IMAGE:
            for i in range(stages):
                row = (x + i) * stages
                total = 0.0
                for j in range(reach[x + i]):
                    total += matrices[row + j] * value[y + j]
                value[at + i] = total
        elif kind[k] == PULLBACK:
            for i in range(stages):
                value[at + i] = 0.0
            for i in range(stages):
                row = (x + i) * stages
                above = value[y + i]
                for j in range(reach[x + i]):
                    value[at + j] += matrices[row + j] * above
        elif kind[k] == ONE:
            for i in range(stages):
                value[at + i] = 1.0
        else:
            for i in range(stages):
                value[at + i] = vectors[x + i]


@kernel
def sums(stages, starts, factor, block, stage, vectors, value, result):
    """Add Σ factor · (vector · stage vector) to the result of each equation."""
    for k in range(len(result)):
        total = 0.0
        for term in range(starts[k], starts[k + 1]):
            x = block[term] * stages
            y = stage[term] * stages
            product = 0.0
            for i in range(stages):
                product += vectors[x + i] * value[y + i]
            total += factor[term] * product
        result[k] += total


@kernel
def gradients(stages, starts, factor, left, right, ends, target, rows, reach, value, columns, above, scratch, result):
    """The Jacobian, row by row: derivatives by all coefficients are summed in `scratch`, the free `columns` copied.

    Terms factor · x yᵀ with the same y are consecutive; where `ends` is nonzero the sum of factor · x is complete. If
    `ends` is 2 its product with y is added to the matrix whose entries begin at `target` and whose `reach` begins at
    `rows`; if 1, the sum itself is added to the vector at `target`. `above` is zero before and after.
    """
    for k in range(len(result)):
        for at in range(len(scratch)):
            scratch[at] = 0.0
        for term in range(starts[k], starts[k + 1]):
            x = left[term] * stages
            for i in range(stages):
                above[i] += factor[term] * value[x + i]
            if ends[term] == 0:
                continue
            y = right[term] * stages
            for i in range(stages):
                total = above[i]
                above[i] = 0.0
                if ends[term] == 1:
                    scratch[target[term] + i] += total
                    continue
                at = target[term] + i * stages
                for j in range(reach[rows[term] + i]):
                    scratch[at + j] += total * value[y + j]
        for column in range(len(columns)):
            result[k, column] = scratch[columns[column]]


class Unknown(NamedTuple):
    """A free coefficient: its argument and its index there, from 0."""

    argument: str
    at: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.argument}[{', '.join(map(str, self.at))}]"


class CompiledConditions:
    """Order conditions for a number of stages, as compiled functions of floats.

    Stage vectors and adjoint vectors are computed once for all trees. With n conditions and U unknowns the Jacobian has
    8·n·U bytes; each edge costs one outer product, s² multiplications (half of them for an explicit
    method). All 1,205 conditions to order 10 with s = 17: 2.95 MB, some 2.6 million multiplications.

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

    def __init__(self, system: EquationSystem, stages: int):
        import numpy as np

        self.stages = stages
        self._system = system
        self._arguments = system.program.arguments
        self._entries = layout(system.program, system.structures, stages)
        self._starts = [k for k, entry in enumerate(self._entries) if entry.place == 0]
        self._columns = np.array([k for k, entry in enumerate(self._entries) if entry.is_free], np.uint64)
        self._arrays: dict[int, tuple[np.ndarray, ...]] = {}
        self.unknowns: tuple[Unknown, ...] = tuple(
            Unknown(entry.argument.name, entry.at) for entry in self._entries if entry.is_free
        )

    def __repr__(self) -> str:
        return f"<CompiledConditions: {len(self._system.equations)} conditions, {len(self.unknowns)} unknowns>"

    def pack(self, *arrays: Any) -> np.ndarray:
        """The unknowns of some arrays as one vector."""
        return self._read(arrays)[self._columns]

    def unpack(self, unknowns: Any) -> tuple[np.ndarray, ...]:
        """The arrays for a vector of unknowns; entries that are not free are zero.

        Example:
            >>> import bseries as bs
            >>> f = bs.order_conditions("runge-kutta", 2, explicit=True).compile(stages=2)
            >>> A, b = f.unpack([0.5, 0.0, 1.0])
            >>> A.tolist(), b.tolist()
            ([[0.0, 0.0], [0.5, 0.0]], [0.0, 1.0])
        """
        import numpy as np

        given = np.asarray(unknowns, float)
        if given.shape != (len(self.unknowns),):
            raise SeriesError(f"unknowns must be {len(self.unknowns)} numbers, but had the shape {given.shape}")
        flat = np.zeros(len(self._entries))
        flat[self._columns] = given
        arrays, at = [], 0
        for argument in self._arguments:
            shape = argument.shape(self.stages)
            size = int(np.prod(shape))
            arrays.append(flat[at : at + size].reshape(shape))
            at += size
        return tuple(arrays)

    def residual(self, *arrays: Any) -> np.ndarray:
        """Left-hand sides minus right-hand sides.

        Args:
            *arrays: The arrays named by the conditions' `arguments`, A and b for Runge–Kutta methods. Entries excluded
                by the structure are ignored.

        Returns:
            One float for each condition.

        Raises:
            SeriesError: The arrays do not fit.
        """
        import numpy as np

        flat = self._read(arrays)
        vectors = self._vectors(flat)
        value = self._run(self._system.size, flat, vectors)
        result = -self._right
        sums.compiled(np.uint64(self.stages), *self._sums, vectors, value, result)
        return result

    def jacobian(self, *arrays: Any) -> np.ndarray:
        """Derivatives of the residual by the `unknowns`.

        Args:
            *arrays: As for `residual`.

        Returns:
            A row for each condition, a column for each unknown.

        Raises:
            SeriesError: The arrays do not fit.
        """
        import numpy as np

        terms = self._gradient_terms  # appends operations to the program
        flat = self._read(arrays)
        value = self._run(len(self._system.program.operations), flat, self._vectors(flat))
        result = np.empty((len(self._system.equations), len(self.unknowns)))
        above, scratch = np.zeros(self.stages), np.empty(len(self._entries))
        inputs = np.uint64(self.stages), *terms, self._reach.ravel()
        gradients.compiled(*inputs, value, self._columns, above, scratch, result)
        return result

    def _read(self, arrays: Sequence[Any]) -> np.ndarray:
        """All entries of all arrays."""
        import numpy as np

        if len(arrays) != len(self._arguments):
            raise SeriesError(f"arguments must be {', '.join(self._system.arguments)}, but were {len(arrays)}")
        flat = []
        for argument, array in zip(self._arguments, arrays, strict=True):
            try:
                entries = np.asarray(array, float)
            except (TypeError, ValueError):
                raise SeriesError(f"{argument.name} must be an array of numbers, but was {array!r:.60}") from None
            shape = argument.shape(self.stages)
            if entries.shape != shape:
                raise SeriesError(f"{argument.name} must have the shape {shape}, but had {entries.shape}")
            flat.append(entries.ravel())
        return np.concatenate(flat)

    def _run(self, last: int, flat: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Values of the operations before `last`."""
        import numpy as np

        s = np.uint64(self.stages)
        value = np.empty(last * self.stages)
        matrices, columns = self._matrices(flat), self._operations(last)
        stage_vectors.compiled(last, s, *columns, matrices, self._operator_reach, vectors, value)
        return value

    def _operations(self, count: int) -> tuple[np.ndarray, ...]:
        """Kind, left and right operands of the first operations."""
        import numpy as np

        if count not in self._arrays:
            operations = np.array(self._system.program.operations[:count], np.uint64)
            self._arrays[count] = tuple(np.ascontiguousarray(column) for column in operations.T)
        return self._arrays[count]

    def _vectors(self, flat: np.ndarray) -> np.ndarray:
        """The vectors of coefficients, by the numbers of their blocks."""
        import numpy as np

        vectors = np.zeros((len(self._starts), self.stages))
        for block, start in enumerate(self._starts):
            if not self._entries[start].argument.is_matrix:
                vectors[block] = flat[start : start + self.stages]
        return vectors.ravel()

    def _matrices(self, flat: np.ndarray) -> np.ndarray:
        """The stage matrices."""
        import numpy as np

        s = self.stages
        matrices = np.zeros((len(self._system.program.operators), s * s))
        for matrix, operator in zip(matrices, self._system.program.operators, strict=True):
            if operator.relation:
                matrix += np.tri(s, k=0 if operator.relation == "≤" else -1).ravel()
            for block in operator.blocks:
                matrix += flat[self._starts[block] : self._starts[block] + s * s]
        return matrices.ravel()

    @cached_property
    def _reach(self) -> np.ndarray:
        """For each row of each block, the number of leading entries up to the last free one."""
        import numpy as np

        reach = np.zeros((len(self._starts), self.stages), np.uint64)
        for argument, index, block, _, is_free in self._entries:
            if argument.is_matrix and is_free:
                reach[block, index[-2]] = index[-1] + 1
        return reach

    @cached_property
    def _operator_reach(self) -> np.ndarray:
        """The same for each stage matrix."""
        import numpy as np

        reach = np.zeros((len(self._system.program.operators), self.stages), np.uint64)
        for row, operator in zip(reach, self._system.program.operators, strict=True):
            if operator.relation:
                row += np.arange(self.stages, dtype=np.uint64) + np.uint64(operator.relation == "≤")
            for block in operator.blocks:
                np.maximum(row, self._reach[block], out=row)
        return reach.ravel()

    @cached_property
    def _sums(self) -> tuple[np.ndarray, ...]:
        """The terms of all left-hand sides."""
        import numpy as np

        terms: list[EquationTerm] = [term for equation in self._system.equations for term in equation.summands]
        return (
            np.cumsum([0, *(len(equation.summands) for equation in self._system.equations)]).astype(np.uint64),
            np.array([float(term.coefficient) for term in terms]),
            np.array([term.block for term in terms], np.uint64),
            np.array([term.value for term in terms], np.uint64),
        )

    @cached_property
    def _right(self) -> np.ndarray:
        import numpy as np

        return np.array([float(equation.right) for equation in self._system.equations])

    @cached_property
    def _gradient_terms(self) -> tuple[np.ndarray, ...]:
        """The gradient terms of all equations, those with the same y consecutive, and their targets."""
        import numpy as np

        rows = [sorted(row, key=lambda term: (term.block, term.y)) for row in self._system.gradients]
        terms = [term for row in rows for term in row]
        targets = [(term.block, term.y) for term in terms]
        lasts = set(np.cumsum([len(row) for row in rows]) - 1)
        ends = [
            0 if k not in lasts and target == targets[k + 1] else 2 if target[1] >= 0 else 1
            for k, target in enumerate(targets)
        ]
        return (
            np.cumsum([0, *map(len, rows)]).astype(np.uint64),
            np.array([float(term.factor) for term in terms]),
            np.array([term.x for term in terms], np.uint64),
            np.array([max(term.y, 0) for term in terms], np.uint64),
            np.array(ends, np.uint8),
            np.array([self._starts[term.block] for term in terms], np.uint64),
            np.array([term.block * self.stages for term in terms], np.uint64),
        )
