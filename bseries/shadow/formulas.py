"""Exact formulas for shadow energies of the Störmer–Verlet method, in the potentials and forces of a few steps.

Steps are kick–drift–kick with H = pᵀM⁻¹p/2 + U(q), g = ∇U(q), D = h d/dt along the modified flow that interpolates
them. Skeel and Hardy add the variables α = 1 and β, so that H = pᵀM⁻¹p/2 + α²U(q/α) is homogeneous of degree 2; hence
so are its brackets and the modified Hamiltonian H̃, and β' = pᵀq' − qᵀp' − 2H̃. The steps give
    h p = M sinh(D) q,    h² g = −M (2 cosh D − 2) q,    h (qᵀg − 2U) = 2 tanh(D/2) β,

and so express p, g and U by q alone and the constant H̃. A bilinear form in q is a function of u and v, which represent
D on the left and on the right factor; with S = (u + v)/2, δ = (v − u)/2 and in units of M/h² these are

    pᵀp: sinh²S − sinh²δ,    gᵀg: 4 (cosh S − cosh δ)²,    U: H̃ + 1 − cosh S cosh δ + (δ/S) sinh S sinh δ.

A combination of pᵀM⁻¹p/2 with such terms at shifted steps is H̃ up to O(h^order) if its function of u and v vanishes
through the degree `order`. Potentials and forces at one step on each side suffice for order 6, two for order 10, six
for order 24. Positions and their rounding errors do not enter. All weights of potentials are positive.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple, TypeAlias

from bseries.exceptions import SeriesError
from integrators.exact.polynomials import from_flint, to_flint_matrix

LEAST_ORDER, MOST_ORDER = 2, 24

Wave: TypeAlias = tuple[int, int]
"""The function cosh(aS) cosh(bδ), as (a, b)."""
Waves: TypeAlias = list[tuple[Wave, int]]
"""A sum of waves, each with its coefficient."""


class ShadowFormula(NamedTuple):
    """The shadow energy of one order at step 0; made by `shadow_formula`.

    H̃ = p₀ᵀM⁻¹p₀/2 + Σ w_i U_i + h p₀ᵀM⁻¹ Σ_{i>0} a_i (g_i − g_−i) + h² Σ b_ij g_iᵀM⁻¹g_j.

    Attributes:
        order: Its error is O(h^order).
        potentials: The weights w_i = w_−i of potentials, from i = 0 on.
        works: The factors a_i, from i = 1 on.
        products: The factors b_ij by (i, j), i ≤ j; each product is counted once.

    Example:
        >>> import bseries as bs
        >>> bs.shadow.shadow_formula(10)
        <ShadowFormula of order 10: 5 steps>
    """

    order: int
    potentials: tuple[Fraction, ...]
    works: tuple[Fraction, ...]
    products: dict[tuple[int, int], Fraction]

    def __repr__(self) -> str:
        return f"<ShadowFormula of order {self.order}: {2 * self.reach + 1} steps>"

    @property
    def reach(self) -> int:
        """The number of steps needed before and after."""
        return len(self.potentials) - 1


@lru_cache(maxsize=16)
def shadow_formula(order: int) -> ShadowFormula:
    """The shadow energy of an order.

    Args:
        order: An even number from 2, the energy itself, to 24.

    Raises:
        SeriesError: The order is not of this kind.

    Example:
        >>> import bseries as bs
        >>> formula = bs.shadow.shadow_formula(4)
        >>> print(*formula.potentials, formula.products)
        5/6 1/12 {(0, 0): Fraction(1, 24)}

    References:
        Skeel, Hardy, SIAM J. Sci. Comput. 23 (2001) 1172, doi:10.1137/S106482750138318X (the homogeneous extension);
        Engle, Skeel, Drees, J. Comput. Phys. 206 (2005) 432, doi:10.1016/j.jcp.2004.12.009.
    """
    check_order(order)
    if order == LEAST_ORDER:
        return ShadowFormula(order, (Fraction(1),), (), {})
    half = order // 2
    reach, is_odd = divmod(half, 2)
    inner = reach if is_odd else reach - 1  # for even `half` forces are needed at fewer steps than potentials
    centres = [(c, lag) for c in range(2 * inner + 1) for lag in range(c % 2, 2 * inner + 1 - c, 2)]
    if is_odd:
        centres.remove((0, 2 * inner))  # one solution has no product of the first and the last force
    columns = [_potential(i, half) for i in range(reach + 1)]
    columns += [_moments(_work(i), half) for i in range(1, inner + 1)]
    columns += [_moments(_product(c, lag), half) for c, lag in centres]
    kinetic = _moments([((2, 0), 1), ((0, 2), -1)], half)
    rows = [[*(4 * column[k] for column in columns), -kinetic[k]] for k in range(len(kinetic))]
    rows.append([*map(Fraction, [1] * (reach + 1) + [0] * (len(columns) - reach - 1)), Fraction(1)])
    solution = _solution(rows)
    weights, works, rest = solution[: reach + 1], solution[reach + 1 : reach + 1 + inner], solution[reach + 1 + inner :]
    products: dict[tuple[int, int], Fraction] = {}
    for (c, lag), value in zip(centres, rest, strict=True):
        for centre in {c, -c}:
            products[(centre - lag) // 2, (centre + lag) // 2] = value if c == 0 else value / 2
    potentials = tuple(value if i == 0 else value / 2 for i, value in enumerate(weights))
    return ShadowFormula(order, potentials, tuple(works), products)


def check_order(order: int) -> None:
    """Check the order of a shadow energy."""
    if not isinstance(order, int) or order % 2 or not LEAST_ORDER <= order <= MOST_ORDER:
        raise SeriesError(f"order must be an even number from {LEAST_ORDER} to {MOST_ORDER}, but was {order!r:.60}")


def _powers(half: int) -> list[tuple[int, int]]:
    """The exponents (2i, 2j) of S and δ below the order of the error."""
    return [(2 * i, 2 * j) for i in range(half + 1) for j in range(half + 1 - i)]


def _moments(waves: Waves, half: int) -> list[Fraction]:
    """The coefficients of S^i δ^j / (i! j!)."""
    return [Fraction(sum(x * a**i * b**j for (a, b), x in waves)) for i, j in _powers(half)]


def _potential(shift: int, half: int) -> list[Fraction]:
    """(U_shift + U_−shift)/2 − H̃: cosh(2 shift S) times the function for U."""
    waves = [((2 * shift, 0), 2), ((2 * shift + 1, 1), -1), ((2 * shift - 1, 1), -1)]
    plain, two = _moments(waves, half), 2 * shift
    # cosh(two S) sinh(S)/S = (sinh((two + 1) S) − sinh((two − 1) S)) / (2 S)
    rest = [Fraction(((two + 1) ** (i + 1) - (two - 1) ** (i + 1)) * j, 2 * (i + 1)) for i, j in _powers(half)]
    return [x / 2 + y for x, y in zip(plain, rest, strict=True)]


def _work(shift: int) -> Waves:
    """h pᵀ(g_shift − g_−shift), symmetrised in u and v."""
    waves: Waves = []
    for n, factor in ((shift + 1, -1), (shift - 1, -1), (shift, 2)):  # 2 sinh(u) sinh(nv) is, symmetrised:
        waves += [((n + 1, n - 1), factor), ((n - 1, n + 1), -factor)]
    return waves


def _product(centre: int, lag: int) -> Waves:
    """h² g_iᵀg_j, i + j = centre and j − i = lag, and its images: 4 (cosh S − cosh δ)² cosh(centre S) cosh(lag δ)."""
    waves: Waves = [((centre, lag), 4)]
    for x in (-1, 1):
        waves += [((centre + 2 * x, lag), 1), ((centre, lag + 2 * x), 1)]
        waves += [((centre + x, lag + y), -2) for y in (-1, 1)]
    return waves


def _solution(rows: list[list[Fraction]]) -> list[Fraction]:
    """The unique solution of a linear system, whose right-hand side is the last column."""
    unknowns = len(rows[0]) - 1
    reduced, rank = to_flint_matrix(rows).rref()
    if rank != unknowns or any(reduced[k, k] != 1 for k in range(unknowns)):
        raise ArithmeticError("the linear system of a shadow energy must have one solution")
    return [from_flint(reduced[k, unknowns]) for k in range(unknowns)]
