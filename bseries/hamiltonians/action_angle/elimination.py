"""Elimination of angles from a nearly integrable Hamiltonian, order by order.

For H(a, θ) = K(a) + ε H_1(a, θ) + ε² H_2(a, θ) + … a generating function S(b, θ) = ε S_1 + ε² S_2 + … is found such
that H(b + ∇_θ S, θ) = N(b, θ + ∇_b S), where N depends on resonant angles only, and on none without resonances. With
the terms of lower orders known, the terms with ε^j are

    ω(b)·∇_θ S_j + R_j(b, θ) = N_j(b, θ),    ω = ∇K,

where R_j is the remainder of both Taylor expansions. N_j is the mean of R_j, with its resonant modes (k·ω = 0). The
other modes, divided by k·ω(b), give S_j.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import cache
from typing import NamedTuple, TypeAlias

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.polynomials import Element
from bseries.hamiltonians.action_angle.fourier import FourierPolynomial, FourierRing, Mode

Exponents: TypeAlias = tuple[int, ...]


class Denominator(NamedTuple):
    """Denominator k·ω(b), with the first order at which it occurs."""

    value: Element
    order: int


class Elimination:
    """Series S and N of a Hamiltonian, with their denominators.

    Args:
        fourier: The ring of the terms.
        terms: The terms K, H_1, …, H_N.
        keep_resonant: Whether resonant modes stay in N; otherwise they raise an error.

    Attributes:
        generating: The terms S_0 = 0, S_1, …, S_N.
        normal: The terms N_0 = K, N_1, …, N_N.
        denominators: The denominators by k.
        resonances: The first orders of the resonant modes of N, by k.
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
        shifted_actions = TaylorShift(fourier, fourier.along_action, d)
        shifted_angles = TaylorShift(fourier, fourier.along_angle, d)
        shifted_actions.terms.extend(terms)
        shifted_angles.terms.append(terms[0])
        for j in range(1, len(terms)):
            rest = fourier.sum([(1, shifted_actions.coefficient(j)), (-1, shifted_angles.coefficient(j))])
            generating, normal = self._split(rest, j)
            self.generating.append(generating)
            self.normal.append(normal)
            shifted_angles.terms.append(normal)
            shifted_actions.shift([fourier.along_angle(generating, i) for i in range(d)])
            shifted_angles.shift([fourier.along_action(generating, i) for i in range(d)])

    def _split(self, rest: FourierPolynomial, order: int) -> tuple[FourierPolynomial, FourierPolynomial]:
        """Split R_j into the terms S_j and N_j."""
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
                self._record_resonance(mode.k, order)
                normal[mode] = x
        return generating, normal

    def _denominator(self, k: Exponents) -> Element:
        """The denominator k·ω(b)."""
        return self.fourier.coefficients.dot(zip(k, self._frequencies, strict=True))

    def _find_reciprocal(self, k: Exponents) -> Element | None:
        """1/(k·ω(b)); None for a resonance."""
        common = math.gcd(*k)
        if common > 1:
            reduced = self._reciprocal(tuple(n // common for n in k))
            return None if reduced is None else reduced * Fraction(1, common)
        value = self._denominator(k)
        return None if self.fourier.is_zero(value) else self.fourier.reciprocal(value)

    def _record_resonance(self, k: Exponents, order: int) -> None:
        if not self._keep:
            raise SeriesError(
                f"hamiltonian must have no resonance through its terms of order {order}, but k·omega = 0 "
                f"for k = ({', '.join(map(str, k))}): see keep_resonant"
            )
        self.resonances.setdefault(k, order)


class TaylorShift:
    """Taylor expansion of f(x + δ) in powers of ε, for the known terms of f = Σ ε^m f_m and δ = Σ ε^j δ_j."""

    def __init__(
        self, fourier: FourierRing, derivative: Callable[[FourierPolynomial, int], FourierPolynomial], directions: int
    ):
        self._fourier, self._partial = fourier, derivative
        self.terms: list[FourierPolynomial] = []
        self._shifts: list[list[FourierPolynomial]] = [[{} for _ in range(directions)]]
        self._constant: FourierPolynomial = {fourier.constant: fourier.coefficients.coerce(1)}
        self._derivative, self._power = cache(self._find_derivative), cache(self._find_power)

    def shift(self, by: list[FourierPolynomial]) -> None:
        """Append the next δ_j."""
        self._shifts.append(by)

    def coefficient(self, j: int) -> FourierPolynomial:
        """The contribution of the known f_m and δ_m to the power ε^j."""
        pairs = [
            (derivative, power)
            for m, _ in enumerate(self.terms[: j + 1])
            for total in range(j - m + 1)
            for alpha in _exponents(total, len(self._shifts[0]))
            if (derivative := self._derivative(m, alpha)) and (power := self._power_of_shift(alpha, j - m))
        ]
        return self._fourier.dot(pairs)

    def _find_derivative(self, m: int, alpha: Exponents) -> FourierPolynomial:
        """The derivative ∂^α f_m."""
        if not any(alpha):
            return self.terms[m]
        i = _first_direction(alpha)
        lower = self._derivative(m, _lowered(alpha, i))
        return self._partial(lower, i) if lower else {}

    def _power_of_shift(self, alpha: Exponents, n: int) -> FourierPolynomial:
        """The coefficient of ε^n in δ^α / α!."""
        total = sum(alpha)
        if total == 0:
            return {} if n else self._constant
        if total == 1:
            return self._shifts[n][alpha.index(1)] if n < len(self._shifts) else {}
        return self._power(alpha, n)

    def _find_power(self, alpha: Exponents, n: int) -> FourierPolynomial:
        i = _first_direction(alpha)
        lower = _lowered(alpha, i)
        pairs = ((self._power_of_shift(lower, n - j), self._shifts[j][i]) for j in range(1, n - sum(lower) + 1))
        return self._fourier.sum([(Fraction(1, alpha[i]), self._fourier.dot(pairs))])


def _exponents(total: int, size: int) -> Iterator[Exponents]:
    """All multi-indices with a given sum."""
    if size == 1:
        yield (total,)
        return
    for first in range(total, -1, -1):
        for rest in _exponents(total - first, size - 1):
            yield (first, *rest)


def _first_direction(alpha: Exponents) -> int:
    """The first direction with a nonzero exponent."""
    return next(i for i, n in enumerate(alpha) if n)


def _lowered(alpha: Exponents, i: int) -> Exponents:
    return (*alpha[:i], alpha[i] - 1, *alpha[i + 1 :])
