"""BSeries as a value: mapping, arithmetic, domains, truncation, presentations, refusals."""

import copy
import json
import pickle
from fractions import Fraction

import numpy as np
import pytest
import sympy

import bseries as bs

RK4 = bs.method("rk4")
X = sympy.Symbol("x")


def test_a_mapping_over_the_trees_of_its_table():
    s = bs.series(RK4, 4)
    assert len(s) == 8
    assert list(s) == list(bs.TreeTable(4))
    assert s["∅"] == 1
    assert "∅" not in s
    assert s["[τ,τ]"] == s["[t^2]"] == s["[0,1,1]"] == s[bs.Tree("[τ,τ]")] == Fraction(1, 3)
    assert dict(s.items()) == {tree: s[tree] for tree in s}
    assert s.get(bs.Tree("[[[[τ]]]]"), "far") == "far"
    assert bs.Tree("[τ]") in s
    with pytest.raises(bs.TreeError, match="must be one of the 8 trees"):
        s["[[[[τ]]]]"]
    with pytest.raises(TypeError, match="unhashable"):
        hash(s)


def test_colours_are_read_and_written_by_their_names():
    parts = {"u": bs.method("implicit-euler"), "v": bs.method("explicit-euler")}
    s = bs.series(bs.PartitionedRungeKutta(parts), 2)
    assert (s["u[u]"], s["u[v]"], s["v[u]"], s["v[v]"]) == (1, 0, 1, 0)
    assert [term["tree"] for term in s.to_dict()["terms"]] == ["u", "v", "u[u]", "u[v]", "v[u]", "v[v]"]


def test_texts_use_the_names_of_the_series_everywhere():
    parts = {"q": bs.method("implicit-euler"), "p": bs.method("explicit-euler")}
    s = bs.series(bs.PartitionedRungeKutta(parts), 2)
    assert (s["p[q]"], s["q[p]"]) == (1, 0)
    assert (s.is_zero("p[q]"), s.is_zero("q[p]")) == (False, True)
    assert (s.get("p[q]"), s.get("p[q,q]", 7), s.get("∅")) == (1, 7, 1)
    assert "p[q]" in s
    assert "p[q,q]" not in s
    with pytest.raises(bs.SeriesError, match="names must be 2 names, one for each colour, but were 1"):
        bs.BSeries.from_rule(lambda tree: 1, 2, colors=2, names=("a",))


def test_series_are_immutable_and_can_be_pickled():
    s = bs.series(bs.method("tsit5"), 3)
    with pytest.raises(AttributeError, match="immutable"):
        s.empty = 7
    with pytest.raises(AttributeError, match="immutable"):
        s.table.limits = ()
    again = pickle.loads(pickle.dumps(s))
    assert again == s
    assert again.uncertainty(2) == s.uncertainty(2) > 0


def test_any_coefficient_of_the_empty_tree():
    a = bs.series(RK4, 3)
    for empty in (sympy.sqrt(2), X, Fraction(1, 3), -2):
        c = a.with_empty(empty)
        result = bs.compose(a, c)
        assert result["∅"] == empty
        assert sympy.simplify(result["[τ]"] - (empty * a["[τ]"] + a["τ"] ** 2 + a["[τ]"])) == 0
        assert bs.algebra.lie_derivative(a.log(), c)["τ"] == empty


def test_colours_of_two_series_must_have_the_same_names():
    first, second = bs.method("explicit-euler"), bs.method("implicit-euler")
    x = bs.series(bs.PartitionedRungeKutta({"u": first, "v": second}), 2)
    y = bs.series(bs.PartitionedRungeKutta({"v": second, "u": first}), 2)
    assert x != y
    assert (x["u[v]"], y["u[v]"]) == (1, 1)
    for call in (lambda: x - y, lambda: bs.compose(x, y)):
        with pytest.raises(bs.SeriesError, match=r"must name their colours alike, but have \('u', 'v'\) and"):
            call()
    assert (y - bs.exact_flow(2, colors=2, names=("v", "u")))["u[v]"] == Fraction(1, 2)


def test_roots_of_a_symbol_are_not_independent_of_it():
    b = bs.BSeries.from_rule(lambda tree: sympy.sqrt(X), 2, empty=0)
    found = bs.algebra.lie_derivative(b, b)
    assert found == bs.BSeries.from_rule(lambda tree: X if tree.order == 2 else 0, 2, empty=0)


def test_many_roots_are_no_obstacle():
    method = bs.RungeKutta([["sqrt(2)", "root(3,3)"], ["root(5,5)", 0]], [1, 0], warn=False)
    assert bs.series(method, 2)["[τ]"] == sympy.sqrt(2) + sympy.cbrt(3)


def test_results_made_of_decimals_keep_their_digits_and_are_no_proof_of_order():
    s = bs.series(bs.method("tsit5"), 4)
    assert bs.order_of(s) == 4
    for made in (s * 1, s**2, bs.compose(s, s), s.scale_step(2), s - s, s.truncate(3).log()):
        assert made.digits == 16
    with pytest.raises(bs.SeriesError, match="was made of a series in decimals"):
        bs.order_of(s * 1)


def test_symbolic_series_are_copied_and_pickled():
    s = bs.modified_equation(bs.method("sdirk2"), 3)
    assert copy.deepcopy(s) is s
    assert pickle.loads(pickle.dumps(s)) == s


def test_vector_space():
    a, b = bs.series(RK4, 5), bs.exact_flow(5)
    assert (a - b) + b == a
    assert -(a - b) == b - a
    assert (a.log() - a)["∅"] == -1
    assert (a * 3)["∅"] == 3
    assert 2 * a == a + a == a / Fraction(1, 2)
    assert (a * 0).nonzero() == []
    assert sum([a, b]) == a + b
    assert np.float64(2) * a == a * 2.0
    with pytest.raises(TypeError):
        a + 1


@pytest.mark.parametrize(
    ("number", "domain"),
    [
        (Fraction(1, 3), "QQ"),
        (2, "QQ"),
        (np.int64(2), "QQ"),
        (0.5, "RR"),
        (np.float32(0.5), "RR"),
        (sympy.Rational(1, 3), "QQ"),
        (sympy.sqrt(2), "QQ<sqrt(2)>"),
        (X, "QQ[x]"),
        (1 / (1 + X), "QQ(x)"),
        (sympy.Float("0.5"), "RR"),
    ],
)
def test_the_domain_is_the_smallest_that_holds_all(number, domain):
    series = bs.exact_flow(3) * number
    assert series.domain == domain
    assert series.is_exact == (domain != "RR")
    assert type(series["[τ]"]) is {"QQ": Fraction, "RR": float}.get(domain, type(series["[τ]"]))
    flow = bs.BSeries.from_rule(lambda tree: number, 3)
    assert flow.domain == domain
    assert flow.log().domain == domain


def test_irrational_entries_with_rational_coefficients_are_rational():
    root = sympy.sqrt(3) / 6
    half, quarter = sympy.Rational(1, 2), sympy.Rational(1, 4)
    gauss = bs.RungeKutta([[quarter, quarter - root], [quarter + root, quarter]], [half, half])
    assert gauss.algebra is None
    assert bs.series(gauss, 6).domain == "QQ"
    assert bs.series(gauss, 6) == bs.series(bs.method("gauss2"), 6)


@pytest.mark.parametrize(
    "numbers",
    [(Fraction(1, 2), X), (X, sympy.sqrt(2)), (sympy.sqrt(2), sympy.sqrt(3)), (1 / X, 1 / (X + 1)), (X, 0.5)],
    ids=str,
)
def test_operands_of_different_domains(numbers):
    a, b = (bs.BSeries.from_rule(lambda tree, number=number: number * tree.order, 3) for number in numbers)
    if any(isinstance(number, float) for number in numbers):
        with pytest.raises(bs.SeriesError, match="must be a number to become a float, but was x"):
            bs.compose(a, b)
        return
    result = bs.compose(bs.compose(a, b), b.inverse())
    assert result == a
    assert all(sympy.simplify(result[tree] - a[tree]) == 0 for tree in a)


def test_symbolic_powers_interpolate():
    theta = sympy.Symbol("theta")
    family = bs.series(RK4, 4) ** theta
    third = bs.series(RK4, 4) ** Fraction(1, 3)
    for tree in third:
        assert sympy.Rational(str(third[tree])) == sympy.sympify(family[tree]).subs(theta, sympy.Rational(1, 3))


def test_truncation_agrees_with_computing_less():
    for method in (RK4, bs.method("sdirk2"), RK4.to_float(), bs.method("tsit5")):
        assert bs.modified_equation(method, 5).truncate(3) == bs.modified_equation(method, 3)
    with pytest.raises(bs.SeriesError, match="order must be at most 3, the order of the series, but was 4"):
        bs.series(RK4, 3).truncate(4)


def test_zeros_in_floats():
    s = bs.series(bs.method("explicit-euler").to_float(), 3)
    assert [s.is_zero(tree) for tree in s] == [False, True, True, True]
    assert s.nonzero() == [(bs.Tree("τ"), 1.0)]


def test_common_denominators_are_divided_by_without_a_change():
    values = bs.BSeries.from_rule(lambda tree: tree.density / (1 + X) ** tree.order + X, 4).stored
    assert values.step != values.reduced.step == values.reduced.ring.one
    differences = map(sympy.Add, values.coefficients(), (-x for x in values.reduced.coefficients()))
    assert not any(map(sympy.simplify, differences))


def test_step_scaling():
    s = bs.series(RK4, 4)
    assert s.scale_step(Fraction(1, 2))["[τ,τ]"] == s["[τ,τ]"] / 8
    assert s.scale_step(-1).scale_step(-1) == s
    assert s.scale_step(X)["[τ]"] == X**2 / 2


def test_weights_are_coefficients_over_symmetry():
    found = {str(term.element): (term.coefficient, term.weight) for term in bs.series(RK4, 3).terms()}
    assert found["[τ,τ]"] == (Fraction(1, 3), Fraction(1, 6))


def test_json_keeps_its_schema():
    data = json.loads(json.dumps(bs.modified_equation(RK4, 5).to_dict()))
    head = {key: value for key, value in data.items() if key != "terms"}
    assert head == {
        "schema": 1, "kind": "modified", "method": "rk4", "order": 5, "domain": "QQ", "colors": [""], "empty": "0",
        "max_children": None, "nonzero": False,
    }  # fmt: skip
    assert data["terms"][6] == {
        "tree": "[τ,[τ]]", "levels": [0, 1, 1, 2], "colors": [0, 0, 0, 0], "order": 4, "symmetry": 1, "density": 8,
        "coefficient": "0", "weight": "0", "differential": "f''(f,f'(f))",
    }  # fmt: skip
    assert len(bs.modified_equation(RK4, 5).to_dict(nonzero=True)["terms"]) == 10


def test_decimals_are_shown_with_their_digits_and_zero_within_them():
    b = bs.modified_equation(bs.method("tsit5"), 6)
    data = b.to_dict()
    assert data["digits"] == 16
    assert all(term["coefficient"] == "0" for term in data["terms"][1:17])
    assert any(term["coefficient"] != "0" for term in data["terms"][17:])
    assert all(len(term["coefficient"]) < 25 for term in data["terms"])
    assert b["[τ]"] != 0  # the mapping keeps the exact result of the printed decimals
    assert b.is_zero("[τ]")


def test_latex_of_a_flow_and_of_a_field():
    assert bs.series(RK4, 2).to_latex() == "y + h\\, f + \\frac{1}{2} h^{2}\\, f'(f)"
    latex = bs.modified_equation(bs.method("sdirk2"), 3).to_latex()
    assert latex.startswith("f + \\left(- \\gamma^{2} + \\gamma - \\frac{1}{6}\\right) h^{2}\\,")
    tiny = bs.BSeries.from_rule(lambda tree: 1e-10 ** (tree.order - 1), 2)
    assert tiny.to_latex() == "y + 1.0 h\\, f + 1 \\cdot 10^{-10} h^{2}\\, f'(f)"


def test_text_and_html():
    s = bs.modified_equation(bs.method("symplectic-euler-p"), 2)
    lines = str(s).splitlines()
    assert lines[0] == "Modified equation of symplectic-euler-p: trees with 1 to 2 nodes, powers h^0 to h^1"
    assert lines[7].split()[:4] == ["2", "p[p]", "1/2", "1/2"]
    html = s._repr_html_()
    assert html.count("<svg") == 6
    assert "symplectic-euler-p" in html
    assert s._repr_latex_().startswith("$")


def test_long_series_are_shown_in_part():
    s = bs.exact_flow(9)
    lines = str(s).splitlines()
    assert "… 286 more rows" in lines
    html = s._repr_html_()
    assert html.count("<svg") == 200
    assert "… 286 more rows" in html
    assert "more" not in str(bs.exact_flow(7))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bs.series(4, 4), "method must be a method such as method.* or a series on trees, .* but was 4"),
        (lambda: bs.series(RK4, 30), "order must be smaller: a series of 550695545884 trees would take"),
        (lambda: bs.series(RK4, bs.TreeTable(3, 2)), "order must be a table of trees in 1 colours, but was TreeTable"),
        (lambda: bs.series(RK4, bs.TreeTable(3), max_children=1), "max_children must be None where a table is given"),
        (lambda: bs.modified_equation(bs.exact_flow(3), max_children=1), "max_children must be None for a series"),
        (lambda: bs.BSeries.from_rule(lambda tree: 0.5 * X, 2), "must not mix floats with symbols"),
        (lambda: bs.BSeries.from_rule(lambda tree: 0.5 * sympy.Symbol("r", real=True), 2), "must not mix floats"),
        (lambda: bs.BSeries.from_rule(lambda tree: sympy.I, 2), "coefficient must be a number or a SymPy expression"),
        (lambda: bs.BSeries.from_rule(lambda tree: sympy.nan, 2), "coefficient must be"),
        (lambda: bs.BSeries.from_rule(lambda tree: sympy.zoo * X, 2), "coefficient must be"),
        (lambda: bs.BSeries.from_rule(lambda tree: 1e308, 2) ** 2, "must stay within the range of floats"),
        (lambda: bs.series(RK4, 2) * 10**400 * 0.5, "must"),
        (lambda: bs.TreeTable(3, 1, [2]), "max_children must be one bound or 1 row of 1 or 2 bounds"),
        (lambda: bs.TreeTable(3, 1, "a"), "max_children must"),
        (lambda: bs.BSeries.from_rule(lambda tree: "1", 3), "coefficient must be a number or a SymPy expression"),
        (lambda: bs.BSeries.from_rule(lambda tree: float("inf"), 3), "coefficient must be finite, but was inf"),
        (lambda: bs.BSeries.from_rule(lambda tree: sympy.zoo, 3), "coefficient must be a number"),
        (lambda: bs.series(RK4, 3).exp(), "must be a field, with the coefficient 0 of the empty tree, but has 1"),
        (lambda: bs.series(RK4, 3).log().log(), "must be a flow, with the coefficient 1 of the empty tree"),
        (lambda: bs.compose(bs.series(RK4, 3), 1), "c must be a series, .*, but was 1"),
        (lambda: bs.compose(bs.series(RK4, 3), bs.series(RK4, 4)), "both series must have the same trees"),
        (lambda: bs.series(RK4, 3) ** "2", "exponent must be a number"),
        (lambda: bs.series(RK4, 3) / 0, "number must not be zero"),
        (lambda: bs.series(RK4, 3) * bs.series(RK4, 3), "compose\\(a, b\\) applies a and then b"),
        (lambda: bs.series(RK4, 2.5), "order must be a whole number, but was 2.5"),
    ],
)
def test_refusals_name_the_argument(call, message):
    with pytest.raises(bs.errors, match=message):
        call()
