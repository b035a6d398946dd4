"""Local terms against flat formulas, and degrees against repeated differentiation."""

from __future__ import annotations

import itertools

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from integrators import Effect, IntegratorError, Scene, Term
from integrators.scenes.model.system import VALUE
from integrators.scenes.particles.parts import Piece, degrees

PQ = {"p": 1, "q": 1}
LATTICE = {"p": 3, "q": 3}
PENDULUM = "p^2/2 - cos(q)"
KINETIC = Term(over="each", hamiltonian="p_i^2/2")
THERMOSTAT = Effect(field={"p": "-xi*p", "xi": "p^2 - 1"}, variables={"xi": 1})
RIGID_BODY = Scene(
    {"y": 3},
    hamiltonian="y1^2/4 + y2^2/2 + 3*y3^2/4",
    poisson=[[0, "-y3", "y2"], ["y3", 0, "-y1"], ["-y2", "y1", 0]],
)
FLAT = {
    "single": Scene({"p": 2, "q": 2}, hamiltonian="p1^2/(2*m) + p2*q1 + 1/(q1 - q2) + 3", parameters={"m": 3}),
    "field": Scene({"z": ["x", "y"]}, field={"x": "k*x*y + 2", "y": "x/(1 + y^2) - x"}, parameters={"k": 2}),
    "zero": Scene({"z": ["x", "y"]}, field={"x": 0, "y": "x"}),
    "poisson": RIGID_BODY,
    "poisson and field": Scene({"y": 3}, hamiltonian="y1 + y2^2", poisson=[[0, "y3"], ["-y3", 0]], field={"y3": "y1"}),
    "reversed blocks": Scene({"q": 2, "p": 2}, hamiltonian="p1*q2^2 + p2/q1"),
    "other names": Scene({"v": 1, "x": 1}, hamiltonian="v^2*x^3"),
    "different shapes": Scene({"p": 4, "q": [2, 2]}, hamiltonian="p1^2*qx1 + p3*qy2 + p4*qx2"),
    "time": Scene(LATTICE, terms=[KINETIC, Term(over="pairs", hamiltonian="t*(q_i - q_j)^3 + t^2*q_i")]),
    "effect": Scene(PQ, hamiltonian=PENDULUM, effects={"thermostat": THERMOSTAT}, active=["thermostat"]),
}
ROLES = {"each": "i", "chain": "ij", "ring": "ij", "pairs": "ij"}
TABLES = {
    "rows of one": [(2,)],
    "of two": [(1, 2), (3, 1), (2, 2)],
    "of three": [(3, 1, 2), (1, 1, 3)],
    "of four": [(4, 1, 2, 3)],
}


def over_sites(over, dimension, kind):
    """A scene of four sites whose formulas use all roles, a parameter of sites, and a difference of two sites."""
    roles = ROLES[over] if isinstance(over, str) else "ijkl"[: len(over[0])]
    first, last = ("x", "xyz"[dimension - 1]) if dimension else ("", "")
    formula = "*".join(f"(q{last}_{role} + m_{role})" for role in roles)
    if "j" in roles:
        formula += f" + k/(7 + (q{last}_i - q{last}_j)^2)"
    term = Term(over=over, hamiltonian=f"({formula})*p{first}_i")
    if kind == "field":
        term = Term(over=over, field={f"p{last}_{roles[-1]}": formula, f"q{first}_i": f"m_i*q{last}_i"})
    kinetic = " + ".join(f"p{axis}_i^2/2" for axis in "xyz"[:dimension] or ("",))
    size = [4, dimension] if dimension else 4
    terms = [Term(over="each", hamiltonian=kinetic), term]
    return Scene({"p": size, "q": size}, terms=terms, parameters={"m": [1, "1/2", 3, -2], "k": "3/2"})


SITES = {
    f"{kind}, {name}, {dimension}": over_sites(over, dimension, kind)
    for kind in ("hamiltonian", "field")
    for name, over in (*zip(ROLES, ROLES, strict=True), *TABLES.items())
    for dimension in (0, 2)
} | {"three dimensions": over_sites("pairs", 3, "hamiltonian")}
SCENES = FLAT | SITES


def rational_point(scene):
    numbers = [sympy.Rational(17 * k * k % 31 + 2, k + 3) for k in range(scene.dimension)]
    return dict(zip(scene.symbols, numbers, strict=True))


def added_up(scene, terms, point):
    """f at a point: the outputs of all rows of these terms."""
    y, total = list(point.values()), [sympy.Integer(0)] * scene.dimension
    for term in terms:
        for row in term.sites.rows():
            values = {}
            for k, (plus, minus) in enumerate(term.arguments):
                values[sympy.Symbol(f"x{k}")] = y[plus.at(row)] - (y[minus.at(row)] if minus else 0)
            for k, data in enumerate(term.data):
                values[sympy.Symbol(f"d{k}")] = data.values[row[data.role]]
            for derivative, place, sign in term.outputs:
                formula = term.formula if derivative == VALUE else term.formula.diff(sympy.Symbol(f"x{derivative}"))
                total[place.at(row)] += sign * formula.xreplace(values)
    return total


@pytest.mark.few(12)
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_local_terms_are_the_flat_field(scene):
    point = rational_point(scene)
    flat = [formula.xreplace(point) for formula in scene.field]
    found = added_up(scene, scene.local_terms, point)
    assert [sympy.expand(a - b) for a, b in zip(found, flat, strict=True)] == [0] * scene.dimension
    assert len(scene.local_terms) == 1 or found != added_up(scene, scene.local_terms[1:], point)


@pytest.mark.parametrize(
    "name", [name for name in SCENES if "hamiltonian" in name or name in ("single", "reversed blocks")]
)
def test_the_flat_field_is_that_of_the_hamiltonian(name):
    scene = SCENES[name]
    blocks = {block.name: block.variables for block in scene.blocks}
    for p, q in zip(blocks["p"], blocks["q"], strict=True):
        assert scene.field[scene.places[p]] == -scene.hamiltonian.diff(sympy.Symbol(q))
        assert scene.field[scene.places[q]] == scene.hamiltonian.diff(sympy.Symbol(p))


def test_differences_and_sums_are_seen_in_local_terms():
    more = Term(over="each", hamiltonian="2*(q_i^2 + q_i^4 + p_i^4)")
    scene = Scene(LATTICE, terms=[KINETIC, Term(over="ring", hamiltonian="exp(q_i - q_j)"), more])
    formulas = sorted((str(term.formula), len(term.arguments), term.sites.kind) for term in scene.local_terms)
    assert formulas == [("2*x0**4 + 2*x0**2", 1, "each"), ("2*x0**4 + x0**2/2", 1, "each"), ("exp(x0)", 1, "ring")]


def test_parts_of_the_field_are_kept_apart():
    scene = Scene(PQ, terms=[Term(field={"p": "-q", "q": "p"}, part="linear"), Term(field={"p": "q^3"}, part="cubic")])
    assert scene.parts == ("cubic", "linear")
    assert [term.part for term in scene.local_terms] == ["cubic", "linear", "linear"]
    assert str(scene.field) == "(q**3 - q, p)"


def test_parameters_that_are_symbols_stay_in_formulas_only():
    scene = Scene(PQ, hamiltonian="k*q", parameters={"k": "k"})
    assert str(scene.field) == "(-k, 0)"
    assert str(scene.local_terms[0].formula) == "k*x0"
    with pytest.raises(IntegratorError, match=r"parameters\.k must be a number in compiled code, but was a symbol"):
        _ = scene.numeric_terms
    with pytest.raises(IntegratorError, match=r"parameters\.x0 must have another name to stay a symbol"):
        _ = Scene(PQ, hamiltonian="x0*q", parameters={"x0": "x0"}).local_terms
    assert str(scene.with_parameters(k=2).local_terms[0].formula) == "2*x0"


# How often a field can be differentiated

LIMIT = 7
BLOCKS = {"a": ["a1", "a2"], "b": ["b1"], "c": ["c1", "c2"]}
NAMES = [name for block in BLOCKS.values() for name in block]
monomials = st.lists(st.sampled_from(NAMES), max_size=4).map(lambda factors: "*".join(["1", *factors]))
functions = st.builds(lambda f, v: f"{f}({v})", st.sampled_from(["sin", "exp"]), st.sampled_from(NAMES))
formulas = st.lists(monomials | monomials | functions, min_size=1, max_size=2).map(" + ".join)


def differentiated(entries, variables):
    """The number of derivatives along variables that leave something; None if it is LIMIT or more."""
    for order in range(LIMIT):
        entries = {entry.diff(variable).expand() for entry in entries for variable in variables} - {0}
        if not entries:
            return order
    return None


def moved(scene, block):
    """The variables of a block that its field moves at some site; nothing is differentiated along others."""
    width = len(block.components) or block.dimension
    entries = [
        (at % width, scene.symbols[block.offset + at], scene.field[block.offset + at]) for at in range(block.dimension)
    ]
    components = {component for component, _, entry in entries if entry != 0}
    return tuple(symbol for component, symbol, _ in entries if component in components)


@settings(max_examples=25)
@given(st.lists(formulas, min_size=len(NAMES), max_size=len(NAMES)))
def test_degrees_are_those_of_repeated_differentiation(entries):
    scene = Scene(BLOCKS, field=dict(zip(NAMES, entries, strict=True)))
    fields = {block.name: set(scene.field[block.offset : block.end]) - {0} for block in scene.blocks}
    moving = [moved(scene, block) for block in scene.blocks]
    groups = [*moving, tuple(itertools.chain(*moving))]
    found = degrees(scene, [Piece(frozenset([name])) for name in BLOCKS])
    assert found == [[differentiated(fields[name], group) for group in groups] for name in BLOCKS]


def degree_at(formula, variables, point):
    """The degree of a formula along a line through a point: differences of higher orders vanish; LIMIT at most."""
    steps = {variable: k + 2 for k, variable in enumerate(point) if variable in variables}
    lines = [{v: value + s * steps.get(v, 0) for v, value in point.items()} for s in range(LIMIT + 3)]
    values = [formula.xreplace(line).evalf(60) for line in lines]
    for order in range(-1, LIMIT):
        if all(abs(value) < 1e-30 for value in values):
            return max(order, 0)
        values = [b - a for a, b in itertools.pairwise(values)]
    return LIMIT


@pytest.mark.parametrize(
    "name", ["hamiltonian, pairs, 2", "field, ring, 0", "hamiltonian, of three, 0", "time", "effect"]
)
def test_degrees_of_terms_over_sites(name):
    scene = SCENES[name]
    point = rational_point(scene)
    moving = [moved(scene, block) for block in scene.blocks]
    groups = [*moving, tuple(itertools.chain(*moving))]
    found = degrees(scene, [Piece(frozenset([block.name])) for block in scene.blocks])
    expected = [
        [max(degree_at(entry, group, point) for entry in scene.field[block.offset : block.end]) for group in groups]
        for block in scene.blocks
    ]
    assert [[LIMIT if degree is None else degree for degree in row] for row in found] == expected


def test_the_oracles_tell_degrees_apart():
    x, y = sympy.symbols("x y")
    assert differentiated({x**2 * y}, (x, y)) == 3
    assert differentiated({x**2 * y}, (x,)) == 2
    assert differentiated({sympy.sin(x)}, (x,)) is None
    found = [
        degree_at(formula, (x,), {x: sympy.Rational(1, 2), y: sympy.Integer(3)}) for formula in (x**2 * y, y, 1 / x)
    ]
    assert found == [2, 0, LIMIT]


def test_degrees_know_separable_and_quadratic_systems():
    blocks = [Piece(frozenset("p")), Piece(frozenset("q"))]
    assert degrees(Scene(PQ, hamiltonian=PENDULUM), blocks) == [[0, None, None], [1, 0, 1]]
    assert degrees(Scene(PQ, hamiltonian="p^2*q^3"), blocks) == [[2, 2, 4], [1, 3, 4]]
    assert degrees(RIGID_BODY, [Piece()]) == [[2, 2]]
    parts = [Term(field={"p": "-q", "q": "p"}, part="linear"), Term(field={"p": "q^3"}, part="cubic")]
    assert degrees(Scene(PQ, terms=parts), [Piece(part="linear"), Piece(part="cubic")]) == [[1, 1, 1], [3, 0, 3]]


@pytest.mark.parametrize("names", [["x0", "w"], ["w", "x0"], ["d0", "x0"], ["x1", "x0"]])
def test_variables_may_be_called_as_local_ones_are(names):
    first, second = names
    scene = Scene({"z": names}, field={first: f"sin({first})*{second}", second: f"{first}^2 + exp({second})"})
    point = dict(zip(scene.symbols, (sympy.Rational(1, 2), sympy.Rational(3, 4)), strict=True))
    found = [0, 0]
    for term in scene.local_terms:
        values = {sympy.Symbol(f"x{k}"): point[scene.symbols[a.plus.offset]] for k, a in enumerate(term.arguments)}
        found[term.outputs[0].place.offset] += term.formula.xreplace(values)
    assert [sympy.simplify(x - f.xreplace(point)) for x, f in zip(found, scene.field, strict=True)] == [0, 0]


# Momenta and positions.

PAIRS = [("p", "q"), ("v", "x"), ("P", "Q"), ("p", "theta"), ("I", "phi"), ("a", "theta"), ("omega", "theta")]


@pytest.mark.parametrize(("momenta", "positions"), PAIRS)
def test_names_tell_momenta_from_positions_in_any_order(momenta, positions):
    energy = f"{momenta}^2/2 - cos({positions})"
    for blocks in ({momenta: 1, positions: 1}, {positions: 1, momenta: 1}):
        scene = Scene(blocks, hamiltonian=energy)
        field = dict(zip(scene.variables, map(str, scene.field), strict=True))
        assert field == {momenta: f"-sin({positions})", positions: momenta}
        assert scene.canonical_pair is not None
        assert [block.name for block in scene.canonical_pair] == [momenta, positions]


@pytest.mark.parametrize(
    "blocks",
    [
        {"x": 1, "y": 1},
        {"u": 1, "v": 1},
        {"x": 1, "q": 1},
        {"v": 1, "p": 1},
        {"v": 1, "x": 1, "r": 1},
        {"p": 1, "q": 2},
        {"p1": 1, "p2": 1, "q1": 1, "q2": 1},
    ],
)
def test_a_hamiltonian_of_blocks_whose_names_tell_nothing_is_refused(blocks):
    with pytest.raises(IntegratorError, match=r"told apart by their names: p and q, which may hold any variables"):
        Scene(blocks, hamiltonian=" + ".join(f"{name}^2" for name in blocks if blocks[name] == 1))
    formulas = {name: "0" for block, size in blocks.items() for name in ([block] if size == 1 else ("q1", "q2"))}
    assert Scene(blocks, field=formulas).canonical_pair is None


def test_other_blocks_beside_p_and_q_do_not_matter():
    scene = Scene({"x": 1, "q": 1, "p": 1}, hamiltonian="p^2/2 + q^4/4", field={"x": "-x"})
    assert str(scene.field) == "(-x, p, -q**3)"
