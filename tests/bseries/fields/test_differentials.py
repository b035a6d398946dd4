"""Series written out on fields: against the lecture, the definition, residues, power series without trees, colours."""

import json
import random
from fractions import Fraction
from functools import partial
from itertools import product
from math import prod
from pathlib import Path

import field_oracles
import formula_power_series as series
import pytest
import sympy

import bseries as bs
from bseries import BSeries, SeriesError
from bseries.fields.differential_rings import DifferentialRing
from bseries.fields.elementary_differentials import DerivativeTowers, SymbolicSeries
from integrators.exact.expressions import parse_expression
from trees import Tree, TreeTable

LECTURE = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())
p, q, x, y, z, gamma = sympy.symbols("p q x y z gamma")
sin, cos, sqrt = sympy.sin, sympy.cos, sympy.sqrt

PENDULUM = (-sin(q), p)
LOTKA_VOLTERRA = (p * (2 - q), q * (p - 1))
OSCILLATOR = (-q / (p**2 + q**2), p / (p**2 + q**2))


def equal(first, second):
    return sympy.simplify(first - second) == 0


def check_equal(found, expected):
    for terms, references in zip(found, expected, strict=True):
        assert all(equal(a, b) for a, b in zip(terms, references, strict=True)), (terms, references)


def symbolic_terms(b, fields, variables, *, simplify=True, **limits):
    """The formulas of a series on a field by order."""
    fields = [list(map(sympy.sympify, field)) for field in fields]
    found = SymbolicSeries(b, fields, variables, **limits)
    return [found.term(n, simplify=simplify) for n in range(1, b.order + 1)]


def elementary_differentials(trees, fields, variables):
    """The formulas of F(τ) for each tree."""
    fields = [list(map(sympy.sympify, field)) for field in fields]
    ring = DifferentialRing([formula for field in fields for formula in field], variables)
    towers = DerivativeTowers(ring, [[ring.element(formula) for formula in field] for field in fields])
    return [tuple(map(ring.to_expression, towers.sum({Tree(tree): Fraction(1)}))) for tree in trees]


def symbolic_differential(tree, fields, variables):
    return elementary_differentials([tree], fields, variables)[0]


def in_blocks(field):
    """A field in two variables as the two colours p, q."""
    return (field[0], 0), (0, field[1])


# The lecture.


@pytest.mark.parametrize("name", ["explicit-euler", "implicit-midpoint", "trapezoidal", "rk4"])
def test_riccati(name):
    expected = [Fraction(c) for c in LECTURE["example1_and_fig1"]["coefficients"][name.replace("-", "_")]]
    found = symbolic_terms(bs.modified_equation(bs.method(name), len(expected)), [(y**2,)], (y,))
    assert found == [(c * y ** (k + 2),) for k, c in enumerate(expected)]


@pytest.mark.parametrize("name", ["explicit-euler", "symplectic-euler-p", "symplectic-euler-q"])
def test_lotka_volterra(name):
    entries, variant = LECTURE["example2_lotka_volterra_and_exercise2"], name.replace("-", "_")
    entry = entries[variant if variant in entries else f"{variant}_implicit"]
    fields = [LOTKA_VOLTERRA] if name == "explicit-euler" else in_blocks(LOTKA_VOLTERRA)
    found = symbolic_terms(bs.modified_equation(bs.method(name), 3), fields, (p, q))
    check_equal(zip(*found, strict=True), [[parse_expression(t, names=["p", "q"]) for t in entry[v]] for v in "pq"])
    assert [str(formula) for formula in found[1]] == [entry["factored_h1"][v] for v in "pq"]


def test_pendulum():
    s, c = sympy.symbols("s c")
    expected = LECTURE["example5_midpoint_pendulum"]["vector_field_h^k"]
    found = symbolic_terms(bs.modified_equation(bs.method("implicit-midpoint"), 5), [PENDULUM], (p, q))
    references = [
        [parse_expression(expected[k][v], names=["p", "s", "c"]).subs({s: sin(q), c: cos(q)}) for v in "pq"]
        for k in "024"
    ]
    check_equal(found[::2], references)
    assert found[1] == found[3] == (0, 0)
    assert str(found[2][0]) == "-(p**2 - 2*cos(q))*sin(q)/24"


ABC = sympy.symbols("A B C")


def abc_flow():
    a, b, c = ABC
    return a * sin(z) + c * cos(y), b * sin(x) + a * cos(z), c * sin(y) + b * cos(x)


def from_reference(text):
    names = [f"{f}{v}" for f in "sc" for v in "xyz"]
    values = {sympy.Symbol(n): {"s": sin, "c": cos}[n[0]](sympy.Symbol(n[1])) for n in names}
    return parse_expression(text, names=[*names, "A", "B", "C"]).subs(values)


def divergence(field):
    return sum(formula.diff(v) for formula, v in zip(field, (x, y, z), strict=True))


@pytest.mark.parametrize(("name", "scheme"), [("Lie", bs.methods.lie_trotter), ("Strang", bs.methods.strang)])
def test_splittings_of_the_abc_flow_keep_volume(name, scheme):
    entry = LECTURE["exercise6_volume_preserving"][name]
    f = abc_flow()
    fields = [tuple(f[i] if i == j else 0 for j in range(3)) for i in range(3)]
    found = symbolic_terms(bs.modified_equation(scheme(["a", "b", "c"]), 3), fields, (x, y, z))
    for k in (2, 3):
        if f"f_{k}" in entry:
            check_equal([found[k - 1]], [map(from_reference, entry[f"f_{k}"])])
        assert equal(divergence(found[k - 1]), 0)


def test_the_explicit_euler_method_does_not_keep_volume():
    expected = LECTURE["exercise6_volume_preserving"]["counter_example_explicit_euler_divergence"]
    found = symbolic_terms(bs.modified_equation(bs.method("explicit-euler"), 3), [abc_flow()], (x, y, z))
    check_equal([map(divergence, found)], [map(from_reference, expected)])


# The definition, by SymPy's derivatives.


def by_definition(tree, field, variables):
    vectors = [by_definition(child, field, variables) for child in tree.children]
    components = []
    for formula in field:
        total = 0
        for along in product(range(len(variables)), repeat=len(vectors)):
            factors = [vector[i] for vector, i in zip(vectors, along, strict=True)]
            if 0 not in factors:
                total += formula.diff(*(variables[i] for i in along)) * sympy.Mul(*factors) if along else formula
        components.append(total)
    return components


FIELDS = {
    "oscillator": OSCILLATOR,
    "drag": (-sin(q) - p * sqrt(1 + p**2) / 5, p),
    "rational": (1 / (1 + p * q), p / q - q**2 / 3),
    "exponential": (sympy.exp(-p / 2) - q, sympy.log(1 + q) * sympy.exp(p)),
    "tangent and powers": (sympy.tan(q) * p**gamma, sympy.atan(p * q)),
    "unknown": (-sympy.Function("U")(q).diff(q), p),
}
POINT = {p: sympy.Rational(3, 7), q: sympy.Rational(5, 9), gamma: sympy.Rational(4, 3)}


def at_point(formula):
    known = sympy.Add(formula).subs(sympy.Function("U"), sympy.Lambda(x, x**4 * sin(x))).doit()
    return sympy.N(known.subs(POINT), 30)


@pytest.mark.parametrize("name", FIELDS)
def test_elementary_differentials_are_those_of_the_definition(name):
    table, values = TreeTable(4), []
    found = elementary_differentials(table, [FIELDS[name]], (p, q))
    for tree, formulas in zip(table, found, strict=True):
        expected = [at_point(formula) for formula in by_definition(tree, FIELDS[name], (p, q))]
        values.append([at_point(formula) for formula in formulas])
        for a, b in zip(values[-1], expected, strict=True):
            assert abs(a - b) <= 1e-25 * (1 + abs(b))
    nonzero = [tuple(value) for value in values if any(value)]
    assert len(set(nonzero)) == len(nonzero)  # no two trees are mixed up unnoticed


@pytest.mark.parametrize("colors", [1, 2])
def test_elementary_differentials_modulo_a_prime(colors):
    source = field_oracles.seeded("differentials", colors)
    fields = [[field_oracles.polynomial(source, 3, 4) for _ in range(4)] for _ in range(colors)]
    variables = sympy.symbols("y1:5")
    formulas = [
        [sum(c * sympy.prod(v**k for v, k in zip(variables, e, strict=True)) for e, c in f.items()) for f in field]
        for field in fields
    ]
    at, known = field_oracles.point(source), {}
    ring = DifferentialRing([formula for field in formulas for formula in field], variables)
    towers = DerivativeTowers(ring, [[ring.element(formula) for formula in field] for field in formulas])
    for tree in TreeTable(4 if colors == 2 else 5, colors):
        expected = field_oracles.differential(tree, fields, at, known)
        for element, reference in zip(towers.sum({tree: Fraction(1)}), expected, strict=True):
            value = sum(
                field_oracles.residue(c) * prod(pow(at[k].value, e, field_oracles.P) for k, e in monomial)
                for monomial, c in element.terms.items()
            )
            assert value % field_oracles.P == reference.value


# Without trees: h f_h = log of the pull-back by the method's map.

START = {p: Fraction(3, 7), q: Fraction(5, 9)}


def field_at(field, state):
    return [series.evaluate(formula, dict(zip((p, q), state, strict=True))) for formula in field]


def explicit_euler(field, state):
    return [series.plus(y, series.times_h(f)) for y, f in zip(state, field_at(field, state), strict=True)]


def explicit_midpoint(field, state):
    half = [series.scaled(0.5, series.times_h(f)) for f in field_at(field, state)]
    middle = [series.plus(y, k) for y, k in zip(state, half, strict=True)]
    return [series.plus(y, series.times_h(f)) for y, f in zip(state, field_at(field, middle), strict=True)]


def symplectic_euler_for_pendulum(field, state):
    momentum = series.plus(state[0], series.times_h(field_at(field, state)[0]))
    return [momentum, series.plus(state[1], series.times_h(momentum))]


def columns(terms):
    """The terms at START, for each component."""
    return [[series.evaluate(term[i], {v: series.constant(x) for v, x in START.items()})[0] for term in terms]
            for i in range(2)]  # fmt: skip


@pytest.mark.parametrize("field", [PENDULUM, LOTKA_VOLTERRA, OSCILLATOR, FIELDS["drag"]], ids=str)
@pytest.mark.parametrize(
    ("name", "step"), [("explicit-euler", explicit_euler), ("explicit-midpoint", explicit_midpoint)]
)
def test_the_modified_equation_is_the_logarithm_of_the_map(name, step, field):
    expected = series.logarithm_of_map(partial(step, field), START.values())
    found = columns(symbolic_terms(bs.modified_equation(bs.method(name), series.ORDER), [field], (p, q)))
    assert all(map(series.close, found, expected))
    other = columns(symbolic_terms(bs.modified_equation(bs.method("heun2"), series.ORDER), [field], (p, q)))
    assert not all(map(series.close, other, expected))


def test_the_modified_equation_of_symplectic_euler_is_the_logarithm_of_the_map():
    expected = series.logarithm_of_map(partial(symplectic_euler_for_pendulum, PENDULUM), START.values())
    b = bs.modified_equation(bs.method("symplectic-euler-p"), series.ORDER)
    assert all(map(series.close, columns(symbolic_terms(b, in_blocks(PENDULUM), (p, q))), expected))


def test_the_modifying_integrator_of_the_oscillator():
    """The exact flow turns by h/r²: so must the explicit midpoint rule on the field that starts with these terms."""
    terms = symbolic_terms(bs.modifying_integrator(bs.method("explicit-midpoint"), 8), [OSCILLATOR], (p, q))
    assert terms[7] == (31 * p / (640 * (p**2 + q**2) ** 8), 31 * q / (640 * (p**2 + q**2) ** 8))
    h = sympy.Symbol("h")
    field = [sum(h**n * term[i] for n, term in enumerate(terms[: series.ORDER])) for i in range(2)]
    length = series.times_h(series.constant(1))

    def step(field):
        at_h = [lambda state, f=f: series.evaluate(f, {p: state[0], q: state[1], h: length}) for f in field]
        start = [series.constant(1), series.constant(0)]
        half = [series.scaled(0.5, series.times_h(f(start))) for f in at_h]
        middle = [series.plus(y, k) for y, k in zip(start, half, strict=True)]
        return [series.plus(y, series.times_h(f(middle))) for y, f in zip(start, at_h, strict=True)]

    exact = reversed(series.sine_and_cosine(length))
    assert all(map(series.close, step(field), exact))
    assert not all(map(series.close, step(OSCILLATOR), series.sine_and_cosine(length)[::-1]))


# Laws.


def test_the_sum_over_colourings_is_the_series_without_colours():
    b = bs.modified_equation(bs.method("implicit-midpoint"), 4)
    colored = BSeries.from_rule(lambda tree: b[Tree.from_levels(tree.levels)], 4, empty=0, colors=2)
    first, second = (p * q, sin(p)), (-(q**2) / 2, p / q)
    whole = [tuple(f + g for f, g in zip(first, second, strict=True))]
    check_equal(symbolic_terms(colored, [first, second], (p, q)), symbolic_terms(b, whole, (p, q)))
    swapped = symbolic_terms(colored, [first, first], (p, q))
    assert not equal(swapped[2][0], symbolic_terms(b, whole, (p, q))[2][0])


def test_terms_are_sums_of_differentials():
    source = random.Random(4)
    b = BSeries.from_rule(lambda tree: Fraction(source.randint(-9, 9), source.randint(1, 9)), 5, empty=0)
    differentials = dict(zip(b, elementary_differentials(b.table, [OSCILLATOR], (p, q)), strict=True))
    for n, found in enumerate(symbolic_terms(b, [OSCILLATOR], (p, q)), 1):
        expected = [sum(b[t] / t.symmetry * differentials[t][i] for t in b if t.order == n) for i in range(2)]
        check_equal([found], [expected])


def test_series_with_parameters():
    symbol = bs.RungeKutta([[gamma]], [1])
    b = bs.modified_equation(symbol, 3)
    found = symbolic_terms(b, [LOTKA_VOLTERRA], (p, q))
    assert str(found[1][1]) == "q*(2*gamma - 1)*(p**2 - p*q + 1)/2"
    for value, name in ((0, "explicit-euler"), (Fraction(1, 2), "implicit-midpoint"), (1, "implicit-euler")):
        expected = symbolic_terms(bs.modified_equation(bs.method(name), 3), [LOTKA_VOLTERRA], (p, q))
        check_equal([[f.subs(gamma, value) for f in term] for term in found], expected)


def test_series_with_algebraic_and_rational_coefficients():
    b = BSeries.from_rule(lambda tree: sqrt(3) / (gamma + tree.order), 2, empty=0)
    first, second = symbolic_terms(b, [(p * q, q**2)], (p, q))
    assert first == (sqrt(3) * p * q / (gamma + 1), sqrt(3) * q**2 / (gamma + 1))
    assert second == (2 * sqrt(3) * p * q**2 / (gamma + 2), 2 * sqrt(3) * q**3 / (gamma + 2))


def test_floats_and_decimals_are_written_as_floats():
    b = bs.modified_equation(bs.method("explicit-euler"), 3)
    exact = symbolic_terms(b, [LOTKA_VOLTERRA], (p, q))[2][0]
    rounded = symbolic_terms(b.to_float(), [LOTKA_VOLTERRA], (p, q))[2][0]
    assert rounded.has(sympy.Float)
    assert not exact.has(sympy.Float)
    assert abs((rounded - exact).subs({p: 2, q: 3})) < 1e-13
    assert str(symbolic_terms(b, [(0.3 * q, p)], (p, q))[1][0]) == "-0.15*p"
    decimal = symbolic_terms(bs.modified_equation(bs.method("tsit5"), 6), [PENDULUM], (p, q))
    assert decimal[1:5] == [(0, 0)] * 4
    assert decimal[0][1].subs(p, 1) == pytest.approx(1, abs=1e-14)
    assert decimal[5][0].has(sympy.Float)


def test_terms_are_computed_when_asked_for():
    written = SymbolicSeries(bs.modified_equation(bs.method("rk4"), 8), [(-(x**3),)], (x,))
    assert written.term(5) == symbolic_terms(bs.modified_equation(bs.method("rk4"), 5), [(-(x**3),)], (x,))[4]
    assert [element.size for element in written.elements(5)] == [1]
    assert written.term(5, simplify=False) == written.term(5)


def test_one_tree():
    assert symbolic_differential("[τ^2]", [PENDULUM], (p, q)) == (p**2 * sin(q), 0)
    assert symbolic_differential("[[τ],τ]", [PENDULUM], (p, q)) == (-p * sin(q) ** 2, 0)
    assert symbolic_differential("q[p,p]", in_blocks((q, p**2)), (p, q)) == (0, 2 * q**2)
    assert symbolic_differential("[τ]", [(2, Fraction(1, 2) * p)], (p, q)) == (0, 1)


# Refusals.


def euler():
    return bs.modified_equation("explicit-euler", 3)


@pytest.mark.parametrize(
    ("fields", "variables", "message"),
    [
        ([(p, sympy.oo)], (p, q), "formula must be finite, but holds oo"),
        ([(p, 1 / (cos(q) ** 2 + sin(q) ** 2 - 1))], (p, q), "formula must not divide by zero"),
        ([((p + q + 1) ** 500, p)], (p, q), "fields must stay simpler: a formula would have more than"),
    ],
)
def test_fields_that_do_not_fit_are_refused(fields, variables, message):
    with pytest.raises(SeriesError, match=f"^{message.replace('(', '[(]').replace(')', '[)]')}"):
        symbolic_terms(euler(), fields, variables)


def test_what_is_too_large_is_refused():
    cubic = [((p + 2 * q + 1) ** 3, (p - q) ** 3)]
    with pytest.raises(SeriesError, match="a formula would have more than 25 monomials"):
        symbolic_terms(euler(), cubic, (p, q), limit=25)
    with pytest.raises(SeriesError, match="n must be at most 3, the order of the series, but was 4"):
        SymbolicSeries(euler(), cubic, (p, q)).term(4)
