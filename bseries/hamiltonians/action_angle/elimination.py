"""Elimination of angles from a nearly integrable Hamiltonian, order by order.

For H(a, θ) = K(a) + ε H_1(a, θ) + ε² H_2(a, θ) + … a generating function S(b, θ) = ε S_1 + ε² S_2 + … is found such
that H(b + ∇_θ S, θ) = N(b, θ + ∇_b S), where N depends on resonant angles only, and on none without resonances. With
the terms of lower orders known, the terms with ε^n are

    ω(b)·∇_θ S_n + R_n(b, θ) = N_n(b, θ),    ω = ∇K,

where R_n is the remainder of both compositions. N_n is the mean of R_n, with its resonant modes (k·ω = 0). The other
modes, divided by k·ω(b), give S_n.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import NamedTuple

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.polynomials import Element
from bseries.fields.symbolic.power_series import Composition, PowerSeries
from bseries.hamiltonians.action_angle.fourier import FourierRing, Mode


class Denominator(NamedTuple):
    """Denominator k·ω(b), with the first order at which it occurs."""

    value: Element
    order: int


class Elimination:
    """Series S and N of the Hamiltonian K + ε H_1 + …, with denominators and the first orders of resonances by k.

    Resonant modes raise an error, or stay in N.
    """

    def __init__(self, ring: FourierRing, terms: Sequence[Element], *, keep_resonant: bool = False):
        self.ring, self._keep = ring, keep_resonant
        if ring.modes(terms[0]).keys() - {ring.constant}:
            names = ", ".join(map(str, ring.actions))
            raise SeriesError(
                f"hamiltonian must depend on {names:.60} only where the parameter is 0, "
                f"but is {ring.waves_expression(terms[0])!s:.60} there"
            )
        d = len(ring.actions)
        self._frequencies = [ring.derivative(terms[0], i) for i in range(d)]
        self._reciprocal = cache(self._find_reciprocal)
        self.generating, self.normal = [ring.zero], [terms[0]]
        self.denominators: dict[Mode, Denominator] = {}
        self.resonances: dict[Mode, int] = {}
        actions, angles = [self._shifted(i, d + i) for i in range(d)], [self._shifted(d + i, i) for i in range(d)]
        fixed = [PowerSeries.polynomial(ring.element(x)) for x in ring.variables]
        at_actions, at_angles = Composition(ring, [*actions, *fixed[d:]]), Composition(ring, [*fixed[:d], *angles])
        frequencies, left = [at_actions(x) for x in self._frequencies], [at_actions(x) for x in terms]
        right = [at_angles(terms[0])]
        for n in range(1, len(terms)):
            # n K_n = Σ m a_m·ω_{n−m} for K and ω at the actions a; the summand with m = n has the unknown S_n.
            moved = zip(actions, frequencies, strict=True)
            known = ring.dot((Fraction(m, n) * a[m], omega[n - m]) for a, omega in moved for m in range(1, n))
            perturbed = ring.dot((1, left[m][n - m]) for m in range(1, n + 1))
            self._split(known + perturbed - ring.dot((1, right[m][n - m]) for m in range(1, n)), n)
            right.append(at_angles(self.normal[n]))

    def _shifted(self, i: int, partner: int) -> PowerSeries:
        """A variable plus the derivative of S in its partner, as a series in ε."""
        start, ring = self.ring.element(self.ring.variables[i]), self.ring
        return PowerSeries(ring, lambda n: ring.derivative(self.generating[n], partner) if n else start)

    def _split(self, rest: Element, order: int) -> None:
        """Split R_n into the terms S_n and N_n, and append them."""
        ring, generating, normal = self.ring, list[tuple[Element, Element]](), list[tuple[Element, Element]]()
        for k, (c, s) in ring.modes(rest).items():
            cosine, sine = ring.wave(k)
            reciprocal = self._reciprocal(k) if any(k) else None
            if reciprocal is not None:
                self.denominators.setdefault(k, Denominator(self._denominator(k), order))
                generating += [(s * reciprocal, cosine), (-c * reciprocal, sine)]
            elif k == ring.constant or not (ring.is_zero(c) and ring.is_zero(s)):
                normal += [(c, cosine), (s, sine)]
                if any(k) and not self._keep:
                    raise SeriesError(
                        f"hamiltonian must have no resonance through its terms of order {order}, but k·omega = 0 "
                        f"for k = ({', '.join(map(str, k))}): see keep_resonant"
                    )
                if any(k):
                    self.resonances.setdefault(k, order)
        self.generating.append(ring.dot(generating))
        self.normal.append(ring.dot(normal))

    def _denominator(self, k: Mode) -> Element:
        """The denominator k·ω(b)."""
        return self.ring.dot(zip(k, self._frequencies, strict=True))

    def _find_reciprocal(self, k: Mode) -> Element | None:
        """1/(k·ω(b)); None for a resonance."""
        common = math.gcd(*k)
        if common > 1:
            reduced = self._reciprocal(tuple(n // common for n in k))
            return None if reduced is None else reduced * Fraction(1, common)
        value = self._denominator(k)
        return None if self.ring.is_zero(value) else self.ring.reciprocal(value)
