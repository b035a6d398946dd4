"""The defect test: one step of a method against the flow of its truncated modified equation, in 50 digits.

The modified equation is that of the method if their gap is the first omitted term: (step − flow) / h^(k+1) → f_{k+1}.
Steps are computed from the method's definition and the scene's formulas, without trees.
"""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy

import bseries as bs
from bseries.fields.evaluation import PreciseSeries
from bseries.fields.scene_trees import flat_fields
from integrators.reference.plain_steps import plain_step

DIGITS = 50
FLOW = bs.method("gauss4")  # far more precise than the gap for such small steps


def start_of(scene):
    """The start values as numbers of mpmath."""
    with mpmath.workdps(DIGITS + 20):
        return [mpmath.mpf(value.evalf(DIGITS + 20)) for value in scene.start]


def compiled(formulas, scene):
    """Formulas as a function of the state that computes with mpmath."""
    function = sympy.lambdify(scene.symbols, formulas, "mpmath", cse=True)
    return lambda y: np.array(function(*y))


def shear_flow(formulas, scene):
    """The exact flow y + t f(y) of a part that does not depend on the variables it changes; None for others."""
    moved = {symbol for symbol, formula in zip(scene.symbols, formulas, strict=True) if formula}
    if any(formula.free_symbols & moved for formula in formulas):
        return None
    field = compiled(formulas, scene)
    return lambda y, t: y + field(y) * t


def step_of(method, f, h):
    """One step of a method on the scene itself."""
    scene = f.scene
    if len(method.names) == 1:
        return plain_step(method, compiled(scene.field, scene), start_of(scene), h, digits=DIGITS)
    pieces = dict(zip(method.names, flat_fields(scene, f.trees.pieces), strict=True))
    fields = {name: compiled(piece, scene) for name, piece in pieces.items()}
    flows = {name: shear_flow(piece, scene) for name, piece in pieces.items()}
    return plain_step(method, fields, start_of(scene), h, flows=flows, digits=DIGITS)


def flow_of(f, h):
    """The flow of a truncated field for the time h."""
    precise = PreciseSeries(f, DIGITS)
    return plain_step(FLOW, lambda y: precise(y, h), start_of(f.scene), h, digits=DIGITS)


def first_omitted(longer, order):
    """The power of h and the value of the first term beyond an order that is not zero, and the scene's time scale."""
    terms = np.array(PreciseSeries(longer, 40).terms(start_of(longer.scene)), float)
    sizes = np.linalg.norm(terms, axis=1)
    k = next(k for k in range(order, longer.order) if sizes[k] > 1e-25 * sizes[0])
    return k, terms[k], (sizes[0] / sizes[k]) ** (1 / k)


def deviations(gap, longer, order, sizes=("1e-4", "5e-5")):
    """How far gap / h^(k+1) is from the first omitted term, relative to it, for small h in the scene's time scale."""
    k, term, scale = first_omitted(longer, order)
    found = []
    for size in sizes:
        h = Fraction(f"{scale:.3e}") * Fraction(size)
        with mpmath.workdps(DIGITS):
            ratio = np.array([float(x / mpmath.mpf(h.numerator) ** (k + 1) * h.denominator ** (k + 1)) for x in gap(h)])
        found.append(np.linalg.norm(ratio - term) / np.linalg.norm(term))
    return found


def defects(method, short, longer):
    return deviations(lambda h: step_of(method, longer, h) - flow_of(short, h), longer, short.order)


# scene, options, method, order, parts
CASES = [
    ("riccati", {}, "rk4", 5),
    ("riccati", {}, "trapezoidal", 5),
    ("linear", {"matrix": [["-1/2", 3], [-1, "1/3"]]}, "heun2", 4),
    ("linear", {}, "implicit-midpoint", 5),
    ("nonlinear-oscillator", {}, "explicit-midpoint", 5),
    ("nonlinear-oscillator", {}, "gauss2", 5),
    ("lotka-volterra", {}, "rk4", 5),
    ("lotka-volterra", {}, "symplectic-euler-p", 4),
    ("harmonic-oscillator", {}, "stormer-verlet", 5),
    ("harmonic-oscillator", {"omega": 2}, "rk4", 5),
    ("pendulum", {}, "explicit-euler", 5),
    ("pendulum", {"effects": ["asymmetry", "damping", "drive"]}, "rk4", 5),
    ("pendulum", {"effects": ["asymmetry", "damping", "drive"]}, "stormer-verlet", 5),
    ("double-pendulum", {}, "explicit-midpoint", 3),
    ("double-pendulum", {}, "symplectic-euler-q", 3),
    ("henon-heiles", {}, "rk4", 5),
    ("henon-heiles", {}, "takahashi-imada", 5),
    ("kepler", {}, "rk38", 5),
    ("kepler", {}, "stormer-verlet", 5),
    ("kepler", {"effects": ["drag", "oblateness"]}, "implicit-midpoint", 4),
    ("perturbed-kepler", {}, "explicit-midpoint", 4),
    ("perturbed-kepler", {}, "blanes-moan4", 5),
    ("central-field", {}, "rk4", 5),
    ("central-field", {"effects": ["perturbation"]}, "symplectic-euler-p", 3),
    ("n-body", {}, "explicit-midpoint", 4),
    ("n-body", {"effects": ["softening"]}, "stormer-verlet-dkd", 4),
    ("outer-solar-system", {"effects": ["jupiter", "saturn"]}, "explicit-midpoint", 3),
    ("outer-solar-system", {"effects": ["jupiter"]}, "stormer-verlet", 3),
    ("rigid-body", {}, "rk4", 6),
    ("rigid-body", {}, "implicit-midpoint", 5),
    ("toda", {}, "explicit-midpoint", 4),
    ("toda", {}, "mclachlan4", 5),
    ("fermi-pasta-ulam", {"m": 1}, "rk4", 5),
    ("fermi-pasta-ulam", {"m": 1}, "strang", 4),
    ("lennard-jones", {"particles": 3}, "explicit-midpoint", 3),
    ("lennard-jones", {"particles": 3, "effects": ["confinement"]}, "stormer-verlet", 3),
    ("field-nijhoff", {}, "heun3", 5),
    ("field-nijhoff", {}, "symplectic-euler-p", 5),
    ("abc-flow", {}, "explicit-midpoint", 4),
    ("abc-flow", {}, "lie-trotter", 3),
    ("brusselator", {}, "rk4", 5),
    ("brusselator", {}, "symplectic-euler-q", 4),
    ("charged-particle", {}, "boris", 3),
    ("charged-particle", {}, "rk4", 5),
    ("magnetic-dipole", {}, "explicit-midpoint", 4),
    ("magnetic-dipole", {"effects": ["attraction"]}, "boris", 3),
    ("van-der-pol", {}, "explicit-midpoint", 4),
    ("van-der-pol", {}, "radau-iia2", 4),
    ("lorenz", {}, "kutta3", 5),
    ("lorenz", {}, "ros3p", 4),
]
STARTS = {"double-pendulum": {"p": ["1/2", "-1/3"]}}  # omitted terms vanish at rest, but not nearby
KICKS = {"a": "q", "b": "p"}
PARTS = {
    "brusselator": {"p": "u", "q": "v"},
    "perturbed-kepler": KICKS,
    "toda": KICKS,
    "fermi-pasta-ulam": {"a": "linear", "b": "nonlinear"},
}


def fields_of(name, options, method, *orders):
    """The method and its modified fields to some orders."""
    scene = bs.scene(name, **options).with_start(**STARTS.get(name, {}))
    chosen = bs.methods.lie_trotter(["a", "b", "c"]) if method == "lie-trotter" else bs.method(method)
    parts = PARTS.get(name) if len(chosen.names) > 1 else None
    return chosen, *(bs.modified_field(chosen, scene, order, parts=parts) for order in orders)


def test_every_scene_is_tested_with_two_methods():
    tested = [scene for scene, *_ in CASES]
    assert all(tested.count(entry.name) >= 2 for entry in bs.scene_catalogue())


@pytest.mark.few(5)
@pytest.mark.parametrize(("name", "options", "method", "order"), CASES)
def test_defects(name, options, method, order):
    chosen, short, longer = fields_of(name, options, method, order, order + 2)
    far, near = defects(chosen, short, longer)
    assert far < 1e-2
    assert near < 0.6 * far


@pytest.mark.parametrize(
    ("name", "method", "tree", "order"),
    [("lotka-volterra", "rk4", "[[[τ]]]", 5), ("kepler", "implicit-midpoint", "[τ,τ]", 3)],
)
def test_a_wrong_coefficient_is_seen(name, method, tree, order):
    """In the truncated equation the gap is of lower order than promised; in the omitted term the ratio is not 1."""
    chosen, scene = bs.method(method), bs.scene(name)
    right = bs.modified_equation(chosen, order + 2)
    omitted = next(tree for tree, _ in right.nonzero() if tree.order > order)
    changed = bs.Tree(tree), omitted
    wrong = bs.BSeries.from_rule(lambda t: right[t] + Fraction(1, 50) * (t in changed), order + 2, empty=0)
    short, longer, wrong_short, wrong_longer = (
        bs.modified_field(b, scene, n) for b in (right, wrong) for n in (order, order + 2)
    )
    assert max(defects(chosen, short, longer)) < 1e-2
    assert min(defects(chosen, short, wrong_longer)) > 5e-2
    far, near = defects(chosen, wrong_short, longer)
    assert near > 1.9 * far > 1e2


MODIFYING = [
    ("rigid-body", "implicit-midpoint", 4),
    ("kepler", "implicit-midpoint", 4),
    ("pendulum", "explicit-midpoint", 3),
    ("pendulum", "symplectic-euler-p", 3),
    ("lotka-volterra", "rk4", 5),
    ("henon-heiles", "stormer-verlet", 4),
]


@pytest.mark.parametrize(("name", "method", "order"), MODIFYING)
def test_modifying_fields(name, method, order):
    """The method on the modifying field, cut at order N, misses the exact flow by what was cut off."""
    scene, chosen = bs.scene(name), bs.method(method)
    exact = compiled(scene.field, scene)

    def gap(h):
        solution = plain_step(bs.method("gauss6"), exact, start_of(scene), h, digits=DIGITS)
        return solution - bs.fields.modifying_steps(chosen, scene, order, start_of(scene), h, 1, digits=DIGITS)[:, 1]

    far, near = deviations(gap, bs.modifying_field(chosen, scene, order + 2), order)
    assert far < 1e-2
    assert near < 0.6 * far
