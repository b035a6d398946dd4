"""Two-derivative, generalised additive Runge–Kutta and exponential methods."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from integrators.methods.catalogue import explicit
from integrators.methods.catalogue.entry import MethodEntry, lower_rows

if TYPE_CHECKING:
    from collections.abc import Callable

    from integrators.methods.kinds.exponential import LawsonMethod
    from integrators.methods.kinds.generalized_additive import GeneralizedAdditiveRungeKutta
    from integrators.methods.kinds.two_derivative import TwoDerivativeRungeKutta
    from integrators.methods.tableaux.runge_kutta import RungeKutta

CHAN_TSAI = "R. P. K. Chan, A. Y. J. Tsai, Numer. Algorithms 53 (2010) 171–194, doi:10.1007/s11075-009-9349-1"
GARK = "A. Sandu, M. Günther, SIAM J. Numer. Anal. 53 (2015) 17–42, doi:10.1137/130943224"
LAWSON = "J. D. Lawson, SIAM J. Numer. Anal. 4 (1967) 372–380, doi:10.1137/0704033"


def _one_field_value(nodes: str, rows: tuple[str, ...], weights: str) -> Callable[..., TwoDerivativeRungeKutta]:
    """Builder of a method with Y_i = y + c_i h f(y) + h² Σ â_ij g(Y_j) and y1 = y + h f(y) + h² Σ b̂_i g(Y_i)."""

    def build(*, name: str, reference: str) -> TwoDerivativeRungeKutta:
        from integrators.methods.kinds.two_derivative import TwoDerivativeRungeKutta

        c, stages = nodes.split(), len(rows)
        zeros = ["0"] * (stages - 1)
        coefficients = [[x, *zeros] for x in c], lower_rows(rows, stages), ["1", *zeros], weights.split()
        return TwoDerivativeRungeKutta(*coefficients, name=name, reference=reference)

    return build


def _trapezoidal_midpoint(*, name: str, reference: str) -> GeneralizedAdditiveRungeKutta:
    from integrators.methods.kinds.generalized_additive import GeneralizedAdditiveRungeKutta

    A = {
        "p": {"p": [["0", "0"], ["1/2", "1/2"]], "q": [["0"], ["1"]]},
        "q": {"p": [["1/2", "0"]], "q": [["1/2"]]},
    }
    return GeneralizedAdditiveRungeKutta(A, {"p": ["1/2", "1/2"], "q": ["1"]}, name=name, reference=reference)


def _lawson(tableau: str) -> Callable[..., LawsonMethod]:
    def build(*, name: str, reference: str) -> LawsonMethod:
        from integrators.methods.kinds.exponential import LawsonMethod

        entry = next(entry for entry in explicit.METHODS if entry.name == tableau)
        slow = cast("RungeKutta", entry.build(name=entry.name, reference=entry.reference))
        return LawsonMethod(slow, name=name, reference=reference)

    return build


METHODS = (
    MethodEntry(
        "tdrk4",
        "two-derivative",
        2,
        4,
        "order 4 from one value of f and two of f' f",
        CHAN_TSAI,
        _one_field_value("0 1/2", ("", "1/8"), "1/6 1/3"),
    ),
    MethodEntry(
        "tdrk5",
        "two-derivative",
        3,
        5,
        "order 5 from one value of f and three of f' f",
        CHAN_TSAI,
        _one_field_value("0 2/5 1", ("", "2/25", "-1/4 3/4"), "1/8 25/72 1/36"),
    ),
    MethodEntry(
        "gark2",
        "additive",
        3,
        2,
        "p by the trapezoidal and q by the midpoint rule; Störmer-Verlet if p' = f(q), q' = g(p)",
        GARK,
        _trapezoidal_midpoint,
    ),
    MethodEntry(
        "lawson-euler",
        "exponential",
        1,
        1,
        "exp(hL) applied to an explicit Euler step of N, for y' = L y + N(y)",
        LAWSON,
        _lawson("explicit-euler"),
    ),
    MethodEntry(
        "lawson4",
        "exponential",
        4,
        4,
        "rk4 for exp(-tL) y, where y' = L y + N(y)",
        LAWSON,
        _lawson("rk4"),
        ("lawson-rk4", "integrating-factor-rk4"),
    ),
)
