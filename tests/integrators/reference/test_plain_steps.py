"""Plain steps: orders of the whole catalogue, sources' formulas, closed forms, geometry, and what is refused."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pytest
import taylor_oracle
from method_definitions import CASES, POINT, second_order_fields, start
from mpmath import mpf
from power_series_oracle import add, coefficients, random_field, run

from bseries.analysis.stability.criteria import stability_function
from integrators import IntegratorError, ProgramBuilder, RungeKutta, catalogue, composition, method
from integrators.reference.plain_steps import block_parts, plain_step, plain_steps

LINEAR = [{(1, 0): Fraction(1, 3), (0, 1): Fraction(-1, 2)}, {(1, 0): Fraction(1), (0, 1): Fraction(1, 5)}]


def distance(x, y):
    return max(abs(a - b) for a, b in zip(x, y, strict=True))


def real(x):
    return mpf(x.numerator) / x.denominator


def functions(fields):
    """What `plain_step` wants, from polynomials by part."""
    return {name: taylor_oracle.function(field) for name, field in fields.items()}


def oscillator(y):
    return [-y[1], y[0]]


# Orders of the catalogue

VALUES = {
    "explicit2": {"alpha": "1/3"},
    "explicit3": {"c2": "1/3", "c3": "3/4"},
    "sdirk2": {"gamma": "1/3"},
    "sdirk2-general": {"gamma": "1/3", "c2": "2/5"},
    "ros2": {"gamma": "1/3"},
    "ros2-w": {"gamma": "1/3"},
}
COARSE = {
    "tsit5": 30,
    "dormand-prince87": 5,
    "blanes-moan4": 40,
    "grk4a": 20,
    "grk4t": 40,
    "berland64": 20,
    "toulorge-desmet84": 20,
}
"""1/h for published decimals: the local error must stand out from what their last digits spoil."""
LONGEST = 15
"""Flows; `test_high_order_compositions` has the orders of all by words, `test_measured_orders` by steps."""


def claimed_methods():
    for entry in (entry for entry in catalogue() if entry.kind != "multistep"):
        for stages in range(entry.least_stages, entry.least_stages + 3) if entry.is_family else [None]:
            order = entry.order
            if isinstance(order, str):
                factor, _, shift = order.partition("s")
                order = int(factor) * stages + int(shift or 0)
            marks = [pytest.mark.slow] * (entry.kind == "splitting" and entry.stages > LONGEST)
            yield pytest.param(entry, stages, order, id=f"{entry.name}{stages or ''}", marks=marks)


def built(entry, stages):
    return method(f"{entry.name}{stages or ''}", **VALUES.get(entry.name, {}))


@cache
def suitable_fields(kind, velocity):
    """Polynomial fields by part that a kind of methods is made for, nonlinear and coupled as far as it allows."""
    whole = random_field(8)
    if kind in ("nystrom", "nystrom splitting", "force gradient"):
        return second_order_fields(velocity=velocity)
    if kind == "partitioned":
        return {"p": [whole[0], {}], "q": [{}, whole[1]]}
    if kind == "w-method":
        return {"f": whole, "W": LINEAR}
    if kind == "exponential":
        return {"L": LINEAR, "N": whole}
    if kind == "splitting":
        return {"a": random_field(4), "b": random_field(5)}
    if kind in ("additive", "implicit-explicit"):
        return {"p": random_field(4), "q": random_field(5)}
    return {"": whole}


@cache
def exact_series(kind, velocity, digits):
    """The Taylor series of the exact solution: long enough for h = 10^-5, or for the larger h of decimals."""
    fields = suitable_fields(kind, velocity)
    parts = [field for name, field in fields.items() if name != "W"]
    total = [add(*components) for components in zip(*parts, strict=True)]
    with mpmath.workdps(75):
        y = [real(x) for x in POINT[: len(total)]]
        return taylor_oracle.taylor(total, y, 16 if digits is None else 28)


def local_errors(made, kind, steps, *, velocity=False, digits):
    """The errors of single steps of some sizes."""
    fields = functions(suitable_fields(kind, velocity))
    if kind in ("additive", "implicit-explicit"):
        fields = dict(zip(made.names, fields.values(), strict=True))
    series = exact_series(kind, velocity, made.digits)
    y = POINT[: len(series)]
    with mpmath.workdps(75):
        ends = [(h, plain_step(made, fields, y, h, digits=digits)) for h in steps]
        return [distance(end, taylor_oracle.at(series, real(h))) for h, end in ends]


def slope(coarse, fine):
    return mpmath.log(coarse / fine, 2)


@pytest.mark.few(20)
@pytest.mark.parametrize(("entry", "stages", "order"), [*claimed_methods()])
def test_local_error_has_the_claimed_order(entry, stages, order):
    made = built(entry, stages)
    velocity = entry.name.endswith("general") and entry.kind == "nystrom"
    if made.digits is None:
        h = Fraction(1, 10**5)
        found = slope(*local_errors(made, entry.kind, [h, h / 2], velocity=velocity, digits=60))
    else:
        h = Fraction(1, COARSE.get(entry.name, 100))
        coarse, middle, fine = local_errors(made, entry.kind, [h, h / 2, h / 4], digits=35)
        found = 2 * slope(middle, fine) - slope(coarse, middle)  # extrapolated to h = 0
    assert abs(found - (order + 1)) < 0.05


def test_order_of_a_misprinted_method_is_lower():
    rk4 = method("rk4")
    A = [*rk4.A[:3], [0, 0, Fraction(99, 100), 0]]
    h = Fraction(1, 10**5)
    assert slope(*local_errors(RungeKutta(A, rk4.b), "", [h, h / 2], digits=60)) < 2.05


# The sources' formulas, as power series in h


def partial_sum(series, h):
    return [sum(real(x) * h**k for k, x in enumerate(row)) for row in series]


@pytest.mark.few(5)
@pytest.mark.parametrize("name", CASES)
def test_step_agrees_with_the_formulas_of_its_source(name):
    """Through h⁵, methods in general position; `wrong` misreads the source slightly."""
    case = CASES[name]
    y = POINT[: len(next(iter(case.fields.values())))]
    expected, wrong = (coefficients(step(case.fields, start(case))) for step in (case.step, case.wrong))
    found = plain_step(case.method, functions(case.fields), y, "1/10^8", digits=60)
    with mpmath.workdps(60):
        h = mpf(10) ** -8
        assert distance(found, partial_sum(expected, h)) < h**5 / 1000
        assert distance(found, partial_sum(wrong, h)) > h**5 / 1000


@pytest.mark.parametrize("name", CASES)
def test_doubles_agree_with_thirty_digits(name):
    case = CASES[name]
    y = POINT[: len(next(iter(case.fields.values())))]
    exact = plain_step(case.method, functions(case.fields), y, "1/50", digits=30)
    found = plain_step(case.method, functions(case.fields), y, "1/50")
    assert found.dtype == float
    assert distance(found, exact) < 1e-14


def etdrk2():
    """Cox and Matthews (2002), formula (22)."""
    builder = ProgramBuilder(["L", "N"])
    y = builder.y
    k1 = builder.field(y, "N")
    a = y + builder.flow(y, "L", forcing=[k1])
    k2 = builder.field(a, "N")
    return builder.program(y + builder.flow(y, "L", forcing=[k1, k2 - k1]))


def average_with_powers():
    builder = ProgramBuilder(["L", "N"])
    k1 = builder.field(builder.y)
    k2 = builder.average([builder.y, k1 / 2, k1], "N", power=2)
    return builder.program(builder.y + k1 + k2 * 3)


def coupled_derivatives():
    """A linear system of two evaluations, at different points."""
    builder = ProgramBuilder(["L", "N"])
    first, second = builder.unknowns(2)
    k = builder.field(builder.y, "N")
    builder.derivative(builder.y, k + second / 2, "N", into=first)
    builder.derivative(builder.y + k / 3, k - first + second / 4, "N", into=second)
    return builder.program(builder.y + k + first + second * 2)


@pytest.mark.parametrize("program", [etdrk2(), average_with_powers(), coupled_derivatives()], ids=range(3))
def test_programs_of_ones_own(program):
    fields = {"L": LINEAR, "N": random_field(7)}
    series = coefficients(run(program, fields, start(CASES["lawson"])))
    found = plain_step(program, functions(fields), POINT[:2], "1/10^8", digits=60)
    with mpmath.workdps(60):
        assert distance(found, partial_sum(series, mpf(10) ** -8)) < 1e-43


# Closed forms


def test_explicit_euler_by_hand():
    y, h = np.array([0.3, -0.7]), 0.1
    assert list(plain_step(method("explicit-euler"), lambda y: [y[1] ** 2, np.sin(y[0])], y, h)) == [
        0.3 + h * 0.7**2,
        -0.7 + h * np.sin(0.3),
    ]


PENDULUM = block_parts(lambda y: [-np.sin(y[1]), y[0]], {"p": [0], "q": [1]})


@pytest.mark.parametrize("form", ["kdk", "dkd"])
def test_stormer_verlet_by_hand(form):
    p, q, h = 0.4, 1.1, 0.2
    if form == "kdk":
        half = p - h / 2 * np.sin(q)
        q1 = q + h * half
        p1 = half - h / 2 * np.sin(q1)
    else:
        half = q + h / 2 * p
        p1 = p - h * np.sin(half)
        q1 = half + h / 2 * p1
    found = plain_step(method(f"stormer-verlet-{form}"), PENDULUM, [p, q], h)
    assert distance(found, (p1, q1)) < 3e-16
    other = plain_step(method(f"stormer-verlet-{'dkd' if form == 'kdk' else 'kdk'}"), PENDULUM, [p, q], h)
    assert distance(other, (p1, q1)) > 1e-5


@pytest.mark.parametrize("h", [0.1, 40.0])
def test_implicit_midpoint_on_a_linear_system_is_a_linear_solve(h):
    """Fixed-point iteration converges for the small step only, Newton's method for both."""
    matrix, y = np.array([[-1.0, 2.0, 0.5], [0.0, -3.0, 1.0], [0.25, 0.0, -0.5]]), np.array([1.0, -1.0, 2.0])
    expected = np.linalg.solve(np.eye(3) - h / 2 * matrix, y + h / 2 * matrix @ y)
    assert distance(plain_step(method("implicit-midpoint"), lambda y: matrix @ y, y, h), expected) < 4e-15


TABLEAUX = [
    pytest.param(entry, stages, id=f"{entry.name}{stages or ''}")
    for entry, stages, _ in (case.values for case in claimed_methods())
    if entry.is_tableau and entry.kind not in ("partitioned", "implicit-explicit")
]


@pytest.mark.few(14)
@pytest.mark.parametrize(("entry", "stages"), TABLEAUX)
def test_linear_problems_show_the_stability_function(entry, stages):
    made = built(entry, stages)
    R = stability_function(made)
    for z in (Fraction(1, 3), Fraction(-7, 2)):
        (found,) = plain_step(made, lambda y: [y[0] * -1], [1], -z, digits=30)
        with mpmath.workdps(30):
            value = R(z)
            value = mpmath.mpmathify(value.evalf(35) if hasattr(value, "evalf") else value)
            assert abs(found - value) < (1e-27 if made.digits is None else 1e-13) * max(1, abs(value))
    a, b = -0.8, 1.7
    found = plain_step(made, lambda y: [a * y[0] - b * y[1], b * y[0] + a * y[1]], [1, 0], 1)
    assert abs(complex(*found) - R(complex(a, b))) < 1e-13


def test_stiff_decay():
    decay = plain_step(method("implicit-euler"), lambda y: [-1e9 * y[0]], [1], 1)
    growth = plain_step(method("implicit-euler"), lambda y: [1e9 * (1 - y[0])], [0], 1)
    assert abs(decay[0] - 1 / (1 + 1e9)) < 3e-16
    assert abs(growth[0] - 1e9 / (1 + 1e9)) < 3e-16


def test_lawson_euler_is_exact_for_the_linear_part():
    h = mpf(3) / 10
    fields = {"L": lambda y: [-y[1], y[0]], "N": lambda y: [0, 0]}
    found = plain_step(method("lawson-euler"), fields, [1, 0], "3/10", digits=40)
    with mpmath.workdps(40):
        h = mpf(3) / 10
        assert distance(found, [mpmath.cos(h), mpmath.sin(h)]) < 1e-39


def test_flows_may_be_given():
    """y' = y², y(t) = y/(1 − ty), and a constant field."""
    fields = {"a": lambda y: [y[0] ** 2], "b": lambda y: [2]}
    computed = plain_step(method("strang"), fields, [0.5], 0.25)
    calls = []

    def riccati(y, t):
        calls.append(t)
        return y / (1 - t * y)

    given = plain_step(method("strang"), fields, [0.5], 0.25, flows={"a": riccati})
    assert distance(computed, given) < 1e-15
    assert calls == [0.125, 0.125]


def test_derivatives_may_be_given():
    exact = plain_step(method("tdrk5"), lambda y: [y[0] ** 2], [0.5], 0.25, derivative=lambda y, v: 2 * y * v)
    computed = plain_step(method("tdrk5"), lambda y: [y[0] ** 2], [0.5], 0.25)
    assert distance(exact, computed) < 2e-16
    wrong = plain_step(method("tdrk5"), lambda y: [y[0] ** 2], [0.5], 0.25, derivative=lambda y, v: 0 * v)
    assert distance(exact, wrong) > 1e-3


def test_kahan_is_linearly_implicit_for_quadratic_fields():
    """y' = y² becomes (y1 − y0)/h = y0 y1."""
    (found,) = plain_step(method("kahan"), lambda y: y**2, [0.5], 0.25)
    assert found == pytest.approx(0.5 / (1 - 0.125), rel=1e-15)


def test_midpoint_rule_on_its_modifying_field_is_the_exact_flow():
    """For y' = y² let y1 = y0 + h y0 y1 and m = (y0 + y1)/2. Then g = y0 y1 solves g = m² − h² g²/4."""
    h = mpf(1) / 5

    def modifying(m):
        return [2 * (mpmath.sqrt(1 + h**2 * m[0] ** 2) - 1) / h**2]

    with mpmath.workdps(60):
        h = mpf(1) / 5
    found = plain_steps(method("implicit-midpoint"), modifying, ["1/2"], h, 5, digits=50)
    with mpmath.workdps(50):
        assert distance(found[0], [1 / (2 - mpf(n) / 5) for n in range(6)]) < 1e-48
    plain = plain_steps(method("implicit-midpoint"), lambda y: y**2, ["1/2"], h, 5, digits=50)
    assert abs(plain[0, -1] - 1) > 1e-3


def test_many_stages_by_their_algebra():
    (found,) = plain_step(method("gauss10"), lambda y: [mpmath.cos(y[0])], [0], "1/20", digits=40)
    with mpmath.workdps(40):
        h = mpf(1) / 20
        assert abs(found - 2 * mpmath.atan(mpmath.tanh(h / 2))) < 1e-39


def test_compositions_of_lowered_methods():
    euler = method("explicit-euler")
    made = composition([(euler, Fraction(1, 2)), (euler, Fraction(1, 2))])
    once = plain_steps(euler, oscillator, [1, 0], 0.1, 2)
    assert distance(plain_step(made, oscillator, [1, 0], 0.2), once[:, -1]) < 1e-16


# Geometry


def hamiltonian_parts(y):
    """H = (p₁² + p₂²)/2 + q₁² q₂ + (q₁⁴ + q₂³)/4."""
    p1, p2, q1, q2 = y
    return [-(2 * q1 * q2 + q1**3), -(q1**2 + 3 * q2**2 / 4), p1, p2]


def defect_of_symplecticity(made, fields):
    """The largest entry of Φ′ᵀ J Φ′ − J, with Φ′ by central differences."""
    width, columns = mpf(10) ** -12, []
    with mpmath.workdps(40):
        for i in range(4):
            ends = []
            for sign in (1, -1):
                y = [real(x) for x in POINT]
                y[i] += sign * width
                ends.append(plain_step(made, fields, y, "1/2", digits=40))
            columns.append((ends[0] - ends[1]) / (2 * width))
        return max(
            abs(a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1] - (j == i + 2) + (i == j + 2))
            for i, a in enumerate(columns)
            for j, b in enumerate(columns)
        )


BLOCKS = block_parts(hamiltonian_parts, {"p": [0, 1], "q": [2, 3]})


@pytest.mark.parametrize(
    ("name", "fields", "symplectic"),
    [
        ("implicit-midpoint", hamiltonian_parts, True),
        ("gauss3", hamiltonian_parts, True),
        ("stormer-verlet", BLOCKS, True),
        ("symplectic-euler-q", BLOCKS, True),
        ("takahashi-imada", BLOCKS, True),
        ("triple-jump4", {"a": BLOCKS["p"], "b": BLOCKS["q"]}, True),
        ("simplified-takahashi-imada", BLOCKS, False),
        ("trapezoidal", hamiltonian_parts, False),
        ("rk4", hamiltonian_parts, False),
    ],
)
def test_symplecticity(name, fields, symplectic):
    defect = defect_of_symplecticity(method(name), fields)
    assert defect < 1e-19 if symplectic else defect > 1e-7


@pytest.mark.parametrize(
    ("name", "fields", "symmetric"),
    [
        ("implicit-midpoint", hamiltonian_parts, True),
        ("lobatto-iiia3", hamiltonian_parts, True),
        ("gauss4", hamiltonian_parts, True),
        ("avf", hamiltonian_parts, True),
        ("stormer-verlet-dkd", BLOCKS, True),
        ("takahashi-imada", BLOCKS, True),
        ("yoshida6", {"a": BLOCKS["p"], "b": BLOCKS["q"]}, True),
        ("rk4", hamiltonian_parts, False),
        ("radau-iia2", hamiltonian_parts, False),
        ("symplectic-euler-p", BLOCKS, False),
    ],
)
@pytest.mark.parametrize("digits", [None, 30])
def test_steps_back_and_forth(name, fields, symmetric, digits):
    y = ["3/10", "-1/5", "2/5", "1/2"]
    there = plain_step(method(name), fields, y, "1/2", digits=digits)
    back = plain_step(method(name), fields, there, "-1/2", digits=digits)
    assert distance(there, back) > 0.1
    with mpmath.workdps(30):
        gap = distance(back, [mpf(3) / 10, mpf(-1) / 5, mpf(2) / 5, mpf(1) / 2])
    assert gap < (1e-15 if digits is None else 1e-28) if symmetric else gap > 1e-6


def test_averaged_vector_field_preserves_energy():
    def energy(y):
        p1, p2, q1, q2 = y
        return (p1**2 + p2**2) / 2 + q1**2 * q2 + (q1**4 + q2**3) / 4

    found = plain_steps(method("avf"), hamiltonian_parts, [0.3, -0.2, 0.4, 0.5], 0.25, 10)
    assert np.ptp([energy(y) for y in found.T]) < 1e-15
    other = plain_steps(method("implicit-midpoint"), hamiltonian_parts, [0.3, -0.2, 0.4, 0.5], 0.25, 10)
    assert np.ptp([energy(y) for y in other.T]) > 1e-7


# Several steps


@pytest.mark.parametrize("digits", [None, 20])
def test_steps_are_single_steps(digits):
    y = [Fraction(1, 3), 0]
    found = plain_steps(method("rk4"), oscillator, y, "1/7", 3, digits=digits)
    assert found.shape == (2, 4)
    for n in range(3):
        y = plain_step(method("rk4"), oscillator, y, "1/7", digits=digits)
        assert list(found[:, n + 1]) == list(y)
    assert plain_steps(method("rk4"), oscillator, [1, 0], 0.1, 0).tolist() == [[1.0], [0.0]]


def test_fields_may_write_into_their_argument():
    def careless(y):
        y[0] = 99
        return [1, 2]

    assert plain_step(method("rk4"), careless, [1, 0], 1).tolist() == pytest.approx([2, 2])


def test_numbers_of_many_kinds():
    y = [np.float64(0.5), np.int64(2), "1/4", Fraction(3, 8), mpf("0.125")]
    expected = [0.5, 2.0, 0.25, 0.375, 0.125]
    for digits in (None, 25):
        assert plain_step(method("rk4"), lambda y: [0] * 5, y, 1, digits=digits).tolist() == expected


# What is refused

RK4 = method("rk4")
STRANG = method("strang")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"method": "rk4"}, "method must be a method, but was 'rk4'"),
        ({"method": method("sdirk2")}, "parameters must have values before a step, but gamma had none"),
        ({"field": 3}, "field must be a function, but was 3"),
        ({"field": {"p": oscillator}}, "field must be a function, but has one for 'p'"),
        ({"field": lambda y: 3}, "field must be a sequence, but was 3"),
        ({"field": lambda y: [1, 2, 3]}, r"field must give 2 numbers, but gave \[1, 2, 3\]"),
        ({"field": lambda y: [1, "x"]}, "field must give numbers, but gave 'x'"),
        ({"field": lambda y: [1, float("nan")]}, "k1 of rk4 must be finite, but was 0.1, nan with h = 0.1"),
        ({"field": lambda y: [1 / (y[0] * 0).item(), 1]}, "k1 of rk4 must be finite, but was nan, nan"),
        ({"field": lambda y: [np.sqrt(y[0] - 2), 1j]}, "k1 of rk4 must be finite, but was nan, nan"),
        ({"field": lambda y: y**9, "y": [1e9, 1]}, "k2 of rk4 must be finite, but was inf"),
        ({"field": lambda y: [mpmath.exp(y[0]), 0], "y": [9, 0], "digits": 20}, "k3 of rk4 must be finite"),
        ({"field": lambda y: [float(y[0]) / 3, 0], "digits": 20}, "field must compute with mpmath for 20 digits"),
        ({"y": []}, "y must hold at least one number, but was empty"),
        ({"y": 3}, "y must be a sequence, but was 3"),
        ({"y": [1, None]}, r"y\[2\] must be a real number or a formula, but was None"),
        ({"y": [1, 10**400]}, r"y\[2\] must be a finite number, but was 1000"),
        ({"h": float("inf")}, "h must be a finite number, but was inf"),
        ({"h": mpf("nan"), "digits": 20}, "h must be a finite number, but was nan"),
        ({"h": "x"}, "h must be a formula, but 'x' has the unknown name"),
        ({"digits": 0}, "digits must be an integer from 1 to 1000, but was 0"),
        ({"digits": 2.5}, "digits must be an integer from 1 to 1000, but was 2.5"),
        ({"derivative": 3}, "derivative must be a function, but was 3"),
        ({"method": STRANG}, "field must be a function for each of the parts a, b, but was <function.*block_parts"),
        ({"method": STRANG, "field": [oscillator]}, "field must be a function for each of the parts a, b, but was"),
        ({"method": STRANG, "field": {"a": oscillator}}, "for each of the parts a, b, but for b was None"),
    ],
)
def test_bad_arguments(changes, message):
    arguments = {"method": RK4, "field": oscillator, "y": [1, 2], "h": 0.1, **changes}
    with pytest.raises(IntegratorError, match=message):
        plain_step(**arguments)


@pytest.mark.parametrize("digits", [None, 30])
def test_huge_steps_are_refused(digits):
    """y1 = 1 + h y1² has no real solution for h > 1/4."""
    message = (
        "h must be small enough to solve for k1 of implicit-euler, but was 1000.*: neither fixed-point .* converged"
    )
    with pytest.raises(IntegratorError, match=message):
        plain_step(method("implicit-euler"), lambda y: y**2, [1], 1000, digits=digits)
    with pytest.raises(IntegratorError, match=r"h must be small enough to solve for k2 of rosenbrock-euler, but was 1"):
        plain_step(method("rosenbrock-euler"), lambda y: y, [1], 1, digits=digits)


def test_stiff_steps_need_newton():
    """Van der Pol's oscillator with ε = 1e-6: a fixed-point iteration would explode."""
    stiff = lambda y: [y[1], 1e6 * ((1 - y[0] ** 2) * y[1] - y[0])]  # noqa: E731
    found = plain_step(method("radau-iia3"), stiff, [2, -0.66], 0.1)
    assert found == pytest.approx([1.9316, -0.7070], abs=1e-3)


def test_flows_beyond_a_blow_up_are_refused():
    fields = {"a": lambda y: [y[0] ** 2], "b": lambda y: [0]}
    with pytest.raises(IntegratorError, match="flow must converge to 16 digits, but did not, or does not exist"):
        plain_step(method("lie-trotter"), fields, [1], 2)


def test_averages_over_kinks_are_refused():
    with pytest.raises(IntegratorError, match="for k1 of avf, but was 1: average of field must converge to 16 digits"):
        plain_step(method("avf"), lambda y: [1 + abs(y[0])], [-0.3], 1)


@pytest.mark.parametrize(
    ("field", "digits", "message"),
    [
        (lambda y: [y[0].real ** 2], None, "derivative must be given for this field: two ways"),
        (lambda y: [abs(y[0] - 0.3)], None, "derivative must be given for this field: two ways"),
        (lambda y: [float(mpmath.sin(y[0].item()))], None, "derivative must be given, as field does not take complex"),
        (lambda y: [mpmath.mpf(mpmath.nstr(mpmath.sin(y[0]), 20))], 20, "derivative must be given for this field"),
    ],
)
def test_derivatives_that_cannot_be_computed_are_refused(field, digits, message):
    with pytest.raises(IntegratorError, match=message):
        plain_step(method("tdrk4"), field, ["1/3"], 0.1, digits=digits)


def test_the_failing_step_is_named():
    with pytest.raises(
        IntegratorError, match="k1 of explicit-euler must be finite, but was inf with h = 1, in step 10"
    ):
        plain_steps(method("explicit-euler"), lambda y: y**2, [2], 1, 50)
    with pytest.raises(IntegratorError, match="steps must be 0, 1, 2, …, but was -1"):
        plain_steps(RK4, oscillator, [1, 0], 0.1, -1)


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ({"p": [0], "q": [0]}, "blocks must hold 0, 1, … once each, but were"),
        ({"p": [0], "q": ["1"]}, "blocks must hold 0, 1, … once each, but were"),
        ({"p": 0, "q": [1]}, r"blocks\[p\] must be a sequence, but was 0"),
        ([[0], [1]], "blocks must map parts to components, but was"),
        ({"p": [0], "q": [2, 1]}, "blocks must hold 2 components, but held 3"),
    ],
)
def test_bad_blocks(blocks, message):
    with pytest.raises(IntegratorError, match=message):
        plain_step(method("stormer-verlet"), block_parts(oscillator, blocks), [1, 0], 0.1)
