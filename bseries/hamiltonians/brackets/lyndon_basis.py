"""The Baker–Campbell–Hausdorff series log(exp A exp B) in the Lyndon basis of the free Lie algebra, to high degrees.

Words of A = 0 and B = 1 are integers whose bits are the letters, the first letter in the highest bit. A Lyndon word
x = uv, where v is its longest proper Lyndon suffix, stands for the bracket P_x = [P_u, P_v]. As a sum of words, P_x is
x plus larger words, so that the coordinates c_x of an element of the Lie algebra with coefficients w_x solve the unit
triangular system c_x = w_x − Σ_{y<x} ⟨P_y, x⟩ c_y, for words with equal letters (H. Hofstätter, arXiv:2102.06570). For
odd degrees the w_x are Goldberg's coefficients. Since exp(−A/2) log(exp A exp B) exp(A/2) is odd, the even degrees are
tanh(ad_A/2) of the odd ones, and [A, P_x] = P_Ax.
"""

from __future__ import annotations

import gc
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from itertools import accumulate
from typing import TYPE_CHECKING, TypeAlias

from bseries.exact.denominators import primes_up_to
from bseries_base.kernels import kernel
from trees.lyndon_words import count_lyndon_words

if TYPE_CHECKING:
    import flint
    import numpy as np
    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.integer]

Blocks: TypeAlias = tuple[int, ...]
"""The lengths of the blocks of equal letters in a word."""

MOST_LETTERS = 20  # of these words, 111,013 are Lyndon words; each further letter takes five times as long
PRIME = 2**31 - 1  # checks the results modulo 2^64


@contextmanager
def _collecting_later() -> Iterator[None]:
    """No search for garbage: it would visit the new tuples and fractions again and again, for a quarter of the time."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@_collecting_later()
def bch_terms(order: int, names: Sequence[str], *, symmetric: bool) -> list[dict[tuple[str, ...], Fraction]]:
    """The coordinates of log(exp A exp B), or of log(exp(A/2) exp B exp(A/2)), by degree and Lyndon word."""
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
        codes = words.codes[words.of_length(n)]
        columns = (letters[codes >> k & 1].tolist() for k in reversed(range(n)))
        fractions = {x: Fraction(x, denominator) for x in set(numerators)}  # half as many in even degrees
        terms.append(dict(zip(zip(*columns, strict=True), map(fractions.__getitem__, numerators), strict=True)))
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


def goldberg_coefficients(n: int) -> Iterator[tuple[Blocks, Fraction]]:
    """Coefficients of the words A…B of n letters in log(exp A exp B), by the lengths of their blocks of equal letters.

    A word of m blocks of lengths s_i, m even, has ∫₀¹ t^(m/2) (t−1)^(m/2−1) Π G_(s_i)(t) dt with the polynomials
    G_1 = 1, s G_s = (t (t−1) G_(s−1))′ (K. Goldberg, Duke Math. J. 23 (1956) 13–21).
    """
    import flint

    t = flint.fmpq_poly([0, 1])
    polynomials = [t, t**0]
    for s in range(2, n + 1):
        polynomials.append((t * (t - 1) * polynomials[-1]).derivative() / s)

    def extended(blocks: tuple[int, ...], product: flint.fmpq_poly, rest: int) -> Iterator[tuple[Blocks, Fraction]]:
        """All continuations by blocks no longer than the last, first some longer than 1, then some of length 1."""
        m = len(blocks) + rest
        if m % 2 == 0:
            integral = (t ** (m // 2) * (t - 1) ** (m // 2 - 1) * product).integral()(1)
            yield blocks + (1,) * rest, Fraction(int(integral.p), int(integral.q))
        for s in range(2, min(rest, *blocks[-1:]) + 1 if blocks else rest + 1):
            yield from extended((*blocks, s), product * polynomials[s], rest - s)

    return extended((), t**0, n)


class LyndonWords:
    """The Lyndon words in two letters of up to `length` letters, by length and then alphabetically."""

    def __init__(self, length: int):
        import numpy as np

        counts = count_lyndon_words(length, 2)
        self.offsets = [0, *accumulate(counts)]
        self.lengths, self.left, self.right = np.zeros((3, sum(counts)), np.int32)
        self.codes = np.zeros(sum(counts), np.int64)
        self.place = np.empty(2 ** (length + 1), np.int32)
        lyndon_words.compiled(length, self.place, self.lengths, self.codes, self.left, self.right)

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
    wanted = by_number[heinz_numbers(words.codes[ids], n, primes)]
    ones = np.array([code.bit_count() for code in words.codes[ids].tolist()])
    found = np.empty(len(ids), np.int64)
    for letters in range(1, n):
        members = np.flatnonzero(ones == letters)
        found[members] = _solve_class(words, ids[members].astype(np.int32), n, wanted[members])
    return found.tolist(), denominator


def heinz_numbers(codes: Array, n: int, primes: Array) -> Array:
    """The product of primes[s] over the blocks of s equal letters of each word, which identifies their lengths."""
    import numpy as np

    product = block = np.ones_like(codes)
    for position in range(1, n):
        ends = (codes >> position ^ codes >> position - 1) & 1 == 1
        product, block = np.where(ends, product * primes[block], product), np.where(ends, 1, block + 1)
    return product * primes[block]


def _solve_class(words: LyndonWords, members: Array, n: int, wanted: Array) -> Array:
    """The numerators of the coordinates of the Lyndon words with given numbers of letters."""
    import numpy as np

    lengths, left, right = words.lengths, words.left, words.right
    needed = np.zeros((words.offsets[n - 1], n), bool)
    mark_needed.compiled(members, n, lengths, left, right, needed)
    numbers = needed.cumsum(dtype=np.int32).reshape(needed.shape) - np.int32(1)

    def operands(of: Array, start: Array) -> Array:
        """The four numbers from which ⟨P_b, x[start:]⟩ follows."""
        u, v = left[of], right[of]
        four = (u, start), (v, start + lengths[u]), (u, start + lengths[v]), (v, start)
        return np.stack([numbers[pair] for pair in four], axis=1)

    letters, (longer, start) = np.argwhere(needed[:2]), np.nonzero(needed[2:])
    work = np.empty((len(letters) + len(longer) + 1, LANES), np.int32), *np.empty((2, LANES), np.int64)
    found = np.empty((len(members), 2), np.int64)
    tables = letters, operands(longer + 2, start), operands(members, np.zeros_like(members))
    solve_class.compiled(members, n, words.codes, *tables, wanted, wanted % PRIME, PRIME, work, found)
    # With the dual basis S, c_x = Σ_w ⟨S_x, w⟩ w_x. For x = av with a letter a and a product v of Lyndon words l_i, S_x
    # is a times the shuffle product of the S_(l_i), divided by k! for k equal factors (C. Reutenauer, *Free Lie
    # Algebras*, theorem 5.3), so that its coefficients are positive, with the sum (n − 1)! at most. Two integers below
    # `bound` in size that agree modulo 2^64 and modulo the prime are equal.
    bound = int(np.abs(wanted).max()) * math.factorial(n - 1)
    if 2 * bound >= 2**64 * PRIME or (found[:, 0] % PRIME != found[:, 1]).any():
        raise ArithmeticError(f"coordinates of degree {n} do not fit into 64 bits")
    return found[:, 0]


LANES = 64  # words that are treated at once; LLVM does not vectorise loops over 16


@kernel
def lyndon_words(length, place, lengths, codes, left, right):
    """List the Lyndon words of up to `length` letters by length and code, with their standard factors.

    ``place[2^n + code]`` becomes the index of a word of n letters, −1 if it is no Lyndon word.
    """
    place[:] = -1
    count = 0
    for n in range(1, length + 1):
        for code in range(int(n > 1), 1 << max(n - 1, 1), min(n, 2)):  # from letter A to letter B, if several
            if _is_lyndon(code, n):
                place[(1 << n) + code] = count
                lengths[count], codes[count] = n, code
                cut = n - 1  # letters of the longest proper suffix
                while n > 1 and place[(1 << cut) + (code & ((1 << cut) - 1))] < 0:
                    cut -= 1
                if n > 1:
                    left[count] = place[(1 << (n - cut)) + (code >> cut)]
                    right[count] = place[(1 << cut) + (code & ((1 << cut) - 1))]
                count += 1


@kernel
def _is_lyndon(code, n):
    """Whether a word is smaller than all its rotations."""
    mask = (1 << n) - 1
    shift = 1
    while shift < n and ((code << shift) & mask) | (code >> (n - shift)) > code:
        shift += 1
    return shift >= n


@kernel
def mark_needed(members, n, lengths, left, right, needed):
    """Mark the ⟨P_b, x[start : start + |b|]⟩, by b and start, from which ⟨P_y, x⟩ follow for the words of a class."""
    for y in members:
        _mark(left[y], right[y], 0, lengths, needed)
    for b in range(len(needed) - 1, 1, -1):
        for start in range(n):
            if needed[b, start]:
                _mark(left[b], right[b], start, lengths, needed)


@kernel
def _mark(u, v, start, lengths, needed):
    """Mark the four numbers of ⟨[P_u, P_v], x[start:]⟩."""
    needed[u, start] = needed[v, start + lengths[u]] = needed[v, start] = needed[u, start + lengths[v]] = True


@kernel
def solve_class(members, n, codes, letters, program, operands, wanted, residues, prime, work, found):
    """Solve the triangular system of the words with equal letters, modulo 2^64 and modulo a prime below 2^31.

    The words `members`, ascending, have n ≤ 31 letters, so that |⟨P_b, x⟩| ≤ 2^(|b|−1) fits into 32 bits. `codes` has
    the codes of all Lyndon words. The first numbers are whether x has certain letters at certain places; `program` has
    the operands of the others, and `operands` those of ⟨P_y, x⟩. `wanted` has the coefficients w_x modulo 2^64, and
    `residues` modulo the prime; the two columns of `found` become the coordinates. `work` has rows of `LANES` entries:
    int32 with a row for each number and one more, two of int64.
    """
    values, sums, sums_modulo = work
    size, first = len(members), len(letters)
    products = values[first + len(program)]
    for start in range(0, size, LANES):
        stop = min(start + LANES, size)
        for k in range(first):
            shift = n - 1 - letters[k, 1]
            for lane in range(LANES):
                x = codes[members[min(start + lane, size - 1)]]
                values[k, lane] = (x >> shift) & 1 == letters[k, 0]
        for k in range(len(program)):
            a, b, c, d = values[program[k, 0]], values[program[k, 1]], values[program[k, 2]], values[program[k, 3]]
            for lane in range(LANES):
                values[first + k, lane] = a[lane] * b[lane] - c[lane] * d[lane]
        sums[:], sums_modulo[:] = 0, 0
        for y in range(stop):
            if y >= start:
                found[y, 0] = wanted[y] - sums[y - start]
                found[y, 1] = (residues[y] - sums_modulo[y - start]) % prime
            own, modulo = found[y, 0], found[y, 1]
            a, b = values[operands[y, 0]], values[operands[y, 1]]
            c, d = values[operands[y, 2]], values[operands[y, 3]]
            for lane in range(LANES):
                products[lane] = a[lane] * b[lane] - c[lane] * d[lane]
            for lane in range(LANES):
                sums[lane] += products[lane] * own
                sums_modulo[lane] += products[lane] * modulo
            if y % 1024 == 1023:
                for lane in range(LANES):
                    sums_modulo[lane] %= prime
