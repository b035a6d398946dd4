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
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple, Protocol, TypeVar

V = TypeVar("V")

ONE, VECTOR, PRODUCT, IMAGE, PULLBACK = range(5)
"""Kinds of operations: (1, …, 1); a vector of coefficients; x · y by components; A y; Aᵀ y."""


class CoefficientArray(NamedTuple):
    """An array of coefficients: a matrix or vector over the stages, or a stack of them, one for each part."""

    name: str
    letter: str
    latex: str
    symbol: str
    is_matrix: bool
    parts: tuple[str, ...] = ("",)

    @property
    def is_stack(self) -> bool:
        """Whether there is one matrix or vector for each part."""
        return self.parts != ("",)

    def shape(self, stages: int) -> tuple[int, ...]:
        """The shape of the array."""
        return (len(self.parts),) * self.is_stack + (stages,) * (1 + self.is_matrix)


class CoefficientBlock(NamedTuple):
    """One matrix or vector of an argument."""

    argument: CoefficientArray
    part: str

    def code(self, at: str = "") -> str:
        """The block, or one of its entries, as an expression in Python."""
        stack = str(self.argument.parts.index(self.part)) if self.argument.is_stack else ""
        index = ", ".join(filter(None, (stack, at)))
        return f"{self.argument.name}[{index}]" if index else self.argument.name


class StageMatrix(NamedTuple):
    """A stage matrix: the sum of some blocks, or the constant matrix with ones where `relation` holds for j and i.

    `row_sum` is the symbol of its row sums in formulas, if they have one.
    """

    blocks: tuple[int, ...]
    letter: str = ""
    latex: str = ""
    part: str = ""
    row_sum: tuple[str, str] | None = None
    relation: str = ""


class EquationTerm(NamedTuple):
    """coefficient · (w · g), with w the vector of coefficients in a block and g the value of an operation."""

    coefficient: Fraction
    block: int
    value: int


class GradientTerm(NamedTuple):
    """A term of a gradient: factor · x yᵀ for the matrix in a block, or factor · x for a vector (`y` is −1)."""

    factor: Fraction
    block: int
    x: int
    y: int


class Interpreter(Protocol[V]):
    """Executes the operations on numbers or symbols, or by writing code; `of_one`: x is (1, …, 1)."""

    def one(self) -> V:
        """The vector (1, …, 1)."""
        ...

    def vector(self, block: int) -> V:
        """A vector of coefficients."""
        ...

    def product(self, x: V, y: V) -> V:
        """The product by components."""
        ...

    def image(self, operator: int, x: V, *, of_one: bool) -> V:
        """A x."""
        ...

    def pullback(self, operator: int, x: V) -> V:
        """Aᵀ x."""
        ...


class ConditionProgram:
    """Operations on stage vectors, without duplicates.

    Args:
        arguments: The arrays of coefficients.
        operators: The stage matrices.
    """

    def __init__(self, arguments: Sequence[CoefficientArray], operators: Sequence[StageMatrix]):
        self.arguments = tuple(arguments)
        self.operators = tuple(operators)
        self.blocks = [CoefficientBlock(argument, part) for argument in arguments for part in argument.parts]
        self.operations: list[tuple[int, int, int]] = []
        self._ids: dict[tuple[int, int, int], int] = {}
        self._factors: dict[int, tuple[int, ...]] = {self._emit(ONE): ()}  # the first operation: its id is ONE, 0

    def _emit(self, kind: int, x: int = 0, y: int = 0) -> int:
        operation = (kind, x, y)
        found = self._ids.get(operation)
        if found is None:
            found = self._ids[operation] = len(self.operations)
            self.operations.append(operation)
        return found

    def vector(self, block: int) -> int:
        """A vector of coefficients, as a factor."""
        return self._emit(VECTOR, block)

    def image(self, operator: int, stage: int) -> int:
        """The image of a stage vector under a stage matrix, as a factor."""
        return self._emit(IMAGE, operator, stage)

    def times(self, stage: int, factor: int) -> int:
        """The product of a stage vector and a factor."""
        found = factor if stage == ONE else self._emit(PRODUCT, stage, factor)
        self._factors.setdefault(found, (*self._factors[stage], factor))
        return found

    def factors(self, stage: int) -> tuple[int, ...]:
        """The factors of a stage vector."""
        return self._factors[stage]

    def _without(self, stage: int, factor: int) -> int:
        """A stage vector without one of its factors."""
        rest = list(self._factors[stage])
        rest.remove(factor)
        found = ONE
        for other in rest:
            found = self.times(found, other)
        return found

    def gradient(self, summands: Sequence[EquationTerm]) -> list[GradientTerm]:
        """The derivatives of a sum by all coefficients; appends the operations they need."""
        derivatives: defaultdict[tuple[int, int, int], Fraction] = defaultdict(Fraction)
        for coefficient, block, stage in summands:
            derivatives[block, stage, -1] += coefficient
            pending = [(stage, self.vector(block), coefficient)]
            while pending:
                stage, above, factor = pending.pop()
                for child, multiplicity in Counter(self._factors[stage]).items():
                    rest = self._without(stage, child)
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

    def run(self, interpreter: Interpreter[V], count: int | None = None) -> list[V]:
        """The values of the first `count` operations, by default of all."""
        values: list[V] = []
        for kind, x, y in self.operations[:count]:
            if kind == ONE:
                values.append(interpreter.one())
            elif kind == VECTOR:
                values.append(interpreter.vector(x))
            elif kind == PRODUCT:
                values.append(interpreter.product(values[x], values[y]))
            elif kind == IMAGE:
                values.append(interpreter.image(x, values[y], of_one=y == ONE))
            else:
                values.append(interpreter.pullback(x, values[y]))
        return values


class Equation(NamedTuple):
    """Σ summands = right."""

    summands: tuple[EquationTerm, ...]
    right: Fraction


class EquationSystem:
    """Equations with the program that computes them.

    Args:
        program: The program for the stage vectors.
        equations: The equations.
        structures: The structure of each stage matrix among the arguments.
    """

    def __init__(self, program: ConditionProgram, equations: Sequence[Equation], structures: Sequence[str]):
        self.program = program
        self.equations = tuple(equations)
        self.structures = tuple(structures)
        self.size = len(program.operations)
        """The number of operations for the left-hand sides; later operations serve the derivatives."""

    @property
    def arguments(self) -> tuple[str, ...]:
        """The names of the arrays of coefficients."""
        return tuple(argument.name for argument in self.program.arguments)

    @cached_property
    def gradients(self) -> list[list[GradientTerm]]:
        """The derivatives of every left-hand side."""
        return [self.program.gradient(equation.summands) for equation in self.equations]
