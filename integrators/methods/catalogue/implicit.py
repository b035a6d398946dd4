"""Implicit Runge–Kutta methods: Gauss, Radau and Lobatto families, Kahan's method, diagonally implicit methods.

The families are computed from their defining conditions. The nodes c_1 … c_s are the roots of a polynomial P with
rational coefficients; the roots are not computed. A stage vector is represented by the polynomial of degree < s with
these values at the nodes. The matrix A acts on 1, x, …, x^(s−1) modulo P, and the weights act as
b[x^l] = Σ b_i c_i^l, in rational numbers only.

Three constructions give all families (Hairer & Wanner, Solving Ordinary Differential Equations II, §IV.5):

- *Collocation*, condition C(s): A x^l = x^(l+1)/(l+1).
- *Symplectic conjugate*: b_i â_ij + b_j a_ji = b_i b_j. It exchanges C(s) and D(s) for quadratures of order at least s
  (Hairer, Lubich, Wanner, Geometric Numerical Integration, §VI.4).
- Lobatto IIIC: C(s−1) and a_i1 = b_1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from math import comb

from integrators.core.errors import IntegratorError
from integrators.exact.entries import Entry, cancels
from integrators.exact.polynomials import Matrix, Polynomial, add, matrix_rows, scale, to_flint_matrix
from integrators.methods.catalogue.registry import MethodEntry, lower_rows
from integrators.methods.tableaux.runge_kutta import RungeKutta
from integrators.methods.tableaux.stage_algebra import StageAlgebra, gram_matrix

BUTCHER = "J. C. Butcher, Math. Comp. 18 (1964) 50–64, doi:10.1090/S0025-5718-1964-0159424-9"
EHLE = "B. L. Ehle, PhD thesis, University of Waterloo (1969)"
CHIPMAN = "F. H. Chipman, BIT 11 (1971) 384–388, doi:10.1007/BF01939406"
JAY = (
    "L. O. Jay, Lobatto methods, Encyclopedia of Applied and Computational Mathematics (2015) 817–826, "
    "doi:10.1007/978-3-540-70529-1_123"
)
STIFF = "Hairer, Wanner, Solving Ordinary Differential Equations II, §IV.5, doi:10.1007/978-3-642-05221-7"


KENNEDY_CARPENTER = "C. A. Kennedy, M. H. Carpenter, NASA/TM-2016-219173 (2016)"
ESDIRK32 = "(-1181+1187*sqrt(2))/2835 (-1181+1187*sqrt(2))/2835 2374*(1-sqrt(2))/2835 5827/7560 9/40"
ESDIRK43 = (
    "(1181-987*sqrt(2))/13782 (1181-987*sqrt(2))/13782 47*(-267+1783*sqrt(2))/273343 (366752-56400*sqrt(2))/571953 "
    "-15625*(97+376*sqrt(2))/90749876 1/4"
)
"""The last rows of two methods, which are their weights."""
WSO643 = (
    "0.079672377876931",
    "0.328355391763968 0.136009256546967",
    "-0.650772774016417 1.742859063495349 0.256472952467792",
    "-0.714580550967259 1.793745752775934 -0.078254785672497 0.311753794172585",
    "-1.120092779092918 1.983452339867353 3.117393885836001 -3.761930177913743 0.770646024799205",
    "0.214823667785537 0.536367363903245 0.154488125726409 -0.217748592703941 0.072226422925896 0.239843012362853",
)
"""The rows of the matrix; the last one is that of the weights."""


def legendre(degree: int) -> Polynomial:
    """The Legendre polynomial of a degree, shifted to [0, 1], by Rodrigues' formula."""
    return tuple(Fraction((-1) ** (degree - k) * comb(degree, k) * comb(degree + k, k)) for k in range(degree + 1))


def _nodes(difference: int, sign: int, stages: int) -> Polynomial:
    """The monic multiple of P_s + sign · P_(s − difference), whose roots are the nodes of s stages."""
    p = add(legendre(stages), scale(legendre(stages - difference), sign))
    return scale(p, 1 / p[-1])


gauss_nodes = partial(_nodes, 0, 0)
radau_left_nodes = partial(_nodes, 1, 1)  # c_1 = 0
radau_right_nodes = partial(_nodes, 1, -1)  # c_s = 1
lobatto_nodes = partial(_nodes, 2, -1)  # c_1 = 0 and c_s = 1


def quadrature(nodes: Polynomial) -> tuple[Fraction, ...]:
    """The moments b[x^l], l < s, of the interpolatory quadrature on [0, 1]."""
    return tuple(Fraction(1, degree + 1) for degree in range(len(nodes) - 1))


def collocation(nodes: Polynomial) -> Matrix:
    """The matrix defined by C(s): A x^l = x^(l+1)/(l+1), with x^s reduced modulo P."""
    stages = len(nodes) - 1
    columns = [[Fraction(int(k == degree), degree) for k in range(stages)] for degree in range(1, stages)]
    columns.append([-a / stages for a in nodes[:-1]])
    return tuple(zip(*columns, strict=True))


def conjugate(nodes: Polynomial, matrix: Matrix) -> Matrix:
    """The symplectic conjugate Â = 1·b − A*, where A* is the adjoint of A in the form b[f·g] = Σ b_i f(c_i) g(c_i)."""
    weights = quadrature(nodes)
    gram = gram_matrix(nodes, weights)
    # b[f·A g] has the matrix gram·A, so gram·A* is its transpose.
    adjoint = gram.solve((gram * to_flint_matrix(matrix)).transpose())
    constants = to_flint_matrix([weights, *[[0] * len(weights)] * (len(weights) - 1)])
    return matrix_rows(constants - adjoint)


def lobatto_c(nodes: Polynomial) -> Matrix:
    """The matrix of Lobatto IIIC: C(s−1), and a_i1 = b_1 for every i.

    The polynomial L = P/x, scaled to L(0) = 1, is 1 at c_1 and 0 at the other nodes. The second condition is therefore
    A L = b[L], which gives A x^(s−1) from A x^l for l < s−1.
    """
    stages = len(nodes) - 1
    *lower, leading = scale(nodes[1:], 1 / nodes[1])
    weight = sum((a * m for a, m in zip((*lower, leading), quadrature(nodes), strict=True)), Fraction(0))
    last = [weight, *(-a / (degree + 1) for degree, a in enumerate(lower))]
    rows = [list(row) for row in collocation(nodes)]
    for row, value in zip(rows, last, strict=True):
        row[stages - 1] = value / leading
    return tuple(map(tuple, rows))


def average(left: Matrix, right: Matrix) -> Matrix:
    """The mean of two matrices."""
    return matrix_rows((to_flint_matrix(left) + to_flint_matrix(right)) / 2)


def conjugate_collocation(nodes: Polynomial) -> Matrix:
    """The matrix defined by D(s), the conjugate of collocation: Radau IA and Lobatto IIIB."""
    return conjugate(nodes, collocation(nodes))


def lobatto_d(nodes: Polynomial) -> Matrix:
    """The matrix of Lobatto IIID: the mean of Lobatto IIIC and its conjugate."""
    matrix = lobatto_c(nodes)
    return average(matrix, conjugate(nodes, matrix))


def lobatto_e(nodes: Polynomial) -> Matrix:
    """The matrix of Lobatto IIIE: the mean of Lobatto IIIA and IIIB."""
    return average(collocation(nodes), conjugate_collocation(nodes))


def family(
    nodes: Callable[[int], Polynomial], matrix: Callable[[Polynomial], Matrix], *, stages: int, **labels: str
) -> RungeKutta:
    """The method with a number of stages from the nodes of its family and the construction of its matrix."""
    polynomial = nodes(stages)
    algebra = StageAlgebra(polynomial, matrix(polynomial), quadrature(polynomial))
    return RungeKutta.from_algebra(algebra, **labels)


lobatto_iiia = partial(family, lobatto_nodes, collocation)
lobatto_iiib = partial(family, lobatto_nodes, conjugate_collocation)
gauss = partial(family, gauss_nodes, collocation)


def _lobatto(letter: str, description: str, reference: str, build: Callable[..., RungeKutta]) -> MethodEntry:
    name = f"lobatto-iii{letter}"
    title = f"Lobatto III{letter.upper()}"
    return MethodEntry(name, "implicit", None, "2s-2", description, reference, build, least_stages=2, title=title)


KAHAN = (
    "W. Kahan, lecture notes, Toronto (1993); E. Celledoni, R. I. McLachlan, B. Owren, G. R. W. Quispel, J. Phys. A 46 "
    "(2013) 025201, doi:10.1088/1751-8113/46/2/025201"
)
_KAHAN_ROWS = [["0", "0", "0"], ["-1/4", "1", "-1/4"], ["-1/2", "2", "-1/2"]]
HALF = Fraction(1, 2)
HLW = "Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), §II.1.1, doi:10.1007/3-540-30666-8"
NORSETT = (
    "S. P. Nørsett, Math. and Comp. 6/74, Trondheim (1974); Hairer, Nørsett, Wanner, "
    "Solving Ordinary Differential Equations I, Table II.7.2, doi:10.1007/978-3-540-78862-1"
)
_CROUZEIX4_ROWS = [
    ["1/2 + cos(pi/18)/sqrt(3)", "0", "0"],
    ["-cos(pi/18)/sqrt(3)", "1/2 + cos(pi/18)/sqrt(3)", "0"],
    ["1 + 2*cos(pi/18)/sqrt(3)", "-1 - 4*cos(pi/18)/sqrt(3)", "1/2 + cos(pi/18)/sqrt(3)"],
]
_CROUZEIX4_WEIGHTS = ["1/(8*cos(pi/18)^2)", "1 - 1/(4*cos(pi/18)^2)", "1/(8*cos(pi/18)^2)"]


def _entry(
    name: str,
    order: int,
    A: Sequence[Sequence[object]],
    b: Sequence[object],
    *texts: str,
    aliases: tuple[str, ...] = (),
    title: str = "",
    digits: int | None = None,
) -> MethodEntry:
    """Entry of a diagonally implicit method from its tableau, description and reference."""
    description, reference = texts
    build = partial(RungeKutta, A, b, digits=digits)
    return MethodEntry(name, "diagonally implicit", len(A), order, description, reference, build, aliases, title=title)


def _sdirk2(*, name: str, reference: str, gamma: Entry) -> RungeKutta:
    """Nodes γ and 1−γ with equal weights: order 2 for every γ, and order 3 if γ² − γ + 1/6 = 0."""
    return RungeKutta([[gamma, 0], [1 - 2 * gamma, gamma]], [HALF, HALF], name=name, reference=reference)


def _sdirk2_general(*, name: str, reference: str, gamma: Entry, c2: Entry) -> RungeKutta:
    """Nodes γ and c2; the weights follow from Σ b_i = 1 and Σ b_i c_i = 1/2."""
    if cancels([gamma, -c2], 0):
        raise IntegratorError(
            f"parameters gamma and c2 of sdirk2-general must differ, but were {gamma!s:.60} and {c2!s:.60}"
        )
    last = (HALF - gamma) / (c2 - gamma)
    return RungeKutta([[gamma, 0], [c2 - gamma, gamma]], [1 - last, last], name=name, reference=reference)


METHODS = (
    MethodEntry("kahan", "implicit", 3, 2,
        "(y1 - y0)/h = 2 f((y0+y1)/2) - f(y0)/2 - f(y1)/2: Kahan's linearly implicit method if f is quadratic", KAHAN,
        partial(RungeKutta, _KAHAN_ROWS, _KAHAN_ROWS[2]), title="Kahan"),
    MethodEntry("gauss", "implicit", None, "2s", "collocation at the Gauss nodes", BUTCHER, gauss,
        aliases=("gauss-legendre",), title="Gauss"),
    MethodEntry("radau-ia", "implicit", None, "2s-1", "D(s) at the left Radau nodes", f"{EHLE}; {STIFF}",
        partial(family, radau_left_nodes, conjugate_collocation), title="Radau IA"),
    MethodEntry("radau-iia", "implicit", None, "2s-1", "collocation at the right Radau nodes", f"{EHLE}; {STIFF}",
        partial(family, radau_right_nodes, collocation), title="Radau IIA"),
    _lobatto("a", "collocation at the Lobatto nodes", f"{EHLE}; {STIFF}", lobatto_iiia),
    _lobatto("b", "D(s) at the Lobatto nodes, the conjugate of IIIA", f"{EHLE}; {STIFF}", lobatto_iiib),
    _lobatto("c", "C(s-1) and a_i1 = b_1", f"{CHIPMAN}; {STIFF}", partial(family, lobatto_nodes, lobatto_c)),
    _lobatto("d", "mean of IIIC and its conjugate, symplectic", JAY, partial(family, lobatto_nodes, lobatto_d)),
    _lobatto("e", "mean of IIIA and IIIB, symplectic", JAY, partial(family, lobatto_nodes, lobatto_e)),
    _entry("implicit-euler", 1, [["1"]], ["1"], "Euler's implicit method", HLW, aliases=("backward-euler",),
        title="implicit Euler"),
    _entry("implicit-midpoint", 2, [["1/2"]], ["1"], "the implicit midpoint rule, symplectic and symmetric", HLW,
        title="implicit midpoint"),
    _entry("trapezoidal", 2, [["0", "0"], ["1/2", "1/2"]], ["1/2", "1/2"],
        "the implicit trapezoidal rule, symmetric and conjugate to the midpoint rule", HLW,
        aliases=("crank-nicolson", "implicit-trapezoidal")),
    _entry("crouzeix3", 3, [["1/2+sqrt(3)/6", "0"], ["-sqrt(3)/3", "1/2+sqrt(3)/6"]], ["1/2", "1/2"],
        "A-stable method of order 3 with two stages: sdirk2 with gamma = 1/2 + sqrt(3)/6",
        f"M. Crouzeix, thesis, Paris (1975); {NORSETT}", aliases=("crouzeix",), title="Crouzeix 3"),
    _entry("crouzeix4", 4, _CROUZEIX4_ROWS, _CROUZEIX4_WEIGHTS,
        "A-stable method of order 4 with three stages and the diagonal 1/2 + cos(pi/18)/sqrt(3)",
        f"M. Crouzeix, thesis, Paris (1975); {NORSETT}", title="Crouzeix 4"),
    _entry("qin-zhang", 2, [["1/4", "0"], ["1/2", "1/4"]], ["1/2", "1/2"],
        "two implicit midpoint steps of half the length, symplectic: sdirk2 with gamma = 1/4",
        "M.-Z. Qin, M.-Q. Zhang, J. Comput. Math. Suppl. (1992) 205–215", title="Qin–Zhang"),
    _entry("wso-dirk643", 4,
        lower_rows(WSO643, 6), WSO643[-1].split(),
        "stiffly accurate, with weak stage order 3: linear problems have order 4 however stiff they are",
        "D. I. Ketcheson, B. Seibold, D. Shirokoff, D. Zhou, arXiv:1811.01285 (2018)", digits=15,
        title="weak stage order (6,4,3)"),
    _entry("kennedy-carpenter-esdirk32", 3,
        lower_rows(
            ("", "9/40 9/40", "(9+9*sqrt(2))/80 (9+9*sqrt(2))/80 9/40",
             "(8+7*sqrt(2))/80 (8+7*sqrt(2))/80 (7-7*sqrt(2))/40 9/40", ESDIRK32), 5),
        ESDIRK32.split(), "stiffly accurate and L-stable, with stage order 2; ESDIRK3(2)5L[2]SA", KENNEDY_CARPENTER,
        title="ESDIRK3(2)5L[2]SA"),
    _entry("kennedy-carpenter-esdirk43", 4,
        lower_rows(
            ("", "1/4 1/4", "(1-sqrt(2))/8 (1-sqrt(2))/8 1/4",
             "(5-7*sqrt(2))/64 (5-7*sqrt(2))/64 7*(1+sqrt(2))/32 1/4",
             "(-13796-54539*sqrt(2))/125000 (-13796-54539*sqrt(2))/125000 (506605+132109*sqrt(2))/437500 "
             "166*(-97+376*sqrt(2))/109375 1/4", ESDIRK43), 6),
        ESDIRK43.split(), "stiffly accurate and L-stable, with stage order 2; ESDIRK4(3)6L[2]SA", KENNEDY_CARPENTER,
        title="ESDIRK4(3)6L[2]SA"),
    MethodEntry("sdirk2", "diagonally implicit", 2, 2,
        "singly diagonally implicit with nodes gamma and 1 - gamma; order 3 for gamma = 1/2 ± sqrt(3)/6", NORSETT,
        _sdirk2, parameters=("gamma",), title="SDIRK2"),
    MethodEntry("sdirk2-general", "diagonally implicit", 2, 2,
        "all singly diagonally implicit methods of order 2 with two stages and nodes gamma and c2", NORSETT,
        _sdirk2_general, parameters=("gamma", "c2"), title="SDIRK2 general"),
)  # fmt: skip
