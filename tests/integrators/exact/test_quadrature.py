"""Gauss–Legendre quadrature: exactness up to its degree, and NumPy's nodes."""

from fractions import Fraction

import numpy as np
import pytest

from integrators.exact.polynomials import gauss_legendre


@pytest.mark.parametrize(("count", "digits"), [(1, 40), (2, 40), (5, 40), (12, 40), (3, 200)])
def test_gauss_formulas_are_exact_to_their_degree(count, digits):
    rule = gauss_legendre(count, digits)
    for degree in range(2 * count + 1):
        gap = abs(sum(weight * x**degree for x, weight in rule) - Fraction(1, degree + 1))
        assert (gap < Fraction(1, 10 ** (digits - 2))) == (degree < 2 * count)


def test_nodes_and_weights_are_those_of_numpy():
    nodes, weights = np.array(gauss_legendre(30), dtype=float).T
    expected = np.polynomial.legendre.leggauss(30)
    np.testing.assert_allclose(2 * nodes - 1, expected[0], atol=1e-15)
    np.testing.assert_allclose(2 * weights, expected[1], atol=1e-15)
