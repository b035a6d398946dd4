"""The fast exact path: rational series as integers over one denominator for each number of nodes.

Why the integers are proved and not guessed: an operation comes with three facts. (1) A *claim*: denominators D_n such
that D_n · result(τ) is an integer for every tree τ with n nodes. (2) A *bound* on |result(τ)|, computed by the same
recursion in the arithmetic of bounds (`bseries.arithmetic.Majorant`). (3) The result modulo M, computed without any
rounding. Once M > 2 · bound · D_n, only one integer fits. The claims, for a flow a with a(τ) L^n integral:

- weights of a method whose entries have the common denominator L: a(τ) L^n (n entries are multiplied);
- log a = Σ (−1)^{j+1} (a−ε)^j / j, j ≤ n: lcm(1, …, n) L^n, which is minimal for n ≤ 12;
- exp b = Σ ∂_b^{j−1} b / j!: n! L^n; compose and inverse have integer structure constants: L^n;
- a^{p/q} = Σ binom(p/q, k) (a−ε)^k: (q · rad q)^n L^n.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from . import kernels
from .arithmetic import (
    MOST_TERMS,
    Exact,
    Majorant,
    Prime,
    Wrapped,
    majorants,
    prime_field,
    primes_beyond,
    wrapped_integers,
)

if TYPE_CHECKING:
    from trees.table import TreeTable


class Source(Protocol):
    """An input of a rational operation: a method's stages or a series."""

    @property
    def step(self) -> int:
        """L: values at trees with n nodes become integers when multiplied by L^n."""
        ...

    @property
    def terms(self) -> int:
        """How many products of residues are added at a time when the values are loaded."""
        ...

    @property
    def exponent(self) -> int:
        """k such that values at trees with n nodes are at most 2^(k·n) in absolute value."""
        ...

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool) -> Any:
        """The values as a raw vector of an arithmetic."""
        ...


class RationalValues:
    """Rational coefficients of all trees of a table.

    Args:
        table: The trees.
        numerators: One integer for each tree: an int64 array or a list.
        denominators: Entry n belongs to the trees with n nodes.
        step: Some L such that L^n times a value is an integer.
    """

    kind = "rational"
    name = "QQ"
    terms = 1

    def __init__(self, table: TreeTable, numerators: Any, denominators: Sequence[int], step: int):
        self.table = table
        self.numerators = numerators
        self.denominators = tuple(denominators)
        self._step = step

    @cached_property
    def step(self) -> int:
        """A small L such that L^n times a value is an integer."""
        return smallest_step(self.denominators, self._step)

    @classmethod
    def from_fractions(cls, table: TreeTable, values: Sequence[Fraction | int]) -> RationalValues:
        """Values given one by one."""
        denominators, numerators, step = [1], [], 1
        for n in range(1, table.max_order + 1):
            part = [Fraction(values[i]) for i in table.ids(n)]
            common = math.lcm(*(value.denominator for value in part))
            denominators.append(common)
            numerators += [value.numerator * (common // value.denominator) for value in part]
            step = math.lcm(step, common)
        return cls(table, numerators, denominators, step)

    def __getitem__(self, at: int) -> Fraction:
        nodes = self.table._order[at]
        return Fraction(int(self.numerators[at]), self.denominators[nodes])

    def fractions(self) -> list[Fraction]:
        """All values."""
        values = []
        for n in range(1, self.table.max_order + 1):
            common, ids = self.denominators[n], self.table.ids(n)
            part = self.numerators[ids.start : ids.stop]
            values += [Fraction(x, common) for x in (part if isinstance(part, list) else part.tolist())]
        return values

    def map(self, function: Callable[[int, Fraction], Fraction]) -> RationalValues:
        """function(number of nodes, value) for every tree."""
        nodes = self.table._order
        values = [function(int(nodes[i]), value) for i, value in enumerate(self.fractions())]
        return RationalValues.from_fractions(self.table, values)

    def is_zero(self, at: int) -> bool:
        """Whether the coefficient of a tree is zero."""
        return not self.numerators[at]

    @cached_property
    def exponent(self) -> int:
        """k such that no value exceeds 2^(k·n)."""
        k = 0
        for n, (first, last) in enumerate(pairwise(self.table.offsets), 1):
            largest = _largest(self.numerators[first:last])
            excess = largest.bit_length() - self.denominators[n].bit_length() + 1
            k = max(k, -(-excess // n))
        return k

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool) -> Any:
        """The values as a raw vector of an arithmetic (`table` is this series' own)."""
        if isinstance(arithmetic, Wrapped | Prime | Majorant):
            return self._load_array(arithmetic, field)
        return arithmetic.vector(self.fractions())

    def _load_array(self, arithmetic: Wrapped | Prime | Majorant, field: bool) -> Any:
        import numpy as np

        vector = arithmetic.zeros(len(self.table))
        for n in range(1, self.table.max_order + 1):
            ids, common = self.table.ids(n), self.denominators[n]
            part = self.numerators[ids.start : ids.stop]
            out = vector[ids.start : ids.stop]
            if isinstance(arithmetic, Majorant):
                scale = common << (arithmetic.exponent * n)
                scale_float = float(scale) if scale.bit_length() < 1000 else math.inf  # tiny anyway: lifted below
                bounds = (
                    [abs(x) / scale for x in part]
                    if isinstance(part, list)
                    else np.abs(part.astype(float)) / scale_float
                )
                lifted = np.maximum(np.abs(bounds) * (1 + 2.0**-50), 2.0 ** -(arithmetic.floor * n))
                out[:] = np.where(np.array([bool(x) for x in part]), lifted, 0.0)
            elif isinstance(arithmetic, Wrapped):
                factor = Fraction(2 ** ((arithmetic.twos + 1) * n - field), common)
                out[:] = _wrapped(part) * np.int64(arithmetic.number(factor))
            else:
                p = arithmetic.prime
                residues = np.array([x % p for x in part], np.int64) if isinstance(part, list) else part % p
                residues = residues * arithmetic.number(Fraction(1, common)) % p
                out[:] = np.where(2 * residues > p, residues - p, residues)
        return vector


def _largest(numbers: Any) -> int:
    if isinstance(numbers, list):
        return max((abs(x) for x in numbers), default=0)
    return max(int(numbers.max(initial=0)), -int(numbers.min(initial=0)))  # |−2^63| is no int64


def _wrapped(numbers: Any) -> Any:
    """Integers modulo 2^64 as an int64 array."""
    import numpy as np

    if not isinstance(numbers, list):
        return numbers
    return np.array([x & (2**64 - 1) for x in numbers], np.uint64).view(np.int64)


def smallest_step(denominators: Sequence[int], step: int) -> int:
    """A small L with denominators[n] dividing L^n, found by taking small primes off `step`, which has that property."""
    for prime in (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37):
        while step % prime == 0:
            smaller = step // prime
            if any(smaller**n % d for n, d in enumerate(denominators)):
                break
            step = smaller
    return step


@lru_cache(maxsize=64)
def primes_up_to(n: int) -> tuple[int, ...]:
    """The primes up to n."""
    return tuple(p for p in range(2, n + 1) if all(p % d for d in range(2, math.isqrt(p) + 1)))


def primorial(n: int) -> int:
    """Product of the primes up to n."""
    return math.prod(primes_up_to(n))


@lru_cache(maxsize=64)
def lcm_up_to(n: int) -> int:
    """lcm(1, …, n)."""
    return math.lcm(*range(1, n + 1))


class Operation(NamedTuple):
    """An operation on series, with what is known about its result.

    `expression(arithmetic, *loaders)` gives the raw result, where loader(field=…) gives an input's raw values.
    `claim(n, L)` is the denominator D_n, `step(order, L)` an L for the result. `field` says how the raw result is
    scaled (see `Wrapped`). The operation's own multipliers have denominators that divide powers of `units`, beside j!.
    """

    expression: Callable[..., Any]
    claim: Callable[[int, int], int]
    step: Callable[[int, int], int]
    field: bool
    units: int = 1


def evaluate(table: TreeTable, sources: Sequence[Source], operation: Operation) -> RationalValues:
    """Exact values of an operation on rational sources."""
    common = math.lcm(*(source.step for source in sources))
    denominators = [1] + [operation.claim(n, common) for n in range(1, table.max_order + 1)]
    step = operation.step(table.max_order, common)

    def run(arithmetic: Exact) -> Any:
        loaders = [partial(source.load, table, arithmetic) for source in sources]
        return operation.expression(arithmetic, *loaders)

    terms = max(table.max_order, *(source.terms for source in sources))
    bits = None
    if table._compiled and terms <= MOST_TERMS:
        bits = _bits(table, run, max(source.exponent for source in sources), denominators)
    if bits is None:
        values = run(Exact())
        scaled = [value * denominators[n] for n, value in zip(table._order, values, strict=True)]
        return RationalValues(table, [_integer(value) for value in scaled], denominators, step)
    twos = _twos(common)
    wrapped_bits = [
        needed + (twos + 1) * n - operation.field - _twos(denominators[n]) for n, needed in enumerate(bits, 1)
    ]
    if operation.units % 2 and max(wrapped_bits) < 62:
        numerators = _run_wrapped(table, run, wrapped_integers(twos), denominators, operation.field)
    else:
        numerators = _run_primes(table, run, max(bits), common * operation.units, denominators)
    return RationalValues(table, numerators, denominators, step)


def _twos(number: int) -> int:
    """How often 2 divides a number."""
    return (number & -number).bit_length() - 1


def _integer(value: Fraction | int) -> int:
    if value.denominator != 1:
        raise ArithmeticError(f"claimed denominator is wrong: {value} is not an integer")
    return value.numerator


def _bits(
    table: TreeTable, run: Callable[[Exact], Any], exponent: int, denominators: Sequence[int]
) -> list[float] | None:
    """Bits of the largest numerator, sign not counted, for trees with 1, 2, … nodes: proved upper bounds.

    None if a bound exceeds the range of floats.
    """
    import numpy as np

    try:
        bounds = run(majorants(exponent, table.max_order))
    except OverflowError:
        return None

    filled = [n for n, (first, last) in enumerate(pairwise(table.offsets), 1) if last > first]
    largest = np.maximum.reduceat(bounds, [table.offsets[n - 1] for n in filled]).tolist()
    bits = [0.0] * table.max_order
    for n, bound in zip(filled, largest, strict=True):
        if not bound < math.inf:
            return None
        bits[n - 1] = math.log2(bound * Majorant.SLACK) + exponent * n + math.log2(denominators[n]) if bound else 0.0
    return bits


def _run_wrapped(
    table: TreeTable, run: Callable[[Exact], Any], arithmetic: Wrapped, denominators: Sequence[int], field: bool
) -> Any:
    values = run(arithmetic)
    odd, shift = _scaling(arithmetic, tuple(denominators), field)
    values *= odd[table._order]
    values >>= shift[table._order]
    return values


@lru_cache(maxsize=64)
def _scaling(arithmetic: Wrapped, denominators: tuple[int, ...], field: bool) -> tuple[Any, Any]:
    """Odd part of each denominator modulo 2^64, and by how many powers of two the raw values exceed the rest of it."""
    import numpy as np

    odd = [arithmetic.number(d >> _twos(d)) for d in denominators]
    shift = [max(0, (arithmetic.twos + 1) * n - field - _twos(d)) for n, d in enumerate(denominators)]
    return np.array(odd), np.array(shift)


def _run_primes(
    table: TreeTable, run: Callable[[Exact], Any], bits: float, avoid: int, denominators: Sequence[int]
) -> Any:
    """One run for each prime, two at a time where there are two cores: compiled kernels release the GIL."""
    import numpy as np

    primes = primes_beyond(bits + 2, avoid)
    residues = np.empty((len(primes), len(table)), np.int32)

    def one(i: int) -> None:
        values = run(prime_field(primes[i])).astype(np.int64)
        factors = np.array([d % primes[i] for d in denominators])
        values *= factors[table._order]
        values %= primes[i]
        residues[i] = values

    with ThreadPoolExecutor(min(os.cpu_count() or 1, len(primes))) as threads:
        list(threads.map(one, range(len(primes))))
    return combine(residues, primes, bits)


def combine(residues: Any, primes: Sequence[int], bits: float) -> Any:
    """The integers of at most `bits` bits with these residues: an int64 array if they fit, else a list."""
    import numpy as np

    words = 2 if bits < 62 else int(bits + 2) // 32 + 1
    inverses = np.array([[pow(q, -1, p) if q != p else 0 for q in primes] for p in primes], np.int64)
    limbs = np.empty((residues.shape[1], words), np.int64)
    digits = np.empty((len(primes), 256), np.int64)
    kernels.chinese_remainder.compiled(residues, np.array(primes, np.int64), inverses, words, digits, limbs)
    stored = limbs.astype("<u4")
    low = np.ascontiguousarray(stored[:, :2]).view("<i8")[:, 0]
    if np.array_equal(stored[:, 2:].view("<i4"), np.broadcast_to((low >> 63)[:, None], (len(low), words - 2))):
        return low  # bounds are generous: most often the numbers are smaller
    data, width = stored.tobytes(), 4 * words
    return [int.from_bytes(data[i : i + width], "little", signed=True) for i in range(0, len(data), width)]
