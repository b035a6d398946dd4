"""Modified Hamiltonians of symplectic methods for quadratic Hamiltonians, in closed form.

y' = Ay with A = J⁻¹S splits into modes on which A² = −κ. On a mode a method acts as on the harmonic oscillator p' = −q,
q' = p with the step size x = h √κ: any Runge–Kutta method, and other methods of kicks and drifts if H = T(p) + U(q).
The step for the oscillator is [[a, −x b], [x c, d]] with rational functions a, b, c, d of s = x². Its determinant is 1,
its eigenvalues are e^(±iθ) with cos θ = (a + d)/2, and its logarithm is

    θ / sin θ · [[(a − d)/2, −x b], [x c, (d − a)/2]],    sin θ = (1 + cos θ) tan(θ/2).

It is singular in x at poles of the step, and where θ is a nonzero multiple of π, unless the step is ±1 there. Hence

    H̃ = Σ_κ θ/sin θ (c T_κ + b U_κ + (d − a)/h X_κ)   with T = ½ pᵀBp, U = ½ qᵀCq, X = ½ pᵀq on the mode κ.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.analysis.stability.field_elements import dot, from_element, to_elements
from bseries.analysis.stability.linear_stability import adjugate_terms, stability_function
from bseries.exceptions import SeriesError
from bseries.fields.truncation import convergence_radius
from bseries.hamiltonians.symplectic_stages import Stages, canonical_pairs, entry, symplectic_stages
from integrators import RungeKutta
from integrators.core.immutable import cached_method

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene


DIGITS = 60
"""Digits for the computation of roots; multiple roots lose many."""
TOLERANCE = 1e-9
"""Largest value that counts as zero at a root."""
PIECES = 64
"""The number of segments along which the branch of an angle is continued."""


class OscillatorStep:
    """Step of a method for the harmonic oscillator: the `entries` a, b, c, d as exact functions of s = x²."""

    def __init__(self, entries: Sequence[sympy.Expr], s: sympy.Symbol):
        import sympy

        self.s = s
        self.entries: tuple[Any, ...] = tuple(sympy.cancel(entry) for entry in entries)
        self.cosine: Any = sympy.cancel((self.entries[0] + self.entries[3]) / 2)
        """cos θ."""
        self._numeric = sympy.lambdify(s, self.entries, "math")

    @classmethod
    def of_runge_kutta(cls, method: RungeKutta) -> OscillatorStep:
        """The step of a Runge–Kutta method: even and odd part of R(xA) with A² = −1."""
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
        """The step of kicks by U = q²/2 and drifts by T = p²/2: P_i = p − x Σ a_ij Q_j, Q_i = q + x Σ â_ij P_j.

        The values z at the stages (Q_i for kicks, P_i for drifts) satisfy z = z_0 + x N z, so that the step is
        1 + x E (1 − xN)⁻¹ z_0.
        """
        import sympy

        rows = stages.stages

        def changes(at: LinearForm, momentum: bool) -> list[Any]:
            """The coefficients of the stage values in the change of momenta, or positions, up to a point."""
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
                else:  # divided by x, with the sign of −x b
                    numerator = _even(s, moved) * (-1 if i == 0 else 1)
                found.append(numerator / determinant)
        return cls(found, s)

    def formulas(self, h: Any, kappa: Any) -> tuple[Any, Any, Any]:
        """θ/sin θ times b, c and (d − a)/h at x = h √κ, on the branch from h = 0 while tan(θ/2) is real."""
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
        """θ/2, and tan(θ/2) as the product of a rational part h √κ r and a root; for κ < 0 without the factors i."""
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
        """θ/sin θ times b, c and (d − a)/x, on the branch continuous from x = 0."""
        if x == 0:
            return 1.0, 1.0, 0.0
        a, b, c, d = self._numeric(x * x)
        angle, sine = self._angle(x)
        if sine == 0:  # the step is ±1, and the limit finite
            return self.coefficients(x * (1 - TOLERANCE))
        return angle / sine * b, angle / sine * c, angle / sine * (d - a) / x

    def _angle(self, x: complex) -> tuple[complex, complex]:
        """θ and sin θ, continued from 0 to x along a straight line."""
        before = now = sine = 0j
        for k in range(1, PIECES + 1):
            s = (x * k / PIECES) ** 2
            a, b, c, d = self._numeric(s)
            positive = cmath.sqrt(s * b * c - ((a - d) / 2) ** 2)  # more accurate than from cos θ
            expected, principal = 2 * now - before, -1j * cmath.log((a + d) / 2 + 1j * positive)
            choices = []
            for sign in (1, -1):
                periods = round(((expected - sign * principal) / (2 * math.pi)).real)
                choices.append((sign * principal + 2 * math.pi * periods, sign * positive))
            before, (now, sine) = now, min(choices, key=lambda choice: abs(choice[0] - expected))
        return now, sine

    def radius(self) -> float:
        """The radius of convergence of the logarithm in powers of x."""
        for s, is_pole in self._candidates():
            if is_pole or not self._is_regular(s):
                return math.sqrt(abs(s))
        return math.inf

    def _candidates(self) -> list[tuple[complex, bool]]:
        """Poles of the step and points with cos θ = ±1, by distance from 0."""
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
        """Whether the logarithm is analytic at a point with cos θ = ±1: the step is ±1, or θ = 0."""
        a, b, c, d = self._numeric(s)
        if max(abs(b), abs(c), abs(a - d)) < TOLERANCE:
            return True
        angle, _ = self._angle(cmath.sqrt(s))
        return abs(angle) < 1


def _parts(polynomial: Any, z: sympy.Symbol, square: Any) -> tuple[Any, Any]:
    """The even part and the odd part divided by z, with `square` in place of z²."""
    import sympy

    parts: tuple[list[Any], list[Any]] = ([], [])
    for (k,), x in sympy.Poly(polynomial, z).terms():
        parts[k % 2].append(x * square ** (k // 2))
    return sympy.Add(*parts[0]), sympy.Add(*parts[1])


def _even(s: sympy.Symbol, coefficients: Sequence[Any]) -> Any:
    """The even part of a polynomial in x with given coefficients, in s = x²."""
    import sympy

    return sympy.Add(*(sympy.sympify(from_element(x), strict=True) * s**k for k, x in enumerate(coefficients[::2])))


class Mode(NamedTuple):
    """Mode on which A² = −κ; for Runge–Kutta methods T is all of H there, and U and X are 0."""

    kappa: Any
    T: Any
    U: Any
    X: Any


def quadratic_form(scene: Scene) -> Any:
    """The matrix S of H = ½ yᵀSy; None if H is not quadratic, or has symbols."""
    import sympy

    H, y = scene.hamiltonian, scene.symbols
    if H is None or not H.is_polynomial(*y) or H.free_symbols - set(y):
        return None
    if any(sum(monomial) not in (0, 2) for monomial in sympy.Poly(H, *y).monoms()):
        return None
    return sympy.hessian(H, y)


class LinearHamiltonian:
    """Modified Hamiltonian of a symplectic method for H = ½ yᵀSy with the matrix `form`."""

    kind = "linear"

    def __init__(self, method: Method, scene: Scene, form: Any, parts: Any = None):
        import sympy

        self._scene = scene
        self._is_runge_kutta = isinstance(method, RungeKutta)
        stages = symplectic_stages(method, scene, parts)
        if isinstance(method, RungeKutta):
            self._step = OscillatorStep.of_runge_kutta(method)
            in_x = convergence_radius(method).radius
        else:
            _check_separable(method, scene, stages)
            self._step = OscillatorStep.of_stages(stages)
            in_x = self._step.radius()
        self._form = form
        rows: dict[int, Any] = {}
        for p, q in canonical_pairs(scene):
            rows[p], rows[q] = -form.row(q), form.row(p)
        self._square: Any = -(sympy.Matrix.vstack(*(rows[i] for i in sorted(rows))) ** 2)
        self._polynomial = _minimal_polynomial(self._square, scene.name)
        largest = max(abs(mode.kappa) for mode in self._numeric_modes)
        self.radius = in_x / math.sqrt(largest) if largest else math.inf

    @cached_property
    def _exact_modes(self) -> list[Mode]:
        import sympy

        factors = [factor for factor, _ in self._polynomial.factor_list()[1] if factor.degree() <= 2]
        roots = [root for factor in factors for root in sympy.roots(factor)]
        if len(roots) < self._polynomial.degree():
            raise SeriesError(
                f"scene must have frequencies that are square roots for a formula, but the squares of those of "
                f"{self._scene.name} are roots of {self._polynomial.as_expr()!s:.60}"
            )
        return [
            Mode(mode.kappa, *(form.applyfunc(sympy.simplify) for form in mode[1:]))
            for mode in self._modes(roots, sympy.Matrix)
        ]

    @cached_property
    def _numeric_modes(self) -> list[Mode]:
        import mpmath
        import numpy as np

        with mpmath.workdps(DIGITS):
            coefficients = [mpmath.mpf(x.evalf(DIGITS)) for x in self._polynomial.all_coeffs()]
            roots = mpmath.polyroots(coefficients, maxsteps=500, extraprec=10 * DIGITS)
            modes = self._modes(
                roots, lambda rows: mpmath.matrix([[mpmath.mpf(x.evalf(DIGITS)) for x in row] for row in rows])
            )
            return [
                Mode(complex(mode.kappa), *(np.array(form.tolist(), complex) for form in mode[1:])) for mode in modes
            ]

    def _modes(self, values: list[Any], matrix: Callable[[Any], Any]) -> list[Mode]:
        """The modes for the values of κ, by projections that are polynomials in A²; `matrix` converts exact rows."""
        import sympy

        size = self._scene.dimension
        one, square, form = (matrix(x.tolist()) for x in (sympy.eye(size), self._square, self._form / 2))
        found = []
        for kappa in values:
            factors = ((square - other * one) / (kappa - other) for other in values if other is not kappa)
            projection = math.prod(factors, start=one)
            if self._is_runge_kutta:
                found.append(Mode(kappa, form * projection, 0 * one, 0 * one))
                continue
            selected = [sympy.zeros(size) for _ in range(3)]
            for p, q in canonical_pairs(self._scene):
                selected[0][p, p], selected[1][q, q], selected[2][p, q] = 1, 1, sympy.Rational(1, 2)
            momenta, positions, mixed = (matrix(x.tolist()) for x in selected)
            found.append(Mode(kappa, momenta * form * projection, positions * form * projection, mixed * projection))
        return found

    @property
    def limit(self) -> sympy.Expr:
        """The quadratic form itself."""
        import sympy

        y = sympy.Matrix(self._scene.symbols)
        return (y.T * self._form * y)[0, 0] / 2

    def values(self, y: np.ndarray, h: float) -> np.ndarray:
        """Values of H̃ at the rows of y."""
        return ((y @ self.matrix(h)) * y).sum(axis=1)

    def radii(self, y: np.ndarray) -> np.ndarray:
        """Radii of convergence, equal at all points."""
        import numpy as np

        return np.full(len(y), self.radius)

    @cached_method
    def matrix(self, h: float) -> np.ndarray:
        """The matrix G of H̃ = yᵀGy."""
        import numpy as np

        total: Any = np.zeros((self._scene.dimension,) * 2, complex)
        for mode in self._numeric_modes:
            root = cmath.sqrt(mode.kappa)
            b, c, mixed = self._step.coefficients(h * root)
            total += c * mode.T + b * mode.U + mixed * root * mode.X
        return total.real

    def expression(self, h: Any) -> sympy.Expr:
        """The formula of H̃, real up to the first step size at which an eigenvalue of the step is −1."""
        import sympy

        y = sympy.Matrix(self._scene.symbols)
        total: Any = sympy.Integer(0)
        for mode in self._exact_modes:
            T, U, X = (sympy.expand((y.T * form * y)[0, 0]) for form in (mode.T, mode.U, mode.X))
            b, c, mixed = self._step.formulas(h, mode.kappa)
            total += c * T + b * U + mixed * X
        return total


def _check_separable(method: Method, scene: Scene, stages: Stages) -> None:
    """Check that a method consists of kicks by U(q) and drifts by T(p)."""
    import sympy

    parts = {stage.hamiltonian for stage in stages.stages}
    mixed = any(stage.kicks and stage.drifts for stage in stages.stages)
    if mixed or sympy.expand(sympy.Add(*parts) - scene.hamiltonian).free_symbols:
        raise SeriesError(
            "method must be a Runge–Kutta method, or kick by U(q) and drift by T(p), for a closed form, but "
            f"{method.name} on {scene.name} does otherwise"
        )


def _minimal_polynomial(square: Any, name: str) -> Any:
    """The minimal polynomial of −A², which must have simple roots."""
    import sympy

    polynomial = sympy.Poly(square.charpoly().as_expr(), extension=True).sqf_part()
    value = sympy.zeros(square.rows)
    for coefficient in polynomial.all_coeffs():
        value = value * square + coefficient * sympy.eye(square.rows)
    if not value.applyfunc(sympy.simplify).is_zero_matrix:
        raise SeriesError(f"scene must have a square A² that can be diagonalised, but that of {name} has Jordan blocks")
    return polynomial
