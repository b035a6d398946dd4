"""Residual and Jacobian of order conditions as compiled functions, for solvers and optimisers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.conditions import kernels
from bseries.conditions.layout import layout
from bseries.exceptions import SeriesError

if TYPE_CHECKING:
    import numpy as np

    from bseries.conditions.program import Summand, System


class Unknown(NamedTuple):
    """A free coefficient: the argument that holds it and where, from 0."""

    argument: str
    at: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.argument}[{', '.join(map(str, self.at))}]"


class CompiledConditions:
    """Order conditions for a number of stages, as compiled functions of floats.

    Everything shared by trees is computed once: the stage vectors, and for the derivatives the vectors that come down
    to a marked node of a trunk. With n conditions and U unknowns the Jacobian has 8·n·U bytes, which any algorithm must
    write; and an edge that can be cut costs one product of vectors, s² multiplications (half of them for an explicit
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

    def __init__(self, system: System, stages: int):
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
        """The unknowns in these arrays, as one vector."""
        return self._read(arrays)[self._columns]

    def unpack(self, unknowns: Any) -> tuple[np.ndarray, ...]:
        """The arrays that a vector of unknowns stands for; entries that are not free are zero.

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
            *arrays: The arrays that the conditions' `arguments` name, A and b for Runge–Kutta methods. Entries that the
                structure rules out are not looked at.

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
        kernels.sums.compiled(np.uint64(self.stages), *self._sums, vectors, value, result)
        return result

    def jacobian(self, *arrays: Any) -> np.ndarray:
        """The derivatives of the residual by the `unknowns`.

        Args:
            *arrays: As for `residual`.

        Returns:
            One row for each condition, one column for each unknown.

        Raises:
            SeriesError: The arrays do not fit.
        """
        import numpy as np

        slopes = self._slopes
        flat = self._read(arrays)
        value = self._run(len(self._system.program.operations), flat, self._vectors(flat))
        result = np.empty((len(self._system.equations), len(self.unknowns)))
        above, scratch = np.zeros(self.stages), np.empty(len(self._entries))
        kernels.gradients.compiled(
            np.uint64(self.stages), *slopes, self._reach.ravel(), value, self._columns, above, scratch, result
        )
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
        """The values of the operations before `last`."""
        import numpy as np

        s = np.uint64(self.stages)
        value = np.empty(last * self.stages)
        matrices, columns = self._matrices(flat), self._operations(last)
        kernels.stage_vectors.compiled(last, s, *columns, matrices, self._operator_reach, vectors, value)
        return value

    def _operations(self, count: int) -> tuple[np.ndarray, ...]:
        """Kind, left and right of the first operations."""
        import numpy as np

        if count not in self._arrays:
            operations = np.array(self._system.program.operations[:count], np.uint64)
            self._arrays[count] = tuple(np.ascontiguousarray(column) for column in operations.T)
        return self._arrays[count]

    def _vectors(self, flat: np.ndarray) -> np.ndarray:
        """The vectors of coefficients, at the place that their block has among all blocks."""
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
        """By row of each block, how many entries from the first on reach the last one that is free."""
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
        """The summands of all equations."""
        import numpy as np

        terms: list[Summand] = [term for equation in self._system.equations for term in equation.summands]
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
    def _slopes(self) -> tuple[np.ndarray, ...]:
        """The slopes of all equations, those with one y behind one another, and where they go."""
        import numpy as np

        rows = [sorted(slopes, key=lambda slope: (slope.block, slope.y)) for slopes in self._system.gradients]
        slopes = [slope for row in rows for slope in row]
        targets = [(slope.block, slope.y) for slope in slopes]
        lasts = set(np.cumsum([len(row) for row in rows]) - 1)
        ends = [
            0 if k not in lasts and target == targets[k + 1] else 2 if target[1] >= 0 else 1
            for k, target in enumerate(targets)
        ]
        return (
            np.cumsum([0, *map(len, rows)]).astype(np.uint64),
            np.array([float(slope.factor) for slope in slopes]),
            np.array([slope.x for slope in slopes], np.uint64),
            np.array([max(slope.y, 0) for slope in slopes], np.uint64),
            np.array(ends, np.uint8),
            np.array([self._starts[slope.block] for slope in slopes], np.uint64),
            np.array([slope.block * self.stages for slope in slopes], np.uint64),
        )
