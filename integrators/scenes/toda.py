"""The Toda lattice: a ring of particles with exponential forces, completely integrable."""

from __future__ import annotations

from math import cos, pi
from typing import Any

from .base import Scene
from .blocks import MAX_VARIABLES
from .options import read_count
from .particles import FLAT_SITES
from .terms import Term

SUMMARY = "the periodic Toda lattice of n particles, completely integrable"
REFERENCE = (
    "M. Toda, J. Phys. Soc. Japan 22 (1967) 431–436; H. Flaschka, Phys. Rev. B 9 (1974) 1924–1925; "
    "HLW, section X.1.5; E. Hairer, lecture on long-time behaviour, example 9"
)


def toda(*, n: Any = 3) -> Scene:
    """H = Σ p_k²/2 + exp(q_k − q_{k+1}) with q_{n+1} = q_1.

    The start for n = 3 is that of figure 9 of the lecture; for other n it is one wave, q = 0 and p_k = cos(2πk/n) to 12
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
        name="toda",
        summary=SUMMARY,
        reference=REFERENCE,
    )


def _integrals(n: int) -> dict[str, str]:
    """The total momentum and, but for a constant, the trace of L³.

    L is Flaschka's periodic Jacobi matrix with diagonal a_k = −p_k/2 and off-diagonal b_k = exp((q_k − q_{k+1})/2)/2,
    whose eigenvalues are first integrals. tr L = −Σ p_k/2, tr L² = H/2, and tr L³ = Σ a_k³ + 3(a_k + a_{k+1}) b_k², to
    which n = 3 adds 6 b_1 b_2 b_3 = 3/4. For n = 3 these three are all there are.
    """
    ring = [(k, k % n + 1) for k in range(1, n + 1)]
    cubes = " + ".join(f"p{k}^3 + 3*(p{k} + p{j})*exp(q{k} - q{j})" for k, j in ring)
    return {"momentum": " + ".join(f"p{k}" for k, _ in ring), "trace_of_cube": f"-({cubes})/8"}


SCENES = (("toda", toda, SUMMARY, REFERENCE, ("toda-lattice",)),)
