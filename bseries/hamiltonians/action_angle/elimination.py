"""The elimination of angles from a nearly integrable Hamiltonian, order by order.

For H(a, θ) = K(a) + ε H_1(a, θ) + ε² H_2(a, θ) + … a generating function S(b, θ) = ε S_1 + ε² S_2 + … is sought such
that H(b + ∇_θ S, θ) = N(b, θ + ∇_b S), where N depends on resonant angles only: on none, if there is no resonance.
With all of order below j known, the terms with ε^j are

    ω(b)·∇_θ S_j + R_j(b, θ) = N_j(b, θ),    ω = ∇K,

where R_j is the rest of both Taylor expansions. N_j takes from R_j its mean (and the resonant modes, k·ω = 0), S_j the
others, divided by k·ω(b).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import cache
from typing import NamedTuple, TypeAlias

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.differential_rings import Element
from bseries.hamiltonians.action_angle.fourier import FourierPolynomial, FourierRing, Mode

Exponents: TypeAlias = tuple[int, ...]


class Denominator(NamedTuple):
    """k·ω(b), and the first order at which something is divided by it."""

    value: Element
    order: int


class Elimination:
    """The series S and N of a Hamiltonian, and what was divided by.

    Args:
        fourier: The ring of the terms.
        terms: K, H_1, …, H_N.
        keep_resonant: Whether resonant modes stay in N; otherwise they are refused.

    Raises:
        SeriesError: K depends on angles, or there is a resonance.

    Attributes:
        generating: S_0 = 0, S_1, …, S_N.
        normal: N_0 = K, N_1, …, N_N.
        denominators: The denominators by k.
        resonances: The modes of N by k, with the first order at which each occurs.
    """

    def __init__(self, fourier: FourierRing, terms: Sequence[FourierPolynomial], *, keep_resonant: bool = False):
        self.fourier, self._keep = fourier, keep_resonant
        d = len(fourier.actions)
        if any(mode != fourier.constant for mode in terms[0]):
            names = ", ".join(map(str, fourier.actions))
            raise SeriesError(
                f"hamiltonian must depend on {names:.60} only where the parameter is 0, "
                f"but is {fourier.expression(terms[0])!s:.60} there"
            )
        energy = terms[0].get(fourier.constant, fourier.coefficients.zero)
        self._frequencies = [fourier.coefficients.derivative(energy, i) for i in range(d)]
        self._reciprocal = cache(self._find_reciprocal)
        self.generating: list[FourierPolynomial] = [{}]
        self.normal: list[FourierPolynomial] = [terms[0]]
        self.denominators: dict[Exponents, Denominator] = {}
        self.resonances: dict[Exponents, int] = {}
        shifted = Shifted(fourier, fourier.along_action, d)
        turned = Shifted(fourier, fourier.along_angle, d)
        shifted.terms.extend(terms)
        turned.terms.append(terms[0])
        for j in range(1, len(terms)):
            rest = fourier.sum([(1, shifted.coefficient(j)), (-1, turned.coefficient(j))])
            generating, normal = self._split(rest, j)
            self.generating.append(generating)
            self.normal.append(normal)
            turned.terms.append(normal)
            shifted.shift([fourier.along_angle(generating, i) for i in range(d)])
            turned.shift([fourier.along_action(generating, i) for i in range(d)])

    def _split(self, rest: FourierPolynomial, order: int) -> tuple[FourierPolynomial, FourierPolynomial]:
        """S_j and N_j from R_j."""
        generating: FourierPolynomial = {}
        normal: FourierPolynomial = {}
        for mode, x in rest.items():
            if mode == self.fourier.constant:
                normal[mode] = x
                continue
            reciprocal = self._reciprocal(mode.k)
            if reciprocal is not None:
                self.denominators.setdefault(mode.k, Denominator(self._denominator(mode.k), order))
                generating[Mode(mode.k, not mode.is_sine)] = x * reciprocal * (1 if mode.is_sine else -1)
            elif not self.fourier.is_zero(x):
                self._meet_resonance(mode.k, order)
                normal[mode] = x
        return generating, normal

    def _denominator(self, k: Exponents) -> Element:
        """k·ω(b)."""
        return self.fourier.coefficients.sum(zip(k, self._frequencies, strict=True))

    def _find_reciprocal(self, k: Exponents) -> Element | None:
        """1/(k·ω(b)); None if that is resonant."""
        common = math.gcd(*k)
        if common > 1:
            reduced = self._reciprocal(tuple(n // common for n in k))
            return None if reduced is None else reduced * Fraction(1, common)
        value = self._denominator(k)
        return None if self.fourier.is_zero(value) else self.fourier.reciprocal(value)

    def _meet_resonance(self, k: Exponents, order: int) -> None:
        if not self._keep:
            raise SeriesError(
                f"hamiltonian must have no resonance through its terms of order {order}, but k·omega = 0 "
                f"for k = ({', '.join(map(str, k))}): see keep_resonant"
            )
        self.resonances.setdefault(k, order)


class Shifted:
    """The powers of ε in f(x + δ), for f = Σ ε^m f_m and δ = Σ ε^j δ_j as far as they are known, by Taylor's formula.

    Args:
        fourier: The ring.
        slope: slope(f, i) is the derivative of f in the i-th direction.
        directions: The number of directions.
    """

    def __init__(
        self, fourier: FourierRing, slope: Callable[[FourierPolynomial, int], FourierPolynomial], directions: int
    ):
        self._fourier, self._slope = fourier, slope
        self.terms: list[FourierPolynomial] = []
        self._shifts: list[list[FourierPolynomial]] = [[{} for _ in range(directions)]]
        self._constant: FourierPolynomial = {fourier.constant: fourier.coefficients.coerce(1)}
        self._derivative, self._power = cache(self._find_derivative), cache(self._find_power)

    def shift(self, by: list[FourierPolynomial]) -> None:
        """Tell the next δ_j."""
        self._shifts.append(by)

    def coefficient(self, j: int) -> FourierPolynomial:
        """What the f_m and δ_m that are known contribute to the power ε^j."""
        pairs = [
            (slope, power)
            for m, _ in enumerate(self.terms[: j + 1])
            for total in range(j - m + 1)
            for alpha in _exponents(total, len(self._shifts[0]))
            if (slope := self._derivative(m, alpha)) and (power := self._power_of_shift(alpha, j - m))
        ]
        return self._fourier.dot(pairs)

    def _find_derivative(self, m: int, alpha: Exponents) -> FourierPolynomial:
        """∂^α f_m."""
        if not any(alpha):
            return self.terms[m]
        i = _first(alpha)
        lower = self._derivative(m, _less(alpha, i))
        return self._slope(lower, i) if lower else {}

    def _power_of_shift(self, alpha: Exponents, n: int) -> FourierPolynomial:
        """The power ε^n of δ^α / α!."""
        total = sum(alpha)
        if total == 0:
            return {} if n else self._constant
        if total == 1:
            return self._shifts[n][alpha.index(1)] if n < len(self._shifts) else {}
        return self._power(alpha, n)

    def _find_power(self, alpha: Exponents, n: int) -> FourierPolynomial:
        i = _first(alpha)
        lower = _less(alpha, i)
        pairs = ((self._power_of_shift(lower, n - j), self._shifts[j][i]) for j in range(1, n - sum(lower) + 1))
        return self._fourier.sum([(Fraction(1, alpha[i]), self._fourier.dot(pairs))])


def _exponents(total: int, size: int) -> Iterator[Exponents]:
    """All multi-indices with a sum."""
    if size == 1:
        yield (total,)
        return
    for first in range(total, -1, -1):
        for rest in _exponents(total - first, size - 1):
            yield (first, *rest)


def _first(alpha: Exponents) -> int:
    """The first direction that a derivative is taken in."""
    return next(i for i, n in enumerate(alpha) if n)


def _less(alpha: Exponents, i: int) -> Exponents:
    return (*alpha[:i], alpha[i] - 1, *alpha[i + 1 :])
