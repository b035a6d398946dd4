"""Partitioned methods for y = (p, q), with p' = −H_q and q' = H_p.

If the two tableaux differ, each is the symplectic conjugate of the other, b_i â_ij + b̂_j a_ji = b_i b̂_j, and the pair
is symplectic (Hairer, Lubich, Wanner, Geometric Numerical Integration, Theorem VI.4.6).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from integrators.methods.catalogue.implicit import gauss, lobatto_iiia, lobatto_iiib
from integrators.methods.catalogue.registry import MethodEntry
from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
from integrators.methods.tableaux.runge_kutta import RungeKutta

HLW = "Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), §II.2 and §VI.3–VI.4, doi:10.1007/3-540-30666-8"
VERLET = (
    "L. Verlet, Phys. Rev. 159 (1967) 98–103, doi:10.1103/PhysRev.159.98; "
    "Hairer, Lubich, Wanner, Acta Numerica 12 (2003) 399–450, doi:10.1017/S0962492902000144"
)
SUN = (
    "G. Sun, J. Comput. Math. 11 (1993) 365–372; L. O. Jay, SIAM J. Numer. Anal. 33 (1996) 368–387, doi:10.1137/0733019"
)


def _pair(p: Callable[..., RungeKutta], q: Callable[..., RungeKutta], **labels: Any) -> PartitionedRungeKutta:
    """The pair of methods of two builders; families have ``stages`` among the labels."""
    parts = {key: build(**labels | {"name": f"{labels['name']}, {key}"}) for key, build in (("p", p), ("q", q))}
    return PartitionedRungeKutta(parts, name=labels["name"], reference=labels["reference"])


EXPLICIT_EULER = partial(RungeKutta, [["0"]], ["1"])
IMPLICIT_EULER = partial(RungeKutta, [["1"]], ["1"])
# Both stages of the half-step part are at the midpoint; the stages of the other part are at the two end points.
HALF_STEP = partial(RungeKutta, [["1/2", "0"], ["1/2", "0"]], ["1/2", "1/2"])
END_POINTS = partial(RungeKutta, [["0", "0"], ["1/2", "1/2"]], ["1/2", "1/2"])

METHODS = (
    MethodEntry("symplectic-euler-p", "partitioned", 1, 1,
        "implicit in p: p1 = p0 - h H_q(p1, q0), q1 = q0 + h H_p(p1, q0)", HLW,
        partial(_pair, IMPLICIT_EULER, EXPLICIT_EULER)),
    MethodEntry("symplectic-euler-q", "partitioned", 1, 1,
        "implicit in q: p1 = p0 - h H_q(p0, q1), q1 = q0 + h H_p(p0, q1)", HLW,
        partial(_pair, EXPLICIT_EULER, IMPLICIT_EULER)),
    MethodEntry("stormer-verlet-kdk", "partitioned", 2, 2,
        "kick-drift-kick: half a step in p, a step in q, half a step in p; lobatto-iiia-iiib2", VERLET,
        partial(_pair, HALF_STEP, END_POINTS), ("stormer-verlet", "velocity-verlet", "leapfrog", "UTU")),
    MethodEntry("stormer-verlet-dkd", "partitioned", 2, 2,
        "drift-kick-drift: half a step in q, a step in p, half a step in q; lobatto-iiib-iiia2", VERLET,
        partial(_pair, END_POINTS, HALF_STEP), ("position-verlet", "TUT")),
    MethodEntry("lobatto-iiia-iiib", "partitioned", None, "2s-2",
        "q by Lobatto IIIA and p by Lobatto IIIB, so that two stages are stormer-verlet-kdk", SUN,
        partial(_pair, lobatto_iiib, lobatto_iiia), least_stages=2),
    MethodEntry("lobatto-iiib-iiia", "partitioned", None, "2s-2",
        "q by Lobatto IIIB and p by Lobatto IIIA, so that two stages are stormer-verlet-dkd", SUN,
        partial(_pair, lobatto_iiia, lobatto_iiib), least_stages=2),
    MethodEntry("gauss-gauss", "partitioned", None, "2s",
        "p and q by the same Gauss method, which is its own symplectic conjugate", HLW, partial(_pair, gauss, gauss),
        aliases=("partitioned-gauss", "gauss-pair")),
)  # fmt: skip
