"""Contractivity for nonlinear problems: algebraic stability and strong stability preservation.

Both are inequalities between entries of the tableau, decided exactly for exact tableaux, and within the error bounds
for decimals and floats.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bseries.analysis.stability.field_elements import (
    Inexact,
    dot,
    from_flint,
    has_sign,
    midpoint,
    nearest_float,
    sign,
    stage_matrix,
    to_elements,
    upper,
)
from bseries.analysis.stability.linear_stability import (
    MethodOrFunction,
    adjugate_terms,
    characteristic,
    checked_method,
    function_of,
)
from bseries.analysis.stability.real_polynomials import Coefficients, first_crossing, reflect, subtract
from integrators.exact.polynomials import derivative, evaluate, trim

if TYPE_CHECKING:
    from integrators.methods.tableaux.runge_kutta import RungeKutta

MOST_EXACT_STAGES = 3
"""With more stages on irrational nodes, the splitting field of the node polynomial is too large."""


def is_algebraically_stable(method: RungeKutta | str) -> bool | None:
    """Whether b_i ≥ 0 and the matrix M with m_ij = b_i a_ij + b_j a_ji − b_i b_j is positive semidefinite.

    Such a method is B-stable: it contracts wherever the flow does. For irreducible methods the converse holds too (for
    DJ-irreducible methods all b_i are then positive). The tableau is not reduced first: for reducible methods the
    condition is sufficient only.

    Args:
        method: a Runge–Kutta method. For methods on the roots of a rational polynomial the quadratic forms are rational
            in the basis 1, x, …; a change of basis keeps their signature.

    Returns:
        The answer; None where it depends on symbols or on roots of too high a degree.

    Raises:
        IntegratorError: `method` is no `RungeKutta`.

    Example:
        >>> from integrators import method
        >>> [is_algebraically_stable(method(name)) for name in ("gauss3", "radau-iia3", "lobatto-iiia3", "trapezoidal")]
        [True, True, False, False]

    References:
        K. Burrage, J. C. Butcher, *Stability criteria for implicit Runge–Kutta methods*, SIAM J. Numer. Anal. 16 (1979)
        46–57;
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.12.
    """
    method = checked_method(method)
    rows, weights, _ = stage_matrix(method)
    if not all(map(has_sign, (*weights, *(a for row in rows for a in row)))):
        # For explicit methods m_ii = −b_i², and some b_i is nonzero.
        return False if method.is_explicit and method.weight_sum == 1 else None
    stages = range(method.stages)
    gram = _gram(method, weights)
    product = [[dot(gram[i], [rows[k][j] for k in stages]) for j in stages] for i in stages]
    gap = [[product[i][j] + product[j][i] - weights[i] * weights[j] for j in stages] for i in stages]
    return _is_semidefinite(gram) and _is_semidefinite(gap)


def _gram(method: RungeKutta, weights: Sequence[Any]) -> list[list[Any]]:
    """Matrix of the form Σ b_i f(c_i) g(c_i): diagonal, or in the basis 1, x, … the moments b(x^(k+l))."""
    size = len(weights)
    if method.algebra is None:
        return [[b if i == j else Fraction(0) for j in range(size)] for i, b in enumerate(weights)]
    moments = method.algebra.moments(2 * size - 1)
    return [list(moments[k : k + size]) for k in range(size)]


def _is_semidefinite(matrix: Sequence[Sequence[Any]]) -> bool:
    """Whether a symmetric matrix has eigenvalues ≥ 0 only: whether all their elementary symmetric functions are ≥ 0.

    The errors of the entries of each row are added to its diagonal entry, which bounds their effect on the eigenvalues
    (Gershgorin).
    """
    rows = [list(map(midpoint, row)) for row in matrix]
    for i, row in enumerate(matrix):
        rows[i][i] = rows[i][i] + sum((from_flint(a.error) for a in row if isinstance(a, Inexact)), Fraction(0))
    return all(sign(a) >= 0 for a in characteristic(rows))


def ssp_coefficient(method: RungeKutta | str) -> Fraction | float | None:
    """SSP coefficient: the largest r such that steps h ≤ r h_E preserve the bounds that Euler steps h ≤ h_E preserve.

    It is Kraaijevanger's radius of absolute monotonicity: with K the matrix A with the row b below it and a column of
    zeros, the largest r with K (I + rK)⁻¹ ≥ 0 and r K (I + rK)⁻¹ 1 ≤ 1. The entries are rational functions of r, and
    the conditions hold on an interval [0, r]: its end is the smallest root at which a numerator changes sign. The
    tableau is not reduced first: equivalent stages may lower the coefficient.

    Args:
        method: a Runge–Kutta method.

    Returns:
        A `Fraction` where the coefficient is recognised as rational (and verified), else the nearest float; 0 if no
        step preserves them, ``inf`` if every step does; None where it depends on symbols or on roots of too high a
        degree.

    Raises:
        IntegratorError: `method` is no `RungeKutta`.

    Example:
        >>> from integrators import method
        >>> names = ("explicit-euler", "ssprk33", "ssprk104", "rk4", "implicit-midpoint", "implicit-euler")
        >>> [str(ssp_coefficient(method(name))) for name in names]
        ['1', '1', '6', '0', '2', 'inf']

    References:
        J. F. B. M. Kraaijevanger, BIT 31 (1991) 482–528, doi:10.1007/BF01933264;
        S. Gottlieb, D. Ketcheson, C.-W. Shu, *Strong Stability Preserving Runge–Kutta and Multistep Time
        Discretizations* (2011), chapter 3, doi:10.1142/7498.
    """
    method = checked_method(method)
    if method.algebra is not None and not method.algebra.has_rational_nodes:
        rows, weights, _ = method.algebra.tableau_float()  # within 10^-40
        if any(value < -1e-30 for row in (*rows, weights) for value in row):
            return Fraction(0)
        if method.stages > MOST_EXACT_STAGES:
            return None
    size = method.stages
    elements = to_elements([v for row in (*method.A, method.b) for v in row], method.precision)
    if not all(map(has_sign, elements)):
        return None
    if any(sign(upper(a)) < 0 for a in elements):
        return Fraction(0)
    exact = method.domain in ("QQ", "algebraic")
    return _first(_numerators([elements[k : k + size] for k in range(0, len(elements), size)]), exact=exact)


def _numerators(rows: Sequence[Sequence[Any]]) -> Iterator[Coefficients]:
    """Polynomials in r that must be nonnegative: det(I + rA), and the numerators of the conditions over it.

    With C the adjugate of I + rA the numerators are the entries of A C, b C and C 1, and det(I + rA) − r b C 1.
    """
    determinant, adjugate = zip(*adjugate_terms(rows[:-1]), strict=True)
    columns = [list(zip(*c, strict=True)) for c in adjugate]
    products = [[[dot(row, column) for column in c] for c in columns] for row in rows]
    row_sums = [[sum(row, Fraction(0)) for row in c] for c in adjugate]
    for coefficients in (*products, row_sums):
        yield from map(trim, zip(*coefficients, strict=True))
    yield trim(determinant)
    sums = [sum(values, Fraction(0)) for values in products[-1]]
    yield subtract(determinant, [Fraction(0), *sums[:-1]])


def _first(conditions: Iterable[Coefficients], *, exact: bool) -> Fraction | float:
    """The smallest r > 0 at which one of the polynomials becomes negative, ``inf`` if there is none."""
    found = {tuple(map(upper, p)) for p in conditions}
    least = min(map(first_crossing, found), default=math.inf)
    # The smallest float may be that of an irrational root next to a rational one of another condition.
    if exact and isinstance(least, Fraction) and all(sign(evaluate(p, least)) >= 0 for p in found):
        return least
    return nearest_float(least) if isinstance(least, Fraction) else least


def linear_ssp_coefficient(method: MethodOrFunction) -> Fraction | float | None:
    """Threshold factor: the SSP coefficient for linear problems with constant coefficients.

    It is the radius of absolute monotonicity of the stability function, the largest r with R^(k)(x) ≥ 0 for all k and
    −r ≤ x ≤ 0. For polynomials the condition at x = −r is sufficient.

    Args:
        method: an explicit Runge–Kutta method or its stability function.

    Returns:
        As `ssp_coefficient`; None also where R is no polynomial, since it then has infinitely many derivatives.

    Example:
        >>> from integrators import method
        >>> [str(linear_ssp_coefficient(method(name))) for name in ("rk4", "ssprk33", "ssprk104")]
        ['1', '1', '6']

    References:
        M. N. Spijker, *Contractivity in the numerical solution of initial value problems*, Numer. Math. 42 (1983)
        271–290;
        J. F. B. M. Kraaijevanger, *Absolute monotonicity of polynomials occurring in the numerical solution of initial
        value problems*, Numer. Math. 48 (1986) 303–322.
    """
    R = function_of(method)
    if len(R.q) > 1 or not R.has_signs:
        return None
    derivatives = [R.p]
    while derivatives[-1]:
        derivatives.append(derivative(derivatives[-1]))
    return _first(map(reflect, derivatives), exact=not R.is_inexact)
