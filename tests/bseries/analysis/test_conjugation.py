"""Bracket against vector fields; conjugation, effective order and conjugate symplecticity against known methods."""

from fractions import Fraction
from math import prod

import field_oracles as oracle
import pytest

import bseries as bs
from bseries.analysis.structure import hamiltonian_conditions
from integrators import TakahashiImada

SEPARABLE = [[0, None], [None, 0]]
NYSTROM = [[0, None], [1, 0]]  # p' = f(q), q' = p
HALF = Fraction(1, 2)


def averaged(tree):
    return prod(map(averaged, tree.children), start=Fraction(1, 1 + len(tree.children)))


def butcher(name):
    """Butcher (1969), doi:10.1007/BFb0060019: the method of effective order 5 and its starting method."""
    main = [[], ["1/5"], [0, "2/5"], ["3/16", 0, "5/16"], ["1/4", 0, "-5/4", 2]], ["1/6", 0, 0, "2/3", "1/6"]
    start = (
        [[], ["1/5"], [0, "2/5"], ["75/64", "-9/4", "117/64"], ["-37/36", "7/3", "-3/4", "4/9"]],
        ["19/144", 0, "25/48", "2/9", "1/8"],
    )
    rows, b = {"main": main, "start": start}[name]
    A = [[*row, *[0] * (5 - len(row))] for row in rows]
    return bs.RungeKutta(A, b, warn=False)


@pytest.mark.parametrize("colors", [1, 2])
def test_bracket_is_that_of_vector_fields(colors, random_series):
    """[B, C] = C'B − B'C, by random polynomial fields: the sum of all terms with one power of h."""
    order = 4 if colors == 1 else 3
    b, c = random_series(order, 1, empty=0, colors=colors), random_series(order, 2, empty=0, colors=colors)
    source = oracle.seeded("bracket", colors)
    fields = [[oracle.polynomial(source, 5, 8) for _ in range(4)] for _ in range(colors)]
    y, known = oracle.point(source), {}

    def term(s, n):
        total = [oracle.constant(0)] * 4
        for tree in (s.table[at] for at in s.table.ids(n)):
            factor = oracle.constant(oracle.residue(s[tree] / tree.symmetry))
            F = oracle.differential(tree, fields, y, known)
            total = [x + factor * component for x, component in zip(total, F, strict=True)]
        return total

    def along(B, C):
        return [sum(g * x.value for g, x in zip(slope.gradient, B, strict=True)) for slope in C]

    found, opposite = bs.algebra.bracket(b, c), bs.algebra.bracket(c, b)
    for n in range(2, order + 1):
        expected = [0] * 4
        for k in range(1, n):
            B, C = term(b, k), term(c, n - k)
            expected = [e + x - z for e, x, z in zip(expected, along(B, C), along(C, B), strict=True)]
        assert [x.value for x in term(found, n)] == [e % oracle.P for e in expected]
        assert n == 2 or [x.value for x in term(opposite, n)] != [e % oracle.P for e in expected]


def test_bracket_is_a_lie_bracket(random_series, execution):
    b, c, d = (random_series(5, seed, empty=0) for seed in (3, 4, 5))
    cyclic = [(b, c, d), (c, d, b), (d, b, c)]
    assert sum(bs.algebra.bracket(x, bs.algebra.bracket(y, z)) for x, y, z in cyclic) == b * 0
    assert bs.algebra.bracket(b, c) == -bs.algebra.bracket(c, b)


def test_conjugation_acts_on_the_modified_equation_by_brackets(random_series, execution):
    """log(χ⁻¹ ∘ Φ ∘ χ) = exp([g, ·]) b with g = log χ: the pull-back of a field."""
    a, c = random_series(5, 6), random_series(5, 7)
    b, g = a.log(), c.log()
    total, term = b, b
    for k in range(1, 5):
        term = bs.algebra.bracket(g, term) / k
        total += term
    assert bs.analysis.conjugate(a, c).log() == total
    assert bs.analysis.conjugate(a, c) == bs.compose(bs.compose(c, a), c.inverse())
    assert bs.analysis.conjugate(bs.analysis.conjugate(a, c), c.inverse()) == a
    assert bs.analysis.conjugate(a, c.inverse()).log() != total


def test_the_trapezoidal_and_the_midpoint_rule_are_conjugate():
    half = bs.series(bs.method("explicit-euler"), 6).scale_step(HALF)
    midpoint, trapezoidal = (bs.series(bs.method(name), 6) for name in ("implicit-midpoint", "trapezoidal"))
    assert bs.analysis.conjugate(midpoint, half) == trapezoidal
    assert bs.analysis.conjugate(trapezoidal, half) != midpoint


def test_effective_order_of_butchers_method(execution):
    method, order = butcher("main"), 6
    verdict = bs.effective_order(method, order)
    assert bs.order_of(method) == 4
    assert verdict[:3] == (5, bs.Tree("[[[[[τ]]]]]"), 6)
    a = bs.series(method, order)
    assert bs.analysis.accuracy(bs.analysis.conjugate(a, verdict.processor)).order == 5
    # His starting method makes a whole step before, which conjugation does not notice, and is fixed to order 4.
    start = bs.series(butcher("start"), 4)
    assert bs.compose(bs.exact_flow(4), verdict.processor.truncate(4)) == start


@pytest.mark.parametrize(
    ("name", "order"),
    [("rk4", 4), ("implicit-midpoint", 2), ("gauss2", 4), ("explicit-euler", 1), ("lobatto-iiic3", 4), ("heun2", 2)],
)
def test_methods_that_gain_nothing_by_processing(name, order):
    verdict = bs.effective_order(bs.method(name), 6)
    assert verdict.order == bs.order_of(bs.method(name)) == order
    assert verdict.breaks.order == order + 1


def test_effective_order_survives_conjugation(random_series, execution):
    c = random_series(6, 8)
    a = bs.analysis.conjugate(bs.series(bs.method("gauss2"), 6), c)
    assert bs.analysis.accuracy(a).order == 2
    assert bs.effective_order(a).order == 4
    exact = bs.analysis.conjugate(bs.exact_flow(6), c)
    verdict = bs.effective_order(exact)
    assert verdict.holds
    assert bs.analysis.conjugate(exact, verdict.processor) == bs.exact_flow(6)


def test_symplectic_euler_is_conjugate_to_stormer_verlet():
    """Where the flows of both parts are exact: on separable systems, but not on all."""
    for name in ("symplectic-euler-p", "symplectic-euler-q"):
        method = bs.method(name)
        assert bs.effective_order(bs.series(method, 6, max_children=SEPARABLE)).order == 2
        assert bs.effective_order(method, 4).order == 1


def takahashi_imada(order, factor):
    """Strang's splitting with the potential corrected by a multiple of [B, [A, B]]."""

    def part(color):
        return bs.BSeries.from_rule(
            lambda tree: int(tree.order == 1 and tree.color == color), order, empty=0, colors=2, names=("a", "b")
        )

    A, B = part(0), part(1)
    kick = (B + bs.algebra.bracket(B, bs.algebra.bracket(A, B)) * factor).exp()
    drift = (A / 2).exp()
    return bs.compose(bs.compose(drift, kick), drift)


def test_takahashi_imada_has_effective_order_four(execution):
    """M. Takahashi, M. Imada, J. Phys. Soc. Jpn. 53 (1984); the factor is ±1/24."""
    found = {factor: bs.effective_order(takahashi_imada(5, factor)).order for factor in (Fraction(1, 24), 0)}
    opposite = bs.effective_order(takahashi_imada(5, Fraction(-1, 24))).order
    assert sorted([found[Fraction(1, 24)], opposite]) == [2, 4]
    assert found[0] == 2


@pytest.mark.parametrize(("alpha", "effective"), [("1/12", 4), ("1/13", 2)])
def test_nystrom_systems(alpha, effective):
    """The method of Takahashi and Imada as it is used, with a force corrected by its derivative: q'' = f(q)."""
    verdict = bs.effective_order(TakahashiImada(alpha), 6)
    a = bs.series(TakahashiImada(alpha), 6, max_children=NYSTROM)
    assert (bs.analysis.accuracy(a).order, verdict.order) == (2, effective)
    assert bs.analysis.accuracy(bs.analysis.conjugate(a, verdict.processor)).order == effective
    assert bs.symplecticity(a).holds
    simplified = TakahashiImada(alpha, simplified=True)
    assert bs.symplecticity(simplified, 6).order == 4
    assert bs.effective_order(simplified, 6).order == effective
    assert bs.volume_preservation(simplified, 6).holds
    assert bs.energy_preservation(simplified, 6).order == 2


@pytest.mark.parametrize(
    ("name", "order"),
    [
        # pybs publishes Lobatto and AVF; Hairer–Zbinden: energy-preserving collocation has 2s + 2, Lobatto IIIA 2s
        ("trapezoidal", None),
        ("implicit-midpoint", None),
        ("gauss2", None),
        ("lobatto-iiia3", 6),
        ("lobatto-iiib3", 4),
        ("rk4", 4),
        ("heun2", 3),
        ("explicit-euler", 1),
        ("avf", 4),
    ],
)
def test_conjugate_symplecticity_of_known_methods(name, order):
    a = bs.BSeries.from_rule(averaged, 7) if name == "avf" else bs.series(bs.method(name), 7)
    verdict = bs.conjugate_symplecticity(a)
    assert verdict.order == (order or 7)
    assert verdict.holds == (order is None)
    assert bs.symplecticity(bs.analysis.conjugate(a, verdict.processor)).order == verdict.order


def test_conjugate_symplecticity_survives_conjugation(random_series, execution):
    c = random_series(6, 9)
    a = bs.analysis.conjugate(bs.series(bs.method("implicit-midpoint"), 6), c)
    assert bs.symplecticity(a).order == 2
    assert bs.conjugate_symplecticity(a).holds
    assert bs.conjugate_symplecticity(bs.analysis.conjugate(bs.series(bs.method("rk4"), 6), c)).order == 4


@pytest.mark.parametrize("options", [{}, {"max_children": SEPARABLE}], ids=["blocks", "separable"])
def test_conjugate_symplecticity_of_partitioned_methods(options, random_series):
    order = 4 if not options else 6
    a = bs.series(bs.method("symplectic-euler-p"), order, **options)
    c = bs.BSeries.from_rule(
        lambda tree: Fraction(1 + hash(tree.levels) % 7 + tree.color, 6), order, colors=2, **options
    )
    mixed = bs.analysis.conjugate(a, c)
    assert bs.symplecticity(mixed).order <= 2
    verdict = bs.conjugate_symplecticity(mixed)
    assert verdict.holds
    assert bs.symplecticity(bs.analysis.conjugate(mixed, verdict.processor)).holds
    euler = bs.PartitionedRungeKutta({"p": bs.method("explicit-euler"), "q": bs.method("explicit-euler")})
    assert bs.conjugate_symplecticity(bs.series(euler, order, **options)).order == 1


@pytest.mark.parametrize(
    "name", ["lobatto-iiia3", "lobatto-iiib3", "rk4", "lobatto-iiic3", "heun2", "avf", "radau-iia2"]
)
def test_conjugate_symplecticity_by_linear_algebra(name):
    """Up to order 2p the equations are linear: is b_n in the image of [f, ·] and the Hamiltonian fields together?"""
    a = bs.BSeries.from_rule(averaged, 6) if name == "avf" else bs.series(bs.method(name), 6)
    table, b, p = a.table, a.log(), bs.analysis.accuracy(a).order
    f = bs.exact_flow(6).log()
    conditions = hamiltonian_conditions(table, False)

    def defects(field, n):
        residuals = conditions.residuals(field.coefficients(), flow=False)
        return [
            oracle.residue(Fraction(x))
            for x, at in zip(residuals, conditions.breaks, strict=True)
            if at in table.ids(n)
        ]

    expected = p
    for n in range(p + 1, min(6, 2 * p) + 1):
        units = [bs.BSeries.from_rule(lambda t, at=at: int(t == table[at]), 6, empty=0) for at in table.ids(n - 1)]
        image = [defects(bs.algebra.bracket(f, unit), n) for unit in units]
        if oracle.rank([*image, defects(b, n)]) > oracle.rank(image):
            break
        expected = n
    found = bs.conjugate_symplecticity(a).order
    assert min(found, 2 * p) == expected


def test_symbols_roots_decimals_and_floats():
    import sympy

    x = sympy.Symbol("x")
    family = bs.RungeKutta([[0, 0], [1 / (2 * x), 0]], [1 - x, x])
    assert bs.effective_order(family, 4).order == 2
    half = bs.series(bs.method("explicit-euler"), 4).scale_step(sympy.sqrt(2))
    midpoint = bs.analysis.conjugate(bs.series(bs.method("implicit-midpoint"), 4), half)
    assert midpoint.domain == "QQ<sqrt(2)>"
    assert bs.conjugate_symplecticity(midpoint).holds
    assert bs.effective_order(midpoint).order == 2
    assert bs.effective_order(bs.method("tsit5"), 6).order == 5
    assert bs.conjugate_symplecticity(bs.method("trapezoidal").to_float(), 5).holds
    assert bs.effective_order(butcher("main").to_float(), 6).order == 5


def test_inconsistent_methods():
    zero = bs.exact_flow(3).scale_step(Fraction(1, 2))
    assert bs.effective_order(zero)[:2] == (0, bs.Tree("τ"))
    with pytest.raises(bs.SeriesError, match="method must be consistent, with the coefficient 1 of τ, but has 1/2"):
        bs.conjugate_symplecticity(zero)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda f, a: bs.algebra.bracket(f, a), "c must be a field, with the coefficient 0"),
        (lambda f, a: bs.algebra.bracket(a, f), "b must be a field"),
        (lambda f, a: bs.algebra.bracket(f, f.truncate(2)), "both series must have the same trees"),
        (lambda f, a: bs.analysis.conjugate(f, a), "a must be a flow"),
        (lambda f, a: bs.analysis.conjugate(a, f), "c must be a flow"),
        (lambda f, a: bs.analysis.conjugate(a, "c"), "c must be a series, .*, but was 'c'"),
        (lambda f, a: bs.effective_order(f), "method must be a flow"),
        (lambda f, a: bs.effective_order(a, 4), "order must be at most 3"),
        (
            lambda f, a: bs.effective_order(bs.exact_flow(4, max_children=1)),
            "series must be on all trees, or those of a separable",
        ),
        (
            lambda f, a: bs.conjugate_symplecticity(bs.exact_flow(4, max_children=2)),
            "series must be on all trees, or those of a separable",
        ),
        (
            lambda f, a: bs.effective_order(bs.exact_flow(3, colors=2, max_children=[[None, 0], [0, None]])),
            "on all trees",
        ),
        (lambda f, a: bs.conjugate_symplecticity(a, colors_are="both"), "colors_are must be 'blocks' or 'parts'"),
        (lambda f, a: bs.conjugate_symplecticity(a.to_float()), "but was a series in floats"),
    ],
)
def test_refusals(call, message):
    a = bs.exact_flow(3)
    with pytest.raises(bs.errors, match=message):
        call(a.log(), a)


def test_irrational_tableaux_are_decided_too():
    method = bs.RungeKutta([["sqrt(2)/2"]], [1])
    assert bs.conjugate_symplecticity(method, 5)[:2] == (1, bs.Tree("[τ]"))
    assert bs.effective_order(method, 4).order == 1
