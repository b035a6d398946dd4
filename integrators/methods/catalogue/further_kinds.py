"""Energy-preserving, two-derivative, generalised additive and exponential methods."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import partial
from itertools import zip_longest

from integrators.methods.catalogue.implicit import legendre
from integrators.methods.catalogue.registry import MethodEntry, lower_rows, method
from integrators.methods.kinds.extended_runge_kutta import (
    ContinuousStageRungeKutta,
    GeneralizedAdditiveRungeKutta,
    LawsonMethod,
    TwoDerivativeRungeKutta,
)
from integrators.methods.tableaux.runge_kutta import RungeKutta

AVF = (
    "G. R. W. Quispel, D. I. McLaren, J. Phys. A 41 (2008) 045206, doi:10.1088/1751-8113/41/4/045206; R. I. McLachlan, "
    "G. R. W. Quispel, N. Robidoux, Phil. Trans. R. Soc. A 357 (1999) 1021–1045, doi:10.1098/rsta.1999.0363"
)
HAIRER = "E. Hairer, JNAIAM 5 (2010) 73–84; L. Brugnano, F. Iavernaro, D. Trigiante, JNAIAM 5 (2010) 17–37 (HBVM(∞, s))"
CHAN_TSAI = "R. P. K. Chan, A. Y. J. Tsai, Numer. Algorithms 53 (2010) 171–194, doi:10.1007/s11075-009-9349-1"
GARK = "A. Sandu, M. Günther, SIAM J. Numer. Anal. 53 (2015) 17–42, doi:10.1137/130943224"
LAWSON = "J. D. Lawson, SIAM J. Numer. Anal. 4 (1967) 372–380, doi:10.1137/0704033"


def _energy_collocation(*, name: str, reference: str, stages: int = 1) -> ContinuousStageRungeKutta:
    """Energy-preserving collocation at Gauss's nodes: A_τσ = Σ_(k<s) (2k+1) ∫₀^τ P_k(x) dx P_k(σ).

    Hairer's A_τσ = Σ_i ∫₀^τ ℓ_i(x) dx ℓ_i(σ) / b_i does not depend on the basis, as the b_i are the squared norms of
    the orthogonal polynomials ℓ_i; P_k are Legendre's polynomials on [0, 1], whose squared norms are 1/(2k+1).
    """
    M = [[Fraction(0)] * stages for _ in range(stages + 1)]
    for k in range(stages):
        for i, x in enumerate(legendre(k), 1):
            terms = [(2 * k + 1) * x * y / i for y in legendre(k)]
            M[i] = [a + b for a, b in zip_longest(M[i], terms, fillvalue=Fraction(0))]
    return ContinuousStageRungeKutta(M, name=name, reference=reference)


def _one_field_value(nodes: str, rows: tuple[str, ...], weights: str) -> Callable[..., TwoDerivativeRungeKutta]:
    """Builder of a method with Y_i = y + c_i h f(y) + h² Σ â_ij g(Y_j) and y1 = y + h f(y) + h² Σ b̂_i g(Y_i)."""
    stages = len(rows)
    zeros = ["0"] * (stages - 1)
    A = [[x, *zeros] for x in nodes.split()]
    return partial(TwoDerivativeRungeKutta, A, lower_rows(rows, stages), ["1", *zeros], weights.split())


def _lawson(tableau: str, **labels: str) -> LawsonMethod:
    slow = method(tableau)
    assert isinstance(slow, RungeKutta)
    return LawsonMethod(slow, **labels)


TRAPEZOIDAL_MIDPOINT = {
    "p": {"p": [["0", "0"], ["1/2", "1/2"]], "q": [["0"], ["1"]]},
    "q": {"p": [["1/2", "0"]], "q": [["1/2"]]},
}
BORIS = (
    "J. P. Boris, Proc. 4th Conf. Numerical Simulation of Plasmas, Washington (1970) 3–67; "
    "E. Hairer, C. Lubich, BIT 58 (2018) 969–979, doi:10.1007/s10543-018-0713-1"
)
MIDPOINT_TRAPEZOIDAL = {
    "v": {"v": [["1/2"]], "x": [["1/2", "0"]]},
    "x": {"v": [["0"], ["1"]], "x": [["0", "0"], ["1/2", "1/2"]]},
}

METHODS = (
    MethodEntry("avf", "continuous stage", 1, 2,
        "the averaged vector field method, y1 = y0 + h ∫ f((1-θ) y0 + θ y1) dθ; preserves energy", AVF,
        _energy_collocation, ("averaged-vector-field",), title="AVF"),
    MethodEntry("energy-collocation", "continuous stage", None, "2s",
        "energy-preserving collocation at Gauss's nodes; one stage is avf", HAIRER, _energy_collocation, ("hbvm",),
        title="energy collocation"),
    MethodEntry("tdrk4", "two-derivative", 2, 4, "order 4 from one value of f and two of f' f", CHAN_TSAI,
        _one_field_value("0 1/2", ("", "1/8"), "1/6 1/3"), title="TDRK4"),
    MethodEntry("tdrk5", "two-derivative", 3, 5, "order 5 from one value of f and three of f' f", CHAN_TSAI,
        _one_field_value("0 2/5 1", ("", "2/25", "-1/4 3/4"), "1/8 25/72 1/36"), title="TDRK5"),
    MethodEntry("gark2", "additive", 3, 2,
        "p by the trapezoidal and q by the midpoint rule; Störmer-Verlet if p' = f(q), q' = g(p)", GARK,
        partial(GeneralizedAdditiveRungeKutta, TRAPEZOIDAL_MIDPOINT, {"p": ["1/2", "1/2"], "q": ["1"]}), title="GARK2"),
    MethodEntry("boris", "additive", 3, 2,
        "v by the midpoint rule between two half steps of x: Boris's method if x' = v, v' = E(x) + v × B(x)", BORIS,
        partial(GeneralizedAdditiveRungeKutta, MIDPOINT_TRAPEZOIDAL, {"v": ["1"], "x": ["1/2", "1/2"]}), title="Boris"),
    MethodEntry("lawson-euler", "exponential", 1, 1,
        "exp(hL) applied to an explicit Euler step of N, for y' = L y + N(y)", LAWSON,
        partial(_lawson, "explicit-euler"), title="Lawson–Euler"),
    MethodEntry("lawson4", "exponential", 4, 4, "rk4 for exp(-tL) y, where y' = L y + N(y)", LAWSON,
        partial(_lawson, "rk4"), ("lawson-rk4", "integrating-factor-rk4"), title="Lawson 4"),
)  # fmt: skip
