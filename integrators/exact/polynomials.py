"""Polynomials and linear systems over the rationals, without slow imports.

A polynomial is a tuple of `Fraction`s, with the coefficient of x^k at index k and without trailing zeros; () is zero.
Sums, products, quotients, derivatives and values are right over any field whose elements are false where zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flint import fmpq

Polynomial = tuple[Fraction, ...]
Matrix = tuple[tuple[Fraction, ...], ...]


def trim(coefficients: Sequence[Any]) -> Polynomial:
    """The polynomial with these coefficients, trailing zeros removed."""
    length = len(coefficients)
    while length and not coefficients[length - 1]:
        length -= 1
    return tuple(Fraction(value) if isinstance(value, int) else value for value in coefficients[:length])


ONE: Polynomial = (Fraction(1),)
X: Polynomial = (Fraction(0), Fraction(1))


def power(exponent: int) -> Polynomial:
    """The polynomial x^exponent."""
    return (*(Fraction(0),) * exponent, Fraction(1))


def add(p: Polynomial, q: Polynomial) -> Polynomial:
    """The sum p + q."""
    longer, shorter = (p, q) if len(p) >= len(q) else (q, p)
    return trim([a + b for a, b in zip(longer, shorter, strict=False)] + list(longer[len(shorter) :]))


def scale(p: Polynomial, factor: Fraction | int) -> Polynomial:
    """The multiple factor · p."""
    return trim([factor * a for a in p])


def multiply(p: Polynomial, q: Polynomial) -> Polynomial:
    """The product p · q."""
    product = [Fraction(0)] * max(0, len(p) + len(q) - 1)
    for i, a in enumerate(p):
        if a:
            for j, b in enumerate(q):
                product[i + j] += a * b
    return trim(product)


def divide(p: Polynomial, q: Polynomial) -> tuple[Polynomial, Polynomial]:
    """The quotient and remainder of p by q."""
    rest = list(p)
    quotient = [Fraction(0)] * max(0, len(p) - len(q) + 1)
    for k in range(len(quotient) - 1, -1, -1):
        factor = quotient[k] = rest[k + len(q) - 1] / q[-1]
        if factor:
            for j, b in enumerate(q):
                rest[k + j] -= factor * b
    return trim(quotient), trim(rest[: len(q) - 1])


def remainder(p: Polynomial, modulus: Polynomial) -> Polynomial:
    """The polynomial p reduced modulo another."""
    return divide(p, modulus)[1]


def invert(p: Polynomial, modulus: Polynomial) -> Polynomial:
    """The inverse of p modulo a coprime polynomial."""
    return _fractions(_by_flint(p).xgcd(_by_flint(modulus))[1].coeffs())


def multiply_modulo(p: Polynomial, q: Polynomial, modulus: Polynomial) -> Polynomial:
    """The product p · q modulo another polynomial."""
    return _fractions((_by_flint(p) * _by_flint(q) % _by_flint(modulus)).coeffs())


def derivative(p: Polynomial) -> Polynomial:
    """The derivative p'."""
    return trim([k * a for k, a in enumerate(p)][1:])


def evaluate(p: Polynomial, x: Fraction | int) -> Fraction:
    """The value p(x)."""
    value = Fraction(0)
    for a in reversed(p):
        value = value * x + a
    return value


def compose(p: Polynomial, q: Polynomial) -> Polynomial:
    """The polynomial p(q(x))."""
    value: Polynomial = ()
    for a in reversed(p):
        value = add(multiply(value, q), trim([a]))
    return value


def to_flint_matrix(rows: Iterable[Sequence[Fraction | int]]) -> Any:
    """A rational matrix of python-flint."""
    import flint

    return flint.fmpq_mat([list(map(to_flint, row)) for row in rows])


def matrix_rows(matrix: Any) -> Matrix:
    """The rows of a rational matrix of python-flint."""
    return tuple(map(_fractions, matrix.tolist()))


def count_real_roots(p: Polynomial) -> tuple[int, bool]:
    """The number of distinct real roots of p, and whether all roots, including complex ones, are simple."""
    found = _by_flint(p).complex_roots()  # isolated; imaginary parts of real roots are exactly 0
    return sum(root.imag == 0 for root, _ in found), all(multiplicity == 1 for _, multiplicity in found)


def real_roots(p: Polynomial, digits: int = 20) -> tuple[Fraction, ...]:
    """The roots of a polynomial with simple real roots only, ascending.

    Rational roots are exact; the others are within 10^-digits, as proved by python-flint's ball arithmetic.
    """
    import flint

    rest = _by_flint(p)
    exact = [from_flint(root) for root, _ in rest.roots()]
    for root in exact:
        rest //= _by_flint((-root, Fraction(1)))
    unit, precision = 10 ** (digits + 5), 4 * digits + 64
    while True:
        with flint.ctx.workprec(precision):
            balls = [root.real for root, _ in rest.complex_roots()]
        if all(ball.rad() * unit < 1 for ball in balls):
            break
        precision *= 2
    return tuple(sorted([*exact, *(Fraction(round(_midpoint(ball) * unit), unit) for ball in balls)]))


def _midpoint(ball: Any) -> Fraction:
    mantissa, exponent = ball.mid().man_exp()
    return int(mantissa) * Fraction(2) ** int(exponent)


def _by_flint(p: Polynomial) -> Any:
    import flint

    return flint.fmpq_poly(list(map(to_flint, p)))


def to_flint(value: Any) -> fmpq:
    """An integer or fraction as a rational number of python-flint."""
    from flint import fmpq

    return fmpq(int(value.numerator), int(value.denominator))


def from_flint(value: fmpq) -> Fraction:
    """A rational number of python-flint as a `Fraction`."""
    return Fraction(int(value.p), int(value.q))


def _fractions(values: Iterable[Any]) -> tuple[Fraction, ...]:
    return tuple(map(from_flint, values))


@cache
def gauss_legendre(count: int, digits: int = 40) -> tuple[tuple[Fraction, Fraction], ...]:
    """Nodes, in ascending order, and weights on [0, 1]; exact for polynomials of degree 2 count − 1.

    References:
        F. Johansson, M. Mezzarobba, SIAM J. Sci. Comput. 40 (2018) C726–C747, doi:10.1137/18M1170133.
    """
    import flint

    with flint.ctx.workdps(digits + 10):
        pairs = [flint.arb.legendre_p_root(count, k, weight=True) for k in reversed(range(count))]
        return tuple((_midpoint((1 + node) / 2), _midpoint(weight / 2)) for node, weight in pairs)
