"""Rational series: integers over one denominator for each number of nodes, and operations on them.

The integers are proved by three facts about an operation. (1) A *denominator bound*: D_n such that D_n · result(τ) is
an integer for every tree τ with n nodes. (2) A *bound* on |result(τ)| (`bseries.exact.bounds`). (3) The result modulo
M, computed without rounding. Once M > 2 · bound · D_n, only one integer fits (`bseries.exact.residues`). Denominators
are those of `bseries.exact.denominators` and `stage_sizes`; for operations on a flow a with a(τ) L^n integral,
compositions and inverses have L^n (their structure constants are integers), and exp b = Σ ∂_b^{j−1} b / j! has n! L^n.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exact import arithmetic as arithmetics
from bseries.exact import bounds
from bseries.exact.arithmetic import MOST_TERMS, Exact, Prime, Wrapped, whole
from bseries.exact.bounds import Bound
from bseries.exact.denominators import smallest_step, twos
from bseries.exact.residues import exact_integers, largest_size
from bseries_base.lowering.flat_kernels import machine_code_pays

if TYPE_CHECKING:
    from bseries.exact.residues import Words
    from trees.basis import Basis


class Values:
    """The coefficients of all trees of a basis, in one domain.

    Attributes:
        kind: The domain: ``rational``, ``ring`` or ``float``.
        name: The name of the domain as users see it, such as ``QQ`` or ``QQ<sqrt(3)>``.
        raw: A number for each tree; zero if and only if the coefficient is.
    """

    kind: str
    name: Any

    def __init__(self, basis: Basis, raw: Any):
        self.basis, self.raw = basis, raw

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

    def truncated(self, basis: Basis) -> Any:
        """The coefficients of the trees of a smaller basis, the first of the own one."""
        return type(self)(basis, self.raw[: len(basis)])

    @property
    def reduced(self) -> Any:
        """The same values over the smallest denominators, or in a field without any."""
        return self

    def homogeneous(self, *, flow: bool) -> Any:
        """The coefficients times a factor for each number of nodes n; for a flow L^n, as products of values have it."""
        return list(self.raw)

    def load(self, basis: Basis, arithmetic: Exact, *, field: bool) -> Any:
        """The values as a raw vector of an arithmetic, scaled as a field or a flow; `basis` is that of the values."""
        return arithmetic.vector(self.raw)


class RationalValues(Values):
    """Rational coefficients of all trees of a basis.

    Args:
        basis: The trees.
        numerators: One integer for each tree: an int64 array or a list.
        denominators: Entry n belongs to the trees with n nodes.
        step: Some L such that L^n times a value is an integer.
    """

    kind = "rational"
    name = "QQ"
    terms = 1

    def __init__(self, basis: Basis, numerators: Any, denominators: Sequence[int], step: int):
        super().__init__(basis, numerators)
        self.denominators = tuple(denominators)
        self._step = step

    @cached_property
    def step(self) -> int:
        """A small L such that L^n times a value is an integer."""
        return smallest_step(self.denominators, self._step)

    @classmethod
    def from_fractions(cls, basis: Basis, values: Sequence[Fraction | int]) -> RationalValues:
        """Values from one number for each tree."""
        denominators, numerators, step = [1], [], 1
        for n in range(1, basis.max_order + 1):
            part = [Fraction(values[i]) for i in basis.ids(n)]
            common = math.lcm(*(value.denominator for value in part))
            denominators.append(common)
            numerators += [value.numerator * (common // value.denominator) for value in part]
            step = math.lcm(step, common)
        return cls(basis, numerators, denominators, step)

    def __getitem__(self, at: int) -> Fraction:
        return Fraction(int(self.raw[at]), self.denominators[self.basis.order_of(at)])

    @property
    def reduced(self) -> RationalValues:
        """The same values over the smallest denominators."""
        return self._reduced

    @cached_property
    def _reduced(self) -> RationalValues:
        numerators, denominators = self.raw.copy(), [1]
        for n, (first, last) in enumerate(pairwise(self.basis.offsets), 1):
            part: Any = self.raw[first:last]  # a list beyond int64
            common = math.gcd(self.denominators[n], *(part if isinstance(part, list) else part.tolist()))
            if common >= 2**63 and not isinstance(part, list):  # all are 0 or −2^63
                part = part.tolist()
            numerators[first:last] = [x // common for x in part] if isinstance(part, list) else part // common
            denominators.append(self.denominators[n] // common)
        return RationalValues(self.basis, numerators, denominators, math.lcm(*denominators))

    def coefficients(self) -> list[Fraction]:
        """All coefficients."""
        values = []
        for n in range(1, self.basis.max_order + 1):
            common, ids = self.denominators[n], self.basis.ids(n)
            part = self.raw[ids.start : ids.stop]
            values += [Fraction(x, common) for x in (part if isinstance(part, list) else part.tolist())]
        return values

    def truncated(self, basis: Basis) -> RationalValues:
        """The coefficients of the first trees."""
        return RationalValues(basis, self.raw[: len(basis)], self.denominators[: basis.max_order + 1], self.step)

    def homogeneous(self, *, flow: bool) -> Any:
        """The numerators, for a flow over the denominators L^n."""
        factors = [self.step**n // d if flow else 1 for n, d in enumerate(self.denominators)]
        if max(factors) == 1:
            return self.raw
        return [int(x) * factors[n] for n, x in zip(self.basis.orders, self.raw, strict=True)]

    @cached_property
    def bound(self) -> Bound:
        """The largest absolute values, by number of nodes."""
        largest = [largest_size(self.raw[first:last]) for first, last in pairwise(self.basis.offsets)]
        return bounds.of_numerators(largest, self.denominators)

    def load(self, basis: Basis, arithmetic: Exact, *, field: bool) -> Any:
        """The values as a raw vector of an arithmetic; `basis` is that of these values."""
        if not isinstance(arithmetic, Wrapped | Prime):
            return arithmetic.vector(self.coefficients())
        import numpy as np

        factors = _inverses(self.denominators, arithmetic, field)[basis.order]
        if isinstance(arithmetic, Prime):
            raw = np.asarray(self.raw, object if isinstance(self.raw, list) else None)
            return _balanced((raw % arithmetic.prime).astype(np.int64) * factors, arithmetic.prime)
        if isinstance(self.raw, list):
            return np.array([x % 2**64 for x in self.raw], np.uint64).view(np.int64) * factors
        return self.raw * factors


@lru_cache(maxsize=256)
def _inverses(denominators: tuple[int, ...], arithmetic: Wrapped | Prime, field: bool) -> Words:
    """Factors on numerators, by number of nodes: 1/denominator, modulo 2^64 with the scaling of the arithmetic."""
    if isinstance(arithmetic, Prime):
        return arithmetic.vector([Fraction(1, d) for d in denominators])
    scales = (2 ** arithmetic.twos_of(n, field=field) for n in range(1, len(denominators)))
    return arithmetic.vector([0, *(Fraction(x, d) for x, d in zip(scales, denominators[1:], strict=True))])


class Operation(NamedTuple):
    """An operation on series, with the facts that prove its result.

    expression(arithmetic, *loaders) is the raw result; loader(field=…) gives an operand's raw values. Except
    for j!, all denominators of the operation's own factors divide a power of `units`; if that is even, nothing runs
    modulo 2^64.
    """

    expression: Callable[..., Any]
    bound: Callable[[Bound], Bound]  # on the result, from what is known of it at the smallest trees
    denominator: Callable[[int, int], int] = lambda n, step: step**n  # denominator(n, L) is the denominator bound D_n
    step: Callable[[int, int], int] = lambda order, step: step  # step(order, L) is some L for the result
    field: bool = False  # whether the raw result is scaled as a field (see `Wrapped`)
    units: int = 1
    avoid: int = 1  # a number divided by: its prime factors are not used as moduli
    integers: Wrapped | None = None  # the arithmetic modulo 2^64 (None: the homogeneous one, see `Wrapped`)
    passes: int = 1  # about how many recursions over all trees the operation takes


def work(basis: Basis, operation: Operation) -> int:
    """About the number of products that an operation computes."""
    return basis.max_order**2 * len(basis) * operation.passes // 2


def evaluate(basis: Basis, sources: Sequence[Any], operation: Operation) -> RationalValues:
    """Exact values of an operation on rational sources, the stages of a method or series.

    A source has a `step` L, for which values at trees with n nodes become integers when multiplied by L^n, and `load`,
    as in `Values`.
    """
    common = math.lcm(*(source.step for source in sources))
    denominators = (1, *(operation.denominator(n, common) for n in range(1, basis.max_order + 1)))
    step = operation.step(basis.max_order, common)

    def run(arithmetic: Exact) -> Any:
        return operation.expression(arithmetic, *(partial(source.load, basis, arithmetic) for source in sources))

    if basis.max_order > MOST_TERMS or not machine_code_pays(work(basis, operation)):
        values = run(arithmetics.rationals(len(basis)))
        scaled = [value * denominators[n] for n, value in zip(basis.orders, values, strict=True)]
        return RationalValues(basis, list(map(whole, scaled)), denominators, step)
    words: Any = None
    scaling: Scaling | None = None
    if operation.units % 2:
        words = operation.integers or arithmetics.wrapped_integers(twos(common))
        scaling = _scaling(words, denominators, operation.field)
        denominators = scaling.denominators

    def residues(prime: int) -> Words:
        if prime:
            return _prime_numerators(basis, run(arithmetics.prime_field(prime)), denominators, prime)
        return _word_numerators(basis, run(words), scaling)

    lost = None if scaling is None else scaling.excess if any(scaling.excess) else ()
    avoid = common * operation.units * operation.avoid
    return proved(basis, residues, denominators, step, operation.bound, lost=lost, avoid=avoid)


def proved(
    basis: Basis,
    run: Callable[[int], Words],
    denominators: tuple[int, ...],
    step: int,
    bound: Callable[[Bound], Bound],
    *,
    lost: Sequence[int] | None,
    avoid: int,
) -> RationalValues:
    """Values from residues of their numerators; other arguments are those of `RationalValues` and `exact_integers`.

    Args:
        bound: Bounds on the values, from what is known of them at the smallest trees.
    """

    def bits_of(largest: Sequence[int]) -> list[int]:
        return bounds.numerator_bits(bound(bounds.of_numerators(largest, denominators)), denominators)

    growth = [d.bit_length() for d in denominators[1:]]
    numerators = exact_integers(run, basis.offsets, bits_of, growth, lost=lost, avoid=avoid)
    return RationalValues(basis, numerators, denominators, step)


class Scaling(NamedTuple):
    """How raw values modulo 2^64 become numerators: times the odd part of the denominator, and shifted."""

    denominators: tuple[int, ...]  # without factors of two that the scaling excludes
    excess: list[int]  # exponents of two by which raw values exceed the numerators, for n = 1, 2, …
    odd: Words  # the odd part of each denominator modulo 2^64
    shift: Words  # `excess` as an array, from n = 0


@lru_cache(maxsize=64)
def _scaling(integers: Wrapped, denominators: tuple[int, ...], field: bool) -> Scaling:
    import numpy as np

    factors = [integers.twos_of(n, field=field) for n in range(1, len(denominators))]
    sharp = (1, *(d >> max(0, twos(d) - own) for own, d in zip(factors, denominators[1:], strict=True)))
    excess = [own - twos(d) for own, d in zip(factors, sharp[1:], strict=True)]
    return Scaling(sharp, excess, np.array([integers.number(d >> twos(d)) for d in sharp]), np.array([0, *excess]))


def _word_numerators(basis: Basis, values: Words, scaling: Any) -> Words:
    values *= scaling.odd[basis.order]
    values >>= scaling.shift[basis.order]
    return values


def _prime_numerators(basis: Basis, values: Words, denominators: Sequence[int], prime: int) -> Words:
    import numpy as np

    factors = np.array([d % prime for d in denominators])
    return _balanced(values * factors[basis.order], prime)


def _balanced(values: Words, prime: int) -> Words:
    """The representatives of least absolute value; the argument is overwritten."""
    values %= prime
    values -= prime * (2 * values > prime)
    return values
