"""Modified Hamiltonians in closed form: sums of convergent series, with their radii of convergence.

For a quadratic H, y' = Ay with A = J⁻¹S splits into modes on which A² = −κ. On a mode a method acts as on the harmonic
oscillator p' = −q, q' = p with the step size x = h √κ: any Runge–Kutta method, and other methods of kicks and drifts if
H = T(p) + U(q). The step for the oscillator is [[a, −x b], [x c, d]] with rational functions a, b, c, d of s = x². Its
determinant is 1, its eigenvalues are e^(±iθ) with cos θ = (a + d)/2, and its logarithm is

    θ / sin θ · [[(a − d)/2, −x b], [x c, (d − a)/2]],    sin θ = (1 + cos θ) tan(θ/2).

It is singular in x at poles of the step, and where θ is a nonzero multiple of π, unless the step matrix is ±1 there.
Hence

    H̃ = Σ_κ θ/sin θ (c T_κ + b U_κ + (d − a)/h X_κ)   with T = ½ pᵀBp, U = ½ qᵀCq, X = ½ pᵀq on the mode κ.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Protocol, TypeAlias

import mpmath
import numpy as np
import sympy
from numpy.typing import ArrayLike, NDArray
from sympy.polys.matrices import DomainMatrix

from bseries.analysis.stability.criteria import stability_function
from bseries.exceptions import SeriesError
from bseries.fields.inputs import Formula, Step, read_states, read_step, read_symbolic_step
from bseries.fields.truncation import convergence_radius
from bseries.hamiltonians.symplectic_stages import Stages, canonical_pairs, entry, symplectic_stages
from bseries_base.formulas import formula_text
from integrators import RungeKutta
from integrators.core.immutable import cached_method
from integrators.exact.functions import as_function
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.evaluations import LinearForm
from integrators.methods.programs.program import Method
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene

Array: TypeAlias = NDArray[np.float64]
Radius: TypeAlias = float | sympy.Expr

DIGITS = 60  # digits of roots and eigenvectors; nearly equal eigenvalues lose many of them
TOLERANCE = 1e-9  # largest value that counts as zero at a root
PIECES = 64  # the number of segments along which the branch of an angle is continued


class OscillatorStep:
    """Step of a method for the harmonic oscillator: the `entries` a, b, c, d as exact functions of s = x²."""

    def __init__(self, entries: Sequence[sympy.Expr], s: sympy.Symbol):
        self.s = s
        self.entries: tuple[sympy.Expr, ...] = tuple(sympy.cancel(entry) for entry in entries)
        self.cosine: sympy.Expr = sympy.cancel((self.entries[0] + self.entries[3]) / 2)  # cos θ
        self._numeric = as_function([s], self.entries, "math")

    @classmethod
    def of_runge_kutta(cls, method: RungeKutta) -> OscillatorStep:
        """The step of a Runge–Kutta method: even and odd part of R(z) with z² = −s."""
        s, z = sympy.symbols("s z")
        R = stability_function(method)
        above, below = (
            sympy.Add(*(sympy.sympify(x, strict=True) * z**k for k, x in enumerate(row)))
            for row in (R.numerator, R.denominator)
        )
        mirrored = below.subs(z, -z)
        product = above * mirrored
        parts = ((product + product.subs(z, -z)) / 2, (product - product.subs(z, -z)) / (2 * z), below * mirrored)
        even, odd, common = (sympy.expand(part).subs(z, sympy.sqrt(-s)) for part in parts)
        return cls((even / common, odd / common, odd / common, even / common), s)

    @classmethod
    def of_stages(cls, stages: Stages) -> OscillatorStep:
        """The step of kicks by U = q²/2 and drifts by T = p²/2: P_i = p − x Σ a_ij Q_j, Q_i = q + x Σ â_ij P_j.

        The values z at the stages (Q_i for kicks, P_i for drifts) satisfy z = z_0 + x N z, so that the step is
        1 + x E (1 − xN)⁻¹ z_0.
        """
        rows = stages.stages
        s, x = sympy.Symbol("s"), sympy.Symbol("x")

        def changes(at: LinearForm, momentum: bool) -> list[sympy.Basic | int]:
            """The coefficients of the stage values in the change of momenta, or positions, up to a point."""
            signed = ((-1, one.forces) if momentum else (1, one.velocities) for one in rows)
            return [
                sympy.sympify(sign * entry(at, multiples), strict=True) if one.kicks is momentum else 0
                for one, (sign, multiples) in zip(rows, signed, strict=True)
            ]

        if not rows:
            return cls(list(map(sympy.Integer, (1, 0, 0, 1))), s)
        n = len(rows)
        table = [
            *([*changes(one.at, not one.kicks), int(one.drifts), int(one.kicks)] for one in rows),
            *([*changes(stages.end, momentum), 0, 0] for momentum in (True, False)),
        ]
        matrix = DomainMatrix.from_Matrix(sympy.Matrix(table), extension=True).to_field()
        N, start, E = matrix[:n, :n], matrix[:n, n:], matrix[n:, :n]
        coefficients = N.charpoly()  # also those of det(1 − xN), in ascending order
        determinant = sympy.Add(*(N.domain.to_sympy(d) * x**k for k, d in enumerate(coefficients)))
        step, column = determinant * sympy.eye(2), start - start
        for k, d in enumerate(coefficients[:-1]):  # adj(1 − xN) z_0 by powers of x (Faddeev–Le Verrier)
            column = N * column + start * d
            step += x ** (k + 1) * (E * column).to_Matrix()
        parts = (step[0, 0], -step[0, 1] / x, step[1, 0] / x, step[1, 1], determinant)
        *numerators, common = (sympy.expand(part).subs(x, sympy.sqrt(s)) for part in parts)
        return cls([part / common for part in numerators], s)

    def formulas(self, h: sympy.Expr, kappa: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr, sympy.Expr]:
        """θ/sin θ times b, c and (d − a)/h at x = h √κ, on the branch from h = 0 while tan(θ/2) is real."""
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

    def _half_angle(self, h: sympy.Expr, kappa: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr, sympy.Expr]:
        """θ/2, and tan(θ/2) as the product of a rational part h √κ r and a root; without the factors i if κ < 0."""
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
        if sine == 0:  # the step matrix is ±1, and the limit is finite
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
        # Poles of the step and points with cos θ = ±1 other than 0, by distance from 0.
        zeros = [(sympy.numer(sympy.cancel(self.cosine - sign)), False) for sign in (1, -1)]
        poles = [(sympy.denom(entry), True) for entry in self.entries]
        found: list[tuple[complex, bool]] = []
        for formula, is_pole in [*poles, *zeros]:
            polynomial = sympy.Poly(formula, self.s, extension=True)
            if polynomial.degree() > 0:
                roots = polynomial.sqf_part().nroots(DIGITS, maxsteps=500)
                found += [(complex(root), is_pole) for root in roots if root]
        found.sort(key=lambda candidate: abs(candidate[0]))
        return next((math.sqrt(abs(s)) for s, is_pole in found if is_pole or not self._is_regular(s)), math.inf)

    def _is_regular(self, s: complex) -> bool:
        """Whether the logarithm is analytic at a point with cos θ = ±1: the step matrix is ±1, or θ = 0."""
        a, b, c, d = self._numeric(s)
        return max(abs(b), abs(c), abs(a - d)) < TOLERANCE or abs(self._angle(cmath.sqrt(s))[0]) < 1


class ClosedForm(Protocol):
    """A closed form, as `ClosedHamiltonian` takes it.

    Attributes:
        kind: A name for the form.

    Example:
        >>> import math, sympy
        >>> import bseries as bs
        >>> class Free:
        ...     kind, radius = "free", math.inf
        ...     def radius_at(self, y):
        ...         return math.inf
        ...     def values(self, y, h):
        ...         return y[:, 0] ** 2 / 2
        ...     def expression(self, h):
        ...         return sympy.Symbol("p") ** 2 / 2
        >>> scene = bs.parse_hamiltonian("p^2/2")
        >>> bs.hamiltonians.ClosedHamiltonian("any method on a free particle", scene, Free())([2.0, 1.0], 0.1)
        2.0
    """

    kind: str

    @property
    def radius(self) -> Radius:
        """The radius of convergence in h, a number, or a formula in the variables."""
        ...

    def radius_at(self, y: Array) -> float:
        """The least radius of convergence at the rows of y."""
        ...

    def values(self, y: Array, h: float) -> Array:
        """The values at the rows of y for a step size within the radius."""
        ...

    def expression(self, h: sympy.Expr) -> sympy.Expr:
        """The formula for a step size."""
        ...


class LinearHamiltonian:
    """Modified Hamiltonian of a symplectic method for H = ½ yᵀSy with the matrix `form`.

    It is yᵀGy with G = T c(K) + U b(K) + X m(K) for K = −A², where T and U are the halves of S that depend on momenta
    and on positions, and the functions of κ are those of `OscillatorStep`; for Runge–Kutta methods G = ½ S c(K).
    """

    kind = "linear"

    def __init__(self, method: Method, scene: Scene, energy: sympy.Expr, parts: Parts | None = None):
        self._scene, self._arguments, size = scene, (method, scene, energy, parts), scene.dimension
        self._constant = energy.subs(dict.fromkeys(scene.symbols, 0))
        form = sympy.hessian(energy, scene.symbols)
        stages = symplectic_stages(method, scene, parts)
        if isinstance(method, RungeKutta):
            self._step = OscillatorStep.of_runge_kutta(method)
            in_x = convergence_radius(method).radius
            self._factors = form / 2, sympy.zeros(size), sympy.zeros(size)
        else:
            kinds = {stage.hamiltonian for stage in stages.stages}
            mixed = any(stage.kicks and stage.drifts for stage in stages.stages)
            if mixed or sympy.expand(sympy.Add(*kinds) - energy).free_symbols:
                raise SeriesError(
                    "method must be a Runge–Kutta method, or kick by U(q) and drift by T(p), for a closed form, but "
                    f"{method.name} on {scene.name} does otherwise"
                )
            self._step = OscillatorStep.of_stages(stages)
            in_x = self._step.radius()
            momenta, positions, products = (sympy.zeros(size) for _ in range(3))
            for p, q in canonical_pairs(scene):
                momenta[p, p], positions[q, q], products[p, q] = 1, 1, sympy.Rational(1, 2)
            self._factors = momenta * form / 2, positions * form / 2, products
        self._square = -(sympy.Matrix(scene.field).jacobian(scene.symbols) ** 2)
        # The minimal polynomial of K must have simple roots.
        characteristic = self._square.charpoly()
        self._polynomial = sympy.Poly(characteristic.as_expr(), characteristic.gen, extension=True).sqf_part()
        value = sympy.zeros(size)
        for coefficient in self._polynomial.all_coeffs():
            value = value * self._square + coefficient * sympy.eye(size)
        if not value.applyfunc(sympy.simplify).is_zero_matrix:
            raise SeriesError(
                f"scene must have a square A² that can be diagonalised, but that of {scene.name} has Jordan blocks"
            )
        largest = max(abs(kappa) for kappa in self._eigensystem[0])
        self.radius = in_x / math.sqrt(largest) if largest else math.inf

    def __reduce__(self) -> tuple[type, tuple[Method, Scene, sympy.Expr, Parts | None]]:
        return LinearHamiltonian, self._arguments

    @cached_property
    def _eigensystem(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Eigenvalues κ and eigenvectors of K, and the inverse of the matrix of eigenvectors."""
        with mpmath.workdps(DIGITS):
            values, vectors = mpmath.eig(mpmath.matrix(self._square.evalf(DIGITS).tolist()))
            found = values, vectors.tolist(), (vectors**-1).tolist()
        values, vectors, inverse = (np.array(rows, complex) for rows in found)
        return values, vectors, inverse

    @cached_method
    def matrix(self, h: float) -> Array:
        """The matrix G of H̃ = yᵀGy."""
        values, vectors, inverse = self._eigensystem
        roots = np.sqrt(values)
        b, c, mixed = np.array([self._step.coefficients(h * root) for root in roots]).T
        functions = zip(self._factors, (c, b, mixed * roots), strict=True)
        summands = (np.array(factor.tolist(), float) @ (vectors * function) @ inverse for factor, function in functions)
        total = np.sum(list(summands), axis=0)
        return total.real

    def values(self, y: Array, h: float) -> Array:
        """Values of H̃ at the rows of y."""
        return ((y @ self.matrix(h)) * y).sum(axis=1) + float(self._constant)

    def radius_at(self, y: Array) -> float:
        """The radius of convergence, the same at all points."""
        return self.radius

    def expression(self, h: sympy.Expr) -> sympy.Expr:
        """The formula of H̃, real up to the first step size at which an eigenvalue of the step is −1."""
        y = sympy.Matrix(self._scene.symbols)
        total = self._constant
        for kappa, projection in self._projections:
            T, U, X = (
                sympy.expand((y.T * (factor * projection).applyfunc(sympy.simplify) * y)[0, 0])
                for factor in self._factors
            )
            b, c, mixed = self._step.formulas(h, kappa)
            total += c * T + b * U + mixed * X
        return total

    @cached_property
    def _projections(self) -> list[tuple[sympy.Expr, Formula]]:
        """The exact eigenvalues κ of K, and the projections on their modes, which are polynomials in K."""
        factors = [factor for factor, _ in self._polynomial.factor_list()[1] if factor.degree() <= 2]
        roots = [root for factor in factors for root in sympy.roots(factor)]
        if len(roots) < self._polynomial.degree():
            raise SeriesError(
                f"scene must have frequencies that are square roots for a formula, but the squares of those of "
                f"{self._scene.name} are roots of {self._polynomial.as_expr()!s:.60}"
            )
        one = sympy.eye(self._scene.dimension)
        return [
            (kappa, math.prod(((self._square - x * one) / (kappa - x) for x in roots if x is not kappa), start=one))
            for kappa in roots
        ]


class ClosedHamiltonian:
    """Modified Hamiltonian in closed form, the sum of its series; `closed_hamiltonian` makes those that are known.

    Args:
        label: The names of the method and the scene.
        scene: The scene.
        form: The closed form, as the protocol `ClosedForm` describes it.

    Attributes:
        kind: The name of the form, such as ``"linear"``.
        radius: The radius of convergence in h, a number, or a formula in the variables.
        variables: The names of the variables.

    Example:
        >>> import bseries as bs
        >>> closed = bs.hamiltonians.closed_hamiltonian("stormer-verlet", "harmonic-oscillator")
        >>> closed.kind, closed.radius
        ('linear', 2.0)
    """

    def __init__(self, label: str, scene: Scene, form: ClosedForm):
        self.label, self.scene, self._form = label, scene, form
        self.kind, self.radius, self.variables = form.kind, form.radius, scene.variables

    def __repr__(self) -> str:
        return f"<modified Hamiltonian of {self.label}: closed form for |h| < {self._shown_radius}>"

    def __str__(self) -> str:
        heading, formula = f"modified Hamiltonian of {self.label}, for |h| < {self._shown_radius}", self._shown_formula
        return heading if formula is None else f"{heading}\n{formula}"

    @property
    def _shown_radius(self) -> str:
        return f"{self.radius:.6g}" if isinstance(self.radius, float) else formula_text(self.radius)

    @property
    def _shown_formula(self) -> str | None:
        """The formula as text; None without one, and where h is a variable of the scene."""
        if "h" in self.variables:
            return None
        try:
            return formula_text(self.expression(sympy.Symbol("h")))
        except SeriesError:
            return None

    def expression(self, h: Step) -> sympy.Expr:
        """The formula for a step size, a number or a symbol.

        For linear systems the branches of roots and arc functions hold up to the first step size at which an eigenvalue
        of the step matrix is −1.

        Raises:
            SeriesError: `h` is neither a number nor an expression, or the frequencies of the linear system are not
                square roots.
        """
        return self._form.expression(read_symbolic_step(h))

    def __call__(self, y: ArrayLike, h: float) -> float | Array:
        """The value at one point or many.

        Args:
            y: The state, of shape (variables,), or (variables, n) for n points.
            h: The step size.

        Returns:
            A float, or an array of n.

        Raises:
            SeriesError: |h| is not less than the radius of convergence, or `y` has the wrong shape.
        """
        states, shape = read_states(y, self.scene.dimension)
        step = read_step(h)
        smallest = self._form.radius_at(states)
        if not abs(step) < smallest:
            raise SeriesError(
                f"h must be less than {smallest:.6g}, the radius of convergence, in absolute value, but was {step}"
            )
        values = self._form.values(states, step)
        return float(values[0]) if len(shape) == 1 else values

    def to_dict(self) -> dict[str, Any]:
        """The closed form as plain data."""
        return {
            "schema": 1,
            "kind": "closed-hamiltonian",
            "label": self.label,
            "closed_form": self.kind,
            "variables": list(self.variables),
            "radius": self._shown_radius,
            "hamiltonian": self._shown_formula,
        }


def closed_hamiltonian(method: Method | str, scene: Scene | str, *, parts: Parts | None = None) -> ClosedHamiltonian:
    """The modified Hamiltonian of a symplectic method as the sum of its series, where a closed form is known.

    For linear systems with H = ½ yᵀSy it is yᵀ J log Φ_h y / (2h) with the step matrix Φ_h. This is R(hA), A = J⁻¹S,
    for Runge–Kutta methods, and the series converges if |hλ| < ρ for all eigenvalues λ of A, with ρ the distance of
    the nearest zero or pole of R from 0. For H = T(p) + U(q) other methods made of kicks and drifts have a form too.
    Forms of other systems are given to `ClosedHamiltonian`.

    Args:
        method: The method, exact.
        scene: The scene.
        parts: As for `modified_field`.

    Raises:
        SeriesError: No closed form is known, or the method is not symplectic.

    Example:
        >>> import bseries as bs
        >>> oscillator = bs.Scene({"p": 1, "q": 1}, hamiltonian="(p^2 + q^2)/2", name="oscillator")
        >>> print(bs.hamiltonians.closed_hamiltonian(bs.method("implicit-midpoint"), oscillator))
        modified Hamiltonian of implicit-midpoint on oscillator, for |h| < 2
        2*(p**2/2 + q**2/2)*atan(h/2)/h

    References:
        E. Hairer, lecture on long-time behaviour, example 3.
    """
    method, scene = as_method(method), as_scene(scene)
    canonical_pairs(scene)
    H, y = scene.hamiltonian, scene.symbols
    if H is not None and (free := sorted(map(str, H.free_symbols - set(y)))):
        raise SeriesError(f"parameters must have values for a closed form, but {', '.join(free)} had none")
    if H is None or not H.is_polynomial(*y) or any(sum(e) not in (0, 2) for e in sympy.Poly(H, *y).monoms()):
        raise SeriesError(f"scene must be linear for a closed form, but was {scene.name}")
    return ClosedHamiltonian(f"{method.name} on {scene.name}", scene, LinearHamiltonian(method, scene, H, parts))
