"""Linear stability: the stability function of a method, A-stability, stability intervals, phase errors.

All answers come from the stability function R = P/Q and are exact for exact methods: signs of polynomials are decided
by their isolated roots. For decimals and floats, quantities that are zero within their digits count as zero. Answers
are None where they depend on symbols or on roots of too high a degree.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import count, islice
from typing import Any

from bseries.analysis.stability.field_elements import (
    dot,
    from_element,
    from_flint,
    midpoint,
    nearest_float,
    stage_matrix,
    to_flint,
    upper,
)
from bseries.analysis.stability.rational_functions import StabilityFunction
from bseries.analysis.stability.real_polynomials import first_crossing, is_hurwitz, is_rational, reflect, subtract
from integrators.core.errors import IntegratorError, shorten
from integrators.exact.polynomials import ONE, add, multiply, trim
from integrators.methods.catalogue.registry import as_method
from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
from integrators.methods.tableaux.runge_kutta import RungeKutta

MethodOrFunction = RungeKutta | StabilityFunction | str
Rows = Sequence[Sequence[Any]]

MOST_INEXACT_STAGES = 10
"""The last coefficients of R decrease like 1/(2s)!, and doubles have sixteen digits."""

ANGLE_STEPS = 30
"""Bisections of the tangent of half the stability angle: 10^-7 degrees."""


def stability_function(method: RungeKutta | str) -> StabilityFunction:
    """Stability function R(z) = 1 + z b (I − zA)⁻¹ 1 in lowest terms: y₁ = R(hλ) y₀ for y' = λy.

    Args:
        method: a Runge–Kutta method. For Gauss, Radau and Lobatto methods of the catalogue no root is computed.

    Returns:
        The function, exact if the tableau is; its `digits` are those of a tableau published as decimals.

    Raises:
        IntegratorError: `method` is no `RungeKutta`, or is implicit with too many stages for floats or decimals.

    Example:
        >>> from integrators import method
        >>> print(stability_function(method("rk4")))
        1 + z + z^2/2 + z^3/6 + z^4/24
        >>> print(stability_function(method("radau-iia2")))
        (1 + z/3)/(1 - 2*z/3 + z^2/6)

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, Proposition IV.3.1.
    """
    method = checked_method(method)
    rows, weights, vector = _reached(*stage_matrix(method))
    explicit = not any(any(row[i:]) for i, row in enumerate(rows))
    if method.precision and not explicit and method.stages > MOST_INEXACT_STAGES:
        raise IntegratorError(
            f"method must have at most {MOST_INEXACT_STAGES} stages if implicit and not exact, but had "
            f"{method.stages}: its entries do not show the last coefficients of the stability function"
        )
    q = ONE if explicit else reflect(characteristic(rows))
    moments = []
    for _ in rows:
        moments.append(dot(weights, vector))
        vector = [dot(row, vector) for row in rows]
    # P = Q (1 + Σ b A^k 1 z^(k+1)): terms beyond degree s cancel by the Cayley–Hamilton theorem.
    p = multiply(q, (Fraction(1), *moments))[: len(rows) + 1]
    return StabilityFunction.from_elements(p, q, floating=method.domain == "float", digits=method.digits)


def _reached(rows: Any, weights: Any, vector: Any) -> tuple[Any, Any, Any]:
    """The stages that the weights depend on; others add common factors to P and Q that floats cannot cancel."""
    found = [i for i, weight in enumerate(weights) if weight]
    for i in found:  # the list grows during the loop
        found.extend(j for j, entry in enumerate(rows[i]) if entry and j not in found)
    kept = sorted(found)
    return [[rows[i][j] for j in kept] for i in kept], [weights[i] for i in kept], [vector[i] for i in kept]


def checked_method(method: Any) -> RungeKutta:
    """The method, if it is given by one tableau, or by the name of one."""
    method = as_method(method)
    if not isinstance(method, RungeKutta):
        why = ": a partitioned method needs y' = λy split first" if isinstance(method, PartitionedRungeKutta) else ""
        raise IntegratorError(f"method must be a RungeKutta, but was {shorten(repr(method))}{why}")
    return method


def function_of(method: MethodOrFunction) -> StabilityFunction:
    """Stability function of a method; a stability function is returned unchanged."""
    return method if isinstance(method, StabilityFunction) else stability_function(method)


def squared_gap(R: StabilityFunction) -> list[Any]:
    """Coefficients of E(y) = |Q(iy)|² − |P(iy)|² in powers of y²: Q(z) Q(−z) − P(z) P(−z) in powers of −z²."""
    below, above = (multiply(values, reflect(values)) for values in (R.q, R.p))
    return [-a if k % 2 else a for k, a in enumerate(subtract(below, above)[::2])]


def e_polynomial(method: MethodOrFunction) -> tuple[Any, ...]:
    """E-polynomial |Q(iy)|² − |P(iy)|² of the stability function P/Q with Q(0) = 1.

    It is nonnegative if and only if |R(iy)| ≤ 1 for all real y.

    Args:
        method: a Runge–Kutta method or its stability function; symbols are allowed.

    Returns:
        The coefficients of 1, y, y², …; () if |R(iy)| = 1 for all y.

    Example:
        >>> from integrators import method
        >>> [str(e) for e in e_polynomial(method("rk4"))]
        ['0', '0', '0', '0', '0', '0', '1/72', '0', '-1/576']

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.3.
    """
    R = function_of(method)
    even = trim(squared_gap(R))
    return tuple(from_element(e, floating=R.floating) for a in even for e in (a, Fraction(0)))[:-1]


def is_i_stable(method: MethodOrFunction) -> bool | None:
    """Whether |R(iy)| ≤ 1 for all real y.

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The answer, or None.

    Example:
        >>> from integrators import method
        >>> is_i_stable(method("gauss3")), is_i_stable(method("rk4"))
        (True, False)
    """
    R = function_of(method)
    if len(R.q) == 1 and any(isinstance(a, Fraction | float) and a for a in R.numerator[1:]):
        return False  # polynomials grow without bound for all values of the symbols
    return first_crossing(stability_gap(R)) == math.inf if R.has_signs else None


def stability_gap(R: StabilityFunction) -> list[Any]:
    """The E-polynomial in y², which must be nonnegative; inexact coefficients at their upper bounds."""
    return list(map(upper, squared_gap(R)))


def is_a_stable(method: MethodOrFunction) -> bool | None:
    """Whether |R(z)| ≤ 1 in the left half plane: I-stable, without poles there.

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The answer, or None.

    Example:
        >>> from integrators import method
        >>> [is_a_stable(method(name)) for name in ("gauss3", "rk4", "sdirk2")]
        [True, False, None]

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.3.
    """
    R = function_of(method)
    stable = is_i_stable(R)
    # All poles must have positive real parts.
    return is_hurwitz(reflect(list(map(midpoint, R.q)))) if stable else stable


def is_l_stable(method: MethodOrFunction) -> bool | None:
    """Whether the method is A-stable and R(∞) = 0.

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The answer, or None.

    Example:
        >>> from integrators import method
        >>> is_l_stable(method("radau-iia3")), is_l_stable(method("gauss3"))
        (True, False)

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.3.
    """
    R = function_of(method)
    stable = is_a_stable(R)
    return stable if stable is None or R.at_infinity == 0 else False


def real_stability_interval(method: MethodOrFunction) -> float | None:
    """Length of the real stability interval: the largest x with |R| ≤ 1 on [−x, 0].

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The length, as the float nearest to an isolated root, ``inf`` if the interval is unbounded, or None.

    Example:
        >>> from integrators import method
        >>> real_stability_interval(method("rk4"))
        2.785293563405282

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.2.
    """
    R = function_of(method)
    if not R.has_signs:
        return None
    # |Q|² − |P|² is the product of Q − P and Q + P, which have no root in common.
    factors = (reflect(subtract(R.q, R.p)), reflect(add(R.q, R.p)))
    return min(nearest_float(first_crossing(tuple(map(upper, factor)))) for factor in factors)


def imaginary_stability_interval(method: MethodOrFunction) -> float | None:
    """Half length of the imaginary stability interval: the largest y with |R| ≤ 1 on [−iy, iy].

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        As `real_stability_interval`; 0.0 where |R(iy)| > 1 for all small y.

    Example:
        >>> from integrators import method
        >>> imaginary_stability_interval(method("rk4")), imaginary_stability_interval(method("heun2"))
        (2.8284271247461903, 0.0)

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.2.
    """
    R = function_of(method)
    return math.sqrt(nearest_float(first_crossing(stability_gap(R)))) if R.has_signs else None


def stability_angle(method: MethodOrFunction) -> float | None:
    """The largest α for which the method is A(α)-stable: |R(z)| ≤ 1 for |arg(−z)| ≤ α.

    The angle is bisected. Each ray is decided exactly: the tangent of half its angle is rational.

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The angle in degrees within 10^-7, 90.0 for A-stable methods, 0.0 if no sector is stable, or None.

    Example:
        >>> round(stability_angle(StabilityFunction([1], [1, -1, "1/2", "-1/6"])), 2)
        88.23

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, Definition IV.3.9.
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
    p, q = ([*map(midpoint, values), *[Fraction(0)] * (size - len(values))] for values in (R.p, R.q))
    cosines = [Fraction(1), (1 - tangent**2) / (1 + tangent**2)]
    while len(cosines) < size:
        cosines.append(2 * cosines[1] * cosines[-1] - cosines[-2])
    gap: list[Any] = [Fraction(0)] * (2 * size - 1)
    for j in range(size):
        for k in range(size):
            gap[j + k] = gap[j + k] + (-1) ** (j + k) * cosines[abs(j - k)] * (q[j] * q[k] - p[j] * p[k])
    return first_crossing(gap) == math.inf


def linear_order(method: MethodOrFunction) -> int:
    """Order for linear systems with constant coefficients: the largest p with R(z) = exp(z) + O(z^(p+1)).

    Args:
        method: a Runge–Kutta method or its stability function; the order holds for every value of symbols.

    Example:
        >>> from integrators import method
        >>> linear_order(method("gauss3")), linear_order(method("heun3"))
        (6, 3)
    """
    R = function_of(method)
    residuals = _times_exponential(R.q, 1)
    # The order of approximation to exp is at most deg P + deg Q.
    for k in range(len(R.p) + len(R.q)):
        if next(residuals) - (R.p[k] if k < len(R.p) else 0):
            return k - 1
    return len(R.p) + len(R.q) - 2


def _times_exponential(p: Sequence[Any], sign: int) -> Iterator[Any]:
    """Power series of p(z) exp(±z)."""
    for m in count():
        yield sum((a * Fraction(sign ** (m - k), math.factorial(m - k)) for k, a in enumerate(p[: m + 1])), Fraction(0))


def dispersion_order(method: MethodOrFunction) -> int | None:
    """Dispersion order: the largest q with phase error y − arg R(iy) = O(y^(q+1)) for y' = iy, always even.

    Args:
        method: a Runge–Kutta method or its stability function; the order holds for every value of symbols.

    Returns:
        The order; None if decimals or floats do not determine the first term of the phase error.

    Example:
        >>> from integrators import method
        >>> dispersion_order(method("rk4")), dispersion_order(method("gauss2"))
        (4, 4)

    References:
        P. J. van der Houwen, B. P. Sommeijer, SIAM J. Numer. Anal. 24 (1987) 595–617, doi:10.1137/0724041.
    """
    R = function_of(method)
    # R(iy) exp(−iy) has the argument of P(z) Q(−z) exp(−z) at z = iy, whose imaginary part consists of the odd powers.
    product = multiply(R.p, reflect(R.q))
    series = islice(_times_exponential(product, -1), 2 * len(product) + 2)
    return next((m - 1 for m, a in enumerate(series) if m % 2 and a), None)


def dissipation_order(method: MethodOrFunction) -> int | None:
    """Dissipation order: the largest r with amplification error 1 − |R(iy)| = O(y^(r+1)) for y' = iy, always odd.

    Args:
        method: a Runge–Kutta method or its stability function; the order holds for every value of symbols.

    Returns:
        The order; None if |R(iy)| = 1 for all y.

    Example:
        >>> from integrators import method
        >>> dissipation_order(method("rk4")), dissipation_order(method("gauss2"))
        (5, None)

    References:
        P. J. van der Houwen, B. P. Sommeijer, SIAM J. Numer. Anal. 24 (1987) 595–617, doi:10.1137/0724041.
    """
    # 1 − |R|² = E / |Q|², and |Q(0)| = 1.
    return next((2 * k - 1 for k, a in enumerate(squared_gap(function_of(method))) if a), None)


def characteristic(matrix: Rows) -> list[Any]:
    """Coefficients of det(I + rA), ascending."""
    if not all(map(is_rational, matrix)):
        return [determinant for determinant, _ in adjugate_terms(matrix)]
    from flint import fmpq_mat

    found = fmpq_mat([list(map(to_flint, row)) for row in matrix]).charpoly().coeffs()
    return list(reflect(list(map(from_flint, reversed(found)))))


def adjugate_terms(matrix: Rows) -> Iterator[tuple[Any, list[list[Any]]]]:
    """Coefficients of r^k, k = 0 … s, in det(I + rA) and in the adjugate C(r) of I + rA (Faddeev–Le Verrier).

    (I + rA) C = d I gives C_k = d_k I − A C_{k−1} and k d_k = tr(A C_{k−1}).
    """
    size = len(matrix)
    sparse = [[(j, a) for j, a in enumerate(row) if a] for row in matrix]
    determinant: Any = Fraction(1)
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
