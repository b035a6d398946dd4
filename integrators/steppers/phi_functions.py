"""φ-functions of matrices in fixed-point arithmetic, with many more digits than doubles have.

φ_0(z) = e^z and φ_k(z) = ∫₀¹ e^((1−θ)z) θ^(k−1)/(k−1)! dθ: they solve z' = X z + Σ θ^j g_j exactly, by
z(1) = z(0) + φ_1(X) X z(0) + Σ j! φ_(j+1)(X) g_j.

References:
    M. Hochbruck, A. Ostermann, Acta Numerica 19 (2010) 209–286, doi:10.1017/S0962492910000048, section 2.1;
    K. Ozaki, T. Ogita, S. Oishi, S. M. Rump, Numer. Algorithms 59 (2012) 95–118, doi:10.1007/s11075-011-9478-1 (exact
    products of matrices from products in doubles).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import factorial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

BITS = 176
"""Digits behind the point; squaring loses one for each doubling of the argument."""
SMALL_BITS = 8
"""The Taylor series is used for arguments below 2^-8."""
MOST_BITS = BITS + 1100
"""Beyond, numbers would be no doubles."""
LIMB = 20
"""Products of so many bits, and sums of a few thousand of them, are exact in doubles."""


def fixed_point(rows: Sequence[Sequence[Fraction]]) -> np.ndarray:
    """A matrix as integers, in units of 2^−BITS."""
    import numpy as np

    matrix = np.empty((len(rows), len(rows[0])), dtype=object)
    matrix[:] = [[round(x * 2**BITS) for x in row] for row in rows]
    return matrix


def doubles(values: Iterable[Any]) -> np.ndarray:
    """Fixed-point numbers as doubles, and the rounding errors of these as doubles: two rows."""
    import numpy as np

    heads = [x / 2**BITS for x in values]
    tails = [(x - int(Fraction(head) * 2**BITS)) / 2**BITS for x, head in zip(values, heads, strict=True)]
    return np.array([heads, tails])


def phi_functions(matrix: np.ndarray, count: int) -> list[np.ndarray] | None:
    """φ_1(X), …, φ_count(X) in fixed-point arithmetic; None if they are no doubles.

    Example:
        >>> (phi,) = phi_functions(fixed_point([[Fraction(1)]]), 1)
        >>> print(doubles(phi[0])[0])  # e − 1
        [1.71828183]
    """
    import numpy as np

    one = np.diag([1 << BITS] * len(matrix)).astype(object)
    largest = max(sum(map(abs, row)) for row in matrix)
    halvings = max(0, int(largest).bit_length() - BITS + SMALL_BITS)
    small = matrix >> halvings
    phi = [_series(small, count, one)]
    for k in range(count - 1, 0, -1):
        phi.insert(0, product(small, phi[0]) + one // factorial(k))
    for doubling in range(halvings):
        exponential = one + product(matrix >> (halvings - doubling), phi[0])
        if max(int(x).bit_length() for x in exponential.flat) > MOST_BITS:
            return None
        phi = [
            product(exponential, phi[k - 1]) + sum(phi[j - 1] // factorial(k - j) for j in range(1, k + 1)) >> k
            for k in range(1, count + 1)
        ]
    return phi


def _series(matrix: np.ndarray, k: int, one: np.ndarray) -> np.ndarray:
    """φ_k(X) = Σ X^m / (m + k)! for a small X, by Horner's rule."""
    terms = 1
    while SMALL_BITS * terms + factorial(terms).bit_length() < BITS:
        terms += 1
    total = one // factorial(terms + k)
    for m in range(terms - 1, -1, -1):
        total = product(matrix, total) + one // factorial(m + k)
    return total


def product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """A B in fixed-point arithmetic: large integers are cut into limbs whose products are exact in doubles."""
    left, right = _limbs(A), _limbs(B)
    total: Any = 0
    for d in range(len(left) + len(right) - 1):
        pairs = ((i, d - i) for i in range(max(0, d - len(right) + 1), min(d + 1, len(left))))
        diagonal: Any = sum(left[i] @ right[j] for i, j in pairs)
        total = total + (diagonal.astype("int64").astype(object) << (LIMB * d))
    return total >> BITS


def _limbs(matrix: np.ndarray) -> list[np.ndarray]:
    """Matrices L_i of doubles with Σ L_i 2^(LIMB·i) = the matrix; the last one holds the signs."""
    count = 1 + max(int(x).bit_length() for x in matrix.flat) // LIMB
    lower = [((matrix >> (LIMB * i)) & (2**LIMB - 1)).astype(float) for i in range(count - 1)]
    return [*lower, (matrix >> (LIMB * (count - 1))).astype(float)]
