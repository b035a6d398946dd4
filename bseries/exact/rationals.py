"""Rational series: integers over one denominator for each number of nodes, and operations on them.

The integers are proved by three facts about an operation. (1) A *denominator bound*: D_n such that D_n · result(τ) is
an integer for every tree τ with n nodes. (2) A *bound* on |result(τ)|, computed by the same recursion on absolute
values (`bseries.exact.arithmetic.Majorant`). (3) The result modulo M, computed without rounding. Once
M > 2 · bound · D_n, only one integer fits. Denominator bounds, for a flow a with a(τ) L^n integral:

- weights of a method whose entries have the common denominator L: L^n (n entries are multiplied);
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
from operator import add
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exact import arithmetic as arithmetics
from bseries.exact import kernels
from bseries.exact.arithmetic import MOST_STAGES, MOST_TERMS, Exact, Majorant, Prime, Wrapped
from trees.compiled import arrays_pay, interpreting

if TYPE_CHECKING:
    from trees.table import TreeTable

BY_ORDER = 20
"""How much faster than the interpreter the recursions on whole orders are."""
SMALL = 2000
"""Number of trees below which a pass takes no longer than handing it to another thread."""


class Values:
    """The coefficients of all trees of a table, in one domain.

    Attributes:
        kind: The domain: ``rational``, ``ring`` or ``float``.
        name: The name of the domain as users see it, such as ``QQ`` or ``QQ<sqrt(3)>``.
        raw: A number for each tree; zero if and only if the coefficient is.
    """

    kind: str
    name: Any

    def __init__(self, table: TreeTable, raw: Any):
        self.table, self.raw = table, raw

    def __getitem__(self, at: int) -> Any:
        return self.raw[at]

    def coefficients(self) -> list[Any]:
        """All coefficients, as users see them."""
        return [self[at] for at in range(len(self.raw))]

    def is_zero(self, at: int) -> bool:
        """Whether the coefficient of a tree is zero."""
        return not self.raw[at]

    def equals_at(self, other: Any, at: int) -> bool:
        """Whether other values, made `alike`, have the same coefficient of a tree."""
        return bool(self[at] == other[at])

    def truncated(self, table: TreeTable) -> Any:
        """The coefficients of the trees of a smaller table, the first of the own one."""
        return type(self)(table, self.raw[: len(table)])

    @property
    def reduced(self) -> Any:
        """The same values over the smallest denominators, or in a field without any."""
        return self

    def homogeneous(self, *, flow: bool) -> Any:
        """The coefficients times a factor for each number of nodes n; for a flow L^n, as products of values have it."""
        return list(self.raw)

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool) -> Any:
        """The values as a raw vector of an arithmetic, scaled as a field or a flow; `table` is that of the values."""
        return arithmetic.vector(self.raw)


class RationalValues(Values):
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
        super().__init__(table, numerators)
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
        return Fraction(int(self.raw[at]), self.denominators[self.table.columns.order[at]])

    @property
    def reduced(self) -> RationalValues:
        """The same values over the smallest denominators."""
        return self._reduced

    @cached_property
    def _reduced(self) -> RationalValues:
        numerators, denominators = self.raw.copy(), [1]
        for n, (first, last) in enumerate(pairwise(self.table.offsets), 1):
            part: Any = self.raw[first:last]  # a list beyond int64
            common = math.gcd(self.denominators[n], *(part if isinstance(part, list) else part.tolist()))
            if common >= 2**63 and not isinstance(part, list):  # all are 0 or −2^63
                part = part.tolist()
            numerators[first:last] = [x // common for x in part] if isinstance(part, list) else part // common
            denominators.append(self.denominators[n] // common)
        return RationalValues(self.table, numerators, denominators, math.lcm(*denominators))

    def coefficients(self) -> list[Fraction]:
        """All coefficients."""
        values = []
        for n in range(1, self.table.max_order + 1):
            common, ids = self.denominators[n], self.table.ids(n)
            part = self.raw[ids.start : ids.stop]
            values += [Fraction(x, common) for x in (part if isinstance(part, list) else part.tolist())]
        return values

    def truncated(self, table: TreeTable) -> RationalValues:
        """The coefficients of the first trees."""
        return RationalValues(table, self.raw[: len(table)], self.denominators[: table.max_order + 1], self.step)

    def homogeneous(self, *, flow: bool) -> Any:
        """The numerators, for a flow over the denominators L^n."""
        factors = [self.step**n // d if flow else 1 for n, d in enumerate(self.denominators)]
        if max(factors) == 1:
            return self.raw
        return [int(x) * factors[n] for n, x in zip(self.table.lists[0], self.raw, strict=True)]

    @property
    def exponent(self) -> int:
        """k such that no value exceeds 2^(k·n)."""
        return math.ceil(self.growth)

    @cached_property
    def growth(self) -> float:
        """Some κ ≥ 0 such that no value exceeds 2^(κ·n)."""
        parts = (self.raw[first:last] for first, last in pairwise(self.table.offsets))
        if isinstance(self.raw, list):
            largest = [max(map(abs, part), default=0) for part in parts]
        else:  # |−2^63| overflows int64
            largest = [max(int(part.max(initial=0)), -int(part.min(initial=0))) for part in parts]
        logs = [(math.log2(x) - math.log2(self.denominators[n])) / n for n, x in enumerate(largest, 1) if x]
        most = max(logs, default=0.0)
        return most + 1e-9 if most > 0 else 0.0

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool) -> Any:
        """The values as a raw vector of an arithmetic; `table` is that of these values."""
        if not isinstance(arithmetic, Wrapped | Prime | Majorant):
            return arithmetic.vector(self.coefficients())
        import numpy as np

        vector = arithmetic.zeros(len(table))
        for n, (first, last) in enumerate(pairwise(table.offsets), 1):
            part, common = self.raw[first:last], self.denominators[n]
            part = np.array(part, object) if isinstance(part, list) else part
            if isinstance(arithmetic, Majorant):
                scale: Any = common << (arithmetic.exponent * n)
                if part.dtype != object:
                    part, scale = part.astype(float), float(scale) if scale.bit_length() < 1000 else math.inf
                bounds = np.abs(part / scale).astype(float)
                bounds = np.maximum(bounds * (1 + 2.0**-50), 2.0 ** -(arithmetic.floor * n))
                vector[first:last] = np.where(part != 0, bounds, 0.0)
            elif isinstance(arithmetic, Wrapped):
                if part.dtype == object:
                    part = (part & (2**64 - 1)).astype(np.uint64).view(np.int64)
                factor = Fraction(2 ** arithmetic.twos_of(n, field=field), common)
                vector[first:last] = part * np.int64(arithmetic.number(factor))
            else:
                p = arithmetic.prime
                residues = (part % p).astype(np.int64) * arithmetic.number(Fraction(1, common)) % p
                vector[first:last] = np.where(2 * residues > p, residues - p, residues)
        return vector


class Operation(NamedTuple):
    """An operation on series, with the facts that prove its result.

    expression(arithmetic, *loaders) is the raw result; loader(field=…) gives an operand's raw values. Except
    for j!, all denominators of the operation's own factors divide a power of `units`; if that is even, nothing runs
    modulo 2^64.
    """

    expression: Callable[..., Any]
    denominator: Callable[[int, int], int] = lambda n, step: step**n  # denominator(n, L) is the denominator bound D_n
    step: Callable[[int, int], int] = lambda order, step: step  # step(order, L) is some L for the result
    field: bool = False  # whether the raw result is scaled as a field (see `Wrapped`)
    units: int = 1
    avoid: int = 1  # a number divided by: its prime factors are not used as moduli
    bounds: Sequence[float] | None = None  # log₂ of bounds on the result for n = 1, 2, … nodes, if known without a run
    integers: Wrapped | None = None  # the arithmetic modulo 2^64 (None: the homogeneous one, see `Wrapped`)
    passes: int = 1  # about how many recursions over all trees the operation takes


@lru_cache(maxsize=1024)
def log_denominator(n: int, step: int) -> int:
    """The denominator bound of log a for trees with n nodes (see above)."""
    return math.lcm(*range(1, n + 1)) * step**n


def wider_step(order: int, step: int) -> int:
    """An L for denominators that divide n! step^n."""
    return step * primorial(order)


def evaluate(table: TreeTable, sources: Sequence[Any], operation: Operation) -> RationalValues:
    """Exact values of an operation on rational sources, the stages of a method or series.

    A source has a `step` L, for which values at trees with n nodes become integers when multiplied by L^n, an
    `exponent` k, for which they are at most 2^(k·n) in absolute value, the number `terms` of products in the longest
    sum when it is loaded, and `load`, as in `Values`.
    """
    common = math.lcm(*(source.step for source in sources))
    denominators = (1, *(operation.denominator(n, common) for n in range(1, table.max_order + 1)))
    step = operation.step(table.max_order, common)

    def run(arithmetic: Exact) -> Any:
        return operation.expression(arithmetic, *(partial(source.load, table, arithmetic) for source in sources))

    has_bounds = table.max_order <= MOST_TERMS and max(source.terms for source in sources) <= MOST_STAGES
    if has_bounds and (table.compiled or works_by_order(table, operation)):
        integers = scaling = None
        if operation.units % 2:
            integers = operation.integers or arithmetics.wrapped_integers(twos(common))
            scaling = _scaling(integers, denominators, operation.field)
            denominators = scaling.denominators
        if operation.bounds is None:
            bits = _bits(table, run, max(source.exponent for source in sources), denominators)
        else:
            bits = [bound + math.log2(d) for bound, d in zip(operation.bounds, denominators[1:], strict=True)]
        if bits and integers and scaling and max(map(add, bits, scaling.excess)) < 62:
            return RationalValues(table, _run_wrapped(table, run, integers, scaling), denominators, step)
        if bits:
            table.choose_kernels(interpreted_seconds(table, operation))
        if bits and table.compiled:
            avoid = common * operation.units * operation.avoid
            return RationalValues(table, _run_primes(table, run, max(bits), avoid, denominators), denominators, step)
    with interpreting():
        values = run(arithmetics.rationals(len(table)))
    scaled = [value * denominators[n] for n, value in zip(table.columns.order, values, strict=True)]
    return RationalValues(table, [_integer(value) for value in scaled], denominators, step)


class Scaling(NamedTuple):
    """How raw values modulo 2^64 become numerators: times the odd part of the denominator, and shifted."""

    denominators: tuple[int, ...]  # without factors of two that the scaling excludes
    excess: list[int]  # exponents of two by which raw values exceed the numerators, for n = 1, 2, …
    odd: Any  # the odd part of each denominator modulo 2^64
    shift: Any  # `excess` as an array, from n = 0


@lru_cache(maxsize=64)
def _scaling(integers: Wrapped, denominators: tuple[int, ...], field: bool) -> Scaling:
    import numpy as np

    factors = [integers.twos_of(n, field=field) for n in range(1, len(denominators))]
    sharp = (1, *(d >> max(0, twos(d) - own) for own, d in zip(factors, denominators[1:], strict=True)))
    excess = [own - twos(d) for own, d in zip(factors, sharp[1:], strict=True)]
    return Scaling(sharp, excess, np.array([integers.number(d >> twos(d)) for d in sharp]), np.array([0, *excess]))


def interpreted_seconds(table: TreeTable, operation: Operation) -> float:
    """About the time of an operation on series in the interpreter."""
    return 4e-6 * table.max_order * len(table) * operation.passes


def works_by_order(table: TreeTable, operation: Operation) -> bool:
    """Whether the recursions should run on whole orders, unless the table is made for compiled kernels."""
    homogeneous = operation.units % 2 == 1 and operation.integers is None
    return homogeneous and arrays_pay(interpreted_seconds(table, operation))


def _integer(value: Any) -> int:
    """A whole rational number, of Python or of flint, as an integer."""
    if isinstance(value, int):
        return value
    numerator, denominator = value.as_integer_ratio() if isinstance(value, Fraction) else (value.p, value.q)
    if denominator != 1:
        raise ArithmeticError(f"denominator bound is wrong: {value} is not an integer")
    return int(numerator)


def _bits(
    table: TreeTable, run: Callable[[Exact], Any], exponent: int, denominators: Sequence[int]
) -> list[float] | None:
    """Proved bounds on log₂ |numerator| for trees with 1, 2, … nodes; None beyond the range of floats."""
    import numpy as np

    try:
        bounds = run(arithmetics.majorants(exponent, table.max_order))
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


def _run_wrapped(table: TreeTable, run: Callable[[Exact], Any], arithmetic: Wrapped, scaling: Scaling) -> Any:
    values = run(arithmetic)
    values *= scaling.odd[table.order]
    values >>= scaling.shift[table.order]
    return values


def _run_primes(
    table: TreeTable, run: Callable[[Exact], Any], bits: float, avoid: int, denominators: Sequence[int]
) -> Any:
    """One run for each prime, in parallel threads: compiled kernels release the GIL."""
    import numpy as np

    primes = arithmetics.primes_beyond(bits + 2, avoid)
    residues = np.empty((len(primes), len(table)), np.int32)

    def one(i: int) -> None:
        values = run(arithmetics.prime_field(primes[i])).astype(np.int64)
        factors = np.array([d % primes[i] for d in denominators])
        values *= factors[table.order]
        values %= primes[i]
        residues[i] = values

    run_all = _threads(os.getpid()).map if len(table) > SMALL else map
    list(run_all(one, range(len(primes))))
    return combine(residues, primes, bits)


@lru_cache(maxsize=1)
def _threads(process: int) -> ThreadPoolExecutor:
    """One pool for each process: starting threads takes longer than a pass over a small table."""
    return ThreadPoolExecutor(min(os.cpu_count() or 1, 8))


def combine(residues: Any, primes: Sequence[int], bits: float) -> Any:
    """The integers below 2^bits in size with these residues: an int64 array if they fit, else a list."""
    import numpy as np

    words = 2 if bits < 62 else int(bits + 2) // 32 + 1
    inverses = np.array([[pow(q, -1, p) if q != p else 0 for q in primes] for p in primes], np.int64)
    limbs = np.empty((residues.shape[1], words), np.int64)
    digits = np.empty((len(primes), 256), np.int64)
    kernels.chinese_remainder.compiled(residues, np.array(primes, np.int64), inverses, words, digits, limbs)
    stored = limbs.astype("<u4")
    low = np.ascontiguousarray(stored[:, :2]).view("<i8")[:, 0]
    if np.array_equal(stored[:, 2:].view("<i4"), np.broadcast_to((low >> 63)[:, None], (len(low), words - 2))):
        return low  # usually the numbers are far smaller than their bounds
    data, width = stored.tobytes(), 4 * words
    return [int.from_bytes(data[i : i + width], "little", signed=True) for i in range(0, len(data), width)]


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


def twos(number: int) -> int:
    """The exponent of 2 in a number."""
    return (number & -number).bit_length() - 1
