"""The Baker–Campbell–Hausdorff series log(exp A exp B) in the Lyndon basis of the free Lie algebra, to high degrees.

For odd degrees the coordinates follow from Goldberg's coefficients of words by a triangular system
(`bseries.hamiltonians.brackets.lyndon_kernels`). Since exp(−A/2) log(exp A exp B) exp(A/2) is odd, the even degrees are
tanh(ad_A/2) of the odd ones, and [A, P_x] = P_Ax.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import accumulate
from typing import Any

from bseries.exact.rationals import primes_up_to
from bseries.hamiltonians.brackets import lyndon_kernels as kernels
from trees.lyndon_words import count_lyndon_words

MOST_LETTERS = 20
"""Of these words, 111,013 are Lyndon words; each further letter takes five times as long."""
PRIME = 2**31 - 1
"""Checks the results modulo 2^64."""


def bch_terms(order: int, names: Sequence[str], *, symmetric: bool) -> list[dict[tuple[str, ...], Fraction]]:
    """The coordinates of log(exp A exp B), or of log(exp(A/2) exp B exp(A/2)), by degree and Lyndon word.

    Example:
        >>> bch_terms(3, "AB", symmetric=False)[2]
        {('A', 'A', 'B'): Fraction(1, 12), ('A', 'B', 'B'): Fraction(1, 12)}
    """
    import numpy as np

    words = LyndonWords(order)
    odd = {1: ([1, 1], 1)} | {n: odd_coordinates(words, n) for n in range(3, order + 1, 2)}
    powers = range(order)
    if symmetric:  # the odd degrees, divided by cosh(ad_A/2)
        operator = _over_cosh([Fraction(int(k == 0)) for k in powers])
    else:
        operator = _over_cosh([Fraction(k % 2, 2**k * math.factorial(k)) for k in powers])
    letters, terms = np.array(list(names), object), []
    for n in range(1, order + 1):
        numerators, denominator = (not symmetric and odd.get(n)) or _applied(operator, odd, words, n)
        coordinates = [Fraction(x, denominator) for x in numerators]
        bits = words.codes[words.of_length(n)][:, None] >> np.arange(n)[::-1] & 1
        terms.append(dict(zip(map(tuple, letters[bits].tolist()), coordinates, strict=True)))
    return terms


def _over_cosh(series: Sequence[Fraction]) -> list[Fraction]:
    """The power series of a function, divided by cosh(x/2)."""
    quotient: list[Fraction] = []
    for k, x in enumerate(series):
        even = range(k % 2, k, 2)
        quotient.append(x - sum(quotient[j] / (2 ** (k - j) * math.factorial(k - j)) for j in even))
    return quotient


def _applied(
    operator: Sequence[Fraction], odd: dict[int, tuple[list[int], int]], words: LyndonWords, n: int
) -> tuple[list[int], int]:
    """The term of degree n of a power series in ad_A, applied to an element with terms of odd degree.

    Coordinates are integers over a common denominator, those of the result too.
    """
    factors = {m: operator[n - m] / odd[m][1] for m in odd if m <= n and operator[n - m]}
    denominator = math.lcm(*(factor.denominator for factor in factors.values()))
    found = [0] * len(words.of_length(n))
    first = words.of_length(n).start
    for m, factor in factors.items():
        multiple = int(factor * denominator)
        places = words.place[(1 << n) + words.codes[words.of_length(m)]].tolist()
        for at, x in zip(places, odd[m][0], strict=True):
            if at >= 0:  # A^n is no Lyndon word
                found[at - first] += multiple * x
    return found, denominator


def goldberg_coefficients(n: int) -> Iterator[tuple[tuple[int, ...], Fraction]]:
    """Coefficients of the words A…B of n letters in log(exp A exp B), by the lengths of their blocks of equal letters.

    A word of m blocks of lengths s_i, m even, has ∫₀¹ t^(m/2) (t−1)^(m/2−1) Π G_(s_i)(t) dt with the polynomials
    G_1 = 1, s G_s = (t (t−1) G_(s−1))′.

    Example:
        >>> dict(goldberg_coefficients(3))
        {(2, 1): Fraction(1, 12)}

    References:
        K. Goldberg, Duke Math. J. 23 (1956) 13–21, doi:10.1215/S0012-7094-56-02302-X.
    """
    import flint

    t = flint.fmpq_poly([0, 1])
    polynomials = [t, t**0]
    for s in range(2, n + 1):
        polynomials.append((t * (t - 1) * polynomials[-1]).derivative() / s)

    def extended(blocks: tuple[int, ...], product: Any, rest: int) -> Iterator[Any]:
        """All continuations by blocks no longer than the last, first some longer than 1, then some of length 1."""
        m = len(blocks) + rest
        if m % 2 == 0:
            integral = (t ** (m // 2) * (t - 1) ** (m // 2 - 1) * product).integral()(1)
            yield blocks + (1,) * rest, Fraction(int(integral.p), int(integral.q))
        for s in range(2, min(rest, *blocks[-1:]) + 1 if blocks else rest + 1):
            yield from extended((*blocks, s), product * polynomials[s], rest - s)

    return extended((), t**0, n)


class LyndonWords:
    """The Lyndon words in two letters of up to `length` letters, by length and then alphabetically; see the kernel."""

    def __init__(self, length: int):
        import numpy as np

        counts = count_lyndon_words(length, 2)
        self.offsets = [0, *accumulate(counts)]
        self.lengths, self.left, self.right = np.zeros((3, sum(counts)), np.int32)
        self.codes = np.zeros(sum(counts), np.int64)
        self.place = np.empty(2 ** (length + 1), np.int32)
        self.norms = np.zeros(sum(counts))
        kernels.lyndon_words.compiled(length, self.place, self.lengths, self.codes, self.left, self.right, self.norms)

    def of_length(self, n: int) -> range:
        """The indices of the words with n letters."""
        return range(self.offsets[n - 1], self.offsets[n])


def odd_coordinates(words: LyndonWords, n: int) -> tuple[list[int], int]:
    """The coordinates of the term of odd degree n ≥ 3 of log(exp A exp B), over their common denominator."""
    import numpy as np

    coefficients = dict(goldberg_coefficients(n))
    denominator = math.lcm(*(x.denominator for x in coefficients.values()))
    primes = np.array([1, *primes_up_to(n * n)[:n]])
    numerators = {math.prod(primes[list(blocks)].tolist()): int(x * denominator) for blocks, x in coefficients.items()}
    by_number = np.zeros(max(numerators) + 1, np.int64)
    by_number[list(numerators)] = list(numerators.values())
    ids = np.array(words.of_length(n))
    numbers = np.empty(len(ids), np.int64)
    kernels.heinz_numbers.compiled(words.codes[ids], n, primes, numbers)
    wanted = by_number[numbers]
    ones = np.array([code.bit_count() for code in words.codes[ids].tolist()])
    found = np.empty(len(ids), np.int64)
    for letters in range(1, n):
        members = np.flatnonzero(ones == letters)
        found[members] = _solve_class(words, ids[members].astype(np.int32), n, wanted[members])
    return found.tolist(), denominator


def _solve_class(words: LyndonWords, members: Any, n: int, wanted: Any) -> Any:
    """The numerators of the coordinates of the Lyndon words with given numbers of letters."""
    import numpy as np

    lengths, left, right, lanes = words.lengths, words.left, words.right, kernels.LANES
    ids = np.empty((words.offsets[n - 1], n), np.int32)
    size = kernels.needed_numbers.compiled(members, n, lengths, left, right, ids)
    program, operands = np.empty((size, 4), np.int32), np.empty((len(members), 4), np.int32)
    kernels.straight_line.compiled(members, n, lengths, left, right, ids, program, operands)
    letters = int((ids[:2] >= 0).sum())
    work = np.empty((size + 1, lanes), np.int32), *np.empty((2, lanes), np.int64)
    found = np.empty((len(members), 2), np.int64)
    kernels.solve_class.compiled(
        members, n, words.codes, program, letters, operands, wanted, wanted % PRIME, PRIME, work, found
    )
    # Two integers below `bound` in size that agree modulo 2^64 and modulo the prime are equal.
    bound = float(np.abs(wanted).max()) * words.norms[members].max() * (1 + 2.0**-20)
    if not 2 * bound < 2.0**64 * PRIME or (found[:, 0] % PRIME != found[:, 1]).any():
        raise ArithmeticError(f"coordinates of degree {n} do not fit into 64 bits")
    return found[:, 0]
