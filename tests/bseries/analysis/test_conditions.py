"""Orders and error coefficients: every catalogue method, the simplifying assumptions, published numbers, controls."""

import re
from fractions import Fraction

import pytest
import sympy

import bseries as bs
from bseries.analysis.order import first_failure
from bseries.analysis.simplifying_assumptions import simplifying_assumptions
from bseries.analysis.structure import accuracy
from integrators import repeat
from trees.words import Words

FIXED = [entry for entry in bs.catalogue() if not entry.is_family and entry.is_tableau]
FAMILIES = [
    (f"{entry.name}{stages}", eval_order)
    for entry in bs.catalogue()
    if entry.is_family and entry.is_tableau and len(bs.method(f"{entry.name}{entry.least_stages}").partitions) == 1
    for stages in range(entry.least_stages, 8)
    for eval_order in [entry.order]
]


def claimed(order, stages):
    """The number that an order such as 2s-1 stands for."""
    factor, _, offset = str(order).partition("s")
    return int(factor) * stages + int(offset or 0)


@pytest.mark.parametrize("entry", FIXED, ids=lambda entry: entry.name)
def test_catalogue_orders_hold_and_end_there(entry):
    method = bs.method(entry.name)
    p = int(entry.order)
    assert bs.order_of(method) == p
    s = bs.series(method, p + 1)
    assert s.table.order[first_failure(s)] == p + 1


@pytest.mark.parametrize(("name", "order"), FAMILIES)
def test_family_orders_by_simplifying_assumptions(name, order):
    method = bs.method(name)
    p = claimed(order, method.stages)
    assert bs.order_of(method) == p
    if p < 8:  # the trees agree
        assert bs.order_of(bs.series(method, p)) == p
        assert bs.order_of(bs.series(method, p + 1)) == p


def test_simplifying_assumptions_of_the_families():
    s = 5  # HLW section II.1.4, Hairer–Wanner table IV.5.13
    known = {"gauss5": (10, 5, 5), "radau-ia5": (9, 4, 5), "radau-iia5": (9, 5, 4)}
    known |= {"lobatto-iiia5": (8, 5, 3), "lobatto-iiib5": (8, 3, 5), "lobatto-iiic5": (8, 4, 4)}
    for name, expected in known.items():
        assert simplifying_assumptions(bs.method(name), 2 * s + 2)[:3] == expected


@pytest.mark.parametrize("name", ["lobatto-iiia-iiib2", "lobatto-iiia-iiib3", "lobatto-iiib-iiia3", "gauss-gauss2"])
def test_orders_of_partitioned_families(name):
    assert bs.order_of(bs.method(name)) == {"2": 2, "3": 4}[name[-1]] * (2 if "gauss" in name else 1)


SPLITTINGS = {entry.name: entry.order for entry in bs.catalogue() if entry.kind == "splitting"}


@pytest.mark.parametrize("name", [name for name, p in SPLITTINGS.items() if int(p) <= 4])
def test_orders_of_splittings_by_words_are_those_by_trees(name):
    p = int(SPLITTINGS[name])
    by_trees = accuracy(name, p + 1)
    assert bs.order_of(name) == by_trees.order == p
    assert not by_trees.holds


LONG = [name for name, p in SPLITTINGS.items() if int(p) >= 6 and name != "sofroniou-spaletta10"]


@pytest.mark.few(4)
@pytest.mark.parametrize("name", [*LONG, pytest.param("sofroniou-spaletta10", marks=pytest.mark.slow)])
def test_orders_of_long_splittings_need_no_trees(name):
    """There are 19,000 trees with eight nodes in two colours, and 50 million with twelve."""
    method, p = bs.method(name), int(SPLITTINGS[name])
    assert bs.order_of(method) == p
    (part, x), *others = method.flows
    changed = bs.Splitting([(part, x + Fraction(1, 10**9)), *others], digits=method.digits)
    assert bs.order_of(changed) == 0  # the times of this part no longer add up to one
    (other, y), *others = others
    moved = [(part, x + Fraction(1, 10**9)), (other, y), (others[0][0], others[0][1] - Fraction(1, 10**9)), *others[1:]]
    assert bs.order_of(bs.Splitting(moved, digits=method.digits)) == 1


def test_words_are_the_tall_trees():
    """The coefficient of a word, from the root to the leaf, is that of the tall tree."""
    words, s = bs.series("ruth3", Words(4)), bs.series("ruth3", 4)
    for word, value in words.items():
        tree = "[".join("ab"[letter] for letter in word) + "]" * (len(word) - 1)
        assert s[tree] == value


def test_orders_of_repeated_splittings_and_of_other_parts():
    assert bs.order_of(repeat(bs.method("ruth3"), 20)) == bs.order_of(repeat(bs.method("ruth3").program, 20)) == 3
    three = [("a", "1/2"), ("b", "1/2"), ("c", 1), ("b", "1/2"), ("a", "1/2")]
    assert bs.order_of(bs.Splitting(three)) == 2 == accuracy(bs.Splitting(three), 3).order
    with_symbol = bs.Splitting([("a", "x"), ("b", 1), ("a", "1-x")], parameters=["x"])
    assert bs.order_of(with_symbol) == 1


def test_principal_error_of_the_classical_method():
    """Published by nodepy: √1745/2880 and 1/120; of order 6, √8531/5760 and 1/144."""
    error = bs.analysis.error_coefficients(bs.method("rk4"))
    assert (error.order, error.norm_squared, error.largest) == (4, Fraction(1745, 2880**2), Fraction(1, 120))
    assert error.norm == pytest.approx(1745**0.5 / 2880)
    error = bs.analysis.error_coefficients(bs.method("rk4"), 5)
    assert (error.norm_squared, error.largest) == (Fraction(8531, 5760**2), Fraction(1, 144))


def test_principal_error_equals_the_first_term_of_the_modified_equation():
    for name in ("heun2", "kutta3", "radau-iia2", "stormer-verlet-dkd"):
        error = bs.analysis.error_coefficients(bs.method(name))
        b = bs.modified_equation(bs.method(name), error.order + 1)
        assert all(b[tree] == e * tree.symmetry for tree, e in error.terms)


def test_a_family_in_a_symbol():
    error = bs.analysis.error_coefficients(bs.method("sdirk2"))
    gamma = sympy.Symbol("gamma")
    tall = dict(error.terms)[bs.Tree("[[τ]]")]
    assert error.order == 2
    assert sympy.expand(tall - (-(gamma**2) + gamma - sympy.Rational(1, 6))) == 0
    assert error.norm is None
    root = bs.method("sdirk2", gamma="(3 - sqrt(3))/6")
    assert bs.order_of(root) == 3
    assert bs.order_of(bs.method("sdirk2", gamma="(3 - sqrt(3))/6 + 1/10^12")) == 2


def test_decimals_are_decided_within_their_digits():
    assert bs.order_of(bs.method("tsit5")) == 5
    tsit5 = bs.method("tsit5")
    exact = bs.RungeKutta(tsit5.A, tsit5.b, warn=False)  # the same decimals, taken literally
    assert bs.order_of(exact) < 5
    coarse = bs.RungeKutta([[0, 0], ["0.6667", 0]], ["0.25", "0.75"], digits=4)
    assert bs.order_of(coarse) == 2
    wrong = bs.RungeKutta([[0, 0], ["0.6777", 0]], ["0.25", "0.75"], digits=4)
    assert bs.order_of(wrong) == 1


def test_floats_are_decided_up_to_rounding():
    for name in ("rk4", "dormand-prince54", "gauss2", "stormer-verlet-kdk"):
        method = bs.method(name)
        parts = [part.to_float() for part in method.partitions]
        rounded = parts[0] if len(parts) == 1 else bs.PartitionedRungeKutta(dict(zip("pq", parts, strict=True)))
        assert bs.order_of(rounded) == bs.order_of(method)


def test_floats_are_trusted_to_the_digits_that_are_given():
    entries = [[0.0, 0], [0.6667, 0]], [0.25, 0.75]
    assert bs.order_of(bs.RungeKutta(*entries)) == 1
    method = bs.RungeKutta(*entries, digits=4)
    assert bs.order_of(method) == 2
    text = str(bs.modified_equation(method, 2))  # where floats stay as they are
    assert "the tableau holds floats" in text
    assert "correct digits" not in text


def test_inconsistent_methods_have_order_zero():
    with pytest.warns(bs.methods.TableauWarning, match="inconsistent"):
        method = bs.RungeKutta([[0]], ["1/2"])
    assert bs.order_of(method) == 0
    assert not bs.check(method).properties["consistent"]


def test_order_of_a_composition():
    """Strang from Lie–Trotter: the symplectic Euler method and its adjoint, half a step each, have order 2."""
    a = bs.series(bs.method("symplectic-euler-p"), 4).scale_step(Fraction(1, 2))
    assert bs.order_of(bs.compose(a.adjoint(), a)) == 2
    assert bs.order_of(bs.compose(a, a)) == 1


def test_the_order_stops_where_it_is_told_to():
    assert bs.order_of(bs.method("rk4"), 3) == 3
    assert bs.order_of(bs.exact_flow(6)) == 6
    assert bs.order_of(bs.method("gauss5"), 7) == 7


@pytest.mark.parametrize(
    ("name", "properties"),
    [
        ("rk4", {"explicit": True, "symmetric_tableau": False, "symplectic_tableau": False}),
        ("gauss3", {"explicit": False, "symmetric_tableau": True, "symplectic_tableau": True}),
        ("lobatto-iiia3", {"explicit": False, "symmetric_tableau": True, "symplectic_tableau": False}),
        ("radau-iia2", {"explicit": False, "symmetric_tableau": False, "symplectic_tableau": False}),
        ("stormer-verlet-kdk", {"symmetric_tableau": True, "symplectic_tableau": True}),
        ("symplectic-euler-q", {"symmetric_tableau": False, "symplectic_tableau": True}),
    ],
)
def test_check_reports_what_the_tableau_decides(name, properties):
    report = bs.check(bs.method(name))
    assert properties.items() <= report.properties.items()
    for key, verdict in (("symmetric_tableau", "symmetric"), ("symplectic_tableau", "symplectic")):
        assert report.structure[verdict].holds == properties[key]
    data = report.to_dict()
    assert (data["kind"], data["order"]) == ("check", report.order)


@pytest.mark.parametrize("names", [("v", "x"), ("x", "v"), ("omega", "theta"), ("y", "z")])
def test_names_of_momenta_and_positions_are_blocks(names):
    momenta, positions = bs.method("lobatto-iiia-iiib3").partitions
    if names[0] == "x":
        momenta, positions = positions, momenta
    report = bs.check(bs.PartitionedRungeKutta(dict(zip(names, (momenta, positions), strict=True))), 5)
    named = bs.check(bs.method("lobatto-iiia-iiib3"), 5)
    label = "symplectic tableau" + " for momenta and positions" * (names == ("y", "z"))
    assert f"\n{label}  yes" in re.sub("  +", "  ", str(report))
    if names == ("y", "z"):
        assert not report.structure["symplectic"].holds
        return
    p, q = sorted(names, key=["v", "omega", "x", "theta"].index)
    assert f"{p} and {q} are taken as blocks of variables, {p}' = -H_{q} and {q}' = H_{p}." in str(report)
    assert {k: v.order for k, v in report.structure.items()} == {k: v.order for k, v in named.structure.items()}
    assert report.structure["symplectic"].holds


def test_check_needs_no_program_of_a_tableau():
    """With the roots of a polynomial of high degree among its entries it takes minutes."""
    tableau = bs.RungeKutta.from_algebra(bs.method("gauss4").algebra)
    assert not bs.check(tableau, 4).properties["explicit"]
    assert "program" not in vars(tableau)


def test_check_reports_embedded_orders():
    assert bs.check(bs.method("dormand-prince54")).embedded_orders == (4,)
    heun = bs.method("heun3")
    twice = bs.RungeKutta(heun.A, heun.b, embedded=[[1, 0, 0], ["-1/2", "3/2", 0]])
    assert bs.check(twice).embedded_orders == (1, 2)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bs.order_of(4), "method must be a method such as .* or a series on trees, .* but was 4"),
        (lambda: bs.order_of(bs.exact_flow(3).log()), "method must be a flow"),
        (lambda: bs.order_of(bs.exact_flow(3), 5), "order must be at most 3"),
        (lambda: bs.check(None), "method must be a method"),
        (lambda: bs.check(bs.method("rk4"), 0), "order must be 1 or more, but was 0"),
        (lambda: bs.analysis.error_coefficients(bs.method("rk4"), "4"), "order must be a whole number, but was '4'"),
        (lambda: bs.order_of(bs.series(bs.method("rk4").to_float(), 6)), "must be a method or an exact series"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(bs.errors, match=message):
        call()
