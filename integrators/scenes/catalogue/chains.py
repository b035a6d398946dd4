"""Chains of particles: the Toda lattice and the Fermi–Pasta–Ulam problem."""

from __future__ import annotations

from math import cos, pi
from typing import Any

from integrators.scenes.catalogue.particles import FLAT_SITES, read_count, read_positive
from integrators.scenes.catalogue.registry import SceneEntry
from integrators.scenes.model.blocks import MAX_VARIABLES
from integrators.scenes.model.terms import Term
from integrators.scenes.scene import Scene


def toda(*, n: Any = 3) -> Scene:
    """H = Σ p_k²/2 + exp(q_k − q_{k+1}) with q_{n+1} = q_1.

    For n = 3 the start is taken from figure 9 of the lecture; for other n it is q = 0, p_k = cos(2πk/n), rounded to 12
    decimals.

    Args:
        n: The number of particles.

    Raises:
        IntegratorError: n is not an integer of at least 2.

    Example:
        >>> toda(n=2).hamiltonian
        p1**2/2 + p2**2/2 + exp(-q1 + q2) + exp(q1 - q2)
    """
    n = read_count(n, "n", 2, MAX_VARIABLES)
    wave = {"p": [round(cos(2 * pi * k / n), 12) for k in range(1, n + 1)], "q": [0] * n}
    return Scene(
        {"p": n, "q": n},
        terms=[Term(over="each", hamiltonian="p_i^2/2"), Term(over="ring", hamiltonian="exp(q_i - q_j)")],
        invariants=_integrals(n) if n <= FLAT_SITES else {},
        start={"p": ["-3/2", 1, "1/2"], "q": [1, 2, -1]} if n == 3 else wave,
    )


def _integrals(n: int) -> dict[str, str]:
    """The total momentum and, up to a constant, the trace of L³.

    L is Flaschka's periodic Jacobi matrix with diagonal a_k = −p_k/2 and off-diagonal b_k = exp((q_k − q_{k+1})/2)/2,
    whose eigenvalues are first integrals. tr L = −Σ p_k/2, tr L² = H/2, and tr L³ = Σ a_k³ + 3(a_k + a_{k+1}) b_k²,
    plus 6 b_1 b_2 b_3 = 3/4 if n = 3. For n = 3 these traces form a complete set of first integrals.
    """
    ring = [(k, k % n + 1) for k in range(1, n + 1)]
    cubes = " + ".join(f"p{k}^3 + 3*(p{k} + p{j})*exp(q{k} - q{j})" for k, j in ring)
    return {"momentum": " + ".join(f"p{k}" for k, _ in ring), "trace_of_cube": f"-({cubes})/8"}


def fermi_pasta_ulam(*, m: Any = 3, omega: Any = 50) -> Scene:
    """H = Σ (y_0² + y_1² + ω² x_1²)/2 + Σ (elongation of a soft spring)⁴/4.

    The coordinates are those of HLW: for the i-th stiff spring, ``qx`` is x_{0,i}, its scaled displacement, ``qy`` is
    x_{1,i}, its scaled expansion, and ``px``, ``py`` are the velocities y_{0,i}, y_{1,i}. Quadratic terms form the part
    ``linear``, quartic terms the part ``nonlinear``. The start is that of HLW's figures, x_{0,1} = y_{0,1} = y_{1,1} =
    1, x_{1,1} = 1/ω, and zero elsewhere.

    The stiff springs exchange their oscillatory energies I_i = (y_{1,i}² + ω² x_{1,i}²)/2 slowly. The sum of the I_i
    stays close to its initial value 1 over very long times, but is not a first integral.

    Args:
        m: The number of stiff springs.
        omega: Their frequency ω.

    Raises:
        IntegratorError: m is not a positive integer, or omega no positive number.

    Example:
        >>> fermi_pasta_ulam(m=1).start
        (1, 1, 1, 1/50)
    """
    m, omega = read_count(m, "m", 1, MAX_VARIABLES // 2), read_positive(omega, "omega")
    rest = [[0, 0]] * (m - 1)
    return Scene(
        {"p": [m, 2], "q": [m, 2]},
        terms=[
            Term(over="each", hamiltonian="(px_i^2 + py_i^2 + omega^2*qy_i^2)/2", part="linear"),
            Term(over=[(1,)], hamiltonian="(qx_i - qy_i)^4/4", part="nonlinear"),
            Term(over="chain", hamiltonian="(qx_j - qy_j - qx_i - qy_i)^4/4", part="nonlinear"),
            Term(over=[(m,)], hamiltonian="(qx_i + qy_i)^4/4", part="nonlinear"),
        ],
        parameters={"omega": omega},
        start={"p": [[1, 1], *rest], "q": [[1, 1 / omega], *rest]},
    )


SCENES = (
    SceneEntry("toda", toda, "the periodic Toda lattice of n particles, completely integrable",
        "M. Toda, J. Phys. Soc. Japan 22 (1967) 431–436; H. Flaschka, Phys. Rev. B 9 (1974) 1924–1925; "
        "HLW, section X.1.5; E. Hairer, lecture on long-time behaviour, example 9",
        aliases=("toda-lattice",)),
    SceneEntry("fermi-pasta-ulam", fermi_pasta_ulam,
        "2m masses joined by soft quartic and stiff linear springs in turn; oscillatory energies over long times",
        "L. Galgani, A. Giorgilli, A. Martinoli, S. Vanzini, Physica D 59 (1992) 334–348; HLW, section I.5.1",
        aliases=("fpu",)),
)  # fmt: skip
