"""Lyndon words, each smaller than all its rotations.

They freely generate the shuffle algebra (Radford 1979) and index bases of the free Lie algebra.
"""

from __future__ import annotations

from collections.abc import Iterator


def lyndon_words(length: int, letters: int) -> Iterator[tuple[int, ...]]:
    """All Lyndon words of up to `length` letters 0 … letters−1 in lexicographic order (Duval's algorithm)."""
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
    """Numbers of Lyndon words of 1, …, `length` letters: Witt's formula, from Σ_{d|n} d L(d) = letters^n."""
    counts: list[int] = []
    for n in range(1, length + 1):
        shorter = sum(d * counts[d - 1] for d in range(1, n) if n % d == 0)
        counts.append((letters**n - shorter) // n)
    return counts
