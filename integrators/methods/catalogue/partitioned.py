"""Methods for y = (p, q): partitioned ones for p' = −H_q, q' = H_p; Nyström and force-gradient ones for q'' = g(q).

If the two tableaux of a pair differ, each is the symplectic conjugate of the other, b_i â_ij + b̂_j a_ji = b_i b̂_j, and
the pair is symplectic (Hairer, Lubich, Wanner, Geometric Numerical Integration, Theorem VI.4.6). Second-order equations
are read as a system p' = g(q), q' = p.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from integrators.methods.catalogue.implicit import gauss, lobatto_iiia, lobatto_iiib
from integrators.methods.catalogue.registry import MethodEntry, lower_rows
from integrators.methods.kinds.second_order import ForceGradient, RungeKuttaNystrom, TakahashiImada
from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
from integrators.methods.tableaux.runge_kutta import RungeKutta

HLW = "Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), §II.2 and §VI.3–VI.4, doi:10.1007/3-540-30666-8"
VERLET = "L. Verlet, Phys. Rev. 159 (1967) 98–103, doi:10.1103/PhysRev.159.98"
STORMER_VERLET = f"{VERLET}; Hairer, Lubich, Wanner, Acta Numerica 12 (2003) 399–450, doi:10.1017/S0962492902000144"
SUN = (
    "G. Sun, J. Comput. Math. 11 (1993) 365–372; L. O. Jay, SIAM J. Numer. Anal. 33 (1996) 368–387, doi:10.1137/0733019"
)
NYSTROM = (
    "E. J. Nyström, Acta Soc. Sci. Fennicae 50 (1925) 1–55; Hairer, Nørsett, Wanner, Solving Ordinary Differential "
    "Equations I (1993), §II.14, doi:10.1007/978-3-540-78862-1"
)
DEP = (
    "J. R. Dormand, M. E. A. El-Mikkawy, P. J. Prince, IMA J. Numer. Anal. 7 (1987) 235–250, doi:10.1093/imanum/7.2.235"
)
BETTIS = "D. G. Bettis, Celestial Mech. 8 (1973) 229–233, doi:10.1007/BF01231421"
FINE = "J. M. Fine, Computing 38 (1987) 281–297, doi:10.1007/BF02278707"
TAKAHASHI_IMADA = "M. Takahashi, M. Imada, J. Phys. Soc. Japan 53 (1984) 3765–3769, doi:10.1143/JPSJ.53.3765"
SIMPLIFIED = "E. Hairer, R. I. McLachlan, R. D. Skeel, ESAIM: M2AN 43 (2009) 631–644, doi:10.1051/m2an/2009019"
CHIN = "S. A. Chin, Phys. Lett. A 226 (1997) 344–348, doi:10.1016/S0375-9601(97)00003-0"


def _pair(p: Callable[..., RungeKutta], q: Callable[..., RungeKutta], **labels: Any) -> PartitionedRungeKutta:
    """The pair of methods of two builders; families have ``stages`` among the labels."""
    parts = {key: build(**labels | {"name": f"{labels['name']}, {key}"}) for key, build in (("p", p), ("q", q))}
    return PartitionedRungeKutta(parts, name=labels["name"], reference=labels["reference"])


EXPLICIT_EULER = partial(RungeKutta, [["0"]], ["1"])
IMPLICIT_EULER = partial(RungeKutta, [["1"]], ["1"])
# Both stages of the half-step part are at the midpoint; the stages of the other part are at the two end points.
HALF_STEP = partial(RungeKutta, [["1/2", "0"], ["1/2", "0"]], ["1/2", "1/2"])
END_POINTS = partial(RungeKutta, [["0", "0"], ["1/2", "1/2"]], ["1/2", "1/2"])


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
    MethodEntry("symplectic-euler-p", "partitioned", 1, 1,
        "implicit in p: p1 = p0 - h H_q(p1, q0), q1 = q0 + h H_p(p1, q0)", HLW,
        partial(_pair, IMPLICIT_EULER, EXPLICIT_EULER), title="symplectic Euler (implicit p)"),
    MethodEntry("symplectic-euler-q", "partitioned", 1, 1,
        "implicit in q: p1 = p0 - h H_q(p0, q1), q1 = q0 + h H_p(p0, q1)", HLW,
        partial(_pair, EXPLICIT_EULER, IMPLICIT_EULER), title="symplectic Euler (implicit q)"),
    MethodEntry("stormer-verlet-kdk", "partitioned", 2, 2,
        "kick-drift-kick: half a step in p, a step in q, half a step in p; lobatto-iiia-iiib2", STORMER_VERLET,
        partial(_pair, HALF_STEP, END_POINTS), ("stormer-verlet", "velocity-verlet", "leapfrog", "UTU"),
        title="Störmer–Verlet (KDK)"),
    MethodEntry("stormer-verlet-dkd", "partitioned", 2, 2,
        "drift-kick-drift: half a step in q, a step in p, half a step in q; lobatto-iiib-iiia2", STORMER_VERLET,
        partial(_pair, END_POINTS, HALF_STEP), ("position-verlet", "TUT"), title="Störmer–Verlet (DKD)"),
    MethodEntry("lobatto-iiia-iiib", "partitioned", None, "2s-2",
        "q by Lobatto IIIA and p by Lobatto IIIB, so that two stages are stormer-verlet-kdk", SUN,
        partial(_pair, lobatto_iiib, lobatto_iiia), least_stages=2, title="Lobatto IIIA–IIIB"),
    MethodEntry("lobatto-iiib-iiia", "partitioned", None, "2s-2",
        "q by Lobatto IIIB and p by Lobatto IIIA, so that two stages are stormer-verlet-dkd", SUN,
        partial(_pair, lobatto_iiia, lobatto_iiib), least_stages=2, title="Lobatto IIIB–IIIA"),
    MethodEntry("gauss-gauss", "partitioned", None, "2s",
        "p and q by the same Gauss method, which is its own symplectic conjugate", HLW, partial(_pair, gauss, gauss),
        aliases=("partitioned-gauss", "gauss-pair"), title="Gauss–Gauss"),
    MethodEntry("rkn-verlet", "nystrom", 2, 2, "the Störmer-Verlet method for q'' = g(q), as a Nyström method", VERLET,
        _nystrom(("", "1/2"), "1/2 0", "1/2 1/2", "0 1"), ("nystrom-verlet",), title="RKN Verlet"),
    MethodEntry("rkn-nystrom4", "nystrom", 3, 4, "Nyström's method of order 4 for q'' = g(q)", NYSTROM,
        _nystrom(("", "1/8", "0 1/2"), "1/6 1/3 0", "1/6 2/3 1/6", "0 1/2 1"), title="RKN Nyström 4"),
    MethodEntry("rkn-nystrom5", "nystrom", 4, 5, "Nyström's method of order 5 for q'' = g(q)", NYSTROM,
        _nystrom(("", "1/50", "-1/27 7/27", "3/10 -2/35 9/35"), "14/336 100/336 54/336 0",
            "14/336 125/336 162/336 35/336", "0 1/5 2/3 1"), title="RKN Nyström 5"),
    MethodEntry("rkn-nystrom4-general", "nystrom", 4, 4,
        "Nyström's method of order 4 for q'' = g(q, q'), with the nodes and weights of rk4", NYSTROM,
        _nystrom(("", "1/8", "1/8 0", "0 0 1/2"), "1/6 1/6 1/6 0", "1/6 1/3 1/3 1/6", "0 1/2 1/2 1",
            ("", "1/2", "0 1/2", "0 0 1")), title="RKN Nyström 4 general"),
    MethodEntry("rkn-dormand-prince4", "nystrom", 4, 4, "four stages; the last position is that of the next step", DEP,
        _nystrom(("", "1/32", "7/1000 119/500", "1/14 8/27 25/189"), "1/14 8/27 25/189 0", "1/14 32/81 250/567 5/54",
            "0 1/4 7/10 1"), title="RKN Dormand–Prince 4"),
    MethodEntry("rkn-bettis5", "nystrom", 6, 5, "six stages; the last position is that of the next step", BETTIS,
        _nystrom(("", "1/128", "1/96 1/48", "1/24 0 1/12", "9/128 0 9/64 9/128", "7/90 0 4/15 1/15 4/45"),
            "7/90 0 4/15 1/15 4/45 0", "7/90 0 16/45 2/15 16/45 7/90", "0 1/8 1/4 1/2 3/4 1"), title="RKN Bettis 5"),
    MethodEntry("rkn-dormand-prince6", "nystrom", 6, 6, "six stages; the last position is that of the next step", DEP,
        _nystrom(("", "1/200", "-1/2200 1/22", "637/6600 -7/110 7/33",
             "225437/1968750 -30073/281250 65569/281250 -9367/984375",
             "151/2142 5/116 385/1368 55/168 -6250/28101"), "151/2142 5/116 385/1368 55/168 -6250/28101 0",
            "151/2142 25/522 275/684 275/252 -78125/112404 1/12", "0 1/10 3/10 7/10 17/25 1"),
        title="RKN Dormand–Prince 6"),
    MethodEntry("rkn-fine4-general", "nystrom", 5, 4, "for q'' = g(q, q')", FINE,
        _nystrom(("", "2/81", "1/36 1/36", "9/128 0 27/128", "11/60 -3/20 9/25 8/75"), "19/180 0 63/200 16/225 1/120",
            "1/9 0 9/20 16/45 1/12", "0 2/9 1/3 3/4 1",
            ("", "2/9", "1/12 1/4", "69/128 -243/128 135/64", "-17/12 27/4 -27/5 16/15")), title="RKN Fine 4 general"),
    MethodEntry("rkn-fine5-general", "nystrom", 7, 5,
        "for q'' = g(q, q'); the last stage is the first of the next step", FINE,
        _nystrom(("", "32/1521", "4/169 4/169", "175/5184 0 1625/5184",
             "-342497279/5618900760 6827067/46824173 35048741/102161832 -2201514/234120865",
             "-7079/52152 767/2173 14027/52152 30/2173", "4817/51600 0 388869/1216880 3276/23575 -1142053/22015140"),
            "4817/51600 0 388869/1216880 3276/23575 -1142053/22015140 0 0",
            "4817/51600 0 1685099/3650640 19656/23575 -53676491/88060560 53/240 0", "0 8/39 4/13 5/6 43/47 1 1",
            ("", "8/39", "1/13 3/13", "7385/6912 -9425/2304 13325/3456",
             "223324757/91364240 -174255393/18272848 382840094/46824173 -39627252/234120865",
             "108475/36464 -9633/848 7624604/806183 8100/49979 -4568212/19446707",
             "4817/51600 0 1685099/3650640 19656/23575 -53676491/88060560 53/240")), title="RKN Fine 5 general"),
    MethodEntry("takahashi-imada", "force gradient", 2, 2,
        "Störmer-Verlet with the force f + alpha h^2 f' f, alpha = 1/12: symplectic, conjugate to a method of order 4",
        TAKAHASHI_IMADA, TakahashiImada, options=("alpha",), title="Takahashi–Imada"),
    MethodEntry("simplified-takahashi-imada", "force gradient", 2, 2,
        "Störmer-Verlet with the force f(q + alpha h^2 f(q)), alpha = 1/12: preserves volume, not symplectic",
        SIMPLIFIED, partial(TakahashiImada, simplified=True), options=("alpha",), title="simplified Takahashi–Imada"),
    MethodEntry("chin4a", "force gradient", 3, 4,
        "kicks h/6, 2h/3, h/6, the one in the middle with its gradient; no step backwards in time", CHIN,
        _force_gradient("0 1/2 1/2 0", "1/6 2/3 1/6", "0 1/36 0"), title="Chin 4A"),
    MethodEntry("chin4b", "force gradient", 2, 4, "two kicks h/2 with gradients; no step backwards in time", CHIN,
        _force_gradient("1/2-sqrt(3)/6 sqrt(3)/3 1/2-sqrt(3)/6", "1/2 1/2", "1/12-sqrt(3)/24 1/12-sqrt(3)/24"),
        title="Chin 4B"),
    MethodEntry("chin4c", "force gradient", 3, 4,
        "kicks 3h/8, h/4, 3h/8, the one in the middle with its gradient; no step backwards in time, small errors", CHIN,
        _force_gradient("1/6 1/3 1/3 1/6", "3/8 1/4 3/8", "0 1/96 0"), title="Chin 4C"),
)  # fmt: skip
