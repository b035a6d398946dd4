"""What a method does with y' = λy: its stability function, and stability on the left half plane.

All answers come from the stability function R = P/Q and are exact for exact methods: signs of polynomials are decided
by Sturm chains, places of poles by Routh's scheme. For decimals and floats, what their digits cannot tell from zero
counts as zero.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from bseries.analysis.stability import sturm
from bseries.analysis.stability.field_elements import dot, from_element, midpoint, stage_matrix, upper
from bseries.analysis.stability.rational_functions import StabilityFunction
from bseries.analysis.stability.resolvents import characteristic
from integrators.core.errors import IntegratorError, shorten
from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
from integrators.methods.tableaux.runge_kutta import RungeKutta

Method = RungeKutta | StabilityFunction

MOST_INEXACT_STAGES = 10
"""The last coefficients of R decrease like 1/(2s)!, and doubles have sixteen digits."""


def stability_function(method: RungeKutta) -> StabilityFunction:
    """The function R(z) = 1 + z b (I − zA)⁻¹ 1, in lowest terms: one step of y' = λy multiplies by R(hλ).

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
    rows, weights, vector = _reached(*stage_matrix(checked_method(method)))
    explicit = not any(any(row[i:]) for i, row in enumerate(rows))
    if method.precision and not explicit and method.stages > MOST_INEXACT_STAGES:
        raise IntegratorError(
            f"method must have at most {MOST_INEXACT_STAGES} stages if implicit and not exact, but had "
            f"{method.stages}: its entries do not show the last coefficients of the stability function"
        )
    q = (Fraction(1),) if explicit else sturm.reflect(characteristic(rows))
    moments = []
    for _ in rows:
        moments.append(dot(weights, vector))
        vector = [dot(row, vector) for row in rows]
    # P = Q (1 + Σ b A^k 1 z^(k+1)): what lies beyond degree s cancels, by the theorem of Cayley and Hamilton.
    p = sturm.multiply(q, [Fraction(1), *moments])[: len(rows) + 1]
    return StabilityFunction.from_elements(p, q, floating=method.domain == "float", digits=method.digits)


def _reached(rows: Any, weights: Any, vector: Any) -> tuple[Any, Any, Any]:
    """The stages that the weights depend on: others would bring factors to P and Q that floats cannot cancel."""
    found = [i for i, weight in enumerate(weights) if weight]
    for i in found:  # grows on the way
        found.extend(j for j, entry in enumerate(rows[i]) if entry and j not in found)
    kept = sorted(found)
    return [[rows[i][j] for j in kept] for i in kept], [weights[i] for i in kept], [vector[i] for i in kept]


def checked_method(method: Any) -> RungeKutta:
    """The method, if it has one tableau."""
    if not isinstance(method, RungeKutta):
        why = ": a partitioned method needs y' = λy split first" if isinstance(method, PartitionedRungeKutta) else ""
        raise IntegratorError(f"method must be a RungeKutta, but was {shorten(repr(method))}{why}")
    return method


def function_of(method: Method) -> StabilityFunction:
    """The stability function of a method, or the one that is given."""
    return method if isinstance(method, StabilityFunction) else stability_function(method)


def squared_gap(R: StabilityFunction) -> list[Any]:
    """The coefficients of E(y) = |Q(iy)|² − |P(iy)|² in powers of y².

    They are those of Q(z) Q(−z) − P(z) P(−z) in powers of −z².
    """
    below, above = (sturm.multiply(values, sturm.reflect(values)) for values in (R.q, R.p))
    return [-a if k % 2 else a for k, a in enumerate(sturm.combine(below, above, -1)[::2])]


def e_polynomial(method: Method) -> tuple[Any, ...]:
    """The polynomial E(y) = |Q(iy)|² − |P(iy)|² of the stability function P/Q with Q(0) = 1.

    It is nowhere negative exactly if |R(iy)| ≤ 1 for all real y.

    Args:
        method: a Runge–Kutta method or its stability function; symbols are welcome.

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
    even = sturm.strip(squared_gap(R))
    return tuple(from_element(e, floating=R.floating) for a in even for e in (a, Fraction(0)))[:-1]


def is_i_stable(method: Method) -> bool | None:
    """Whether |R(iy)| ≤ 1 for all real y.

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The answer; None where it depends on symbols, or hangs on roots of too high a degree.

    Example:
        >>> from integrators import method
        >>> is_i_stable(method("gauss3")), is_i_stable(method("rk4"))
        (True, False)
    """
    R = function_of(method)
    if len(R.q) == 1 and any(isinstance(a, Fraction | float) and a for a in R.numerator[1:]):
        return False  # polynomials grow without bound, whatever value a symbol has
    return sturm.is_nonnegative(stability_gap(R)) if R.has_signs else None


def stability_gap(R: StabilityFunction) -> sturm.Coefficients:
    """The polynomial E in y² that must not be negative, with the benefit of what inexact entries leave open."""
    return sturm.strip(map(upper, squared_gap(R)))


def is_a_stable(method: Method) -> bool | None:
    """Whether |R(z)| ≤ 1 in the whole left half plane: no poles there, and I-stable.

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The answer; None where it depends on symbols, or hangs on roots of too high a degree.

    Example:
        >>> from integrators import method
        >>> [is_a_stable(method(name)) for name in ("gauss3", "rk4", "sdirk2")]
        [True, False, None]

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.3.
    """
    R = function_of(method)
    stable = is_i_stable(R)
    return _has_right_poles(R) if stable else stable


def _has_right_poles(R: StabilityFunction) -> bool:
    """Whether all poles have positive real parts."""
    return sturm.is_hurwitz(sturm.reflect(list(map(midpoint, R.q))))


def is_l_stable(method: Method) -> bool | None:
    """Whether the method is A-stable and R(∞) = 0.

    Args:
        method: a Runge–Kutta method or its stability function.

    Returns:
        The answer; None where it depends on symbols, or hangs on roots of too high a degree.

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
