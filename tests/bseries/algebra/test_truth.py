"""Values from outside: published sums, the lecture, tables of other packages, power series of the map itself."""

import json
from fractions import Fraction
from functools import cache
from itertools import product
from pathlib import Path

import pytest
import sympy
from series_oracles import weight

import bseries as bs
from trees import Tree

LECTURE = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())
CATALOGUE = {
    "explicit_euler": "explicit-euler",
    "implicit_euler": "implicit-euler",
    "implicit_midpoint": "implicit-midpoint",
    "trapezoidal": "trapezoidal",
    "explicit_midpoint": "explicit-midpoint",
    "heun": "heun2",
    "rk4": "rk4",
}


@pytest.mark.parametrize(
    ("order", "total"),
    [
        (9, Fraction(19063, 26880)),  # also published in the documentation of BSeries.jl
        (12, Fraction(1496137, 443520)),
        (15, Fraction(33555814121, 738017280)),
    ],
)
def test_sum_of_all_modified_coefficients_of_the_explicit_midpoint_rule(order, total):
    assert sum(bs.modified_equation(bs.method("explicit-midpoint"), order).coefficients()) == total


def square_factor(tree):
    """F(τ)(y) / y^(|τ|+1) for y' = y²: the derivatives of y² are y², 2y, 2, 0, …"""
    factor = (1, 2, 2)[len(tree.children)] if len(tree.children) <= 2 else 0
    for child in tree.children:
        factor *= square_factor(child)
    return factor


@pytest.mark.parametrize("max_children", [None, 2], ids=["all trees", "trees that can contribute"])
@pytest.mark.parametrize("name", LECTURE["example1_and_fig1"]["coefficients"])
def test_modified_equation_of_a_quadratic_problem(name, max_children, execution):
    """Example 1 of the lecture: y' = y², coefficients of h^k y^(k+2)."""
    expected = [Fraction(text) for text in LECTURE["example1_and_fig1"]["coefficients"][name]]
    b = bs.modified_equation(bs.method(CATALOGUE[name]), len(expected), max_children=max_children)
    found = [Fraction(0)] * len(expected)
    for tree, value in b.items():
        found[tree.order - 1] += value * square_factor(tree) / tree.symmetry
    assert found == expected


@pytest.mark.parametrize("max_children", [None, 1], ids=["all trees", "trees that can contribute"])
@pytest.mark.parametrize("name", LECTURE["example3_linear"]["b"])
def test_modified_equation_of_a_linear_problem(name, max_children, execution):
    """Example 3 of the lecture: (1/h) log R(hA) = Σ b_k h^(k−1) A^k, and only tall trees contribute."""
    expected = [Fraction(text) for text in LECTURE["example3_linear"]["b"][name]]
    b = bs.modified_equation(bs.method(CATALOGUE[name]), len(expected), max_children=max_children)
    tall, found = Tree("τ"), []
    while tall.order <= len(expected):
        found.append(b[tall])
        tall = Tree.join([tall])
    assert found == expected


# BSeries.jl, test/runtests.jl: modified_equation, by level sequences in the order of its own listing.
LEVELS = (  # noqa: SIM905
    "[0] [0,1] [0,1,1] [0,1,2] [0,1,1,1] [0,1,1,2] [0,1,2,2] [0,1,2,3] [0,1,1,1,1] [0,1,1,1,2] [0,1,1,2,2] "
    "[0,1,1,2,3] [0,1,2,1,2] [0,1,2,2,2] [0,1,2,2,3] [0,1,2,3,3] [0,1,2,3,4]"
).split(" ")
PUBLISHED = {
    "explicit-midpoint": "1 0 -1/12 -1/6 0 0 1/8 1/8 7/240 1/40 3/80 7/240 1/30 -7/240 -1/40 -19/240 -1/20",
    "heun2": "1 0 1/6 -1/6 0 -1/8 0 1/8 -1/30 -7/120 7/120 1/20 3/40 1/30 7/120 -7/120 -1/20",
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_modified_equations_published_by_another_package(name, execution):
    b = bs.modified_equation(bs.method(name), 5)
    assert [b[levels] for levels in LEVELS] == [Fraction(text) for text in PUBLISHED[name].split()]


def test_symplectic_euler_as_tabulated():
    """HLW, table IX.10.1, for the method implicit in p: weights of the trees of the p-part."""
    b = bs.modified_equation(bs.method("symplectic-euler-p"), 3)
    expected = {"p[p]": "1/2", "p[q]": "-1/2", "p[p[p]]": "1/3", "p[q[q]]": "1/3", "p[p[q]]": "-1/6", "p[q[p]]": "-1/6"}
    expected |= {"p[p,p]": "1/6", "p[p,q]": "-1/3", "p[q,q]": "1/6"}
    assert {tree: str(b[tree]) for tree in expected} == expected


P, Q = sympy.symbols("p q")
FIELD = {"p": 1 + 2 * Q - P * Q**2 + P**2, "q": P - Q + P**2 * Q - 3 * Q**3}  # not separable, not Hamiltonian
POINT = {P: sympy.Rational(1, 2), Q: sympy.Rational(-2, 3)}
ORDER = 5


def differential(tree, names=("p", "q")):
    """F(τ) at POINT for the coloured field, from the definition by partial derivatives."""
    children = [differential(child) for child in tree.children]
    total = 0
    for slots in product((P, Q), repeat=len(children)):
        if any(str(slot) != names[child.color] for slot, child in zip(slots, tree.children, strict=True)):
            continue
        derivative = FIELD[names[tree.color]]
        for slot in slots:
            derivative = sympy.diff(derivative, slot)
        total += derivative.subs(POINT)
    for value in children:
        total *= value
    return total


def numerical_map(parts):
    """(p1, q1) as polynomials in h: fixed-point iteration of the stages on truncated power series."""
    h = sympy.symbols("h")

    def cut(expression):
        return sum(sympy.Poly(expression, h).coeff_monomial(h**k) * h**k for k in range(ORDER + 1))

    start = {"p": POINT[P], "q": POINT[Q]}
    stages = len(parts["p"][1])
    Y = {name: [start[name]] * stages for name in "pq"}
    for _ in range(ORDER + 1):
        f = {name: [cut(FIELD[name].subs({P: Y["p"][j], Q: Y["q"][j]})) for j in range(stages)] for name in "pq"}
        Y = {
            name: [
                start[name] + cut(h * sum(parts[name][0][i][j] * f[name][j] for j in range(stages)))
                for i in range(stages)
            ]
            for name in "pq"
        }
    end = {
        name: start[name] + cut(h * sum(b * k for b, k in zip(parts[name][1], f[name], strict=True))) for name in "pq"
    }
    return {name: [sympy.Poly(end[name], h).coeff_monomial(h**k) for k in range(1, ORDER + 1)] for name in "pq"}


E1 = ([[1]], [1]), ([[0]], [1])
HALF = sympy.Rational(1, 2)
MAPS = {
    "symplectic-euler-p": {"p": ([[1]], [1]), "q": ([[0]], [1])},  # p1 = p0 + h f(p1, q0), q1 = q0 + h g(p1, q0)
    "symplectic-euler-q": {"p": ([[0]], [1]), "q": ([[1]], [1])},
    # HLW (VI.3.4): p½ = p0 + h/2 f(p½, q0), q1 = q0 + h/2 (g(p½, q0) + g(p½, q1)), p1 = p½ + h/2 f(p½, q1)
    "stormer-verlet-kdk": {"p": ([[HALF, 0], [HALF, 0]], [HALF, HALF]), "q": ([[0, 0], [HALF, HALF]], [HALF, HALF])},
    "stormer-verlet-dkd": {"q": ([[HALF, 0], [HALF, 0]], [HALF, HALF]), "p": ([[0, 0], [HALF, HALF]], [HALF, HALF])},
}


@pytest.mark.parametrize("name", MAPS)
def test_partitioned_series_against_the_power_series_of_the_map_itself(name):
    s = bs.series(bs.method(name), ORDER)
    found = {"p": [0] * ORDER, "q": [0] * ORDER}
    for tree, value in s.items():
        if value:
            exact = sympy.Rational(value.numerator, value.denominator)
            found["pq"[tree.color]][tree.order - 1] += exact * differential(tree) / tree.symmetry
    assert found == numerical_map(MAPS[name])
    other = next(key for key in MAPS if key != name)
    assert found != numerical_map(MAPS[other])  # the comparison can fail


@cache
def weights(name, order):
    """Elementary weights by definition, once for all executions."""
    parts = [(part.A, part.b) for part in bs.method(name).partitions]
    return {tree: weight(parts, tree) for tree in bs.TreeTable(order, colors=len(parts))}


@pytest.mark.parametrize(
    "name", ["rk4", "ralston3", "dormand-prince54", "qin-zhang", "lobatto-iiic3", "symplectic-euler-q"]
)
def test_elementary_weights_from_the_definition(name, execution):
    order = 6 if len(bs.method(name).partitions) == 1 else 4
    assert dict(bs.series(bs.method(name), order).items()) == weights(name, order)


def test_families_given_by_their_nodes_polynomial_agree_with_their_tableaus():
    for name in ("gauss3", "radau-iia2", "lobatto-iiia4"):
        method = bs.method(name)
        plain = bs.RungeKutta(method.A, method.b, warn=False)
        assert method.algebra is not None
        assert plain.algebra is None
        assert bs.modified_equation(method, 5) == bs.modified_equation(plain, 5)
        assert bs.modified_equation(plain, 5).domain == "QQ"  # the smallest domain that holds all coefficients
