"""Generating functions of symplectic methods, and the modified Hamiltonians that follow from them.

A symplectic map (p, q) ↦ (P, Q) near the identity is p = P + S_q(P, q), Q = q + S_P(P, q). For Runge–Kutta methods, and
all others made of evaluations of the field, S is a formula in H at the stages (theorem 5 of the lecture); so the
modified Hamiltonian is defined wherever H is.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.fields.differentials import refusing_large
from bseries.fields.inputs import read_symbolic_step
from bseries.fields.symbolic.differential_rings import MOST_MONOMIALS, DifferentialRing
from bseries.hamiltonians.hamilton_jacobi import HamiltonJacobi, generating_hamiltonian, paired, power_series
from bseries.hamiltonians.ring_power_series import Composition, PowerSeries, SeriesArithmetic
from bseries.hamiltonians.symplectic_stages import (
    Stages,
    canonical_pairs,
    entry,
    hamiltonian_constant,
    symplectic_stages,
)
from integrators.core.immutable import cached_method
from integrators.exact.entries import sum_entries
from trees.counting import check_order

if TYPE_CHECKING:
    import sympy

    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene


class GeneratingFunction(NamedTuple):
    """A generating function S(P, q, h) = h S_1 + h² S_2 + …, of the map p = P + S_q, Q = q + S_P.

    Attributes:
        label: What it generates.
        momenta: The symbols of P.
        positions: The symbols of q.
        terms: S_1, S_2, …

    Example:
        >>> import bseries as bs
        >>> print(generating_function(bs.method("stormer-verlet"), bs.scene("pendulum"), 3))
        generating function of stormer-verlet-kdk on pendulum
        h^1   p**2/2 - cos(q)
        h^2   p*sin(q)/2
        h^3   p**2*cos(q)/4 + sin(q)**2/8
    """

    label: str
    momenta: tuple[sympy.Symbol, ...]
    positions: tuple[sympy.Symbol, ...]
    terms: tuple[sympy.Expr, ...]

    def expression(self, h: Any) -> sympy.Expr:
        """The truncated function for a step size, a number or a symbol."""
        import sympy

        step = read_symbolic_step(h)
        return sympy.Add(*(term * step**n for n, term in enumerate(self.terms, 1)))

    def hamiltonian(self) -> tuple[sympy.Expr, ...]:
        """The terms of the modified Hamiltonian, H_1 + h H_2 + …"""
        import sympy

        h = sympy.Dummy("h")
        return generating_hamiltonian(self.expression(h), self.momenta, self.positions, len(self.terms), h=h)

    def __str__(self) -> str:
        rows = (f"h^{n:<3} {term}" for n, term in enumerate(self.terms, 1))
        return "\n".join([f"generating function of {self.label}", *rows])

    def to_dict(self) -> dict[str, Any]:
        """The function as plain data."""
        return {
            "schema": 1,
            "kind": "generating-function",
            "label": self.label,
            "momenta": [str(symbol) for symbol in self.momenta],
            "positions": [str(symbol) for symbol in self.positions],
            "terms": [{"power": n, "generating_function": str(term)} for n, term in enumerate(self.terms, 1)],
        }


def generating_function(method: Method, scene: Scene, order: int, *, parts: Any = None) -> GeneratingFunction:
    """The generating function of a symplectic method on a canonical Hamiltonian scene.

    For methods made of evaluations of the field at stages, with b_i â_ij + b̂_j a_ji = b_i b̂_j,

        S(P, q, h) = h Σ b_i H(P_i, Q_i) − h² Σ b_i â_ij H_q(P_i, Q_i)ᵀ H_p(P_j, Q_j),

    expanded in powers of h. Splittings are among them if their parts are functions of p or of q only.

    Args:
        method: The method, exact: a tableau, a splitting, or anything with a program of evaluations of the field.
        scene: The scene.
        order: The number N of terms.
        parts: As for `modified_field`.

    Returns:
        S_1, …, S_N, in the variables of the scene (p stands for P).

    Raises:
        SeriesError: The scene is not canonical, or the method not symplectic or of another kind; the message says why.

    Example:
        >>> import bseries as bs
        >>> S = generating_function(bs.method("implicit-midpoint"), bs.scene("pendulum"), 3)
        >>> S.terms
        (p**2/2 - cos(q), p*sin(q)/2, p**2*cos(q)/8 + sin(q)**2/8)
        >>> S.hamiltonian()[2]
        -p**2*cos(q)/24 - sin(q)**2/24
        >>> generating_function(bs.method("rk4"), bs.scene("pendulum"), 2)
        Traceback (most recent call last):
        bseries.exceptions.SeriesError: method must be symplectic, but rk4 is not: ...

    References:
        E. Hairer, lecture on long-time behaviour, theorem 5; HLW, theorem VI.5.4 and section IX.3.2.
        F. M. Lasagni, unpublished (1988).
    """
    with refusing_large(MOST_MONOMIALS):
        arithmetic, generating = _expanded(method, scene, order, parts)
        terms = _with_constant(arithmetic.written(generating), scene)
    momenta, positions = (
        tuple(scene.symbols[i] for i in places) for places in zip(*canonical_pairs(scene), strict=True)
    )
    return GeneratingFunction(f"{method.name} on {scene.name}", momenta, positions, terms)


def generating_terms(method: Method, scene: Scene, order: int, parts: Any = None) -> tuple[sympy.Expr, ...]:
    """The modified Hamiltonian of a symplectic method, by the Hamilton–Jacobi recursion from its generating function.

    Args:
        method: As for `generating_function`.
        scene: The scene.
        order: The number N of terms.
        parts: As for `modified_field`.

    Returns:
        The terms with h^0, …, h^(N−1).

    Raises:
        SeriesError: As for `generating_function`.

    Example:
        >>> import bseries as bs
        >>> generating_terms(bs.method("symplectic-euler-p"), bs.scene("pendulum"), 3)
        (p**2/2 - cos(q), -p*sin(q)/2, p**2*cos(q)/12 + sin(q)**2/12)

    References:
        E. Hairer, lecture on long-time behaviour, theorem 4 and (24); HLW, theorem IX.3.2.
    """
    with refusing_large(MOST_MONOMIALS):
        arithmetic, generating = _expanded(method, scene, order, parts)
        recursion = HamiltonJacobi(arithmetic.coefficients, canonical_pairs(scene))
        return _with_constant(arithmetic.written(recursion.hamiltonian(generating)), scene)


def exact_generating_function(
    H: sympy.Expr,
    momenta: Sequence[sympy.Symbol],
    positions: Sequence[sympy.Symbol],
    order: int,
    *,
    h: sympy.Symbol | None = None,
) -> GeneratingFunction:
    """The generating function of the exact flow of a Hamiltonian over time h, by the Hamilton–Jacobi equation.

    Args:
        H: The Hamiltonian: a formula in p and q, and in h where it is a modified one.
        momenta: The symbols of p; in the result they stand for P.
        positions: The symbols of q.
        order: The number of terms.
        h: The symbol of the step size; by default ``Symbol("h")``.

    Raises:
        SeriesError: The symbols do not fit, or H is no power series in h.

    Example:
        >>> import sympy
        >>> p, q = sympy.symbols("p q")
        >>> exact_generating_function((p**2 + q**2) / 2, [p], [q], 3).terms
        (p**2/2 + q**2/2, p*q/2, p**2/6 + q**2/6)

    References:
        HLW, theorem VI.5.6.
    """
    with refusing_large(MOST_MONOMIALS):
        arithmetic, series = power_series(H, "H", momenta, positions, order, h)
        recursion = HamiltonJacobi(arithmetic.coefficients, paired(len(momenta)))
        terms = arithmetic.written(recursion.generating(series[k] for k in range(order)))
    return GeneratingFunction("an exact flow", tuple(momenta), tuple(positions), terms)


def _with_constant(terms: tuple[sympy.Expr, ...], scene: Scene) -> tuple[sympy.Expr, ...]:
    """The terms with the constant of H, which no stage has, in the first."""
    return terms[0] + hamiltonian_constant(scene), *terms[1:]


def _expanded(method: Method, scene: Scene, order: int, parts: Any) -> tuple[SeriesArithmetic, list[Any]]:
    """S_1, …, S_N of a method."""
    check_order(order)
    expansion = _StageSeries(symplectic_stages(method, scene, parts), scene)
    S = expansion.generating()
    return expansion.arithmetic, [S[n] for n in range(1, order + 1)]


class _StageSeries:
    """The stages of a method in powers of h, as functions of P and q: P_i = P + h Σ (b_j − a_ij) H_q(P_j, Q_j)."""

    def __init__(self, stages: Stages, scene: Scene):
        self._stages = stages.stages
        self._pairs = canonical_pairs(scene)
        end = stages.end
        kicks = [(k, x.forces, entry(end, x.forces)) for k, x in enumerate(self._stages) if x.kicks]
        drifts = [(k, x.velocities) for k, x in enumerate(self._stages) if x.drifts]
        self._b = {k: b for k, _, b in kicks}
        self._weights = [stages.weight(stage) for stage in self._stages]
        points = dict.fromkeys(stage.at for stage in self._stages)
        self._momentum_rows = {at: [(sum_entries((b, -entry(at, f))), k) for k, f, b in kicks] for at in points}
        self._position_rows = {at: [(entry(at, v), k) for k, v in drifts] for at in points}
        rows = [*self._momentum_rows.values(), *self._position_rows.values()]
        numbers = {*self._weights, *self._b.values(), *(x for row in rows for x, _ in row)}
        irrational = [x for x in numbers if not isinstance(x, Fraction)]
        formulas = [stage.hamiltonian for stage in self._stages]
        self._ring = DifferentialRing.of([*formulas, *irrational, *scene.symbols], scene.symbols)
        self._elements = self._ring.elements
        self.arithmetic = SeriesArithmetic(self._ring)
        self._numbers = {x: self.arithmetic.read(x) for x in irrational}

    def generating(self) -> PowerSeries:
        """S; of h² Σ b_i â_ij H_q(P_i, Q_i)ᵀ H_p(P_j, Q_j), the sum h Σ_j is Q_i − q."""
        arithmetic = self.arithmetic
        parts = [
            (self._number(weight), self._at(stage.at)(element))
            for weight, stage, element in zip(self._weights, self._stages, self._elements, strict=False)
        ]
        for k, b in self._b.items():
            point = self._point(self._stages[k].at)
            for _, q in self._pairs:
                way_back = arithmetic.dot([(-1, PowerSeries(lambda n, Q=point[q]: Q[n] if n else arithmetic.zero))])
                parts.append((self._number(b), arithmetic.product(self._slope(k, q), way_back)))
        return arithmetic.times_h(arithmetic.dot(parts))

    def _number(self, x: Any) -> Any:
        return self._numbers.get(x, x)

    @cached_method
    def _at(self, at: LinearForm) -> Composition:
        """Formulas at a point."""
        return Composition(self.arithmetic, self._ring, self._point(at))

    @cached_method
    def _point(self, at: LinearForm) -> list[PowerSeries]:
        """A point: a series for every variable."""
        found: dict[int, PowerSeries] = {}
        for p, q in self._pairs:
            found[p] = self._moved(p, q, self._momentum_rows[at])
            found[q] = self._moved(q, p, self._position_rows[at])
        return [found[i] for i in sorted(found)]

    def _moved(self, place: int, other: int, row: list[tuple[Any, int]]) -> PowerSeries:
        """A variable, changed by h times derivatives of H with respect to the conjugate one at all stages."""
        start = self.arithmetic.read(self._ring.variables[place])
        multiples = [(self._number(x), k) for x, k in row if x != 0]

        def coefficient(n: int) -> Any:
            if n == 0:
                return start
            return self.arithmetic.combine((x, self._slope(k, other)[n - 1]) for x, k in multiples)

        return PowerSeries(coefficient)

    @cached_method
    def _slope(self, k: int, place: int) -> PowerSeries:
        """The derivative of H^k with respect to a variable, at the point of stage k."""
        return self._at(self._stages[k].at)(self._ring.derivative(self._elements[k], place))
