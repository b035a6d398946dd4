"""Structure tests: known orders, random fields with the structure as the second method, and series that lack it."""

import itertools
from fractions import Fraction
from math import prod

import field_oracles as oracle
import pytest
import sympy

import bseries as bs
from bseries.analysis.conjugation import CONJUGATE_STRUCTURES
from bseries.analysis.report import structure_of
from bseries.analysis.structure import (
    STRUCTURES,
    cubic_conditions,
    energy_conditions,
    hamiltonian_conditions,
    volume_conditions,
)
from integrators import WMethod
from trees.table import tree_table

SEPARABLE = [[0, None], [None, 0]]
NYSTROM = [[0, None], [1, 0]]  # p' = f(q), q' = p


def averaged(tree):
    """The averaged vector field method: ∫ f((1 − ξ) y₀ + ξ y₁) dξ."""
    return prod(map(averaged, tree.children), start=Fraction(1, 1 + len(tree.children)))


def avf(order):
    return bs.BSeries.from_rule(averaged, order)


def plain(A, b):
    return bs.RungeKutta([[Fraction(x) for x in row] for row in A], [Fraction(x) for x in b], warn=False)


METHODS = {
    # Celledoni, McLachlan, McLaren, Owren, Quispel, Wright, M2AN 43 (2009): energy preserved beyond the order
    "pseudo-energy 4": plain([[0] * 3, ["1/3", 0, 0], ["-5/48", "15/16", 0]], ["1/10", "1/2", "2/5"]),
    "pseudo-energy 3": plain([[0, 0], ["2/3", 0]], ["1/4", "3/4"]),
    # Butcher (1969), effective order 5
    "effective 5": plain(
        [[0] * 5, ["1/5", 0, 0, 0, 0], [0, "2/5", 0, 0, 0], ["3/16", 0, "5/16", 0, 0], ["1/4", 0, "-5/4", 2, 0]],
        ["1/6", 0, 0, "2/3", "1/6"],
    ),
    # Aubry, Chartier (1998), PS(2, 4, 2) with the parameter 3
    "pseudo-symplectic": plain([[0] * 3, ["21/20", 0, 0], ["121/126", "5/126", 0]], ["8/21", "-50/21", 3]),
}


def named(name):
    return METHODS.get(name) or bs.method(name)


@pytest.mark.parametrize(
    ("name", "accuracy", "symmetry", "symplecticity", "energy"),
    [
        # symplecticity and energy: BSeries.jl and pybs publish these; None: all orders
        ("rk4", 4, 5, 4, 4),
        ("effective 5", 4, 5, 4, 4),
        ("pseudo-energy 4", 2, 5, 2, 4),
        ("pseudo-energy 3", 2, 3, 2, 3),
        ("pseudo-symplectic", 2, 3, 4, 2),
        ("implicit-midpoint", 2, None, None, 2),
        ("gauss2", 4, None, None, 4),
        ("gauss3", 6, None, None, 6),
        ("trapezoidal", 2, None, 2, 2),
        ("lobatto-iiia3", 4, None, 4, 4),
        ("lobatto-iiib3", 4, None, 4, 4),
        ("explicit-euler", 1, 1, 1, 1),
        ("implicit-euler", 1, 1, 1, 1),
    ],
)
def test_orders_of_known_methods(name, accuracy, symmetry, symplecticity, energy, execution):
    order = 7
    method = named(name)
    verdicts = bs.analysis.accuracy, bs.symmetry, bs.symplecticity, bs.energy_preservation
    for test, expected in zip(verdicts, (accuracy, symmetry, symplecticity, energy), strict=True):
        found = test(method, order)
        assert found.order == (expected or order), test
        assert found.holds == (expected is None)
        assert found.breaks is None or found.breaks.order == expected + 1
        assert found.tested_to == order


def test_the_averaged_vector_field_method(execution):
    s = avf(7)
    assert bs.energy_preservation(s).holds
    assert bs.symmetry(s).holds
    assert bs.symplecticity(s)[:2] == (2, bs.Tree("[[τ]]"))
    assert bs.analysis.accuracy(s)[:2] == (2, bs.Tree("[[τ]]"))
    spoiled = s + bs.BSeries.from_rule(lambda tree: Fraction(int(str(tree) == "[τ,[τ]]"), 10**6), 7, empty=0)
    assert bs.energy_preservation(spoiled).order == 3


@pytest.mark.parametrize("name", ["symplectic-euler-p", "stormer-verlet", "lobatto-iiia-iiib3", "lobatto-iiib-iiia2"])
def test_partitioned_methods(name, execution):
    """Symplectic on blocks (HLW, theorem VI.4.6), but not as additive methods for sums of Hamiltonian fields."""
    method = bs.method(name)
    p = bs.order_of(method)
    assert bs.symplecticity(method, 5).holds
    assert bs.symplecticity(bs.series(method, 7, max_children=SEPARABLE)).holds
    assert bs.symplecticity(method, 5, colors_are="parts").order == p
    assert bs.energy_preservation(method, 5).order == p
    assert bs.symmetry(method, 5).order == (5 if p > 1 else 1)


def test_a_pair_symplectic_for_separable_systems_only():
    """b and b̂ may differ if H = T(p) + U(q), as in the method of order 3 by R. D. Ruth (1983)."""
    kicks, drifts = ["7/24", "3/4", "-1/24"], ["2/3", "-2/3", "1"]
    A_kick = [[kicks[j] if j <= i else 0 for j in range(3)] for i in range(3)]  # drift i follows kick i
    A_drift = [[drifts[j] if j < i else 0 for j in range(3)] for i in range(3)]
    method = bs.PartitionedRungeKutta({"p": plain(A_kick, kicks), "q": plain(A_drift, drifts)})
    separable = bs.series(method, 6, max_children=SEPARABLE)
    assert bs.symplecticity(separable).holds
    assert bs.analysis.accuracy(separable).order == 3
    assert bs.symplecticity(method, 4).order == 1
    wrong = bs.PartitionedRungeKutta({"p": plain(A_drift, kicks), "q": plain(A_drift, drifts)})
    assert bs.symplecticity(bs.series(wrong, 6, max_children=SEPARABLE)).order == 1


def test_uncoloured_methods_seen_as_partitioned():
    midpoint, rk4 = bs.method("implicit-midpoint"), bs.method("rk4")
    twice = bs.PartitionedRungeKutta({"p": midpoint, "q": midpoint})
    assert bs.symplecticity(twice, 5).holds
    assert bs.symplecticity(twice, 5, colors_are="parts").holds
    twice = bs.PartitionedRungeKutta({"p": rk4, "q": rk4})
    assert bs.symplecticity(twice, 5)[0] == bs.symplecticity(twice, 5, colors_are="parts")[0] == 4
    assert bs.energy_preservation(twice, 5)[0] == bs.energy_preservation(twice, 5, colors_are="parts")[0] == 4


def part(color, order, colors=2):
    """The field of one part alone."""
    return bs.BSeries.from_rule(
        lambda tree: int(tree.order == 1 and tree.color == color), order, empty=0, colors=colors, names=("a", "b")
    )


def strang(order):
    first, second = (part(0, order) / 2).exp(), part(1, order).exp()
    return bs.compose(bs.compose(first, second), first)


def test_splitting_methods_keep_what_their_parts_keep(execution):
    s = strang(5)
    tests = bs.symplecticity, bs.volume_preservation, bs.analysis.cubic_invariants, bs.symmetry
    assert all(test(s).holds for test in tests)
    assert (bs.analysis.accuracy(s).order, bs.energy_preservation(s).order) == (2, 2)
    assert bs.hamiltonian_field(s.log()).holds
    spoiled = s + bs.BSeries.from_rule(
        lambda tree: Fraction(tree == bs.Tree("[0,1,2,1]:[0,1,0,0]")), 5, empty=0, colors=2, names=("a", "b")
    )
    assert [test(spoiled).order for test in tests] == [3] * 4
    assert bs.hamiltonian_field(spoiled.log()).order == 3


def test_only_the_exact_flow_keeps_volume_and_cubic_invariants():
    """Iserles–Quispel–Tse and Chartier–Murua: the conditions leave no coefficient beyond the first."""
    table = tree_table(8)
    for conditions in (volume_conditions, cubic_conditions):
        for n in range(2, 9):
            rows = rows_of(conditions(table, False), table, n)
            assert oracle.rank(rows) == len(table.ids(n))
    assert bs.volume_preservation(bs.exact_flow(7)).holds
    assert bs.analysis.cubic_invariants(bs.exact_flow(7).scale_step(Fraction(1, 3))).holds
    for name in ("gauss2", "rk4", "explicit-midpoint"):
        method = bs.method(name)
        p = bs.order_of(method)
        assert bs.volume_preservation(method, 6).order == bs.analysis.cubic_invariants(method, 6).order == p


@pytest.mark.parametrize("options", [{}, {"max_children": SEPARABLE}], ids=["all", "separable"])
def test_only_compositions_of_exact_flows_keep_what_all_parts_keep(options):
    """Chartier–Murua: what the conditions leave is the free Lie algebra of the parts, by Witt's formula."""
    table = tree_table(5 if options else 4, 2, **options)
    for n, dimension in enumerate([2, 1, 2, 3, 6][: table.max_order], start=1):
        for conditions in (volume_conditions,) if options else (volume_conditions, cubic_conditions):
            rows = rows_of(conditions(table, False), table, n)
            assert len(table.ids(n)) - oracle.rank(rows) == dimension


def test_extra_parts_have_no_structure():
    method = WMethod([[0]], [[1]], [1])
    assert bs.analysis.accuracy(method, 4)[:2] == (1, bs.Tree("[τ]"))
    with pytest.raises(bs.SeriesError, match="must be made of the field alone to have a structure, but has the extra"):
        bs.symplecticity(method, 4)


def test_the_number_of_symplecticity_conditions():
    """Pairs of trees with n nodes together: m_n of Hairer–Zbinden; the rest are Hamiltonian fields."""
    table = tree_table(8)
    ranks = [oracle.rank(rows_of(hamiltonian_conditions(table, False), table, n)) for n in range(1, 9)]
    assert ranks == [0, 1, 1, 3, 6, 16, 37, 96]


def test_volume_in_separable_systems():
    euler = bs.method("symplectic-euler-q")
    assert bs.volume_preservation(bs.series(euler, 6, max_children=SEPARABLE)).holds
    assert bs.volume_preservation(euler, 4).order == 1
    rk4 = bs.PartitionedRungeKutta({"p": bs.method("rk4"), "q": bs.method("rk4")})
    assert bs.volume_preservation(bs.series(rk4, 6, max_children=SEPARABLE)).order == 4


# The second method: conditions against what random fields with the structure tell about F(τ), tree by tree.


def rows_of(conditions, table, n):
    """The conditions on trees with n nodes, as rows over these trees."""
    ids, start, rows = table.ids(n), conditions.start, []
    for k, breaks in enumerate(conditions.breaks):
        if breaks in ids:
            row = [0] * len(ids)
            for at in range(start[k], start[k + 1]):
                row[conditions.trees[at] - ids.start] += int(conditions.factors[at])
            rows.append(row)
    return rows


P_BLOCK, Q_BLOCK = (0, 1), (2, 3)


def random_fields(kind, coloring, n, source):
    """Fields with a structure, one for each colour but for blocks, and what they conserve."""
    degree, terms = (3 if coloring == "quadratic" else n + 2), 2 * (n + 2)
    kinetic = 2 if coloring == "nystrom" else degree
    if kind == "cubic":
        invariant = oracle.polynomial(source, 3, 12)
        return [oracle.conserving(source, invariant, n - 1 or 1, n) for _ in range(2)], invariant
    if kind == "volume" and coloring in ("separable", "nystrom"):
        f = [oracle.polynomial(source, degree, terms, Q_BLOCK) for _ in P_BLOCK]
        return [f + [oracle.polynomial(source, kinetic - 1, terms, P_BLOCK) for _ in Q_BLOCK]], {}
    if kind == "volume":
        return [oracle.divergence_free(source, degree, terms) for _ in range(2)], {}
    if coloring in ("separable", "nystrom"):
        T, U = oracle.polynomial(source, kinetic, terms, P_BLOCK), oracle.polynomial(source, degree, terms, Q_BLOCK)
        return [oracle.rotated(oracle.added(T, U))], oracle.added(T, U)
    H = [oracle.polynomial(source, degree, terms) for _ in range(2)]
    return [oracle.rotated(h) for h in H], oracle.added(*H) if coloring == "parts" else H[0]


def observed(kind, coloring, n, table, seed):
    """What one random field says of Σ b(τ)/σ(τ) F(τ): linear forms in b that vanish if the structure is kept."""
    source = oracle.seeded(kind, coloring, n, seed)
    fields, conserved = random_fields(kind, coloring, n, source)
    if coloring in BLOCKS:
        fields = oracle.split_in_blocks(fields[0])
    y, known, columns = oracle.point(source), {}, []
    slopes = [oracle.contracted(oracle.derivative(conserved, i), [], y) for i in range(oracle.DIMENSION)]
    for at in table.ids(n):
        tree = table[at]
        F = oracle.differential(tree, fields, y, known)
        D = [component.gradient for component in F]
        if kind == "hamiltonian":  # J⁻¹ DF is symmetric; J⁻¹ F = (F_q, −F_p)
            turned = [D[2], D[3], [-x for x in D[0]], [-x for x in D[1]]]
            values = [turned[i][j] - turned[j][i] for i in range(4) for j in range(i)]
        elif kind == "volume":
            values = [sum(D[i][i] for i in range(4))]
        else:
            values = [oracle.dot(slopes, F)]
        columns.append([value * pow(tree.symmetry, -1, oracle.P) % oracle.P for value in values])
    return [list(row) for row in zip(*columns, strict=True)]


CONDITIONS = {
    "hamiltonian": hamiltonian_conditions,
    "energy": energy_conditions,
    "volume": volume_conditions,
    "cubic": cubic_conditions,
}
BLOCKS = ("blocks", "separable", "nystrom")
RESTRICTED = {"separable": SEPARABLE, "nystrom": NYSTROM, "quadratic": 2}
CASES = [(c, n) for c in ("parts", "blocks") for n in (1, 2, 3)]
CASES += [(c, n) for c in ("one", "separable", "nystrom", "quadratic") for n in (2, 3, 4, 5)]
UNDECIDED = [("cubic", c, n) for c in RESTRICTED for n in range(6)]  # on all trees only
SLOW = [("cubic", "one", 5), ("volume", "one", 5), ("volume", "separable", 5), ("volume", "nystrom", 5)]


@pytest.mark.few(24)
@pytest.mark.parametrize(
    ("kind", "coloring", "n"),
    [(kind, *case) for kind in CONDITIONS for case in CASES if (kind, *case) not in UNDECIDED + SLOW],
)
def test_conditions_are_those_of_random_fields(kind, coloring, n):
    table = tree_table(n, 1 if coloring in ("one", "quadratic") else 2, RESTRICTED.get(coloring))
    rows = rows_of(CONDITIONS[kind](table, coloring in BLOCKS), table, n)
    seen, seeds = [], itertools.count()
    while len(seen) < len(table.ids(n)) + 2:
        seen += observed(kind, coloring, n, table, next(seeds))
    assert oracle.rank(seen) == oracle.rank(rows) == oracle.rank(seen + rows)


def test_wrong_conditions_would_be_noticed():
    table = tree_table(3, 2)
    seen = [row for seed in range(8) for row in observed("hamiltonian", "blocks", 3, table, seed)]
    parts = rows_of(hamiltonian_conditions(table, False), table, 3)
    assert oracle.rank(seen + parts) > oracle.rank(seen)


# Kinds of numbers.


def test_algebraic_and_symbolic_coefficients():
    gauss = bs.RungeKutta([["1/4", "1/4 - sqrt(3)/6"], ["1/4 + sqrt(3)/6", "1/4"]], ["1/2", "1/2"])
    assert bs.symplecticity(gauss, 6).holds
    assert bs.symmetry(gauss, 5).holds
    assert bs.energy_preservation(gauss, 5).order == 4
    x = sympy.Symbol("x")
    alpha = bs.RungeKutta([[0, 0], [1 / (2 * x), 0]], [1 - x, x])
    assert [test(alpha, 4).order for test in (bs.analysis.accuracy, bs.energy_preservation, bs.symplecticity)] == [
        2,
        2,
        2,
    ]
    diagonal = bs.RungeKutta([[x / 2, 0], [x, (1 - x) / 2]], [x, 1 - x])  # midpoint rules, one after the other
    assert bs.symplecticity(diagonal, 5).holds
    assert bs.symplecticity(bs.RungeKutta([[x / 2, 0], [x, (1 - x) / 3]], [x, 1 - x]), 4).order == 1


def test_decimals_and_floats_are_decided_within_their_digits():
    tsit5 = bs.method("tsit5")
    assert [test(tsit5, 6).order for test in (bs.analysis.accuracy, bs.symplecticity, bs.energy_preservation)] == [
        5,
        5,
        5,
    ]
    assert bs.symplecticity(bs.series(tsit5, 6)).order == 5
    assert bs.hamiltonian_field(bs.modified_equation(tsit5, 6)).order == 5
    assert bs.symplecticity(bs.RungeKutta(tsit5.A, tsit5.b, warn=False), 6).order < 5  # the decimals taken literally
    gauss = bs.method("gauss2").to_float()
    assert bs.symplecticity(gauss, 6).holds
    assert bs.symmetry(gauss, 6).holds
    assert bs.energy_preservation(gauss, 6).order == 4
    coarse = bs.RungeKutta([["0.5000", 0], ["0.3333", "0.3333"]], ["0.3333", "0.6667"], digits=4)
    assert bs.symplecticity(coarse, 4).order < 4


def test_numbers_beyond_machine_integers(execution):
    """Step sizes with large denominators: the exact path without int64."""
    a = bs.series(bs.method("gauss2"), 7)
    c = (bs.exact_flow(7) ** Fraction(10**9 + 7, 10**9 + 9)).log().exp()
    b = bs.compose(a, c)
    assert bs.symplecticity(b).holds
    spoiled = b + bs.BSeries.from_rule(lambda tree: Fraction(int(tree.order == 7), 10**60), 7, empty=0)
    assert bs.symplecticity(spoiled).order == 6
    assert bs.hamiltonian_field(spoiled.log()).order == 6


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bs.symplecticity(4, 4), "method must be a method"),
        (lambda: bs.symplecticity(bs.exact_flow(3), 5), "order must be at most 3"),
        (lambda: bs.symplecticity(bs.exact_flow(3).log()), "method must be a flow, with the coefficient 1"),
        (lambda: bs.symmetry(bs.exact_flow(3).log()), "method must be a flow"),
        (lambda: bs.analysis.accuracy(bs.exact_flow(3).log()), "method must be a flow"),
        (lambda: bs.hamiltonian_field(bs.exact_flow(3)), "field must be a field, with the coefficient 0"),
        (lambda: bs.hamiltonian_field(bs.method("rk4"), 4), "field must be a series"),
        (lambda: bs.energy_preservation(bs.exact_flow(3).with_empty(2)), "method must be a flow"),
        (
            lambda: bs.symplecticity(bs.exact_flow(3), colors_are="block"),
            "must be 'blocks' or 'parts', but was 'block'",
        ),
        (
            lambda: bs.symplecticity(bs.exact_flow(3), colors_are="blocks"),
            "must be 'parts' unless there are two colours",
        ),
        (lambda: bs.symplecticity(bs.exact_flow(3, colors=2, max_children=2)), "on a table that holds all trees up to"),
        (lambda: bs.energy_preservation(bs.exact_flow(3, colors=2, max_children=2)), "on a table that holds all trees"),
        (lambda: bs.analysis.cubic_invariants(bs.exact_flow(4, max_children=2)), "on a table that holds all trees"),
        (lambda: bs.volume_preservation(bs.exact_flow(3, colors=2, max_children=2)), "on a table that holds all trees"),
        (
            lambda: bs.symplecticity(bs.series(bs.method("rk4").to_float(), 4)),
            "exact series, but was a series in floats",
        ),
        (lambda: bs.symplecticity(bs.series(bs.method("tsit5"), 4) ** 2), "but was made of a series in decimals"),
        (lambda: bs.symplecticity(bs.method("rk4"), 0), "order must be 1 or more"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(bs.errors, match=message):
        call()


@pytest.mark.parametrize("method", ["rk4", "stormer-verlet"])
def test_check_reports_every_structure(method):
    names = [name for structure in (*STRUCTURES, *CONJUGATE_STRUCTURES) for name in structure.names]
    assert list(bs.check(bs.method(method), 3).structure) == names


def test_symbols_stay_symbols():
    gamma = sympy.Symbol("gamma")
    s = bs.BSeries.from_rule(lambda tree: gamma ** (tree.order - 1), 3)
    assert bs.symplecticity(s)[:2] == (1, bs.Tree("[τ]"))


@pytest.mark.parametrize(
    "verdict",
    [
        bs.symplecticity,
        bs.energy_preservation,
        bs.volume_preservation,
        bs.analysis.cubic_invariants,
        bs.conjugate_symplecticity,
    ],
)
def test_blocks_go_by_name_whatever_their_order(verdict):
    """Parts p and q are blocks in any order: what a verdict says of one order it says of the other."""
    given = dict(zip("pq", bs.method("lobatto-iiia-iiib3").partitions, strict=True))
    swapped = bs.PartitionedRungeKutta({name: given[name] for name in ("q", "p")})
    assert verdict(swapped, 5)[:2] == verdict(bs.PartitionedRungeKutta(given), 5)[:2]
    series = bs.series(swapped, 4)
    flipped = bs.BSeries.from_rule(lambda tree: series[recolored(tree)], 4, colors=2, names=("q", "p"))
    assert verdict(flipped).order == verdict(series).order


def recolored(tree):
    """The tree with its two colours exchanged."""
    return bs.Tree.from_levels(tree.levels, [1 - color for color in tree.colors])


def test_a_splitting_is_judged_alike_whichever_flow_comes_first():
    """A step of p at fixed q is no symplectic map for H(p, q) that is not separable."""
    flows = [("p", "1/2"), ("q", 1), ("p", "1/2")]
    first, second = (bs.symplecticity(bs.Splitting(order, name="x"), 4) for order in (flows, [("q", "0"), *flows]))
    assert first[:2] == second[:2]
    assert not first.holds


@pytest.mark.parametrize("method", ["rk4", "stormer-verlet", "tsit5", "sdirk2"])
def test_without_an_order_methods_are_tested_as_far_as_by_check(method):
    chosen, tests = bs.method(method), (bs.symmetry, bs.symplecticity, bs.conjugate_symplecticity, bs.effective_order)
    names = ("symmetric", "symplectic", "conjugate_symplectic", "effective_order")
    report = bs.check(chosen)
    for name, test in zip(names, tests, strict=True):
        assert test(chosen)[:3] == report.structure[name][:3], name


@pytest.mark.parametrize("method", ["gauss4", "radau-iia4"])
def test_to_the_order_of_a_method_its_structure_is_that_of_its_own_series(method):
    chosen = bs.method(method)
    own, exact = (structure_of(chosen, 6, accuracy) for accuracy in (0, bs.order_of(chosen)))
    assert own.keys() == exact.keys()
    assert all(own[name][:3] == exact[name][:3] for name in own)
