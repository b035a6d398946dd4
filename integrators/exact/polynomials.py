"""Polynomials and linear systems over the rationals, without slow imports.

A polynomial is a tuple of `Fraction`s, with the coefficient of x^k at index k and without trailing zeros; () is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import pairwise
from math import lcm

from integrators.core.errors import IntegratorError

Polynomial = tuple[Fraction, ...]
Matrix = tuple[tuple[Fraction, ...], ...]


def trim(coefficients: Sequence[Fraction | int]) -> Polynomial:
    """The polynomial with these coefficients, trailing zeros removed."""
    length = len(coefficients)
    while length and coefficients[length - 1] == 0:
        length -= 1
    return tuple(Fraction(value) for value in coefficients[:length])


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
    """The product p · q.

    Example:
        >>> [str(a) for a in multiply((Fraction(-1), Fraction(1)), (Fraction(1), Fraction(1)))]
        ['-1', '0', '1']
    """
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
    """The inverse of p modulo a coprime polynomial, by Euclid's algorithm.

    Example:
        >>> [str(a) for a in invert((Fraction(1), Fraction(1)), (Fraction(-2), Fraction(0), Fraction(1)))]
        ['-1', '1']
    """
    (last, rest), (left, right) = (modulus, p), ((), ONE)
    while len(rest) != 1:
        quotient, remaining = divide(last, rest)
        (last, rest), (left, right) = (rest, remaining), (right, add(left, scale(multiply(quotient, right), -1)))
    return scale(right, 1 / rest[-1])


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


def solve(matrix: Sequence[Sequence[Fraction]], right: Sequence[Sequence[Fraction]]) -> Matrix:
    """The matrix X with matrix · X = right, by Gaussian elimination in `Fraction`s.

    Args:
        matrix: a square matrix, by rows.
        right: a matrix with as many rows; a vector is a matrix with one column.

    Returns:
        The solution, by rows.

    Raises:
        IntegratorError: the matrix is singular.

    Example:
        >>> solve([[Fraction(2), Fraction(1)], [Fraction(1), Fraction(1)]], [[Fraction(1)], [Fraction(0)]])
        ((Fraction(1, 1),), (Fraction(-1, 1),))
    """
    size = len(matrix)
    rows = [[*left, *values] for left, values in zip(matrix, right, strict=True)]
    for column in range(size):
        pivot = next((i for i in range(column, size) if rows[i][column]), None)
        if pivot is None:
            raise IntegratorError(f"matrix must be invertible, but column {column + 1} depends on those before it")
        rows[column], rows[pivot] = rows[pivot], rows[column]
        inverse = 1 / Fraction(rows[column][column])
        rows[column] = [inverse * value for value in rows[column]]
        for i, row in enumerate(rows):
            if i != column and (factor := row[column]):
                rows[i] = [a - factor * b for a, b in zip(row, rows[column], strict=True)]
    return tuple(tuple(row[size:]) for row in rows)


def primitive(p: Polynomial) -> tuple[int, ...]:
    """The coefficients of p times their common denominator."""
    denominator = lcm(*(a.denominator for a in p))
    return tuple(a.numerator * (denominator // a.denominator) for a in p)


def count_real_roots(p: Polynomial) -> tuple[int, bool]:
    """The number of distinct real roots of p, and whether all roots, including complex ones, are simple.

    Both follow from the Sturm chain p, p', −(p mod p'), …, whose last member is the greatest common divisor of p
    and p'.
    """
    chain = [p, derivative(p)]
    while chain[-1]:
        rest = remainder(chain[-2], chain[-1])
        # Scaling by a positive factor changes no sign and keeps the numbers short.
        chain.append(scale(rest, -1 / abs(rest[-1])) if rest else ())
    chain.pop()
    at_plus = [q[-1] > 0 for q in chain]
    at_minus = [(q[-1] > 0) == (len(q) % 2 == 1) for q in chain]
    changes = [sum(a != b for a, b in pairwise(signs)) for signs in (at_minus, at_plus)]
    return changes[0] - changes[1], len(chain[-1]) == 1


def real_roots(p: Polynomial, digits: int = 20) -> tuple[Fraction, ...]:
    """The roots of a polynomial with simple real roots only, ascending.

    Rational roots are exact; the others are within 10^-digits, verified by a change of sign.

    Args:
        p: a polynomial of degree 1 or more whose roots are all real and simple.
        digits: decimals wanted.

    Returns:
        One `Fraction` per root.

    Example:
        >>> [str(root) for root in real_roots((Fraction(0), Fraction(-1, 3), Fraction(1)))]
        ['0', '1/3']
    """
    whole = primitive(p)
    # The denominator of a rational root divides `leading`; two such numbers differ by at least 1/leading².
    leading = abs(whole[-1])
    digits = max(digits, 2 * len(str(leading)) + 2)
    precision = digits + 2 * len(p) + 10
    error = Fraction(1, 10**digits)
    while True:
        unit = 10 ** (digits + 5)
        roots = [Fraction(round(Fraction(root) * unit), unit) for root in _laguerre(p, precision)]
        bounds = [bound for root in roots for bound in (root - error, root + error)]
        signs = [_sign(whole, bound) for bound in bounds]
        disjoint = all(a < b for a, b in pairwise(bounds))
        if disjoint and all(a * b < 0 for a, b in zip(signs[::2], signs[1::2], strict=True)):
            break
        precision *= 2
    rationals = [root.limit_denominator(leading) for root in roots]
    return tuple(q if _sign(whole, q) == 0 else root for q, root in zip(rationals, roots, strict=True))


def _sign(p: Sequence[int], x: Fraction) -> int:
    """The sign of p(x), in integers."""
    value, power = 0, 1
    for a in reversed(p):
        value = value * x.numerator + a * power
        power *= x.denominator
    return (value > 0) - (value < 0)


def _laguerre(p: Polynomial, precision: int) -> list[Decimal]:
    """The real roots, ascending, by Laguerre's method with deflation.

    If all roots are real, the iteration from the left converges monotonically to the leftmost one, with order three.
    """
    with localcontext(prec=precision, Emax=10**9, Emin=-(10**9)):
        coefficients = [Decimal(a.numerator) / Decimal(a.denominator) for a in p]
        x = -1 - max(abs(a / coefficients[-1]) for a in coefficients)
        roots: list[Decimal] = []
        while len(coefficients) > 1:
            degree = len(coefficients) - 1
            for _ in range(50 * precision):
                value, first, half_second = Decimal(0), Decimal(0), Decimal(0)
                for a in reversed(coefficients):
                    half_second = half_second * x + first
                    first = first * x + value
                    value = value * x + a
                if not value:
                    break
                g = first / value
                if g >= 0:  # by rounding, x has passed the root
                    break
                h = g * g - 2 * half_second / value
                spread = max(Decimal(0), (degree - 1) * (degree * h - g * g))
                step = degree / (g - spread.sqrt())
                if not x - step > x:
                    break
                x -= step
            roots.append(x)
            for k in range(degree - 1, -1, -1):
                coefficients[k] += x * coefficients[k + 1]
            del coefficients[0]
    return roots
