"""The tools beneath stability: signs of polynomials, number fields, resolvents, and numbers with errors."""

import math
from fractions import Fraction

import numpy as np
import pytest
import sympy

from bseries.analysis.stability.field_elements import Inexact, to_number_field
from bseries.analysis.stability.linear_stability import adjugate_terms, characteristic
from bseries.analysis.stability.sturm import count_roots, first_crossing, is_hurwitz, squarefree_factors, sturm_chain


def rational(*values):
    return tuple(map(Fraction, values))


def from_roots(*roots):
    polynomial = rational(1)
    for root in roots:
        polynomial = tuple(a - Fraction(root) * b for a, b in zip((0, *polynomial), (*polynomial, 0), strict=True))
    return polynomial


def test_sturm_counts():
    chain = sturm_chain(from_roots(-2, "1/3", 1, 4))
    assert [count_roots(chain, Fraction(a), Fraction(b)) for a, b in ((-3, 5), (0, 1), (1, 4), (2, 3))] == [4, 2, 1, 0]
    factors = squarefree_factors(from_roots(1, 2, 2, 3, 3, 3))
    assert [first_crossing(tuple(-a for a in f)) is not None for f in factors] == [True, True, True]
    assert factors == [from_roots(1), from_roots(2), from_roots(3)]


@pytest.mark.parametrize(
    ("roots", "sign", "expected"),
    [
        ((2,), -1, 2),
        ((2,), 1, 0),
        ((1, 1, 3), -1, 3),
        ((1, 1, 1, 3), 1, 1),
        ((1, 1), 1, None),
        ((-1, -2), 1, None),
        ((0, 0, 5), -1, 5),
        (("1/7", "1/6"), 1, Fraction(1, 7)),
        ((10**9,), -1, 10**9),
        ((1, Fraction(10**7 + 1, 10**7)), 1, 1),
    ],
)
def test_first_crossing(roots, sign, expected):
    found = first_crossing(tuple(sign * a for a in from_roots(*roots)))
    assert found == expected
    assert expected is None or type(found) is Fraction


def test_first_crossing_of_an_irrational_root():
    assert first_crossing(rational(2, 0, -1)) == math.sqrt(2)


@pytest.mark.parametrize("seed", range(30))
def test_first_crossing_against_roots(seed):
    numbers = np.random.default_rng(seed)
    p = rational(*(int(a) for a in numbers.integers(-9, 10, size=numbers.integers(2, 8))))
    roots = np.roots([float(a) for a in reversed(p)])
    positive = [root.real for root in roots if abs(root.imag) < 1e-9 and root.real > 1e-9]
    start = next(a for a in p if a)
    expected = 0 if start < 0 else min(positive, default=None)
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
    assert root > Fraction("3.14626436994197")
    assert root < Fraction("3.14626436994198")
    assert not (1 / root) * root - 1
    assert not (six * six - 6)
    assert (root - root).sign == 0
    # A difference of 10^-60 is told from zero.
    near = Fraction(math.isqrt(6 * 10**120), 10**60)
    assert six > near
    assert six < near + Fraction(1, 10**60)
    assert type(third) is Fraction
    assert float(six) == math.sqrt(6)


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
    assert characteristic(thirds) == [Fraction(d, 3**k) for k, (d, _) in enumerate(terms)]


def test_errors_enclose():
    numbers = np.random.default_rng(7)
    for _ in range(50):
        true = [Fraction(int(a), 97) for a in numbers.integers(-300, 300, size=4)]
        seen = [
            Inexact(x + Fraction(int(e), 10**9), 1e-8)
            for x, e in zip(true, numbers.integers(-9, 9, size=4), strict=True)
        ]
        value = seen[0] * seen[1] - 3 * seen[2] + (seen[3] + 1) * seen[0] * seen[0] / 7
        expected = true[0] * true[1] - 3 * true[2] + (true[3] + 1) * true[0] ** 2 / 7
        assert abs(value.value - expected) <= value.error
        assert value.error < 1e-5
        if seen[1] and abs(true[1]) > 1e-3:
            ratio = seen[0] / seen[1]
            assert abs(ratio.value - true[0] / true[1]) <= ratio.error
    assert not Inexact(Fraction(1, 10**9), 1e-8)
    assert Inexact(Fraction(1, 10**9), 1e-8).text == "0"
    assert Inexact(Fraction(1, 3), 1e-5).text == "0.3333"
    assert Inexact(Fraction(1, 3 * 10**7), 1e-12).text == "3.333e-8"
