"""The free Lie algebra of the parts of a field, and its quotients, in right-nested brackets {a,{b,{c,d}}}.

A bracket of fields is a series on coloured trees, so that any table of trees stands for a Lie algebra. On tall trees,
which are words, it is free: there are no relations but antisymmetry and the Jacobi identity, and Lyndon words tell
elements apart (Radford 1979). On trees that belong to a smaller class of fields brackets that vanish for the class are
zero, and relations between others come out by themselves. With T(p) quadratic and U(q) all brackets vanish that have
at least two more U than T, {U,{U,{U,T}}} among them, and everything that contains one of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from trees.lyndon_words import lyndon_words

if TYPE_CHECKING:
    from trees.table import TreeTable

Word = tuple[int, ...]
"""The letters of a right-nested bracket: (0, 0, 1) stands for {0,{0,1}}."""

TALL = 1
"""Children of a node in trees that are words."""


class Span:
    """A basis of the brackets that have the same letters, and coordinates in it.

    Args:
        words: The brackets in the order in which they are welcome in the basis.
        vectors: Gives the coefficients of a bracket by trees.
        trees: Those that tell brackets apart.
    """

    def __init__(self, words: Iterable[Word], vectors: Callable[[Word], Mapping[int, int]], trees: Sequence[int]):
        self.words: list[Word] = []
        self._rows: list[tuple[int, dict[int, Fraction]]] = []
        for word in words:
            if len(self.words) == len(trees):
                break
            coefficients = vectors(word)
            vector = {tree: Fraction(coefficients[tree]) for tree in trees if tree in coefficients}
            vector[self._key(len(self.words))] = Fraction(1)
            self._eliminate(vector, Fraction)
            pivot = max(vector)
            if pivot >= 0:
                self._rows.append((pivot, {key: x / vector[pivot] for key, x in vector.items()}))
                self.words.append(word)

    def coordinates(self, vector: dict[int, Any], number: Callable[[Fraction], Any]) -> list[Any]:
        """The coordinates of an element, given by its coefficients; what is left of these is none of the span's.

        Args:
            vector: Coefficients by trees; changed to what is left.
            number: Makes a coefficient of a Fraction.
        """
        self._eliminate(vector, number)
        zero = number(Fraction(0))
        return [-vector.pop(self._key(k), zero) for k in range(len(self.words))]

    @staticmethod
    def _key(k: int) -> int:
        """Where a vector counts how often the k-th word has been subtracted: trees have the numbers from 0 on."""
        return -1 - k

    def _eliminate(self, vector: dict[int, Any], number: Callable[[Fraction], Any]) -> None:
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
    """The brackets of the parts of a field, as series on a table of trees.

    Args:
        table: The trees.
        letters: The colours in the order in which words are sorted.

    Example:
        >>> from trees.table import tree_table
        >>> free = LieAlgebra(tree_table(5, 2, 1), (0, 1))
        >>> ["".join(map("TU".__getitem__, word)) for word in free.basis(5)]
        ['TTTTU', 'UTTTU', 'UUTTU', 'TTUUT', 'TUUUT', 'UUUUT']
        >>> quadratic = LieAlgebra(tree_table(5, 2, [[0, 1, 1], [None, 0]]), (0, 1))
        >>> ["".join(map("TU".__getitem__, word)) for word in quadratic.basis(5)]
        ['TTTTU', 'UTTTU', 'UUTTU', 'TTUUT']

    References:
        C. Reutenauer, *Free Lie Algebras*, Oxford 1993, chapters 4 and 5;
        R. I. McLachlan, B. Ryland, J. Math. Phys. 44 (2003) 3071–3087, doi:10.1063/1.1576904 (quadratic T).
    """

    def __init__(self, table: TreeTable, letters: Sequence[int]):
        self.table = table
        self.letters = tuple(letters)
        self._cuts = _cuts(table)
        self._trees = _by_content(table, self.letters)
        is_free = all(row[-1] == TALL == min(row) for row in table.limits)
        self._lyndon = frozenset(lyndon_words(table.max_order, table.colors)) if is_free else None
        self._vector = cache(self._bracket)
        self._spans = cache(self._made_spans)

    def basis(self, degree: int) -> list[Word]:
        """The basis of the brackets with so many letters."""
        return sorted((word for span, _ in self._spans(degree) for word in span.words), key=_place)

    def coordinates(
        self, degree: int, values: Sequence[Any], number: Callable[[Fraction], Any]
    ) -> tuple[list[Any], dict[int, Any]]:
        """The coordinates in `basis` of a field's term with so many nodes, and what is not in its span, by trees.

        Args:
            degree: The number of nodes.
            values: The coefficients of the field by trees.
            number: Makes a coefficient of a Fraction.
        """
        found: dict[Word, Any] = {}
        rest: dict[int, Any] = {}
        for span, trees in self._spans(degree):
            vector = {tree: values[tree] for tree in trees}
            found.update(zip(span.words, span.coordinates(vector, number), strict=True))
            rest |= vector
        return [found[word] for word in self.basis(degree)], rest

    def _made_spans(self, degree: int) -> list[tuple[Span, list[int]]]:
        """For each choice of so many letters the span of its brackets, and the trees that tell them apart."""
        found = []
        for content, trees in self._trees.items():
            if sum(content) == degree:
                if self._lyndon is not None:
                    trees = [tree for tree in trees if self.table[tree].colors in self._lyndon]
                words = sorted(filter(_is_welcome, _arrangements(content)), key=_rank)
                found.append((Span(words, self._vector, trees), trees))
        return found

    def _bracket(self, word: Word) -> dict[int, int]:
        """The coefficients of a bracket: {A,B} = A'B − B'A, where A is a single node."""
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


@lru_cache(maxsize=8)
def lie_algebra(table: TreeTable, letters: tuple[int, ...]) -> LieAlgebra:
    """The Lie algebra on a table of trees, made once."""
    return LieAlgebra(table, letters)


def _place(word: Word) -> tuple[Word, Word]:
    """The order in which brackets are listed: by what is innermost, and outwards from there."""
    return word[-2:], word[-3::-1]


def _rank(word: Word) -> tuple[bool, int, tuple[Word, Word]]:
    """The order in which brackets are welcome: those that vanish for quadratic T, then by the number of powers.

    TTUUT = T²U²T has three. So the basis for quadratic T is the general one without brackets, and coordinates agree.
    """
    return not _vanishes(word), sum(a != b for a, b in pairwise(word)), _place(word)


def _vanishes(word: Word) -> bool:
    """Whether a bracket is zero, or holds one that is, if the part 0 is quadratic in momenta that others lack.

    Each T raises the degree in the momenta by two and each bracket lowers it by one, so that {U,{U,{U,T}}} = 0.
    """
    degree = 1
    for letter in reversed(word):
        degree += 1 if letter == 0 else -1
        if degree < 0:
            return True
    return False


def _is_welcome(word: Word) -> bool:
    """Whether the innermost letters are as people write them: {a,b} with a before b, {a,{a,b}} and not {a,{b,a}}."""
    if len(word) < 2:
        return True
    *outer, a, b = word[-3:]
    return a != b and outer != [b] and (outer == [a] or a < b)


def _arrangements(content: Sequence[int]) -> Iterator[Word]:
    """All words with so many letters of each kind."""
    if not any(content):
        yield ()
    for letter, count in enumerate(content):
        if count:
            rest = (*content[:letter], count - 1, *content[letter + 1 :])
            for word in _arrangements(rest):
                yield (letter, *word)


def _cuts(table: TreeTable) -> list[tuple[tuple[int, int], list[tuple[int, int]]]]:
    """For each tree: its root and what is left without it if that is a tree (else −1), its leaves and the rest."""
    order = table.lists[0]
    start, trunks, branches = (list(map(int, column)) for column in table.splits[2:])
    found = []
    for tree, n in enumerate(order):
        first = start[n] + tree * (n - 1)
        stem, leaves = (-1, -1), []
        for trunk, branch in zip(trunks[first : first + n - 1], branches[first : first + n - 1], strict=True):
            if trunk < table.colors:
                stem = trunk, branch
            if branch < table.colors:
                leaves.append((branch, trunk))
        found.append((stem, leaves))
    return found


def _by_content(table: TreeTable, letters: Sequence[int]) -> dict[tuple[int, ...], list[int]]:
    """The trees that have so many nodes of each colour."""
    _, color, left, right = table.lists
    contents: list[tuple[int, ...]] = []
    found: dict[tuple[int, ...], list[int]] = {}
    for tree, (u, v) in enumerate(zip(left, right, strict=True)):
        if u < 0:
            contents.append(tuple(int(color[tree] == letter) for letter in letters))
        else:
            contents.append(tuple(map(sum, zip(contents[u], contents[v], strict=True))))
        found.setdefault(contents[tree], []).append(tree)
    return found
