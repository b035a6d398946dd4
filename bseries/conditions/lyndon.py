"""Order conditions of splitting methods: one for each Lyndon word in the names of the fields.

A splitting method with s sweeps through the exact flows of K fields,

    φ^[K](x^K_s h) ∘ … ∘ φ^[1](x^1_s h) ∘ … ∘ φ^[K](x^K_1 h) ∘ … ∘ φ^[1](x^1_1 h),

is a product of exponentials, and so is the exact flow of the sum. Expanded in words of Lie derivatives their
coefficients are characters of the shuffle algebra, which the Lyndon words generate freely (Radford 1979): two such
characters that agree on the Lyndon words with up to n letters agree on all words with up to n letters. The coefficient
of a word is that of a tall tree, and of any tree it is the sum over its linear extensions. So the tall trees whose
colours, from the root, spell a Lyndon word give a minimal set of conditions; Witt's formula counts them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import groupby, product
from math import factorial, prod

from bseries.conditions.kernels import ONE
from bseries.conditions.program import Program, Summand
from trees.tree import Tree

STRICT, WEAK = 0, 1
"""Operators: the sum over all earlier sweeps, and with the same sweep."""


def lyndon_words(length: int, letters: int) -> Iterator[tuple[int, ...]]:
    """All Lyndon words with up to `length` letters 0 … letters−1, lexicographically (Duval's algorithm)."""
    word = [-1]
    while word:
        word[-1] += 1
        yield tuple(word)
        period = len(word)
        while len(word) < length:
            word.append(word[-period])
        while word and word[-1] == letters - 1:
            word.pop()


def count_lyndon_words(length: int, letters: int) -> list[int]:
    """How many there are with 1, 2, …, `length` letters: Witt's formula, from Σ_{d|n} d L(d) = letters^n."""
    counts: list[int] = []
    for n in range(1, length + 1):
        shorter = sum(d * counts[d - 1] for d in range(1, n) if n % d == 0)
        counts.append((letters**n - shorter) // n)
    return counts


def lyndon_trees(order: int, colors: int) -> Sequence[Tree]:
    """The tall trees whose colours from the root spell a Lyndon word, in the order of a table."""
    return sorted(Tree.from_levels(range(len(word)), word) for word in lyndon_words(order, colors))


def lyndon_sums(program: Program) -> Callable[[Tree], tuple[Summand, ...]]:
    """The coefficient of a tall tree as sums over sweeps.

    r equal letters in one flow make x^r/r!. So a word is cut in all ways into pieces of equal letters, and the pieces,
    from the root down, belong to flows each of which acts before the one above.
    """

    def below(pieces: Sequence[tuple[int, int]], color: int) -> int:
        """The sum over all flows that act before a flow of the field `color`, sweep by sweep."""
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
    """All ways to write a number as an ordered sum of positive ones."""
    if total == 0:
        yield ()
    for first in range(1, total + 1):
        for rest in _compositions(total - first):
            yield (first, *rest)
