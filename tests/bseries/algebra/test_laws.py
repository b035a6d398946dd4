"""Group and Lie laws on random exact series, one to three colours, against enumeration of cuts."""

from fractions import Fraction
from itertools import pairwise

import pytest
from series_oracles import composed, derived

import bseries as bs

SIZES = [(7, 1), (4, 2), (3, 3)]

pytestmark = pytest.mark.parametrize(("order", "colors"), SIZES)


def identity(order, colors):
    return bs.BSeries.from_rule(lambda tree: 0, order, colors=colors)


def test_composition_is_the_sum_over_ordered_subtrees(execution, random_series, order, colors):
    for empty in (1, 0, Fraction(3, 2)):
        a, c = random_series(order, 1, colors=colors), random_series(order, 2, empty, colors)
        result = bs.compose(a, c)
        assert result["∅"] == empty
        assert all(result[tree] == composed(a, c, tree) for tree in a)


def test_composition_is_associative_and_not_commutative(execution, random_series, order, colors):
    a, b, c = (random_series(order, seed, colors=colors) for seed in (1, 2, 3))
    assert bs.compose(bs.compose(a, b), c) == bs.compose(a, bs.compose(b, c))
    assert bs.compose(a, b) != bs.compose(b, a)


def test_inverse_on_both_sides(execution, random_series, order, colors):
    a = random_series(order, 4, colors=colors)
    assert bs.compose(a, a.inverse()) == identity(order, colors)
    assert bs.compose(a.inverse(), a) == identity(order, colors)
    assert a.inverse().inverse() == a


def test_adjoint_is_an_involution_that_reverses_products(execution, random_series, order, colors):
    a, b = random_series(order, 5, colors=colors), random_series(order, 6, colors=colors)
    assert a.adjoint() != a
    assert a.adjoint().adjoint() == a
    assert bs.compose(a, b).adjoint() == bs.compose(b.adjoint(), a.adjoint())


def test_log_and_exp_are_inverse(execution, random_series, order, colors):
    a, b = random_series(order, 7, colors=colors), random_series(order, 8, 0, colors)
    assert a.log().exp() == a
    assert b.exp().log() == b
    assert a.log()["∅"] == 0


def test_log_of_the_exact_flow_is_the_field(execution, order, colors):
    field = bs.exact_flow(order, colors=colors).log()
    assert field == bs.BSeries.from_rule(lambda tree: int(tree.order == 1), order, empty=0, colors=colors)


def test_powers_add(execution, random_series, order, colors):
    a = random_series(order, 9, colors=colors)
    assert a**2 == bs.compose(a, a)
    assert a**0 == identity(order, colors)
    assert a**-1 == a.inverse()
    assert (a ** Fraction(1, 2)) ** 2 == a
    assert (a ** Fraction(2, 3)) ** Fraction(-9, 2) == a**-3
    assert bs.compose(a ** Fraction(5, 6), a ** Fraction(1, 6)) == a


def test_exp_turns_multiples_of_a_field_into_powers(execution, random_series, order, colors):
    b = random_series(order, 10, 0, colors)
    assert (b * 3).exp() == b.exp() ** 3
    assert (b / 3).exp() == b.exp() ** Fraction(1, 3)


def test_lie_derivative_cuts_single_edges(execution, random_series, order, colors):
    for empty in (0, 1, Fraction(1, 2)):
        b, c = random_series(order, 11, 0, colors), random_series(order, 12, empty, colors)
        result = bs.algebra.lie_derivative(b, c)
        assert all(result[tree] == derived(b, c, tree) for tree in c)


def test_composition_derives_to_the_lie_derivative(execution, random_series, order, colors):
    """d/ds compose(exp(s b), c) at s = 0 is ∂_b c, here from exact differences of the polynomial in s."""
    b, c = random_series(order, 13, 0, colors), random_series(order, 14, colors=colors)
    steps = [bs.compose((b * s).exp(), c) - c for s in range(1, order + 2)]
    for tree in c:
        values = [0] + [step[tree] for step in steps]
        slope = Fraction(0)
        for k in range(1, order + 2):  # Newton's forward differences: f'(0) = Σ (−1)^(k+1) Δ^k / k
            values = [y - x for x, y in pairwise(values)]
            slope += Fraction((-1) ** (k + 1), k) * values[0]
        assert slope == bs.algebra.lie_derivative(b, c)[tree]
