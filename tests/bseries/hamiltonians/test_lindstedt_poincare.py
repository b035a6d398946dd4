"""Elimination of angles: section 7 of the lecture, known normal forms, and actions along accurate solutions."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy

import bseries as bs
from bseries.hamiltonians.canonical_transformations import harmonic_action_angle
from bseries.hamiltonians.fourier import FourierRing
from bseries.hamiltonians.lindstedt_poincare import lindstedt_poincare

A, THETA, EPS = sympy.symbols("a theta eps")
A1, A2, THETA1, THETA2 = sympy.symbols("a1 a2 theta1 theta2")
GOLDEN = "(a1^2 + a2^2)/2 + a1 + (1 + sqrt(5))/2*a2 + eps*(cos(theta1) + cos(theta1 - theta2))"


@pytest.fixture(scope="module")
def golden():
    return lindstedt_poincare(scene(GOLDEN), 3)


def scene(hamiltonian, size=2, **options):
    options = {"parameters": {"eps": "1/100"}} | options
    return bs.Scene({"a": size, "theta": size}, hamiltonian=hamiltonian, **options)


# Fourier polynomials.


@pytest.mark.parametrize(
    "text",
    [
        "(cos(theta1) + a1*sin(theta2 - 2*theta1))^3*cos(theta1 + theta2)",
        "sqrt(a1)*sin(theta1 + 1/3)^2*(a2 + sin(theta1 - theta1)) - cos(-theta2)*sin(-3*theta2)",
        "a1/(a1 + a2)*sin(theta1)^4 + exp(a2)*cos(2*(theta1 + theta2))^2",
        "(sin(theta1) + cos(theta2))*(sin(theta2) - cos(theta1))",
    ],
)
def test_reading_products_and_derivatives_agree_with_numbers(text):
    formula = scene(text, parameters={}).hamiltonian
    actions, angles = (A1, A2), (THETA1, THETA2)
    ring = FourierRing([formula], actions, angles)
    f = ring.read(formula)
    point = {A1: 0.7, A2: 1.3, THETA1: 0.4, THETA2: 2.1}
    pairs = [(f, formula), (f * f, formula**2)]
    pairs += [(ring.derivative(f, i), formula.diff(variable)) for i, variable in enumerate((*actions, *angles))]
    for found, expected in pairs:
        number = float(ring.waves_expression(found).subs(point))
        assert number == pytest.approx(float(expected.subs(point)), rel=1e-12, abs=1e-12)


def test_modes_have_one_form_each():
    ring = FourierRing([], (A1, A2), (THETA1, THETA2))
    f = ring.read(sympy.sin(THETA2 - THETA1, evaluate=False) + sympy.cos(-THETA2, evaluate=False))
    modes = {k: (cosine.terms, sine.terms) for k, (cosine, sine) in ring.modes(f).items()}
    assert modes == {(1, -1): ({}, {(): -1}), (0, 1): ({(): 1}, {})}
    assert ring.modes(ring.read(sympy.sin(THETA1) ** 2 + sympy.cos(THETA1) ** 2)).keys() == {ring.constant}


# Known series.


def test_a_rotor_has_the_characteristic_values_of_mathieu_functions():
    """p²/2 + ε cos θ is the classical limit of Mathieu's equation: NIST DLMF (28.15.1) for ν → ∞, q = 4ε, ν = 2a."""
    form = lindstedt_poincare(scene("a^2/2 + eps*cos(theta)", 1), 6)
    terms = [form.symbolic(k) for k in range(7)]
    assert terms == [A**2 / 2, 0, 1 / (4 * A**2), 0, 5 / (64 * A**6), 0, 9 / (128 * A**10)]


def duffing_action(energy, eps):
    """∮ p dq / 2π of p²/2 + q²/2 + ε q⁴/4."""
    turn = mpmath.sqrt((mpmath.sqrt(1 + 4 * eps * energy) - 1) / eps)

    def integrand(angle):
        q = turn * mpmath.sin(angle)
        return mpmath.sqrt(abs(2 * energy - q**2 - eps * q**4 / 2)) * turn * mpmath.cos(angle)

    return mpmath.quad(integrand, [0, mpmath.pi / 2]) * 2 / mpmath.pi


def test_the_energy_of_duffings_oscillator_by_its_action():
    """The series of the energy in the action, against the action integral at that energy."""
    oscillator = bs.parse_hamiltonian("(p^2 + q^2)/2 + eps*q^4/4", parameters="eps=eps")
    form = lindstedt_poincare(harmonic_action_angle(oscillator, {"a": 1, "theta": 1}, [1]).hamiltonian(oscillator), 4)
    assert [form.symbolic(k) / A ** (k + 1) for k in range(4)] == [
        1, sympy.Rational(3, 8), sympy.Rational(-17, 64), sympy.Rational(375, 1024),
    ]  # fmt: skip
    with mpmath.workdps(30):
        gaps = []
        for eps in (mpmath.mpf(1) / 50, mpmath.mpf(1) / 100):
            energy = mpmath.mpf(str(form.expression(EPS).subs({A: 1, EPS: sympy.Rational(str(eps))}).evalf(40)))
            gaps.append(abs(duffing_action(energy, eps) - 1))
        assert float(mpmath.log(gaps[0] / gaps[1], 2)) == pytest.approx(5, abs=0.2)


def henon_heiles():
    old = bs.parse_hamiltonian("(p1^2 + p2^2 + q1^2 + q2^2)/2 + eps*(q1^2*q2 - q2^3/3)", parameters="eps=eps")
    return harmonic_action_angle(old, {"a": 2, "theta": 2}, [1, 1]).hamiltonian(old)


def test_the_resonant_normal_form_of_henon_heiles():
    """Gustavson's: −5/12 I² + 7/12 L², with I = a1 + a2 and the angular momentum L."""
    form = lindstedt_poincare(henon_heiles(), 2, keep_resonant=True)
    squared_momentum = 2 * A1 * A2 * (1 - sympy.cos(2 * THETA1 - 2 * THETA2))
    expected = (7 * squared_momentum - 5 * (A1 + A2) ** 2) / 12
    assert sympy.expand(form.symbolic(2) - expected) == 0
    assert dict(form.resonances) == {(2, -2): 2}


def test_a_resonance_is_refused_with_its_k():
    message = r"no resonance through its terms of order 2, but k·omega = 0 for k = \(2, -2\): see keep_resonant"
    with pytest.raises(bs.SeriesError, match=message):
        lindstedt_poincare(henon_heiles(), 2)
    assert lindstedt_poincare(henon_heiles(), 1).symbolic(1) == 0


@pytest.mark.parametrize(
    "frequencies", ["sqrt(3 + 2*sqrt(2))*a1 + (1 + sqrt(2))*a2", "sin(1/3)*a1 + 2*sin(1/6)*cos(1/6)*a2"]
)
def test_a_resonance_that_numbers_hide(frequencies):
    """√(3 + 2√2) = 1 + √2, and sin 2x = 2 sin x cos x."""
    system = scene(f"{frequencies} + eps*cos(theta1 - theta2)")
    with pytest.raises(bs.SeriesError, match=r"k·omega = 0 for k = \(1, -1\): see keep_resonant"):
        lindstedt_poincare(system, 2)
    form = lindstedt_poincare(system, 2, keep_resonant=True)
    assert dict(form.resonances) == {(1, -1): 1}
    assert form.symbolic(1) == sympy.cos(THETA1 - THETA2)


def test_a_small_denominator_is_no_resonance():
    """Frequencies that agree to 30 digits differ."""
    close = scene("sqrt(2)*a1 + 1.414213562373095048801688724209*a2 + eps*cos(theta1 - theta2)")
    assert not lindstedt_poincare(close, 1).resonances


def test_two_incommensurable_oscillators_have_no_resonance():
    """Where a1 = 1, a2 = 0, q1² = 1 − cos 2t drives q2'' + 2 q2 = −ε q1²; that shifts the energy by ε <q1² q2>/2."""
    text = "(p1^2 + p2^2 + q1^2 + 2*q2^2)/2 + eps*(q1^2*q2 - q2^3/3)"
    old = bs.parse_hamiltonian(text, parameters="eps=eps")
    new = harmonic_action_angle(old, {"a": 2, "theta": 2}, [1, "sqrt(2)"]).hamiltonian(old)
    form = lindstedt_poincare(new, 4)
    assert not form.resonances
    assert all(form.symbolic(k).free_symbols <= {A1, A2} for k in range(5))
    constant, wave = Fraction(-1, 2), Fraction(1, 2 - 4)  # the response to −1, and to cos 2t
    shift = (constant - wave * Fraction(1, 2)) / 2  # half the mean of q1² q2
    assert form.symbolic(2).subs({A1: 1, A2: 0}) == sympy.Rational(shift)


def test_the_frequency_of_the_verlet_method_on_an_oscillator():
    """Figure 10 for H = (p² + 2 q²)/2: the modified energy is ω_h a with ω_h = (2/h) arcsin(h ω/2)."""
    oscillator = bs.parse_hamiltonian("(p^2 + 2*q^2)/2")
    terms = bs.modified_invariant(bs.modified_field(bs.method("stormer-verlet"), oscillator, 7)).terms
    change = harmonic_action_angle(oscillator, {"a": 1, "theta": 1}, ["sqrt(2)"])
    new = change.hamiltonian(oscillator)
    form = lindstedt_poincare(new, 6, parameter="h", perturbations=[change.composed(term) for term in terms[1:]])
    h = sympy.Symbol("h")
    exact = sympy.series(2 / h * sympy.asin(h / sympy.sqrt(2)), h, 0, 7).removeO()
    assert sympy.expand(form.expression(h) - A * exact) == 0


# The change of variables.


def generating(form, eps):
    """S(b, θ)."""
    return sum(form.generating_function(k) * eps**k for k in range(form.order + 1))


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_new_actions_vary_with_the_next_power(order):
    """b = const + O(ε^(N+1)) along accurate solutions: the exponent, measured."""
    start = {"a": ["3/10", "2/10"], "theta": [0, 1]}
    system = scene(GOLDEN, start=start)
    form = lindstedt_poincare(system, order)
    variation = []
    for eps in (Fraction(1, 100), Fraction(1, 200)):
        solution = bs.reference_solution(system.with_parameters(eps=eps), np.linspace(0.5, 20, 40))
        b = form.to_normal(solution, float(eps))[:2]
        variation.append(np.abs(b - b[:, :1]).max())
    assert np.log2(variation[0] / variation[1]) == pytest.approx(order + 1, abs=0.2)


def test_resonant_normal_forms_keep_the_fast_action():
    """With k = ±(2, −2) kept, a1 + a2 remains an integral of the normal form; without the change it is none."""
    form = lindstedt_poincare(henon_heiles(), 3, keep_resonant=True)
    variation, plain = [], []
    for eps in (0.1, 0.05):
        system = henon_heiles().with_parameters(eps=eps).with_start(a=[0.3, 0.2], theta=[1, 2])
        solution = bs.reference_solution(system, np.linspace(0.5, 20, 40))
        total = form.to_normal(solution, eps)[:2].sum(axis=0)
        variation.append(np.abs(total - total[0]).max())
        plain.append(np.ptp(solution[:2].sum(axis=0)))
    assert np.log2(variation[0] / variation[1]) == pytest.approx(4, abs=0.3)
    assert np.log2(plain[0] / plain[1]) == pytest.approx(1, abs=0.3)


def test_the_normal_form_moves_as_the_system_does():
    """The flow of the truncated normal form, carried back by χ, follows the solution with an error O(ε^(N+1))."""
    system, t = scene(GOLDEN, start={"a": ["3/10", "2/10"], "theta": [0, 1]}), 5.0
    form = lindstedt_poincare(system, 2)
    gaps = []
    for eps in (0.02, 0.01):
        first = form.to_normal(system.y0, eps)
        normal = form.normal_scene.with_parameters(eps=eps)
        rates = np.array([float(x.subs({A1: first[0], A2: first[1]})) for x in normal.field])
        last = form.from_normal(first + t * rates, eps)
        gaps.append(np.abs(last - bs.reference_solution(system.with_parameters(eps=eps), [t])[:, 0]).max())
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(3, abs=0.2)


def test_both_maps_are_inverse_and_take_many_points(golden):
    points = np.random.default_rng(7).uniform(0.2, 0.6, (4, 20))
    images = golden.to_normal(points, 0.01)
    assert np.abs(golden.from_normal(images, 0.01) - points).max() < 1e-14
    assert np.abs(images - points).max() > 1e-3
    assert np.array_equal(golden.to_normal(points[:, 3], 0.01), images[:, 3])


def test_points_near_a_small_denominator_are_solved_for(golden):
    """There ∂²S/∂θ∂b is near 1 or beyond, so that plain iteration converges slowly, or not at all."""
    points = np.random.default_rng(1).uniform(0.2, 0.25, (2000, 4)).T
    b = golden.to_normal(points, 0.01)
    slopes = [term.diff(x) for term in (generating(golden, 0.01),) for x in (THETA1, THETA2, A1, A2)]
    numbers = sympy.lambdify((A1, A2, THETA1, THETA2), slopes, cse=True)(*b[:2], *points[2:])
    assert np.abs(b[:2] + numbers[:2] - points[:2]).max() < 1e-11
    assert np.abs(points[2:] + numbers[2:] - b[2:]).max() < 1e-8
    angles = golden.from_normal(points, 0.01)[2:]
    numbers = sympy.lambdify((A1, A2, THETA1, THETA2), slopes, cse=True)(*points[:2], *angles)
    assert np.abs(angles + numbers[2:] - points[2:]).max() < 1e-11


def test_threads_give_the_same_images(golden):
    points = np.random.default_rng(8).uniform(0.2, 0.6, (4, 31))
    assert np.array_equal(golden.to_normal(points, 0.01, workers=3), golden.to_normal(points, 0.01))


def test_angles_may_come_first():
    """The blocks of the state in another order: {q, p} as {θ, a}."""
    text = "(a1^2 + a2^2)/2 + a1 + sqrt(2)*a2 + eps*(cos(q1) + cos(q1 - q2))"
    swapped = bs.Scene({"q": 2, "p": ["a1", "a2"]}, hamiltonian=text, parameters={"eps": "1/100"})
    plain = bs.Scene({"p": ["a1", "a2"], "q": 2}, hamiltonian=text, parameters={"eps": "1/100"})
    y = np.array([0.3, 0.2, 0.7, 1.9])
    images = [lindstedt_poincare(system, 2).to_normal(np.roll(y, k), 0.01) for system, k in ((swapped, 2), (plain, 0))]
    assert np.array_equal(np.roll(images[0], 2), images[1])


def test_the_maps_are_those_of_the_generating_function(golden):
    y, eps = np.array([0.3, 0.2, 0.7, 1.9]), 0.03
    b1, b2, phi1, phi2 = golden.to_normal(y, eps)
    S = generating(golden, EPS)
    mixed = {A1: b1, A2: b2, THETA1: y[2], THETA2: y[3], EPS: eps}
    slopes = [float(S.diff(x).subs(mixed)) for x in (THETA1, THETA2, A1, A2)]
    assert [b1 + slopes[0], b2 + slopes[1]] == pytest.approx(y[:2], abs=1e-14)
    assert [y[2] + slopes[2], y[3] + slopes[3]] == pytest.approx([phi1, phi2], abs=1e-14)


def test_maps_that_cannot_be_solved_for_are_refused(golden):
    message = (
        r"y must be where Newton's method can solve .* with eps = 0.01, but at 1 of 2 points it could not, such as "
    )
    with pytest.raises(bs.SeriesError, match=message + r"\[-1.0, 1.0, 0.5, 0.5\]"):
        golden.to_normal(np.transpose([[0.5, 0.5, 1, 1], [-1, 1, 0.5, 0.5]]), 0.01)  # a1 + 1 = 0 is a denominator
    with pytest.raises(bs.SeriesError, match="workers must be a whole number ≥ 1, but was 0"):
        golden.to_normal([1, 2, 3, 4], 0.01, workers=0)
    with pytest.raises(bs.SeriesError, match=r"y must have the shape \(4,\)"):
        golden.to_normal([1, 2], 0.01)
    with pytest.raises(bs.SeriesError, match="eps must be a real number, but was 'x'"):
        golden.to_normal([1, 2, 3, 4], "x")


# Denominators.


def test_small_denominators():
    form = lindstedt_poincare(scene(GOLDEN), 4)
    smallest = form.small_denominators(["3/10", "2/10"], 3)
    assert [entry.k for entry in smallest] == [(4, -3), (3, -2), (1, -1)]
    assert [entry.order for entry in smallest] == [4, 3, 1]
    golden = (1 + 5**0.5) / 2 + 0.2
    assert [entry.value for entry in smallest] == pytest.approx([4 * 1.3 - 3 * golden, 3.9 - 2 * golden, 1.3 - golden])
    assert form.denominators[1, 0] == A1 + 1
    assert lindstedt_poincare(scene("a1^2/2 + eps*cos(theta1)"), 2).small_denominators([0, 1])[0].value == 0


def test_parameters_may_be_symbols():
    system = scene(
        "a1^2 + w*a2 + eps*cos(theta1 + beta)*sin(theta2)", parameters=dict.fromkeys(("w", "beta", "eps"), 1)
    )
    system = system.with_parameters(w="w", beta="beta")
    form, w = lindstedt_poincare(system, 2), sympy.Symbol("w")
    assert sympy.simplify(form.symbolic(2) - (1 / (2 * A1 + w) ** 2 + 1 / (2 * A1 - w) ** 2) / 8) == 0
    with pytest.raises(bs.SeriesError, match="scene must have numbers for its parameters to map points, but not for"):
        form.to_normal([1, 2, 3, 4], 0.1)


def test_hamiltonians_need_not_be_polynomials_in_the_parameter():
    """θ' = g(θ) = exp(ε sin θ) + cos ε has the frequency 1/<1/g> = 2 − ε²/2 + …."""
    form = lindstedt_poincare(scene("exp(eps*sin(theta))*a + cos(eps)*a", 1), 2)
    assert [form.symbolic(k) for k in range(3)] == [2 * A, 0, -A / 2]


def test_text_and_data():
    form = lindstedt_poincare(scene("a^2/2 + eps*cos(theta)", 1), 2)
    assert str(form) == "normal form of scene\neps^0   a**2/2\neps^1   0\neps^2   1/(4*a**2)"
    assert repr(form) == "<NormalForm of scene through eps^2>"
    data = form.to_dict()
    assert data["terms"][1] == {"power": 1, "hamiltonian": "0", "generating_function": "-sin(theta)/a"}
    assert data["denominators"][0] == {"k": [1], "order": 1, "denominator": "a"}


# Refusals.


@pytest.mark.parametrize(
    ("hamiltonian", "message"),
    [
        (
            "a1 + eps*cos(theta1/2)",
            r"finitely many Fourier modes, of period 2π in theta1, theta2, but has cos\(theta1/2",
        ),
        ("a1 + eps/(2 + cos(theta1))", r"finitely many Fourier modes, .* but has 1/\(cos\(theta1\) \+ 2\)"),
        ("a1 + eps*theta2", "finitely many Fourier modes, .* but has theta2"),
        ("a1 + cos(theta1)", r"must depend on a1, a2 only where the parameter is 0, but is a1 \+ cos\(theta1\)"),
        ("a1 + cos(theta1)/eps", "parameter must be one that can be small, but at eps = 0 there is no Hamiltonian"),
    ],
)
def test_hamiltonians_that_do_not_fit(hamiltonian, message):
    with pytest.raises(bs.SeriesError, match=message):
        lindstedt_poincare(scene(hamiltonian), 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((scene("a1"), 0), "order must be a whole number ≥ 1, but was 0"),
        ((scene("a1"), True), "order must be a whole number ≥ 1, but was True"),
        ((3, 1), "scene must be a Scene or the name of one, but was 3"),
        ((bs.scene("lorenz"), 1), "scene must be Hamiltonian, but lorenz is not"),
        ((bs.scene("lotka-volterra"), 1), "scene must be canonical, but lotka-volterra has a Poisson structure"),
    ],
)
def test_arguments_that_do_not_fit(arguments, message):
    with pytest.raises(bs.errors, match=message):
        lindstedt_poincare(*arguments)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"parameter": "mu"}, "parameter must be one of the scene's parameters, eps, but was 'mu'"),
        ({"parameter": "a1", "perturbations": ["1"]}, "parameter must have a name of its own, but a1 is a variable"),
        ({"perturbations": ["cos(x)"]}, r"perturbations\[1\] must be a formula in .* unknown name 'x'"),
        ({"perturbations": "cos(theta1)"}, "perturbations must be a sequence, but was"),
        ({"perturbations": ["cos(theta1)*cos(theta2)"], "limit": 1}, "order must be smaller: a coefficient would have"),
    ],
)
def test_options_that_do_not_fit(options, message):
    with pytest.raises(bs.errors, match=message):
        lindstedt_poincare(scene("a1^2 + sqrt(2)*a1*a2 + a2"), 3, **options)


def test_powers_that_do_not_exist():
    form = lindstedt_poincare(scene(GOLDEN), 1)
    with pytest.raises(bs.SeriesError, match="k must be a power of eps from 0 to 1, but was 2"):
        form.symbolic(2)
    with pytest.raises(bs.SeriesError, match="actions must be 2 numbers, but were 1"):
        form.small_denominators([1])
    with pytest.raises(bs.SeriesError, match="eps must be a number or a SymPy expression, but was 'x'"):
        form.expression("x")


def test_three_degrees_of_freedom():
    """With H_1 = cos(θ1 + θ2 + θ3) only the sum s of the frequencies matters: K_2 = 3/(4 s²) for K = |a|²/2."""
    text = "(a1^2 + a2^2 + a3^2)/2 + eps*cos(theta1 + theta2 + theta3)"
    form = lindstedt_poincare(scene(text, 3), 2)
    a = sympy.symbols("a1 a2 a3")
    assert sympy.simplify(form.symbolic(2) - 3 / (4 * sum(a) ** 2)) == 0
    points = np.random.default_rng(3).uniform(0.5, 1, (6, 5))
    assert np.abs(form.from_normal(form.to_normal(points, 0.01), 0.01) - points).max() < 1e-14
