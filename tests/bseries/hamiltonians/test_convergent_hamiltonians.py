"""Modified Hamiltonians in closed form."""

import itertools
import math
import pickle

import mpmath
import numpy as np
import pytest
import sympy

import bseries as bs
from bseries.hamiltonians.closed_forms import OscillatorStep, closed_hamiltonian
from bseries.hamiltonians.generating_functions import generating_terms
from bseries.hamiltonians.symplectic_stages import symplectic_stages

H_STEP = sympy.Symbol("h")
RUNGE_KUTTA = ["implicit-midpoint", "gauss2", "gauss3", "qin-zhang", "lobatto-iiie3"]
PARTITIONED = ["symplectic-euler-p", "symplectic-euler-q", "stormer-verlet-kdk", "stormer-verlet-dkd"]
PARTITIONED += ["lobatto-iiia-iiib3", "gauss-gauss2", "ruth3", "triple-jump4", "strang", "gark2"]


def scene_of(hamiltonian, size=1, name="custom"):
    return bs.Scene({"p": size, "q": size}, hamiltonian=hamiltonian, name=name)


OSCILLATOR = scene_of("(p^2 + q^2)/2", name="oscillator")
STIFF = scene_of("p^2/2 + 9*q^2/2", name="stiff")
SADDLE = scene_of("p^2/2 - 3*q^2/2", name="saddle")
COUPLED = scene_of("p1^2/2 + p2^2 + q1^2 + q1*q2 + q2^2", 2, name="coupled")
MAGNETIC = scene_of("p1^2/2 + p2^2/2 + p1*q2 - p2*q1 + q1^2 + 2*q2^2", 2, name="magnetic")
SPIRAL = scene_of("p1*(q1 + q2) + p2*(q2 - q1)", 2, name="spiral")


def linear_step(method, scene, h):
    """One step of a tableau on a linear system, as a matrix: the stages are solved for all at once."""
    y = scene.symbols
    A = np.array(sympy.Matrix(scene.field).jacobian(y).tolist(), float)
    n, parts, s = len(y), method.partitions, method.stages
    blocks = [np.eye(n)] if len(parts) == 1 else [np.diag((np.arange(n) // (n // 2) == k) * 1.0) for k in range(2)]
    a = sum(np.kron(np.array(part.A, float), block @ A) for part, block in zip(parts, blocks, strict=True))
    b = sum(np.kron(np.array(part.b, float), block @ A) for part, block in zip(parts, blocks, strict=True))
    stages = np.linalg.solve(np.eye(n * s) - h * a, np.kron(np.ones((s, 1)), np.eye(n)))
    return np.eye(n) + h * b @ stages


@pytest.mark.few(8)
@pytest.mark.parametrize(
    ("name", "scene"),
    [
        *itertools.product([*RUNGE_KUTTA, *PARTITIONED], [OSCILLATOR, SADDLE]),
        *itertools.product([*RUNGE_KUTTA[:2], *PARTITIONED[:2]], [STIFF, COUPLED]),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_the_closed_form_is_the_sum_of_the_series(name, scene):
    method = bs.method(name)
    found = closed_hamiltonian(method, scene)
    terms = generating_terms(method, scene, 5)
    y = [0.3, 0.7, -0.2, 0.4][: scene.dimension]
    values = dict(zip(scene.symbols, y, strict=True))
    h = found.radius / 100
    truncated = sum(float(term.subs(values)) * h**k for k, term in enumerate(terms))
    assert found(y, h) == pytest.approx(truncated, abs=1e-9)
    if scene is not COUPLED or name in ("implicit-midpoint", "stormer-verlet-kdk"):  # formulas of modes are long
        written = found.expression(H_STEP).subs(values).subs(H_STEP, h)
        assert found(y, h) == pytest.approx(float(written), abs=1e-13)
    assert found(y, 0) == pytest.approx(float(scene.hamiltonian.subs(values)))
    assert sympy.expand(found.expression(0) - scene.hamiltonian) == 0 or scene is COUPLED


@pytest.mark.parametrize("scene", [MAGNETIC, SPIRAL], ids=lambda scene: scene.name)
@pytest.mark.parametrize("name", ["implicit-midpoint", "gauss2"])
def test_runge_kutta_methods_where_momenta_and_positions_mix(name, scene):
    found = closed_hamiltonian(bs.method(name), scene)
    terms = generating_terms(bs.method(name), scene, 7)
    y, h = np.array([0.3, 0.7, -0.2, 0.4]), found.radius / 50
    values = dict(zip(scene.symbols, y, strict=True))
    truncated = sum(float(term.subs(values)) * h**k for k, term in enumerate(terms))
    assert found(y, h) == pytest.approx(truncated, abs=1e-12)
    step = linear_step(bs.method(name), scene, 0.9 * found.radius)
    assert found(step @ y, 0.9 * found.radius) == pytest.approx(found(y, 0.9 * found.radius), rel=1e-11)


@pytest.mark.parametrize("scene", [OSCILLATOR, COUPLED], ids=lambda scene: scene.name)
@pytest.mark.parametrize("name", [*RUNGE_KUTTA, *PARTITIONED[:6]])
def test_it_is_conserved_for_large_steps_too(name, scene):
    found = closed_hamiltonian(bs.method(name), scene)
    y = np.array([0.3, 0.7, -0.2, 0.4][: scene.dimension])
    for h in (0.95 * found.radius, -0.5 * found.radius):
        step = linear_step(bs.method(name), scene, h)
        points = np.array([np.linalg.matrix_power(step, n) @ y for n in range(40)]).T
        values = found(points, h)
        assert np.ptp(values) < 1e-9 * np.abs(values).max()


def test_the_hamiltonian_itself_is_not_conserved():
    step = linear_step(bs.method("stormer-verlet"), OSCILLATOR, 1.9)
    points = np.array([np.linalg.matrix_power(step, n) @ [0.3, 0.7] for n in range(40)])
    assert np.ptp((points**2).sum(axis=1)) > 1


def flow_over(H, h, dimension):
    """exp(h J⁻¹S̃) for H̃ = ½ yᵀS̃y given as a function."""
    unit = np.eye(dimension)
    S = np.array([[H(a + b) - H(a) - H(b) for b in unit] for a in unit])
    half = dimension // 2
    A = h * np.vstack([-S[half:], S[:half]])
    total, power = np.eye(dimension), np.eye(dimension)
    for k in range(1, 60):
        power = power @ A / k
        total = total + power
    return total


@pytest.mark.few(10)
@pytest.mark.parametrize("scene", [OSCILLATOR, SADDLE, COUPLED], ids=lambda scene: scene.name)
@pytest.mark.parametrize("name", [*RUNGE_KUTTA, *PARTITIONED[:6]])
def test_its_flow_is_the_step(name, scene):
    found = closed_hamiltonian(bs.method(name), scene)
    h = 0.9 * found.radius
    flow = flow_over(lambda y: found(y, h), h, scene.dimension)
    assert flow == pytest.approx(linear_step(bs.method(name), scene, h), abs=1e-9)


def test_the_branch_beyond_an_eigenvalue_minus_one():
    """Gauss with three stages turns the oscillator by π at h = √10 already, and the series goes on to 4.64."""
    found = closed_hamiltonian(bs.method("gauss3"), OSCILLATOR)
    R = bs.stability_function(bs.method("gauss3"))
    h = 3.6
    zeros = np.roots([float(x) for x in reversed(R.numerator)])
    poles = np.roots([float(x) for x in reversed(R.denominator)])
    b = [(np.sum(poles**-k) - np.sum(zeros**-k)).real / k for k in range(1, 161)]  # Example 3
    angle = sum((x * (1j * h) ** k for k, x in enumerate(b, 1)), start=0j).imag
    assert angle > math.pi
    assert found([1, 0], h) == pytest.approx(angle / h / 2, rel=1e-9)


# Radii of convergence.


@pytest.mark.parametrize("name", [*RUNGE_KUTTA, "gauss5", "lobatto-iiid3"])
def test_the_radius_of_runge_kutta_methods_in_two_ways(name):
    method = bs.method(name)
    assert OscillatorStep.of_runge_kutta(method).radius() == pytest.approx(bs.fields.convergence_radius(method).radius)


@pytest.mark.parametrize("name", ["implicit-midpoint", "gauss2", "qin-zhang", "lobatto-iiie3"])
def test_the_step_in_two_ways(name):
    method = bs.method(name)
    one = OscillatorStep.of_runge_kutta(method)
    other = OscillatorStep.of_stages(symplectic_stages(method, OSCILLATOR))
    assert all(sympy.simplify(a - b) == 0 for a, b in zip(one.entries, other.entries, strict=True))


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("name", "radius"),
    [
        ("symplectic-euler-p", 2),
        ("stormer-verlet-kdk", 2),
        ("stormer-verlet-dkd", 2),
        ("lobatto-iiia-iiib3", math.sqrt(8)),
        ("ruth3", 2.5074811709523552),
        ("triple-jump4", 1.6453350615546878),
    ],
)
def test_the_radius_is_that_of_the_series(name, radius):
    found = closed_hamiltonian(bs.method(name), OSCILLATOR)
    assert found.radius == pytest.approx(radius)
    step = OscillatorStep.of_stages(symplectic_stages(bs.method(name), OSCILLATOR))
    with mpmath.workdps(40):
        sizes = [abs(x) for x in angle_over_sine(step, 300)]
        growth = max(float(sizes[k] ** (mpmath.mpf(1) / (2 * k))) for k in range(260, 300))
    assert growth * radius == pytest.approx(1, abs=0.03)  # up to a power of k


def angle_over_sine(step, count):
    """The coefficients of F = θ/sin θ in powers of s, from (1 − c²) F' = c' (c F − 1) with c = cos θ."""
    numerator, denominator = (
        [mpmath.mpf(x.evalf(40)) for x in reversed(sympy.Poly(part, step.s).all_coeffs())]
        for part in sympy.fraction(sympy.cancel(step.cosine))
    )
    c = []
    for n in range(count + 2):
        known = numerator[n] if n < len(numerator) else 0
        known -= mpmath.fsum(denominator[k] * c[n - k] for k in range(1, min(n, len(denominator) - 1) + 1))
        c.append(known / denominator[0])
    slope = [(n + 1) * x for n, x in enumerate(c[1:])]
    gap = [-mpmath.fsum(c[k] * c[n - k] for k in range(n + 1)) for n in range(count + 1)]  # 1 − c², but for gap[0]
    product = [mpmath.fsum(slope[k] * c[n - k] for k in range(n + 1)) for n in range(count + 1)]
    F = [mpmath.mpf(1)]
    for n in range(1, count):
        rest = mpmath.fsum(product[n - k] * F[k] for k in range(n)) - slope[n]
        rest -= mpmath.fsum(gap[n + 1 - k] * k * F[k] for k in range(1, n))
        F.append(rest / (gap[1] * n - product[0]))
    return F


def test_radii_of_scenes():
    midpoint = bs.method("implicit-midpoint")
    assert closed_hamiltonian(midpoint, STIFF).radius == pytest.approx(2 / 3)
    assert closed_hamiltonian(midpoint, SADDLE).radius == pytest.approx(2 / math.sqrt(3))
    assert closed_hamiltonian(midpoint, SPIRAL).radius == pytest.approx(2 / math.sqrt(2))
    free = closed_hamiltonian(bs.method("stormer-verlet"), scene_of("p^2/2"))
    assert free.radius == math.inf
    assert free([2, 5], 1e6) == pytest.approx(2)
    assert str(free.expression(H_STEP)) == "p**2/2"


@pytest.mark.parametrize(
    ("h", "message"),
    [
        (2, "h must be less than 2, the radius of convergence, in absolute value"),
        (-2.5, "h must be less than 2, the radius of convergence, in absolute value"),
        (math.inf, "h must be a finite number, but was inf"),
        (math.nan, "h must be a finite number, but was nan"),
    ],
)
def test_outside_the_radius_there_is_no_value(h, message):
    found = closed_hamiltonian(bs.method("implicit-midpoint"), OSCILLATOR)
    with pytest.raises(bs.SeriesError, match=message):
        found([1, 0], h)


# Formulas.


def test_known_formulas():
    p, q = OSCILLATOR.symbols
    energy = (p**2 + q**2) / 2
    midpoint = closed_hamiltonian(bs.method("implicit-midpoint"), OSCILLATOR).expression(H_STEP)
    assert sympy.simplify(midpoint - energy * 2 * sympy.atan(H_STEP / 2) / H_STEP) == 0
    verlet = closed_hamiltonian(bs.method("stormer-verlet"), OSCILLATOR).expression(H_STEP)
    ratio = 2 * sympy.asin(H_STEP / 2) / (H_STEP * sympy.sqrt(1 - H_STEP**2 / 4))
    expected = (ratio * (p**2 + (1 - H_STEP**2 / 4) * q**2)) / 2
    assert abs(float((verlet - expected).subs({p: 0.3, q: 0.8, H_STEP: 1.3}))) < 1e-14
    saddle = closed_hamiltonian(bs.method("implicit-midpoint"), scene_of("p*q")).expression(H_STEP)
    assert sympy.simplify(saddle - 2 * p * q * sympy.atanh(H_STEP / 2) / H_STEP) == 0


def test_what_it_says():
    found = closed_hamiltonian(bs.method("implicit-midpoint"), OSCILLATOR)
    assert repr(found) == "<modified Hamiltonian of implicit-midpoint on oscillator: closed form for |h| < 2>"
    assert found.to_dict() == {
        "schema": 1,
        "kind": "closed-hamiltonian",
        "label": "implicit-midpoint on oscillator",
        "closed_form": "linear",
        "variables": ["p", "q"],
        "radius": "2",
        "hamiltonian": "2*(p**2/2 + q**2/2)*atan(h/2)/h",
    }


def test_frequencies_without_formulas():
    chain = " + ".join([*(f"p{i}^2/2" for i in range(1, 6)), *(f"(q{i + 1} - q{i})^2/2" for i in range(1, 5))])
    scene = scene_of(chain + " + q1^2", 5, name="chain")
    method = bs.method("stormer-verlet")
    found = closed_hamiltonian(method, scene)
    assert str(found) == f"modified Hamiltonian of stormer-verlet-kdk on chain, for |h| < {found.radius:.6g}"
    assert found.to_dict()["hamiltonian"] is None
    y = np.arange(10) / 7
    step = linear_step(method, scene, 0.9 * found.radius)
    assert found(step @ y, 0.9 * found.radius) == pytest.approx(found(y, 0.9 * found.radius), rel=1e-11)
    with pytest.raises(bs.SeriesError, match="must have frequencies that are square roots for a formula"):
        found.expression(H_STEP)


def test_constants_stay_and_results_can_be_sent():
    found = closed_hamiltonian(bs.method("strang"), scene_of("(p^2 + q^2)/2 + 5"))
    again = pickle.loads(pickle.dumps(found))
    plain = closed_hamiltonian(bs.method("strang"), OSCILLATOR)
    assert again([1, 2], 0.3) == found([1, 2], 0.3) == plain([1, 2], 0.3) + 5
    assert closed_hamiltonian(bs.method("strang"), scene_of("7"))([1, 2], 3) == 7
    with pytest.raises(bs.SeriesError, match="h must be a number or a SymPy expression"):
        found.expression("h")


# What is refused.


@pytest.mark.parametrize(
    ("name", "scene", "reason"),
    [
        ("rk4", OSCILLATOR, r"method must be symplectic, but rk4 is not: b_i a_ij \+ b_j a_ji = b_i b_j"),
        ("implicit-midpoint", bs.scene("pendulum"), "scene must be linear for a closed form, but was pendulum"),
        (
            "symplectic-euler-p",
            bs.scene("field-nijhoff"),
            "scene must be linear for .* was field-nijhoff",
        ),
        ("implicit-midpoint", scene_of("p^2/2 + q^2/2 + q"), "scene must be linear for"),
        (
            "implicit-midpoint",
            bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 + k*q^2/2", parameters={"k": "k"}),
            "parameters must have values for a closed form, but k had none",
        ),
        ("stormer-verlet", MAGNETIC, "must be a Runge–Kutta method, or kick by U.q. and drift by T.p."),
        ("implicit-midpoint", scene_of("p1*q1 - p2*q2 + p1*q2 - p2*q1/2 + p1^2", 2), "Jordan blocks"),
        ("implicit-midpoint", bs.scene("linear"), "must be Hamiltonian in canonical variables"),
        ("yoshida6", OSCILLATOR, "must be exact"),
    ],
)
def test_where_no_closed_form_is_known(name, scene, reason):
    with pytest.raises(bs.SeriesError, match=reason):
        closed_hamiltonian(bs.method(name), scene)
