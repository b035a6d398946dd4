"""Criteria of stability: linear stability from the stability function, contractivity from the tableau.

All answers are exact for exact methods, since signs of polynomials are decided by their isolated roots. For decimals
and floats, quantities that are zero within their digits count as zero. Answers are None if they depend on symbols, or
on roots of too high a degree. The argument `method` is a Runge–Kutta method or its name; most functions also accept its
stability function R = P/Q. Other methods are refused by an `IntegratorError`.

References:
    Hairer, Wanner, *Solving Ordinary Differential Equations II*, chapter IV.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import count, islice, zip_longest
from typing import Any

from bseries.analysis.stability import field_elements as field
from bseries.analysis.stability.field_elements import Coefficients, Element, Inexact, Rows, Vector
from bseries.analysis.stability.rational_functions import StabilityFunction
from bseries_base.errors import shorten
from integrators.core.errors import IntegratorError
from integrators.exact.entries import Entry
from integrators.exact.polynomials import ONE, add, derivative, evaluate, from_flint, multiply, to_flint_matrix, trim
from integrators.methods.catalogue.registry import as_method
from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
from integrators.methods.tableaux.runge_kutta import RungeKutta

MethodOrFunction = RungeKutta | StabilityFunction | str

MOST_INEXACT_STAGES = 10
"""The last coefficients of R decrease like 1/(2s)!, and doubles have sixteen digits."""

MOST_EXACT_STAGES = 3
"""With more stages on irrational nodes, the splitting field of the node polynomial is too large."""
ANGLE_STEPS = 30
"""Bisections of the tangent of half the stability angle: 10^-7 degrees."""


def stability_function(method: RungeKutta | str) -> StabilityFunction:
    """Stability function R(z) = 1 + z b (I − zA)⁻¹ 1 in lowest terms: y₁ = R(hλ) y₀ for y' = λy.

    It is exact if the tableau is; its `digits` are those of a tableau published as decimals. For Gauss, Radau and
    Lobatto methods of the catalogue no root is computed.

    Raises:
        IntegratorError: `method` is implicit with too many stages for floats or decimals.

    Example:
        >>> import bseries as bs
        >>> print(bs.stability_function("rk4"))
        1 + z + z^2/2 + z^3/6 + z^4/24
        >>> print(bs.stability_function("radau-iia2"))
        (1 + z/3)/(1 - 2*z/3 + z^2/6)
    """
    method = checked_method(method)
    rows, weights, vector = _needed_stages(*field.stage_matrix(method))
    explicit = not any(any(row[i:]) for i, row in enumerate(rows))
    if method.precision and not explicit and method.stages > MOST_INEXACT_STAGES:
        raise IntegratorError(
            f"method must have at most {MOST_INEXACT_STAGES} stages if implicit and not exact, but had "
            f"{method.stages}: its entries do not show the last coefficients of the stability function"
        )
    q = ONE if explicit else field.reflect(characteristic(rows))
    moments = []
    for _ in rows:
        moments.append(field.dot(weights, vector))
        vector = [field.dot(row, vector) for row in rows]
    # P = Q (1 + Σ b A^k 1 z^(k+1)): terms beyond degree s cancel by the Cayley–Hamilton theorem.
    p = multiply(q, (Fraction(1), *moments))[: len(rows) + 1]
    return StabilityFunction.from_elements(p, q, floating=method.domain == "float", digits=method.digits)


def _needed_stages(
    rows: Sequence[Coefficients], weights: Coefficients, vector: Coefficients
) -> tuple[Rows, Vector, Vector]:
    """The stages on which the result depends; others add common factors to P and Q, which floats cannot cancel."""
    found = [i for i, weight in enumerate(weights) if weight]
    for i in found:  # the list grows during the loop
        found.extend(j for j, entry in enumerate(rows[i]) if entry and j not in found)
    kept = sorted(found)
    return [[rows[i][j] for j in kept] for i in kept], [weights[i] for i in kept], [vector[i] for i in kept]


def checked_method(method: object) -> RungeKutta:
    """The method, if it is given by one tableau, or by the name of one."""
    method = as_method(method)
    if not isinstance(method, RungeKutta):
        why = ": a partitioned method needs y' = λy split first" if isinstance(method, PartitionedRungeKutta) else ""
        raise IntegratorError(f"method must be a RungeKutta, but was {shorten(repr(method))}{why}")
    return method


def function_of(method: MethodOrFunction) -> StabilityFunction:
    """Stability function of a method; a stability function is returned unchanged."""
    return method if isinstance(method, StabilityFunction) else stability_function(method)


def squared_gap(R: StabilityFunction) -> Coefficients:
    """Coefficients of E(y) = |Q(iy)|² − |P(iy)|² in powers of y²: Q(z) Q(−z) − P(z) P(−z) in powers of −z²."""
    below, above = (multiply(values, field.reflect(values)) for values in (R.q, R.p))
    return field.reflect(field.subtract(below, above)[::2])


def e_polynomial(method: MethodOrFunction) -> tuple[Entry, ...]:
    """E-polynomial |Q(iy)|² − |P(iy)|² of the stability function P/Q with Q(0) = 1.

    It is nonnegative if and only if |R(iy)| ≤ 1 for all real y.

    Returns:
        The coefficients of 1, y, y², …, which may have symbols; () if |R(iy)| = 1 for all y.

    Example:
        >>> import bseries as bs
        >>> [str(e) for e in bs.stability.e_polynomial("rk4")]
        ['0', '0', '0', '0', '0', '0', '1/72', '0', '-1/576']
    """
    R = function_of(method)
    even = trim(squared_gap(R))
    return tuple(field.from_element(e, floating=R.floating) for a in even for e in (a, Fraction(0)))[:-1]


def is_i_stable(method: MethodOrFunction) -> bool | None:
    """Whether |R(iy)| ≤ 1 for all real y; None if undecided.

    Example:
        >>> import bseries as bs
        >>> bs.stability.is_i_stable("gauss3"), bs.stability.is_i_stable("rk4")
        (True, False)
    """
    R = function_of(method)
    if len(R.q) == 1 and any(isinstance(a, Fraction | float) and a for a in R.numerator[1:]):
        return False  # polynomials grow without bound for all values of the symbols
    return field.first_crossing(stability_gap(R)) == math.inf if R.has_signs else None


def stability_gap(R: StabilityFunction) -> Coefficients:
    """The E-polynomial in y², which must be nonnegative; inexact coefficients at their upper bounds."""
    return tuple(map(field.upper, squared_gap(R)))


def is_a_stable(method: MethodOrFunction) -> bool | None:
    """Whether |R(z)| ≤ 1 in the left half plane: I-stable, without poles there; None if undecided.

    Example:
        >>> import bseries as bs
        >>> [bs.stability.is_a_stable(name) for name in ("gauss3", "rk4", "sdirk2")]
        [True, False, None]
    """
    R = function_of(method)
    stable = is_i_stable(R)
    # All poles must have positive real parts.
    return field.is_hurwitz(field.reflect(list(map(field.midpoint, R.q)))) if stable else stable


def is_l_stable(method: MethodOrFunction) -> bool | None:
    """Whether the method is A-stable and R(∞) = 0; None if undecided.

    Example:
        >>> import bseries as bs
        >>> bs.stability.is_l_stable("radau-iia3"), bs.stability.is_l_stable("gauss3")
        (True, False)
    """
    R = function_of(method)
    stable = is_a_stable(R)
    return stable if stable is None or R.at_infinity == 0 else False


def real_stability_interval(method: MethodOrFunction) -> float | None:
    """Length of the real stability interval: the largest x with |R| ≤ 1 on [−x, 0]; None if undecided.

    It is the float nearest to an isolated root, or ``inf``.

    Example:
        >>> import bseries as bs
        >>> bs.stability.real_stability_interval("rk4")
        2.785293563405282
    """
    R = function_of(method)
    if not R.has_signs:
        return None
    # |Q|² − |P|² is the product of Q − P and Q + P, which have no root in common.
    factors = (field.reflect(field.subtract(R.q, R.p)), field.reflect(add(R.q, R.p)))
    return min(field.nearest_float(field.first_crossing(tuple(map(field.upper, factor)))) for factor in factors)


def imaginary_stability_interval(method: MethodOrFunction) -> float | None:
    """Half length of the imaginary stability interval: the largest y with |R| ≤ 1 on [−iy, iy]; None if undecided.

    It is 0.0 if |R(iy)| > 1 for all small y > 0.

    Example:
        >>> import bseries as bs
        >>> bs.stability.imaginary_stability_interval("rk4"), bs.stability.imaginary_stability_interval("heun2")
        (2.8284271247461903, 0.0)
    """
    R = function_of(method)
    return math.sqrt(field.nearest_float(field.first_crossing(stability_gap(R)))) if R.has_signs else None


def stability_angle(method: MethodOrFunction) -> float | None:
    """The largest α for which the method is A(α)-stable: |R(z)| ≤ 1 for |arg(−z)| ≤ α.

    It is in degrees, within 10^-7: 90.0 for A-stable methods, 0.0 if no sector is stable, None if undecided. It is
    found by bisection. Each ray is decided exactly, since the tangent of half its angle is rational.

    Example:
        >>> import bseries as bs
        >>> round(bs.stability.stability_angle(bs.stability.StabilityFunction([1], [1, -1, "1/2", "-1/6"])), 2)
        88.23
    """
    R = function_of(method)
    stable = is_a_stable(R)
    if stable is not False:
        return 90.0 if stable else None
    if not R.has_signs or not _is_stable_ray(R, Fraction(0)):  # only polynomials are decided without signs
        return 0.0
    stable_to, unstable_from = Fraction(0), Fraction(1)
    nearest_pole = min((abs(math.pi - abs(cmath.phase(pole))) for pole in R.poles), default=math.pi)
    for _ in range(ANGLE_STEPS):
        middle = (stable_to + unstable_from) / 2
        if 2 * math.atan(middle) < nearest_pole and _is_stable_ray(R, middle):
            stable_to = middle
        else:
            unstable_from = middle
    return math.degrees(2 * math.atan(stable_to))


def _is_stable_ray(R: StabilityFunction, tangent: Fraction) -> bool:
    """Whether |R| ≤ 1 on the ray z = −x exp(iα), with tan(α/2) given.

    The coefficient of (−x)^(j+k) in |Q|² is q_j q_k cos((j − k) α), and cosines of multiples of α are Chebyshev
    polynomials of cos α.
    """
    size = max(len(R.p), len(R.q))
    p, q = ([*map(field.midpoint, values), *[Fraction(0)] * (size - len(values))] for values in (R.p, R.q))
    cosines = [Fraction(1), (1 - tangent**2) / (1 + tangent**2)]
    while len(cosines) < size:
        cosines.append(2 * cosines[1] * cosines[-1] - cosines[-2])
    gap = [Fraction(0)] * (2 * size - 1)
    for j in range(size):
        for k in range(size):
            gap[j + k] = gap[j + k] + (-1) ** (j + k) * cosines[abs(j - k)] * (q[j] * q[k] - p[j] * p[k])
    return field.first_crossing(tuple(gap)) == math.inf


def linear_order(method: MethodOrFunction) -> int:
    """Order for linear systems with constant coefficients: the largest p with R(z) = exp(z) + O(z^(p+1)).

    Like the orders of dispersion and dissipation, it holds for all values of the symbols.

    Example:
        >>> import bseries as bs
        >>> bs.stability.linear_order("gauss3"), bs.stability.linear_order("heun3")
        (6, 3)
    """
    R = function_of(method)
    size = len(R.p) + len(R.q)  # the order of approximation to exp is at most deg P + deg Q
    pairs = zip_longest(islice(_times_exponential(R.q, 1), size), R.p, fillvalue=Fraction(0))
    return next((k - 1 for k, (a, b) in enumerate(pairs) if a - b), size - 2)


def _times_exponential(p: Coefficients, rate: int) -> Iterator[Element]:
    """Power series of p(z) exp(rate · z)."""
    for m in count():
        yield sum((a * Fraction(rate ** (m - k), math.factorial(m - k)) for k, a in enumerate(p[: m + 1])), Fraction(0))


def dispersion_order(method: MethodOrFunction) -> int | None:
    """Dispersion order: the largest q with phase error y − arg R(iy) = O(y^(q+1)) for y' = iy, always even.

    It is None if decimals or floats do not determine the first term of the phase error.

    Example:
        >>> import bseries as bs
        >>> bs.stability.dispersion_order("rk4"), bs.stability.dispersion_order("gauss2")
        (4, 4)

    References:
        P. J. van der Houwen, B. P. Sommeijer, SIAM J. Numer. Anal. 24 (1987) 595–617, doi:10.1137/0724041.
    """
    R = function_of(method)
    # R(iy) exp(−iy) has the argument of P(z) Q(−z) exp(−z) at z = iy, whose imaginary part consists of the odd powers.
    product = multiply(R.p, field.reflect(R.q))
    series = islice(_times_exponential(product, -1), 2 * len(product) + 2)
    return next((m - 1 for m, a in enumerate(series) if m % 2 and a), None)


def dissipation_order(method: MethodOrFunction) -> int | None:
    """Dissipation order: the largest r with amplification error 1 − |R(iy)| = O(y^(r+1)); None if |R(iy)| = 1.

    Example:
        >>> import bseries as bs
        >>> bs.stability.dissipation_order("rk4"), bs.stability.dissipation_order("gauss2")
        (5, None)
    """
    # 1 − |R|² = E / |Q|², and |Q(0)| = 1.
    return next((2 * k - 1 for k, a in enumerate(squared_gap(function_of(method))) if a), None)


def characteristic(matrix: Sequence[Sequence[Any]]) -> Coefficients:
    """Coefficients of det(I + rA), ascending."""
    if not all(map(field.is_rational, matrix)):
        return tuple(determinant for determinant, _ in adjugate_terms(matrix))
    return field.reflect(list(map(from_flint, reversed(to_flint_matrix(matrix).charpoly().coeffs()))))


def adjugate_terms(matrix: Rows) -> Iterator[tuple[Element, Rows]]:
    """Coefficients of r^k, k = 0 … s, in det(I + rA) and in the adjugate C(r) of I + rA (Faddeev–Le Verrier).

    (I + rA) C = d I gives C_k = d_k I − A C_{k−1} and k d_k = tr(A C_{k−1}).
    """
    size = len(matrix)
    sparse = [[(j, a) for j, a in enumerate(row) if a] for row in matrix]
    determinant = Fraction(1)
    product = [[Fraction(0)] * size for _ in range(size)]
    for k in range(size + 1):
        if k:
            determinant = sum((product[i][i] for i in range(size)), Fraction(0)) / k
        adjugate = [[-value for value in row] for row in product]
        for i, row in enumerate(adjugate):
            row[i] = row[i] + determinant
        yield determinant, adjugate
        columns = list(zip(*adjugate, strict=True))
        product = [[sum([a * column[m] for m, a in row], Fraction(0)) for column in columns] for row in sparse]


def is_algebraically_stable(method: RungeKutta | str) -> bool | None:
    """Whether b_i ≥ 0 and the matrix M with m_ij = b_i a_ij + b_j a_ji − b_i b_j is positive semidefinite.

    Such a method is B-stable: it contracts wherever the flow does. For irreducible methods the converse holds too; the
    tableau is not reduced first. For methods on the roots of a rational polynomial the quadratic forms are rational in
    the basis 1, x, …; a change of basis keeps their signature.

    Example:
        >>> import bseries as bs
        >>> names = ("gauss3", "radau-iia3", "lobatto-iiia3", "trapezoidal")
        >>> [bs.stability.is_algebraically_stable(name) for name in names]
        [True, True, False, False]

    References:
        K. Burrage, J. C. Butcher, *Stability criteria for implicit Runge–Kutta methods*, SIAM J. Numer. Anal. 16 (1979)
        46–57;
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.12.
    """
    method = checked_method(method)
    rows, weights, _ = field.stage_matrix(method)
    if not all(map(field.has_sign, (*weights, *(a for row in rows for a in row)))):
        # For explicit methods m_ii = −b_i², and some b_i is nonzero.
        return False if method.is_explicit and method.weight_sum == 1 else None
    stages = range(method.stages)
    if method.algebra is None:
        gram = [[b if i == j else Fraction(0) for j in stages] for i, b in enumerate(weights)]
    else:  # the form Σ b_i f(c_i) g(c_i) in the basis 1, x, …: the moments b(x^(k+l))
        moments = method.algebra.moments(2 * method.stages - 1)
        gram = [list(moments[k : k + method.stages]) for k in stages]
    product = [[field.dot(gram[i], [rows[k][j] for k in stages]) for j in stages] for i in stages]
    gap = [[product[i][j] + product[j][i] - weights[i] * weights[j] for j in stages] for i in stages]
    return _is_semidefinite(gram) and _is_semidefinite(gap)


def _is_semidefinite(matrix: Rows) -> bool:
    """Whether a symmetric matrix has eigenvalues ≥ 0 only: whether all their elementary symmetric functions are ≥ 0.

    The errors of the entries of each row are added to its diagonal entry, which bounds their effect on the eigenvalues
    (Gershgorin).
    """
    rows = [list(map(field.midpoint, row)) for row in matrix]
    for i, row in enumerate(matrix):
        rows[i][i] = rows[i][i] + sum((from_flint(a.error) for a in row if isinstance(a, Inexact)), Fraction(0))
    return all(field.sign(a) >= 0 for a in characteristic(rows))


def ssp_coefficient(method: RungeKutta | str) -> Fraction | float | None:
    """SSP coefficient: the largest r such that steps h ≤ r h_E preserve the bounds that Euler steps h ≤ h_E preserve.

    It is Kraaijevanger's radius of absolute monotonicity: with K the matrix A with the row b below it and a column of
    zeros, the largest r with K (I + rK)⁻¹ ≥ 0 and r K (I + rK)⁻¹ 1 ≤ 1. The entries are rational functions of r, and
    the conditions hold on an interval [0, r]: its end is the smallest root at which a numerator changes sign. The
    tableau is not reduced first: equivalent stages may lower the coefficient.

    Returns:
        A `Fraction` where the coefficient is recognised as rational (and verified), else the nearest float; 0 if no
        step preserves the bounds, ``inf`` if every step does; None if it depends on symbols or on roots of too high a
        degree.

    Example:
        >>> import bseries as bs
        >>> names = ("explicit-euler", "ssprk33", "ssprk104", "rk4", "implicit-midpoint", "implicit-euler")
        >>> [str(bs.stability.ssp_coefficient(name)) for name in names]
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
    elements = field.to_elements([v for row in (*method.A, method.b) for v in row], method.precision)
    if not all(map(field.has_sign, elements)):
        return None
    if any(field.sign(field.upper(a)) < 0 for a in elements):
        return Fraction(0)
    exact = method.domain in ("QQ", "algebraic")
    return _first(_numerators([elements[k : k + size] for k in range(0, len(elements), size)]), exact=exact)


def _numerators(rows: Rows) -> Iterator[Coefficients]:
    """Polynomials in r that must be nonnegative: det(I + rA), and the numerators of the conditions over it.

    With C the adjugate of I + rA the numerators are the entries of A C, b C and C 1, and det(I + rA) − r b C 1.
    """
    determinant, adjugate = zip(*adjugate_terms(rows[:-1]), strict=True)
    columns = [list(zip(*c, strict=True)) for c in adjugate]
    products = [[[field.dot(row, column) for column in c] for c in columns] for row in rows]
    row_sums = [[sum(row, Fraction(0)) for row in c] for c in adjugate]
    for coefficients in (*products, row_sums):
        yield from map(trim, zip(*coefficients, strict=True))
    yield trim(determinant)
    sums = [sum(values, Fraction(0)) for values in products[-1]]
    yield field.subtract(determinant, [Fraction(0), *sums[:-1]])


def _first(conditions: Iterable[Coefficients], *, exact: bool) -> Fraction | float:
    """The smallest r > 0 at which one of the polynomials becomes negative, ``inf`` if there is none."""
    found = {tuple(map(field.upper, p)) for p in conditions}
    least = min(map(field.first_crossing, found), default=math.inf)
    # The smallest value may be the float of an irrational root, close to a rational root of another condition.
    if exact and isinstance(least, Fraction) and all(field.sign(evaluate(p, least)) >= 0 for p in found):
        return least
    return field.nearest_float(least) if isinstance(least, Fraction) else least


def linear_ssp_coefficient(method: MethodOrFunction) -> Fraction | float | None:
    """Threshold factor: the SSP coefficient for linear problems with constant coefficients.

    It is the radius of absolute monotonicity of the stability function, the largest r with R^(k)(x) ≥ 0 for all k and
    −r ≤ x ≤ 0. For polynomials the condition at x = −r is sufficient.

    Returns:
        As for `ssp_coefficient`; None also if R is not a polynomial, since it then has infinitely many derivatives.

    Example:
        >>> import bseries as bs
        >>> [str(bs.stability.linear_ssp_coefficient(name)) for name in ("rk4", "ssprk33", "ssprk104")]
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
    return _first(map(field.reflect, derivatives), exact=not R.is_inexact)
