"""Scenes: what is read, what is refused, effects, and the two forms of a field against each other."""

from __future__ import annotations

import copy
import pickle
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from integrators import Effect, IntegratorError, Scene, Term
from integrators import scene as named_scene
from integrators.scenes.checks import guards
from integrators.scenes.model import formulas
from integrators.scenes.model.formulas import formula_text, read_formula

PQ = {"p": 1, "q": 1}
PENDULUM = "p^2/2 - cos(q)"
LATTICE = {"p": 3, "q": 3}
KINETIC = Term(over="each", hamiltonian="p_i^2/2")


def symbols(names):
    return sympy.symbols(names, real=True)


# Equal values from text, SymPy and numbers


def test_text_and_sympy_give_equal_scenes():
    p, q, k = symbols("p q k")
    text = Scene(PQ, hamiltonian="p^2/2 - 0.5*k*cos(q)", parameters={"k": 0.1}, start={"p": 0, "q": [-1.5]})
    formulas = Scene(
        {"p": ["p"], "q": ["q"]},
        terms=[Term(hamiltonian=p**2 / 2), Term(hamiltonian=-0.5 * k * sympy.cos(q))],
        parameters={"k": sympy.Rational(1, 10)},
        start={"p": np.array([0.0]), "q": Fraction(-3, 2)},
    )
    assert text == formulas
    assert hash(text) == hash(formulas)
    assert text.field == formulas.field == (-sympy.sin(sympy.Symbol("q")) / 20, sympy.Symbol("p"))


def test_fields_may_be_written_with_symbols():
    p, q = symbols("p q")
    assert Scene(PQ, field={p: -sympy.sin(q), q: p}) == Scene(PQ, field={"p": "-sin(q)", "q": "p"})


BASE = {"variables": PQ, "hamiltonian": PENDULUM, "start": {"p": 0, "q": 1}}


@pytest.mark.parametrize(
    "change",
    [
        {"hamiltonian": "p^2/2 - cos(2*q)"},
        {"start": {"p": 0, "q": 2}},
        {"start": None},
        {"parameters": {"k": 1}},
        {"invariants": {"zero": "p - p"}},
        {"positive": ["q"]},
        {"effects": {"drag": Effect(field={"p": "-p"})}},
        {"variables": {"q": 1, "p": 1}},
    ],
)
def test_other_content_gives_other_scenes(change):
    assert Scene(**{**BASE, **change}) != Scene(**BASE)
    assert Scene(**BASE, name="a name", summary="and what it is") == Scene(**BASE)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (2, 2),
        (0.1, Fraction(1, 10)),
        (1e-3, Fraction(1, 1000)),
        (Decimal("0.1"), Fraction(1, 10)),
        (Fraction(1, 3), Fraction(1, 3)),
        (np.float64(0.1), Fraction(1, 10)),
        (np.int64(7), 7),
        (np.array(0.5), Fraction(1, 2)),
        (sympy.Float(0.1), Fraction(1, 10)),
        (sympy.Float("0.12345678901234567890", 20), Fraction(12345678901234567890, 10**20)),
        (0.1 + 0.2, Fraction("0.30000000000000004")),
        (sympy.Float(0.1 + 0.2), Fraction("0.30000000000000004")),
        ("1/3", Fraction(1, 3)),
    ],
)
def test_numbers_are_the_decimals_they_print_as(value, expected):
    assert read_formula(value, (), "number") == sympy.Rational(expected)


x, y = sympy.symbols("x y")
expressions = st.recursive(
    st.sampled_from([x, y, sympy.Integer(2), sympy.Rational(-1, 3), sympy.pi, sympy.E, sympy.sqrt(2)]),
    lambda inner: st.one_of(
        st.builds(lambda a, b: a + b, inner, inner),
        st.builds(lambda a, b: a * b, inner, inner),
        st.builds(lambda a: 1 / (a**2 + 3), inner),
        st.builds(lambda a: (a - 1) / 3 * sympy.Rational(1, 2), inner),
        st.builds(lambda f, a: f(a), st.sampled_from([sympy.sin, sympy.exp, sympy.cosh]), inner),
        st.builds(lambda a: sympy.sqrt(a**2 + 1), inner),
    ),
    max_leaves=5,
)


def has_huge_constant(formula):
    """Whether a function has a constant argument beyond 10000, which the parser refuses."""
    return any(f.args[0].is_number and abs(f.args[0].evalf()) > 10_000 for f in formula.atoms(sympy.Function))


@settings(max_examples=60)
@given(expressions.filter(lambda formula: not has_huge_constant(formula)))
def test_formulas_come_back_from_their_text(formula):
    read = read_formula(formula, ["x", "y"], "formula")
    assert read_formula(formula_text(read), ["x", "y"], "formula") == read
    assert read_formula(read, ["x", "y"], "formula") == read
    point = {x: sympy.Rational(3, 7), y: sympy.Rational(5, 11)}
    assert abs((read - formula).subs(point).evalf(30)) < 1e-15 * (1 + abs(formula.subs(point).evalf(30)))


def test_sums_that_are_longer_than_the_parser_takes_are_read_from_sympy():
    names = [f"{'long' * 20}{k}" for k in range(1, 151)]
    total = sympy.Add(*(sympy.Symbol(name) ** 2 / 3 for name in names))
    assert len(formula_text(total)) > 10_000
    assert read_formula(total, names, "formula") == total


def test_equal_formulas_are_read_again_once_and_refused_under_their_own_names(monkeypatch):
    formula, parsed = sympy.sin(sympy.Symbol("q") / 7) / 11, []
    parse = formulas.parse_expression
    monkeypatch.setattr(formulas, "parse_expression", lambda *a, **options: parsed.append(a) or parse(*a, **options))
    assert read_formula(formula, ["q"], "hamiltonian") == formula
    once = len(parsed)
    assert read_formula(formula, ["q"], "field.p") == formula
    assert once == len(parsed) == 1
    for name in ("hamiltonian", "field.p"):
        with pytest.raises(IntegratorError, match=f"^{name} must have functions of .* only, but has 'gamma'$"):
            read_formula(sympy.gamma(sympy.Symbol("q")), ["q"], name)


# What is refused

BAD = {
    "no mapping": ({"variables": ["p", "q"]}, r"variables must map names of blocks to sizes, but was \['p', 'q'\]"),
    "no blocks": ({"variables": {}}, "variables must have at least one block"),
    "size": ({"variables": {"p": 1.0, "q": 1}}, r"variables.p must be a number, a pair .* but was 1.0"),
    "truth as size": ({"variables": {"p": True, "q": 1}}, "variables.p must be a number"),
    "dimension": ({"variables": {"p": [2, 4], "q": [2, 4]}}, r"dimensions up to 3\].* but was \[2, 4\]"),
    "negative size": ({"variables": {"p": -1, "q": 1}}, "variables.p must have at least one site .* but had -1"),
    "too many": ({"variables": {"p": [10**6, 3], "q": 1}}, "at most 1000000 variables, but had 1000000 and 3000000"),
    "pi": ({"variables": {"pi": 1, "q": 1}}, "must not be called pi"),
    "function": ({"variables": {"sin": 1, "q": 1}}, "not name a function, but one was 'sin'"),
    "two of a name": ({"variables": {"p": ["u", "u"]}}, "variables.p must have different names"),
    "of two blocks": ({"variables": {"p": ["u"], "q": ["u"]}}, "u stands for a variable of the block p and a var"),
    "q1 and 11 sites": ({"variables": {"q": 11, "q1": 1}}, "q1 stands for a variable of the block q and a variable of"),
    "qx and sites": ({"variables": {"q": [5, 2], "qx": 1}}, "qx_i stands for qx at a site and qx at a site"),
    "t in three": ({"variables": {"t": 3}}, "variables.t must be the time"),
    "no equation": ({"hamiltonian": None}, "must have an equation for every variable, but has none for p, q"),
    "missing equation": ({"hamiltonian": None, "field": {"p": "q"}}, "but has none for q$"),
    "other equation": ({"field": {"r": "p"}}, "field must have equations for p, q, but has one for 'r'"),
    "no momenta": ({"variables": {"y": 3}, "hamiltonian": "y1"}, "a block of momenta and one of .* but had y of 3"),
    "unequal": ({"variables": {"p": 2, "q": 3}, "hamiltonian": "q1"}, "but had p of 2, q of 3"),
    "unknown name": ({"hamiltonian": "p^2 + r"}, "must be a formula in p, q, t, but has the unknown name 'r'"),
    "unknown symbol": ({"hamiltonian": sympy.Symbol("r")}, "has the unknown name 'r'"),
    "odd symbol": ({"hamiltonian": sympy.Symbol("p + q")}, r"has the unknown name 'p \+ q'"),
    "unknown function": ({"hamiltonian": "Abs(q)"}, "must have functions of sin, cos, .* root only, but has 'Abs'"),
    "gamma": ({"hamiltonian": sympy.gamma(x).subs(x, sympy.Symbol("q"))}, "but has 'gamma'"),
    "Piecewise": ({"hamiltonian": sympy.Piecewise((1, sympy.Eq(sympy.Symbol("q"), 0)), (0, True))}, "Piecewise"),
    "Derivative": ({"hamiltonian": sympy.Function("f")(sympy.Symbol("q")).diff(sympy.Symbol("q"))}, "Derivative"),
    "function of time": ({"hamiltonian": sympy.Function("p")(sympy.Symbol("t"))}, "but has 'p'"),
    "I": ({"hamiltonian": sympy.I * sympy.Symbol("q")}, "hamiltonian must be real"),
    "complex root": ({"hamiltonian": "sqrt(-2)*q"}, "even root of a negative number"),
    "complex power": ({"hamiltonian": (-1) ** sympy.Rational(1, 3) * sympy.Symbol("q")}, "of a negative number"),
    "asin": ({"hamiltonian": sympy.asin(2) * sympy.Symbol("q")}, "is not real"),
    "oo": ({"hamiltonian": sympy.oo}, "is not finite"),
    "nan": ({"hamiltonian": sympy.nan}, "is not finite"),
    "float nan": ({"hamiltonian": float("nan")}, "hamiltonian must be finite, but was nan"),
    "decimal nan": ({"hamiltonian": Decimal("nan")}, "is not finite"),
    "large decimal": ({"hamiltonian": Decimal("1e999999")}, "more than 4000 digits"),
    "large integer": ({"hamiltonian": 10**5000}, "more than 4000 digits"),
    "relation": ({"hamiltonian": sympy.Symbol("q") > 0}, "hamiltonian must be a formula or a number"),
    "truth": ({"hamiltonian": True}, "must be a formula or a number, but was True"),
    "complex": ({"hamiltonian": 1j}, "must be a formula or a number, but was 1j"),
    "array": ({"hamiltonian": np.array([1, 2])}, "must be a formula or a number"),
    "matrix symbol": ({"hamiltonian": sympy.MatrixSymbol("q", 1, 1)[0, 0]}, "in plain symbols"),
    "not commutative": ({"hamiltonian": sympy.Symbol("q", commutative=False)}, "in plain symbols"),
    "code": ({"hamiltonian": "__import__('os')"}, "but has '__import__'"),
    "deep": ({"hamiltonian": "(" * 500 + "q" + ")" * 500}, "nested more than 100 deep"),
    "parameter t": ({"parameters": {"t": 1}}, "parameters must not be called t"),
    "parameter p_i": ({"parameters": {"p_i": 1}}, "p_i stands for the parameter p_i and p at a site"),
    "parameter q": ({"parameters": {"q": 1}}, "q stands for a variable of the block q and the parameter q"),
    "parameter m_i": ({"parameters": {"m": [1], "m_i": 1}}, "m_i stands for the parameter m_i and m at a site"),
    "formula": ({"parameters": {"m": "2*m"}}, r"parameters.m must be a number or its own name, but was '2\*m'"),
    "no numbers": ({"parameters": {"m": []}}, "parameters.m must have a number for each site"),
    "numbers of numbers": ({"parameters": {"m": [[1]]}}, r"parameters.m\[1\] must be a formula or a number"),
    "parameter list": ({"parameters": ["m"]}, "parameters must map names to numbers"),
    "term": ({"terms": Term(hamiltonian="q")}, "terms must be a sequence"),
    "text as term": ({"terms": ["q"]}, "terms must be Terms, but one was 'q'"),
    "start": ({"start": {"p": 1}}, "start must have values for p, q, but has none for q"),
    "unknown start": ({"start": {"p": 1, "q": 1, "r": 1}}, "but has some for 'r'"),
    "long start": ({"start": {"p": [1, 2], "q": 1}}, "start.p must have as many values .*, 1, but has 2"),
    "symbol as start": ({"start": {"p": "q", "q": 1}}, r"start.p\[1\] must be a number, but has the unknown name 'q'"),
    "infinite start": ({"start": {"p": float("inf"), "q": 1}}, r"start.p\[1\] must be finite, but was inf"),
    "start list": ({"start": [1, 2]}, "start must map blocks to lists of numbers"),
    "start of no time": ({"start": {"p": 1, "q": 1, "t": 0}}, "must not have a value for the time t where nothing"),
    "integral of no time": ({"invariants": {"a": "t"}}, "must not use the time t"),
    "invariants": ({"invariants": ["p"]}, "invariants must map names to formulas"),
    "positive": ({"positive": "q"}, "positive must be a sequence, but was 'q'"),
    "effects": ({"effects": {"a": {}}}, "effects must map names to Effects"),
    "active": ({"active": ["a"]}, "there is no effect 'a'"),
    "name": ({"name": 3}, "name must be text, but was 3"),
    "poisson": ({"poisson": [[0, 1]]}, "poisson must be square with 1 to 2 rows, but had rows of 2 entries"),
    "symmetric": ({"poisson": [[0, "q"], ["q", 0]]}, r"its entries \(2, 1\) and \(1, 2\) were q and q"),
    "poisson alone": ({"poisson": [[0, 1], [-1, 0]], "hamiltonian": None, "field": {"p": 1, "q": 1}}, "must be given"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "message"), BAD.values(), ids=BAD)
def test_bad_input_is_refused_in_one_sentence(change, message):
    with pytest.raises(IntegratorError, match=message) as caught:
        Scene(**{"variables": PQ, "hamiltonian": PENDULUM, **change})
    assert len(str(caught.value)) < 400


BAD_TERMS = {
    "field and hamiltonian": ({"hamiltonian": "q", "field": {"p": "q"}}, "either hamiltonian or field, but had both"),
    "nothing": ({}, "but had neither"),
    "field": ({"field": ["p"]}, "field must map variables to formulas"),
    "over": ({"over": "all", "hamiltonian": "q_i"}, "over must be one of single, each, .* but was 'all'"),
    "site 0": ({"over": [(0, 1)], "hamiltonian": "q_i"}, "site numbers from 1"),
    "ragged": ({"over": [(1, 2), (1,)], "hamiltonian": "q_i"}, "over must be one of"),
    "five sites": ({"over": [(1, 2, 3, 4, 5)], "hamiltonian": "q_i"}, "rows of 1 to 4 site numbers"),
    "no rows": ({"over": [], "hamiltonian": "q_i"}, r"but was \[\]"),
    "no such site": ({"over": [(1, 4)], "hamiltonian": "q_i"}, "must have site numbers up to 3, but had 4"),
    "q_j": ({"over": "each", "hamiltonian": "q_j"}, r"terms\[1\].hamiltonian .* p_i, q_i, k, t, but .* 'q_j'"),
    "flat name": ({"over": "each", "hamiltonian": "q_i*q1"}, "has the unknown name 'q1'"),
    "flat target": ({"over": "each", "field": {"p1": "q_i"}}, "must have equations for p_i, q_i, but has one for 'p1'"),
    "no site": ({"over": "pairs", "hamiltonian": "k"}, "must have names at equally many sites, but had none"),
    "other sites": ({"over": "each", "hamiltonian": "q_i*m_i"}, "at equally many sites, but had 2 of m and 3 of q"),
    "part": ({"hamiltonian": "q1", "part": 3}, "part must be text, but was 3"),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "message"), BAD_TERMS.values(), ids=BAD_TERMS)
def test_bad_terms_are_refused(arguments, message):
    values = {"k": 1, "m": [1, 2]} if "m_i" in str(arguments) else {"k": 1}
    with pytest.raises(IntegratorError, match=message):
        Scene(LATTICE, terms=[Term(**arguments), KINETIC], parameters=values)


BAD_EFFECTS = {
    "nothing": ({}, "an effect must have a hamiltonian, a field or terms"),
    "unknown name": ({"field": {"p": "r"}}, "effects.a.field.p must be a formula in .* has the unknown name 'r'"),
    "unknown target": ({"field": {"r": "p"}}, "effects.a.field must have equations for p, q, but has one for 'r'"),
    "no equation": (
        {"field": {"p": "u"}, "variables": {"u": 1}},
        "effects.a.field must have an equation .* none for u",
    ),
    "no start": ({"field": {"u": "1"}, "variables": {"u": 1}}, "effects.a.start must have values for u, but has none"),
    "start of others": ({"field": {"p": "1"}, "start": {"p": 1}}, "effects.a.start .* but has some for 'p'"),
    "time": (
        {"field": {"t": "1"}, "variables": {"t": 1}},
        "t stands for the time and a variable of the block effects.a",
    ),
    "parameter of the scene": ({"field": {"p": "k"}, "parameters": {"k": 1}}, "the parameter k and .* effects.a.k"),
    "parameter of another": (
        {"field": {"p": "c"}, "parameters": {"c": 1}},
        "effects.a.c and the parameter effects.b.c",
    ),
    "block of the scene": ({"field": {"u": "1"}, "variables": {"p": ["u"]}}, "a block of the scene and a block of"),
    "breaks": (
        {"field": {"p": "1"}, "breaks": ["c"]},
        "effects.a.breaks must be of the invariants none, but one was 'c'",
    ),
    "breaks as text": ({"field": {"p": "1"}, "breaks": "c"}, "breaks must be a sequence"),
    "no mapping": ({"field": ["p"]}, "field of an effect must be a mapping"),
    "summary": ({"field": {"p": "1"}, "summary": 3}, "summary of an effect must be text"),
}


@pytest.mark.parametrize(("arguments", "message"), BAD_EFFECTS.values(), ids=BAD_EFFECTS)
def test_mistakes_in_effects_are_found_while_they_are_off(arguments, message):
    with pytest.raises(IntegratorError, match=message):
        Scene(
            PQ, hamiltonian=PENDULUM, parameters={"k": 1}, start={"p": 0, "q": 1},
            effects={"a": Effect(**arguments), "b": Effect(field={"p": "c"}, parameters={"c": 2})},
        )  # fmt: skip


def test_a_hamiltonian_effect_needs_a_structure():
    with pytest.raises(IntegratorError, match=r"effects.a.variables must have a block of momenta"):
        Scene({"y": 1}, field={"y": "y"}, effects={"a": Effect(hamiltonian="y")})


def test_names_that_only_look_like_those_of_sites_are_allowed():
    scene = Scene(PQ, field={"p": "-gamma_i*q", "q": "p"}, parameters={"gamma_i": 2})
    assert str(scene.field) == "(-2*q, p)"
    assert str(scene.local_terms[0].formula) == "-2*x0"


# Effects

THERMOSTAT = Effect(
    field={"p": "-xi*p", "xi": "(p^2 - T)/Q"}, variables={"xi": 1}, parameters={"T": 1, "Q": 10}, start={"xi": 0}
)
EFFECTS = {
    "asymmetry": Effect(hamiltonian="epsilon*sin(2*q)", parameters={"epsilon": 0.2}),
    "damping": Effect(field={"p": "-gamma*p"}, parameters={"gamma": "1/10"}),
    "drive": Effect(field={"p": "a*cos(omega*t)"}, parameters={"a": "1/2", "omega": "2/3"}, start={"t": 1}),
    "thermostat": THERMOSTAT,
}


def rich():
    return Scene(
        PQ, hamiltonian=PENDULUM, start={"p": 0, "q": -1}, effects=EFFECTS, invariants={"energy": PENDULUM}, name="rich"
    )


def test_effects_that_are_off_leave_no_trace():
    plain = Scene(PQ, hamiltonian=PENDULUM, start={"p": 0, "q": -1})
    off = rich()
    assert off.active == ()
    for attribute in ("blocks", "summands", "field", "hamiltonian", "local_terms", "start", "parameters", "notes"):
        assert getattr(off, attribute) == getattr(plain, attribute)
    written = Scene(PQ, hamiltonian="p^2/2 - cos(q) + sin(2*q)/5", start={"p": 0, "q": -1})
    on = off.with_effects("asymmetry")
    assert on.local_terms == written.local_terms
    assert on.hamiltonian == written.hamiltonian
    assert on.with_effects() == off != on


def test_an_effect_without_a_hamiltonian_takes_it_away():
    scene = rich().with_effects("damping", "asymmetry")
    assert scene.active == ("asymmetry", "damping")
    assert scene.hamiltonian is None
    assert not scene.is_hamiltonian
    assert scene.base_hamiltonian == rich().hamiltonian
    assert str(scene.field[0]) == "-p/10 - sin(q) - 2*cos(2*q)/5"


def test_effects_bring_variables_parameters_and_start_values():
    scene = rich().with_effects("thermostat", T=2)
    assert scene.variables == ("p", "q", "xi")
    assert str(scene.field) == "(-p*xi - sin(q), p, p**2/10 - 1/5)"
    assert scene.start == (0, -1, 0)
    assert dict(scene.parameters) == {"T": 2, "Q": 10}
    assert scene.with_start(xi=3).start == (0, -1, 3)
    both = rich().with_effects("drive", "thermostat")
    assert [block.name for block in both.blocks] == ["p", "q", "xi", "t"]
    assert [block.offset for block in both.blocks] == [0, 1, 2, 3]


def test_parameters_and_start_values_can_be_replaced_where_they_exist():
    scene = rich()
    assert (
        scene.with_effects("damping", gamma=0.5).field == scene.with_effects("damping").with_parameters(gamma=0.5).field
    )
    assert scene.with_effects("damping", gamma="0.1") == scene.with_effects("damping")
    assert scene.with_start(p=2).start == (2, -1)
    assert scene.with_effects("drive").start == (0, -1, 1)
    assert scene.with_effects("drive").with_start(t=5, q=0).start == (0, 0, 5)
    star = named_scene("henon-heiles")
    assert star.with_start(q1="3/10").start == (*star.start[:2], Fraction(3, 10), star.start[3])
    assert star.with_start(p2=1, q=[2, 3]).start == (star.start[0], 1, 2, 3)
    with pytest.raises(IntegratorError, match=r"start\.q must have as many values as the block has variables, 2"):
        star.with_start(q1=[1, 2])
    with pytest.raises(IntegratorError, match="there is no parameter gamma unless the effect damping is on"):
        scene.with_parameters(gamma=1)
    with pytest.raises(IntegratorError, match=r"there is no parameter k; there are none"):
        scene.with_parameters(k=1)
    with pytest.raises(IntegratorError, match=r"there is no block xi unless the effect .* is on; the blocks are p, q"):
        scene.with_start(xi=1)
    with pytest.raises(IntegratorError, match=r"there is no block t.*; the blocks are p, q$"):
        scene.with_start(t=1)
    with pytest.raises(IntegratorError, match=r"there is no effect 'friction'; the effects are asymmetry, .*"):
        scene.with_effects("friction")
    masses = Scene(LATTICE, terms=[Term(over="each", hamiltonian="p_i^2/m_i")], parameters={"m": [1, 2, 3]})
    assert masses.with_parameters(m=[3, 2, 1]).field != masses.field
    with pytest.raises(
        IntegratorError, match=r"parameters\.m must be a list of 3 numbers, as before, but was a number"
    ):
        masses.with_parameters(m=1)


def test_broken_integrals_are_not_declared_any_more():
    effects = {"drag": Effect(field={"p": "-p"}, breaks=["energy"]), "spring": Effect(hamiltonian="q^2")}
    scene = Scene(PQ, hamiltonian=PENDULUM, invariants={"energy": PENDULUM}, effects=effects)
    assert list(scene.invariants) == ["energy"]
    assert list(scene.with_effects("drag").invariants) == []
    assert scene.with_effects("drag").with_effects() == scene
    assert list(scene.with_effects("spring").invariant_defects()) == ["energy"]


# The time


def test_the_time_becomes_a_variable_and_it_is_said():
    scene = Scene(PQ, hamiltonian="p^2/2 - cos(q - t)", start={"p": 0, "q": 1}, invariants={"a": "p - t"})
    assert scene.variables == ("p", "q", "t")
    assert str(scene.field) == "(sin(t - q), p, 1)".replace("sin(t - q)", str(scene.field[0]))
    assert scene.field[2] == 1
    assert scene.start == (0, 1, 0)
    assert scene.hamiltonian is None
    assert str(scene.base_hamiltonian) == "p**2/2 - cos(q - t)"
    assert scene.notes == ("the field depends on the time t: made autonomous by the variable t with t' = 1",)
    assert rich().notes == ()


def test_a_variable_t_is_the_time():
    scene = Scene({"x": 1, "t": 1}, field={"x": "t*x", "t": "1"})
    assert scene.variables == ("x", "t")
    assert scene.notes == ()
    with pytest.raises(IntegratorError, match=r"variables.t must be the time"):  # a run would set it to the time
        Scene({"z": ["x", "t"]}, field={"x": "t*x", "t": "1"})
    with pytest.raises(IntegratorError, match=r"field.t must be 1, since t is the time, but was 2"):
        Scene({"x": 1, "t": 1}, field={"x": "t*x", "t": "2"})
    with pytest.raises(IntegratorError, match=r"effects.fast.field.t must be 1"):
        Scene({"x": 1, "t": 1}, field={"x": "x", "t": "1"}, effects={"fast": Effect(field={"t": "1"})})


def test_the_time_enters_terms_over_sites_and_poisson_systems():
    sites = Scene(
        LATTICE, terms=[KINETIC, Term(over="each", hamiltonian="m_i*q_i*sin(t)")], parameters={"m": [1, 2, 3]}
    )
    assert str(sites.field) == "(-sin(t), -2*sin(t), -3*sin(t), p1, p2, p3, 1)"
    poisson = Scene({"y": 2}, hamiltonian="y1^2 + y2^2", poisson=[[0, "t"], ["-t", 0]])
    assert str(poisson.field) == "(2*t*y2, -2*t*y1, 1)"


# Poisson systems, first integrals

RIGID = {
    "variables": {"y": 3},
    "hamiltonian": "y1^2/(2*I1) + y2^2/(2*I2) + y3^2/(2*I3)",
    "poisson": [[0, "-y3", "y2"], ["y3", 0, "-y1"], ["-y2", "y1", 0]],
    "parameters": {"I1": 2, "I2": 1, "I3": "2/3"},
}


def test_poisson_systems_and_their_casimirs():
    scene = Scene(**RIGID, invariants={"casimir": "y1^2 + y2^2 + y3^2"})
    assert str(scene.field) == "(y2*y3/2, -y1*y3, y1*y2/2)"
    assert scene.is_hamiltonian
    assert str(scene.hamiltonian) == "y1**2/4 + y2**2/2 + 3*y3**2/4"
    assert scene.invariant_defects() == {}
    wrong = Scene(**RIGID, invariants={"none": "y1^2 + 2*y2^2 + y3^2", "casimir": "y1^2 + y2^2 + y3^2"})
    assert list(wrong.invariant_defects()) == ["none"]
    assert 1e-6 < wrong.invariant_defects()["none"] <= 1


def test_a_poisson_structure_may_leave_out_variables_with_equations_of_their_own():
    scene = Scene({"y": 3}, hamiltonian="y1 + y2^2", poisson=[[0, "y3"], ["-y3", 0]], field={"y3": "-y3"})
    assert str(scene.field) == "(2*y2*y3, -y3, -y3)"
    assert scene.hamiltonian is None


def test_skew_symmetry_is_that_of_functions():
    Scene({"y": 2}, hamiltonian="y1", poisson=[[0, "sin(2*y1)"], ["-2*sin(y1)*cos(y1)", 0]])


def test_integrals_are_checked_whatever_variables_are_called():
    scene = Scene({"y": ["mpf", "lambda"]}, field={"mpf": "lambda/3", "lambda": "-mpf/3"}, invariants={"a": "mpf^2/2"})
    assert list(scene.invariant_defects()) == ["a"]


def test_integrals_are_checked_for_numbers_only():
    scene = Scene(PQ, hamiltonian="k*q", parameters={"k": "k"}, invariants={"p": "p"})
    with pytest.raises(IntegratorError, match="must have numbers for parameters and at most 50000 terms"):
        scene.invariant_defects()


# Values that nobody changes


def test_scenes_are_immutable_and_can_be_copied():
    scene = rich().with_effects("thermostat")
    for mapping in (scene.parameters, scene.invariants, scene.effects, scene.effects["drive"].parameters, scene.places):
        with pytest.raises(TypeError, match="does not support item assignment"):
            mapping["omega"] = 0
    with pytest.raises(AttributeError, match="immutable"):
        scene.name = "other"
    scene.y0[0] = 5
    assert scene.y0[0] == 0
    for other in (pickle.loads(pickle.dumps(scene)), copy.copy(scene), copy.deepcopy(scene)):
        assert other == scene
        assert hash(other) == hash(scene)
        assert other.name == "rich"
        assert other.local_terms == scene.local_terms


def test_what_was_given_can_change_without_changing_the_scene():
    sizes, masses, start = {"p": [2, 1], "q": [2, 1]}, [1, 2], {"p": [[0], [0]], "q": np.array([[1.0], [2.0]])}
    effect_parameters = {"c": 1}
    effect = Effect(terms=[Term(over="each", field={"px_i": "-c*px_i"})], parameters=effect_parameters)
    effects = {"drag": effect}
    terms = [Term(over="each", hamiltonian="px_i^2/(2*m_i)")]
    scene = Scene(sizes, terms=terms, parameters={"m": masses}, start=start, effects=effects)
    again = copy.deepcopy(scene)
    sizes["p"].append(3)
    masses[0], effect_parameters["c"] = 7, 9
    start["q"][0] = 5
    effects.clear()
    assert scene == again
    assert scene.with_effects("drag").field == again.with_effects("drag").field
    assert scene.with_start(p=[1, 1]).start == (1, 1, 1, 2)


def test_effects_are_values():
    effect = EFFECTS["drive"]
    assert pickle.loads(pickle.dumps(effect)) == copy.deepcopy(effect) == effect
    assert hash(pickle.loads(pickle.dumps(effect))) == hash(effect)
    assert effect != EFFECTS["damping"]
    assert repr(EFFECTS["damping"]) == "Effect(field={'p': '-gamma*p'}, parameters={'gamma': '1/10'})"


# The domain


def lattice(formula, q, over="pairs", **arguments):
    return Scene(
        LATTICE, terms=[KINETIC, Term(over=over, hamiltonian=formula)], start={"p": [0, 0, 0], "q": q}, **arguments
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scene(PQ, hamiltonian="p + log(q)", start={"p": 0, "q": 0}), "make q positive, but it was 0"),
        (lambda: Scene(PQ, hamiltonian="p + sqrt(q)", start={"p": 0, "q": 0}), "make q positive, but it was 0"),
        (lambda: Scene(PQ, field={"p": "sqrt(q)", "q": 1}, start={"p": 0, "q": -1}), "make q not negative"),
        (lambda: Scene(PQ, hamiltonian="p/(q - 0.3)", start={"p": 0, "q": 0.3}), "make q - 3/10 other than zero"),
        (lambda: Scene(PQ, hamiltonian="tan(q)*p", start={"p": 0, "q": "pi/2"}), r"make cos\(q\) other than zero"),
        (lambda: Scene(PQ, hamiltonian="asin(q)*p", start={"p": 0, "q": 1}), r"make 1 - q\*\*2 positive"),
        (lambda: Scene(PQ, hamiltonian="log(sin(q)^2 + cos(q)^2 - 1)*p", start={"p": 0, "q": 1}), "positive, but"),
        (lambda: Scene(PQ, hamiltonian="p*q", positive=["q - p"], start={"p": 1, "q": 0}), "make -p \\+ q positive"),
        (lambda: Scene(PQ, hamiltonian="p/k", parameters={"k": 0}), "make k other than zero, but it was 0"),
        (lambda: Scene({"y": 2}, hamiltonian="y1", poisson=[[0, "1/y2"], ["-1/y2", 0]], start={"y": [1, 0]}), "y2"),
        (lambda: lattice("1/(q_i - q_j)", [0.3, 1, "3/10"]), "other than zero, but it was 0 for the sites 1, 3"),
        (lambda: lattice("sqrt(q_i - q_j)", [3, 2, 5], "chain"), "positive, but it was -3 for the sites 2, 3"),
        (lambda: lattice("1/q_i", [3, 0, 5], "each"), "make q_i other than zero, but it was 0 for the sites 2"),
        (lambda: lattice("q_j/m_i", [3, 0, 5], [(1, 2), (3, 3)], parameters={"m": [1, 1, 0]}), "for the sites 3, 3"),
        (lambda: Scene(LATTICE, terms=[Term(over=[(1, 1)], hamiltonian="1/(q_i - q_j)")]), "zero, but .* sites 1, 1"),
        (lambda: Scene(PQ, hamiltonian="p", start={"p": 10**400, "q": 0}).y0, "must be in the range of doubles"),
        (lambda: Scene(PQ, hamiltonian="p").y0, "start must be given for scene, but was not"),
    ],
)  # fmt: skip
def test_starts_outside_the_domain_are_refused(make, message):
    with pytest.raises(IntegratorError, match=message):
        make()


def test_starts_inside_the_domain_are_not():
    Scene(PQ, field={"p": "-sqrt(p^2)*p", "q": "p^(3/2)"}, start={"p": 0, "q": 0})
    Scene(PQ, hamiltonian="(q^2)^(3/2) + p", start={"p": 0, "q": 0})
    Scene(PQ, hamiltonian="p/k", parameters={"k": "k"}, start={"p": 0, "q": 0})
    Scene(PQ, hamiltonian="p/q")
    Scene(PQ, hamiltonian="p + k*log(q)", parameters={"k": 0}, start={"p": 0, "q": -1})
    lattice("1/(q_i - q_j)", [0, 1e-20, 2e-20])
    lattice("1/(q_i - q_j)", [0, 0, 1], [(1, 3)])


def test_guards_of_smooth_formulas_are_none():
    assert guards(sympy.exp(x) * sympy.cos(y) + x**3 * sympy.atan(y) + sympy.sqrt(2)) == []
    assert [guard.relation for guard in guards(x ** sympy.Rational(5, 2), 3)] == [">"]


def test_many_sites_take_no_work_for_each_pair():
    n = 20_000
    force = Term(over="pairs", hamiltonian="1/((qx_i - qx_j)^2 + (qy_i - qy_j)^2)")
    kinetic = Term(over="each", hamiltonian="(px_i^2 + py_i^2)/(2*m_i)")
    q = [[k % 200, k // 200] for k in range(n)]
    arguments = {"terms": [kinetic, force], "parameters": {"m": [1] * n}}
    scene = Scene({"p": [n, 2], "q": [n, 2]}, **arguments, start={"p": [[0, 0]] * n, "q": q})
    assert len(scene.local_terms) == 3
    assert scene.local_terms[-1].sites.size == n * (n - 1) // 2
    q[17_000] = q[3]
    with pytest.raises(IntegratorError, match="for the sites 4, 17001"):
        scene.with_start(q=q)


@pytest.mark.parametrize("formula", ["x*sqrt(k)", "x*log(k)", "x*k^(1/2)"])
def test_parameters_that_make_formulas_complex(formula):
    with pytest.raises(IntegratorError, match=r"parameters must make .* real, but were k = -4"):
        Scene({"x": 1}, field={"x": formula}, parameters={"k": -4}, start={"x": 1})
    assert Scene({"x": 1}, field={"x": formula}, parameters={"k": 4}, start={"x": 1}).field
