"""The three routes to modified Hamiltonians against each other, as formulas."""

from __future__ import annotations

from fractions import Fraction

import pytest

import bseries as bs
from bseries.fields.differential_rings import DifferentialRing

GENERAL = bs.Scene(
    {"p": 1, "q": 1},
    hamiltonian="a*p^2/2 + b*p^3 + c*p^4 + d*q^2 + e*q^3 + f*q^4",
    parameters={name: name for name in "abcdef"},
    name="general",
)
"""T(p) + U(q) with polynomials that have no symmetry, and symbols for their coefficients."""
SCENES = {"general": GENERAL, **{name: bs.scene(name) for name in ("pendulum", "henon-heiles", "kepler")}}
CASES = [
    ("stormer-verlet-kdk", "general", 5),
    ("stormer-verlet-dkd", "general", 5),
    ("symplectic-euler-p", "general", 4),
    ("symplectic-euler-q", "general", 4),
    ("stormer-verlet-kdk", "pendulum", 9),
    ("symplectic-euler-p", "pendulum", 6),
    ("lie-trotter", "pendulum", 5),
    ("stormer-verlet-kdk", "henon-heiles", 5),
    ("symplectic-euler-q", "henon-heiles", 4),
    ("stormer-verlet-kdk", "kepler", 3),
    ("symplectic-euler-p", "kepler", 3),
]


def differ(one, other):
    """The first power of h at which two modified Hamiltonians differ by more than a constant; None if there is none."""
    symbols = one.scene.symbols
    for k in range(one.order):
        gap = one.symbolic(k) - other.symbolic(k)
        ring = DifferentialRing([gap.diff(x) for x in symbols], symbols)
        if not all(map(ring.is_zero, ring.elements)):
            return k
    return None


@pytest.mark.parametrize(("name", "scene", "order"), CASES)
def test_three_routes_lead_to_one_hamiltonian(name, scene, order):
    method = bs.method(name)
    trees, brackets, generated = (
        bs.modified_hamiltonian(method, SCENES[scene], order, route=route)
        for route in ("trees", "brackets", "generating-function")
    )
    assert (trees.route, brackets.route, generated.route) == ("trees", "brackets", "generating-function")
    assert differ(trees, brackets) is None
    assert differ(trees, generated) is None


@pytest.mark.parametrize("name", ["implicit-midpoint", "gauss2", "lobatto-iiia-iiib3"])
@pytest.mark.parametrize(("scene", "order"), [("pendulum", 5), ("henon-heiles", 3)])
def test_methods_that_are_no_splittings(name, scene, order):
    """Implicit methods have no brackets in general; two routes are left."""
    found = (
        bs.modified_hamiltonian(bs.method(name), SCENES[scene], order, route=route)
        for route in ("trees", "generating-function")
    )
    assert differ(*found) is None


def test_integration_leads_there_too():
    kinds = ("trees", "integration")
    verlet = bs.method("stormer-verlet")
    assert differ(*(bs.modified_hamiltonian(verlet, SCENES["pendulum"], 5, route=kind) for kind in kinds)) is None


def test_another_method_has_another_hamiltonian():
    """The comparison sees where: the two Störmer–Verlet methods differ from h² on, by kinetic terms only."""
    kdk, dkd = (
        bs.modified_hamiltonian(bs.method(f"stormer-verlet-{order}"), SCENES["pendulum"], 5) for order in ("kdk", "dkd")
    )
    assert differ(kdk, dkd) == 2


@pytest.mark.parametrize("route", ["trees", "brackets", "generating-function"])
def test_the_order_of_blocks_changes_no_part_of_a_splitting(route):
    """a is the drift and b the kick, also where positions are the first block, or where b comes first."""
    scenes = [bs.Scene(blocks, hamiltonian="p^2/2 - cos(q)") for blocks in ({"p": 1, "q": 1}, {"q": 1, "p": 1})]
    kick_first = bs.Splitting([("b", "1/2"), ("a", 1), ("b", "1/2")], name="kick first")
    for method, twin in ((bs.method("lie-trotter"), "symplectic-euler-q"), (kick_first, "stormer-verlet")):
        found = [str(bs.modified_hamiltonian(method, scene, 3, route=route).symbolic(2)) for scene in scenes]
        expected = str(bs.modified_hamiltonian(bs.method(twin), scenes[0], 3).symbolic(2))
        assert found == [expected, expected]


LIFTED = {
    "pendulum": bs.parse_hamiltonian("p^2/2 - cos(q) + 3", start="p=1/2; q=1/3"),
    "no equilibrium at 0": bs.parse_hamiltonian("(p + 1)^2/2 + (q - 2)^4/4 + 7", start="p=1/2; q=1/3"),
    "no equilibrium": bs.parse_hamiltonian("p^2/2 + exp(q) - 1/3", start="p=1/2; q=1/3"),
    "sites": bs.Scene(
        {"p": 3, "q": 3},
        terms=[
            bs.Term(over="each", hamiltonian="p_i^2/2 + 2"),
            bs.Term(over="chain", hamiltonian="(q_i - q_j)^4 - 1/7"),
        ],
        start={"p": [0, 1, "1/2"], "q": [1, 0, "1/3"]},
    ),
}
ROUTES = ("trees", "brackets", "generating-function", "integration")


def modified(name, route, method="stormer-verlet", order=5):
    return bs.modified_hamiltonian(bs.method(method), LIFTED[name], order, route=route)


def constant_gap(one, other):
    """The largest difference of two formulas, terms with powers of h and all constants included, at two points."""
    points = [(0.3, -0.7, 0.2, 0.9, 0.4, -0.1), (-1.1, 0.6, 0.5, -0.2, 1.3, 0.8)]
    gaps = []
    for point in points:
        values = dict(zip(one.scene.symbols, point, strict=False))
        gaps += [abs((one.symbolic(k) - other.symbolic(k)).evalf(30, subs=values)) for k in range(one.order)]
    return max(gaps)


@pytest.mark.slow
@pytest.mark.parametrize("name", LIFTED)
@pytest.mark.parametrize("method", ["stormer-verlet", "symplectic-euler-q"])
def test_constants_are_the_same_in_all_routes_and_for_a_step_of_length_zero_it_is_the_hamiltonian(name, method):
    found = {route: modified(name, route, method, 4) for route in ROUTES}
    H, y = LIFTED[name], LIFTED[name].y0
    energy = float(H.hamiltonian.subs(dict(zip(H.symbols, y.tolist(), strict=True))))
    for route, one in found.items():
        assert constant_gap(one, found["trees"]) < 1e-25, route
        assert one(y, 0.0) == pytest.approx(energy, rel=1e-14), route
        assert float(one.precise(H.start, 0)) == pytest.approx(energy, rel=1e-14), route
        assert one.compiled(y, 0.0) == pytest.approx(energy, rel=1e-14), route
        assert one.terms(y)[0] == pytest.approx(energy, rel=1e-14), route


def test_towers_keep_the_constant_too():
    for name, scene in LIFTED.items():
        H = modified(name, "trees")
        formulas, towers = H._energy.formulas(), H._energy
        states = scene.y0[None]
        assert towers.values(states, 0.1) == pytest.approx(formulas.values(states, 0.1), rel=1e-13)


@pytest.mark.parametrize("name", ["pendulum", *(pytest.param(x, marks=pytest.mark.slow) for x in [*LIFTED][1:])])
@pytest.mark.slow
def test_compiled_towers_keep_it(name):
    """Each is a function of numba, which keeps none of its machine code."""
    energy, y0 = modified(name, "trees")._energy, LIFTED[name].y0
    assert energy.compiled(y0, 0.1) == pytest.approx(energy.formulas().values(y0[None], 0.1)[0], rel=1e-13)


@pytest.mark.parametrize("name", ["pendulum", "no equilibrium", "sites"])
def test_shadow_energies_have_the_same_constants(name):
    scene, h, middle = LIFTED[name], 0.01, 20
    run = bs.integrate("stormer-verlet", scene, h=h, steps=2 * middle)
    report = bs.shadow_energy(run, scene, order=8, keep=True)
    for row in report.rows:
        values = report.values[row.order]
        lost = (len(run.t) - len(values)) // 2
        expected = modified(name, "trees", order=row.order - 1)(run.y[:, middle], h)
        assert values[middle - lost] == pytest.approx(expected, abs=1e3 * h**row.order + 1e-13), row.order


def test_poisson_systems_keep_the_constant_and_agree_with_brackets():
    lifted = bs.Scene({"p": 1, "q": 1}, hamiltonian="p - log(p) + q - 2*log(q) + 5", poisson=[[0, "p*q"], ["-p*q", 0]])
    one, other = (
        bs.modified_hamiltonian(bs.method("lie-trotter"), lifted, 3, route=route)
        for route in ("brackets", "integration")
    )
    points = [[1.3, 0.7], [0.4, 2.1]]
    for y in points:
        assert one.terms(y) == pytest.approx(other.terms(y), rel=1e-12, abs=1e-14)
    assert one([1.0, 2.0], 0.0) == pytest.approx(float(lifted.hamiltonian.subs({"p": 1, "q": 2})), rel=1e-15)


def test_what_only_integration_finds_keeps_the_constant_of_the_hamiltonian():
    lifted = LIFTED["pendulum"]
    H = bs.modified_hamiltonian(bs.method("rk4"), lifted, 5)
    plain = bs.modified_hamiltonian(bs.method("rk4"), bs.parse_hamiltonian("p^2/2 - cos(q)"), 5)
    assert H.route == "integration"
    assert [H.symbolic(k) - plain.symbolic(k) for k in range(5)] == [3, 0, 0, 0, 0]


@pytest.mark.parametrize(
    ("text", "method"),
    [
        ("p^2/2 + q^2/2 + 3", "stormer-verlet"),
        ("p^2/2 + p*q/3 + q^2 - 1/7", "implicit-midpoint"),
        ("exp(1)*p^2/2 + q^2 + 1", "symplectic-euler-p"),
    ],
)
def test_closed_forms_keep_the_constant_too(text, method):
    scene, y, h = bs.parse_hamiltonian(text), [0.3, 0.4], 0.01
    closed = bs.hamiltonians.closed_hamiltonian(bs.method(method), scene)
    H = bs.modified_hamiltonian(bs.method(method), scene, 7)
    assert closed(y, h) == pytest.approx(H(y, h), rel=1e-14)
    values = dict(zip(scene.symbols, y, strict=True))
    assert float(closed.expression(Fraction(1, 100)).evalf(30, subs=values).as_real_imag()[0]) == pytest.approx(
        H(y, h), rel=1e-12
    )


@pytest.mark.parametrize("text", ["p^2/2", "q^4/4", "3"])
@pytest.mark.parametrize("method", ["lie-trotter", "strang", "stormer-verlet", "symplectic-euler-p"])
def test_a_part_may_have_no_energy(text, method):
    """What moves one block only is separable: every splitting follows it exactly."""
    scene, chosen = bs.parse_hamiltonian(f"{text} + 0*p*q", blocks="p=p; q=q", start="p=1; q=1"), bs.method(method)
    for route in ("trees", "brackets"):
        H = bs.modified_hamiltonian(chosen, scene, 4, route=route)
        assert [H.symbolic(k) for k in range(4)] == [scene.hamiltonian, 0, 0, 0]
    assert bs.energy_drift(chosen, scene, h=0.1).breaks is None


# Where it ends.


@pytest.mark.parametrize(
    ("method", "scene", "order", "last", "tree"),
    [
        ("rk4", "pendulum", 5, 4, "[τ,[[τ]]]"),
        ("rk4", "pendulum", 3, 4, "[τ,[[τ]]]"),
        ("explicit-euler", "kepler", 1, 0, "[τ]"),
        ("simplified-takahashi-imada", "henon-heiles", 2, 3, "p[q[p[q[p]]]]"),
        ("implicit-midpoint", "lotka-volterra", 2, 1, None),
    ],
)
def test_where_a_modified_hamiltonian_ends_is_said_even_if_all_terms_asked_for_are_there(
    method, scene, order, last, tree
):
    H = bs.modified_hamiltonian(bs.method(method), bs.scene(scene), order)
    assert (H.verdict.exists_through, H.verdict.broken_tree) == (last, tree)
    with pytest.raises(bs.SeriesError, match=f"the term with h\\^{last + 1} breaks it"):
        bs.modified_hamiltonian(bs.method(method), bs.scene(scene), last + 2)
    sentence = f"H~ exists through h^{last} only: on {scene} the term with h^{last + 1} has no Hamiltonian"
    note = " ".join(str(H).rpartition("\n\n")[2].split())
    assert sentence in note
    assert (tree or ".") in note
    data = H.to_dict()
    assert (data["exists_through"], data["verdict"]["holds"]) == (last, False)
    assert rf"exists through $h^{{{last}}}$ only" in H.to_latex()


@pytest.mark.parametrize(
    ("method", "scene", "order"),
    [
        ("gauss2", "kepler", 2),
        ("stormer-verlet", "double-pendulum", 2),
        ("blanes-moan4", "henon-heiles", 2),
        ("takahashi-imada", "henon-heiles", 2),
        ("simplified-takahashi-imada", "pendulum", 5),
        ("symplectic-euler-p", "lotka-volterra", 2),
    ],
)
def test_nothing_is_said_where_no_end_is_known(method, scene, order):
    H = bs.modified_hamiltonian(bs.method(method), bs.scene(scene), order)
    assert (H.verdict.exists_through, H.verdict.limit(), H.to_dict()["exists_through"]) == (None, "", None)
    assert "exists" not in str(H) + H.to_latex()


def test_a_splitting_that_is_not_symplectic_without_separable_hamiltonian_is_found_out():
    scene = bs.parse_hamiltonian("p^2*cos(q) + q^2")
    assert bs.modified_hamiltonian(bs.method("strang"), scene, 2).verdict.exists_through == 1
