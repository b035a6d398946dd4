"""Arithmetics: exact numbers, floats and residues, for the same recursions.

A recursion (`bseries.exact.recursions`) is written once. An arithmetic (`Exact` and its subclasses) says how vectors
are stored, how numbers enter, and whether kernels run compiled. Some arithmetics scale values by a factor per node,
with different exponents for flows and fields (see `Wrapped`); the others do not scale.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from bseries_base.kernels import Kernel

if TYPE_CHECKING:
    from trees.basis import Basis, Cuts
    from trees.table import TreeTable

MOST_TERMS = 30
"""Products of residues below (1/2 + 2^−17) 2^30 that fit in int64 together."""
FEW_TREES = 100
"""Fractions for so many trees take about 15 ms; flint loads in 25 ms."""


class Exact:
    """Python or SymPy numbers in lists; kernels run uncompiled."""

    modulus: int = 0
    compiled = False

    def __init__(self, element: Callable[[Any], Any] | None = None):
        self._element = element

    def run(self, kernel: Kernel) -> Any:
        """The interpreted or compiled version of a kernel."""
        return kernel.compiled if self.compiled else kernel.py_func

    def zeros(self, size: int) -> Any:
        """A vector of `size` zeros."""
        return [0] * size

    def width(self, entries: int) -> int:
        """Length of a row for this many entries."""
        return max(entries, 1)

    def indices(self, numbers: Sequence[int]) -> Any:
        """A vector of indices."""
        return list(map(int, numbers))  # not NumPy's, which take numbers of flint for arrays

    def columns(self, table: TreeTable) -> tuple[Any, Any, Any, Any]:
        """Order, colour, left and right of every tree, as the kernels expect them."""
        return table.arrays if self.compiled else table.lists

    def orders(self, basis: Basis[Any]) -> Any:
        """The number of nodes of every element."""
        return basis.orders

    def cuts(self, cuts: Cuts) -> tuple[Any, Any, Any, Any]:
        """Where the rows of each element begin, trunks, branches and multiplicities, as the kernels expect them."""
        start, trunk, branch = self.ids(cuts[2:5])
        return start, trunk, branch, self.indices([] if cuts.multiplicity is None else cuts.multiplicity)

    def ids(self, columns: Iterable[Any]) -> tuple[Any, ...]:
        """Columns of ids, such as cuts and partitions, as the kernels expect them."""
        return tuple(x if isinstance(x, list) else x.tolist() for x in columns)

    def number(self, value: Any) -> Any:
        """An exact number as an element of the ring."""
        return value if self._element is None else self._element(value)

    def element(self, value: Any) -> Any:
        """A result as an element of the ring."""
        return value

    def vector(self, values: Sequence[Any]) -> Any:
        """A vector of exact numbers."""
        return [self.number(value) for value in values]

    def factors(self, values: Sequence[Any]) -> tuple[Any, Any]:
        """Factors of the terms of a sum, and their rounding errors (`bseries.exact.kernels.add_weighted`)."""
        return self.vector(values), self.zeros(0)

    def node_factor(self, *, field: bool) -> int:
        """The scaling per node."""
        return 1

    def doubling(self, j: int, *, field: bool) -> int:
        """Factor on 1/j! (see `Wrapped`)."""
        return 1

    entry_factors = (1, 1)
    """Factors on the entries of stage matrices and on weights (see `WrappedStages`)."""


class Compiled(Exact):
    """Numbers in NumPy arrays; kernels run compiled."""

    compiled = True
    dtype: str

    def zeros(self, size: int) -> Any:
        """An array of `size` zeros."""
        import numpy as np

        return np.zeros(size, self.dtype)

    def width(self, entries: int) -> int:
        """Length of a row: a multiple of four, a full set of SIMD lanes."""
        return max(entries + 3, 4) // 4 * 4

    def indices(self, numbers: Sequence[int]) -> Any:
        """An array of indices."""
        import numpy as np

        return np.array(numbers, np.int64)

    def orders(self, basis: Basis[Any]) -> Any:
        """The number of nodes of every element, as an unsigned array, which kernels index without testing the sign."""
        return basis.order.view(f"u{basis.order.itemsize}")

    def ids(self, columns: Iterable[Any]) -> tuple[Any, ...]:
        """Columns of ids as arrays: where each tree begins, then ids, of the types in compiled tables."""
        import numpy as np

        start, *others = columns
        return np.asarray(start, np.int64), *(np.asarray(x, np.uint32) for x in others)

    def vector(self, values: Sequence[Any]) -> Any:
        """An array of exact numbers."""
        import numpy as np

        return np.array([self.number(value) for value in values], self.dtype)


class FloatLists(Exact):
    """Floats in lists, for few trees."""

    def number(self, value: Any) -> float:
        """The nearest float."""
        return float(value)

    def factors(self, values: Sequence[Any]) -> tuple[Any, Any]:
        """Factors as sums of two floats, the first of 24 bits; those of j = 0 and 1 are just rounded."""
        weights = [self.number(value) for value in values]
        for j in range(2, len(values)):
            fraction, exponent = math.frexp(weights[j])
            weights[j] = math.ldexp(round(math.ldexp(fraction, 24)), exponent - 24)
        tails = [0 if j < 2 else value - Fraction(weights[j]) for j, value in enumerate(values)]
        return self.vector(weights), self.vector(tails)


class Float(Compiled, FloatLists):
    """float64."""

    dtype = "float64"


class Prime(Compiled):
    """Residues of least absolute value modulo a prime below 2^30."""

    dtype = "int64"

    def __init__(self, prime: int):
        super().__init__()
        self.prime = self.modulus = prime

    def number(self, value: Any) -> int:
        """The residue of a rational number whose denominator the prime does not divide."""
        residue = value.numerator * pow(value.denominator, -1, self.prime) % self.prime
        return residue - self.prime if 2 * residue > self.prime else residue


class Wrapped(Compiled):
    """Integers modulo 2^64 (int64 with wraparound): one pass, the fastest exact arithmetic.

    Odd denominators are units modulo 2^64; scaling removes powers of two. Suppose a(τ) 2^(e·n) has an odd denominator
    for trees with n nodes. Values of a flow carry the factor 2^((e+1)n), those of a field 2^((e+1)n − 1). Then the j-th
    Lie derivative of a flow carries 2^((e+1)n − j), and since j! has fewer than j factors of two, 2^j/j! (2^(j−1)/j!
    towards a field) is a 2-adic integer: the recursions need no other factors and no division.
    """

    dtype = "int64"

    def __init__(self, twos: int):
        super().__init__()
        self.twos = twos

    def number(self, value: Any) -> int:
        """A rational number with odd denominator, modulo 2^64."""
        residue = value.numerator * pow(value.denominator, -1, 2**64) % 2**64
        return residue - 2**64 if residue >= 2**63 else residue

    def node_factor(self, *, field: bool) -> int:
        """2^(e+1), or 2^e where the product over the nodes gives the value of a field."""
        return 2**self.twos if field else 2 ** (self.twos + 1)

    def doubling(self, j: int, *, field: bool) -> int:
        """2^j, or 2^(j−1) towards a field, which has no term j = 0."""
        return 2**j // 2 if field else 2**j

    def twos_of(self, n: int, *, field: bool) -> int:
        """The exponent of two in the scaling of trees with n nodes."""
        return (self.twos + 1) * n - field


class WrappedParts(Wrapped):
    """Integers modulo 2^64 for sums over partitions, a(skeleton) Π b(parts).

    Parts with n nodes (and results) carry 2^(slope·n − offset), skeletons with m nodes 2^(offset·(m−1)). For every
    partition of a tree with n nodes the product of skeleton and parts carries 2^(slope·n − offset) again.
    """

    def __init__(self, slope: int, offset: int):
        super().__init__(0)
        self.slope = slope
        self.offset = offset

    def twos_of(self, n: int, *, field: bool) -> int:
        """The exponent of two in the scaling of a part (field) or a skeleton."""
        return self.slope * n - self.offset if field else self.offset * (n - 1)


class WrappedStages(Wrapped):
    """Integers modulo 2^64 for the modifying integrator, stage by stage.

    Let 2^d and 2^e be the powers of two in the denominators of the stage matrices and of the weights. Fields and stage
    derivatives k_i carry 2^((d+e+1)(n−1)); points Y = Σ a k and their logarithms carry 2^d more, the factor on a. The
    j-th derivative along a logarithm then lacks 2^(j(e+1)), and weights of 2^(j+(j−1)e)/j! leave 2^e for b in
    Σ b_i k_i. All these are 2-adic integers since j! has fewer than j factors of two.
    """

    def __init__(self, of_matrix: int, of_weights: int):
        super().__init__(of_matrix + of_weights)
        self.of_weights = of_weights
        self.entry_factors = (2**of_matrix, 2**of_weights)

    def twos_of(self, n: int, *, field: bool) -> int:
        """The exponent of two in the scaling of a field."""
        return (self.twos + 1) * (n - 1)

    def doubling(self, j: int, *, field: bool) -> int:
        """2^((j−1)(e+1)) towards a logarithm (field), 2^(j+(j−1)e) towards a stage derivative."""
        return 2 ** max(0, (j - 1) * (self.of_weights + 1) + (not field))


@lru_cache(maxsize=1)
def integers() -> Exact:
    """Python's integers."""
    return Exact(whole)


def whole(value: Any) -> int:
    """A whole rational number, of Python or of flint, as an integer."""
    if isinstance(value, int):
        return value
    numerator, denominator = value.as_integer_ratio() if isinstance(value, Fraction) else (value.p, value.q)
    if denominator != 1:
        raise ArithmeticError(f"denominator bound is wrong: {value} is not an integer")
    return int(numerator)


def rationals(trees: float = math.inf) -> Exact:
    """Exact rational arithmetic: for few trees, Fractions take less time than loading flint."""
    return _fractions() if trees <= FEW_TREES else _flint()


@lru_cache(maxsize=1)
def _flint() -> Exact:
    """python-flint's rational numbers in lists, which take a tenth of the time of Fractions."""
    from flint import fmpq

    return Exact(lambda value: fmpq(value.numerator, value.denominator))


# One object for each set of arguments, so that caches can be keyed by arithmetic.
_fractions = lru_cache(maxsize=1)(Exact)
floats = lru_cache(maxsize=1)(Float)
float_lists = lru_cache(maxsize=1)(FloatLists)
prime_field = lru_cache(maxsize=1024)(Prime)
wrapped_integers = lru_cache(maxsize=64)(Wrapped)
wrapped_stages = lru_cache(maxsize=64)(WrappedStages)
wrapped_parts = lru_cache(maxsize=64)(WrappedParts)


@lru_cache(maxsize=1024)
def factorial_weights(
    arithmetic: Exact, count: int, factor: Any, field: bool, *, negated: bool = False
) -> tuple[Any, Any]:
    """±factor^j / j! for j = 0 … count, as factors of sums that give a field or a flow."""
    weights, weight = [], Fraction(-1 if negated else 1)
    for j in range(count + 1):
        weights.append(weight * arithmetic.doubling(j, field=field))
        weight = weight * factor / (j + 1)
    return arithmetic.factors(weights)
