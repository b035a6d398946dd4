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
    ONE,
    CoefficientArray,
    ConditionProgram,
    EquationTerm,
    StageMatrix,
)
from trees.lyndon_words import lyndon_trees
from trees.tree import Tree

Sums = Callable[["Tree"], "tuple[EquationTerm, ...]"]
Coefficients = tuple[Sequence[CoefficientArray], Sequence[StageMatrix]]

NODES = ("c", "c")

STRICT, WEAK = 0, 1
"""Operators of splitting methods: sums over all earlier sweeps, without and with the same sweep."""


class MethodKind(NamedTuple):
    """A kind of methods."""

    about: str  # the name of the methods in text
    notation: str  # the meaning of the letters in formulas
    coefficients: Callable[[Sequence[str]], Coefficients]  # arguments and operators, from the names of the parts
    sums: Callable[[ConditionProgram], Sums]  # the function from trees to their sums, for a program
    colors: int = 1  # the default number of colours
    any_colors: bool = False  # whether other numbers are allowed
    limits: Any = None  # `max_children` of the trees with nonzero elementary differentials
    trees: Callable[[int, int], Sequence[Tree]] | None = None  # all trees, if they are not those of a `TreeTable`
    has_condition: Callable[[Tree], bool] = lambda tree: True
    structures: tuple[str, ...] | None = None  # the structure of each matrix, if the kind determines it


def _runge_kutta(names: Sequence[str]) -> Coefficients:
    parts = tuple(names)
    arguments = [CoefficientArray("A", "a", "a", True, parts), CoefficientArray("b", "b", "b", False, parts)]
    return arguments, [StageMatrix((k,), "a", "a", name, NODES) for k, name in enumerate(parts)]


def _stage_vectors(
    program: ConditionProgram, factor: Callable[[Tree, Tree, Callable[[Tree], int]], int]
) -> Callable[[Tree], int]:
    """The function from trees to stage vectors, products of factor(tree, child, stage vectors) over the children."""
    known: dict[Tree, int] = {}

    def stage(tree: Tree) -> int:
        if tree not in known:
            g = ONE
            for child in tree.children:
                g = program.times(g, factor(tree, child, stage))
            known[tree] = g
        return known[tree]

    return stage


def _runge_kutta_sums(program: ConditionProgram) -> Sums:
    """b · g with g(u ∘ v) = g(u) · A g(v), by the colours of the root and of v (HLW, sections III.1 and III.2)."""
    parts = len(program.operators)
    stage = _stage_vectors(program, lambda tree, child, stage: program.image(child.color, stage(child)))
    return lambda tree: (EquationTerm(Fraction(1), parts + tree.color, stage(tree)),)


def _nystrom(names: Sequence[str]) -> Coefficients:
    arguments = [
        CoefficientArray("Abar", "ā", r"\bar{a}", True),
        CoefficientArray("bbar", "b̄", r"\bar{b}", False),
        CoefficientArray("b", "b", "b", False),
        CoefficientArray("c", "c", "c", False),
    ]
    return arguments, [StageMatrix((0,), "ā", r"\bar{a}")]


def _general_nystrom(names: Sequence[str]) -> Coefficients:
    arguments, operators = _nystrom(names)
    return [*arguments, CoefficientArray("A", "a", "a", True)], [*operators, StageMatrix((4,), "a", "a")]


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


def _rosenbrock(names: Sequence[str]) -> Coefficients:
    arguments = [
        CoefficientArray("alpha", "α", r"\alpha", True),
        CoefficientArray("Gamma", "γ", r"\gamma", True),
        CoefficientArray("b", "b", "b", False),
    ]
    operators = [
        StageMatrix((0,), "α", r"\alpha", "", ("α", r"\alpha")),
        StageMatrix((0, 1), "β", r"\beta", "", ("β", r"\beta")),
    ]
    return arguments, operators


def _rosenbrock_sums(program: ConditionProgram) -> Sums:
    """An only child is applied with β = α + γ, several children with α (Hairer–Wanner, section IV.7)."""
    alpha, beta, b = 0, 1, 2

    def factor(tree: Tree, child: Tree, stage: Callable[[Tree], int]) -> int:
        return program.image(beta if len(tree.children) == 1 else alpha, stage(child))

    stage = _stage_vectors(program, factor)
    return lambda tree: (EquationTerm(Fraction(1), b, stage(tree)),)


def _splitting(names: Sequence[str]) -> Coefficients:
    return [CoefficientArray("x", "x", "x", False, tuple(names))], [
        StageMatrix((), relation="<"),
        StageMatrix((), relation="≤"),
    ]


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

    def below(pieces: Sequence[tuple[int, int]], color: int) -> int:
        """Sum over all flows that act before a flow of the field `color`, sweep by sweep."""
        if not pieces:
            return ONE
        letter, length = pieces[0]
        return program.image(WEAK if letter < color else STRICT, stage(pieces, length))

    def stage(pieces: Sequence[tuple[int, int]], power: int) -> int:
        letter = pieces[0][0]
        g = ONE
        for _ in range(power):
            g = program.times(g, program.vector(letter))
        return program.times(g, below(pieces[1:], letter)) if len(pieces) > 1 else g

    def sums(tree: Tree) -> tuple[EquationTerm, ...]:
        runs = [(letter, len(list(run))) for letter, run in groupby(tree.colors)]
        found = []
        for choice in product(*(_compositions(length) for _, length in runs)):
            pieces = [(letter, size) for (letter, _), sizes in zip(runs, choice, strict=True) for size in sizes]
            factor = Fraction(1, prod(factorial(size) for _, size in pieces))
            found.append(EquationTerm(factor, pieces[0][0], stage(pieces, pieces[0][1] - 1)))
        return tuple(found)

    return sums


def _compositions(total: int) -> Iterator[tuple[int, ...]]:
    """All compositions of a number: ordered sums of positive integers."""
    if total == 0:
        yield ()
    for first in range(1, total + 1):
        for rest in _compositions(total - first):
            yield (first, *rest)


def _is_not_position(tree: Tree) -> bool:
    """Whether a tree has a condition: y₁ = y₀ + h y₀' + … holds by construction."""
    return tree.color == 0 or tree.order > 1


_PARTS = "b^ν_i, a^ν_ij and c^ν_i = Σ_j a^ν_ij belong to the part ν"
_NYSTROM = "p stands for y', q for y; positions have the weights b̄_i, velocities b_i"

KINDS = {
    "runge-kutta": MethodKind("Runge–Kutta methods", "c_i = Σ_j a_ij", _runge_kutta, _runge_kutta_sums),
    "partitioned": MethodKind("partitioned Runge–Kutta methods", _PARTS, _runge_kutta, _runge_kutta_sums, 2, True),
    "additive": MethodKind("additive Runge–Kutta methods", _PARTS, _runge_kutta, _runge_kutta_sums, 2, True),
    "nystrom": MethodKind(
        "Runge–Kutta–Nyström methods for y'' = g(y)",
        _NYSTROM,
        _nystrom,
        _nystrom_sums,
        2,
        limits=[[0, None], [1, 0]],
        has_condition=_is_not_position,
    ),
    "general-nystrom": MethodKind(
        "Runge–Kutta–Nyström methods for y'' = g(y, y')",
        _NYSTROM,
        _general_nystrom,
        _nystrom_sums,
        2,
        limits=[[None, None], [1, 0]],
        has_condition=_is_not_position,
    ),
    "rosenbrock": MethodKind(
        "Rosenbrock methods",
        "β_ij = α_ij + γ_ij; α_i and β_i are row sums",
        _rosenbrock,
        _rosenbrock_sums,
        structures=(EXPLICIT, DIAGONALLY_IMPLICIT),
    ),
    "splitting": MethodKind(
        "splitting methods",
        "x^ν_i h is the time of the flow of part ν in sweep i; a sweep takes the parts in their order",
        _splitting,
        _splitting_sums,
        2,
        True,
        trees=lyndon_trees,
    ),
}
"""The kinds by name."""
