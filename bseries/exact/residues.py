"""Integers from their residues: modulo 2^64, and modulo primes where that is not enough.

A recursion on integers runs without rounding modulo any M. Once M exceeds twice a bound on the size of its result,
only one integer fits. Integers modulo 2^64 wrap around, as int64 does, and need no reduction; the primes are just below
2^30, so that products of residues fit into 60 bits.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from math import floor
from typing import TYPE_CHECKING, Any, TypeVar

from bseries.exceptions import SeriesError
from bseries_base.interrupts import mapped
from bseries_base.lowering.flat_kernels import flat_kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Words = NDArray[np.int64]
    Integers = Words | list[int]

T = TypeVar("T")

PRIME_BITS = 30
WORD = 63
"""Integers of fewer bits are known from their residues modulo 2^64."""
SMALL, LARGE = 2000, 2**21
"""Numbers of entries: below the first, a run takes no longer than handing it to another thread; a run on more than the
second is itself done in several threads."""


def exact_integers(
    run: Callable[[int], Words],
    offsets: Sequence[int],
    bits_of: Callable[[Sequence[int]], Sequence[int]],
    growth: Sequence[int],
    *,
    lost: Sequence[int] | None = (),
    avoid: int = 1,
) -> Integers:
    """Integers from runs of a recursion modulo 2^64, and modulo as many primes as their size asks for.

    Args:
        run: Gives all residues modulo a prime, of least absolute value; for 0 modulo 2^64.
        offsets: The integers of order n are offsets[n−1] … offsets[n]−1.
        bits_of: Numbers of bits that bound the integers of each order, from the largest absolute values in the first
            orders: what is known makes the other bounds sharper.
        growth: Bits by which orders grow in any case: a guess of how many primes will be needed.
        lost: Bits by which the run modulo 2^64 gives less for each order (empty: none); None if there is no such run.
        avoid: Primes that divide this number are not used.

    Raises:
        SeriesError: There are too few primes.
    """
    low = None if lost is None else run(0)
    rooms = [0 if low is None else WORD - x for x in lost or [0] * (len(offsets) - 1)]
    primes: list[int] = []
    residues: list[Words] = []
    found: list[Integers] = []
    largest: list[int] = []
    bits = bits_of(largest)

    def part(first: int, last: int | None) -> Integers:
        return from_residues([r[first:last] for r in residues], primes, None if low is None else low[first:last])

    while any(bound > room for bound, room in zip(bits, rooms, strict=True)):
        known = len(found)
        while len(found) < len(bits) and bits[len(found)] <= rooms[len(found)]:
            found.append(part(offsets[len(found)], offsets[len(found) + 1]))
            largest.append(largest_size(found[-1]))
        if len(found) > known:
            bits = bits_of(largest)
            continue
        if lost:
            low = None  # its residues modulo less than 2^64 are not combined with others
        have = sum(map(math.log2, primes)) + (WORD if low is not None else -1)
        wanted = bits[known] + max(0, growth[-1] - growth[known]) - have
        more = primes_beyond(max(wanted, 1), avoid * math.prod(primes))
        primes += more
        residues += in_threads(run, more) if SMALL < offsets[-1] <= LARGE else map(run, more)
        rooms = [int(sum(math.log2(p) - 1e-9 for p in primes)) + (WORD if low is not None else -1)] * len(bits)
    return _joined([*found, part(offsets[len(found)], None)]) if primes or low is None else low


def _joined(parts: Sequence[Integers]) -> Integers:
    """The integers one after another: an int64 array if all fit."""
    import numpy as np

    if any(isinstance(part, list) for part in parts):
        return [x for part in parts for x in (part if isinstance(part, list) else part.tolist())]
    return np.concatenate(parts)


def in_threads(function: Callable[..., T], *arguments: Iterable[Any]) -> Iterable[T]:
    """The results of a function for the arguments of each call, in the order of these."""
    return mapped(_threads(os.getpid()), function, *arguments)


@lru_cache(maxsize=1)
def _threads(process: int) -> ThreadPoolExecutor:
    """One pool for each process: starting threads takes longer than a run on few trees."""
    return ThreadPoolExecutor(min(os.cpu_count() or 1, 8))


def primes_beyond(bits: float, avoid: int = 1) -> list[int]:
    """Primes, none of which divides `avoid`, whose product exceeds 2^bits.

    Raises:
        SeriesError: There are too few of 30 bits.
    """
    from flint import fmpz

    chosen, product_bits = [], 0.0
    for number in range(2**PRIME_BITS - 1, 2**PRIME_BITS - 2**18, -2):
        if product_bits > bits:
            return chosen
        if fmpz(number).is_prime() and avoid % number:
            chosen.append(number)
            product_bits += math.log2(number) - 1e-9
    raise SeriesError(f"method must have coefficients of fewer digits: exact results would take {bits:.0f} bits each")


def largest_size(numbers: Integers) -> int:
    """The largest absolute value; |−2^63| is no int64."""
    if isinstance(numbers, list):
        return max(map(abs, numbers), default=0)
    return max(int(numbers.max(initial=0)), -int(numbers.min(initial=0)))


def from_residues(residues: Sequence[Words], primes: Sequence[int], low: Words | None = None) -> Integers:
    """The integers of least absolute value with these residues modulo primes, and modulo 2^64 if `low` is given.

    Returns:
        An int64 array if the integers fit, else a list.
    """
    import numpy as np

    if not primes:
        assert low is not None
        return low
    count, tables = len(residues[0]), _combination(tuple(primes))
    found, long = np.empty(count, np.int64), list[int]()
    for first in range(0, count, CHUNK):
        part = slice(first, min(first + CHUNK, count))
        stored = _words([r[part] for r in residues], tables, None if low is None else low[part])
        least = np.ascontiguousarray(stored[:, :2]).view("<i8")[:, 0]
        signs = np.broadcast_to((least >> 63)[:, None], stored[:, 2:].shape)
        if not long and np.array_equal(stored[:, 2:].view("<i4"), signs):
            found[part] = least  # usually the numbers are far smaller than their bounds
            continue
        long = long or found[:first].tolist()
        data, width = stored.tobytes(), 4 * stored.shape[1]
        long += [int.from_bytes(data[i : i + width], "little", signed=True) for i in range(0, len(data), width)]
    return long or found


@lru_cache(maxsize=64)
def _combination(primes: tuple[int, ...]) -> tuple[Words, Words, Words]:
    """The primes, their inverses modulo one another, and 2^64 with its inverse modulo each."""
    import numpy as np

    inverses = [pow(q, -1, p) if q != p else 0 for p in primes for q in primes]
    return np.array(primes), np.array(inverses), np.array([x for p in primes for x in (2**64 % p, pow(2**64, -1, p))])


def _words(residues: Sequence[Words], tables: tuple[Words, Words, Words], low: Words | None) -> NDArray[np.uint32]:
    """The integers as rows of 32-bit words in two's complement, the lowest first."""
    import numpy as np

    primes, inverses, wrap = tables
    words = max(2, int(sum(map(math.log2, primes.tolist())) + 2) // 32 + 1)
    limbs = np.zeros((len(residues[0]), words + 2 * (low is not None)), np.int64)
    chinese_remainder.compiled(
        len(limbs), len(primes), np.concatenate(residues), primes, inverses, int(low is not None),
        np.zeros(1, np.int64) if low is None else np.ascontiguousarray(low), wrap, words,
        np.zeros(len(primes) * BLOCK, np.int64), limbs,
    )  # fmt: skip
    return limbs.astype("<u4")


CHUNK = 2**18
"""Integers that are combined at once."""
BLOCK = 256
"""Numbers that are combined together, in SIMD lanes."""


@flat_kernel
def chinese_remainder(count, size, residues, primes, inverses, wrapped, low, wrap, words, digits, limbs):
    """Signed integers from their residues, in two's complement as words of 32 bits, the lowest first.

    Garner's mixed radix with balanced digits: x = d_0 + p_0 (d_1 + p_1 (d_2 + …)) is the representative of least
    absolute value. If residues modulo 2^64 are given (`wrapped`), these are the two lowest words, and the others are
    those of (x − low) / 2^64.

    Args:
        count, size: Number of integers, and of primes.
        residues: For each prime the residues of all integers.
        inverses: 1/p_j modulo p_i, row i.
        wrap: 2^64 and its inverse modulo each prime.
        words: Number of words of the mixed radix.
        digits: Scratch of `BLOCK` entries for each prime.
        limbs: Output, a row for each integer.
    """
    width = words + 2 * wrapped
    block = 0
    while block < count:
        many = min(count - block, BLOCK)
        for i in range(size):
            p = primes[i]
            inverse = 1.0 / p
            at = i * BLOCK
            for t in range(many):
                digits[at + t] = residues[i * count + block + t]
            if wrapped:
                for t in range(many):
                    least = low[block + t]
                    least -= floor(least * inverse + 0.5) * p
                    least += wrap[2 * i] if low[block + t] < 0 else 0
                    rest = digits[at + t] - least
                    rest -= floor(rest * inverse + 0.5) * p
                    digits[at + t] = rest * wrap[2 * i + 1]
            for j in range(i):
                factor = inverses[i * size + j]
                for t in range(many):
                    rest = digits[at + t]
                    rest -= floor(rest * inverse + 0.5) * p
                    digits[at + t] = (rest - digits[j * BLOCK + t]) * factor
            for t in range(many):
                rest = digits[at + t]
                rest -= floor(rest * inverse + 0.5) * p
                if rest > p // 2:
                    rest -= p
                if rest < -(p // 2):
                    rest += p
                digits[at + t] = rest
        for t in range(many):
            row = (block + t) * width
            if wrapped:
                limbs[row] = low[block + t] & 0xFFFFFFFF
                limbs[row + 1] = (low[block + t] >> 32) & 0xFFFFFFFF
                row += 2
            for i in range(size):
                carry = digits[(size - 1 - i) * BLOCK + t]
                for w in range(words):
                    carry += limbs[row + w] * primes[size - 1 - i]
                    limbs[row + w] = carry & 0xFFFFFFFF
                    carry = carry >> 32
        block += many
