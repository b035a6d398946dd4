"""Modified Hamiltonians against the lecture, against the field whose Hamiltonian they are, and along trajectories."""

import json
import pickle
from fractions import Fraction
from math import pi
from pathlib import Path

import mpmath
import numba
import numpy as np
import pytest
import sympy

import bseries as bs
from bseries.exact.domains import make_values
from bseries.fields.differential_rings import DifferentialRing
from bseries.hamiltonians.from_trees import EnergyScene, EnergySeries, energy_series, energy_trees
from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian
from integrators.reference.plain_steps import plain_steps
from integrators.scenes.particles.parts import pieces_of

LECTURE = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())
P, Q, H_ = sympy.symbols("p q h")
PENDULUM = bs.scene("pendulum")
ASYMMETRIC = bs.scene("pendulum", effects=["asymmetry"])
QUARTIC = bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 + q^4/4", start={"p": [1], "q": ["1/2"]})
MIXED = bs.Scene({"p": 2, "q": 2}, hamiltonian="(p1^2 + p2^2)/2 + q1*p2^2 + p1*q2^2 + q1^3*q2")
FORMULAS = bs.Scene({"p": 1, "q": 1}, field={"p": "-sin(q)", "q": "p"})
IN_PARTS = bs.Scene(
    {"p": 2, "q": 2},
    terms=[
        bs.Term(hamiltonian="p1^2/2 + p2^2/2 + q1^2*p2", part="A"),
        bs.Term(hamiltonian="q1^4*q2 + q2^3 + q1*p1", part="B"),
    ],
)


def found(method, scene, order, **options):
    return bs.modified_hamiltonian(bs.method(method), scene, order, **options)


def evaluated(H, route):
    """The same function, evaluated in another way."""
    energy = EnergySeries(H._energy.scene, H._energy.series.trees, H._energy.series.series)
    energy.__dict__["evaluator"] = energy if route == "towers" else energy.formulas()
    return ModifiedHamiltonian(H.method, H.scene, H.order, H.parts, H.route, energy)


def agree(first, second, symbols):
    """Whether two formulas differ by a constant: a ring with all their generators recognises zero."""
    slopes = [(first - second).diff(x) for x in symbols]
    ring = DifferentialRing(slopes, symbols)
    return all(map(ring.is_zero, ring.elements))


def lecture_formula(text, scene=PENDULUM, **values):
    """A formula of the lecture, with U1, U2, … the derivatives of the scene's potential."""
    potential = scene.hamiltonian.subs(P, 0)
    slopes = {f"U{k}": potential.diff(Q, k) for k in range(1, 6)}
    shorthands = {"c": sympy.cos(Q), "s": sympy.sin(Q), "p": P, "q": Q}
    return sympy.sympify(text, locals={**slopes, **shorthands, **values})


# The lecture's formulas.


@pytest.mark.parametrize("power", ["0", "2", "4"])
def test_example_5_the_midpoint_rule_on_the_pendulum(power):
    H = found("implicit-midpoint", PENDULUM, 5)
    for form in LECTURE["example5_midpoint_pendulum"]["H_h^k"][power].values():
        assert agree(H.symbolic(int(power)), lecture_formula(form), (P, Q))
    assert H.symbolic(1) == H.symbolic(3) == 0


@pytest.mark.parametrize("scene", [PENDULUM, ASYMMETRIC, QUARTIC], ids=["pendulum", "asymmetric", "quartic"])
@pytest.mark.parametrize(("method", "variant"), [("stormer-verlet", "UTU"), ("stormer-verlet-dkd", "TUT")])
def test_example_6_both_orders_of_stormer_verlet(method, variant, scene):
    H = found(method, scene, 5)
    for power, formula in LECTURE["example6_stoermer_verlet"]["one_dof_T=p^2/2"][variant].items():
        assert agree(H.symbolic(int(power[-1])), lecture_formula(formula, scene), (P, Q))


@pytest.mark.parametrize("alpha", ["1/12", "1/24", "alpha"])
def test_15_and_16_takahashi_imada_with_any_alpha(alpha):
    method = bs.methods.TakahashiImada(alpha, parameters=["alpha"] * (alpha == "alpha"))
    H = bs.modified_hamiltonian(method, ASYMMETRIC, 5)
    value = sympy.Symbol("alpha") if alpha == "alpha" else sympy.Rational(alpha)
    for power, key in ((2, "H3_general_alpha"), (4, "H5_general_alpha")):
        expected = lecture_formula(LECTURE["section4_takahashi_imada"][key], ASYMMETRIC, alpha=value)
        assert H.route == "trees"
        assert agree(H.symbolic(power), expected, (P, Q))


@pytest.mark.parametrize(("name", "sign"), [("p", 1), ("q", -1)])
def test_25_symplectic_euler_on_a_hamiltonian_that_is_not_separable(name, sign):
    """H̃ = H ∓ h/2 H_p H_q + h²/12 (H_pp H_q² + H_qq H_p² + 4 H_pq H_p H_q), as sums over degrees of freedom."""
    H, p, q = found(f"symplectic-euler-{name}", MIXED, 3), MIXED.symbols[:2], MIXED.symbols[2:]
    h = MIXED.hamiltonian
    first = -sign * sum(h.diff(p[i]) * h.diff(q[i]) for i in range(2)) / 2
    second = sum(
        h.diff(p[i], p[j]) * h.diff(q[i]) * h.diff(q[j])
        + h.diff(q[i], q[j]) * h.diff(p[i]) * h.diff(p[j])
        + 4 * h.diff(p[i], q[j]) * h.diff(q[i]) * h.diff(p[j])
        for i in range(2)
        for j in range(2)
    )
    assert agree(H.symbolic(1), first, MIXED.symbols)
    assert agree(H.symbolic(2), second / 12, MIXED.symbols)


@pytest.mark.parametrize(("name", "sign"), [("p", 1), ("q", -1)])
def test_exercise_5_field_nijhoff(name, sign):
    scene = bs.scene("field-nijhoff")
    H, invariant = found(f"symplectic-euler-{name}", scene, 7), sympy.exp(scene.hamiltonian)
    for k in range(1, 7):
        assert agree(H.symbolic(k), -(sign**k) * invariant ** (-k) / (k * (k + 1)), scene.symbols)


def test_the_linear_case_is_a_logarithm():
    """On H = (p² + q²)/2 the midpoint rule turns by 2 arctan(h/2) a step, so H̃ = 2 arctan(h/2)/h · H."""
    oscillator = bs.Scene({"p": 1, "q": 1}, hamiltonian="(p^2 + q^2)/2")
    H = found("implicit-midpoint", oscillator, 9)
    rate = sympy.series(2 * sympy.atan(H_ / 2) / H_, H_, 0, 9).removeO()
    assert sympy.expand(H.expression(H_) - rate * (P**2 + Q**2) / 2) == 0
    # The trapezoidal rule is no symplectic method, but has the same stability function.
    trapezoidal = found("trapezoidal", oscillator, 9)
    assert trapezoidal.route == "integration"
    assert sympy.expand(trapezoidal.expression(H_) - H.expression(H_)) == 0


# The Hamiltonian of the modified equation.

SYSTEMS = [
    ("implicit-midpoint", PENDULUM, 7, {}),
    ("stormer-verlet", bs.scene("henon-heiles"), 5, {}),
    ("gauss2", bs.scene("henon-heiles"), 5, {}),
    ("implicit-midpoint", bs.scene("kepler"), 3, {}),
    ("symplectic-euler-q", bs.scene("kepler"), 3, {}),
    ("lobatto-iiia-iiib3", MIXED, 5, {}),
    ("strang", PENDULUM, 5, {}),
    ("strang", IN_PARTS, 5, {"parts": {"a": "A", "b": "B"}}),
    ("takahashi-imada", bs.scene("henon-heiles"), 5, {}),
    ("chin4a", PENDULUM, 7, {}),
    ("rkn-verlet", bs.scene("henon-heiles"), 5, {}),
    ("implicit-midpoint", bs.scene("central-field"), 3, {}),
]


@pytest.mark.few(4)
@pytest.mark.parametrize(("method", "scene", "order", "options"), SYSTEMS)
def test_the_formulas_are_the_hamiltonian_of_the_modified_equation(method, scene, order, options):
    H = found(method, scene, order, **options)
    assert H.route == "trees"
    half = scene.dimension // 2
    for k in range(order):
        gradient = [H.symbolic(k).diff(x) for x in scene.symbols]
        expected = [-x for x in gradient[half:]] + gradient[:half]
        defects = [a - b for a, b in zip(H.field.symbolic(k), expected, strict=True)]
        ring = DifferentialRing(defects, scene.symbols)
        assert all(map(ring.is_zero, ring.elements))


def slope(H, y, direction):
    """The derivative of H̃ in a direction by a difference quotient, with h = 1/10, and the size of its error."""
    with mpmath.workdps(40):
        step = mpmath.mpf(10) ** -12
        ahead, behind = ([mpmath.mpf(a) + s * d for a, d in zip(y, direction, strict=True)] for s in (step, -step))
        return (H.precise(ahead, "1/10", 40) - H.precise(behind, "1/10", 40)) / (2 * step)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("method", "scene", "order"),
    [
        ("implicit-midpoint", bs.scene("toda"), 6),
        ("stormer-verlet", bs.scene("lennard-jones", particles=3), 3),
        ("stormer-verlet", bs.scene("outer-solar-system"), 3),
        ("symplectic-euler-p", bs.scene("double-pendulum"), 4),
        ("gauss2", bs.scene("fermi-pasta-ulam"), 5),
    ],
)
def test_the_gradient_on_scenes_with_many_variables(method, scene, order):
    H = found(method, scene, order)
    source = np.random.default_rng(0)
    y = scene.y0 + 0.01 * (1 + abs(scene.y0)) * source.uniform(-1, 1, scene.dimension)
    direction = source.uniform(-1, 1, scene.dimension) * (0.1 + abs(y))
    expected = float(slope(H, y.tolist(), direction.tolist()))
    assert H.gradient(y, 0.1) @ direction == pytest.approx(expected, rel=1e-11)
    assert H.compiled(y, 0.1) == pytest.approx(H(y, 0.1), rel=1e-13)
    assert H(y, 0.1) == pytest.approx(float(H.precise(y.tolist(), "1/10", 40)), rel=1e-12)


@pytest.mark.parametrize(("method", "order"), [("mclachlan-atela4", 5), ("blanes-moan-rkn6", 7)])
def test_methods_in_decimals_are_hamiltonian_within_their_digits(method, order):
    scene = bs.scene("henon-heiles")
    H = evaluated(found(method, scene, order), "towers")
    y, direction = [0.3, -0.2, 0.1, 0.25], [0.5, 1.0, -0.75, 0.25]
    half = 1e-3
    ahead, behind = ([a + s * d for a, d in zip(y, direction, strict=True)] for s in (half, -half))
    quotient = (H(ahead, 1.0) - H(behind, 1.0)) / (2 * half)
    assert H.gradient(y, 1.0) @ direction == pytest.approx(quotient, rel=1e-5)
    with pytest.raises(bs.SeriesError, match="digits must be at most"):
        H.precise(y, 1, 60)


# One rooted tree of each free tree, or all of them.


def by_all_rootings(trees, factor):
    """The series with b(τ)/|τ| times a factor for every rooted tree τ: 1/σ(free) = Σ 1/(|τ| σ(τ))."""
    table, values = trees.table, trees.field.coefficients()
    image = {}
    for tree in table:
        twin = bs.Tree.from_levels(tree.levels, [trees.colors[c] for c in tree.colors])
        image[tree] = trees.field.table.index(twin)
    coefficients = [
        Fraction(factor(tree)) * values[image[tree]] / tree.order if tree.color >= len(trees.scene.field_pieces) else 0
        for tree in table
    ]
    series = bs.BSeries(table, make_values(table, coefficients), 0)
    return EnergySeries(trees.scene, energy_series(trees).series.trees, series)


@pytest.mark.parametrize(
    ("method", "scene", "order"),
    [
        ("implicit-midpoint", PENDULUM, 8),
        ("symplectic-euler-p", bs.scene("henon-heiles"), 7),
        ("lobatto-iiia-iiib3", MIXED, 5),
        ("implicit-midpoint", MIXED, 5),
    ],
)
def test_the_centroid_stands_for_all_rootings(method, scene, order):
    trees = energy_trees(bs.method(method), scene, order, None)
    points = np.random.default_rng(1).uniform(-1, 1, (4, scene.dimension))
    all_rootings = by_all_rootings(trees, lambda tree: 1).terms(points)
    centroids = energy_series(trees).terms(points)
    assert centroids == pytest.approx(all_rootings, rel=1e-12, abs=1e-15)
    # One rooting counted wrong: with σ of the root's tree in place of that of the free tree, or with another sign.
    for wrong in (lambda tree: tree.order, lambda tree: -1 if str(tree).count("[") == 2 else 1):
        terms = by_all_rootings(trees, wrong).terms(points)
        assert not np.allclose(terms, centroids, rtol=1e-3)


# Ways to evaluate it.


@pytest.mark.parametrize(("method", "name", "order"), [("implicit-midpoint", "pendulum", 9), ("gauss2", "kepler", 6)])
def test_towers_formulas_and_many_digits_agree(method, name, order):
    H = found(method, bs.scene(name), order)
    y = H.scene.y0[:, None] * (1 + np.random.default_rng(2).uniform(-0.1, 0.1, (H.scene.dimension, 50)))
    towers, formulas = evaluated(H, "towers"), evaluated(H, "symbolic")
    assert towers.terms(y) == pytest.approx(formulas.terms(y), rel=1e-9, abs=1e-13)
    powers = 0.2 ** np.arange(order)
    for function in (towers, formulas, H):
        values = function(y, 0.2, workers=2)
        assert values.shape == (50,)
        assert values == pytest.approx(powers @ H.terms(y), rel=1e-13)
        assert function(y[:, 3], 0.2) == pytest.approx(values[3], rel=1e-14)
        assert function.compiled(np.ascontiguousarray(y[:, 3]), 0.2) == pytest.approx(values[3], rel=1e-14)
        assert float(function.precise(y[:, 3].tolist(), Fraction(1, 5), 30)) == pytest.approx(values[3], rel=1e-12)
    numbers = dict(zip(H.scene.symbols, map(sympy.Rational, y[:, 3].tolist()), strict=True))
    exact = H.expression(sympy.Rational(1, 5)).subs(numbers).evalf(30)
    with mpmath.workdps(30):
        assert abs(mpmath.mpf(str(exact)) - H.precise(y[:, 3].tolist(), "1/5", 25)) < 1e-24


def test_formulas_too_long_to_compile_can_still_be_written():
    H = found("symplectic-euler-p", bs.scene("double-pendulum"), 5)
    y = [0.3, -0.2, 0.5, 0.7]
    value = H(y, 0.2)
    assert H._energy.evaluator is H._energy  # by towers
    numbers = dict(zip(H.scene.symbols, y, strict=True))
    assert float(H.expression(0.2).subs(numbers)) == pytest.approx(value, rel=1e-11)


@pytest.mark.slow
def test_other_compiled_code_can_call_it_and_runs_observe_it():
    H = found("stormer-verlet", bs.scene("toda"), 5)
    energy = H.compiled

    @numba.njit
    def mean(points, h):
        total = 0.0
        for k in range(len(points)):
            total += energy(points[k], h)
        return total / len(points)

    y = H.scene.y0
    assert mean(np.array([y, y]), 0.01) == pytest.approx(H(y, 0.01), rel=1e-14)
    run = bs.integrate(H.method, H.scene, h=0.02, steps=400, observe=["energy", {"H": H.observer(0.02)}])
    spread = {name: np.ptp(values) for name, values in run.observed.items()}
    assert spread["H"] < 1e-3 * spread["energy"]
    assert run.observed["H"] == pytest.approx(H(run.y, 0.02), rel=1e-12)


def test_it_is_pickled_and_written_as_data():
    for method, scene in ((bs.method("implicit-midpoint"), PENDULUM), (bs.method("trapezoidal"), FORMULAS)):
        H = bs.modified_hamiltonian(method, scene, 2)
        again = pickle.loads(pickle.dumps(H))
        assert str(again) == str(H)
        assert again([0.1, 0.2], 0.3) == H([0.1, 0.2], 0.3)
    data = found("symplectic-euler-p", PENDULUM, 2).to_dict()
    assert json.loads(json.dumps(data)) == {
        "schema": 1,
        "kind": "hamiltonian",
        "method": "symplectic-euler-p",
        "scene": "pendulum",
        "effects": [],
        "order": 2,
        "route": "trees",
        "domain": "QQ",
        "variables": ["p", "q"],
        "exists_through": None,
        "verdict": {
            "tested_to": 2,
            "general": {"hamiltonians": "all H = T(p) + U(q)", "order": 2, "breaks": None},
            "order": 2,
            "holds": True,
        },
        "terms": [{"power": 0, "hamiltonian": "p**2/2 - cos(q)"}, {"power": 1, "hamiltonian": "-p*sin(q)/2"}],
    }
    latex = found("symplectic-euler-p", PENDULUM, 2).to_latex()
    assert latex == r"\frac{p^{2}}{2} - \cos{\left(q \right)} + h \left(- \frac{p \sin{\left(q \right)}}{2}\right)"


def test_a_series_does_as_well_as_its_method():
    for method in ("gauss2", "stormer-verlet"):
        series = bs.modified_equation(bs.method(method), 5)
        H = bs.modified_hamiltonian(series, bs.scene("henon-heiles"))
        assert H.order == 5
        assert agree(H.expression(H_), found(method, H.scene, 5).expression(H_), H.scene.symbols)
    with pytest.raises(bs.SeriesError, match="method must be a method for the route 'brackets', but was a series"):
        bs.modified_hamiltonian(series, PENDULUM, route="brackets")


def test_parameters_may_be_symbols():
    oscillator = {"hamiltonian": "p^2/(2*m) + k*q^4", "parameters": {"m": "m", "k": "k"}}
    H = found("stormer-verlet", bs.Scene({"p": 1, "q": 1}, **oscillator), 3)
    m, k = sympy.symbols("m k")
    assert agree(H.symbolic(2), k * P**2 * Q**2 / m**2 - 2 * k**2 * Q**6 / (3 * m), (P, Q))
    with pytest.raises(bs.IntegratorError, match="must be a number in compiled code, but was a symbol"):
        H([0.0, 1.0], 0.1)
    general = bs.methods.TakahashiImada("alpha", parameters=["alpha"], simplified=True)
    assert bs.hamiltonians.hamiltonian_verdict(general, PENDULUM, 5).holds
    assert bs.hamiltonians.hamiltonian_verdict(general, bs.scene("henon-heiles"), 5).order == 4
    with pytest.raises(bs.SeriesError, match="must be numbers in compiled code, but alpha are symbols"):
        bs.modified_hamiltonian(general, PENDULUM, 5)([0.0, 1.0], 0.1)


# Theorem 3 of the lecture: along the numerical solution H^[N] varies as the first term that it leaves out.


@pytest.mark.parametrize("method", ["implicit-midpoint", "symplectic-euler-p", "stormer-verlet"])
def test_theorem_3_the_first_omitted_term_is_what_varies(method):
    H, start, order = found(method, PENDULUM, 9), (0, Fraction(-3, 2)), 9

    def field(y):
        return [-mpmath.sin(y[1]), y[0]]

    blocks = (lambda y: [-mpmath.sin(y[1]), 0], lambda y: [0, y[0]])
    parts = field if method == "implicit-midpoint" else blocks
    steps = {n: plain_steps(bs.method(method), parts, start, Fraction(2, n), n, digits=40)[:, -1] for n in (16, 32)}
    with mpmath.workdps(40):
        terms = [sympy.lambdify((P, Q), H.symbolic(k), "mpmath") for k in range(order)]
        gaps = {}
        for n, end in steps.items():
            changes = [f(*end) - f(mpmath.mpf(0), mpmath.mpf(-3) / 2) for f in terms]
            gaps[n] = [mpmath.polyval(changes[N - 1 :: -1], mpmath.mpf(2) / n) for N in range(1, order)]
            for N in range(1, order):
                short = found(method, PENDULUM, N)
                pair = [short.precise(y, Fraction(2, n), 40) for y in (end, start)]
                assert abs(pair[0] - pair[1] - gaps[n][N - 1]) < 1e-35
        for N in range(1, order):
            omitted = next(k for k in range(N, order) if H.symbolic(k) != 0)
            assert omitted == (N if method == "symplectic-euler-p" else N + N % 2)
            assert mpmath.log(abs(gaps[16][N - 1] / gaps[32][N - 1]), 2) == pytest.approx(omitted, abs=0.25)
            predicted = -terms[omitted](*steps[32]) + terms[omitted](mpmath.mpf(0), mpmath.mpf(-3) / 2)
            assert gaps[32][N - 1] / predicted / (mpmath.mpf(2) / 32) ** omitted == pytest.approx(1, abs=0.15)


def test_figure_6_the_energy_of_the_midpoint_rule():
    """Max |H^[3](y_n) − H^[3](y_0)| over 20,000 steps with h = 0.1, from (0, −1.5)."""
    H = found("implicit-midpoint", PENDULUM, 3)
    run = bs.integrate(H.method, PENDULUM, h=0.1, steps=20_000, observe={"H": H.observer(0.1)})
    assert abs(run.observed["H"] - run.observed["H"][0]).max() == pytest.approx(6.97e-7, rel=2e-3)


# Methods and scenes without one.


@pytest.mark.parametrize(
    ("method", "name", "order", "message"),
    [
        (
            "rk4",
            "henon-heiles",
            5,
            r"rk4 is Hamiltonian for all H to order 4, where \[τ,\[\[τ\]\]\] breaks it, .* h\^4",
        ),
        ("rk4", "n-body", 5, r"the term with h\^4 breaks it"),
        ("explicit-euler", "pendulum", 2, r"for all H to order 1, where \[τ\] breaks it, .* h\^1 breaks it"),
        (
            "simplified-takahashi-imada",
            "henon-heiles",
            5,
            r"quadratic T to order 4, where p\[q\[p\[q\[p\]\]\]\] breaks",
        ),
    ],
)
def test_methods_that_are_not_symplectic_are_refused(method, name, order, message):
    with pytest.raises(bs.SeriesError, match=f"^method must be symplectic on {name}, but .*{message}"):
        found(method, bs.scene(name), order)
    with pytest.raises(bs.SeriesError, match="method must be symplectic for the route 'trees', but"):
        found(method, bs.scene(name), order, route="trees")


def test_scenes_that_are_not_hamiltonian_are_refused():
    midpoint = bs.method("implicit-midpoint")
    for name in ("van-der-pol", "lorenz", "abc-flow"):
        with pytest.raises(bs.SeriesError, match=f"scene must be canonical or a Poisson .*, but {name} is not"):
            bs.modified_hamiltonian(midpoint, bs.scene(name), 3)
    damped = bs.scene("pendulum", effects=["damping"])
    with pytest.raises(
        bs.SeriesError, match="scene must be Hamiltonian, but the field of pendulum with damping is not"
    ):
        bs.modified_hamiltonian(midpoint, damped, 3)
    with pytest.raises(
        bs.SeriesError, match=r"scene must be given by a Hamiltonian .*, but pendulum with damping is not"
    ):
        bs.modified_hamiltonian(midpoint, damped, 3, route="trees")
    with pytest.raises(bs.SeriesError, match="method must be a Poisson integrator on lotka-volterra, but implicit-mid"):
        bs.modified_hamiltonian(midpoint, bs.scene("lotka-volterra"), 3)


def test_a_hamiltonian_field_need_not_say_that_it_is_one():
    H = bs.modified_hamiltonian(bs.method("implicit-midpoint"), FORMULAS, 5)
    assert H.route == "integration"
    assert agree(H.expression(H_), found("implicit-midpoint", PENDULUM, 5).expression(H_), (P, Q))
    y = np.random.default_rng(3).uniform(-1, 1, (2, 5))
    assert H.gradient(y, 0.3) == pytest.approx(found("implicit-midpoint", PENDULUM, 5).gradient(y, 0.3), rel=1e-12)
    assert float(H.precise(y[:, 0].tolist(), 0.3, 20)) == pytest.approx(H(y[:, 0], 0.3), rel=1e-12)


def test_integration_agrees_with_trees():
    for method, scene in (("implicit-midpoint", PENDULUM), ("stormer-verlet", bs.scene("henon-heiles"))):
        first, second = found(method, scene, 5), found(method, scene, 5, route="integration")
        assert (first.route, second.route) == ("trees", "integration")
        assert agree(first.expression(H_), second.expression(H_), scene.symbols)


def test_exercise_2_lotka_volterra():
    scene = bs.scene("lotka-volterra")
    H = found("symplectic-euler-p", scene, 3)
    expected = LECTURE["example2_lotka_volterra_and_exercise2"]["symplectic_euler_p_implicit"]["first_integral_I_k"]
    assert all(agree(H.symbolic(k), sympy.sympify(text), (P, Q)) for k, text in enumerate(expected))
    gradient, field = H.gradient([1.5, 2.5], 0.1), H.field([1.5, 2.5], 0.1)
    assert field == pytest.approx([-1.5 * 2.5 * gradient[1], 1.5 * 2.5 * gradient[0]], rel=1e-13)


# With one degree of freedom a method may be Hamiltonian on a scene although it is not symplectic.


def test_the_simplified_method_has_a_hamiltonian_on_the_line_but_not_on_the_cylinder():
    """It grows by α²/2 ∫ U''' U'² = α²/2 · 6π/5 from q to q + 2π on the asymmetric pendulum, and not on the other."""
    for scene, mean in ((PENDULUM, sympy.Integer(0)), (ASYMMETRIC, sympy.Rational(6, 5) * sympy.pi)):
        H = found("simplified-takahashi-imada", scene, 5)
        assert H.route == "integration"
        increments = [sympy.expand_trig(H.symbolic(k).subs(Q, Q + 2 * sympy.pi) - H.symbolic(k)) for k in range(5)]
        assert [sympy.expand(x) for x in increments] == [0, 0, 0, 0, mean / 144 / 2]
    potential = -sympy.cos(Q) + sympy.sin(2 * Q) / 5
    integral = sympy.integrate(sympy.expand(potential.diff(Q, 3) * potential.diff(Q) ** 2), (Q, 0, 2 * sympy.pi))
    assert sympy.simplify(integral - 6 * sympy.pi / 5) == 0
    assert LECTURE["section4_takahashi_imada"]["integral_U_qqq_U_q^2"]["exact"] == "6*pi/5"
    assert float(integral) == pytest.approx(6 * pi / 5)


@pytest.mark.parametrize(
    ("method", "name", "general", "here"),
    [
        ("implicit-midpoint", "pendulum", 6, 6),
        ("rk4", "pendulum", 4, 5),  # its energy drifts as t h⁵, one power less than its order lets expect
        ("rk4", "henon-heiles", 4, 4),
        ("explicit-euler", "kepler", 1, 1),
        ("stormer-verlet", "lennard-jones", 6, 6),
        ("simplified-takahashi-imada", "pendulum", 4, 6),
        ("simplified-takahashi-imada", "henon-heiles", 4, 4),
        ("symplectic-euler-p", "double-pendulum", 6, 6),
        ("blanes-moan-rkn6", "henon-heiles", 6, 6),
        ("dormand-prince54", "henon-heiles", 5, 5),
    ],
)
def test_verdicts_for_all_hamiltonians_and_for_one(method, name, general, here):
    verdict = bs.hamiltonians.hamiltonian_verdict(bs.method(method), bs.scene(name), 6)
    assert (verdict.general.order, verdict.order, verdict.tested_to) == (general, here, 6)
    assert verdict.holds == (here == 6)
    assert (verdict.general.breaks is None) == (general == 6)


def test_verdicts_on_poisson_systems():
    scene = bs.scene("lotka-volterra")
    verdicts = [
        bs.hamiltonians.hamiltonian_verdict(bs.method(name), scene, 5) for name in ("symplectic-euler-p", "rk4")
    ]
    assert [(verdict.general, verdict.order) for verdict in verdicts] == [(None, 5), (None, 4)]
    assert str(verdicts[1]) == "rk4 is Hamiltonian on lotka-volterra to order 4, where the term with h^4 breaks it"


# Arguments.


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((4, PENDULUM, 3), {}, "method must be"),
        ((bs.method("rk4"), 3, 3), {}, "scene must be a Scene or the name of one, but was 3"),
        ((bs.method("rk4"), PENDULUM), {}, "order must be given for a method, but was None"),
        ((bs.method("rk4"), PENDULUM, 0), {}, "order"),
        ((bs.method("rk4"), PENDULUM, 3), {"route": "guess"}, "route must be one of auto, trees"),
        ((bs.method("symplectic-euler-p"), bs.scene("abc-flow"), 3), {}, "parts must say what the method"),
    ],
)
def test_bad_arguments_are_refused(arguments, options, message):
    with pytest.raises(bs.errors, match=message):
        bs.modified_hamiltonian(*arguments, **options)


def test_bad_points_powers_and_steps_are_refused():
    H = found("implicit-midpoint", bs.scene("toda"), 3)
    for k in (-1, 3, True, 1.0):
        with pytest.raises(bs.SeriesError, match="k must be a power of h from 0 to 2"):
            H.symbolic(k)
    for y in ([1.0], [[1.0]], "y", [None] * 6):
        with pytest.raises(bs.SeriesError, match="y must"):
            H(y, 0.1)
        with pytest.raises(bs.errors, match="y"):
            H.precise(y, 0.1)
    for h in ("h", None, 1j):
        with pytest.raises(bs.SeriesError, match="h must be a real number"):
            H(H.scene.y0, h)
    with pytest.raises(bs.SeriesError, match="h must be a number or a SymPy expression"):
        H.expression("h")
    with pytest.raises(bs.SeriesError, match="workers must be"):
        H(H.scene.y0, 0.1, workers=0)
    with pytest.raises(ValueError, match="y must have another number of entries"):
        H.compiled(np.zeros(3), 0.1)
    with pytest.raises(ValueError, match="y must have 2 entries"):
        found("implicit-midpoint", PENDULUM, 3).compiled(np.zeros(3), 0.1)


# The scene with its energies.


def test_energies_take_names_that_are_free_and_keep_sums_over_sites():
    crowded = bs.Scene(
        {"p": 1, "q": ["energy1"]}, hamiltonian="p^2/(2*energy_x) - cos(energy1)", parameters={"energy_x": 2}
    )
    assert EnergyScene(crowded, pieces_of(["f"], crowded)).variables == ("p", "energy1", "energy__1")
    atoms = bs.scene("lennard-jones", particles=3)
    energies = EnergyScene(atoms, pieces_of(["p", "q"], atoms))
    assert [term.sites for term in energies.local_terms] == [term.sites for term in atoms.local_terms]
    assert sympy.expand(sum(map(sum, energies.fields[2:])) - atoms.hamiltonian) == 0
    assert tuple(map(sum, zip(*energies.fields, strict=True)))[: atoms.dimension] == atoms.field
    assert energies == EnergyScene(atoms, pieces_of(["p", "q"], atoms)) != EnergyScene(atoms, pieces_of(["f"], atoms))
    assert pickle.loads(pickle.dumps(energies)) == energies
