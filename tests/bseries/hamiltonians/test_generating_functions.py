"""Modified Hamiltonians by the Hamilton–Jacobi equation: theorems 4 and 5 of the lecture, (24), (25)."""

import json
from fractions import Fraction
from math import factorial
from pathlib import Path

import mpmath
import pytest
import sympy

import bseries as bs
from bseries.fields.differential_rings import DifferentialRing
from bseries.hamiltonians.generating_functions import (
    exact_generating_function,
    generating_function,
    generating_hamiltonian,
    generating_terms,
    variational_generating_function,
)
from bseries.hamiltonians.symplectic_stages import canonical_pairs

LECTURE = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())
EXAMPLE6 = LECTURE["example6_stoermer_verlet"]
P, Q, H_STEP = sympy.symbols("p q h")
PENDULUM = bs.scene("pendulum")
HENON_HEILES = bs.scene("henon-heiles")
KEPLER = bs.scene("kepler")
NONSEPARABLE = bs.Scene(
    {"p": 2, "q": 2},
    hamiltonian="(1 + q1^2)*p1^2/2 + p2^2*cos(q1)/2 + p1*q2 + q1^4 + q2^2",
    name="nonseparable",
)
GENERIC = bs.Scene(
    {"p": 1, "q": 1},
    hamiltonian="a*p^2/2 + b*p^3/6 + c*p^4/24 + d*q^2/2 + k*q^3/6 + m*q^4/24",
    parameters={name: name for name in "abcdkm"},
    name="generic",
)


def lecture_formula(text, **names):
    return sympy.sympify(text, locals={"p": P, "q": Q, **names})


def is_constant(formula, variables):
    ring = DifferentialRing([sympy.sympify(formula)], variables)
    return all(ring.is_zero(ring.derivative(ring.elements[0], i)) for i in range(len(variables)))


def agrees_with_modified_field(terms, method, scene, **options):
    """Whether p' = −H̃_q, q' = H̃_p is the modified equation, power by power."""
    field = bs.modified_field(method, scene, len(terms), **options)
    ring = field.formulas.ring
    for k, term in enumerate(terms):
        H, f = ring.element(term), field.formulas.elements(k + 1)
        for p, q in canonical_pairs(scene):
            if not ring.is_zero(f[p] + ring.derivative(H, q)) or not ring.is_zero(f[q] - ring.derivative(H, p)):
                return False
    return True


# The recursion.


def test_equation_25_for_any_hamiltonian_of_one_degree_of_freedom():
    H = sympy.Function("H")(P, Q)
    found = generating_hamiltonian(H_STEP * H, [P], [Q], 3)
    names = {f"H{i}{j}": H.diff(*[P] * i, *[Q] * j) for i in range(3) for j in range(3) if i + j}
    for k in (1, 2):
        expected = lecture_formula(LECTURE["example7_symplectic_euler_eq25"]["H_h^k"][str(k)], **names)
        assert sympy.expand(found[k] - expected) == 0
    wrong = (H.diff(P, 2) * H.diff(Q) ** 2 + H.diff(Q, 2) * H.diff(P) ** 2) / 12  # without 4 H_pq H_p H_q
    assert sympy.expand(found[2] - wrong) != 0


def test_equation_25_for_several_degrees_of_freedom():
    p, q = sympy.symbols("p1:3"), sympy.symbols("q1:3")
    H = sympy.Function("H")(*p, *q)
    found = generating_hamiltonian(H_STEP * H, p, q, 3)
    pairs = [(i, j) for i in range(2) for j in range(2)]
    expected = sum(
        H.diff(p[i], p[j]) * H.diff(q[i]) * H.diff(q[j])
        + H.diff(q[i], q[j]) * H.diff(p[i]) * H.diff(p[j])
        + 4 * H.diff(p[i], q[j]) * H.diff(q[i]) * H.diff(p[j])
        for i, j in pairs
    )
    assert sympy.expand(found[1] + sum(H.diff(x) * H.diff(y) for x, y in zip(p, q, strict=True)) / 2) == 0
    assert sympy.expand(found[2] - expected / 12) == 0


def taylor_recursion(H, p, q, order):
    """(24) as it is printed: S_(j+1) (j + 1) is the coefficient of t^j in H(P, q + ∇_P S), a Taylor polynomial."""
    t, terms = sympy.Dummy("t"), [H]
    for j in range(1, order):
        moved = {y: y + sum(S.diff(x) * t**k for k, S in enumerate(terms, 1)) for x, y in zip(p, q, strict=True)}
        value = H.xreplace(moved).diff(t, j).xreplace({t: sympy.Integer(0)}) / factorial(j)
        terms.append(sympy.expand(value / (j + 1)))
    return terms


@pytest.mark.parametrize(
    ("H", "p", "q", "order"),
    [
        ("p**2/2 - cos(q)", "p", "q", 5),
        ("p**3*q**2/6 + p*q + q**3", "p", "q", 4),
        ("p1**2/2 + p2**2*q1/2 + p1*p2*q2 + q1**2*q2", "p1 p2", "q1 q2", 4),
    ],
)
def test_the_recursion_of_products_gives_what_taylor_polynomials_give(H, p, q, order):
    formula = sympy.sympify(H)
    p, q = ([sympy.Symbol(name) for name in names.split()] for names in (p, q))
    found = exact_generating_function(formula, p, q, order)
    for S, expected in zip(found.terms, taylor_recursion(formula, p, q, order), strict=True):
        assert sympy.simplify(S - expected) == 0
    back = found.hamiltonian()
    assert sympy.simplify(back[0] - formula) == 0
    assert not any(back[1:])


@pytest.mark.parametrize("S", ["p**2/(1 + h*q)", "sin(p*q) + h*exp(q)*p", "p*q*(1 + h)/(1 - h*p)"])
def test_back_and_forth_from_any_generating_function(S):
    S = H_STEP * lecture_formula(S, h=H_STEP)
    terms = generating_hamiltonian(S, [P], [Q], 4)
    modified = sum(term * H_STEP**k for k, term in enumerate(terms))
    found = exact_generating_function(modified, [P], [Q], 4)
    expected = [S.diff(H_STEP, n).subs(H_STEP, 0) / factorial(n) for n in range(1, 5)]
    assert all(sympy.simplify(a - b) == 0 for a, b in zip(found.terms, expected, strict=True))


# Methods.


@pytest.mark.parametrize("scene", [PENDULUM, HENON_HEILES, KEPLER], ids=lambda scene: scene.name)
@pytest.mark.parametrize(
    "name",
    [
        "symplectic-euler-p",
        "symplectic-euler-q",
        "implicit-midpoint",
        "stormer-verlet-kdk",
        "stormer-verlet-dkd",
        "gauss2",
        "lobatto-iiia-iiib3",
    ],
)
def test_the_gradient_is_the_modified_field(name, scene):
    method, order = bs.method(name), 3 if scene is KEPLER else 5
    assert agrees_with_modified_field(generating_terms(method, scene, order), method, scene)


@pytest.mark.parametrize("name", ["gauss3", "gauss4", "qin-zhang", "lobatto-iiie3", "ruth3", "triple-jump4", "gark2"])
def test_more_methods_on_the_pendulum(name):
    method = bs.method(name)
    assert agrees_with_modified_field(generating_terms(method, PENDULUM, 4), method, PENDULUM)


@pytest.mark.parametrize("name", ["symplectic-euler-p", "implicit-midpoint", "stormer-verlet-kdk", "gauss2"])
def test_hamiltonians_that_are_not_separable(name):
    method = bs.method(name)
    assert agrees_with_modified_field(generating_terms(method, NONSEPARABLE, 3), method, NONSEPARABLE)


@pytest.mark.parametrize("name", ["symplectic-euler-q", "implicit-midpoint", "stormer-verlet-dkd"])
def test_hamiltonians_with_symbols(name):
    method = bs.method(name)
    assert agrees_with_modified_field(generating_terms(method, GENERIC, 4), method, GENERIC)


def test_methods_made_of_methods_and_of_parts():
    one, other = bs.method("symplectic-euler-p"), bs.method("symplectic-euler-q")
    composed = bs.composition([(one, "1/3"), (other, "2/3")])
    assert agrees_with_modified_field(generating_terms(composed, NONSEPARABLE, 3), composed, NONSEPARABLE)
    scene = bs.Scene(
        {"p": 1, "q": 1},
        terms=[bs.Term(hamiltonian="p^2/2 + p*q/3", part="a"), bs.Term(hamiltonian="q^2*p - cos(q)", part="b")],
    )
    gauss = bs.method("gauss2")
    additive = bs.PartitionedRungeKutta({"a": gauss, "b": gauss})
    assert agrees_with_modified_field(generating_terms(additive, scene, 3), additive, scene)
    parts = {"a": "p", "b": "q"}
    strang = bs.method("strang")
    assert agrees_with_modified_field(generating_terms(strang, PENDULUM, 3, parts), strang, PENDULUM, parts=parts)


def test_a_method_with_a_parameter():
    theta = bs.PartitionedRungeKutta(
        {"p": {"A": [["1 - x"]], "b": [1]}, "q": {"A": [["x"]], "b": [1]}}, parameters=["x"], name="theta"
    )
    terms = generating_terms(theta, PENDULUM, 3)
    x = sympy.Symbol("x")
    for value, name in ((0, "symplectic-euler-p"), (1, "symplectic-euler-q")):
        expected = generating_terms(bs.method(name), PENDULUM, 3)
        assert all(sympy.simplify(a.subs(x, value) - b) == 0 for a, b in zip(terms, expected, strict=True))


# The lecture.


def test_example_5():
    terms = generating_terms(bs.method("implicit-midpoint"), PENDULUM, 7)
    for k, forms in LECTURE["example5_midpoint_pendulum"]["H_h^k"].items():
        assert is_constant(terms[int(k)] - lecture_formula(forms["fourier"]), [P, Q])
    assert not any(terms[1::2])


@pytest.mark.parametrize(("name", "word"), [("stormer-verlet-kdk", "UTU"), ("stormer-verlet-dkd", "TUT")])
def test_example_6_for_a_generic_separable_hamiltonian(name, word):
    terms = generating_terms(bs.method(name), GENERIC, 5)
    H = GENERIC.hamiltonian
    names = {f"T{k}": H.diff(P, k) for k in range(1, 5)} | {f"U{k}": H.diff(Q, k) for k in range(1, 5)}
    for k in (2, 4):
        expected = lecture_formula(EXAMPLE6["one_dof_general_T(p)+U(q)"][word][f"h^{k}"], **names)
        assert sympy.expand(terms[k] - expected) == 0


def stages_of_midpoint(order):
    """P_1 and Q_1 of the implicit midpoint rule on the pendulum in terms of P and q, by fixed points of SymPy."""
    P1, Q1 = P, Q
    for n in range(1, order + 1):
        P1, Q1 = P + H_STEP / 2 * sympy.sin(Q1), Q + H_STEP / 2 * P1
        P1, Q1 = (sympy.series(x, H_STEP, 0, n + 1).removeO() for x in (P1, Q1))
    return P1, Q1


@pytest.mark.parametrize("sign", [-1, 1])
def test_theorem_5_has_the_minus_sign(sign):
    P1, Q1 = stages_of_midpoint(3)
    S = H_STEP * (P1**2 / 2 - sympy.cos(Q1)) + sign * H_STEP**2 / 2 * sympy.sin(Q1) * P1
    found = generating_hamiltonian(S, [P], [Q], 3)
    expected = generating_terms(bs.method("implicit-midpoint"), PENDULUM, 3)
    agree = all(sympy.simplify(a - b) == 0 for a, b in zip(found, expected, strict=True))
    assert agree is (sign < 0)


@pytest.mark.parametrize("name", ["implicit-midpoint", "gauss2", "stormer-verlet-kdk"])
def test_theorem_5_generates_the_step(name):
    """p − P − S_q and Q − q − S_P of a step in high precision vanish like h^(N+1)."""
    order, method = 4, bs.method(name)
    S = generating_function(method, PENDULUM, order)
    tableaux = method.partitions * (2 // len(method.partitions))
    with mpmath.workdps(50):
        gaps = [step_gap(tableaux, S, h) for h in (Fraction(1, 50), Fraction(1, 100))]
        for coarse, fine in zip(*gaps, strict=True):
            assert order + 0.8 < mpmath.log(coarse / fine, 2) < order + 2.2


def step_gap(tableaux, S, h):
    (a, b), (a_hat, b_hat) = (
        ([[mpmath.mpf(sympy.N(x, 50)) for x in row] for row in t.A], [mpmath.mpf(sympy.N(x, 50)) for x in t.b])
        for t in tableaux
    )
    h, p, q = mpmath.mpf(h.numerator) / h.denominator, mpmath.mpf("0.7"), mpmath.mpf("0.4")
    stages = range(len(b))
    force, velocity = [mpmath.mpf(0) for _ in stages], [mpmath.mpf(0) for _ in stages]
    for _ in range(60):
        momenta = [p + h * mpmath.fdot(a[i], force) for i in stages]
        positions = [q + h * mpmath.fdot(a_hat[i], velocity) for i in stages]
        force, velocity = [-mpmath.sin(x) for x in positions], momenta
    P1, Q1 = p + h * mpmath.fdot(b, force), q + h * mpmath.fdot(b_hat, velocity)
    formula = S.expression(H_STEP)
    values = {H_STEP: sympy.Float(str(h), 50), P: sympy.Float(str(P1), 50), Q: sympy.Float(str(q), 50)}
    S_q, S_P = (mpmath.mpf(formula.diff(x).evalf(50, subs=values)) for x in (Q, P))
    return abs(p - P1 - S_q), abs(Q1 - q - S_P)


# Variational integrators.


def action(kind, potential, q, Q1):
    kinetic = sum((y - x) ** 2 for x, y in zip(q, Q1, strict=True)) / (2 * H_STEP)
    middle = [(x + y) / 2 for x, y in zip(q, Q1, strict=True)]
    mean = potential(*middle) if kind == "midpoint" else (potential(*q) + potential(*Q1)) / 2
    return kinetic - H_STEP * mean


@pytest.mark.parametrize(("kind", "name"), [("midpoint", "implicit-midpoint"), ("trapezoidal", "stormer-verlet-kdk")])
def test_discrete_lagrangians_of_known_methods(kind, name):
    ends = sympy.symbols("Q1 Q2")
    L = action(kind, lambda q: -sympy.cos(q), [Q], ends[:1])
    found = variational_generating_function(L, [Q], ends[:1], [P], 5)
    assert all(
        sympy.simplify(a - b) == 0
        for a, b in zip(found.hamiltonian(), generating_terms(bs.method(name), PENDULUM, 5), strict=True)
    )
    p1, p2, q1, q2 = sympy.symbols("p1 p2 q1 q2")
    L = action(kind, lambda x, y: (x**2 + y**2) / 2 + x**2 * y - y**3 / 3, [q1, q2], ends)
    found = variational_generating_function(L, [q1, q2], ends, [p1, p2], 4)
    expected = generating_function(bs.method(name), HENON_HEILES, 4)
    assert all(sympy.expand(a - b) == 0 for a, b in zip(found.terms, expected.terms, strict=True))


def test_discrete_lagrangian_of_an_unknown_potential():
    """Example 6 for U(q) in general, T quadratic."""
    U, end = sympy.Function("U"), sympy.Symbol("Q")
    L = action("trapezoidal", U, [Q], [end])
    found = variational_generating_function(L, [Q], [end], [P], 5).hamiltonian()
    names = {f"U{k}": U(Q).diff(Q, k) for k in range(1, 5)}
    for k in (2, 4):
        expected = lecture_formula(EXAMPLE6["one_dof_T=p^2/2"]["UTU"][f"h^{k}"], **names)
        assert sympy.expand(found[k] - expected) == 0


@pytest.mark.parametrize(
    ("lagrangian", "velocity", "hamiltonian"),
    [
        ("(1 + q**2)*v**2/2 - cos(q)", None, "p^2/(2*(1 + q^2)) + cos(q)"),
        ("v**2/2 + q**2*v - q**3", None, "(p - q^2)^2/2 + q^3"),
        ("-sqrt(1 - v**2) + cos(q)", "p/sqrt(1 + p**2)", "sqrt(1 + p^2) - cos(q)"),
    ],
)
def test_a_rectangle_rule_for_the_action_is_the_symplectic_euler_method(lagrangian, velocity, hamiltonian):
    end = sympy.Symbol("Q")
    L = H_STEP * lecture_formula(lagrangian, v=(end - Q) / H_STEP)
    solved = None if velocity is None else [lecture_formula(velocity)]
    found = variational_generating_function(L, [Q], [end], [P], 3, velocity=solved)
    scene = bs.Scene({"p": 1, "q": 1}, hamiltonian=hamiltonian)
    expected = generating_terms(bs.method("symplectic-euler-p"), scene, 3)
    assert all(sympy.simplify(a - b) == 0 for a, b in zip(found.hamiltonian(), expected, strict=True))
    assert found.terms[1:] == (0, 0)


# What is refused.


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("rk4", r"rk4 is not: b_i a_ij \+ b_j a_ji = b_i b_j does not hold for i = 1, j = 1"),
        ("explicit-euler", "explicit-euler is not: .* does not hold for i = 1, j = 1"),
        ("trapezoidal", "trapezoidal is not: .* for i = 1, j = 1"),
        ("lobatto-iiia3", "lobatto-iiia3 is not: .* for i = 1, j = 1"),
        ("avf", "must evaluate the field itself only, but k1 of avf does not"),
        ("takahashi-imada", "must evaluate the field itself only"),
        ("blanes-moan4", "must be exact, but the coefficients of blanes-moan4 are decimals"),
    ],
)
def test_methods_without_a_known_generating_function(name, reason):
    with pytest.raises(bs.SeriesError, match=reason):
        generating_terms(bs.method(name), PENDULUM, 3)


def test_the_first_broken_condition_is_named():
    method = bs.RungeKutta([["1/4", 0], ["1/2", "1/3"]], ["1/2", "1/2"], name="nearly", warn=False)  # qin-zhang: 1/4
    with pytest.raises(bs.SeriesError, match=r"nearly is not: .* i = 2, j = 2"):
        generating_terms(method, PENDULUM, 2)
    swapped = bs.PartitionedRungeKutta({"p": {"A": [["1/2"]], "b": [1]}, "q": {"A": [[0]], "b": [1]}}, name="swapped")
    with pytest.raises(bs.SeriesError, match=r"b_i â_ij .* does not hold for i = 1, j = 1"):
        generating_terms(swapped, PENDULUM, 2)
    with pytest.raises(bs.SeriesError, match="b_i = b̂_i does not hold for i = 1"):
        generating_terms(bs.method("gark2"), NONSEPARABLE, 2)
    with pytest.raises(bs.SeriesError, match="flows that kick or drift, but k1 of strang does both"):
        generating_terms(bs.method("strang"), NONSEPARABLE, 2)


@pytest.mark.parametrize("name", ["lotka-volterra", "rigid-body", "linear", "van-der-pol"])
def test_scenes_that_are_not_canonical(name):
    with pytest.raises(bs.SeriesError, match=f"canonical variables p and q, but {name} is not"):
        generating_terms(bs.method("implicit-midpoint"), bs.scene(name), 2)


def test_damping_is_not_hamiltonian():
    with pytest.raises(bs.SeriesError, match="must be Hamiltonian"):
        generating_terms(bs.method("implicit-midpoint"), PENDULUM.with_effects("damping"), 2)


@pytest.mark.parametrize(
    ("S", "reason"),
    [
        (P * Q + H_STEP, "zero for a step of length zero"),
        (P / H_STEP, "a power series in h"),
        (sympy.sqrt(H_STEP) * P, "a power series in h"),
        (0.5 * H_STEP * P, "without floats"),
        ("h*p", "a SymPy expression"),
    ],
)
def test_what_is_no_generating_function(S, reason):
    with pytest.raises(bs.SeriesError, match=f"S must be .*{reason}"):
        generating_hamiltonian(S, [P], [Q], 3)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (([P], [P]), "different SymPy symbols"),
        (([P, Q], [sympy.Symbol("x")]), "positions must be 2, as many as momenta, but were 1"),
        (([], []), "momenta must be a list"),
        ((P, [Q]), "momenta must be a list"),
        (([P], ["q"]), "different SymPy symbols"),
    ],
)
def test_symbols_that_do_not_fit(arguments, reason):
    with pytest.raises(bs.SeriesError, match=reason):
        generating_hamiltonian(H_STEP * P * Q, *arguments, 2)


@pytest.mark.parametrize(
    ("lagrangian", "velocity", "reason"),
    [
        ("h*q", None, "lagrangian must have an invertible matrix"),
        ("1/h", None, "lagrangian must be h times a power series"),
        ("h*sqrt(1 + v**2)", None, "velocity must be given"),
        ("h*v**2/2", ["2*p"], "velocity must solve"),
        ("h*v**2/2", ["p", "p"], "velocity must be a list of 1"),
    ],
)
def test_lagrangians_that_generate_nothing(lagrangian, velocity, reason):
    end = sympy.Symbol("Q")
    L = lecture_formula(lagrangian, v=(end - Q) / H_STEP, h=H_STEP)
    given = velocity and [lecture_formula(x) for x in velocity]
    with pytest.raises(bs.SeriesError, match=reason):
        variational_generating_function(L, [Q], [end], [P], 3, velocity=given)


def test_what_a_generating_function_says():
    S = generating_function(bs.method("symplectic-euler-p"), PENDULUM, 2)
    assert str(S).splitlines() == [
        "generating function of symplectic-euler-p on pendulum",
        "h^1   p**2/2 - cos(q)",
        "h^2   0",
    ]
    assert S.to_dict()["terms"][0] == {"power": 1, "generating_function": "p**2/2 - cos(q)"}
    assert S.hamiltonian() == generating_terms(bs.method("symplectic-euler-p"), PENDULUM, 2)
    assert S.expression(2) == 2 * PENDULUM.hamiltonian
