"""Explicit Runge–Kutta methods without error estimate, and two symbolic families."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError
from integrators.methods.catalogue.entry import MethodEntry, lower_rows

if TYPE_CHECKING:
    from integrators.methods.tableaux.runge_kutta import RungeKutta

HEUN = "K. Heun, Z. Math. Phys. 45 (1900) 23–38"
KUTTA = "W. Kutta, Z. Math. Phys. 46 (1901) 435–453"
RALSTON = "A. Ralston, Math. Comp. 16 (1962) 431–437, doi:10.1090/S0025-5718-1962-0150954-0"


def explicit_entry(
    name: str,
    order: int,
    rows: tuple[str, ...],
    weights: str,
    description: str,
    reference: str,
    *,
    aliases: tuple[str, ...] = (),
    embedded: tuple[str, ...] = (),
    digits: int | None = None,
) -> MethodEntry:
    """Entry of an explicit method given by its printed tableau, which is parsed when the method is built.

    Args:
        name: The name in the catalogue.
        order: The order claimed by the source.
        rows: Rows 2 … s of A below the diagonal, entries separated by spaces. The nodes are the row sums.
        weights: The weights b_1 … b_s, separated by spaces.
        description: One line about the method.
        reference: The source.
        aliases: Other names.
        embedded: The weights of each embedded method.
        digits: The number of significant digits of decimals; None if the entries are exact.
    """
    stages = len(rows) + 1

    def build(*, name: str, reference: str) -> RungeKutta:
        from integrators.methods.tableaux.runge_kutta import RungeKutta

        return RungeKutta(
            lower_rows(("", *rows), stages),
            weights.split(),
            embedded=[row.split() for row in embedded],
            name=name,
            digits=digits,
            reference=reference,
        )

    kind = "embedded pair" if embedded else "explicit"
    return MethodEntry(name, kind, stages, order, description, reference, build, aliases)


def _two_stages(*, name: str, reference: str, alpha: Any) -> RungeKutta:
    """Σ b_i = 1 and Σ b_i c_i = 1/2 with c = (0, α)."""
    from integrators.exact.entries import cancels
    from integrators.methods.tableaux.runge_kutta import RungeKutta

    if cancels([alpha], 0):
        raise IntegratorError(f"parameter alpha of explicit2 must not be 0, but was {alpha}")
    last = 1 / (2 * alpha)
    return RungeKutta([[0, 0], [alpha, 0]], [1 - last, last], name=name, reference=reference)


def _three_stages(*, name: str, reference: str, c2: Any, c3: Any) -> RungeKutta:
    """Solve Σ b_i c_i^(k−1) = 1/k, k = 1, 2, 3, for b and b_3 a_32 c_2 = 1/6 for a_32, with c = (0, c2, c3)."""
    from integrators.exact.entries import cancels
    from integrators.methods.tableaux.runge_kutta import RungeKutta

    # The last case is b_3 = 0, for which a_32 is free or does not exist.
    if any(cancels(terms, 0) for terms in ([c2], [c3], [c2, -c3], [3 * c2, -2])):
        raise IntegratorError(
            "parameters c2 and c3 of explicit3 must differ from 0 and from each other, and c2 from 2/3, "
            f"but were {c2!s:.60} and {c3!s:.60}"
        )
    b2 = (3 * c3 - 2) / (6 * c2 * (c3 - c2))
    b3 = (2 - 3 * c2) / (6 * c3 * (c3 - c2))
    a32 = c3 * (c3 - c2) / (c2 * (2 - 3 * c2))
    matrix = [[0, 0, 0], [c2, 0, 0], [c3 - a32, a32, 0]]
    return RungeKutta(matrix, [1 - b2 - b3, b2, b3], name=name, reference=reference)


METHODS = (
    explicit_entry(
        "explicit-euler",
        1,
        (),
        "1",
        "Euler's polygon method",
        "L. Euler, Institutionum calculi integralis (1768), §650",
        aliases=("forward-euler",),
    ),
    explicit_entry(
        "explicit-midpoint",
        2,
        ("1/2",),
        "0 1",
        "Runge's midpoint rule",
        "C. Runge, Math. Ann. 46 (1895) 167–178, doi:10.1007/BF01446807",
    ),
    explicit_entry(
        "heun2", 2, ("1",), "1/2 1/2", "Heun's method, the explicit trapezoidal rule", HEUN, aliases=("heun", "ssprk22")
    ),
    explicit_entry("ralston2", 2, ("2/3",), "1/4 3/4", "two stages of order 2 with the least error bound", RALSTON),
    explicit_entry("kutta3", 3, ("1/2", "-1 2"), "1/6 2/3 1/6", "Kutta's method of order 3", KUTTA, aliases=("rk3",)),
    explicit_entry("heun3", 3, ("1/3", "0 2/3"), "1/4 0 3/4", "Heun's method of order 3", HEUN),
    explicit_entry(
        "ralston3", 3, ("1/2", "0 3/4"), "2/9 1/3 4/9", "three stages of order 3 with the least error bound", RALSTON
    ),
    explicit_entry(
        "ssprk33",
        3,
        ("1", "1/4 1/4"),
        "1/6 1/6 2/3",
        "optimal strong-stability-preserving method with three stages",
        "C.-W. Shu, S. Osher, J. Comput. Phys. 77 (1988) 439–471, doi:10.1016/0021-9991(88)90177-5",
    ),
    explicit_entry(
        "ssprk104",
        4,
        tuple("1/6 " * i for i in range(1, 5)) + tuple("1/15 " * 5 + "1/6 " * i for i in range(5)),
        "1/10 " * 10,
        "strong-stability-preserving method with ten stages, in low storage",
        "D. I. Ketcheson, SIAM J. Sci. Comput. 30 (2008) 2113–2136, doi:10.1137/07070485X",
    ),
    explicit_entry(
        "rk4",
        4,
        ("1/2", "0 1/2", "0 0 1"),
        "1/6 1/3 1/3 1/6",
        "the classical Runge–Kutta method",
        KUTTA,
        aliases=("classical-rk4",),
    ),
    explicit_entry("rk38", 4, ("1/3", "-1/3 1", "1 -1 1"), "1/8 3/8 3/8 1/8", "Kutta's 3/8 rule", KUTTA),
    explicit_entry(
        "ralston4",
        4,
        (
            "2/5",
            "(-2889+1428*sqrt(5))/1024 (3785-1620*sqrt(5))/1024",
            "(-3365+2094*sqrt(5))/6040 (-975-3046*sqrt(5))/2552 (467040+203968*sqrt(5))/240845",
        ),
        "(263+24*sqrt(5))/1812 (125-1000*sqrt(5))/3828 (3426304+1661952*sqrt(5))/5924787 (30-4*sqrt(5))/123",
        "four stages of order 4 with the least error bound",
        RALSTON,
    ),
    explicit_entry(
        "nystrom5",
        5,
        ("1/3", "4/25 6/25", "1/4 -3 15/4", "2/27 10/9 -50/81 8/81", "2/25 12/25 2/15 8/75 0"),
        "23/192 0 125/192 0 -27/64 125/192",
        "Kutta's method of order 5 as corrected by Nyström",
        "E. J. Nyström, Acta Soc. Sci. Fenn. 50 (1925) no. 13",
        aliases=("nystrom",),
    ),
    MethodEntry(
        "explicit2",
        "explicit",
        2,
        2,
        "all explicit methods of order 2 with two stages; alpha is the second node",
        "J. C. Butcher, Numerical Methods for Ordinary Differential Equations (2016), §232, doi:10.1002/9781119121534",
        _two_stages,
        parameters=("alpha",),
    ),
    MethodEntry(
        "explicit3",
        "explicit",
        3,
        3,
        "explicit methods of order 3 with three stages and distinct nodes 0, c2, c3",
        "J. C. Butcher, Numerical Methods for Ordinary Differential Equations (2016), §233, doi:10.1002/9781119121534",
        _three_stages,
        parameters=("c2", "c3"),
    ),
)
