"""Substitution and the modifying integrator: against sums over partitions, published tables, and each other."""

from fractions import Fraction

import pytest
import sympy
from series_oracles import partitions, substituted

import bseries as bs
from trees.table import TreeTable, partitions_of

SIZES = [(6, 1), (4, 2), (3, 3)]
METHODS = [
    "explicit-midpoint", "rk4", "implicit-midpoint", "gauss2", "gauss3", "radau-iia2", "lobatto-iiic3",
    "dormand-prince54", "crouzeix3", "stormer-verlet", "symplectic-euler-p", "lobatto-iiia-iiib3",
]  # fmt: skip
LEVELS = [
    [0], [0, 1], [0, 1, 1], [0, 1, 2], [0, 1, 1, 1], [0, 1, 1, 2], [0, 1, 2, 2], [0, 1, 2, 3], [0, 1, 1, 1, 1],
    [0, 1, 1, 1, 2], [0, 1, 1, 2, 2], [0, 1, 1, 2, 3], [0, 1, 2, 1, 2], [0, 1, 2, 2, 2], [0, 1, 2, 2, 3],
    [0, 1, 2, 3, 3], [0, 1, 2, 3, 4],
]  # fmt: skip
HEUN = ([[0, 0], [1, 0]], ["1/2", "1/2"])  # SSPRK(2,2)
# Modifying integrators as BSeries.jl computes them, on the trees of LEVELS.
PUBLISHED = {
    "explicit-midpoint": "1 0 1/12 1/6 0 0 -1/8 -1/8 1/80 1/60 1/240 1/80 7/240 9/80 13/120 13/80 2/15",
    "heun2": "1 0 -1/6 1/6 0 1/8 0 -1/8 1/5 7/120 -7/120 -2/15 1/120 -1/5 -7/120 7/120 2/15",
}


def identity_field(order, colors=1, names=()):
    return bs.BSeries.from_rule(lambda tree: int(tree.order == 1), order, empty=0, colors=colors, names=names)


def invertible(series):
    """The series with 2, 3, … at single nodes, so that it can be divided by."""
    return bs.BSeries.from_rule(
        lambda tree: tree.color + 2 if tree.order == 1 else series[tree],
        series.order, empty=series.empty, colors=series.table.colors,
    )  # fmt: skip


@pytest.mark.parametrize(("order", "colors"), SIZES)
def test_substitution_is_the_sum_over_partitions(execution, random_series, order, colors):
    b, a = random_series(order, 1, 0, colors), random_series(order, 2, 1, colors)
    result = bs.substitute(b, a)
    assert result["∅"] == 1
    assert all(result[tree] == substituted(b, a, tree) for tree in b)


@pytest.mark.parametrize(("order", "colors"), SIZES)
def test_substitution_acts_on_compositions_and_logarithms(execution, random_series, order, colors):
    b = random_series(order, 3, 0, colors)
    a, c = random_series(order, 4, 1, colors), random_series(order, 5, 1, colors)
    assert bs.compose(bs.substitute(b, a), bs.substitute(b, c)) == bs.substitute(b, bs.compose(a, c))
    assert bs.substitute(b, a).log() == bs.substitute(b, a.log())
    assert bs.substitute(b, a.inverse()) == bs.substitute(b, a).inverse()
    assert bs.substitute(b, bs.exact_flow(order, colors=colors)) == b.exp()


@pytest.mark.parametrize(("order", "colors"), SIZES)
def test_substitution_is_a_group_law(execution, random_series, order, colors):
    b, c = (invertible(random_series(order, seed, 0, colors)) for seed in (6, 7))
    a = random_series(order, 8, 1, colors)
    assert bs.substitute(bs.substitute(b, c), a) == bs.substitute(b, bs.substitute(c, a))
    assert bs.substitute(b, c) != bs.substitute(c, b)
    unit = identity_field(order, colors)
    assert bs.substitute(unit, a) == a
    assert bs.substitute(b, unit) == b
    inverse = bs.algebra.substitution_inverse(b)
    assert bs.substitute(inverse, b) == unit
    assert bs.substitute(b, inverse) == unit


@pytest.mark.parametrize("name", METHODS)
def test_stage_by_stage_is_the_same_as_over_partitions(execution, random_series, name):
    method = bs.method(name)
    colors = len(method.names)
    order = 6 if colors == 1 and name != "crouzeix3" else 4
    s = bs.series(method, order)
    b = bs.BSeries(s.table, random_series(order, 9, 0, colors).stored, 0, names=s.names)
    assert bs.substitute(b, method) == bs.substitute(b, s)
    assert bs.modifying_integrator(method, order) == bs.modifying_integrator(s)


@pytest.mark.parametrize("name", METHODS)
def test_modified_and_modifying_equations_undo_each_other(execution, name):
    method = bs.method(name)
    order = 6 if len(method.names) == 1 and name != "crouzeix3" else 4
    modifying, modified = bs.modifying_integrator(method, order), bs.modified_equation(method, order)
    exact = bs.exact_flow(order, colors=len(method.names), names=method.names)
    assert bs.substitute(modifying, method) == exact
    assert bs.substitute(modified, exact) == bs.series(method, order)
    unit = identity_field(order, len(method.names), method.names)
    assert bs.substitute(modifying, modified) == bs.substitute(modified, modifying) == unit
    assert bs.algebra.substitution_inverse(modified) == modifying


@pytest.mark.parametrize("name", ["fehlberg45", "nystrom5", "dormand-prince54", "verner65", "gauss6", "radau-iia5"])
def test_terms_that_vanish_have_no_common_denominator(execution, name):
    """Below its order a modified equation is zero over claimed denominators beyond 64 bits."""
    modified = bs.modified_equation(bs.method(name), 5)
    assert bs.substitute(modified, bs.exact_flow(5)) == bs.series(bs.method(name), 5)
    unit = identity_field(5, 1)
    assert bs.substitute(bs.algebra.substitution_inverse(modified), modified) == unit


@pytest.mark.parametrize("name", ["blanes-moan4", "kahan-li8", "tsit5"])
def test_what_decimals_leave_uncertain_of_a_modifying_integrator(execution, name):
    """The sum of the weights is as uncertain as the digits; other powers of two divide the changed decimals."""
    method = bs.method(name)
    colors = len(method.names)
    b = bs.modifying_integrator(method, 2, max_children=[[0] * colors] * colors)
    assert all(0 < b.uncertainty(at) < 1e-12 for at in range(len(b)))


@pytest.mark.parametrize("name", PUBLISHED)
def test_modifying_integrators_as_published(execution, name):
    method = bs.RungeKutta(*HEUN) if name == "heun2" else bs.method(name)
    b = bs.modifying_integrator(method, 5)
    assert [b[bs.Tree.from_levels(levels)] for levels in LEVELS] == [Fraction(x) for x in PUBLISHED[name].split()]


def test_the_sum_that_others_measure(execution):
    assert sum(bs.modifying_integrator(bs.method("explicit-midpoint"), 9).values()) == Fraction(5460293, 241920)


@pytest.mark.slow
def test_many_digits_take_many_primes():
    method = bs.RungeKutta([[0, 0], [Fraction(123456789, 987654321), 0]], [Fraction(1, 3**20), 1 - Fraction(1, 3**20)])
    b = bs.modifying_integrator(method, 7)
    assert bs.substitute(b, method) == bs.exact_flow(7)
    assert bs.substitute(b, bs.series(method, 7)) == bs.exact_flow(7)


def test_restricted_tables_hold_the_restriction_of_the_full_result():
    verlet, limits = bs.method("stormer-verlet"), [[0, None], [None, 0]]
    small, full = (bs.modifying_integrator(verlet, 5, max_children=x) for x in (limits, None))
    assert len(small) < len(full)
    assert all(value == full[tree] for tree, value in small.items())
    b = bs.modified_equation(verlet, 5, max_children=limits)
    expected = bs.substitute(bs.modified_equation(verlet, 5), verlet)
    assert all(value == expected[tree] for tree, value in bs.substitute(b, verlet).items())


def test_symbols_and_roots_stay_exact():
    sdirk = bs.method("sdirk2")
    b = bs.modifying_integrator(sdirk, 4)
    assert b.domain == "QQ(gamma)"
    assert bs.substitute(b, sdirk) == bs.exact_flow(4)
    assert bs.modifying_integrator(bs.series(sdirk, 4)) == b
    mixed = bs.substitute(b, bs.method("gauss2"))
    assert mixed == bs.substitute(b, bs.series(bs.method("gauss2"), 4))


@pytest.mark.parametrize("number", [sympy.Symbol("g"), 1 + sympy.sqrt(2)])
def test_inverses_of_symbols_and_roots(number):
    """The inverse has 1/g where the field has g, at the single node."""
    b = bs.BSeries.from_rule(lambda tree: number if tree.order == 1 else 1, 3, empty=0)
    x = bs.algebra.substitution_inverse(b)
    assert sympy.simplify(x["τ"] * number) == 1
    assert bs.substitute(x, b) == bs.substitute(b, x) == identity_field(3)


def test_entries_with_symbols_in_their_denominators():
    c = sympy.Symbol("c")
    method = bs.RungeKutta([[0, 0], [c, 0]], [1 - 1 / (2 * c), 1 / (2 * c)])
    b = bs.modified_equation(bs.method("gauss2"), 4)
    expected = bs.substitute(b, bs.series(method, 4))
    assert bs.substitute(b, method) == expected
    assert sympy.simplify(expected["[τ,τ]"] - c / 2) == 0
    inverse = bs.modifying_integrator(method, 4)
    assert bs.substitute(inverse, method) == bs.exact_flow(4)
    assert bs.modifying_integrator(bs.series(method, 4)) == inverse


@pytest.mark.parametrize("name", ["rk4", "gauss3", "stormer-verlet"])
def test_floats_are_near_the_exact_numbers(execution, name):
    method = bs.method(name)
    exact, rounded = bs.modifying_integrator(method, 4), bs.modifying_integrator(method.to_float(), 4)
    assert not rounded.is_exact
    assert max(abs(float(x) - y) for x, y in zip(exact.values(), rounded.values(), strict=True)) < 1e-14
    again = bs.substitute(exact.to_float(), method)
    assert (
        max(
            abs(float(x) - y)
            for x, y in zip(bs.exact_flow(4, colors=len(method.names)).values(), again.values(), strict=True)
        )
        < 1e-14
    )


@pytest.mark.parametrize(("order", "colors"), [(6, 1), (4, 2)])
def test_partitions_are_the_subsets_of_edges(execution, order, colors):
    table = TreeTable(order, colors)
    start, skeleton, part, kept = partitions_of(table)
    assert kept == sum(len(table.ids(n)) << (n - 1) for n in range(1, order))
    for tree in table:
        first = start[tree.order] + (table.index(tree) << (tree.order - 1))
        ids = range(first, first + (1 << (tree.order - 1)))
        listed = sorted((str(table[int(skeleton[i])]), str(table[int(part[i])])) for i in ids)
        assert listed == sorted((str(s), str(parts[0])) for s, parts in partitions(tree))


def test_negative_controls():
    """Wrong conventions are caught: the other order of the operands, and 1/σ in the coefficients."""
    a = bs.series(bs.method("rk4"), 6)
    b = bs.modified_equation(bs.method("explicit-midpoint"), 6)
    assert bs.substitute(b, b) != bs.substitute(b, bs.modified_equation(bs.method("rk4"), 6))
    assert bs.substitute(a.log(), bs.exact_flow(6)) == a
    scaled = bs.BSeries.from_rule(lambda tree: b[tree] / tree.symmetry, 6, empty=0)
    assert bs.substitute(scaled, bs.exact_flow(6)) != bs.series(bs.method("explicit-midpoint"), 6)


W = bs.PartitionedRungeKutta(
    {"p": {"A": [[0, 0], [1, 0]], "b": [1, -1]}, "q": {"A": [[0, 0], [1, 0]], "b": [0, 1]}}, warn=False
)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bs.substitute(bs.exact_flow(3), bs.exact_flow(3)), "b must be a field, .* but has 1 there"),
        (lambda: bs.substitute(identity_field(3), bs.exact_flow(4)), "both series must have the same trees"),
        (lambda: bs.substitute(identity_field(3), bs.method("stormer-verlet")), "b must have the colours .* p, q"),
        (lambda: bs.substitute(identity_field(3), "rk4"), "method must be a method .* a property `program`"),
        (lambda: bs.modifying_integrator(identity_field(3)), "method must be a flow"),
        (lambda: bs.modifying_integrator(bs.exact_flow(3), 4), "order must be at most 3"),
        (lambda: bs.modifying_integrator(W, 3), "sums of the weights of custom must not be 0, .* for p"),
        (
            lambda: bs.algebra.substitution_inverse(identity_field(2) * 0),
            "coefficients of single nodes in b must not be 0",
        ),
        (lambda: bs.algebra.substitution_inverse(bs.exact_flow(2)), "b must be a field"),
        (
            lambda: bs.modifying_integrator(bs.exact_flow(4, max_children=2)),
            "method must be a method, or a series on all trees .* but was a series on TreeTable",
        ),
        (lambda: partitions_of(TreeTable(3, max_children=2)), "table must hold all trees"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, message):
    with pytest.raises(bs.errors, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("order", "colors"), [(6, 1), (4, 2)])
def test_the_substitution_coproduct_gives_the_same(random_series, order, colors):
    b, a = random_series(order, 10, 0, colors), random_series(order, 11, 1, colors)
    expected = bs.substitute(b, a)
    for tree in b:
        assert bs.hopf.substitution_coproduct(tree).evaluate(b.__getitem__, a.__getitem__) == expected[tree]
