"""Rational coefficients: integers over one denominator for each number of nodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from bseries.exact.arithmetic import Exact, Majorant, Prime, Wrapped

if TYPE_CHECKING:
    from trees.table import TreeTable


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
        """Values from one number for each tree."""
        denominators, numerators, step = [1], [], 1
        for n in range(1, table.max_order + 1):
            part = [Fraction(values[i]) for i in table.ids(n)]
            common = math.lcm(*(value.denominator for value in part))
            denominators.append(common)
            numerators += [value.numerator * (common // value.denominator) for value in part]
            step = math.lcm(step, common)
        return cls(table, numerators, denominators, step)

    def __getitem__(self, at: int) -> Fraction:
        nodes = self.table.columns.order[at]
        return Fraction(int(self.numerators[at]), self.denominators[nodes])

    @cached_property
    def reduced(self) -> RationalValues:
        """The same values over the smallest denominators."""
        numerators, denominators = self.numerators.copy(), [1]
        for n, (first, last) in enumerate(pairwise(self.table.offsets), 1):
            part = self.numerators[first:last]
            common = _gcd(self.denominators[n], part)
            denominators.append(self.denominators[n] // common)
            numerators[first:last] = _quotients(part, common)
        return RationalValues(self.table, numerators, denominators, math.lcm(*denominators))

    def coefficients(self) -> list[Fraction]:
        """All coefficients."""
        values = []
        for n in range(1, self.table.max_order + 1):
            common, ids = self.denominators[n], self.table.ids(n)
            part = self.numerators[ids.start : ids.stop]
            values += [Fraction(x, common) for x in (part if isinstance(part, list) else part.tolist())]
        return values

    def is_zero(self, at: int) -> bool:
        """Whether the coefficient of a tree is zero."""
        return not self.numerators[at]

    def equals_at(self, other: RationalValues, at: int) -> bool:
        """Whether the coefficient of a tree is the same."""
        return self[at] == other[at]

    def truncated(self, table: TreeTable) -> RationalValues:
        """The coefficients of the first trees."""
        return RationalValues(table, self.numerators[: len(table)], self.denominators[: table.max_order + 1], self.step)

    def homogeneous(self, *, flow: bool) -> Any:
        """The numerators, for a flow over the denominators L^n."""
        factors = [self.step**n // d if flow else 1 for n, d in enumerate(self.denominators)]
        if max(factors) == 1:
            return self.numerators
        return [int(x) * factors[n] for n, x in zip(self.table.lists[0], self.numerators, strict=True)]

    @property
    def exponent(self) -> int:
        """k such that no value exceeds 2^(k·n)."""
        return math.ceil(self.growth)

    @cached_property
    def growth(self) -> float:
        """Some κ ≥ 0 such that no value exceeds 2^(κ·n)."""
        largest = [_largest(self.numerators[first:last]) for first, last in pairwise(self.table.offsets)]
        logs = [(math.log2(x) - math.log2(self.denominators[n])) / n for n, x in enumerate(largest, 1) if x]
        most = max(logs, default=0.0)
        return most + 1e-9 if most > 0 else 0.0

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool) -> Any:
        """The values as a raw vector of an arithmetic; `table` is that of these values."""
        if isinstance(arithmetic, Wrapped | Prime | Majorant):
            return self._load_array(arithmetic, field)
        return arithmetic.vector(self.coefficients())

    def _load_array(self, arithmetic: Wrapped | Prime | Majorant, field: bool) -> Any:
        import numpy as np

        vector = arithmetic.zeros(len(self.table))
        for n in range(1, self.table.max_order + 1):
            ids, common = self.table.ids(n), self.denominators[n]
            part = self.numerators[ids.start : ids.stop]
            out = vector[ids.start : ids.stop]
            if isinstance(arithmetic, Majorant):
                scale = common << (arithmetic.exponent * n)
                scale_float = float(scale) if scale.bit_length() < 1000 else math.inf  # raised below
                bounds = (
                    [abs(x) / scale for x in part]
                    if isinstance(part, list)
                    else np.abs(part.astype(float)) / scale_float
                )
                lifted = np.maximum(np.abs(bounds) * (1 + 2.0**-50), 2.0 ** -(arithmetic.floor * n))
                out[:] = np.where(np.array([bool(x) for x in part]), lifted, 0.0)
            elif isinstance(arithmetic, Wrapped):
                factor = Fraction(2 ** arithmetic.twos_of(n, field=field), common)
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
    return max(int(numbers.max(initial=0)), -int(numbers.min(initial=0)))  # |−2^63| overflows int64


def _gcd(number: int, numbers: Any) -> int:
    if isinstance(numbers, list):
        return math.gcd(number, *numbers)
    import numpy as np

    return math.gcd(number, int(np.gcd.reduce(numbers, initial=0)))


def _quotients(numbers: Any, divisor: int) -> Any:
    """Integers divided by a common divisor, which exceeds int64 if all are 0 or −2^63."""
    if isinstance(numbers, list) or divisor >= 2**63:
        return [int(x) // divisor for x in numbers]
    return numbers // divisor


def _wrapped(numbers: Any) -> Any:
    """Integers modulo 2^64 as an int64 array."""
    import numpy as np

    if not isinstance(numbers, list):
        return numbers
    return np.array([x & (2**64 - 1) for x in numbers], np.uint64).view(np.int64)


def smallest_step(denominators: Sequence[int], step: int) -> int:
    """A small L with denominators[n] dividing L^n: `step`, which has that property, without needless small primes."""
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


def twos(number: int) -> int:
    """The exponent of 2 in a number."""
    return (number & -number).bit_length() - 1
