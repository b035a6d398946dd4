"""Lyndon words against their definition."""

from trees.lyndon_words import count_lyndon_words, lyndon_words


def test_lyndon_words_are_smaller_than_their_rotations():
    words = set(lyndon_words(6, 2))
    everything = [tuple(int(c) for c in f"{k:0{n}b}") for n in range(1, 7) for k in range(2**n)]
    assert words == {w for w in everything if all(w < w[k:] + w[:k] for k in range(1, len(w)))}
    assert count_lyndon_words(6, 2) == [sum(len(w) == n for w in words) for n in range(1, 7)]
