"""One step of a symplectic method for the harmonic oscillator p' = −q, q' = p, and where its logarithm converges.

The step is [[a, −x b], [x c, d]] for the step size x, with rational functions a, b, c, d of s = x². Its determinant is
1, its eigenvalues are e^(±iθ) with cos θ = (a + d)/2, and its logarithm is

    θ / sin θ · [[(a − d)/2, −x b], [x c, (d − a)/2]],    sin θ = (1 + cos θ) tan(θ/2).

As a function of x it is singular at poles of the step, and where θ is a multiple of π other than 0, unless the step is
±1 there.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bseries.analysis.stability.field_elements import dot, from_element, to_elements
from bseries.analysis.stability.linear_stability import adjugate_terms, stability_function
from bseries.hamiltonians.symplectic_stages import Stages, entry

if TYPE_CHECKING:
    import sympy

    from integrators import RungeKutta
    from integrators.methods.program.evaluations import LinearForm

DIGITS = 60
"""Digits to compute roots with; multiple ones lose many."""
TOLERANCE = 1e-9
"""What counts as zero at a root."""
PIECES = 64
"""In how many pieces the way to a point is cut when an angle is followed."""


class OscillatorStep:
    """The step of a method, as exact functions of s = x².

    Args:
        entries: a, b, c, d.
        s: Their variable.
    """

    def __init__(self, entries: Sequence[sympy.Expr], s: sympy.Symbol):
        import sympy

        self.s = s
        self.entries: tuple[Any, ...] = tuple(sympy.cancel(entry) for entry in entries)
        self.cosine: Any = sympy.cancel((self.entries[0] + self.entries[3]) / 2)
        """cos θ."""
        self._numeric = sympy.lambdify(s, self.entries, "math")

    @classmethod
    def of_runge_kutta(cls, method: RungeKutta) -> OscillatorStep:
        """From R(xA) with A² = −1: the even and the odd part of the stability function."""
        import sympy

        s, z = sympy.symbols("s z")
        R = stability_function(method)
        above, below = (
            sympy.Add(*(sympy.sympify(x, strict=True) * z**k for k, x in enumerate(row)))
            for row in (R.numerator, R.denominator)
        )
        mirrored = below.subs(z, -z)
        even, odd = _parts(above * mirrored, z, -s)
        common, _ = _parts(below * mirrored, z, -s)
        return cls((even / common, odd / common, odd / common, even / common), s)

    @classmethod
    def of_stages(cls, stages: Stages) -> OscillatorStep:
        """From kicks by U = q²/2 and drifts by T = p²/2: P_i = p − x Σ a_ij Q_j, Q_i = q + x Σ â_ij P_j.

        With the values z at the stages, Q_i of those that kick and P_i of those that drift, z = z_0 + x N z, and the
        step is 1 + x E (1 − xN)⁻¹ z_0.
        """
        import sympy

        rows = stages.stages

        def changes(at: LinearForm, momentum: bool) -> list[Any]:
            """By what multiples of the values momenta, or positions, change on the way to a point."""
            signed = ((-1, one.forces) if momentum else (1, one.velocities) for one in rows)
            return [
                sign * entry(at, multiples) if one.kicks is momentum else Fraction(0)
                for one, (sign, multiples) in zip(rows, signed, strict=True)
            ]

        size = len(rows)
        if not size:
            return cls([sympy.Integer(int(i in (0, 3))) for i in range(4)], sympy.Symbol("s"))
        table = [changes(one.at, not one.kicks) for one in rows] + [changes(stages.end, m) for m in (True, False)]
        elements = to_elements([x for row in table for x in row])
        matrix = [elements[k : k + size] for k in range(0, len(elements), size)]
        terms = list(adjugate_terms([[-x for x in row] for row in matrix[:-2]]))
        start = [[Fraction(int(one.drifts)) for one in rows], [Fraction(int(one.kicks)) for one in rows]]
        s = sympy.Symbol("s")
        determinant = _even(s, [d for d, _ in terms])
        found = []
        for i, end in enumerate(matrix[-2:]):
            for j, vector in enumerate(start):
                moved = [dot(end, [dot(row, vector) for row in adjugate]) for _, adjugate in terms]
                if i == j:
                    numerator = determinant + _even(s, [Fraction(0), *moved])
                else:  # one power of x less, and the sign of −x b
                    numerator = _even(s, moved) * (-1 if i == 0 else 1)
                found.append(numerator / determinant)
        return cls(found, s)

    def formulas(self, h: Any, kappa: Any) -> tuple[Any, Any, Any]:
        """θ/sin θ times b, c and (d − a)/h at x = h √κ; real as long as tan(θ/2) is, from h = 0 on."""
        import sympy

        s = h**2 * kappa
        a, b, c, d = (entry.subs(self.s, s) for entry in self.entries)
        if s == 0:
            return b, c, (d - a) / h if h else d - a
        angle, rational, root = self._half_angle(h, kappa)
        found = []
        for factor in (b, c, (d - a) / h):
            rest = factor / ((1 + (a + d) / 2) * rational)
            written = (root**k * sympy.factor(sympy.cancel(rest / root ** (k + 1))) for k in (-1, 1))
            found.append(2 * angle * min(written, key=sympy.count_ops))
        return found[0], found[1], found[2]

    def _half_angle(self, h: Any, kappa: Any) -> tuple[Any, Any, Any]:
        """θ/2, and tan(θ/2) as the product of h √κ r and a root; for κ < 0 without the factors i.

        Returns:
            θ/2, the rational part h √κ r, and the root.
        """
        import sympy

        squared = sympy.cancel((1 - self.cosine) / (1 + self.cosine) / self.s)
        rational = h * sympy.sqrt(abs(kappa) if kappa.is_negative else kappa)
        root = sympy.sqrt(squared.subs(self.s, 0))
        for part, sign in zip(sympy.fraction(squared), (1, -1), strict=True):
            for factor, times in sympy.factor_list(part)[1]:
                one = (factor / factor.subs(self.s, 0)).subs(self.s, h**2 * kappa)
                rational *= one ** (sign * (times // 2))
                root *= sympy.sqrt(one) ** (sign * (times % 2))
        angle = (sympy.atanh if kappa.is_negative else sympy.atan)(rational * root)
        return angle, rational, root

    def coefficients(self, x: complex) -> tuple[complex, complex, complex]:
        """θ/sin θ times b, c and (d − a)/x, on the branch that is continuous from x = 0."""
        if x == 0:
            return 1.0, 1.0, 0.0
        a, b, c, d = self._numeric(x * x)
        angle, sine = self._angle(x)
        if sine == 0:  # the step is ±1, and the limit finite
            return self.coefficients(x * (1 - TOLERANCE))
        return angle / sine * b, angle / sine * c, angle / sine * (d - a) / x

    def _angle(self, x: complex) -> tuple[complex, complex]:
        """θ and sin θ, followed from 0 to x along a straight line."""
        before = now = sine = 0j
        for k in range(1, PIECES + 1):
            s = (x * k / PIECES) ** 2
            a, b, c, d = self._numeric(s)
            positive = cmath.sqrt(s * b * c - ((a - d) / 2) ** 2)  # more exact than from cos θ
            expected, principal = 2 * now - before, -1j * cmath.log((a + d) / 2 + 1j * positive)
            choices = []
            for sign in (1, -1):
                turns = round(((expected - sign * principal) / (2 * math.pi)).real)
                choices.append((sign * principal + 2 * math.pi * turns, sign * positive))
            before, (now, sine) = now, min(choices, key=lambda choice: abs(choice[0] - expected))
        return now, sine

    def radius(self) -> float:
        """The radius of convergence of the logarithm in powers of x."""
        for s, is_pole in self._candidates():
            if is_pole or not self._is_regular(s):
                return math.sqrt(abs(s))
        return math.inf

    def _candidates(self) -> list[tuple[complex, bool]]:
        """Poles of the step, and where cos θ = ±1, those nearest to 0 first."""
        import mpmath
        import sympy

        zeros = [(sympy.numer(sympy.cancel(self.cosine - sign)), False) for sign in (1, -1)]
        poles = [(sympy.denom(entry), True) for entry in self.entries]
        found = []
        for formula, is_pole in [*poles, *zeros]:
            with mpmath.workdps(DIGITS):
                numbers = [mpmath.mpf(x.evalf(DIGITS)) for x in sympy.Poly(formula, self.s).all_coeffs()]
                while numbers and not numbers[-1]:
                    numbers.pop()  # s = 0, where the step is 1
                if len(numbers) > 1:
                    roots = mpmath.polyroots(numbers, maxsteps=500, extraprec=10 * DIGITS)
                    found += [(complex(root), is_pole) for root in roots]
        return sorted(found, key=lambda candidate: abs(candidate[0]))

    def _is_regular(self, s: complex) -> bool:
        """Whether the logarithm is analytic where cos θ = ±1: the step is ±1, or θ = 0."""
        a, b, c, d = self._numeric(s)
        if max(abs(b), abs(c), abs(a - d)) < TOLERANCE:
            return True
        angle, _ = self._angle(cmath.sqrt(s))
        return abs(angle) < 1


def _parts(polynomial: Any, z: sympy.Symbol, square: Any) -> tuple[Any, Any]:
    """The even part, and the odd part divided by z, with `square` for z²."""
    import sympy

    parts: tuple[list[Any], list[Any]] = ([], [])
    for (k,), x in sympy.Poly(polynomial, z).terms():
        parts[k % 2].append(x * square ** (k // 2))
    return sympy.Add(*parts[0]), sympy.Add(*parts[1])


def _even(s: sympy.Symbol, coefficients: Sequence[Any]) -> Any:
    """An even polynomial in x, given by the coefficients of 1, x, x², …"""
    import sympy

    return sympy.Add(*(sympy.sympify(from_element(x), strict=True) * s**k for k, x in enumerate(coefficients[::2])))
