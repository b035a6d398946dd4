"""Order conditions as one straight-line program of stage vectors, with derivatives by reverse accumulation.

The stage vector of a tree is a product with one factor for each child; a factor is a vector of coefficients (the nodes
c) or the image A g of a child's stage vector g. Vectors of common subtrees are computed once. The left-hand side of a
condition is a sum of products b · g.

Its derivative is a sum over the edges of the tree: with u the adjoint vector at the parent times the factors of the
siblings, and g the stage vector of the child, the edge contributes u_k g_l to ∂/∂a_kl, and Aᵀu is the adjoint vector at
the child. Adjoint vectors of common trunks are computed once as well.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import NamedTuple

ONE, VECTOR, PRODUCT, IMAGE, PULLBACK = range(5)
"""Kinds of operations: (1, …, 1); a vector of coefficients; x · y by components; A y; Aᵀ y."""

FULL, EXPLICIT, DIAGONALLY_IMPLICIT = STRUCTURES = ("full", "explicit", "diagonally-implicit")
BANDS = {EXPLICIT: 0, DIAGONALLY_IMPLICIT: 1, "<": 0, "≤": 1}
"""Row i = 0, 1, … of a lower triangular matrix begins with i + band entries that may be nonzero."""


class CoefficientArray(NamedTuple):
    """An array of coefficients: a matrix or vector over the stages, or a stack of them, one for each part."""

    name: str
    symbol: str  # in formulas
    is_matrix: bool
    parts: tuple[str, ...] = ("",)

    @property
    def is_stack(self) -> bool:
        """Whether there is one matrix or vector for each part."""
        return self.parts != ("",)

    def shape(self, stages: int) -> tuple[int, ...]:
        """The shape of the array."""
        return (len(self.parts),) * self.is_stack + self.part_shape(stages)

    def part_shape(self, stages: int) -> tuple[int, ...]:
        """The shape of one matrix or vector."""
        return (stages,) * (1 + self.is_matrix)


class CoefficientBlock(NamedTuple):
    """One matrix or vector of an argument."""

    argument: CoefficientArray
    part: str

    @property
    def stack(self) -> tuple[int, ...]:
        """The first index of the block's entries in a stack."""
        return (self.argument.parts.index(self.part),) * self.argument.is_stack

    @property
    def code(self) -> str:
        """The block as an expression in Python."""
        return self.argument.name + "".join(f"[{k}]" for k in self.stack)


class StageMatrix(NamedTuple):
    """A stage matrix: the sum of some blocks, or the matrix with entries 1 for `relation` between j and i, else 0.

    In formulas, `symbol` stands for it, and `row_sum`, if not empty, for its row sums.
    """

    blocks: tuple[int, ...]
    symbol: str = ""
    part: str = ""
    row_sum: str = ""
    relation: str = ""


class EquationTerm(NamedTuple):
    """factor · (w · g), with w the vector of coefficients in a block and g the value of an operation."""

    factor: Fraction
    block: int
    value: int


class GradientTerm(NamedTuple):
    """A term of a gradient: factor · x yᵀ for the matrix in a block, or factor · x for a vector (`y` is −1)."""

    factor: Fraction
    block: int
    x: int
    y: int


class Equation(NamedTuple):
    """Σ summands = right."""

    summands: tuple[EquationTerm, ...]
    right: Fraction


class ConditionProgram:
    """Operations on stage vectors, without duplicates, and the equations between them.

    Attributes:
        arguments: The arrays of coefficients.
        operators: The stage matrices.
        blocks: The matrices and vectors of all arguments.
        bands: For each block its band, as in `BANDS`; None where all entries may be nonzero.
        operations: Kind and operands of every operation.
        factors: The factors of every stage vector, as ids of operations.
        size: The number of operations for the left-hand sides; later operations serve the derivatives.
    """

    def __init__(
        self, arguments: Sequence[CoefficientArray], operators: Sequence[StageMatrix], structures: Sequence[str]
    ):
        self.arguments, self.operators = tuple(arguments), tuple(operators)
        self.equations: tuple[Equation, ...] = ()
        self.size = 0
        self.blocks = [CoefficientBlock(argument, part) for argument in arguments for part in argument.parts]
        bands = map(BANDS.get, structures)
        self.bands = [next(bands) if block.argument.is_matrix else None for block in self.blocks]
        self.operations: list[tuple[int, int, int]] = []
        self._ids: dict[tuple[int, int, int], int] = {}
        self.factors: dict[int, tuple[int, ...]] = {self._emit(ONE): ()}  # the first operation: its id is ONE, 0

    def _emit(self, kind: int, x: int = 0, y: int = 0) -> int:
        operation = (kind, x, y)
        found = self._ids.setdefault(operation, len(self.operations))
        if found == len(self.operations):
            self.operations.append(operation)
        return found

    def vector(self, block: int) -> int:
        """A vector of coefficients, as a factor."""
        return self._emit(VECTOR, block)

    def image(self, operator: int, stage: int) -> int:
        """The image of a stage vector under a stage matrix, as a factor."""
        return self._emit(IMAGE, operator, stage)

    def product(self, factors: Iterable[int]) -> int:
        """The product of factors: a stage vector."""
        stage = ONE
        for factor in factors:
            found = factor if stage == ONE else self._emit(PRODUCT, stage, factor)
            self.factors.setdefault(found, (*self.factors[stage], factor))
            stage = found
        return stage

    def _gradient(self, summands: Sequence[EquationTerm]) -> list[GradientTerm]:
        """The derivatives of a sum by all coefficients; appends the operations they need."""
        derivatives: defaultdict[tuple[int, int, int], Fraction] = defaultdict(Fraction)
        for factor, block, stage in summands:
            derivatives[block, stage, -1] += factor
            pending = [(stage, self.vector(block), factor)]
            while pending:
                stage, above, factor = pending.pop()
                for child, multiplicity in Counter(self.factors[stage]).items():
                    siblings = list(self.factors[stage])
                    siblings.remove(child)
                    rest = self.product(siblings)
                    u = above if rest == ONE else self._emit(PRODUCT, above, rest)
                    kind, which, branch = self.operations[child]
                    if kind == VECTOR:
                        derivatives[which, u, -1] += factor * multiplicity
                        continue
                    for own in self.operators[which].blocks:
                        derivatives[own, u, branch] += factor * multiplicity
                    if branch != ONE:
                        pending.append((branch, self._emit(PULLBACK, which, u), factor * multiplicity))
        return [GradientTerm(factor, *key) for key, factor in derivatives.items()]

    def free_entries(self, stages: int) -> Iterator[tuple[int, tuple[int, ...]]]:
        """The coefficients that the structures allow: block, and index in the block."""
        for k, (block, band) in enumerate(zip(self.blocks, self.bands, strict=True)):
            entries = product(range(stages), repeat=1 + block.argument.is_matrix)
            yield from ((k, at) for at in entries if band is None or at[1] < at[0] + band)

    @cached_property
    def gradients(self) -> list[list[GradientTerm]]:
        """The derivatives of every left-hand side."""
        return [self._gradient(equation.summands) for equation in self.equations]
