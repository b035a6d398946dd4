"""Order conditions of all kinds: published counts and methods, a second way to every number, negative controls."""

import ctypes
import math
import pickle
import random
import shutil
import subprocess
import sys
from fractions import Fraction
from itertools import accumulate

import numpy as np
import pytest
import sympy
from order_condition_oracles import exact_step, random_fractions, rosenbrock_step, scalar_differential
from series_oracles import weight
from sympy.polys.matrices import DomainMatrix

import bseries as bs
from trees.notation import default_names

F = Fraction
NAMES = ("residual", "jacobian")
RK4 = bs.method("rk4")


# counts


@pytest.mark.parametrize(
    ("kind", "options", "counts"),
    [
        ("runge-kutta", {}, [1, 1, 2, 4, 9, 20, 48, 115, 286, 719]),  # OEIS A000081
        ("partitioned", {}, [2, 4, 14, 52, 214]),
        ("additive", {"colors": 3}, [3, 9, 45, 246]),
        ("partitioned", {"max_children": [[0, None], [None, 0]]}, [2, 2, 4, 8, 18, 40, 96, 230]),  # separable
        ("rosenbrock", {}, [1, 1, 2, 4, 9, 20]),
        ("splitting", {}, [2, 1, 2, 3, 6, 9, 18, 30, 56, 99]),  # Witt's formula, OEIS A001037
        ("splitting", {"colors": 3}, [3, 3, 8, 18, 48]),
        ("splitting", {"symmetric": True}, [2, 0, 2, 0, 6, 0, 18]),
        ("runge-kutta", {"symmetric": True}, [1, 0, 2, 0, 9]),
        ("runge-kutta", {"scalar": True}, [1, 1, 2, 3, 5, 7, 11, 15, 22]),  # partitions of n−1, OEIS A000041
        ("runge-kutta", {"scalar": "nonautonomous"}, [1, 1, 2, 4, 8, 15]),  # Butcher: 16 to order 5, 31 to order 6
    ],
)
def test_numbers_of_conditions(kind, options, counts):
    totals = list(accumulate(counts))
    conditions = bs.order_conditions(kind, len(counts), **options)
    assert [sum(c.tree.order == n for c in conditions) for n in range(1, len(counts) + 1)] == counts
    assert len(conditions) == totals[-1]
    assert len(bs.order_conditions(kind, 2, **options)) == totals[1]


def test_numbers_of_nystrom_trees():
    # SN-trees, Hairer–Nørsett–Wanner, section II.14: velocities, and positions with one node more
    special = bs.order_conditions("nystrom", 9)
    roots = [[c.tree.order for c in special if c.tree.color == color] for color in (0, 1)]
    numbers = [1, 1, 2, 3, 6, 10, 20, 36]
    assert [roots[0].count(n) for n in range(1, 9)] == numbers
    assert [roots[1].count(n) for n in range(2, 10)] == numbers
    general = bs.order_conditions("general-nystrom", 4)
    assert [sum(c.tree.order == n and c.tree.color == 0 for c in general) for n in (1, 2, 3)] == [1, 2, 6]


# formulas


@pytest.mark.parametrize(
    ("kind", "order", "colors"), [("runge-kutta", 7, 1), ("partitioned", 4, 2), ("additive", 3, 3)]
)
def test_formulas_are_those_of_the_trees(kind, order, colors):
    conditions = bs.order_conditions(kind, order, colors=None if colors == 1 else colors)
    names = default_names(colors)
    assert [c.tree for c in conditions] == list(bs.TreeTable(order, colors))
    for c in conditions:
        assert str(c) == c.tree.condition(names=names)
        assert c.to_latex() == c.tree.condition("latex", names)
        assert c.right == F(1, c.tree.density)


@pytest.mark.parametrize(
    ("kind", "tree", "text", "latex"),
    [
        ("nystrom", "p[q[p]]", "Σ b_i ā_ij = 1/6", r"\sum_{i,j} b_{i} \bar{a}_{ij} = \frac{1}{6}"),
        ("nystrom", "q[p[q,q]]", "Σ b̄_i c_i^2 = 1/12", r"\sum_{i} \bar{b}_{i} c_{i}^{2} = \frac{1}{12}"),
        ("general-nystrom", "p[p,q]", "Σ b_i c_i a_ij = 1/3", r"\sum_{i,j} b_{i} c_{i} a_{ij} = \frac{1}{3}"),
        # Hairer–Wanner, table IV.7.1
        ("rosenbrock", "[τ,[τ]]", "Σ b_i α_i α_ij β_j = 1/8", None),
        ("rosenbrock", "[[τ,τ]]", "Σ b_i β_ij α_j^2 = 1/12", None),
        ("splitting", "p[q]", "Σ_{j<i} x^p_i x^q_j = 1/2", r"\sum_{j < i} x^{p}_{i} x^{q}_{j} = \frac{1}{2}"),
        ("splitting", "p[q[q]]", "Σ_{k<j<i} x^p_i x^q_j x^q_k + 1/2 Σ_{j<i} x^p_i (x^q_j)^2 = 1/6", None),
    ],
)
def test_formulas_of_other_kinds(kind, tree, text, latex):
    found = bs.order_conditions(kind, 4)[tree]
    assert str(found) == text
    assert latex is None or found.to_latex() == latex


def test_a_sweep_takes_the_fields_in_their_order():
    assert str(bs.order_conditions("splitting", 3, colors=3)["a[b[c]]"]) == "Σ_{k<j<i} x^a_i x^b_j x^c_k = 1/6"
    assert "≤" in str(bs.order_conditions("splitting", 3, colors=3)["a[c[b]]"])


# values


@pytest.mark.parametrize("seed", range(3))
def test_residuals_of_random_tableaux(seed):
    source = random.Random(seed)
    A, b = random_fractions(source, 3, 3), random_fractions(source, 3)
    conditions = bs.order_conditions("runge-kutta", 6)
    expected = [weight([(A, b)], c.tree) - F(1, c.tree.density) for c in conditions]
    assert conditions.residuals(A, b) == expected
    assert conditions.residuals(bs.RungeKutta(A, b, warn=False)) == expected
    assert conditions.residuals(sympy.Matrix(A), b) == expected
    assert (bs.series(bs.RungeKutta(A, b, warn=False), 6) - bs.exact_flow(6)).coefficients() == expected


@pytest.mark.parametrize(
    ("kind", "name", "order"),
    [
        ("runge-kutta", "gauss2", 4),
        ("partitioned", "stormer-verlet", 2),
        ("nystrom", "rkn-nystrom4", 4),
        ("general-nystrom", "rkn-nystrom4-general", 4),
        ("rosenbrock", "ros2", 2),
        ("splitting", "ruth3", 3),
    ],
)
def test_residuals_of_methods_by_name(kind, name, order):
    assert not any(bs.order_conditions(kind, order).residuals(name))
    assert any(bs.order_conditions(kind, order + 1).residuals(bs.method(name)))


def test_residuals_of_names_are_those_of_arrays():
    sweeps = bs.method("ruth3").flows
    times = {part: [x for own, x in sweeps if own == part] for part in ("a", "b")}
    conditions = bs.order_conditions("splitting", 5)
    assert conditions.residuals("ruth3") == conditions.residuals([times["a"], times["b"]])


@pytest.mark.parametrize(
    ("kind", "name"),
    [("splitting", "stormer-verlet"), ("nystrom", "rk4"), ("runge-kutta", "strang"), ("rosenbrock", "ros34pw2")],
)
def test_residuals_of_other_kinds_are_refused(kind, name):
    with pytest.raises(bs.SeriesError, match=f"method must be one of the [12]-part {kind} kind, but was"):
        bs.order_conditions(kind, 2).residuals(name)


@pytest.mark.parametrize("colors", [2, 3])
def test_residuals_of_random_partitioned_tableaux(colors):
    source = random.Random(colors)
    A, b = random_fractions(source, colors, 2, 2), random_fractions(source, colors, 2)
    conditions = bs.order_conditions("additive", 4, colors=colors)
    parts = list(zip(A, b, strict=True))
    assert conditions.residuals(A, b) == [weight(parts, c.tree) - c.right for c in conditions]
    names = default_names(colors)
    method = bs.PartitionedRungeKutta(
        {n: bs.RungeKutta(*part, warn=False) for n, part in zip(names, parts, strict=True)}, warn=False
    )
    assert conditions.residuals(method) == conditions.residuals(A, b)


@pytest.mark.parametrize(("name", "order"), [("rk4", 4), ("heun3", 3), ("radau-iia2", 3), ("stormer-verlet-kdk", 2)])
def test_classical_methods(name, order):
    method = bs.method(name)
    kind = "runge-kutta" if len(method.partitions) == 1 else "partitioned"
    assert not any(bs.order_conditions(kind, order).residuals(method))
    assert any(bs.order_conditions(kind, order + 1).residuals(method))


def test_what_rk4_lacks_at_order_5():
    conditions = bs.order_conditions("runge-kutta", 5)
    residuals = dict(zip(conditions, conditions.residuals(RK4), strict=True))
    errors = [r / c.tree.symmetry for c, r in residuals.items() if c.tree.order == 5]
    assert sum(e * e for e in errors) == F(1745, 2880**2)  # nodepy's error metrics of RK44
    assert max(map(abs, errors)) == F(1, 120)


@pytest.mark.parametrize("seed", range(3))
def test_nystrom_conditions_are_those_of_partitioned_methods(seed):
    # p' = g(q), q' = p by a partitioned method is a Nyström method: Ā = A^q A^p, b̄ = b^q A^p, c = A^q 1
    source = random.Random(seed)
    (Ap, Aq), (bp, bq) = random_fractions(source, 2, 3, 3), random_fractions(source, 2, 3)
    bq[0] += 1 - sum(bq)
    Abar = [[sum(Aq[i][j] * Ap[j][k] for j in range(3)) for k in range(3)] for i in range(3)]
    bbar = [sum(bq[j] * Ap[j][k] for j in range(3)) for k in range(3)]
    c = [sum(row) for row in Aq]
    special = bs.order_conditions("nystrom", 6)
    parts = [(Ap, bp), (Aq, bq)]
    assert special.residuals(Abar, bbar, bp, c) == [weight(parts, x.tree) - x.right for x in special]
    general = bs.order_conditions("general-nystrom", 5)
    assert general.residuals(Abar, bbar, bp, c, Ap) == [weight(parts, x.tree) - x.right for x in general]


def test_nystroms_method_has_order_4():
    # Hairer–Nørsett–Wanner, section II.14
    Abar = [[0, 0, 0], [F(1, 8), 0, 0], [0, F(1, 2), 0]]
    arrays = Abar, [F(1, 6), F(1, 3), 0], [F(1, 6), F(2, 3), F(1, 6)], [0, F(1, 2), 1]
    assert not any(bs.order_conditions("nystrom", 4).residuals(*arrays))
    assert any(bs.order_conditions("nystrom", 5).residuals(*arrays))


def grk4a():
    """Kaps–Rentrop 1979, as printed."""
    alpha, gamma = np.zeros((4, 4)), np.zeros((4, 4))
    alpha[1, 0] = 0.438
    alpha[2:, :2] = 0.796920457938, 0.0730795420615
    gamma[1, 0] = -0.767672395484
    gamma[2, :2] = -0.851675323742, 0.522967289188
    gamma[3, :3] = 0.288463109545, 0.0880214273381, -0.337389840627
    gamma += 0.395 * np.eye(4)
    return alpha, gamma, [0.199293275701, 0.482645235674, 0.0680614886256, 0.25]


def test_grk4a_has_order_4():
    residual = np.array(bs.order_conditions("rosenbrock", 4).residuals(*grk4a()))
    assert abs(residual).max() < 1e-11
    assert max(map(abs, bs.order_conditions("rosenbrock", 5).residuals(*grk4a()))) > 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_rosenbrock_weights_on_a_scalar_equation(seed):
    source = random.Random(seed)
    order = 6
    alpha, gamma = ([[x if j < i + k else F(0) for j, x in enumerate(row)] for i, row in enumerate(random_fractions(
        source, 3, 3))] for k in (0, 1))  # fmt: skip
    b, derivatives = random_fractions(source, 3), [F(1), *random_fractions(source, order)]
    conditions = bs.order_conditions("rosenbrock", order)
    error = [F(0)] * (order + 1)
    for c, r in zip(conditions, conditions.residuals(alpha, gamma, b), strict=True):
        error[c.tree.order] += r * scalar_differential(c.tree, derivatives) / c.tree.symmetry
    step, exact = rosenbrock_step(alpha, gamma, b, derivatives, order), exact_step(derivatives, order)
    assert [x - y for x, y in zip(step, exact, strict=True)] == error
    assert any(error)


def flow(part, time, order, colors):
    """The exact flow of one part for some time, as a series."""
    return bs.BSeries.from_rule(
        lambda t: time**t.order / t.density if set(t.colors) == {part} else F(0), order, colors=colors
    )


@pytest.mark.parametrize(("colors", "order"), [(2, 5), (3, 4)])
def test_splitting_conditions_are_coefficients_of_composed_flows(colors, order):
    x = random_fractions(random.Random(colors), colors, 3)
    flows = [flow(part, x[part][sweep], order, colors) for sweep in range(3) for part in range(colors)]
    whole = flows[0]
    for each in flows[1:]:
        whole = bs.compose(whole, each)
    conditions = bs.order_conditions("splitting", order, colors=colors)
    assert conditions.residuals(x) == [whole[c.tree] - c.right for c in conditions]


def splitting_order(x):
    """The largest order whose conditions hold."""
    return next(n for n in range(1, 9) if any(map(sympy.sympify, bs.order_conditions("splitting", n + 1).residuals(x))))


def test_orders_of_splitting_methods():
    assert splitting_order([[1], [1]]) == 1
    assert splitting_order([[F(1, 2), F(1, 2)], [1, 0]]) == 2
    ruth = [[F(7, 24), F(3, 4), F(-1, 24)], [F(2, 3), F(-2, 3), 1]]  # Ruth 1983
    assert splitting_order(ruth) == 3


def test_conditions_on_lyndon_words_are_all_conditions():
    # Ruth's method satisfies the five conditions to order 3; then its series agrees on all 20 trees
    x = [[F(7, 24), F(3, 4), F(-1, 24)], [F(2, 3), F(-2, 3), F(1)]]
    whole = flow(0, x[0][0], 4, 2)
    for part, sweep in [(1, 0), (0, 1), (1, 1), (0, 2), (1, 2)]:
        whole = bs.compose(whole, flow(part, x[part][sweep], 4, 2))
    exact = bs.exact_flow(4, colors=2)
    assert whole.truncate(3).coefficients() == exact.truncate(3).coefficients()
    assert whole.coefficients() != exact.coefficients()


def test_triple_jump_satisfies_the_conditions_of_symmetric_methods():
    w = (1 / (2 - 2 ** sympy.Rational(1, 3))).evalf(60)
    x = [[w / 2, (1 - w) / 2, (1 - w) / 2, w / 2], [w, 1 - 2 * w, w, 0]]

    def is_zero(values):
        return all(abs(value) < 1e-50 for value in values)

    assert is_zero(bs.order_conditions("splitting", 4, symmetric=True).residuals(x))
    assert is_zero(bs.order_conditions("splitting", 4).residuals(x))
    assert not is_zero(bs.order_conditions("splitting", 5, symmetric=True).residuals(x))
    # without symmetry odd orders are not enough: two sweeps that satisfy order 1 but not order 2
    assert bs.order_conditions("splitting", 2, symmetric=True).residuals([[1], [1]]) == [0, 0]


def test_symmetric_methods_need_odd_orders_only():
    symmetric = bs.order_conditions("runge-kutta", 6, symmetric=True)
    assert not any(symmetric.residuals(bs.method("gauss3")))
    assert not any(bs.order_conditions("runge-kutta", 6).residuals(bs.method("gauss3")))
    assert any(symmetric.residuals(bs.method("gauss2")))


# reduced sets


@pytest.mark.parametrize("stages", [1, 2, 3, 4])
@pytest.mark.parametrize("family", ["gauss", "radau", "lobatto-c"])
def test_butchers_theorem(stages, family):
    # B(p), C(q), D(r) with p ≤ q + r + 1 and p ≤ 2q + 2 give order p (Hairer–Nørsett–Wanner, theorem II.7.4)
    s = stages
    p, q, r = {"gauss": (2 * s, s, s), "radau": (2 * s - 1, s, s - 1), "lobatto-c": (2 * s, s - 1, s)}[family]
    assert len(bs.order_conditions("runge-kutta", p, assumptions={"B": p, "C": q, "D": r})) == 0
    assert len(bs.order_conditions("runge-kutta", p + 1, assumptions={"B": p, "C": q, "D": r})) > 0


def tableau_with_stage_order_2(source):
    """C(2) holds, weights are random."""
    c = source.sample([F(-1), F(-1, 3), F(1, 4), F(2, 5), F(3, 4), F(1), F(2)], 3)
    A = []
    for ci in c:
        first = random_fractions(source)
        s, t = ci - first, ci**2 / 2 - first * c[0]
        last = (t - s * c[1]) / (c[2] - c[1])
        A.append([first, s - last, last])
    return A, random_fractions(source, 3)


def tableau_with_dual_order_1(source):
    """D(1) holds."""
    c = source.sample([F(-1), F(-1, 3), F(1, 4), F(2, 5), F(3, 4), F(1), F(2)], 3)
    b = [F(0), F(source.randint(1, 5), 3), F(source.randint(1, 5), 7)]
    b[0] = (b[1] * (2 * c[1] - 1) + b[2] * (2 * c[2] - 1)) / (1 - 2 * c[0])
    rows = []
    for ci in c[:2]:
        x, y = random_fractions(source, 2)
        rows.append([x, y, ci - x - y])
    rows.append([(b[j] * (1 - c[j]) - b[0] * rows[0][j] - b[1] * rows[1][j]) / b[2] for j in range(3)])
    return rows, b


def anything(source):
    return random_fractions(source, 3, 3), random_fractions(source, 3)


def ranks(make, assumptions, order=5, samples=30):
    """Ranks of the residuals over many tableaux: of the conditions that are kept, and of all."""
    source = random.Random(7)
    everything = bs.order_conditions("runge-kutta", order)
    kept = {c.tree for c in bs.order_conditions("runge-kutta", order, assumptions=assumptions)}
    rows = [everything.residuals(*make(source)) for _ in range(samples)]
    chosen = [[r for c, r in zip(everything, row, strict=True) if c.tree in kept] for row in rows]
    return tuple(
        DomainMatrix([[sympy.QQ(x.numerator, x.denominator) for x in row] for row in m], (samples, len(m[0])), sympy.QQ)
        .rank()
        for m in (chosen, rows)
    )  # fmt: skip


@pytest.mark.parametrize(
    ("make", "assumptions"), [(tableau_with_stage_order_2, "C2"), (tableau_with_dual_order_1, {"D": 1})]
)
def test_what_is_left_out_follows_from_what_is_kept(make, assumptions):
    kept, everything = ranks(make, assumptions)
    assert kept == everything
    kept, everything = ranks(anything, assumptions)
    assert kept < everything == 17


def test_conditions_kept_for_order_5():
    # explicit methods of order 5 with C(2) and D(1): Butcher 2016, section 325
    kept = bs.order_conditions("runge-kutta", 5, assumptions="B(5), C(2), D(1)")
    assert [str(c) for c in kept] == ["Σ b_i c_i a_ij c_j^2 = 1/15"]
    assert repr(kept) == "<OrderConditions runge-kutta: order 5, 1 conditions, assuming B(5), C(2), D(1)>"


# scalar equations


@pytest.mark.parametrize("seed", range(3))
def test_scalar_conditions_are_those_of_a_scalar_equation(seed):
    source = random.Random(seed)
    order = 7
    A, b = random_fractions(source, 3, 3), random_fractions(source, 3)
    derivatives = [F(1), *random_fractions(source, order)]
    conditions = bs.order_conditions("runge-kutta", order, scalar=True)
    error = [F(0)] * (order + 1)
    for c, r in zip(conditions, conditions.residuals(A, b), strict=True):
        values = {scalar_differential(t, derivatives) for t in c.trees}
        assert len(values) == 1
        error[c.tree.order] += r * values.pop() / math.lcm(*(t.symmetry for t in c.trees))
    zero = [[F(0)] * 3] * 3
    step, exact = rosenbrock_step(A, zero, b, derivatives, order), exact_step(derivatives, order)
    assert [x - y for x, y in zip(step, exact, strict=True)] == error


def test_isomeric_trees_of_order_5():
    # the first pair for y' = f(t, y) (Butcher 2016, section 316)
    conditions = bs.order_conditions("runge-kutta", 5, scalar="nonautonomous")
    assert [[str(t) for t in c.trees] for c in conditions if len(c.trees) > 1] == [["[[τ,[τ]]]", "[τ,[[τ]]]"]]
    assert str(conditions["[[τ,[τ]]]"]).endswith(" = 7/120")
    assert conditions["[τ,[[τ]]]"] == conditions["[[τ,[τ]]]"]


# SymPy


def test_sympy_equations_against_kauri():
    conditions = bs.order_conditions("runge-kutta", 3, stages=3, explicit=True)
    a10, a20, a21, b1, b2 = sympy.symbols("a_21 a_31 a_32 b_2 b_3")
    (equation,) = (e for c, e in zip(conditions, conditions.sympy(), strict=True) if str(c.tree) == "[τ,τ]")
    assert equation.lhs - equation.rhs == a10**2 * b1 + b2 * (a20 + a21) ** 2 - sympy.Rational(1, 3)


def test_sympy_equations_with_nodes_and_in_given_symbols():
    conditions = bs.order_conditions("partitioned", 2, structure=["explicit", "diagonally-implicit"])
    found = conditions.sympy(stages=2, nodes=True)
    assert len(found) == 6 + 3  # c^p_1 is zero
    assert str(found[-1]) == "Eq(c__q_2, a__q_21 + a__q_22)"
    assert str(found[2].lhs) == "b__p_2*c__p_2"
    t = sympy.Symbol("t")
    theta = bs.order_conditions("runge-kutta", 2).sympy([[0, 0], [1 - t, t]], [1 - t, t])
    assert sympy.solve(theta[1]) == [sympy.Rational(1, 2)]
    assert "a_10_1" in {s.name for e in bs.order_conditions("runge-kutta", 2).sympy(stages=10) for s in e.free_symbols}


# floats


CASES = [
    ("runge-kutta", 4, 3, {}),
    ("runge-kutta", 5, 4, {"explicit": True}),
    ("runge-kutta", 4, 3, {"structure": "diagonally-implicit", "assumptions": "C1"}),
    ("runge-kutta", 5, 2, {"scalar": True}),
    ("partitioned", 3, 2, {"structure": ["explicit", "diagonally-implicit"]}),
    ("additive", 2, 2, {"colors": 3}),
    ("nystrom", 4, 2, {"explicit": True}),
    ("general-nystrom", 3, 2, {}),
    ("rosenbrock", 4, 3, {}),
    ("splitting", 4, 3, {}),
    ("splitting", 4, 2, {"colors": 3}),
]


@pytest.mark.few(4)
@pytest.mark.parametrize(("kind", "order", "stages", "options"), CASES)
def test_compiled_residual_and_jacobian(kind, order, stages, options):
    conditions = bs.order_conditions(kind, order, stages=stages, **options)
    f = conditions.compile()
    point = np.random.default_rng(order).standard_normal(len(f.unknowns))
    arrays = f.unpack(point)
    assert (f.pack(*arrays) == point).all()
    assert f.residual(*arrays) == pytest.approx(np.array(conditions.residuals(*arrays), float), abs=1e-12)
    symbols = sympy.symbols(f"u:{len(point)}")
    unknown = [np.zeros(array.shape, object) for array in arrays]
    for u, (name, at) in zip(symbols, f.unknowns, strict=True):
        unknown[conditions.arguments.index(name)][at] = u
    rows = [[e.lhs.diff(u) for u in symbols] for e in conditions.sympy(*unknown)]
    expected = sympy.lambdify([symbols], rows, "math")(point)
    found = f.jacobian(*arrays)
    assert found == pytest.approx(np.array(expected, float), abs=1e-10)
    direction = np.ones_like(point)
    ahead, behind = (f.residual(*f.unpack(point + e * direction)) for e in (1e-6, -1e-6))
    assert (ahead - behind) / 2e-6 == pytest.approx(found @ direction, rel=1e-5, abs=1e-6)


def test_a_wrong_jacobian_would_be_noticed():
    f = bs.order_conditions("runge-kutta", 3).compile(2)
    A, b = f.unpack(np.arange(6.0))
    assert abs(f.jacobian(A, b) - f.jacobian(A.T, b)).max() > 1


# code


def numbers(text):
    return np.array([float(x) for x in text.split()])


def run_julia(source, arrays, folder):
    def shaped(array):
        flat = ", ".join(map(repr, map(float, np.ravel(array, order="F"))))
        return f"reshape([{flat}], {', '.join(map(str, np.shape(array)))})"

    calls = [f"println(join(vec(permutedims({name}({', '.join(map(shaped, arrays))}))), ' '))" for name in NAMES]
    (folder / "conditions.jl").write_text("\n".join([source, *calls]), encoding="utf-8")
    return subprocess.run(
        ["julia", str(folder / "conditions.jl")], capture_output=True, text=True, check=True
    ).stdout.splitlines()


def run_c(source, arrays, folder, sizes):
    """Residual and Jacobian by a compiled library."""
    file, library = folder / "conditions.c", folder / "conditions.so"
    file.write_text(source, encoding="utf-8")
    command = ["gcc", "-Wall", "-Werror", "-std=c99", "-shared", "-fPIC", "-o", library, file]
    subprocess.run(command, check=True, capture_output=True)
    loaded = ctypes.CDLL(str(library))
    results = []
    for name, size in zip(NAMES, sizes, strict=True):
        given = [np.array(array, float, order="C") for array in arrays]
        result = np.full(size, np.nan)
        getattr(loaded, name)(*(x.ctypes.data_as(ctypes.c_void_p) for x in (*given, result)))
        results.append(result)
    return results


def executed(source):
    scope = {}
    exec(compile(source, "generated", "exec"), scope)
    return [scope[name] for name in NAMES if name in scope]


@pytest.mark.parametrize(("kind", "order", "stages", "options"), CASES)
def test_generated_numpy(kind, order, stages, options):
    conditions = bs.order_conditions(kind, order, **options)
    f = conditions.compile(stages)
    arrays = f.unpack(np.random.default_rng(5).integers(-5, 5, len(f.unknowns)) / 4)
    residual, jacobian = executed(conditions.code("numpy"))
    assert residual(*arrays) == pytest.approx(f.residual(*arrays), abs=1e-12)
    assert jacobian(*arrays) == pytest.approx(f.jacobian(*arrays), abs=1e-12)
    assert len(executed(conditions.code("numpy", jacobian=False))) == 1


@pytest.mark.few(8)
@pytest.mark.parametrize(("language", "program"), [("c", "gcc"), ("julia", "julia")])
@pytest.mark.parametrize(("kind", "order", "stages", "options"), CASES)
def test_generated_code(kind, order, stages, options, language, program, tmp_path):
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not there")
    conditions = bs.order_conditions(kind, order, stages=stages, **options)
    f = conditions.compile()
    arrays = f.unpack(np.random.default_rng(5).standard_normal(len(f.unknowns)))
    source = conditions.code(language)
    expected = f.residual(*arrays), f.jacobian(*arrays)
    if language == "c":
        found = run_c(source, arrays, tmp_path, [x.shape for x in expected])
    else:
        found = map(numbers, run_julia(source, arrays, tmp_path))
    for x, y in zip(found, expected, strict=True):
        assert np.ravel(x) == pytest.approx(y.ravel(), abs=1e-12)


# values and bad input


def test_conditions_are_immutable_values():
    conditions = bs.order_conditions("runge-kutta", 4, explicit=True)
    assert (
        conditions
        == bs.order_conditions("Runge_Kutta", 4, structure="explicit")
        != bs.order_conditions("runge-kutta", 4)
    )
    assert hash(conditions) == hash(pickle.loads(pickle.dumps(conditions)))
    assert conditions[-1] == conditions["[τ,τ,τ]"] == conditions[7:][0]
    with pytest.raises(AttributeError, match="immutable"):
        conditions.order = 5  # type: ignore[misc]
    with pytest.raises(IndexError):
        conditions[8]


@pytest.mark.parametrize(
    ("arguments", "options", "sentence"),
    [
        (("euler", 3), {}, "kind must be one of runge-kutta, partitioned, .*, but was 'euler'"),
        ((7, 3), {}, "kind must be one of .*, but was 7"),
        (("runge-kutta", 0), {}, "order must be 1 or more, but was 0"),
        (("runge-kutta", 2.5), {}, "order must be a whole number, but was 2.5"),
        (("runge-kutta", 61), {}, "order must be 60 or less"),
        (("runge-kutta", 20), {}, "order must be smaller: there would be 20,247,374 conditions"),
        (("splitting", 30), {}, "order must be smaller: there would be"),
        (("runge-kutta", 3), {"stages": 0}, "stages must be 1 or more, but was 0"),
        (("runge-kutta", 3), {"colors": 2}, "colors must be left out for Runge–Kutta methods, but was 2"),
        (("partitioned", 3), {"colors": 0}, "colors must be 1 or more, but was 0"),
        (("nystrom", 3), {"max_children": 2}, "max_children must be left out for .* but was 2"),
        (("runge-kutta", 3), {"structure": "lower"}, "structure must be one of full, .*, but was 'lower'"),
        (("partitioned", 3), {"structure": ["full"]}, "or 2 of them, but was \\['full'\\]"),
        (("splitting", 3), {"explicit": True}, "structure must be left out for splitting methods"),
        (("rosenbrock", 3), {"structure": "explicit"}, "structure must be left out for Rosenbrock methods"),
        (("runge-kutta", 3), {"assumptions": "E5"}, "assumptions must be like 'B5 C2 D1' .*, but were 'E5'"),
        (("runge-kutta", 3), {"assumptions": "C2 C3"}, "assumptions must be like"),
        (("runge-kutta", 3), {"assumptions": "C-1"}, "assumptions must be like"),
        (("runge-kutta", 3), {"assumptions": {"C": 1.5}}, "assumptions must be like"),
        (("runge-kutta", 3), {"assumptions": ""}, "assumptions must be like"),
        (("runge-kutta", 3), {"assumptions": 3}, "assumptions must be like"),
        (("rosenbrock", 3), {"assumptions": "C2"}, "assumptions must be left out for Rosenbrock methods"),
        (("partitioned", 3), {"scalar": True}, "scalar must be left out for partitioned"),
        (("runge-kutta", 3), {"scalar": True, "assumptions": "C2"}, "assumptions must be left out where scalar"),
        (("runge-kutta", 3), {"scalar": "yes"}, "scalar must be True, False, .* but was 'yes'"),
    ],
)
def test_bad_requests(arguments, options, sentence):
    with pytest.raises(bs.errors, match=sentence):
        bs.order_conditions(*arguments, **options)


def few():
    return bs.order_conditions("runge-kutta", 2)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: few().residuals([[0]]), "arguments must be A, b, but were 1"),
        (
            lambda: few().residuals(bs.method("stormer-verlet")),
            "method must be one of the 1-part runge-kutta kind",
        ),
        (lambda: few().residuals([[0, 1], [0]], [1, 0]), "A must have rows of one length"),
        (lambda: few().residuals([np.ones((2, 2)), np.ones((2, 3))], [1]), "A must have rows of one length"),
        (lambda: few().residuals([[0]], [1, 0]), r"b must have the shape \(1,\), but had \(2,\)"),
        (lambda: few().residuals("[[0]]", [1]), "A must hold numbers in lists"),
        (lambda: few().residuals([["1/2"]], [1]), "A must hold numbers in lists"),
        (lambda: few().residuals([], []), "A must have rows of one length, one at least"),
        (lambda: few().residuals(5, 6), "A must be an array, but was 5"),
        (lambda: few().residuals([[None]], [1]), "A must hold numbers or expressions, but had None"),
        (lambda: few().compile(10**9), "stages must be 1000 or less"),
        (lambda: few().code("c", stages=900), "stages must be fewer, or language numpy"),
        (lambda: few().sympy(), "stages must be given"),
        (lambda: few().compile(), "stages must be given"),
        (lambda: few().compile(0), "stages must be 1 or more, but was 0"),
        (lambda: few().code("c"), "stages must be given"),
        (lambda: few().code("cobol", stages=1), "language must be one of numpy, c, julia, but was 'cobol'"),
        (lambda: few().compile(2).residual([[0]], [1, 0]), r"A must have the shape \(2, 2\), but had \(1, 1\)"),
        (lambda: few().compile(2).jacobian([[0, 0], [1, 0]]), "arguments must be A, b, but were 1"),
        (lambda: few().compile(1).residual([["x"]], [1]), "A must be an array of numbers"),
        (lambda: few().compile(1).unpack([1]), "unknowns must be 2 numbers"),
        (lambda: few()["[τ,τ]"], "tree must have one of these 2 conditions, but was"),
        (lambda: few()["[τ"], "text must"),
        (lambda: bs.order_conditions("nystrom", 2).sympy(stages=1, nodes=True), "nodes must be False for nystrom"),
    ],
)
def test_bad_arguments(call, sentence):
    with pytest.raises(bs.errors, match=sentence):
        call()


def test_listing_imports_nothing_heavy():
    script = "import bseries as bs, sys; bs.order_conditions('rosenbrock', 5).text(); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "sympy", "numba", "scipy"} & set(loaded)
