"""Words in letters as a basis: series of operators in a free associative algebra, such as products of exponentials."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

from trees import counting
from trees.basis import Basis, Cuts, Growth
from trees.errors import TreeError
from trees.notation import default_names

Word = tuple[int, ...]


class Words(Basis[Word]):
    """All words of 1 … `order` letters in `colors` letters, by length and then alphabetically, as tuples of numbers.

    A word is cut between two letters into the trunk in front and the branch behind. A tall tree, whose nodes have one
    child at most, is the word of its colours from the root to the leaf, with the same cuts, so that a series on words
    is the restriction of one on trees. Composing flows multiplies the series of words: the letters of the second come
    first. Coefficients of products of exponentials are multiplicative for the shuffle product (C. Reutenauer, *Free
    Lie Algebras*, Oxford 1993, theorem 3.2; A. Murua, Found. Comput. Math. 6 (2006) 387–426,
    doi:10.1007/s10208-003-0111-0).

    Args:
        order: Largest number of letters in a word.
        colors: Number of letters.

    Raises:
        TreeError: An argument is out of range, or the words would not fit in memory (refused before any work).

    Example:
        >>> import bseries as bs
        >>> words = bs.trees.Words(2)
        >>> [words.text(word) for word in words]
        ['p', 'q', 'p p', 'p q', 'q p', 'q q']
    """

    what, unit = "words", "letter"
    growth = Growth(branches=lambda n, k: 1, cuts=lambda n: n - 1, products=lambda n: n + 1)

    def __init__(self, order: int, colors: int = 2):
        self.max_order, self.colors = counting.check_size(order, colors)
        self.sizes = [self.colors**n for n in range(1, self.max_order + 1)]
        cuts = sum(n * size for n, size in enumerate(self.sizes))
        counting.refuse_table_beyond_memory(8 * cuts, f"the words with up to {order} letters")
        self._complete = True

    @cached_property
    def exact_flow(self) -> list[int]:
        """1 for every word: letters are cut off from its end on."""
        return [1] * len(self)

    def rows(self, at: int) -> list[tuple[int, int, int]]:
        """The cuts of a word, from its end on."""
        n, first = self.order_of(at), [0, *self.offsets]
        pieces = (divmod(at - self.offsets[n - 1], self.colors**k) for k in range(1, n))
        return [(first[n - k] + front, first[k] + behind, 1) for k, (front, behind) in enumerate(pieces, 1)]

    def cut_chunks(self) -> Iterator[Cuts]:
        """The cuts of all words."""
        if not self.compiled:
            yield from super().cut_chunks()
            return
        import numpy as np

        trunk, branch = [], []
        for n, size in enumerate(self.sizes, 1):
            codes = np.arange(size)
            pieces = [np.divmod(codes, self.colors**k) for k in range(1, n)]
            trunk += [np.array([x + self.offsets[n - 1 - k] for k, (x, _) in enumerate(pieces, 1)], int).T.ravel()]
            branch += [np.array([x + self.offsets[k - 1] for k, (_, x) in enumerate(pieces, 1)], int).T.ravel()]
        start = np.concatenate([[0], np.cumsum(self.order.astype(int) - 1)])
        yield Cuts(0, len(self), start, *(np.concatenate(x).astype(np.uint32) for x in (trunk, branch)))

    def prefixes(self, color: int | None) -> Iterator[tuple[int, int, slice, slice]]:
        """The words of n letters that begin with k times a letter, or any k: n, k, and the ids of words and rests.

        The ids are those of a list whose first entry is the empty word. Longer words come first.
        """
        start = [0, *(1 + offset for offset in self.offsets)]
        for n in range(self.max_order, 0, -1):
            for k in range(1, n + 1):
                size, equal = self.colors ** (n - k), sum(self.colors**i for i in range(k))
                rest = slice(start[n - k], start[n - k] + size)
                for prefix in range(self.colors**k) if color is None else [color * equal]:
                    first = start[n] + prefix * size
                    yield n, k, slice(first, first + size), rest

    def element(self, at: int) -> Word:
        """The word with an id."""
        n = self.order_of(at)
        rest, letters = at - self.offsets[n - 1], []
        for _ in range(n):
            rest, letter = divmod(rest, self.colors)
            letters.append(letter)
        return tuple(reversed(letters))

    def find(self, element: object) -> int:
        """The id of a word; negative if it is none."""
        if not isinstance(element, tuple) or not 0 < len(element) <= self.max_order:
            return -1
        code = 0
        for letter in element:
            if letter not in range(self.colors):
                return -1
            code = code * self.colors + int(letter)
        return self.offsets[len(element) - 1] + code

    def letters(self, element: Word) -> tuple[int, ...]:
        """The letters of a word."""
        return element

    def read(self, text: str, names: Sequence[str] | None = None) -> Word:
        """The word that a text stands for: names of letters with spaces between them."""
        known = list(names or self.names)
        try:
            return tuple(map(known.index, text.split()))
        except ValueError:
            letters = ", ".join(known)
            raise TreeError(
                f"text must be letters among {letters}, with spaces between, but was {text!r:.60}"
            ) from None

    def text(self, element: Word, names: Sequence[str] | None = None) -> str:
        """The text of a word."""
        known = names or self.names
        return " ".join(known[letter] for letter in element)

    def latex(self, element: Word, names: Sequence[str] | None = None) -> str:
        """The word as a product of letters."""
        return self.text(element, names)

    def truncated(self, order: int) -> Words:
        """The words with at most `order` letters."""
        return Words(order, self.colors)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The default names of the letters."""
        return ("a",) if self.colors == 1 else default_names(self.colors)
