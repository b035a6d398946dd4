"""Runge–Kutta–Nyström and force-gradient methods for q'' = g(q), as a system p' = g(q), q' = p."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from integrators.methods.catalogue.registry import MethodEntry, lower_rows
from integrators.methods.kinds.second_order import ForceGradient, RungeKuttaNystrom, TakahashiImada

NYSTROM = (
    "E. J. Nyström, Acta Soc. Sci. Fennicae 50 (1925) 1–55; Hairer, Nørsett, Wanner, Solving Ordinary Differential "
    "Equations I (1993), §II.14, doi:10.1007/978-3-540-78862-1"
)
VERLET = "L. Verlet, Phys. Rev. 159 (1967) 98–103, doi:10.1103/PhysRev.159.98"
TAKAHASHI_IMADA = "M. Takahashi, M. Imada, J. Phys. Soc. Japan 53 (1984) 3765–3769, doi:10.1143/JPSJ.53.3765"
SIMPLIFIED = "E. Hairer, R. I. McLachlan, R. D. Skeel, ESAIM: M2AN 43 (2009) 631–644, doi:10.1051/m2an/2009019"
CHIN = "S. A. Chin, Phys. Lett. A 226 (1997) 344–348, doi:10.1016/S0375-9601(97)00003-0"


def _nystrom(
    positions: tuple[str, ...], b_bar: str, b: str, c: str, momenta: tuple[str, ...] = ()
) -> Callable[..., RungeKuttaNystrom]:
    """Builder of an explicit method from its matrices below the diagonal."""
    stages = len(positions)
    rows = lower_rows(positions, stages), b_bar.split(), b.split(), c.split()
    return partial(RungeKuttaNystrom, *rows, A=lower_rows(momenta, stages) or None)


def _force_gradient(*coefficients: str) -> Callable[..., ForceGradient]:
    """Builder of a method from its drifts, kicks and gradients."""
    return partial(ForceGradient, *map(str.split, coefficients))


METHODS = (
    MethodEntry("rkn-verlet", "nystrom", 2, 2, "the Störmer-Verlet method for q'' = g(q), as a Nyström method", VERLET,
        _nystrom(("", "1/2"), "1/2 0", "1/2 1/2", "0 1"), ("nystrom-verlet",)),
    MethodEntry("rkn-nystrom4", "nystrom", 3, 4, "Nyström's method of order 4 for q'' = g(q)", NYSTROM,
        _nystrom(("", "1/8", "0 1/2"), "1/6 1/3 0", "1/6 2/3 1/6", "0 1/2 1")),
    MethodEntry("rkn-nystrom5", "nystrom", 4, 5, "Nyström's method of order 5 for q'' = g(q)", NYSTROM,
        _nystrom(("", "1/50", "-1/27 7/27", "3/10 -2/35 9/35"), "14/336 100/336 54/336 0",
            "14/336 125/336 162/336 35/336", "0 1/5 2/3 1")),
    MethodEntry("rkn-nystrom4-general", "nystrom", 4, 4,
        "Nyström's method of order 4 for q'' = g(q, q'), with the nodes and weights of rk4", NYSTROM,
        _nystrom(("", "1/8", "1/8 0", "0 0 1/2"), "1/6 1/6 1/6 0", "1/6 1/3 1/3 1/6", "0 1/2 1/2 1",
            ("", "1/2", "0 1/2", "0 0 1"))),
    MethodEntry("takahashi-imada", "force gradient", 2, 2,
        "Störmer-Verlet with the force f + alpha h^2 f' f, alpha = 1/12: symplectic, conjugate to a method of order 4",
        TAKAHASHI_IMADA, TakahashiImada, options=("alpha",)),
    MethodEntry("simplified-takahashi-imada", "force gradient", 2, 2,
        "Störmer-Verlet with the force f(q + alpha h^2 f(q)), alpha = 1/12: preserves volume, not symplectic",
        SIMPLIFIED, partial(TakahashiImada, simplified=True), options=("alpha",)),
    MethodEntry("chin4a", "force gradient", 3, 4,
        "kicks h/6, 2h/3, h/6, the one in the middle with its gradient; no step backwards in time", CHIN,
        _force_gradient("0 1/2 1/2 0", "1/6 2/3 1/6", "0 1/36 0")),
    MethodEntry("chin4b", "force gradient", 2, 4, "two kicks h/2 with gradients; no step backwards in time", CHIN,
        _force_gradient("1/2-sqrt(3)/6 sqrt(3)/3 1/2-sqrt(3)/6", "1/2 1/2", "1/12-sqrt(3)/24 1/12-sqrt(3)/24")),
    MethodEntry("chin4c", "force gradient", 3, 4,
        "kicks 3h/8, h/4, 3h/8, the one in the middle with its gradient; no step backwards in time, small errors", CHIN,
        _force_gradient("1/6 1/3 1/3 1/6", "3/8 1/4 3/8", "0 1/96 0")),
)  # fmt: skip
