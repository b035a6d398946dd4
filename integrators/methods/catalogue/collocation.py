"""Gauss, Radau and Lobatto methods with any number of stages, computed from their defining conditions.

The nodes c_1 … c_s are the roots of a polynomial P with rational coefficients; the roots are not computed. A stage
vector is represented by the polynomial of degree < s with these values at the nodes. The matrix A acts on
1, x, …, x^(s−1) modulo P, and the weights act as b[x^l] = Σ b_i c_i^l, in rational numbers only.

Three constructions give all families (Hairer & Wanner, Solving Ordinary Differential Equations II, §IV.5):

- *Collocation*, condition C(s): A x^l = x^(l+1)/(l+1).
- *Symplectic conjugate*: b_i â_ij + b_j a_ji = b_i b_j. It exchanges C(s) and D(s) for quadratures of order at least s
  (Hairer, Lubich, Wanner, Geometric Numerical Integration, §VI.4).
- Lobatto IIIC: C(s−1) and a_i1 = b_1.
"""

from __future__ import annotations

from fractions import Fraction
from math import comb
from typing import TYPE_CHECKING

from integrators.exact.polynomials import Matrix, Polynomial, add, scale, solve
from integrators.methods.catalogue.entry import MethodEntry

if TYPE_CHECKING:
    from collections.abc import Callable

    from integrators.methods.tableaux.runge_kutta import RungeKutta

BUTCHER = "J. C. Butcher, Math. Comp. 18 (1964) 50–64, doi:10.1090/S0025-5718-1964-0159424-9"
EHLE = "B. L. Ehle, PhD thesis, University of Waterloo (1969)"
CHIPMAN = "F. H. Chipman, BIT 11 (1971) 384–388, doi:10.1007/BF01939406"
JAY = (
    "L. O. Jay, Lobatto methods, Encyclopedia of Applied and Computational Mathematics (2015) 817–826, "
    "doi:10.1007/978-3-540-70529-1_123"
)
STIFF = "Hairer, Wanner, Solving Ordinary Differential Equations II, §IV.5, doi:10.1007/978-3-642-05221-7"


def legendre(degree: int) -> Polynomial:
    """The Legendre polynomial of a degree, shifted to [0, 1], by Rodrigues' formula.

    Example:
        >>> [str(a) for a in legendre(2)]
        ['1', '-6', '6']
    """
    return tuple(Fraction((-1) ** (degree - k) * comb(degree, k) * comb(degree + k, k)) for k in range(degree + 1))


def gauss_nodes(stages: int) -> Polynomial:
    """The monic polynomial whose roots are the Gauss nodes."""
    return _monic(legendre(stages))


def radau_left_nodes(stages: int) -> Polynomial:
    """The monic polynomial whose roots are the Radau nodes with c_1 = 0."""
    return _monic(add(legendre(stages), legendre(stages - 1)))


def radau_right_nodes(stages: int) -> Polynomial:
    """The monic polynomial whose roots are the Radau nodes with c_s = 1."""
    return _monic(add(legendre(stages), scale(legendre(stages - 1), -1)))


def lobatto_nodes(stages: int) -> Polynomial:
    """The monic polynomial whose roots are the Lobatto nodes, with c_1 = 0 and c_s = 1."""
    return _monic(add(legendre(stages), scale(legendre(stages - 2), -1)))


def _monic(p: Polynomial) -> Polynomial:
    return scale(p, 1 / p[-1])


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
    stages = len(nodes) - 1
    moments = [*quadrature(nodes)]
    for degree in range(stages, 2 * stages - 1):
        reduced = (a * moments[degree - stages + k] for k, a in enumerate(nodes[:-1]))
        moments.append(-sum(reduced, Fraction(0)))
    gram = [moments[k : k + stages] for k in range(stages)]
    # b[f·A g] has the matrix gram·A, so gram·A* is its transpose.
    transposed = [
        [sum((gram[row][k] * matrix[k][column] for k in range(stages)), Fraction(0)) for row in range(stages)]
        for column in range(stages)
    ]
    first, *others = solve(gram, transposed)
    constants = tuple(m - a for m, a in zip(gram[0], first, strict=True))
    return (constants, *(tuple(-a for a in row) for row in others))


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
    return tuple(tuple((a + b) / 2 for a, b in zip(*rows, strict=True)) for rows in zip(left, right, strict=True))


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


def build_family(
    nodes: Callable[[int], Polynomial], matrix: Callable[[Polynomial], Matrix]
) -> Callable[..., RungeKutta]:
    """Builder of a family from its nodes and the construction of its matrix."""

    def build(*, name: str, reference: str, stages: int) -> RungeKutta:
        from integrators.methods.tableaux.runge_kutta import RungeKutta
        from integrators.methods.tableaux.stage_algebra import StageAlgebra

        polynomial = nodes(stages)
        algebra = StageAlgebra(polynomial, matrix(polynomial), quadrature(polynomial))
        return RungeKutta.from_algebra(algebra, name=name, reference=reference)

    return build


lobatto_iiia = build_family(lobatto_nodes, collocation)
lobatto_iiib = build_family(lobatto_nodes, conjugate_collocation)
gauss = build_family(gauss_nodes, collocation)


def _lobatto(letter: str, description: str, reference: str, build: Callable[..., RungeKutta]) -> MethodEntry:
    name = f"lobatto-iii{letter}"
    return MethodEntry(name, "implicit", None, "2s-2", description, reference, build, least_stages=2)


METHODS = (
    MethodEntry(
        "gauss", "implicit", None, "2s", "collocation at the Gauss nodes", BUTCHER, gauss, aliases=("gauss-legendre",)
    ),
    MethodEntry(
        "radau-ia",
        "implicit",
        None,
        "2s-1",
        "D(s) at the left Radau nodes",
        f"{EHLE}; {STIFF}",
        build_family(radau_left_nodes, conjugate_collocation),
    ),
    MethodEntry(
        "radau-iia",
        "implicit",
        None,
        "2s-1",
        "collocation at the right Radau nodes",
        f"{EHLE}; {STIFF}",
        build_family(radau_right_nodes, collocation),
    ),
    _lobatto("a", "collocation at the Lobatto nodes", f"{EHLE}; {STIFF}", lobatto_iiia),
    _lobatto("b", "D(s) at the Lobatto nodes, the conjugate of IIIA", f"{EHLE}; {STIFF}", lobatto_iiib),
    _lobatto("c", "C(s-1) and a_i1 = b_1", f"{CHIPMAN}; {STIFF}", build_family(lobatto_nodes, lobatto_c)),
    _lobatto("d", "mean of IIIC and its conjugate, symplectic", JAY, build_family(lobatto_nodes, lobatto_d)),
    _lobatto("e", "mean of IIIA and IIIB, symplectic", JAY, build_family(lobatto_nodes, lobatto_e)),
)
