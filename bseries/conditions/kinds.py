"""Kinds of methods: coefficients, trees, and the sum for each tree."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import groupby, product
from math import factorial, prod
from typing import Any, NamedTuple

from bseries.conditions.condition_program import (
    DIAGONALLY_IMPLICIT,
    EXPLICIT,
    CoefficientArray,
    ConditionProgram,
    EquationTerm,
    StageMatrix,
)
from trees.lyndon_words import lyndon_words
from trees.tree import Tree

Sums = Callable[["Tree"], "tuple[EquationTerm, ...]"]
Factor = Callable[[Tree, Tree, Callable[[Tree], int]], int]
"""The factor of a child in the stage vector of a tree, from the tree, the child, and the function to stage vectors."""

STRICT, WEAK = 0, 1
"""Operators of splitting methods: sums over all earlier sweeps, without and with the same sweep."""


class MethodKind(NamedTuple):
    """A kind of methods."""

    about: str  # the name of the methods in text
    notation: str  # the meaning of the letters in formulas
    arguments: tuple[CoefficientArray, ...]
    sums: Callable[[ConditionProgram], Sums]  # the function from trees to their sums, for a program
    operators: tuple[StageMatrix, ...] = ()  # by default the matrices a of all parts
    colors: int = 1  # the default number of colours
    has_parts: bool = False  # whether there are as many parts as colours, each with its own arrays
    limits: Any = None  # `max_children` of the trees with nonzero elementary differentials
    trees: Callable[[int, int], Sequence[Tree]] | None = None  # all trees, if not those of a `TreeTable`: Lyndon words
    structures: tuple[str, ...] | None = None  # the structure of each matrix, if the kind determines it

    def program(self, names: Sequence[str], structures: Sequence[str]) -> ConditionProgram:
        """The program of methods whose parts have these names, without equations."""
        arguments = [x._replace(parts=tuple(names)) if self.has_parts else x for x in self.arguments]
        own = self.operators or [StageMatrix((k,), "a", name, row_sum="c") for k, name in enumerate(names)]
        return ConditionProgram(arguments, own, structures)


def _stage_vectors(program: ConditionProgram, factor: Factor) -> Callable[[Tree], int]:
    """The function from trees to stage vectors, products of one factor for each child."""
    known: dict[Tree, int] = {}

    def stage(tree: Tree) -> int:
        if tree not in known:
            known[tree] = program.product(factor(tree, child, stage) for child in tree.children)
        return known[tree]

    return stage


def _runge_kutta_sums(program: ConditionProgram) -> Sums:
    """b · g with g(u ∘ v) = g(u) · A g(v), by the colours of the root and of v (HLW, sections III.1 and III.2)."""
    parts = len(program.operators)
    stage = _stage_vectors(program, lambda tree, child, stage: program.image(child.color, stage(child)))
    return lambda tree: (EquationTerm(Fraction(1), parts + tree.color, stage(tree)),)


def _nystrom_sums(program: ConditionProgram) -> Sums:
    """Colours are p = y' and q = y: q[τ] with τ rooted in p is a fat edge, with the matrix Ā or the weights b̄.

    A leaf q is a factor c_i, a child rooted in p a factor with the matrix A (Hairer–Nørsett–Wanner, section II.14).
    """
    abar, bbar, b, c, a = 0, 1, 2, 3, 1

    def factor(tree: Tree, child: Tree, stage: Callable[[Tree], int]) -> int:
        if child.color == 0:
            return program.image(a, stage(child))
        return program.image(abar, stage(child.children[0])) if child.children else program.vector(c)

    stage = _stage_vectors(program, factor)

    def sums(tree: Tree) -> tuple[EquationTerm, ...]:
        block, g = (b, tree) if tree.color == 0 else (bbar, tree.children[0])
        return (EquationTerm(Fraction(1), block, stage(g)),)

    return sums


def _rosenbrock_sums(program: ConditionProgram) -> Sums:
    """An only child is applied with β = α + γ, several children with α (Hairer–Wanner, section IV.7)."""
    alpha, beta, b = 0, 1, 2

    def factor(tree: Tree, child: Tree, stage: Callable[[Tree], int]) -> int:
        return program.image(beta if len(tree.children) == 1 else alpha, stage(child))

    stage = _stage_vectors(program, factor)
    return lambda tree: (EquationTerm(Fraction(1), b, stage(tree)),)


def _splitting_sums(program: ConditionProgram) -> Sums:
    """The coefficient of a tall tree as sums over sweeps.

    A splitting method with s sweeps through the exact flows of K fields,

        φ^[K](x^K_s h) ∘ … ∘ φ^[1](x^1_s h) ∘ … ∘ φ^[K](x^K_1 h) ∘ … ∘ φ^[1](x^1_1 h),

    is a product of exponentials, and so is the exact flow of the sum. Their coefficients at words of Lie derivatives
    are characters of the shuffle algebra: two of them that agree on the Lyndon words with up to n letters agree on all
    words with up to n letters. The coefficient of a word is that of a tall tree, and the coefficient of any tree is the
    sum over its linear extensions, so the tall trees of Lyndon words give a minimal set of conditions.

    r equal letters in one flow contribute x^r/r!. The word is cut in all ways into pieces of equal letters; the pieces,
    from the root to the leaf, belong to flows of which each acts before the one above it.
    """

    def factors(pieces: Sequence[tuple[int, int]], power: int) -> Iterator[int]:
        """`power` times the time of the first piece's flow, and the sum over all flows that act before it."""
        (letter, _), *below = pieces
        for _ in range(power):
            yield program.vector(letter)
        if below:
            operator = WEAK if below[0][0] < letter else STRICT
            yield program.image(operator, program.product(factors(below, below[0][1])))

    def sums(tree: Tree) -> tuple[EquationTerm, ...]:
        runs = [(letter, len(list(run))) for letter, run in groupby(tree.colors)]
        found = []
        for choice in product(*(_compositions(length) for _, length in runs)):
            pieces = [(letter, size) for (letter, _), sizes in zip(runs, choice, strict=True) for size in sizes]
            factor = Fraction(1, prod(factorial(size) for _, size in pieces))
            stage = program.product(factors(pieces, pieces[0][1] - 1))
            found.append(EquationTerm(factor, pieces[0][0], stage))
        return tuple(found)

    return sums


def _compositions(total: int) -> Iterator[tuple[int, ...]]:
    """All compositions of a number: ordered sums of positive integers."""
    if total == 0:
        yield ()
    for first in range(1, total + 1):
        for rest in _compositions(total - first):
            yield (first, *rest)


_PARTS = "b^ν_i, a^ν_ij and c^ν_i = Σ_j a^ν_ij belong to the part ν"
_TABLEAU = (CoefficientArray("A", "a", True), CoefficientArray("b", "b", False))
_NYSTROM_NOTATION = "p stands for y', q for y; positions have the weights b̄_i, velocities b_i"
_NYSTROM = (
    CoefficientArray("Abar", "ā", True),
    CoefficientArray("bbar", "b̄", False),
    CoefficientArray("b", "b", False),
    CoefficientArray("c", "c", False),
)

KINDS = {
    "runge-kutta": MethodKind("Runge–Kutta methods", "c_i = Σ_j a_ij", _TABLEAU, _runge_kutta_sums),
    "partitioned": MethodKind(
        "partitioned Runge–Kutta methods", _PARTS, _TABLEAU, _runge_kutta_sums, colors=2, has_parts=True
    ),
    "additive": MethodKind(
        "additive Runge–Kutta methods", _PARTS, _TABLEAU, _runge_kutta_sums, colors=2, has_parts=True
    ),
    "nystrom": MethodKind(
        "Runge–Kutta–Nyström methods for y'' = g(y)",
        _NYSTROM_NOTATION,
        _NYSTROM,
        _nystrom_sums,
        (StageMatrix((0,), "ā"),),
        colors=2,
        limits=[[0, None], [1, 0]],
    ),
    "general-nystrom": MethodKind(
        "Runge–Kutta–Nyström methods for y'' = g(y, y')",
        _NYSTROM_NOTATION,
        (*_NYSTROM, CoefficientArray("A", "a", True)),
        _nystrom_sums,
        (StageMatrix((0,), "ā"), StageMatrix((4,), "a")),
        colors=2,
        limits=[[None, None], [1, 0]],
    ),
    "rosenbrock": MethodKind(
        "Rosenbrock methods",
        "β_ij = α_ij + γ_ij; α_i and β_i are row sums",
        (CoefficientArray("alpha", "α", True), CoefficientArray("Gamma", "γ", True), CoefficientArray("b", "b", False)),
        _rosenbrock_sums,
        (StageMatrix((0,), "α", row_sum="α"), StageMatrix((0, 1), "β", row_sum="β")),
        structures=(EXPLICIT, DIAGONALLY_IMPLICIT),
    ),
    "splitting": MethodKind(
        "splitting methods",
        "x^ν_i h is the time of the flow of part ν in sweep i; a sweep takes the parts in their order",
        (CoefficientArray("x", "x", False),),
        _splitting_sums,
        (StageMatrix((), relation="<"), StageMatrix((), relation="≤")),
        colors=2,
        has_parts=True,
        trees=lambda order, colors: sorted(Tree.from_levels(range(len(w)), w) for w in lyndon_words(order, colors)),
    ),
}
"""The kinds by name."""
