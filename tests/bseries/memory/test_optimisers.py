"""Optimisers as methods: their modified equations against scalar power series, and which fields are gradients again.

Power series on systems are iterated in `test_underlying_methods`.
"""

from fractions import Fraction

import pytest
import sympy

import bseries as bs

BETA = sympy.Symbol("beta")


def test_the_points_of_nesterovs_method_obey_a_two_step_method():
    points = bs.LinearMultistep(["beta", "-1-beta", 1], ["-beta", "1+beta", 0], rescaled=True, parameters=["beta"])
    method = bs.memory.nesterov(lookahead=True)
    assert bs.modified_equation(points, 5) == bs.modified_equation(method, 5)
    assert bs.modified_equation(points, 3) != bs.modified_equation(bs.memory.nesterov(), 3)


def test_on_a_linear_field_the_modified_rate_is_the_logarithm_of_the_root():
    """y' = −y: the root ζ near 1 of ζ² − (1 + β − h) ζ + β is exp Σ (−h)^n b(tall tree with n nodes)."""
    order, beta = 6, Fraction(9, 10)

    def times(p, q):
        return [sum(p[i] * q[n - i] for i in range(n + 1)) for n in range(order + 1)]

    rate, tree, b = [Fraction(0)], bs.Tree("τ"), bs.modified_equation(bs.memory.momentum(beta), order)
    for n in range(1, order + 1):
        rate.append(b[tree] * (-1) ** n)
        tree = bs.Tree(f"[{tree}]")

    def residual(rate):
        zeta = power = [Fraction(n == 0) for n in range(order + 1)]
        for k in range(1, order + 1):
            power = [x / k for x in times(power, rate)]
            zeta = [x + y for x, y in zip(zeta, power, strict=True)]
        middle = times(zeta, [-1 - beta, Fraction(1), *[Fraction(0)] * (order - 1)])
        return [x + y + beta * (n == 0) for n, (x, y) in enumerate(zip(times(zeta, zeta), middle, strict=True))]

    assert not any(residual(rate))
    assert any(residual([*rate[:2], -rate[2], *rate[3:]]))  # the other sign of [τ]


def test_symbols_agree_with_numbers_at_order_8():
    symbolic, b = bs.modified_equation(bs.memory.momentum(), 8), bs.modified_equation(bs.memory.momentum("2/3"), 8)
    for tree in list(b)[::9]:
        assert symbolic[tree].subs(BETA, sympy.Rational(2, 3)) == b[tree]


def test_the_modified_loss_and_how_far_it_goes():
    loss = bs.memory.modified_loss(bs.memory.momentum())
    assert [str(tree) for tree in loss] == ["τ", "[τ]"]
    for c, expected in zip(loss.values(), (1 / (1 - BETA), (1 + BETA) / (4 * (1 - BETA) ** 3)), strict=True):
        assert sympy.cancel(c - expected) == 0
    assert list(bs.memory.modified_loss("explicit-euler").values()) == [1, Fraction(1, 4)]
    for method in (bs.memory.momentum(), bs.memory.nesterov(), "explicit-euler"):
        assert bs.memory.gradient_order(method, 4) == 2
        with pytest.raises(bs.SeriesError, match="order must be at most 2, where the modified field is a gradient"):
            bs.memory.modified_loss(method, 3)


@pytest.mark.slow
def test_equal_coefficients_of_all_rootings_give_gradients_and_others_do_not():
    """∂_j of the modified field of L is symmetric, with L made of polynomials and elementary differentials by hand."""
    x = sympy.symbols("x y z")
    loss = x[0] ** 3 + x[0] * x[1] ** 2 * x[2] - 2 * x[1] ** 3 + x[2] ** 2 * x[0] + x[1] * x[2]
    field = sympy.Matrix([-sympy.diff(loss, v) for v in x])

    def differential(tree, kept):
        total = field
        for child in tree.children:  # only the field is differentiated: directions are symbols until the end
            value = differential(child, kept)
            names = sympy.symbols(f"c{len(kept)}_:3")
            kept.append(dict(zip(names, value, strict=True)))
            total = total.jacobian(x) * sympy.Matrix(names)
        return total

    def evaluated(tree):
        kept = []
        total = differential(tree, kept)
        for values in reversed(kept):
            total = total.subs(values)
        return total.expand()

    def is_gradient(vector):
        jacobian = vector.jacobian(x)
        return (jacobian - jacobian.T).expand().is_zero_matrix

    for free in bs.trees.free_tree_classes(4):
        total = sympy.zeros(3, 1)
        for tree, _, _ in free.rootings:
            total += evaluated(tree) / tree.symmetry
        assert is_gradient(total)
        if len(free.rootings) > 1:
            assert not is_gradient(evaluated(free.rootings[0].tree))


@pytest.mark.parametrize("make", [bs.memory.momentum, bs.memory.nesterov])
@pytest.mark.parametrize("beta", [1, "1", 0.9])
def test_a_beta_of_one_and_floats_are_refused(make, beta):
    with pytest.raises(bs.IntegratorError, match=r"^beta must be an exact number or formula other than 1, but was "):
        make(beta)


def test_a_scaled_step_of_symbols_is_the_same_tree_by_tree():
    s, factor = bs.series(bs.memory.momentum(), 4), 1 / (1 + BETA)
    for tree, x in s.scale_step(factor).items():
        assert sympy.cancel(x - s[tree] * factor**tree.order) == 0
    root = bs.modified_equation("gauss2", 4)
    assert root.scale_step(sympy.sqrt(2)).scale_step(sympy.sqrt(2)) == root.scale_step(2)
