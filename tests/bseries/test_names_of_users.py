"""No name of a user's reaches generated code: every result is that of the same scene with other names."""

from __future__ import annotations

import builtins
import keyword
import math
from pathlib import Path
from typing import NamedTuple

import mpmath
import numpy as np
import pytest
import sympy

import bseries as bs
from bseries_base.formulas import formula_text
from integrators.exact.expressions import NOT_FINITE, parse_expression
from integrators.scenes.checks import defects
from integrators.scenes.model.formulas import KNOWN
from integrators.scenes.text import loads_scene

ROOT = Path(bs.__file__).parents[1]
NEUTRAL = "u", "w", "mu"
"""A momentum, a position and a parameter."""
NAMES = (
    *("e", "E", "I", "N", "S", "h", "mpf", "x0", "d0", "y0", "_", "gamma", "zeta", "lambda"),
    *("K", "ﬁ", "µ"),
    *("s", "mpmath", "argument_1", "None", "euler", "phi", "j", "re", "beta", "Symbol", "numpy", "self", "infinite"),
    *("fi", "μ"),
)  # fmt: skip
"""Names of functions and constants of mpmath, NumPy, SymPy and Python, and of generated code."""
REFUSED = ("t", "exp", "pi", "max", "ｅｘｐ", "𝐩𝐢", "inf", "ｔ")
CODE = tuple(dict.fromkeys((*keyword.kwlist, *keyword.softkwlist, *dir(builtins), *dir(mpmath), *dir(math))))
ENERGY = "{0}^2/2 + {1}^4/4 + {2}*exp(1)*sin({1})/3 + exp({1}/3 + 1) - pi*cos({1})*exp(-2)"
START = "{0}=1/5; {1}=3/10"


def scene(names, *, symbolic=False):
    p, q, parameter = names
    return bs.parse_hamiltonian(
        ENERGY.format(*names),
        {"p": [p], "q": [q]},
        {parameter: parameter if symbolic else "7/10"},
        START.format(*names),
    )


def damped(names):
    """Not Hamiltonian, with a first integral of the base system, an effect and a function with branches."""
    p, q, parameter = names
    return bs.Scene(
        {p: 1, q: 1, f"{q}{p}": 1},
        field={p: f"-{q}*exp(1)", q: f"{p}/exp(-1)", f"{q}{p}": f"sqrt(1 + {q}^2) - {parameter}*{q}{p}"},
        parameters={parameter: "1/3"},
        invariants={"radius": f"{p}^2 + {q}^2"},
        start={p: [1], q: ["1/2"], f"{q}{p}": [1]},
        effects={"friction": bs.Effect(field={p: f"-abs({p})*log(2 + {q}^2)"}, breaks=["radius"])},
    )


def lotka(names):
    p, q, parameter = names
    return bs.Scene(
        {p: 1, q: 1}, hamiltonian=f"{p} - log({p}) + {q} - {parameter}*log({q}) + exp(1)",
        poisson=[[0, f"{p}*{q}"], [f"-{p}*{q}", 0]], parameters={parameter: 2}, positive=[p, q],
        start={p: [2], q: ["1/2"]},
    )  # fmt: skip


def particles(names):
    p, _, m = names
    force = f"-{m}_i*{m}_j*{m}0{p}/sqrt((qx_i - qx_j)^2 + (qy_i - qy_j)^2)"
    return bs.Scene(
        {"p": [3, 2], "q": [3, 2]}, parameters={m: [1, 2, "1/2"], f"{m}0{p}": "exp(1)"},
        terms=[
            bs.Term(hamiltonian=f"(px_i^2 + py_i^2)/(2*{m}_i)", over="each"),
            bs.Term(hamiltonian=force, over="pairs"),
        ],
        start={"p": [[0, 1], [1, 0], [0, -1]], "q": [[0, 0], [1, 2], [-2, 1]]},
    )  # fmt: skip


def runs(names):
    """Steps, observers, adaptive steps, ensembles, reference solutions and files."""
    energy, system, loop, bodies = scene(names), damped(names), lotka(names), particles(names)
    run = bs.integrate("implicit-midpoint", energy, h=0.1, steps=20, observe=["energy"])
    yield from (run.y, run.observed["energy"])
    verlet = bs.integrate("stormer-verlet", energy, h=0.05, steps=40)
    yield from bs.shadow_energy(verlet, order=4, keep=True).values.values()
    yield bs.integrate("gauss2", system, h=0.1, steps=10, observe="invariants").observed["radius"]
    yield bs.integrate("rk4", system.with_effects("friction"), h=0.1, steps=10).y
    yield bs.integrate("rk4", loop, h=0.1, steps=10, observe=["energy"]).observed["energy"]
    yield bs.integrate("stormer-verlet", bodies, h=0.01, steps=5, observe=["energy"]).y
    yield bs.ensemble("rk4", energy, h=0.1, steps=5, y0=[[0.1, 0.2], [0.3, 0.4]], observe="energy").mean["energy"]
    for made in (energy, system, loop, bodies):
        yield bs.reference_solution(made, [0.5])
        assert loads_scene(made.to_toml()) == made
        yield str(defects(made))


def fields(names):
    """Modified fields and first integrals, as formulas, compiled and in many digits."""
    for made, method in ((scene(names), "rk4"), (damped(names), "heun2"), (lotka(names), "gauss2")):
        f = bs.modified_field(method, made, 4)
        yield f(made.y0, 0.1)
        yield np.array(f.precise(list(map(str, made.y0)), "1/10", 30), float)
        for k in range(4):
            yield from f.symbolic(k)
        yield from texts(row for term in f.to_dict()["terms"] for row in term["field"])
    for k in range(3):
        yield from bs.modified_field("rk4", scene(names, symbolic=True), 3).symbolic(k)
    yield bs.modified_field("stormer-verlet", particles(names), 3)(particles(names).y0, 0.01)
    yield bs.fields.divergence(bs.modified_field("heun2", damped(names), 3), 2)
    yield from texts(
        term["invariant"]
        for term in bs.modified_invariant(bs.modified_field("gauss2", scene(names), 4)).to_dict()["terms"]
    )
    yield bs.fields.reach(bs.modified_field("rk4", scene(names), 5), scene(names).y0, 0.1).sizes


def hamiltonians(names):
    """Modified Hamiltonians by trees, brackets, generating functions and in closed form."""
    energy = scene(names)
    for method in ("stormer-verlet", "gauss2"):
        H = bs.modified_hamiltonian(method, energy, 5)
        yield H(energy.y0, 0.1)
        yield float(H.precise(list(map(str, energy.y0)), "1/10", 30))
        yield from (H.symbolic(k) for k in range(5))
        yield from texts(term["hamiltonian"] for term in H.to_dict()["terms"])
    yield bs.modified_hamiltonian("gauss2", lotka(names), 3)([2, 0.5], 0.1)
    yield bs.modified_hamiltonian("stormer-verlet", particles(names), 3)(particles(names).y0, 0.01)
    symbolic = bs.modified_hamiltonian("stormer-verlet", scene(names, symbolic=True), 3)
    yield from (symbolic.symbolic(k) for k in range(3))
    S = bs.hamiltonians.generating_function("gauss2", energy, 3)
    yield from (*S.terms, *S.hamiltonian())
    yield from texts(term["generating_function"] for term in S.to_dict()["terms"])
    yield bs.hamiltonians.hamiltonian_verdict("gauss2", energy).exists_through or 0


def drifts(names):
    """Means of the energy's rate along orbits and along trajectories, and gains per period of an angle."""
    report = bs.energy_drift("rk4", scene(names), h=0.1)
    yield from (report.slope(), report.drift[1])
    p, q, parameter = names
    rotor = bs.Scene(
        {"p": [p], "q": [q]}, hamiltonian=f"{p}^2/2 - {parameter}*cos({q}) + exp(1)*sin(2*{q})/20",
        parameters={parameter: 1}, start={"p": ["5/2"], "q": [0]},
    )  # fmt: skip
    yield bs.energy_drift("simplified-takahashi-imada", rotor, y0=[2.5, 0], h=0.2).slope()
    yield bs.energy_drift("simplified-takahashi-imada", rotor).turns[0].gain
    steep = bs.Scene(
        {"p": [p], "q": [q]}, hamiltonian=f"{p}^2/2 - exp(cos({q}) + sin(2*{q})/exp(1))", start={"p": [3], "q": [0]}
    )
    yield float(bs.energy_drift("simplified-takahashi-imada", steep, h=0.1).turns[0].gain)


def closed(names):
    """Closed forms, coordinates and normal forms."""
    p, q, parameter = names
    pair = {"p": [p], "q": [q]}
    for method, energy in (
        ("implicit-midpoint", f"({p}^2 + 4*{q}^2)/2"),
        ("symplectic-euler-p", f"exp(1)*{p}^2/2 + {q}^2"),
    ):
        made = bs.Scene(pair, hamiltonian=energy)
        form = bs.hamiltonians.closed_hamiltonian(method, made)
        yield from (form([0.4, 0.5], 0.1), form.expression(sympy.Rational(1, 10)))
        text = form.to_dict()["hamiltonian"]
        step = "h" if text else "k"
        yield Text(text or formula_text(form.expression(sympy.Symbol(step))), step)
    rotor = bs.Scene(
        {"p": [p], "q": [q]}, hamiltonian=f"exp(1)*{p}^2/2 + {parameter}*cos({q})", parameters={parameter: "1/10"}
    )
    form = bs.hamiltonians.lindstedt_poincare(rotor, 3, parameter=parameter)
    yield from (form.to_normal([0.5, 0.3], 0.1), form.from_normal([0.5, 0.3], 0.1), *form.terms)
    change = bs.hamiltonians.point_transformation({"p": ["pp"], "q": ["qq"]}, pair, {"qq": f"exp({q})*exp(1)"})
    yield from (change.to_old([0.3, 0.4]), change.to_new([0.1, 4.0], [0.3, 0.4]), *change.formulas.values())


def advice(names):
    """Predictions, costs and influences of effects."""
    energy = scene(names)
    found = bs.predict_run("stormer-verlet", energy, h=0.1, steps=200, timed=False)
    yield from (found.energy.value, found.solution.value)
    yield bs.predict_run("gauss2", lotka(names), h=0.1, steps=50, timed=False).energy.value
    rows = bs.effect_influence("rk4", damped(names), h=0.1, span=1.0).to_dict()["rows"]
    yield from (row["alone"]["solution"] for row in rows)


def quick(names):
    """A number of each printer."""
    energy = scene(names)
    yield bs.integrate("rk4", energy, h=0.1, steps=3).y
    yield float(bs.modified_hamiltonian("gauss2", energy, 3).precise(["1/5", "3/10"], "1/10", 30))
    yield str(defects(damped(names)))
    yield float(bs.predict_run("gauss2", lotka(names), h=0.1, steps=3, timed=False).energy.value)


RESULTS = (runs, fields, hamiltonians, drifts, closed, advice)


class Text(NamedTuple):
    """A formula as text, and the name of the step in it."""

    formula: str
    step: str


def texts(formulas):
    """Formulas as texts of documents."""
    return [Text(text, "") for text in formulas]


def number(value, names):
    """The value of a result at a fixed point of its names."""
    p, q, parameter = names
    symbols = {p: 0.3, q: -0.2, q + p: 0.4, parameter: 0.7}
    if isinstance(value, Text):
        symbols[value.step] = 0.1
        value = parse_expression(value.formula, names=filter(None, symbols))
    if isinstance(value, sympy.Basic):
        assert {symbol.name for symbol in value.free_symbols} <= set(symbols)
        return np.array(value.subs({sympy.Symbol(name): x for name, x in symbols.items()}).evalf(20), float)
    return value if isinstance(value, str) else np.array(value, float)


@pytest.fixture(scope="module")
def expected():
    """The results with neutral names."""
    return {results: [number(value, NEUTRAL) for value in results(NEUTRAL)] for results in (*RESULTS, quick)}


def compare(results, names, expected):
    for k, (value, wanted) in enumerate(zip(results(names), expected[results], strict=True)):
        found = number(value, names)
        if isinstance(wanted, str):
            assert found == wanted, k
        else:
            np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12, err_msg=str(k))


FAST = {
    "fields": ("E", "I", "lambda"),
    "drifts": ("e", "µ", "mpf"),
    "closed": ("h", "N", "_"),
    "runs": ("ﬁ", "x0", "K"),
}
TRIPLES = [tuple(NAMES[(k + j) % len(NAMES)] for j in range(3)) for k in range(len(NAMES))]
"""Each name as momentum, as position and as parameter."""


def cases(name):
    """A name as momentum, as position and as parameter."""
    return [(name, *NEUTRAL[1:]), (NEUTRAL[0], name, NEUTRAL[2]), (*NEUTRAL[:2], name)]


@pytest.mark.parametrize("results", RESULTS, ids=lambda results: results.__name__)
def test_results_do_not_depend_on_names(results, expected):
    names = FAST.get(results.__name__, NAMES)[:3]
    compare(results, names, expected)


@pytest.mark.slow
@pytest.mark.parametrize("names", TRIPLES, ids="-".join)
@pytest.mark.parametrize("results", RESULTS, ids=lambda results: results.__name__)
def test_results_do_not_depend_on_any_name(results, names, expected):
    if names[2] in ("x0", "d0") and results in (fields, hamiltonians):
        with pytest.raises(bs.IntegratorError, match="must have another name to stay a symbol"):
            compare(results, names, expected)
    else:
        compare(results, names, expected)


@pytest.mark.few(12)
@pytest.mark.parametrize("name", CODE)
def test_names_with_a_meaning_in_code_have_none_in_scenes(name, expected):
    for names in cases(name):
        if name in KNOWN | set(NOT_FINITE):
            with pytest.raises(bs.IntegratorError, match=r"must not be called|not name a function|block t of its own"):
                scene(names)
        else:
            compare(quick, names, expected)


@pytest.mark.parametrize("name", REFUSED)
def test_names_with_a_meaning_in_formulas_are_refused(name):
    for names in cases(name):
        with pytest.raises(bs.IntegratorError, match=r"must not be called|not name a function|block t of its own"):
            scene(names)


@pytest.mark.parametrize("pair", [("ﬁ", "fi"), ("µ", "μ"), ("\u212a", "K"), ("x₁", "x1")])
def test_names_that_look_alike_are_refused_with_both_named(pair):
    first, second = pair
    assert first != second
    for names in ((first, second, "mu"), (first, "w", second), ("u", second, first)):
        with pytest.raises(bs.IntegratorError, match=f"({first} .* and {second}|{second} .* and {first}) "):
            scene(names)
    with pytest.raises(bs.IntegratorError, match=f"({first} .* and {second}|{second} .* and {first}) "):
        bs.RungeKutta([[first]], [second], parameters=[first, second])
    effects = {"more": bs.Effect(hamiltonian=f"{second}*w", parameters={second: 1})}
    with pytest.raises(bs.IntegratorError, match=f"({first} .* and {second}|{second} .* and {first}) "):
        bs.Scene({"p": [first], "q": ["w"]}, hamiltonian=f"{first}^2/2 + w^2/2", effects=effects)


def test_one_function_alone_turns_formulas_into_code():
    """Its caller cannot forget to replace the names of symbols."""
    sources = (path for room in ("integrators", "bseries") for path in (ROOT / room).rglob("*.py"))
    found = [path.name for path in sources if "lambdify(" in path.read_text(encoding="utf-8")]
    assert found == ["functions.py"]
