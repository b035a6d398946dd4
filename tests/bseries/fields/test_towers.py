"""Elementary differentials by towers: against their definition, on every kind of sites, and run by the interpreter."""

import itertools

import numpy as np
import pytest
import sympy

import bseries as bs
from bseries.fields import taylor_polynomials
from bseries.fields.evaluation import PreciseSeries
from integrators.exact.expressions import ELEMENTARY

X, Y = sympy.symbols("x y")
PLANE = bs.Scene({"z": ["x", "y"]}, field={"x": "x*y^2 - sin(x + 2*y)", "y": "exp(x/2)/(1 + y^2) - x^3"})
POINT = np.array([0.3, -0.7])


def single_coefficient(tree, order, colors=1, names=()):
    return bs.BSeries.from_rule(lambda t: int(t == tree), order, empty=0, colors=colors, names=names)


def differential(tree, field, variables):
    """F([τ1, …, τm]) = f^(m)(F(τ1), …, F(τm)), by differentiating along one child after the other."""
    vectors = [differential(child, field, variables) for child in tree.children]
    result = []
    for component in field:
        total = 0
        for chosen in itertools.product(range(len(variables)), repeat=len(vectors)):
            derivative = component
            for i in chosen:
                derivative = derivative.diff(variables[i])
            total += derivative * sympy.prod(v[i] for v, i in zip(vectors, chosen, strict=True))
        result.append(total)
    return result


@pytest.mark.parametrize("tree", bs.TreeTable(5), ids=str)
def test_each_tree_alone_gives_its_elementary_differential(tree):
    f = bs.modified_field(single_coefficient(tree, 5), PLANE, route="towers")
    values = dict(zip((X, Y), map(sympy.Rational, POINT), strict=True))
    expected = [float(x.subs(values).evalf(30)) / tree.symmetry for x in differential(tree, PLANE.field, (X, Y))]
    terms = f.terms(POINT)
    np.testing.assert_allclose(terms[tree.order - 1], expected, rtol=1e-14)
    assert np.count_nonzero(np.abs(terms).sum(axis=1)) == 1


def test_two_trees_are_told_apart():
    one, other = (single_coefficient(bs.Tree(text), 3) for text in ("[τ,τ]", "[[τ]]"))
    values = [bs.modified_field(s, PLANE, route="towers").terms(POINT)[2] for s in (one, other)]
    assert np.abs(values[0] - values[1]).max() > 1e-3


FUNCTIONS = {name: f"{name}(x/3 + {2 if name == 'acosh' else 0.3})" for name in ELEMENTARY}
POWERS = [
    "x^7",
    "(1 + x)^(-3)",
    "(1 + x)^(3/2)",
    "(2 + x)^(-5/2)",
    "(2 + x)^(1/3)",
    "(2 + x)^pi",
    "(1 + x^2)^x",
    "root(x + 2, 5)",
]


@pytest.mark.parametrize("formula", [*FUNCTIONS.values(), *POWERS])
def test_functions(formula):
    scene = bs.Scene({"x": 1}, field={"x": formula})
    f = bs.modified_field(bs.method("rk4"), scene, 7, route="towers")
    point = 0.41
    precise = [[float(x) for x in row] for row in PreciseSeries(f, 30).terms([point])]
    exact = [float(f.symbolic(k)[0].subs(X, sympy.Rational(point)).evalf(30)) for k in range(7)]
    scale = np.abs(exact).max()
    np.testing.assert_allclose(np.ravel(precise), exact, rtol=1e-14, atol=1e-15 * scale)
    np.testing.assert_allclose(f.terms([point])[:, 0], exact, rtol=1e-13, atol=1e-14 * scale)


def test_powers_of_zero_have_their_derivatives():
    f = bs.modified_field(bs.method("explicit-euler"), bs.Scene({"x": 1}, field={"x": "1 + x^3"}), 5, route="towers")
    np.testing.assert_allclose(f.terms([0.0])[:, 0], [float(f.symbolic(k)[0].subs(X, 0)) for k in range(5)])


def written_flat(scene):
    """The same problem without terms over sites."""
    sizes = {block.name: list(block.variables) for block in scene.blocks}
    return bs.Scene(sizes, field={str(v): f for v, f in zip(scene.variables, scene.field, strict=True)})


SITES = {
    "each": bs.Term(over="each", hamiltonian="m_i*sin(q_i)*cos(p_i)"),
    "chain": bs.Term(over="chain", hamiltonian="exp(q_i - q_j)*m_i/m_j"),
    "ring": bs.Term(over="ring", hamiltonian="m_j*log(2 + (q_i - q_j)^2) + p_i*q_j^2"),
    "pairs": bs.Term(over="pairs", hamiltonian="m_i*m_j/sqrt(1 + (q_i - q_j)^2)"),
    "table": bs.Term(over=[(1, 3), (2, 5), (5, 4)], hamiltonian="m_i*(q_i - 2*q_j)^3"),
    "triples": bs.Term(over=[(1, 2, 3), (5, 4, 1)], hamiltonian="cos(q_i - 2*q_j + q_k)"),
    "field": bs.Term(over="pairs", field={"p_i": "p_j*(q_i - q_j)^2", "q_j": "sin(p_i)/m_j"}),
}


@pytest.mark.few(5)
@pytest.mark.parametrize("kind", SITES)
@pytest.mark.parametrize("method", ["rk4", "stormer-verlet-kdk"])
def test_sites_give_what_the_flat_formulas_give(kind, method):
    kinetic = bs.Term(over="each", hamiltonian="p_i^2/(2*m_i)")
    masses = {"m": [1, "3/2", 2, "1/3", 5]}
    scene = bs.Scene({"p": 5, "q": 5}, terms=[kinetic, SITES[kind]], parameters=masses)
    y = np.random.default_rng(1).normal(size=10)
    ours = bs.modified_field(bs.method(method), scene, 5, route="towers")
    flat = bs.modified_field(bs.method(method), written_flat(scene), 5, route="towers")
    expected = flat.terms(y)
    np.testing.assert_allclose(ours.terms(y), expected, rtol=1e-12, atol=1e-13 * np.abs(expected).max())
    assert np.abs(ours.terms(y) - bs.modified_field(bs.method(method), scene, 5).terms(y[::-1].copy())).max() > 1e-3


@pytest.mark.parametrize("sites", [1, 2, 3, 4, 7])
def test_numbers_of_rows_that_do_not_fill_a_group(sites):
    terms = [SITES["pairs"], SITES["each"]] if sites > 1 else [SITES["each"]]
    scene = bs.Scene({"p": sites, "q": sites}, terms=terms, parameters={"m": list(range(1, sites + 1))})
    f = bs.modified_field(bs.method("implicit-midpoint"), scene, 5, route="towers")
    points = np.random.default_rng(2).normal(size=(2 * sites, 5))
    precise = np.array([PreciseSeries(f, 20).terms(list(column)) for column in points.T], float)
    scale = np.abs(precise).max()
    np.testing.assert_allclose(f.terms(points), precise.transpose(1, 2, 0), rtol=1e-12, atol=1e-13 * scale)


def test_truncated_polynomials_multiply():
    every = frozenset(range(taylor_polynomials.monomial_count(2, 3)))
    exponents = taylor_polynomials.monomials(2, 3)
    found = taylor_polynomials.products(2, 3, every, every, False)
    assert len(found) == len({(b, c) for _, b, c in found})
    assert all(tuple(map(sum, zip(exponents[b], exponents[c], strict=True))) == exponents[a] for a, b, c in found)
    assert len(found) == sum(sum(b) + sum(c) <= 3 for b in exponents for c in exponents)


def test_a_function_without_a_known_differential_equation():
    with pytest.raises(bs.SeriesError, match="elementary functions, but has 'gamma'"):
        taylor_polynomials.InstructionList(sympy.gamma(sympy.Symbol("x0")), 1, 2)
