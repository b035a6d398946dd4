"""The kinds of methods: their coefficients, their trees, and the sum that each tree stands for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import groupby, product
from math import factorial, prod
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.conditions.kernels import ONE
from bseries.conditions.program import Argument, Operator, Program, Summand
from trees.lyndon_words import lyndon_trees

if TYPE_CHECKING:
    from trees.tree import Tree

Sums = Callable[["Tree"], "tuple[Summand, ...]"]

FULL, EXPLICIT, DIAGONALLY_IMPLICIT = STRUCTURES = ("full", "explicit", "diagonally-implicit")
NODES = ("c", "c")

STRICT, WEAK = 0, 1
"""Operators of splitting methods: sums over all earlier sweeps, without and with the same sweep."""


class Kind(NamedTuple):
    """A kind of methods.

    Attributes:
        about: What the methods are.
        notation: What the letters in formulas mean.
        colors: Number of colours by default.
        any_colors: Whether there may be others.
        coefficients: Arguments and operators, from the names of the parts.
        sums: A function from trees to their sums, for a program.
        limits: `max_children` of the trees that elementary differentials call for.
        trees: All trees up to an order in so many colours, if they are not those of a `TreeTable`.
        has_condition: Whether a tree has a condition at all.
        structures: The structure of each matrix, where the kind dictates it.
    """

    about: str
    notation: str
    coefficients: Callable[[Sequence[str]], tuple[list[Argument], list[Operator]]]
    sums: Callable[[Program], Sums]
    colors: int = 1
    any_colors: bool = False
    limits: Any = None
    trees: Callable[[int, int], Sequence[Tree]] | None = None
    has_condition: Callable[[Tree], bool] = lambda tree: True
    structures: tuple[str, ...] | None = None


def _runge_kutta(names: Sequence[str]) -> tuple[list[Argument], list[Operator]]:
    parts = tuple(names)
    arguments = [Argument("A", "a", "a", "a", True, parts), Argument("b", "b", "b", "b", False, parts)]
    return arguments, [Operator((k,), "a", "a", name, NODES) for k, name in enumerate(parts)]


def _runge_kutta_sums(program: Program) -> Sums:
    """b · g with g(u ∘ v) = g(u) · A g(v), by the colours of the root and of v (HLW, sections III.1 and III.2)."""
    parts = len(program.operators)
    known: dict[Tree, int] = {}

    def stage(tree: Tree) -> int:
        if tree not in known:
            g = ONE
            for child in tree.children:
                g = program.times(g, program.image(child.color, stage(child)))
            known[tree] = g
        return known[tree]

    return lambda tree: (Summand(Fraction(1), parts + tree.color, stage(tree)),)


def _nystrom(names: Sequence[str]) -> tuple[list[Argument], list[Operator]]:
    arguments = [
        Argument("Abar", "ā", r"\bar{a}", "abar", True),
        Argument("bbar", "b̄", r"\bar{b}", "bbar", False),
        Argument("b", "b", "b", "b", False),
        Argument("c", "c", "c", "c", False),
    ]
    return arguments, [Operator((0,), "ā", r"\bar{a}")]


def _general_nystrom(names: Sequence[str]) -> tuple[list[Argument], list[Operator]]:
    arguments, operators = _nystrom(names)
    return [*arguments, Argument("A", "a", "a", "a", True)], [*operators, Operator((4,), "a", "a")]


def _nystrom_sums(program: Program) -> Sums:
    """Colours are p = y' and q = y: q[τ] with τ rooted in p is a fat edge, with the matrix Ā or the weights b̄.

    A leaf q is a factor c_i, a child rooted in p a factor with the matrix A (Hairer–Nørsett–Wanner, section II.14).
    """
    abar, bbar, b, c, a = 0, 1, 2, 3, 1
    known: dict[Tree, int] = {}

    def factor(child: Tree) -> int:
        if child.color == 0:
            return program.image(a, stage(child))
        return program.image(abar, stage(child.children[0])) if child.children else program.vector(c)

    def stage(tree: Tree) -> int:
        if tree not in known:
            g = ONE
            for child in tree.children:
                g = program.times(g, factor(child))
            known[tree] = g
        return known[tree]

    def sums(tree: Tree) -> tuple[Summand, ...]:
        block, g = (b, tree) if tree.color == 0 else (bbar, tree.children[0])
        return (Summand(Fraction(1), block, stage(g)),)

    return sums


def _rosenbrock(names: Sequence[str]) -> tuple[list[Argument], list[Operator]]:
    arguments = [
        Argument("alpha", "α", r"\alpha", "alpha", True),
        Argument("Gamma", "γ", r"\gamma", "gamma", True),
        Argument("b", "b", "b", "b", False),
    ]
    operators = [
        Operator((0,), "α", r"\alpha", "", ("α", r"\alpha")),
        Operator((0, 1), "β", r"\beta", "", ("β", r"\beta")),
    ]
    return arguments, operators


def _rosenbrock_sums(program: Program) -> Sums:
    """An only child is applied with β = α + γ, several children with α (Hairer–Wanner, section IV.7)."""
    alpha, beta, b = 0, 1, 2
    known: dict[Tree, int] = {}

    def stage(tree: Tree) -> int:
        if tree not in known:
            operator = beta if len(tree.children) == 1 else alpha
            g = ONE
            for child in tree.children:
                g = program.times(g, program.image(operator, stage(child)))
            known[tree] = g
        return known[tree]

    return lambda tree: (Summand(Fraction(1), b, stage(tree)),)


def _splitting(names: Sequence[str]) -> tuple[list[Argument], list[Operator]]:
    return [Argument("x", "x", "x", "x", False, tuple(names))], [
        Operator((), relation="<"),
        Operator((), relation="≤"),
    ]


def _splitting_sums(program: Program) -> Sums:
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

    def sums(tree: Tree) -> tuple[Summand, ...]:
        runs = [(letter, len(list(run))) for letter, run in groupby(tree.colors)]
        found = []
        for choice in product(*(_compositions(length) for _, length in runs)):
            pieces = [(letter, size) for (letter, _), sizes in zip(runs, choice, strict=True) for size in sizes]
            factor = Fraction(1, prod(factorial(size) for _, size in pieces))
            found.append(Summand(factor, pieces[0][0], stage(pieces, pieces[0][1] - 1)))
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
    """y₁ = y₀ + h y₀' + … holds by construction."""
    return tree.color == 0 or tree.order > 1


_PARTS = "b^ν_i, a^ν_ij and c^ν_i = Σ_j a^ν_ij belong to the part ν"
_NYSTROM = "p stands for y', q for y; positions have the weights b̄_i, velocities b_i"

KINDS = {
    "runge-kutta": Kind("Runge–Kutta methods", "c_i = Σ_j a_ij", _runge_kutta, _runge_kutta_sums),
    "partitioned": Kind("partitioned Runge–Kutta methods", _PARTS, _runge_kutta, _runge_kutta_sums, 2, True),
    "additive": Kind("additive Runge–Kutta methods", _PARTS, _runge_kutta, _runge_kutta_sums, 2, True),
    "nystrom": Kind(
        "Runge–Kutta–Nyström methods for y'' = g(y)",
        _NYSTROM,
        _nystrom,
        _nystrom_sums,
        2,
        limits=[[0, None], [1, 0]],
        has_condition=_is_not_position,
    ),
    "general-nystrom": Kind(
        "Runge–Kutta–Nyström methods for y'' = g(y, y')",
        _NYSTROM,
        _general_nystrom,
        _nystrom_sums,
        2,
        limits=[[None, None], [1, 0]],
        has_condition=_is_not_position,
    ),
    "rosenbrock": Kind(
        "Rosenbrock methods",
        "β_ij = α_ij + γ_ij; α_i and β_i are row sums",
        _rosenbrock,
        _rosenbrock_sums,
        structures=(EXPLICIT, DIAGONALLY_IMPLICIT),
    ),
    "splitting": Kind(
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
