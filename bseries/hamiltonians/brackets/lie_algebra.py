"""Free Lie algebras of the parts of a field, and their quotients, in right-nested brackets {a,{b,{c,d}}}.

A bracket of fields is a series, so that any basis defines a Lie algebra. On words it is free: antisymmetry and the
Jacobi identity are the only relations, and the coefficients of Lyndon words determine an element (Radford 1979). On the
trees of a smaller class of fields, brackets that vanish for the class are zero and further relations follow. For
quadratic T(p) and U(q) all brackets with at least two more U than T vanish, such as {U,{U,{U,T}}}, and all brackets
that contain one of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache, lru_cache
from itertools import pairwise
from typing import Any, TypeAlias

from trees.basis import Basis
from trees.lyndon_words import lyndon_words
from trees.words import Words

RingElement: TypeAlias = Any
"""A coefficient: an int, float or Fraction, or an element of a SymPy domain, whose classes differ by domain."""
Number: TypeAlias = Callable[[Fraction], RingElement]
"""Makes an element of the ring of coefficients."""

Word = tuple[int, ...]  # the letters of a right-nested bracket: (0, 0, 1) stands for {0,{0,1}}


class Span:
    """Basis of the brackets with the same letters, given in order of preference, and coordinates in it.

    The coefficients of `trees` determine an element.
    """

    def __init__(self, words: Iterable[Word], vectors: Callable[[Word], Mapping[int, int]], trees: Sequence[int]):
        self.words: list[Word] = []
        self._rows: list[tuple[int, dict[int, Fraction]]] = []
        for word in words:
            if len(self.words) == len(trees):
                break
            coefficients = vectors(word)
            vector = {tree: Fraction(coefficients[tree]) for tree in trees if tree in coefficients}
            # Trees have the keys 0, 1, …; −1 − k is that of the multiple of the k-th word that was subtracted.
            vector[-1 - len(self.words)] = Fraction(1)
            self._eliminate(vector, Fraction)
            pivot = max(vector)
            if pivot >= 0:
                self._rows.append((pivot, {key: x / vector[pivot] for key, x in vector.items()}))
                self.words.append(word)

    def coordinates(self, vector: dict[int, RingElement], number: Number) -> list[RingElement]:
        """The coordinates of an element with given coefficients by tree; `vector` becomes the remainder."""
        self._eliminate(vector, number)
        zero = number(Fraction(0))
        return [-vector.pop(-1 - k, zero) for k in range(len(self.words))]

    def _eliminate(self, vector: dict[int, RingElement], number: Number) -> None:
        for pivot, row in self._rows:
            factor = vector.get(pivot)
            if not factor:
                continue
            for key, x in row.items():
                value = vector[key] - factor * number(x) if key in vector else -factor * number(x)
                if value:
                    vector[key] = value
                else:
                    del vector[key]


class LieAlgebra:
    """Lie algebra of the brackets of the parts of a field, as series on a basis of trees.

    The colours `letters` are in the sorting order of words.

    References:
        C. Reutenauer, *Free Lie Algebras*, Oxford 1993, chapters 4 and 5;
        R. I. McLachlan, B. Ryland, J. Math. Phys. 44 (2003) 3071–3087, doi:10.1063/1.1576904 (quadratic T).
    """

    def __init__(self, basis: Basis[Any], letters: Sequence[int]):
        self.basis = basis
        self.letters = tuple(letters)
        self._cuts = _cuts(basis)
        self._trees = _by_content(basis, self.letters)
        is_free = isinstance(basis, Words)
        self._lyndon = frozenset(lyndon_words(basis.max_order, basis.colors)) if is_free else None
        self._vector = cache(self._bracket)
        self._spans = cache(self._find_spans)

    def brackets(self, degree: int) -> list[Word]:
        """The basis of the brackets with this number of letters."""
        return sorted((word for span, _ in self._spans(degree) for word in span.words), key=_listing_order)

    def coordinates(
        self, degree: int, values: Sequence[RingElement], number: Number
    ) -> tuple[list[RingElement], dict[int, RingElement]]:
        """The coordinates in `brackets` of one term of a field, and the remainder outside the span, by tree."""
        found: dict[Word, RingElement] = {}
        rest: dict[int, RingElement] = {}
        for span, trees in self._spans(degree):
            vector = {tree: values[tree] for tree in trees}
            found.update(zip(span.words, span.coordinates(vector, number), strict=True))
            rest |= vector
        return [found[word] for word in self.brackets(degree)], rest

    def _find_spans(self, degree: int) -> list[tuple[Span, list[int]]]:
        """The span of the brackets for each content of letters, with the trees that determine its elements."""
        found = []
        for content, trees in self._trees.items():
            if sum(content) == degree:
                if self._lyndon is not None:
                    trees = [tree for tree in trees if self.basis.letters(self.basis[tree]) in self._lyndon]
                words = sorted(filter(_is_preferred, _arrangements(content)), key=_preference)
                found.append((Span(words, self._vector, trees), trees))
        return found

    def _bracket(self, word: Word) -> dict[int, int]:
        """The coefficients of the bracket {A,B} = A'B − B'A, where A is a single node."""
        color = self.letters[word[0]]
        if len(word) == 1:
            return {color: 1}
        inner, found = self._vector(word[1:]), {}
        for tree in self._trees.get(tuple(map(word.count, range(len(self.letters)))), ()):
            (root, branch), leaves = self._cuts[tree]
            total = inner.get(branch, 0) if root == color else 0
            total -= sum(inner.get(trunk, 0) for leaf, trunk in leaves if leaf == color)
            if total:
                found[tree] = total
        return found


lie_algebra = lru_cache(maxsize=8)(LieAlgebra)  # the Lie algebra on a basis of trees, cached


def _listing_order(word: Word) -> tuple[Word, Word]:
    """Sorting key of listed brackets: the letters from the innermost outwards."""
    return word[-2:], word[-3::-1]


def _preference(word: Word) -> tuple[bool, int, tuple[Word, Word]]:
    """Sorting key of brackets for the basis: those that vanish for quadratic T first, then by the number of powers.

    For example TTUUT = T²U²T has three powers. The basis for quadratic T is then a part of the general basis, with the
    same coordinates.
    """
    return not _vanishes_for_quadratic(word), sum(a != b for a, b in pairwise(word)), _listing_order(word)


def _vanishes_for_quadratic(word: Word) -> bool:
    """Whether a bracket contains one that vanishes if the part 0 is quadratic in the momenta and the others lack them.

    T has degree two in the momenta, and each bracket lowers the degree by one, so that {U,{U,{U,T}}} = 0.
    """
    degree = 1
    for letter in reversed(word):
        degree += 1 if letter == 0 else -1
        if degree < 0:
            return True
    return False


def _is_preferred(word: Word) -> bool:
    """Whether the innermost letters have the usual order: {a,b} with a before b, {a,{a,b}} and not {a,{b,a}}."""
    if len(word) < 2:
        return True
    *outer, a, b = word[-3:]
    return a != b and outer != [b] and (outer == [a] or a < b)


def _arrangements(content: Sequence[int]) -> Iterator[Word]:
    """All words with given numbers of letters."""
    from sympy.utilities.iterables import multiset_permutations

    return map(tuple, multiset_permutations([letter for letter, count in enumerate(content) for _ in range(count)]))


def _cuts(basis: Basis[Any]) -> list[tuple[tuple[int, int], list[tuple[int, int]]]]:
    """For each tree its root and branch (−1 for several branches), and its leaves with the remaining trees."""
    found = []
    for cuts in basis.cut_chunks():
        start, trunks, branches = (list(map(int, column)) for column in cuts[2:5])
        for first, last in pairwise(start):
            stem, leaves = (-1, -1), []
            for trunk, branch in zip(trunks[first:last], branches[first:last], strict=True):
                if trunk < basis.colors:
                    stem = trunk, branch
                if branch < basis.colors:
                    leaves.append((branch, trunk))
            found.append((stem, leaves))
    return found


def _by_content(basis: Basis[Any], letters: Sequence[int]) -> dict[tuple[int, ...], list[int]]:
    """The trees by their numbers of nodes of each colour."""
    found: dict[tuple[int, ...], list[int]] = {}
    for at, tree in enumerate(basis):
        found.setdefault(tuple(map(basis.letters(tree).count, letters)), []).append(at)
    return found
