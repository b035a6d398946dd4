"""The tools beneath stability: roots and signs of polynomials, number fields, resolvents, and numbers with errors."""

import math
from fractions import Fraction

import numpy as np
import pytest
import sympy

from bseries.analysis.stability.criteria import adjugate_terms, characteristic
from bseries.analysis.stability.field_elements import (
    Inexact,
    enclose,
    first_crossing,
    is_hurwitz,
    roots,
    sign,
    squarefree_factors,
    to_number_field,
)
from integrators.exact.polynomials import to_flint


def rational(*values):
    return tuple(map(Fraction, values))


def from_roots(*roots):
    polynomial = rational(1)
    for root in roots:
        polynomial = tuple(a - Fraction(root) * b for a, b in zip((0, *polynomial), (*polynomial, 0), strict=True))
    return polynomial


def test_roots():
    found = roots(from_roots(-2, "1/3", 1, 4))
    assert all(root.imag == 0 for root in found)
    assert [float(root.real) for root in found] == pytest.approx([-2, 1 / 3, 1, 4])
    factors = squarefree_factors(from_roots(1, 2, 2, 3, 3, 3))
    assert [first_crossing(tuple(-a for a in f)) < math.inf for f in factors] == [True, True, True]
    assert factors == [from_roots(1), from_roots(2), from_roots(3)]


def test_roots_over_a_number_field():
    """(x² − √2)(x² + x + √3): two real roots and a pair; the product is also factored where roots are multiple."""
    found = to_number_field([sympy.sqrt(2), sympy.sqrt(3)])
    assert found is not None
    two, three = found
    p = (-two * three, -two, three - two, Fraction(1), Fraction(1))
    places = roots(p)
    real = [float(root.real) for root in places if root.imag == 0]
    assert sorted(real) == pytest.approx([-(2**0.25), 2**0.25], rel=1e-15)
    assert sorted(root.imag > 0 for root in places if root.imag != 0) == [False, True]
    assert first_crossing(tuple(-a for a in p)) == pytest.approx(2**0.25, rel=1e-15)
    assert first_crossing((two, Fraction(0), Fraction(-1))) == pytest.approx(2**0.25, rel=1e-15)
    square = (two, Fraction(0), Fraction(-2) * two, Fraction(0), two)  # √2 (x² − 1)²
    assert first_crossing(square) == math.inf
    assert first_crossing((-two, two)) == 0
    assert first_crossing((two, -two)) == Fraction(1)
    assert is_hurwitz((two, three, Fraction(1))) is True
    assert is_hurwitz((two, Fraction(0), Fraction(1))) is False
    assert is_hurwitz((two, -three, Fraction(1))) is False


def test_roots_close_to_each_other_and_to_the_axis():
    near = Fraction(1, 10**60)
    assert first_crossing(tuple(-a for a in from_roots(1, 1 + near, 1 + 2 * near))) == 1
    assert first_crossing(from_roots(1 + near, 3)) == 1.0
    assert type(first_crossing(from_roots(1 + near, 3))) is float  # not the rational 1
    assert is_hurwitz((1 + near**2, 2 * near, Fraction(1))) is True  # −ε ± i
    assert is_hurwitz((1 + near**2, -2 * near, Fraction(1))) is False


@pytest.mark.parametrize(
    ("roots", "sign", "expected"),
    [
        ((2,), -1, 2),
        ((2,), 1, 0),
        ((1, 1, 3), -1, 3),
        ((1, 1, 1, 3), 1, 1),
        ((1, 1), 1, math.inf),
        ((-1, -2), 1, math.inf),
        ((0, 0, 5), -1, 5),
        (("1/7", "1/6"), 1, Fraction(1, 7)),
        ((10**9,), -1, 10**9),
        ((1, Fraction(10**7 + 1, 10**7)), 1, 1),
    ],
)
def test_first_crossing(roots, sign, expected):
    found = first_crossing(tuple(sign * a for a in from_roots(*roots)))
    assert found == expected
    assert expected == math.inf or type(found) is Fraction


def test_first_crossing_of_an_irrational_root():
    assert first_crossing(rational(2, 0, -1)) == math.sqrt(2)


@pytest.mark.parametrize("seed", range(30))
def test_first_crossing_against_roots(seed):
    numbers = np.random.default_rng(seed)
    p = rational(*(int(a) for a in numbers.integers(-9, 10, size=numbers.integers(2, 8))))
    roots = np.roots([float(a) for a in reversed(p)])
    positive = [root.real for root in roots if abs(root.imag) < 1e-9 and root.real > 1e-9]
    start = next(a for a in p if a)
    expected = 0 if start < 0 else min(positive, default=math.inf)
    found = first_crossing(p)
    assert found == expected or found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("seed", range(30))
def test_hurwitz_against_roots(seed):
    numbers = np.random.default_rng(seed)
    p = rational(*(int(a) for a in numbers.integers(1, 12, size=numbers.integers(2, 7))))
    roots = np.roots([float(a) for a in reversed(p)])
    if abs(roots.real).min() > 1e-9:
        assert is_hurwitz(p) is bool(np.all(roots.real < 0))
    assert is_hurwitz((*p, Fraction(-1))) is False


def test_number_fields():
    found = to_number_field([sympy.sqrt(2) + sympy.sqrt(3), sympy.sqrt(6), Fraction(1, 3)])
    assert found is not None
    root, six, third = found
    assert not root * root - 5 - 2 * six
    assert sign(root - Fraction("3.14626436994197")) == 1
    assert sign(root - Fraction("3.14626436994198")) == -1
    assert not (1 / root) * root - 1
    assert not (six * six - 6)
    assert sign(root - root) == 0
    # A difference of 10^-60 is told from zero.
    near = Fraction(math.isqrt(6 * 10**120), 10**60)
    assert sign(six - near) == 1
    assert sign(near + Fraction(1, 10**60) - six) == 1
    assert type(third) is Fraction
    assert float(enclose(six, 100)) == math.sqrt(6)


@pytest.mark.parametrize("seed", range(8))
def test_adjugate_and_determinant(seed):
    numbers = np.random.default_rng(seed)
    size = int(numbers.integers(1, 5))
    matrix = numbers.integers(-5, 6, size=(size, size)).tolist()
    r = sympy.Symbol("r")
    resolvent = sympy.eye(size) + r * sympy.Matrix(matrix)
    terms = list(adjugate_terms(matrix))
    assert sympy.expand(resolvent.det(method="berkowitz") - sum(d * r**k for k, (d, _) in enumerate(terms))) == 0
    adjugate = sum((r**k * sympy.Matrix(c) for k, (_, c) in enumerate(terms)), sympy.zeros(size))
    assert (adjugate - resolvent.adjugate()).expand() == sympy.zeros(size)
    thirds = [[Fraction(a, 3) for a in row] for row in matrix]
    assert list(characteristic(thirds)) == [Fraction(d, 3**k) for k, (d, _) in enumerate(terms)]


def inexact(value, error):
    return Inexact(to_flint(Fraction(value)), to_flint(Fraction(error)))


def test_errors_enclose():
    numbers = np.random.default_rng(7)
    for _ in range(50):
        true = [Fraction(int(a), 97) for a in numbers.integers(-300, 300, size=4)]
        seen = [
            Inexact(to_flint(x + Fraction(int(e), 10**9)), to_flint(Fraction(1, 10**8)))
            for x, e in zip(true, numbers.integers(-9, 9, size=4), strict=True)
        ]
        value = seen[0] * seen[1] - 3 * seen[2] + (seen[3] + 1) * seen[0] * seen[0] / 7
        expected = true[0] * true[1] - 3 * true[2] + (true[3] + 1) * true[0] ** 2 / 7
        assert abs(value.value - to_flint(expected)) <= value.error
        assert value.error < to_flint(Fraction(1, 10**5))
        if seen[1] and abs(true[1]) > 1e-3:
            ratio = seen[0] / seen[1]
            assert abs(ratio.value - to_flint(true[0] / true[1])) <= ratio.error
    assert not inexact("1/1000000000", "1e-8")
    assert inexact("1/1000000000", "1e-8").text == "0"
    assert inexact("1/3", "1e-5").text == "0.3333"
    assert inexact("1/30000000", "1e-12").text == "3.333e-8"
