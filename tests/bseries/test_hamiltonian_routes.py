"""The three routes to modified Hamiltonians against each other, as formulas."""

from __future__ import annotations

import pytest

import bseries as bs
from bseries.differential_rings import DifferentialRing

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
        ring = DifferentialRing.of([gap.diff(x) for x in symbols], symbols)
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
