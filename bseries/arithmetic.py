"""The numbers that the recursions run on: exact ones, floats, residues, and bounds.

A recursion (`bseries.recursions`) is written once; an arithmetic says how its vectors are stored, how numbers get in,
and which execution of the kernels runs. Values of a flow carry a factor `flow_scale` per node and values of a field
half of one factor less (see `Wrapped`); everywhere else both are 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from trees.compiled import Kernel

from .exceptions import SeriesError

if TYPE_CHECKING:
    from trees.table import Splits, TreeTable

PRIME_BITS = 30
"""Primes p lie just below 2^30, residues below (1/2 + 2^−17) p: `MOST_TERMS` products of two add up in int64."""

MOST_TERMS = 30


class Exact:
    """Python or SymPy numbers in lists; kernels run uncompiled."""

    modulus: Any = 0
    majorant = False

    def __init__(self, element: Callable[[Any], Any] | None = None):
        self._element = element

    def run(self, kernel: Kernel) -> Any:
        """The execution of a kernel that suits these numbers."""
        return kernel.py_func

    def zeros(self, size: int) -> Any:
        """A vector of `size` zeros."""
        return [0] * size

    def scratch(self, size: int) -> Any:
        """A work vector wide enough for sums of products."""
        return [0] * size

    def width(self, entries: int) -> Any:
        """Length of a row for this many entries."""
        return max(entries, 1)

    def size(self, number: int) -> Any:
        """A length."""
        return number

    def columns(self, table: TreeTable) -> tuple[Any, Any, Any, Any]:
        """Order, colour, left and right of every tree, in the form that the kernels want."""
        return table.lists

    def splits(self, splits: Splits) -> tuple[Any, Any, Any]:
        """Starts, trunks and branches, in the form that the kernels want."""
        start, trunk, branch = (x if isinstance(x, list) else x.tolist() for x in splits[2:])
        return start, trunk, branch

    def number(self, value: Any) -> Any:
        """One exact number, as an element of the ring in use."""
        return value if self._element is None else self._element(value)

    def vector(self, values: Sequence[Any]) -> Any:
        """A vector of exact numbers."""
        return [self.number(value) for value in values]

    def node_factor(self, *, field: bool) -> int:
        """Factor on the values of trees with one node (then to the power of the number of nodes)."""
        return 1

    def doubling(self, j: int, *, field: bool) -> int:
        """Factor on 1/j! (see `Wrapped`)."""
        return 1


class Compiled(Exact):
    """Numbers in NumPy arrays; kernels run compiled."""

    dtype: str
    wide: str

    def run(self, kernel: Kernel) -> Any:
        """The compiled kernel."""
        return kernel.compiled

    def zeros(self, size: int) -> Any:
        """An array of `size` zeros."""
        import numpy as np

        return np.zeros(size, self.dtype)

    def scratch(self, size: int) -> Any:
        """A work array wide enough for sums of products."""
        import numpy as np

        return np.zeros(size, self.wide)

    def width(self, entries: int) -> Any:
        """Length of a row: a multiple of four, which fills vector registers."""
        import numpy as np

        return np.uint64(max(entries + 3, 4) // 4 * 4)

    def size(self, number: int) -> Any:
        """A length, unsigned."""
        import numpy as np

        return np.uint64(number)

    def columns(self, table: TreeTable) -> tuple[Any, Any, Any, Any]:
        """Order, colour, left and right of every tree as unsigned arrays."""
        return table.arrays

    def splits(self, splits: Splits) -> tuple[Any, Any, Any]:
        """Starts, trunks and branches as arrays."""
        import numpy as np

        return np.asarray(splits.start), np.asarray(splits.trunk), np.asarray(splits.branch)

    def vector(self, values: Sequence[Any]) -> Any:
        """An array of exact numbers, brought into this arithmetic."""
        import numpy as np

        return np.array([self.number(value) for value in values], self.dtype)


class Float(Compiled):
    """float64."""

    dtype = wide = "float64"

    def number(self, value: Any) -> float:
        """The nearest float."""
        return float(value)


class FloatLists(Exact):
    """Floats in lists, for small tables while numba is not loaded."""

    def number(self, value: Any) -> float:
        """The nearest float."""
        return float(value)


class Majorant(Float):
    """Rigorous upper bounds of absolute values, in float64.

    Lie derivatives are sums of products, so bounds on |b| and |c| give bounds on |∂_b^j c| by the same recursion, and
    every other operation is a sum of those with known factors: all factors are made positive. In particular |log a| is
    bounded by the β with β = |a| + Σ_{j≥2} ∂_β^{j−1} β / j!. (Tempting, but wrong: −log(−|a|). It bounds log a on tall
    trees only, because the signs in a product over a forest multiply.)

    Values of trees with n nodes are scaled by 2^(−exponent·n) such that no input exceeds 1, and raised to at least
    2^(−floor·n) unless zero, so that nothing over- or underflows. Nothing is ever subtracted: a product of n
    inputs passes through at most 3 n² + (s + 4) n roundings on its way (s stages), which makes a relative error below
    2^−40 within `MOST_TERMS`, and `SLACK` covers several such steps.
    """

    majorant = True
    SLACK = 1 + 2.0**-20

    def __init__(self, exponent: int, order: int):
        super().__init__()
        self.exponent = exponent
        self.floor = 800 // order

    def number(self, value: Any) -> float:
        """|value|, rounded up, and lifted to the smallest positive number in use unless it is zero."""
        return max(abs(float(value)) * (1 + 2.0**-50), 2.0**-self.floor) if value else 0.0

    def node_factor(self, *, field: bool) -> Any:
        """The scaling of values with one node."""
        return Fraction(2) ** -self.exponent


class Prime(Compiled):
    """Residues modulo a prime below 2^30, of least absolute value."""

    dtype, wide = "int32", "int64"

    def __init__(self, prime: int):
        import numpy as np

        super().__init__()
        self.prime = prime
        self.modulus = np.int64(prime)

    def number(self, value: Any) -> int:
        """The residue of a rational number whose denominator the prime does not divide."""
        residue = value.numerator * pow(value.denominator, -1, self.prime) % self.prime
        return residue - self.prime if 2 * residue > self.prime else residue


class Wrapped(Compiled):
    """Integers modulo 2^64: int64 that wraps around. One pass, the fastest exact arithmetic there is.

    Odd denominators are units modulo 2^64; powers of two are scaled away. Let a(τ) 2^(e·n) be free of them for trees
    with n nodes. In a flow every value carries the factor 2^((e+1)n), in a field 2^((e+1)n − 1). Then the j-th
    Lie derivative of a flow carries 2^((e+1)n − j), and since j! has fewer than j factors of two, 2^j/j! (2^(j−1)/j!
    towards a field) is a 2-adic integer: the recursions need no other multipliers and never divide.
    """

    dtype = wide = "int64"

    def __init__(self, twos: int):
        import numpy as np

        super().__init__()
        self.modulus = np.int64(0)
        self.twos = twos

    def number(self, value: Any) -> int:
        """A rational number with odd denominator, modulo 2^64."""
        residue = value.numerator * pow(value.denominator, -1, 2**64) % 2**64
        return residue - 2**64 if residue >= 2**63 else residue

    def node_factor(self, *, field: bool) -> int:
        """2^(e+1), or 2^e where the product over the nodes shall be a field's value."""
        return 2**self.twos if field else 2 ** (self.twos + 1)

    def doubling(self, j: int, *, field: bool) -> int:
        """2^j, or 2^(j−1) towards a field, which has no 0-th term."""
        return 2**j // 2 if field else 2**j


# One object for each, so that vectors can be kept by arithmetic (below, and in `bseries.recursions`).
prime_field = lru_cache(maxsize=1024)(Prime)
wrapped_integers = lru_cache(maxsize=64)(Wrapped)
majorants = lru_cache(maxsize=64)(Majorant)


@lru_cache(maxsize=1024)
def factorial_weights(arithmetic: Exact, count: int, factor: Any, field: bool) -> Any:
    """factor^j / j! for j = 0 … count, for sums that give a field's or a flow's values."""
    weights, weight = [], Fraction(1)
    for j in range(count + 1):
        weights.append(weight * arithmetic.doubling(j, field=field))
        weight = weight * factor / (j + 1)
    return arithmetic.vector(weights)


@lru_cache(maxsize=1)
def _prime_pool() -> list[int]:
    """The primes in the last 2^18 numbers below 2^30, largest first."""
    import numpy as np

    start, stop = 2**PRIME_BITS - 2**18, 2**PRIME_BITS
    composite = np.zeros(stop - start, bool)
    for divisor in range(2, math.isqrt(stop) + 1):
        composite[-start % divisor :: divisor] = True
    return (start + np.flatnonzero(~composite))[::-1].tolist()


def primes_beyond(bits: float, avoid: int) -> list[int]:
    """Primes, none of which divides `avoid`, whose product exceeds 2^bits."""
    chosen, product_bits = [], 0.0
    for prime in _prime_pool():
        if product_bits > bits:
            return chosen
        if avoid % prime:
            chosen.append(prime)
            product_bits += math.log2(prime) - 1e-9
    raise SeriesError(f"method must have coefficients of fewer digits: exact results would take {bits:.0f} bits each")
