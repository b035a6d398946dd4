"""Generating functions of variational integrators, from discrete Lagrangians."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy

from bseries.exceptions import SeriesError
from bseries.fields.elementary_differentials import refusing_large
from bseries.fields.symbolic.differential_rings import MOST_MONOMIALS
from bseries.fields.symbolic.polynomials import Element
from bseries.fields.symbolic.power_series import Composition, Expansion, PowerSeries
from bseries.hamiltonians.generating_functions import GeneratingFunction, check_formula, check_symbols
from trees.counting import check_order


def variational_generating_function(
    lagrangian: sympy.Expr,
    start: Sequence[sympy.Symbol],
    end: Sequence[sympy.Symbol],
    momenta: Sequence[sympy.Symbol],
    order: int,
    *,
    h: sympy.Symbol | None = None,
    velocity: Sequence[sympy.Expr] | None = None,
) -> GeneratingFunction:
    """The generating function of the variational integrator p = −∂L_h/∂q, P = ∂L_h/∂Q with a discrete Lagrangian L_h.

    L_h(q, Q) generates the map in the variables q and Q. With Q = q + h v and ℓ(q, v, h) = L_h(q, q + h v)/h,

        S(P, q, h) = h (Pᵀv − ℓ(q, v, h))   at the v for which P = ∂ℓ/∂v,

    a Legendre transformation in powers of h.

    Args:
        lagrangian: L_h, an approximation of the action ∫ L(q, q̇) dt over a step from q to Q.
        start: The symbols of q.
        end: The symbols of Q.
        momenta: The symbols for P.
        order: The number of terms S_1, S_2, …
        h: The symbol of the step size; by default ``Symbol("h")``.
        velocity: q̇ as formulas in P and q, from P = ∂L/∂q̇; needed where L is not quadratic in q̇.

    Returns:
        The generating function; its `hamiltonian` gives the modified Hamiltonian.

    Raises:
        SeriesError: The symbols do not fit, ℓ is not a power series in h, or `velocity` does not solve ∂L/∂q̇ = P.

    Example:
        The trapezoidal rule for the action gives the Störmer–Verlet method, kick–drift–kick:

        >>> import sympy
        >>> q, Q, p, h = sympy.symbols("q Q p h")
        >>> L = ((Q - q) / h) ** 2 * h / 2 + h * (sympy.cos(q) + sympy.cos(Q)) / 2
        >>> variational_generating_function(L, [q], [Q], [p], 3).hamiltonian()
        (p**2/2 - cos(q), 0, p**2*cos(q)/12 - sin(q)**2/24)

    References:
        HLW, sections VI.5.3 and VI.6.2; J. E. Marsden, M. West, Acta Numerica 10 (2001) 357–514,
        doi:10.1017/S096249290100006X.
    """
    check_order(order)
    step = sympy.Symbol("h") if h is None else h
    check_symbols(start, end, *momenta, step)
    check_symbols(momenta, start)
    check_formula(lagrangian, "lagrangian")
    if velocity is not None:
        if not isinstance(velocity, Sequence) or len(velocity) != len(start):
            raise SeriesError(f"velocity must be a list of {len(start)} formulas, but was {velocity!r:.60}")
        for x in velocity:
            check_formula(x, "velocity")
    with refusing_large(MOST_MONOMIALS):
        terms = _Legendre(lagrangian, start, end, step).terms(momenta, velocity, order)
    return GeneratingFunction("a variational integrator", tuple(momenta), tuple(start), terms)


class _Legendre:
    """Legendre transformation Pᵀv − ℓ(q, v, h) in powers of h."""

    def __init__(self, lagrangian: Any, start: Sequence[Any], end: Sequence[Any], h: sympy.Symbol):
        self._q = tuple(start)
        self._v = tuple(sympy.Dummy(f"v{i}") for i in range(1, len(start) + 1))
        self._h = h
        moved = {Q: q + h * x for Q, q, x in zip(end, start, self._v, strict=True)}
        self._mean = lagrangian.xreplace(moved) / h
        try:
            expansion = self._expansion(self._v, (*self._q, *self._v))
            point = _point(expansion, self._q, [[expansion.ring.element(x)] for x in self._v])
            at_zero = point(expansion.elements[0])[0]
        except SeriesError as error:
            raise SeriesError(f"lagrangian must be {h} times a power series for Q = q + {h} v, but {error}") from None
        self._L: Any = expansion.ring.to_expression(at_zero)

    def terms(self, momenta: Sequence[Any], velocity: Any, order: int) -> tuple[sympy.Expr, ...]:
        """The terms S_1, S_2, …; since S is stationary in v, v to h^m gives S to h^(2m+2)."""
        mass: Any = sympy.hessian(self._L, self._v)
        if mass.det().equals(0):
            raise SeriesError("lagrangian must have an invertible matrix ∂²L/∂v², but its determinant is 0")
        start = self._solved(mass, momenta) if velocity is None else tuple(velocity)
        inverse = mass.inv().xreplace(dict(zip(self._v, start, strict=True)))
        expansion = self._expansion(start, (*momenta, *self._q), *inverse)
        ring, (ell,) = expansion.ring, expansion.elements
        P = [ring.element(x) for x in momenta]
        rows = [[ring.element(x) for x in row] for row in inverse.tolist()]
        gradient = [expansion.formulas.derivative(ell, len(self._q) + i) for i in range(len(self._v))]
        v = [[ring.element(x)] for x in start]
        point = _point(expansion, self._q, v)
        if not all(ring.is_zero(point(D)[0] - x) for D, x in zip(gradient, P, strict=True)):
            raise SeriesError(f"velocity must solve P = ∂L/∂v, but {start!s:.60} does not")
        for m in range(1, (order + 1) // 2):
            gap = [point(D)[m] for D in gradient]
            for x, row in zip(v, rows, strict=True):
                x.append(-ring.dot(zip(row, gap, strict=True)))
            point = _point(expansion, self._q, v)
        total = point(ell)
        work = [ring.dot((y, x[n]) for y, x in zip(P, v, strict=True) if n < len(x)) for n in range(order)]
        return tuple(ring.to_expression(work[n] - total[n]) for n in range(order))

    def _expansion(self, velocity: Sequence[Any], variables: Sequence[Any], *others: Any) -> Expansion:
        """ℓ as a power series, for a velocity at h = 0."""
        start = {**{q: q for q in self._q}, **dict(zip(self._v, velocity, strict=True)), self._h: sympy.Integer(0)}
        return Expansion([self._mean], start, variables, [*velocity, *others])

    def _solved(self, mass: Any, momenta: Sequence[Any]) -> tuple[Any, ...]:
        """The velocities as functions of momenta and positions, from P = ∂L/∂v linear in v."""
        if mass.free_symbols & set(self._v):
            raise SeriesError("velocity must be given where L is not quadratic in velocities, but was None")
        at_rest = [self._L.diff(x).xreplace({x: sympy.Integer(0) for x in self._v}) for x in self._v]
        return tuple(mass.inv() * (sympy.Matrix(momenta) - sympy.Matrix(at_rest)))


def _point(expansion: Expansion, q: Sequence[Any], v: Sequence[Sequence[Element]]) -> Composition:
    """The composition with q, v = v_0 + h v_1 + … and h."""
    ring = expansion.ring
    positions = [PowerSeries.polynomial(ring.element(x)) for x in q]
    velocities = [PowerSeries.polynomial(*x) for x in v]
    return expansion.at([*positions, *velocities, PowerSeries.polynomial(ring.zero, ring.coerce(1))])
