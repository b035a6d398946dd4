"""Rosenbrock methods and W-methods."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from integrators.exact.entries import Entry
from integrators.methods.catalogue.registry import MethodEntry, lower_rows
from integrators.methods.kinds.extended_runge_kutta import Rosenbrock, WMethod

HW = "Hairer, Wanner, Solving Ordinary Differential Equations II (1996), §IV.7, doi:10.1007/978-3-642-05221-7"
KAPS_RENTROP = "P. Kaps, P. Rentrop, Numer. Math. 33 (1979) 55–68, doi:10.1007/BF01396495"


def _given(
    alpha: tuple[str, ...], gamma: tuple[str, ...], weights: str, digits: int | None = None, *, exact: bool = True
) -> Callable[..., Rosenbrock]:
    """Builder of a method from α, γ and b; a W-method unless its Jacobian must be `exact`."""
    matrices = lower_rows(alpha, len(alpha)), lower_rows(gamma, len(alpha))
    return partial(Rosenbrock if exact else WMethod, *matrices, weights.split(), digits=digits)


def _transformed(
    a: tuple[str, ...], c: tuple[str, ...], weights: str, gamma: str, digits: int | None = None
) -> Callable[..., Rosenbrock]:
    """Builder of a method from the coefficients of its implementation."""
    matrices = lower_rows(a, len(a)), lower_rows(c, len(a))
    return partial(Rosenbrock.from_transformed, *matrices, weights.split(), gamma, digits=digits)


def _ros2(kind: type[Rosenbrock], *, gamma: Entry, **labels: Any) -> Rosenbrock:
    return kind([[0, 0], [1, 0]], [[gamma, 0], [-2 * gamma, gamma]], ["1/2", "1/2"], **labels)


METHODS = (
    MethodEntry("rosenbrock-euler", "rosenbrock", 1, 1, "the linearly implicit Euler method", HW,
        _given(("0",), ("1",), "1"), ("linearly-implicit-euler",), title="Rosenbrock–Euler"),
    MethodEntry("ros2", "rosenbrock", 2, 2, "order 2 for every gamma, L-stable for gamma = 1 ± sqrt(2)/2",
        "J. G. Verwer, E. J. Spee, J. G. Blom, W. Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456–1480, "
        "doi:10.1137/S1064827597326651",
        partial(_ros2, Rosenbrock), parameters=("gamma",), title="ROS2"),
    MethodEntry("ros3p", "rosenbrock", 3, 3, "A-stable method of order 3 for parabolic problems",
        "J. Lang, J. Verwer, BIT 41 (2001) 731–738, doi:10.1023/A:1021900219772",
        _given(("0", "1 0", "1 0 0"),
            ("1/2+sqrt(3)/6", "-1 1/2+sqrt(3)/6", "-1/2-sqrt(3)/6 -1/2-sqrt(3)/3 1/2+sqrt(3)/6"), "2/3 0 1/3"),
        title="ROS3P"),
    MethodEntry("rodas3", "rosenbrock", 4, 3, "stiffly accurate, L-stable method of order 3 with rational coefficients",
        "A. Sandu, J. G. Verwer, J. G. Blom, E. J. Spee, G. R. Carmichael, F. A. Potra, Atmos. Environ. 31 (1997) "
        "3459–3472, doi:10.1016/S1352-2310(97)83212-8",
        _transformed(("", "0", "2 0", "2 0 1"), ("", "4", "1 -1", "1 -1 -8/3"), "2 0 1 1", "1/2"), title="RODAS3"),
    MethodEntry("grk4a", "rosenbrock", 4, 4, "A-stable method of order 4 of Kaps and Rentrop, gamma = 0.395",
        KAPS_RENTROP,
        _given(("", "0.438", "0.796920457938 0.0730795420615", "0.796920457938 0.0730795420615"),
            ("0.395",
             "-0.767672395484 0.395",
             "-0.851675323742 0.522967289188 0.395",
             "0.288463109545 0.0880214273381 -0.337389840627 0.395"),
            "0.199293275701 0.482645235674 0.0680614886256 0.25", 12), title="GRK4A"),
    MethodEntry("grk4t", "rosenbrock", 4, 4, "method of order 4 of Kaps and Rentrop with small errors, gamma = 0.231",
        KAPS_RENTROP,
        _given(("", "0.462", "-0.0815668168327 0.961775150166", "-0.0815668168327 0.961775150166"),
            ("0.231",
             "-0.270629667752 0.231",
             "0.311254483294 0.00852445628482 0.231",
             "0.282816832044 -0.457959483281 -0.111208333333 0.231"),
            "0.217487371653 0.486229037990 0 0.296283590357", 12), title="GRK4T"),
    MethodEntry("rosenbrock-shampine4", "rosenbrock", 4, 4,
        "A-stable method of order 4 with rational coefficients, gamma = 1/2",
        "L. F. Shampine, ACM Trans. Math. Softw. 8 (1982) 93–113, doi:10.1145/355993.355994",
        _transformed(("", "2", "48/25 6/25", "48/25 6/25"), ("", "-8", "372/25 12/5", "-112/125 -54/125 -2/5"),
            "19/9 1/2 25/108 125/108", "1/2"), title="Rosenbrock–Shampine 4"),
    MethodEntry("rodas4", "rosenbrock", 6, 4,
        "stiffly accurate, L-stable method of order 4, as 16-digit decimals of the code RODAS",
        f"{HW} and the code rodas.f",
        _transformed(
            ("",
             "1.544",
             "0.9466785280815826 0.2557011698983284",
             "3.314825187068521 2.896124015972201 0.9986419139977817",
             "1.221224509226641 6.019134481288629 12.53708332932087 -0.6878860361058950",
             "1.221224509226641 6.019134481288629 12.53708332932087 -0.6878860361058950 1"),
            ("",
             "-5.6688",
             "-2.430093356833875 -0.2063599157091915",
             "-0.1073529058151375 -9.594562251023355 -20.47028614809616",
             "7.496443313967647 -10.24680431464352 -33.99990352819905 11.70890893206160",
             "8.083246795921522 -7.981132988064893 -31.52159432874371 16.31930543123136 -6.058818238834054"),
            "1.221224509226641 6.019134481288629 12.53708332932087 -0.6878860361058950 1 1", "1/4", 14),
        title="RODAS4"),
    MethodEntry("ros2-w", "w-method", 2, 2, "ros2 with any matrix in place of the Jacobian: still of order 2",
        "J. G. Verwer, E. J. Spee, J. G. Blom, W. Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456–1480, "
        "doi:10.1137/S1064827597326651",
        partial(_ros2, WMethod), parameters=("gamma",), title="ROS2 W"),
    MethodEntry("ros34pw2", "w-method", 4, 3, "stiffly accurate W-method of order 3 of Rang and Angermann",
        "J. Rang, L. Angermann, BIT 45 (2005) 761–787, doi:10.1007/s10543-005-0035-y",
        _given(("", "0.87173304301691799883", "0.84457060015369423918 -0.11299064236484185325", "0 0 1"),
            ("0.43586652150845899942",
             "-0.87173304301691799883 0.43586652150845899942",
             "-0.90338057013044082229 0.054180672388095326136 0.43586652150845899942",
             "0.24212380706095346380 -1.2232505839045147162 0.54526025533510214102 0.43586652150845899942"),
            "0.24212380706095346380 -1.2232505839045147162 1.5452602553351021410 0.43586652150845899942", 16,
            exact=False), title="ROS34PW2"),
)  # fmt: skip
