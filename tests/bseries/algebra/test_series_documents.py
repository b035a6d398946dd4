"""Series read from the JSON that they write, and written for BSeries.jl."""

from __future__ import annotations

import io
import json
import re

import pytest
import sympy

import bseries as bs
from integrators.methods.tableaux.runge_kutta import RungeKutta

SERIES = {
    "rational": lambda: bs.series("rk4", 6),
    "irrational nodes": lambda: bs.modified_equation("gauss3", 7),
    "roots": lambda: bs.modified_equation("crouzeix3", 5),
    "symbols": lambda: bs.modified_equation("sdirk2", 4),
    "fractions of symbols": lambda: bs.series("explicit3", 4),
    "decimals": lambda: bs.modified_equation("tsit5", 6),
    "many decimals": lambda: bs.series("dop853", 5),
    "floats": lambda: bs.series(bs.method("rk4").to_float(), 5),
    "rounded decimals": lambda: bs.modified_equation("tsit5", 6).to_float(),
    "arithmetic on decimals": lambda: bs.series("tsit5", 4) ** 2,
    "two colours": lambda: bs.modified_equation("stormer-verlet", 4),
    "names of colours": lambda: bs.series("lawson4", 3),
    "five colours": lambda: bs.exact_flow(3, colors=5),
    "restricted": lambda: bs.modified_equation("stormer-verlet", 6, max_children=[[0, None], [None, 0]]),
    "binary": lambda: bs.series("rk4", 6, max_children=2),
    "special systems": lambda: bs.series("rkn-nystrom4", 4),
    "functions": lambda: bs.BSeries.from_rule(lambda tree: sympy.exp(sympy.Symbol("x")) * tree.order, 3, empty=0),
    "another empty tree": lambda: bs.BSeries.from_rule(lambda tree: tree.order, 3, empty=sympy.sqrt(2)),
    "floats only": lambda: bs.BSeries.from_rule(lambda tree: 1e-300 / tree.order, 4, empty=0.5),
    "inverse of a family": lambda: bs.series("sdirk2", 3).inverse(),
    "half a step": lambda: bs.series("rk4", 5) ** sympy.sqrt(3),
}


def dumps(series, **options):
    return json.dumps(series.to_dict(**options))


@pytest.mark.parametrize("name", SERIES)
def test_what_is_read_equals_what_was_written(name):
    series = SERIES[name]()
    text = dumps(series)
    found = bs.load_series(text)
    assert found == series
    assert (found.order, found.names, found.label, found.digits) == (
        series.order, series.names, series.label, series.digits,
    )  # fmt: skip
    assert found.table == series.table
    assert [found.is_zero(tree) for tree in found] == [series.is_zero(tree) for tree in series]
    # A family may be computed with a denominator that its coefficients do not need.
    assert dumps(found).replace("QQ[c2,c3]", "QQ(c2,c3)") == text
    if series.digits is None:
        assert bs.load_series(dumps(series, nonzero=True)) == series


def test_arithmetic_goes_on_with_what_was_read():
    series = bs.load_series(dumps(bs.series("gauss2", 5)))
    assert series.log() == bs.modified_equation("gauss2", 5)
    assert bs.symplecticity(series).holds


@pytest.mark.parametrize(
    "arguments",
    [
        ("modified", "rk4", "--order", "5", "--nonzero"),
        ("modifying", "implicit-midpoint", "--order", "5"),
        ("series", "sdirk2", "--order", "3"),
        ("series", "tsit5", "--order", "4", "--float"),
        ("series", "--A", "0,0;1,0", "--b", "1/2,1/3", "--order", "3"),
    ],
)
def test_files_of_the_command_are_read(tmp_path, arguments):
    from click.testing import CliRunner

    from bseries.cli.application import application

    path = tmp_path / "series.json"
    assert CliRunner().invoke(application, [*arguments, "-o", str(path)]).exit_code == 0
    found = bs.load_series(path)
    assert found == bs.load_series(io.BytesIO(path.read_bytes())) == bs.load_series(path.read_text(encoding="utf-8"))
    compute = {"modified": bs.modified_equation, "modifying": bs.modifying_integrator, "series": bs.series}
    method = RungeKutta([[0, 0], [1, 0]], ["1/2", "1/3"], warn=False) if "--A" in arguments else arguments[1]
    expected = compute[arguments[0]](method, found.order)
    assert found == (expected.to_float() if "--float" in arguments else expected)


def changed(**changes):
    return {**bs.series("heun2", 3).to_dict(), **changes}


def with_term(**changes):
    data = bs.series("heun2", 3).to_dict()
    data["terms"][2] |= changes
    return data


def without(key):
    data = bs.series("heun2", 3).to_dict()
    del data[key]
    return data


def bad_documents():
    return {
        "kind": (changed(kind="check"), "document must have schema 1 and the kind modified, .*, but had 'check'"),
        "schema": (changed(schema=2), "document must have schema 1"),
        "no terms": (without("terms"), "document must have the key terms"),
        "no order": (without("order"), "document must have the key order"),
        "terms": (changed(terms=3), "terms must be lists"),
        "few terms": (changed(terms=[]), "terms must be those of all 4 trees up to the order, but were 0"),
        "no objects": (changed(terms=[1, 2, 3, 4]), "terms must be lists"),
        "order": (changed(order="3"), "order must be a whole number, but was '3'"),
        "large order": (changed(order=10**9), "order must be 60 or less"),
        "many trees": (changed(order=40, nonzero=True), "terms must be those of all"),
        "colors": (changed(colors=["p", "p"]), "names must be different words"),
        "color": (changed(colors="p"), "terms must be lists"),
        "domain": (changed(domain="RR"), r"coefficient of \[τ\] must be the text of a number in RR, but was '1/2'"),
        "other domain": (changed(domain="QQ[x]"), "domain must be that of the coefficients, QQ, but was"),
        "digits": (changed(digits=-1), "digits must be an integer from 1"),
        "decimals": (changed(digits=16), "coefficient of τ must be the text of a number in QQ, but was None"),
        "left out": (changed(digits=16, nonzero=True), "terms must all be there for a method in decimals"),
        "max_children": (changed(max_children=[1, 2, 3]), "max_children must be one bound or 1 row"),
        "method": (changed(method=3), "domain and method must be text"),
        "empty": (changed(empty=None), "empty must be the text of a number, but was None"),
        "twice": (with_term(tree="[τ]"), r"terms must have each tree once, but had \[τ\] twice"),
        "no tree": (with_term(tree="[["), "must be one tree"),
        "tree": (with_term(tree=3), "tree must be text, but was 3"),
        "other tree": (with_term(tree="[[[τ]]]"), "must be one of the 4 trees"),
        "number": (with_term(coefficient=1), "must be the text of a number in QQ, but was 1"),
        "decimal": (with_term(coefficient="0.5"), "must be the text of a number in QQ, but was '0.5'"),
        "zero": (with_term(coefficient="1/0"), "must be the text of a number"),
        "long": (with_term(coefficient="9" * 5000), "must be the text of a number"),
        "call": (with_term(coefficient="__import__('os')"), "must be the text of a number"),
    }


def test_what_is_no_series_is_refused_in_one_sentence():
    for name, (data, message) in bad_documents().items():
        with pytest.raises(bs.errors, match=message) as caught:
            bs.load_series(json.dumps(data))
        assert "\n" not in str(caught.value), name


@pytest.mark.parametrize(
    "text", ["nan", "inf", "1e999", "1_0", "0x1", "", " 1", "1" * 500, "__import__('os')", "1.0 + 1.0"]
)
def test_floats_are_checked(text):
    data = bs.series(bs.method("heun2").to_float(), 3).to_dict()
    data["terms"][2]["coefficient"] = text
    with pytest.raises(bs.SeriesError, match=r"coefficient of \[\[τ\]\] must be the text of a number in RR"):
        bs.load_series(json.dumps(data))


@pytest.mark.parametrize(
    "text", ["f(x)", "x.y", "x[0]", "10**10**10", "lambda: 0", "(" * 500, "x" * 20_000, "CRootOf(x, 0)"]
)
def test_formulas_are_read_by_the_grammar(text):
    data = bs.series("sdirk2", 3).to_dict()
    data["terms"][2]["coefficient"] = text
    with pytest.raises(bs.errors, match="coefficient of"):
        bs.load_series(json.dumps(data))


@pytest.mark.parametrize("error", [-1, "x", None, [1]])
def test_uncertainties_are_checked(error):
    data = bs.series("tsit5", 3).to_dict()
    data["terms"][2]["error"] = error
    with pytest.raises(bs.SeriesError, match="error of"):
        bs.load_series(json.dumps(data))


@pytest.mark.parametrize("source", [3, "nowhere.json", "{", "[1]", "{}", io.StringIO("[]"), io.StringIO("NaN")])
def test_sources_that_hold_no_json_object_are_refused(source):
    with pytest.raises(bs.errors):
        bs.load_series(source)


def julia_terms(text):
    """The pairs of level sequences and coefficients of a snippet."""
    return re.findall(r"rootedtree\((?:Int)?\[([\d, ]*)\](?:, (?:Bool)?\[([a-z, ]*)\])?\) => (\S+),", text)


def test_level_sequences_and_coefficients_for_bseries_jl():
    """The listing of `bseries(ExactSolution{Rational{Int}}(), 4)` in the documentation of BSeries.jl."""
    listing = {
        "": "1", "1": "1", "1, 2": "1//2", "1, 2, 3": "1//6", "1, 2, 2": "1//3", "1, 2, 3, 4": "1//24",
        "1, 2, 3, 3": "1//12", "1, 2, 2, 3": "1//8", "1, 2, 2, 2": "1//4",
    }  # fmt: skip
    text = bs.exact_flow(4).to_julia()
    assert {levels: value for levels, _, value in julia_terms(text)} == listing
    assert "Dict{Any, Rational{Int}}(" in text
    assert text.endswith("series = bseries((t, _) -> coefficients[t], 4)\n")


def test_types_and_colours_for_bseries_jl():
    text = bs.modified_equation("symplectic-euler-p", 2).to_julia()
    assert ("1, 2", "false, true", "-1//2") in julia_terms(text) or ("1, 2", "true, false", "-1//2") in julia_terms(
        text
    )
    assert julia_terms(text)[0] == ("", "", "0")
    assert "coefficients[t], 2, BicoloredRootedTreeIterator)" in text
    assert "Dict{Any, Float64}(" in bs.series("tsit5", 3).to_julia()
    assert "Dict{Any, Float64}(" in bs.series(bs.method("rk4").to_float(), 3).to_julia()
    assert "Rational{BigInt}" in (bs.series("rk4", 8) * 10**20).with_empty(1).to_julia()


@pytest.mark.parametrize(
    ("series", "message"),
    [
        (lambda: bs.series("sdirk2", 3), r"rational or floats for BSeries.jl, but were in QQ\[gamma\]"),
        (lambda: bs.series("rk4", 4, max_children=2), "max_children must be None for BSeries.jl"),
        (lambda: bs.exact_flow(2, colors=3), "one or two colours for BSeries.jl, but has 3"),
    ],
)
def test_what_bseries_jl_cannot_hold_is_refused(series, message):
    with pytest.raises(bs.SeriesError, match=message):
        series().to_julia()
