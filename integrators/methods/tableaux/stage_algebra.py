"""Runge–Kutta methods on the roots of a rational polynomial, represented without the roots.

Stage values g(c_1), …, g(c_s) are represented by the interpolating polynomial g of degree < s, an element of Q[x]/(P)
with the node polynomial P. The stage matrix becomes a rational matrix in the basis 1, x, …, x^(s−1), the weights a
rational linear form, and every B-series coefficient is rational although the nodes are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from math import comb, lcm
from numbers import Rational
from typing import TYPE_CHECKING, Any

from bseries_base.errors import shorten, shown
from integrators.core.arguments import MOST_DIGITS, items, read_whole
from integrators.core.errors import IntegratorError
from integrators.core.immutable import ImmutableValue
from integrators.exact import polynomials
from integrators.exact.arithmetic import Exact, in_sympy, simplest
from integrators.exact.polynomials import Matrix, Polynomial, matrix_rows, to_flint_matrix

if TYPE_CHECKING:
    import sympy

MAX_STAGES = 100


class StageAlgebra(ImmutableValue):
    """A Runge–Kutta method on the roots c_1 < … < c_s of a rational polynomial, as rational data.

    Args:
        polynomial: the coefficients of 1, x, …, x^s in the node polynomial, monic, with s simple real roots.
        A: s × s; A[k][l] is the coefficient of x^k in A x^l, where A g interpolates the values Σ_j a_ij g(c_j).
        b: s numbers; b[l] = Σ_i b_i c_i^l.

    Raises:
        IntegratorError: sizes do not match, an entry is not rational, or a root is not real or not simple.

    Example:
        The implicit midpoint rule has the node 1/2, a_11 = 1/2 and b_1 = 1:

        >>> import bseries as bs
        >>> from fractions import Fraction
        >>> half = Fraction(1, 2)
        >>> bs.methods.StageAlgebra([-half, 1], [[half]], [1]).tableau_exact()
        (((Fraction(1, 2),),), (Fraction(1, 1),), (Fraction(1, 2),))

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.7 (collocation);
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, II.1.
    """

    polynomial: Polynomial
    A: Matrix
    b: tuple[Fraction, ...]

    def __init__(self, polynomial: Sequence[object], A: Sequence[Sequence[object]], b: Sequence[object]) -> None:
        nodes = _rationals(polynomial, "polynomial")
        stages = len(nodes) - 1
        if stages > MAX_STAGES:
            raise IntegratorError(f"polynomial must have degree {MAX_STAGES} at most, but has {stages}")
        if stages < 1 or nodes[-1] != 1:
            raise IntegratorError("polynomial must be monic of degree 1 or more, but was " + _polynomial_text(nodes))
        rows = tuple(_rationals(row, f"row {i} of A") for i, row in enumerate(items(A, "A"), 1))
        if len(rows) != stages or any(len(row) != stages for row in rows):
            sizes = sorted({len(row) for row in rows})
            raise IntegratorError(
                f"A must have {stages} rows of {stages} entries, one per root of polynomial, "
                f"but had {len(rows)} rows of {' or '.join(map(str, sizes)) or 'no'} entries"
            )
        weights = _rationals(b, "b")
        if len(weights) != stages:
            raise IntegratorError(f"b must have {stages} entries, one per root of polynomial, but had {len(weights)}")
        real, simple = polynomials.count_real_roots(nodes)
        if not simple:
            raise IntegratorError("polynomial must have simple roots, but was " + _polynomial_text(nodes))
        if real != stages:
            raise IntegratorError(
                f"polynomial must have {stages} real roots, but has {real}: {_polynomial_text(nodes)}"
            )
        self.__dict__.update(polynomial=nodes, A=rows, b=weights)

    @property
    def _data(self) -> tuple[object, ...]:
        return self.polynomial, self.A, self.b

    def __repr__(self) -> str:
        return f"StageAlgebra({_polynomial_text(self.polynomial)})"

    @property
    def stages(self) -> int:
        """The number s of stages."""
        return len(self.b)

    def multiply(self, f: Polynomial, g: Polynomial) -> Polynomial:
        """The stage values f(c_i) g(c_i), as a polynomial: f · g modulo the node polynomial."""
        return polynomials.multiply_modulo(f, g, self.polynomial)

    def apply(self, g: Polynomial) -> Polynomial:
        """The stage values Σ_j a_ij g(c_j), as a polynomial."""
        return polynomials.trim([sum((a * v for a, v in zip(row, g, strict=False)), Fraction(0)) for row in self.A])

    def weigh(self, g: Polynomial) -> Fraction:
        """The number Σ_i b_i g(c_i)."""
        return sum((b * v for b, v in zip(self.b, g, strict=False)), Fraction(0))

    def moments(self, count: int) -> tuple[Fraction, ...]:
        """The moments Σ_i b_i c_i^k for k < `count`, by the linear recurrence of the node polynomial."""
        return moments(self.polynomial, self.b, count)

    @property
    def row_sums(self) -> Polynomial:
        """The sums Σ_j a_ij, as a polynomial: x for most methods."""
        return self.apply(polynomials.ONE)

    def rows_sum_to_nodes(self) -> tuple[bool, ...]:
        """Whether Σ_j a_ij = c_i, for each row of the stage matrix."""
        if self.row_sums == polynomials.remainder(polynomials.X, self.polynomial):
            return (True,) * self.stages
        gap = polynomials.add(self.row_sums, polynomials.scale(polynomials.X, -1))
        return tuple(value == 0 for value in self.values(gap))

    def is_symplectic_with(self, other: StageAlgebra) -> bool:
        """`RungeKutta.is_symplectic_with` for an algebra with the same nodes, without their roots.

        The condition b(f · Âg) + b(Af · g) = b(f) b(g) for all stage values f and g is checked on the basis 1, x, ….
        """
        gram = gram_matrix(self.polynomial, self.b)
        left, right = (gram * to_flint_matrix(algebra.A) for algebra in (other, self))
        products = to_flint_matrix([[x * y for y in self.b] for x in self.b])
        return self.b == other.b and left + right.transpose() == products

    @property
    def has_symmetric_nodes(self) -> bool:
        """Whether the nodes are symmetric about 1/2."""
        reflected = polynomials.compose(self.polynomial, polynomials.trim([1, -1]))  # P(1 − x)
        return polynomials.scale(reflected, (-1) ** self.stages) == self.polynomial

    def is_symmetric(self) -> bool:
        """Whether the method is its own adjoint, given symmetric nodes.

        With their reversal ρ: x → 1 − x the condition is ρAρ g + A g = b(g) on the basis.
        """
        basis, A = range(self.stages), to_flint_matrix(self.A)
        reversal = to_flint_matrix([[(-1) ** k * comb(level, k) for level in basis] for k in basis])
        weights = to_flint_matrix([self.b, *[[0] * self.stages] * (self.stages - 1)])
        return reversal * A * reversal + A == weights

    @cached_property
    def has_rational_nodes(self) -> bool:
        """Whether all nodes, and therefore all entries of the tableau, are rational."""
        return all(
            polynomials.evaluate(self.polynomial, node) == 0 for node in polynomials.real_roots(self.polynomial, 20)
        )

    @cached_property
    def _dual(self) -> tuple[Polynomial, ...]:
        """The inverse Vandermonde matrix: polynomials D_l for which Σ_j D_l(c_j) g(c_j) is the coefficient of x^l in g.

        The Lagrange polynomial (P(x) − P(c_j)) / ((x − c_j) P'(c_j)) has the coefficients
        Σ_{m>l} p_m c_j^(m−l−1) / P'(c_j), and 1/P' is a polynomial modulo P.
        """
        p = self.polynomial
        inverse = polynomials.invert(polynomials.derivative(p), p)
        return tuple(self.multiply(p[level + 1 :], inverse) for level in range(self.stages))

    @cached_property
    def _entry_polynomials(self) -> tuple[tuple[Polynomial, ...], Polynomial]:
        """Rational polynomials R and S with a_ij = Σ_k R[k](c_j) c_i^k and b_j = S(c_j)."""
        dual = to_flint_matrix([(*p, *[0] * (self.stages - len(p))) for p in self._dual])
        *rows, weights = map(polynomials.trim, matrix_rows(to_flint_matrix([*self.A, self.b]) * dual))
        return tuple(rows), weights

    def _approximate_tableau(self, digits: int) -> tuple[Matrix, tuple[Fraction, ...], tuple[Fraction, ...]]:
        """A, b, c within 10^-digits, in fixed-point arithmetic with a common denominator."""
        rows, weights = self._entry_polynomials
        nodes = polynomials.real_roots(self.polynomial, 20)
        # An error ε in the nodes or of rounding changes an entry by at most 4 s ε Σ|R| (1 + |c|)^(2s).
        size = sum((abs(value) for row in (*rows, weights) for value in row), Fraction(1))
        size *= 4 * self.stages * (1 + max(map(abs, nodes))) ** (2 * self.stages)
        digits_inside = digits + len(str(int(size)))
        nodes = polynomials.real_roots(self.polynomial, digits_inside)
        places = digits_inside * 10 // 3 + 1
        denominator = lcm(*(value.denominator for row in (*rows, weights) for value in row))
        *scaled, scaled_weights = ([int(v * denominator) << places for v in row] for row in (*rows, weights))
        points = [round(node * 2**places) for node in nodes]

        def value(numerator: int) -> Fraction:
            found = Fraction(numerator, denominator << places)
            return found if abs(found) * 10**digits >= 1 else Fraction(0)

        columns = [[_horner(row, point, places) for row in scaled] for point in points]
        a = tuple(tuple(value(_horner(column, point, places)) for column in columns) for point in points)
        return a, tuple(value(_horner(scaled_weights, point, places)) for point in points), nodes

    def nodes_decimal(self, digits: int = 50) -> tuple[Any, ...]:
        """The nodes c_1 < … < c_s to a number of decimals, as mpmath numbers."""
        return _decimals(polynomials.real_roots(self.polynomial, _read_digits(digits)), digits)

    def tableau_decimal(self, digits: int = 50) -> tuple[tuple[tuple[Any, ...], ...], Any, Any]:
        """The tableau (A, b, c) to a number of decimals, as mpmath numbers; the matrix by rows."""
        a, b, c = self._approximate_tableau(_read_digits(digits) + 3)
        return tuple(_decimals(row, digits) for row in a), _decimals(b, digits), _decimals(c, digits)

    def tableau_float(self) -> tuple[tuple[tuple[float, ...], ...], tuple[float, ...], tuple[float, ...]]:
        """The tableau (A, b, c) in doubles, each rounded from a value within 10^-40."""
        a, b, c = self._approximate_tableau(40)
        return tuple(tuple(map(float, row)) for row in a), tuple(map(float, b)), tuple(map(float, c))

    @cached_property
    def _exact_nodes(self) -> tuple[tuple[Exact, Polynomial], ...]:
        """Each node, ascending, with its minimal polynomial over the rationals."""
        approximate = polynomials.real_roots(self.polynomial, 20)
        rational = [node for node in approximate if polynomials.evaluate(self.polynomial, node) == 0]
        rest = self.polynomial
        for node in rational:
            rest = polynomials.divide(rest, (-node, Fraction(1)))[0]
        found: list[tuple[Exact, Polynomial]] = [(node, (-node, Fraction(1))) for node in rational]
        if len(rest) == 1:
            return tuple(found)
        import sympy

        x = sympy.Symbol("x")
        terms = [in_sympy(a) * x**k for k, a in enumerate(rest)]
        for factor, _ in sympy.factor_list(sympy.Add(*terms), x)[1]:
            coefficients = [simplest(a) for a in reversed(sympy.Poly(factor, x).all_coeffs())]
            minimal = polynomials.scale(tuple(coefficients), 1 / coefficients[-1])
            found.extend((root, minimal) for root in _roots(minimal, factor))
        return tuple(sorted(found, key=lambda pair: sympy.N(pair[0], 20)))

    def nodes(self) -> tuple[Exact, ...]:
        """The nodes: `Fraction`s where rational, radicals for quadratic and biquadratic factors, else ``CRootOf``.

        Example:
            >>> import bseries as bs
            >>> from fractions import Fraction
            >>> half = Fraction(1, 2)
            >>> bs.methods.StageAlgebra([Fraction(1, 6), -1, 1], [[0, 0], [1, half]], [1, half]).nodes()
            (1/2 - sqrt(3)/6, sqrt(3)/6 + 1/2)
        """
        return tuple(node for node, _ in self._exact_nodes)

    def tableau_exact(self) -> tuple[tuple[tuple[Exact, ...], ...], tuple[Exact, ...], tuple[Exact, ...]]:
        """The tableau (A, b, c), `Fraction`s where rational: V A V⁻¹ and b V⁻¹ with the Vandermonde matrix V."""
        rows, weights = self._entry_polynomials
        points = self._exact_nodes
        a = tuple(tuple(_entry(rows, first, second) for second in points) for first in points)
        return a, self.values(weights), self.nodes()

    def values(self, g: Polynomial) -> tuple[Exact, ...]:
        """The values g(c_1), …, g(c_s), exactly."""
        return tuple(_entry([g], point, point) for point in self._exact_nodes)


def moments(polynomial: Polynomial, b: Sequence[Fraction], count: int) -> tuple[Fraction, ...]:
    """The values b[x^k], k < `count`, of the linear form modulo a monic polynomial that has the values b on 1, x, …."""
    found = list(b[:count])
    while len(found) < count:
        found.append(-sum((p * m for p, m in zip(polynomial, found[-len(b) :], strict=False)), Fraction(0)))
    return tuple(found)


def gram_matrix(polynomial: Polynomial, b: Sequence[Fraction]) -> Any:
    """The matrix b[x^(k+l)] of the form b[f · g] of stage values."""
    values = moments(polynomial, b, 2 * len(b) - 1)
    return to_flint_matrix([values[k : k + len(b)] for k in range(len(b))])


def _horner(coefficients: Sequence[int], point: int, places: int) -> int:
    """The value of a polynomial in fixed-point arithmetic."""
    value = 0
    for coefficient in reversed(coefficients):
        value = (value * point >> places) + coefficient
    return value


def _entry(rows: Sequence[Polynomial], first: tuple[Exact, Polynomial], second: tuple[Exact, Polynomial]) -> Exact:
    """The number Σ_k rows[k](y) x^k at the nodes x and y, after reduction by their minimal polynomials."""
    (x, minimal_x), (y, minimal_y) = first, second
    if x is y:
        total: Polynomial = ()
        for k, row in enumerate(rows):
            total = polynomials.add(total, polynomials.multiply(row, polynomials.power(k)))
        return _value([polynomials.remainder(total, minimal_y)], Fraction(1), y)
    reduced = [polynomials.remainder(row, minimal_y) for row in rows]
    width = max(map(len, reduced))
    columns = [polynomials.trim([row[level] if level < len(row) else 0 for row in reduced]) for level in range(width)]
    return _value([polynomials.remainder(column, minimal_x) for column in columns], y, x)


def _value(columns: Sequence[Polynomial], y: Exact, x: Exact) -> Exact:
    """The number Σ_l columns[l](x) y^l, as an expanded sum."""
    terms = [(a, k, level) for level, column in enumerate(columns) for k, a in enumerate(column) if a]
    if (isinstance(x, Fraction) or not any(k for _, k, _ in terms)) and (
        isinstance(y, Fraction) or not any(level for _, _, level in terms)
    ):
        value = Fraction(0)
        for a, k, level in terms:
            value += a * (x**k if k else 1) * (y**level if level else 1)  # type: ignore[operator]
        return value
    import sympy

    value = sympy.Add(*(in_sympy(a) * x**k * y**level for a, k, level in terms))
    if not isinstance(x, sympy.CRootOf) and not isinstance(y, sympy.CRootOf):
        value = sympy.expand(value)
    return simplest(value)


def _roots(minimal: Polynomial, factor: sympy.Expr) -> list[sympy.Expr]:
    """The roots of an irreducible polynomial: in square roots if possible, else as ``CRootOf``."""
    import sympy

    degree = len(minimal) - 1
    mean = -minimal[-2] / degree
    *lower, _ = map(in_sympy, polynomials.compose(minimal, (mean, Fraction(1))))
    centre = in_sympy(mean)
    if degree == 2:
        squares = [-lower[0]]
    elif degree == 4 and lower[1] == 0:
        half, root = -lower[2] / 2, sympy.sqrt(lower[2] ** 2 / 4 - lower[0])
        squares = [half - root, half + root]
    else:
        return [sympy.CRootOf(factor, k) for k in range(degree)]
    return [centre + sign * sympy.sqrt(square) for square in squares for sign in (-1, 1)]


def _rationals(values: Sequence[object], argument: str) -> tuple[Fraction, ...]:
    """The values as `Fraction`s; anything but exact rationals is refused."""
    numbers = []
    for k, value in enumerate(items(values, argument)):
        if isinstance(value, bool) or not isinstance(value, Rational):
            raise IntegratorError(f"{argument} must hold integers and fractions, but entry {k + 1} was {shown(value)}")
        numbers.append(Fraction(int(value.numerator), int(value.denominator)))
    return tuple(numbers)


def _polynomial_text(p: Polynomial) -> str:
    """A polynomial as text, shortened."""
    text = " + ".join(f"{a}*x^{k}" if k else str(a) for k, a in enumerate(p) if a) or "0"
    return shorten(text)


def _read_digits(digits: int) -> int:
    return read_whole(digits, "digits", f"an integer from 1 to {MOST_DIGITS}", 1, MOST_DIGITS)


def _decimals(values: Sequence[Fraction], digits: int) -> tuple[Any, ...]:
    """The values as mpmath numbers."""
    import mpmath

    with mpmath.workdps(digits + 3):
        return tuple(mpmath.mpf(value.numerator) / value.denominator for value in values)
