"""Linear stability of multistep methods: parasitic modes, the root locus and Dahlquist's first barrier."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bseries.analysis.memory_properties import linear_multistep
from integrators.core.arguments import read_whole
from integrators.exact.entries import round_entry
from integrators.methods.kinds.root_conditions import ParasiticMode
from integrators.methods.programs.program import Method

if TYPE_CHECKING:
    import numpy as np


def parasitic_modes(method: Method | str) -> tuple[ParasiticMode, ...]:
    """The roots ζ ≠ 1 of ρ on the unit circle, with their growth parameters μ = σ(ζ)/(ζ ρ'(ζ)).

    A parasitic component z ζ^n of the numerical solution obeys z' = μ f'(y) z + O(h): along a stable solution it grows
    where Re μ < 0, whatever h.

    Args:
        method: A linear multistep method, or its name.

    Raises:
        SeriesError: `method` is no linear multistep method.
        IntegratorError: The coefficients of ρ have symbols, or its roots cannot be told from the unit circle.

    Example:
        >>> import bseries as bs
        >>> [(mode.root, mode.growth) for mode in bs.memory.parasitic_modes(bs.memory.nystrom(2))]
        [((-1+0j), (-1+0j))]

    References:
        HLW, theorem XV.3.2.
    """
    return linear_multistep(method).growth_parameters


def root_locus(method: Method | str, points: int = 400) -> np.ndarray:
    """The curve z = ρ(ζ)/σ(ζ), ζ = e^{iθ}: the boundary of the stability region lies on it.

    Args:
        method: A linear multistep method, or its name.
        points: The number of angles θ, from −π to π; where σ(ζ) = 0 the value is infinite or not a number.

    Raises:
        SeriesError: `method` is no linear multistep method.
        IntegratorError: `points` is not a whole number ≥ 2, or a coefficient has symbols.

    Example:
        >>> import bseries as bs
        >>> [complex(z) for z in bs.memory.root_locus("am1", 5).round(12)[1:4]]
        [-2j, 0j, 2j]
    """
    import numpy as np

    multistep = linear_multistep(method)
    rho, sigma = (np.array([round_entry(x) for x in row[::-1]]) for row in (multistep.alpha, multistep.beta))
    zeta = np.exp(1j * np.linspace(-np.pi, np.pi, read_whole(points, "points", "a whole number ≥ 2", 2, 10**7)))
    with np.errstate(all="ignore"):
        return np.polyval(rho, zeta) / np.polyval(sigma, zeta)


def dahlquist_barrier(k: int, *, explicit: bool = False) -> int:
    """The largest order of a zero-stable method with k steps.

    Args:
        k: The number of steps.
        explicit: Whether the method is explicit.

    Raises:
        IntegratorError: `k` is not a whole number ≥ 1.

    Example:
        >>> import bseries as bs
        >>> [bs.memory.dahlquist_barrier(k) for k in (1, 2, 3, 4)]
        [2, 4, 4, 6]
        >>> bs.memory.milne_simpson(2).order
        4

    References:
        G. Dahlquist, Math. Scand. 4 (1956) 33–53; Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*,
        theorem III.3.5.
    """
    k = read_whole(k, "k", "a number of steps ≥ 1", 1, 10**9)
    return k if explicit else k + 1 + (k % 2 == 0)
