"""Families of linear multistep methods with k steps: Adams, BDF, Nyström, Milne–Simpson, and symmetric ones."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import comb

from bseries_base.errors import shown
from integrators.core.arguments import items, read_whole
from integrators.core.errors import IntegratorError
from integrators.exact import polynomials
from integrators.exact.entries import Entry, EntryRow, multiply_entries, read_entry
from integrators.methods.kinds.memory import LinearMultistep, dot

MOST_STEPS = 50
HNW = "Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, section III.1"


def adams_bashforth(k: int, *, name: str | None = None, reference: str | None = HNW) -> LinearMultistep:
    """The explicit Adams method with k steps, of order k.

    Example:
        >>> import bseries as bs
        >>> bs.memory.adams_bashforth(2).beta
        (Fraction(-1, 2), Fraction(3, 2), Fraction(0, 1))
    """
    return _from_differences(_steps(k, 1), 1, 0, name or f"ab{k}", reference)


def adams_moulton(k: int, *, name: str | None = None, reference: str | None = HNW) -> LinearMultistep:
    """The implicit Adams method with k steps, of order k + 1; k = 1 is the trapezoidal rule.

    Example:
        >>> import bseries as bs
        >>> bs.memory.adams_moulton(2).beta
        (Fraction(-1, 12), Fraction(2, 3), Fraction(5, 12))
    """
    return _from_differences(_steps(k, 1), 1, 1, name or f"am{k}", reference)


def nystrom(k: int, *, name: str | None = None, reference: str | None = HNW) -> LinearMultistep:
    """Nyström's explicit method y_{n+k} = y_{n+k−2} + …, of order k; k = 2 is the leapfrog or explicit midpoint rule.

    Example:
        >>> import bseries as bs
        >>> bs.memory.nystrom(3).beta
        (Fraction(1, 3), Fraction(-2, 3), Fraction(7, 3), Fraction(0, 1))
    """
    return _from_differences(_steps(k, 2), 2, 0, name or f"nystrom{k}", reference)


def milne_simpson(k: int, *, name: str | None = None, reference: str | None = HNW) -> LinearMultistep:
    """The implicit method y_{n+k} = y_{n+k−2} + … of Milne; k = 2 is Simpson's rule, of order 4.

    Example:
        >>> import bseries as bs
        >>> simpson = bs.memory.milne_simpson(2)
        >>> simpson.beta, simpson.order
        ((Fraction(1, 3), Fraction(4, 3), Fraction(1, 3)), 4)
    """
    return _from_differences(_steps(k, 2), 2, 1, name or f"milne-simpson{k}", reference)


def bdf(k: int, *, name: str | None = None, reference: str | None = HNW) -> LinearMultistep:
    """The backward differentiation formula with k steps, of order k; zero-stable for k ≤ 6.

    Example:
        >>> import bseries as bs
        >>> bs.memory.bdf(2).alpha, bs.memory.bdf(7).zero_stable
        ((Fraction(1, 2), Fraction(-2, 1), Fraction(3, 2)), False)
    """
    k = _steps(k, 1)
    # Σ_{j=1}^k ∇^j y_{n+k} / j = h f_{n+k}
    alpha = [
        sum((Fraction((-1) ** (k - i) * comb(j, k - i), j) for j in range(max(1, k - i), k + 1)), Fraction(0))
        for i in range(k + 1)
    ]
    return LinearMultistep(alpha, [*[0] * k, 1], name=name or f"bdf{k}", reference=reference)


def symmetric_multistep(
    angles: Sequence[object], *, explicit: bool = True, name: str = "symmetric-multistep", reference: str | None = None
) -> LinearMultistep:
    """The symmetric method whose ρ has the root 1 and those of modulus 1 with these arguments.

    ρ(ζ) = (ζ − 1) Π (ζ² − 2 cos θ ζ + 1), with a factor ζ + 1 for the angle π, and σ gives the largest order.

    Args:
        angles: The angles θ, rational multiples of π as text such as ``"pi/3"``, none of them 0 and no two equal.
        explicit: Whether β_k = β_0 = 0: order k for an even number k of steps, k − 1 for an odd one. Implicit methods
            have order k + 2 or k + 1.
        name, reference: As for `LinearMultistep`.

    Raises:
        IntegratorError: An angle is 0, no rational multiple of π or occurs twice, or an explicit method has no angle.

    Example:
        >>> import bseries as bs
        >>> milne = bs.memory.symmetric_multistep(["pi/2", "pi"])
        >>> list(map(str, milne.beta)), milne.order, milne.is_symmetric
        (['0', '8/3', '-4/3', '8/3', '0'], 4, True)

    References:
        HLW, section XV.4.
    """
    alpha: EntryRow = (Fraction(-1), Fraction(1))
    cosines = [read_entry(f"cos({angle})", f"angles[{j}]") for j, angle in enumerate(items(angles, "angles"), 1)]
    if len({1, *cosines}) <= len(cosines):
        raise IntegratorError(f"angles must differ from 0 and from one another, but were {shown(list(angles))}")
    for cosine in cosines:
        middle = multiply_entries(Fraction(-2), cosine)
        factor = (Fraction(1), Fraction(1)) if cosine == -1 else (Fraction(1), middle, Fraction(1))
        products = [
            dot(factor, [alpha[n - j] if 0 <= n - j < len(alpha) else Fraction(0) for j in range(len(factor))])
            for n in range(len(alpha) + len(factor) - 1)
        ]
        alpha = tuple(products)
    if explicit and len(alpha) == 2:
        raise IntegratorError("angles must have an entry for an explicit method, but was empty")
    places = range(explicit, len(alpha) - explicit)
    return LinearMultistep(alpha, _weights(alpha, places), name=name, reference=reference)


def _steps(k: object, least: int) -> int:
    return read_whole(k, "k", f"a number of steps from {least} to {MOST_STEPS}", least, MOST_STEPS)


def _from_differences(k: int, back: int, implicit: int, name: str, reference: str | None) -> LinearMultistep:
    """The method y_{n+k} − y_{n+k−back} = h Σ β_j f_{n+j} of the largest order."""
    alpha: list[Entry] = [Fraction(0)] * (k + 1)
    alpha[k - back], alpha[k] = Fraction(-1), Fraction(1)
    return LinearMultistep(alpha, _weights(alpha, range(k + implicit)), name=name, reference=reference)


def _weights(alpha: Sequence[Entry], places: Sequence[int]) -> EntryRow:
    """The β_j, nonzero at these places only, of the largest order.

    Σ α_i y(i) = Σ α_i ∫₀^i y' as ρ(1) = 0, and y' is replaced by its interpolation polynomial.
    """
    beta: list[Entry] = [Fraction(0)] * len(alpha)
    for j in places:
        basis = polynomials.ONE
        for m in places:
            if m != j:
                basis = polynomials.multiply(basis, (Fraction(-m, j - m), Fraction(1, j - m)))
        integral = (Fraction(0), *(x / (n + 1) for n, x in enumerate(basis)))
        beta[j] = dot(alpha, [polynomials.evaluate(integral, i) for i in range(len(alpha))])
    return tuple(beta)
