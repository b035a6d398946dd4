"""Diagonally implicit methods with rational or algebraic coefficients, and two symbolic families."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError
from integrators.methods.catalogue.entry import MethodEntry

if TYPE_CHECKING:
    from integrators.methods.tableaux.runge_kutta import RungeKutta

HALF = Fraction(1, 2)
HLW = "Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), §II.1.1, doi:10.1007/3-540-30666-8"
NORSETT = (
    "S. P. Nørsett, Math. and Comp. 6/74, Trondheim (1974); Hairer, Nørsett, Wanner, "
    "Solving Ordinary Differential Equations I, Table II.7.2, doi:10.1007/978-3-540-78862-1"
)


def _entry(
    name: str,
    order: int,
    matrix: list[list[str]],
    weights: list[str],
    description: str,
    reference: str,
    aliases: tuple[str, ...] = (),
) -> MethodEntry:
    def build(*, name: str, reference: str) -> RungeKutta:
        from integrators.methods.tableaux.runge_kutta import RungeKutta

        return RungeKutta(matrix, weights, name=name, reference=reference)

    return MethodEntry(name, "diagonally implicit", len(matrix), order, description, reference, build, aliases)


def _sdirk2(*, name: str, reference: str, gamma: Any) -> RungeKutta:
    """Nodes γ and 1−γ with equal weights: order 2 for every γ, and order 3 if γ² − γ + 1/6 = 0."""
    from integrators.methods.tableaux.runge_kutta import RungeKutta

    return RungeKutta([[gamma, 0], [1 - 2 * gamma, gamma]], [HALF, HALF], name=name, reference=reference)


def _sdirk2_general(*, name: str, reference: str, gamma: Any, c2: Any) -> RungeKutta:
    """Nodes γ and c2; the weights follow from Σ b_i = 1 and Σ b_i c_i = 1/2."""
    from integrators.exact.entries import cancels
    from integrators.methods.tableaux.runge_kutta import RungeKutta

    if cancels([gamma, -c2], 0):
        raise IntegratorError(
            f"parameters gamma and c2 of sdirk2-general must differ, but were {gamma!s:.60} and {c2!s:.60}"
        )
    last = (HALF - gamma) / (c2 - gamma)
    return RungeKutta([[gamma, 0], [c2 - gamma, gamma]], [1 - last, last], name=name, reference=reference)


METHODS = (
    _entry("implicit-euler", 1, [["1"]], ["1"], "Euler's implicit method", HLW, ("backward-euler",)),
    _entry("implicit-midpoint", 2, [["1/2"]], ["1"], "the implicit midpoint rule, symplectic and symmetric", HLW),
    _entry(
        "trapezoidal",
        2,
        [["0", "0"], ["1/2", "1/2"]],
        ["1/2", "1/2"],
        "the implicit trapezoidal rule, symmetric and conjugate to the midpoint rule",
        HLW,
        ("crank-nicolson", "implicit-trapezoidal"),
    ),
    _entry(
        "crouzeix3",
        3,
        [["1/2+sqrt(3)/6", "0"], ["-sqrt(3)/3", "1/2+sqrt(3)/6"]],
        ["1/2", "1/2"],
        "A-stable method of order 3 with two stages: sdirk2 with gamma = 1/2 + sqrt(3)/6",
        f"M. Crouzeix, thesis, Paris (1975); {NORSETT}",
        ("crouzeix",),
    ),
    _entry(
        "qin-zhang",
        2,
        [["1/4", "0"], ["1/2", "1/4"]],
        ["1/2", "1/2"],
        "two implicit midpoint steps of half the length, symplectic: sdirk2 with gamma = 1/4",
        "M.-Z. Qin, M.-Q. Zhang, J. Comput. Math. Suppl. (1992) 205–215",
    ),
    MethodEntry(
        "sdirk2",
        "diagonally implicit",
        2,
        2,
        "singly diagonally implicit with nodes gamma and 1 - gamma; order 3 for gamma = 1/2 ± sqrt(3)/6",
        NORSETT,
        _sdirk2,
        parameters=("gamma",),
    ),
    MethodEntry(
        "sdirk2-general",
        "diagonally implicit",
        2,
        2,
        "all singly diagonally implicit methods of order 2 with two stages and nodes gamma and c2",
        NORSETT,
        _sdirk2_general,
        parameters=("gamma", "c2"),
    ),
)
