"""The Fermi–Pasta–Ulam problem in the form of Hairer, Lubich and Wanner: soft and stiff springs alternate."""

from __future__ import annotations

from typing import Any

from .base import Scene
from .blocks import MAX_VARIABLES
from .options import read_count, read_positive
from .terms import Term

SUMMARY = "2m masses joined by soft quartic and stiff linear springs in turn; oscillatory energies over long times"
REFERENCE = "L. Galgani, A. Giorgilli, A. Martinoli, S. Vanzini, Physica D 59 (1992) 334–348; HLW, section I.5.1"


def fermi_pasta_ulam(*, m: Any = 3, omega: Any = 50) -> Scene:
    """H = Σ (y_0² + y_1² + ω² x_1²)/2 + a quarter of the fourth powers of the elongations of the soft springs.

    The coordinates are those of HLW: at site i, ``qx`` is x_{0,i}, the scaled displacement of the i-th stiff spring,
    ``qy`` is x_{1,i}, its scaled expansion, and ``px``, ``py`` are the velocities y_{0,i}, y_{1,i}. Quadratic terms are
    the part ``linear``, quartic ones the part ``nonlinear``. The start is that of HLW's figures, x_{0,1} = y_{0,1} =
    y_{1,1} = 1, x_{1,1} = 1/ω, and zero elsewhere.

    The stiff springs exchange their oscillatory energies I_i = (y_{1,i}² + ω² x_{1,i}²)/2 slowly, and the sum of these
    stays close to its first value 1 over very long times: they are no first integrals.

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
        name="fermi-pasta-ulam",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("fermi-pasta-ulam", fermi_pasta_ulam, SUMMARY, REFERENCE, ("fpu",)),)
