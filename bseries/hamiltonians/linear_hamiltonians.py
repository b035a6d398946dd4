"""Quadratic Hamiltonians: their normal modes, and modified Hamiltonians in closed form.

y' = Ay with A = J⁻¹S falls into parts on which A² = −κ. There a method does what it does to the harmonic oscillator
with x = h √κ: Runge–Kutta methods whatever H is, other methods of kicks and drifts if H = T(p) + U(q). So the entries
of the step and of its logarithm are multiples of those of A:

    H̃ = Σ_κ θ/sin θ (c T_κ + b U_κ + (d − a)/h X_κ)   with T = ½ pᵀBp, U = ½ qᵀCq, X = ½ pᵀq on the part of κ.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exceptions import SeriesError
from bseries.fields.convergence import convergence_radius
from bseries.hamiltonians.oscillator_steps import DIGITS, OscillatorStep
from bseries.hamiltonians.symplectic_stages import Stages, canonical_pairs, symplectic_stages
from integrators import RungeKutta
from integrators.core.immutable import cached_method

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene


class Mode(NamedTuple):
    """The part on which A² = −κ; for Runge–Kutta methods, which need not tell T from U, T is all of H there."""

    kappa: Any
    T: Any
    U: Any
    X: Any


def quadratic_form(scene: Scene) -> Any:
    """The matrix S of H = ½ yᵀSy; None if H is another function, or has symbols."""
    import sympy

    H, y = scene.hamiltonian, scene.symbols
    if H is None or not H.is_polynomial(*y) or H.free_symbols - set(y):
        return None
    if any(sum(monomial) not in (0, 2) for monomial in sympy.Poly(H, *y).monoms()):
        return None
    return sympy.hessian(H, y)


class LinearHamiltonian:
    """The modified Hamiltonian of a symplectic method on a linear Hamiltonian system.

    Args:
        method: The method.
        scene: The scene.
        form: The matrix S.
        parts: What the method's parts are.

    Raises:
        SeriesError: The method is not symplectic, or no closed form is known.
    """

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

        roots = [root for factor, _ in self._polynomial.factor_list()[1] for root in _simple_roots(factor)]
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
        """The parts on which A² = −κ, by projections that are polynomials in A²; `matrix` makes one of exact rows."""
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
        """H̃ at the rows of y."""
        return ((y @ self.matrix(h)) * y).sum(axis=1)

    def radii(self, y: np.ndarray) -> np.ndarray:
        """The radius of convergence, the same everywhere."""
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
        """H̃ as a formula; real up to the first step size at which an eigenvalue of the step is −1."""
        import sympy

        y = sympy.Matrix(self._scene.symbols)
        total: Any = sympy.Integer(0)
        for mode in self._exact_modes:
            T, U, X = (sympy.expand((y.T * form * y)[0, 0]) for form in (mode.T, mode.U, mode.X))
            b, c, mixed = self._step.formulas(h, mode.kappa)
            total += c * T + b * U + mixed * X
        return total


def _check_separable(method: Method, scene: Scene, stages: Stages) -> None:
    """Refuse other methods than those of kicks by all of U(q) and drifts by all of T(p)."""
    import sympy

    parts = {stage.hamiltonian for stage in stages.stages}
    mixed = any(stage.kicks and stage.drifts for stage in stages.stages)
    if mixed or sympy.expand(sympy.Add(*parts) - scene.hamiltonian).free_symbols:
        raise SeriesError(
            "method must be a Runge–Kutta method, or kick by U(q) and drift by T(p), for a closed form, but "
            f"{method.name} on {scene.name} does otherwise"
        )


def _minimal_polynomial(square: Any, name: str) -> Any:
    """The polynomial with the eigenvalues of −A² as simple roots; there must be no Jordan blocks."""
    import sympy

    polynomial = sympy.Poly(square.charpoly().as_expr(), extension=True).sqf_part()
    value = sympy.zeros(square.rows)
    for coefficient in polynomial.all_coeffs():
        value = value * square + coefficient * sympy.eye(square.rows)
    if not value.applyfunc(sympy.simplify).is_zero_matrix:
        raise SeriesError(f"scene must have a square A² that can be diagonalised, but that of {name} has Jordan blocks")
    return polynomial


def _simple_roots(factor: Any) -> list[Any]:
    """The roots of a polynomial of degree one or two; none of others."""
    import sympy

    return list(sympy.roots(factor)) if factor.degree() <= 2 else []
