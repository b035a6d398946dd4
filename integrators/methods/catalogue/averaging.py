"""Energy-preserving methods that average the field, and Kahan's method for quadratic fields."""

from __future__ import annotations

from fractions import Fraction
from itertools import zip_longest
from math import comb
from typing import TYPE_CHECKING

from integrators.methods.catalogue.entry import MethodEntry

if TYPE_CHECKING:
    from integrators.methods.kinds.continuous_stage import ContinuousStageRungeKutta
    from integrators.methods.tableaux.runge_kutta import RungeKutta

AVF = (
    "G. R. W. Quispel, D. I. McLaren, J. Phys. A 41 (2008) 045206, doi:10.1088/1751-8113/41/4/045206; R. I. McLachlan, "
    "G. R. W. Quispel, N. Robidoux, Phil. Trans. R. Soc. A 357 (1999) 1021–1045, doi:10.1098/rsta.1999.0363"
)
HAIRER = "E. Hairer, JNAIAM 5 (2010) 73–84; L. Brugnano, F. Iavernaro, D. Trigiante, JNAIAM 5 (2010) 17–37 (HBVM(∞, s))"
KAHAN = (
    "W. Kahan, lecture notes, Toronto (1993); E. Celledoni, R. I. McLachlan, B. Owren, G. R. W. Quispel, J. Phys. A 46 "
    "(2013) 025201, doi:10.1088/1751-8113/46/2/025201"
)


def _energy_collocation(*, name: str, reference: str, stages: int = 1) -> ContinuousStageRungeKutta:
    """Energy-preserving collocation at Gauss's nodes: A_τσ = Σ_(k<s) (2k+1) ∫₀^τ P_k(x) dx P_k(σ).

    Hairer's A_τσ = Σ_i ∫₀^τ ℓ_i(x) dx ℓ_i(σ) / b_i does not depend on the basis, as the b_i are the squared norms of
    the orthogonal polynomials ℓ_i; P_k are Legendre's polynomials on [0, 1], whose squared norms are 1/(2k+1).
    """
    from integrators.methods.kinds.continuous_stage import ContinuousStageRungeKutta

    M = [[Fraction(0)] * stages for _ in range(stages + 1)]
    for k in range(stages):
        legendre = [(-1) ** (k + j) * comb(k, j) * comb(k + j, j) for j in range(k + 1)]
        for i, x in enumerate(legendre, 1):
            terms = [Fraction((2 * k + 1) * x * y, i) for y in legendre]
            M[i] = [a + b for a, b in zip_longest(M[i], terms, fillvalue=Fraction(0))]
    return ContinuousStageRungeKutta(M, name=name, reference=reference)


def _kahan(*, name: str, reference: str) -> RungeKutta:
    from integrators.methods.tableaux.runge_kutta import RungeKutta

    A = [["0", "0", "0"], ["-1/4", "1", "-1/4"], ["-1/2", "2", "-1/2"]]
    return RungeKutta(A, A[2], name=name, reference=reference)


METHODS = (
    MethodEntry(
        "avf",
        "continuous stage",
        1,
        2,
        "the averaged vector field method, y1 = y0 + h ∫ f((1-θ) y0 + θ y1) dθ; preserves energy",
        AVF,
        _energy_collocation,
        ("averaged-vector-field",),
    ),
    MethodEntry(
        "energy-collocation",
        "continuous stage",
        None,
        "2s",
        "energy-preserving collocation at Gauss's nodes; one stage is avf",
        HAIRER,
        _energy_collocation,
        ("hbvm",),
    ),
    MethodEntry(
        "kahan",
        "implicit",
        3,
        2,
        "(y1 - y0)/h = 2 f((y0+y1)/2) - f(y0)/2 - f(y1)/2: Kahan's linearly implicit method if f is quadratic",
        KAHAN,
        _kahan,
    ),
)
