"""Exact operations on rational series: integers over one denominator for each number of nodes.

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
from functools import lru_cache, partial
from itertools import pairwise
from operator import add
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from bseries.exact import kernels
from bseries.exact.arithmetic import (
    MOST_STAGES,
    MOST_TERMS,
    Exact,
    Majorant,
    Wrapped,
    majorants,
    prime_field,
    primes_beyond,
    rationals,
    wrapped_integers,
)
from bseries.exact.rationals import RationalValues, lcm_up_to, primorial, twos
from trees.compiled import arrays_pay, interpreting

if TYPE_CHECKING:
    from trees.table import TreeTable

BY_ORDER = 20
"""How much faster than the interpreter the recursions on whole orders are."""
SMALL = 2000
"""Number of trees below which a pass takes no longer than handing it to another thread."""


class Source(Protocol):
    """An input of a rational operation: the stages of a method or a series."""

    @property
    def step(self) -> int:
        """L: values at trees with n nodes become integers when multiplied by L^n."""
        ...

    @property
    def terms(self) -> int:
        """Number of products in the longest sum when the values are loaded."""
        ...

    @property
    def exponent(self) -> int:
        """k such that values at trees with n nodes are at most 2^(k·n) in absolute value."""
        ...

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool) -> Any:
        """The values as a raw vector of the arithmetic, scaled as a field or a flow."""
        ...


class Operation(NamedTuple):
    """An operation on series, with the facts that prove its result.

    expression(arithmetic, *loaders) is the raw result; loader(field=…) gives an operand's raw values. Except
    for j!, all denominators of the operation's own factors divide a power of `units`; if that is even, nothing runs
    modulo 2^64.
    """

    expression: Callable[..., Any]
    denominator: Callable[[int, int], int]  # denominator(n, L) is the denominator bound D_n
    step: Callable[[int, int], int]  # step(order, L) is some L for the result
    field: bool  # whether the raw result is scaled as a field (see `Wrapped`)
    units: int = 1
    avoid: int = 1  # a number divided by: its prime factors are not used as moduli
    bounds: Sequence[float] | None = None  # log₂ of bounds on the result for n = 1, 2, … nodes, if known without a run
    integers: Wrapped | None = None  # the arithmetic modulo 2^64 (None: the homogeneous one, see `Wrapped`)
    passes: int = 1  # about how many recursions over all trees the operation takes


def log_denominator(n: int, step: int) -> int:
    """The denominator bound of log a for trees with n nodes (see above)."""
    return lcm_up_to(n) * step**n


def wider_step(order: int, step: int) -> int:
    """An L for denominators that divide n! step^n."""
    return step * primorial(order)


def evaluate(table: TreeTable, sources: Sequence[Source], operation: Operation) -> RationalValues:
    """Exact values of an operation on rational sources."""
    common = math.lcm(*(source.step for source in sources))
    denominators = [1] + [operation.denominator(n, common) for n in range(1, table.max_order + 1)]
    step = operation.step(table.max_order, common)

    def run(arithmetic: Exact) -> Any:
        loaders = [partial(source.load, table, arithmetic) for source in sources]
        return operation.expression(arithmetic, *loaders)

    by_order = works_by_order(table, operation)
    has_bounds = table.max_order <= MOST_TERMS and max(source.terms for source in sources) <= MOST_STAGES
    if has_bounds and (table.compiled or by_order):
        integers = None
        if operation.units % 2:
            integers = operation.integers or wrapped_integers(twos(common))
            denominators = _sharpened(integers, tuple(denominators), operation.field)
        if operation.bounds is None:
            bits = _bits(table, run, max(source.exponent for source in sources), denominators)
        else:
            bits = [bound + math.log2(d) for bound, d in zip(operation.bounds, denominators[1:], strict=True)]
        numerators = None
        if bits is not None:
            numerators = _numerators(
                table, run, bits, common * operation.units * operation.avoid, denominators, integers, operation
            )
        if numerators is not None:
            return RationalValues(table, numerators, denominators, step)
    with interpreting():
        values = run(rationals(len(table)))
    scaled = [value * denominators[n] for n, value in zip(table.columns.order, values, strict=True)]
    return RationalValues(table, [_integer(value) for value in scaled], denominators, step)


@lru_cache(maxsize=64)
def _sharpened(integers: Wrapped, denominators: tuple[int, ...], field: bool) -> tuple[int, ...]:
    """The denominator bounds without factors of two that the scaling modulo 2^64 excludes."""
    excess = (twos(d) - integers.twos_of(n, field=field) for n, d in enumerate(denominators[1:], 1))
    return 1, *(d >> max(0, more) for d, more in zip(denominators[1:], excess, strict=True))


@lru_cache(maxsize=64)
def _excess_twos(integers: Wrapped, denominators: tuple[int, ...], field: bool) -> list[int]:
    """Exponents of two by which raw values exceed the numerators, for n = 1, 2, …."""
    return [integers.twos_of(n, field=field) - twos(d) for n, d in enumerate(denominators[1:], 1)]


def _numerators(
    table: TreeTable, run: Callable[[Exact], Any], bits: Sequence[float], avoid: int, denominators: Sequence[int],
    integers: Wrapped | None, operation: Operation,
) -> Any:  # fmt: skip
    """The numerators, found modulo 2^64 if they fit there with their powers of two, else modulo primes.

    None without compiled kernels, which the residues modulo primes need.
    """
    if integers and max(map(add, bits, _excess_twos(integers, tuple(denominators), operation.field))) < 62:
        return _run_wrapped(table, run, integers, denominators, operation.field)
    table.choose_kernels(interpreted_seconds(table, operation))
    return _run_primes(table, run, max(bits), avoid, denominators) if table.compiled else None


def interpreted_seconds(table: TreeTable, operation: Operation) -> float:
    """About the time of an operation on series in the interpreter."""
    return 4e-6 * table.max_order * len(table) * operation.passes


def works_by_order(table: TreeTable, operation: Operation) -> bool:
    """Whether the recursions should run on whole orders, unless the table is made for compiled kernels."""
    return bool(
        operation.units % 2 and operation.integers is None and arrays_pay(interpreted_seconds(table, operation))
    )


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
    values *= odd[table.order]
    values >>= shift[table.order]
    return values


@lru_cache(maxsize=64)
def _scaling(arithmetic: Wrapped, denominators: tuple[int, ...], field: bool) -> tuple[Any, Any]:
    """The odd part of each denominator modulo 2^64, and the exponent of two by which raw values exceed the rest."""
    import numpy as np

    odd = [arithmetic.number(d >> twos(d)) for d in denominators]
    shift = [max(0, arithmetic.twos_of(n, field=field) - twos(d)) for n, d in enumerate(denominators)]
    return np.array(odd), np.array(shift)


def _run_primes(
    table: TreeTable, run: Callable[[Exact], Any], bits: float, avoid: int, denominators: Sequence[int]
) -> Any:
    """One run for each prime, in parallel threads: compiled kernels release the GIL."""
    import numpy as np

    primes = primes_beyond(bits + 2, avoid)
    residues = np.empty((len(primes), len(table)), np.int32)

    def one(i: int) -> None:
        values = run(prime_field(primes[i])).astype(np.int64)
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
