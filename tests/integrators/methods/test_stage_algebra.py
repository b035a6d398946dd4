"""Methods held without their roots: against closed forms, defining conditions and NumPy's quadrature."""

import pickle
import subprocess
import sys
from fractions import Fraction
from math import comb

import mpmath
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from integrators import IntegratorError, PartitionedRungeKutta, RungeKutta, StageAlgebra, method
from integrators.exact import polynomials as poly


def legendre(stages):
    return [Fraction((-1) ** (stages - k) * comb(stages, k) * comb(stages + k, k), comb(2 * stages, stages))
            for k in range(stages + 1)]  # fmt: skip


def collocation(nodes):
    """A x^l = x^(l+1)/(l+1), and weights that integrate exactly: collocation at the roots of a polynomial."""
    stages = len(nodes) - 1
    integrals = [poly.scale(poly.power(k + 1), Fraction(1, k + 1)) for k in range(stages)]
    columns = [poly.remainder(integral, poly.trim(nodes)) for integral in integrals]
    rows = [[column[k] if k < len(column) else 0 for column in columns] for k in range(stages)]
    return StageAlgebra(nodes, rows, [Fraction(1, k + 1) for k in range(stages)])


def gauss(stages):
    return collocation(legendre(stages))


def lobatto_iiia(stages):
    upper, lower = (poly.scale(p, comb(2 * n, n)) for n in (stages, stages - 2) for p in [tuple(legendre(n))])
    nodes = poly.add(upper, poly.scale(lower, -1))
    return collocation(poly.scale(nodes, 1 / nodes[-1]))


RADAU_IIA2 = collocation([Fraction(1, 3), Fraction(-4, 3), 1])  # (x − 1/3)(x − 1)

root3, root15 = sympy.sqrt(3), sympy.sqrt(15)
GAUSS2 = ([["1/4", 1 / sympy.S(4) - root3 / 6], [1 / sympy.S(4) + root3 / 6, "1/4"]], ["1/2", "1/2"])
GAUSS3 = (
    [
        ["5/36", sympy.Rational(2, 9) - root15 / 15, sympy.Rational(5, 36) - root15 / 30],
        [sympy.Rational(5, 36) + root15 / 24, "2/9", sympy.Rational(5, 36) - root15 / 24],
        [sympy.Rational(5, 36) + root15 / 30, sympy.Rational(2, 9) + root15 / 15, "5/36"],
    ],
    ["5/18", "4/9", "5/18"],
)
LOBATTO3 = ([[0, 0, 0], ["5/24", "1/3", "-1/24"], ["1/6", "2/3", "1/6"]], ["1/6", "2/3", "1/6"])
RADAU2 = ([["5/12", "-1/12"], ["3/4", "1/4"]], ["3/4", "1/4"])


@pytest.mark.parametrize(
    ("algebra", "tableau"),
    [(gauss(2), GAUSS2), (gauss(3), GAUSS3), (lobatto_iiia(3), LOBATTO3), (RADAU_IIA2, RADAU2)],
    ids=["gauss2", "gauss3", "lobatto-iiia3", "radau-iia2"],
)
def test_textbook_tableaux(algebra, tableau):
    """HLW Table II.1.1, Hairer–Wanner Tables IV.5.5 and IV.5.7."""
    expected = RungeKutta(*tableau)
    a, b, c = algebra.tableau_exact()
    assert RungeKutta(a, b, c) == expected


def test_rational_nodes_need_no_sympy():
    code = """
import sys
from integrators import RungeKutta, StageAlgebra
method = RungeKutta.from_algebra(StageAlgebra(["0".count("1"), -1, 1], [[0, 0], [1, 1]], [1, 1]))
method.A, method.domain, method.is_symplectic, method.is_symmetric, method.issues, str(method)
sys.exit("sympy" in sys.modules or "numpy" in sys.modules)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("stages", [1, 2, 5, 10, 16])
def test_gauss_agrees_with_numpy(stages):
    points, weights = np.polynomial.legendre.leggauss(stages)
    a, b, c = gauss(stages).tableau_float()
    np.testing.assert_allclose(c, (points + 1) / 2, rtol=1e-13)
    np.testing.assert_allclose(b, weights / 2, rtol=1e-13)
    np.testing.assert_allclose(np.sum(a, axis=1), c, rtol=1e-13)


@pytest.mark.parametrize("algebra", [gauss(10), lobatto_iiia(7)], ids=["gauss10", "lobatto-iiia7"])
def test_decimals_satisfy_the_conditions(algebra):
    """C(s): Σ_j a_ij c_j^k = c_i^(k+1)/(k+1), to all decimals asked for."""
    with mpmath.workdps(70):
        a, b, c = algebra.tableau_decimal(60)
        assert all(abs(x - y) < mpmath.mpf(10) ** -60 for x, y in zip(c, algebra.nodes_decimal(60), strict=True))
        for k in range(algebra.stages):
            for row, node in zip(a, c, strict=True):
                gap = sum(value * x**k for value, x in zip(row, c, strict=True)) - node ** (k + 1) / (k + 1)
                assert abs(gap) < mpmath.mpf(10) ** -59
            assert abs(sum(w * x**k for w, x in zip(b, c, strict=True)) - mpmath.mpf(1) / (k + 1)) < 1e-59


@pytest.mark.parametrize("algebra", [gauss(4), gauss(5), lobatto_iiia(5)], ids=["gauss4", "gauss5", "lobatto-iiia5"])
def test_floats_are_the_exact_entries_rounded(algebra):
    exact, rounded = algebra.tableau_exact(), algebra.tableau_float()
    for row, numbers in zip((*exact[0], *exact[1:]), (*rounded[0], *rounded[1:]), strict=True):
        assert [float(sympy.N(value, 40)) for value in row] == list(numbers)


def test_exact_zeros_stay_zero():
    algebra = lobatto_iiia(6)
    assert set(algebra.tableau_float()[0][0]) == {0.0}
    assert set(algebra.tableau_exact()[0][0]) == {0}


def test_nodes_by_kind_of_factor():
    assert gauss(1).nodes() == (Fraction(1, 2),)
    assert gauss(2).nodes() == (sympy.Rational(1, 2) - root3 / 6, sympy.Rational(1, 2) + root3 / 6)
    assert all(not node.has(sympy.CRootOf) for node in gauss(4).nodes())
    assert gauss(5).nodes()[2] == Fraction(1, 2)
    assert all(isinstance(node, sympy.CRootOf) for node in gauss(6).nodes())
    nodes = gauss(7).nodes()
    assert nodes[3] == Fraction(1, 2)
    assert [float(node) for node in nodes] == sorted(float(node) for node in nodes)


@pytest.mark.parametrize("stages", [1, 2, 3, 6])
def test_moments(stages):
    """Gauss integrates x^k exactly for k < 2s only; Lobatto and Radau two and one powers less."""
    moments = gauss(stages).moments(2 * stages + 1)
    assert [m * (k + 1) == 1 for k, m in enumerate(moments)] == [True] * (2 * stages) + [False]
    assert [gauss(stages).moments(count) for count in (0, 1)] == [(), (1,)]
    _, weights, nodes = gauss(stages).tableau_float()
    expected = [np.dot(weights, np.power(nodes, k)) for k in range(2 * stages + 1)]
    assert np.allclose([float(moment) for moment in moments], expected, rtol=1e-12)


def test_operations_are_those_of_the_stages():
    algebra = gauss(3)
    a, b, c = algebra.tableau_float()
    f, g = poly.trim([1, 2, 3]), poly.trim([2, 0, -1])

    def values(p):
        return np.polynomial.polynomial.polyval(np.array(c), [float(v) for v in p])

    np.testing.assert_allclose(values(algebra.multiply(f, g)), values(f) * values(g))
    np.testing.assert_allclose(values(algebra.apply(f)), np.array(a) @ values(f))
    assert float(algebra.weigh(f)) == pytest.approx(np.dot(b, values(f)))
    assert [float(v) for v in algebra.values(f)] == pytest.approx(values(f))


def perturbed(algebra):
    rows = [list(row) for row in algebra.A]
    rows[0][0] += Fraction(1, 7)
    return StageAlgebra(algebra.polynomial, rows, algebra.b)


@pytest.mark.parametrize(
    ("algebra", "symplectic", "symmetric"),
    [
        (gauss(2), True, True),
        (gauss(3), True, True),
        (lobatto_iiia(3), False, True),
        (RADAU_IIA2, False, False),
        (perturbed(gauss(2)), False, False),
        (perturbed(gauss(3)), False, False),
    ],
)
def test_structure_is_decided_alike_with_and_without_roots(algebra, symplectic, symmetric):
    method, explicit = RungeKutta.from_algebra(algebra), RungeKutta(*algebra.tableau_exact(), warn=False)
    assert method.is_symplectic is explicit.is_symplectic is symplectic
    assert method.is_symmetric is explicit.is_symmetric is symmetric
    assert method.is_explicit is explicit.is_explicit is False
    assert len(method.issues) == len(explicit.issues)


def test_large_methods_are_decided_without_roots():
    method = RungeKutta.from_algebra(gauss(20))
    assert method.is_symplectic
    assert method.is_symmetric
    assert not method.is_explicit
    assert method.issues == ()
    assert not RungeKutta.from_algebra(lobatto_iiia(20)).is_symplectic
    assert method.to_float().is_symplectic


def test_value_semantics():
    algebra = gauss(3)
    assert algebra == gauss(3)
    assert hash(algebra) == hash(gauss(3))
    assert algebra != gauss(2)
    assert algebra != lobatto_iiia(3)
    assert pickle.loads(pickle.dumps(algebra)) == algebra
    with pytest.raises(AttributeError, match="immutable"):
        algebra.b = ()
    assert "x^3" in repr(algebra)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1], [], []), "polynomial must be monic of degree 1 or more, but was 1"),
        (([0, 2], [[1]], [1]), "polynomial must be monic"),
        (([0, 0, 1], [[0, 0], [0, 0]], [1, 0]), "polynomial must have simple roots"),
        (([1, 0, 1], [[0, 0], [0, 0]], [1, 0]), "polynomial must have 2 real roots, but has 0"),
        (([0, 1], [[1, 2]], [1]), "A must have 1 rows of 1 entries, .* but had 1 rows of 2 entries"),
        (([0, 1], [], [1]), "but had 0 rows of no entries"),
        (([0, 1], [[1]], [1, 2]), "b must have 1 entries, .* but had 2"),
        (([0.5, 1], [[1]], [1]), "polynomial must hold integers and fractions, but entry 1 was 0.5"),
        (([0, 1], [[True]], [1]), "row 1 of A must hold integers and fractions, but entry 1 was True"),
        (([0, 1], 5, [1]), "A must be a sequence, but was 5"),
        (([0] * 200 + [1], [], []), "polynomial must have degree 100 at most, but has 200"),
    ],
)
def test_bad_algebras(arguments, message):
    with pytest.raises(IntegratorError, match=message):
        StageAlgebra(*arguments)


@pytest.mark.parametrize("digits", [0, -1, 2.5, True, 10**6])
def test_bad_digits(digits):
    with pytest.raises(IntegratorError, match="digits must be an integer from 1 to 1000, but was"):
        gauss(2).nodes_decimal(digits)


distinct = st.lists(st.fractions(-5, 5, max_denominator=50), min_size=1, max_size=6, unique=True)


def product(roots):
    value = poly.ONE
    for root in roots:
        value = poly.multiply(value, (-root, Fraction(1)))
    return value


@given(distinct)
def test_rational_roots_are_found_exactly(roots):
    p = product(roots)
    assert poly.count_real_roots(p) == (len(roots), True)
    assert poly.real_roots(p) == tuple(sorted(roots))


@given(distinct, distinct)
def test_sturm_chains_see_multiple_and_complex_roots(roots, others):
    p = product(roots)
    assert poly.count_real_roots(poly.multiply(p, p)) == (len(roots), False)
    assert poly.count_real_roots(poly.multiply(p, poly.trim([1, 0, 1]))) == (len(roots), True)
    both = poly.multiply(p, product(others))
    assert poly.count_real_roots(both) == (len({*roots, *others}), not {*roots} & {*others})


def test_close_roots_are_told_apart():
    gap = Fraction(1, 10**30)
    assert poly.real_roots(product([Fraction(1, 3), Fraction(1, 3) + gap, Fraction(7)]))[1] == Fraction(1, 3) + gap
    near = poly.multiply(poly.trim([Fraction(-2), 0, 1]), poly.trim([Fraction(-2) - gap, 0, 1]))
    found = poly.real_roots(near, 60)
    assert len(set(found)) == 4
    assert all(abs(abs(float(root)) - 2**0.5) < 1e-15 for root in found)


@pytest.mark.parametrize("decimals", [5, 30])
def test_rational_programs_are_near_the_tableau(decimals):
    irrational, rational = RungeKutta.from_algebra(gauss(2)), RungeKutta([["1/4", 0], ["1/2", "1/4"]], ["1/2", "1/2"])
    pair = PartitionedRungeKutta({"p": irrational, "q": rational}).rational_program(decimals)
    for program, count in ((irrational.rational_program(decimals), 1), (pair, 2)):
        assert program.domain == "QQ"
        for i, row in enumerate(irrational.A):
            terms = program.evaluations[count * i].at.terms
            assert all(abs(sympy.N(terms[count * j] - a, 40)) < 10**-decimals for j, a in enumerate(row))
    assert [pair.evaluations[e].at.terms.get(3, 0) for e in (0, 2)] == [0, Fraction(1, 4)]
    assert rational.rational_program(decimals) is rational.program


@pytest.mark.parametrize(("name", "expected"), [("gauss9", True), ("lobatto-iiia9", True), ("radau-ia9", False)])
def test_symmetry_is_decided_without_roots(name, expected, monkeypatch):
    monkeypatch.setattr(StageAlgebra, "tableau_exact", None)
    assert method(name).is_symmetric is expected


def typed(tableau):
    return RungeKutta(tableau.A, tableau.b, tableau.c, warn=False)


@pytest.mark.parametrize(
    ("name", "other"),
    [("gauss1", "implicit-midpoint"), ("radau-iia1", "implicit-euler"), ("lobatto-iiia2", "trapezoidal")],
)
def test_methods_of_equal_entries_are_equal(name, other):
    assert method(name) == method(other)
    assert hash(method(name)) == hash(method(other))


@pytest.mark.parametrize("name", ["gauss1", "gauss2", "gauss3", "radau-iia2", "lobatto-iiic3", "lobatto-iiia4"])
def test_a_tableau_and_its_stage_algebra_are_equal(name):
    one, two = method(name), typed(method(name))
    assert (one, two) == (two, one)
    assert len({one, two}) == 1
    changed = RungeKutta(one.A, [2 * x for x in one.b], one.c, warn=False)
    embedded = RungeKutta(one.A, one.b, one.c, embedded=[1] + [0] * (one.stages - 1), warn=False)
    assert one not in (changed, embedded, RungeKutta(one.to_float().A, one.to_float().b, warn=False))


def test_parts_of_partitioned_methods_are_equal_to_methods():
    momenta, positions = method("lobatto-iiia-iiib2").partitions
    assert positions == method("lobatto-iiia2") == method("trapezoidal")
    assert momenta == method("lobatto-iiib2") != positions
    assert method("lobatto-iiia-iiib2") == PartitionedRungeKutta({"p": typed(momenta), "q": typed(positions)})
