"""Runge–Kutta–Nyström methods for q'' = g(q), as a system p' = g(q), q' = p."""

from __future__ import annotations

from typing import TYPE_CHECKING

from integrators.methods.catalogue.entry import MethodEntry

if TYPE_CHECKING:
    from collections.abc import Callable

    from integrators.methods.kinds.nystrom import RungeKuttaNystrom

NYSTROM = (
    "E. J. Nyström, Acta Soc. Sci. Fennicae 50 (1925) 1–55; Hairer, Nørsett, Wanner, Solving Ordinary Differential "
    "Equations I (1993), §II.14, doi:10.1007/978-3-540-78862-1"
)
VERLET = "L. Verlet, Phys. Rev. 159 (1967) 98–103, doi:10.1103/PhysRev.159.98"


def _nystrom(
    positions: tuple[str, ...], b_bar: str, b: str, c: str, momenta: tuple[str, ...] = ()
) -> Callable[..., RungeKuttaNystrom]:
    """The builder of an explicit method, its matrices given below the diagonal."""

    def build(*, name: str, reference: str) -> RungeKuttaNystrom:
        from integrators.methods.kinds.nystrom import RungeKuttaNystrom

        stages = len(positions)
        A_bar, A = (
            [[*row.split(), *["0"] * (stages - len(row.split()))] for row in rows] for rows in (positions, momenta)
        )
        rows = A_bar, b_bar.split(), b.split(), c.split()
        return RungeKuttaNystrom(*rows, A=A or None, name=name, reference=reference)

    return build


METHODS = (
    MethodEntry(
        "rkn-verlet",
        "nystrom",
        2,
        2,
        "the Störmer-Verlet method for q'' = g(q), as a Nyström method",
        VERLET,
        _nystrom(("", "1/2"), "1/2 0", "1/2 1/2", "0 1"),
        ("nystrom-verlet",),
    ),
    MethodEntry(
        "rkn-nystrom4",
        "nystrom",
        3,
        4,
        "Nyström's method of order 4 for q'' = g(q)",
        NYSTROM,
        _nystrom(("", "1/8", "0 1/2"), "1/6 1/3 0", "1/6 2/3 1/6", "0 1/2 1"),
    ),
    MethodEntry(
        "rkn-nystrom5",
        "nystrom",
        4,
        5,
        "Nyström's method of order 5 for q'' = g(q)",
        NYSTROM,
        _nystrom(
            ("", "1/50", "-1/27 7/27", "3/10 -2/35 9/35"),
            "14/336 100/336 54/336 0",
            "14/336 125/336 162/336 35/336",
            "0 1/5 2/3 1",
        ),
    ),
    MethodEntry(
        "rkn-nystrom4-general",
        "nystrom",
        4,
        4,
        "Nyström's method of order 4 for q'' = g(q, q'), with the nodes and weights of rk4",
        NYSTROM,
        _nystrom(
            ("", "1/8", "1/8 0", "0 0 1/2"),
            "1/6 1/6 1/6 0",
            "1/6 1/3 1/3 1/6",
            "0 1/2 1/2 1",
            ("", "1/2", "0 1/2", "0 0 1"),
        ),
    ),
)
