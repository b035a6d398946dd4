"""The reference solution against closed forms, other methods in high precision, conserved quantities, and itself."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy as np
import power_series_oracle
import pytest
import sympy
import taylor_oracle

from integrators import IntegratorError, Scene
from integrators.compile.scene_source import compiled_scene
from integrators.exact.expressions import ELEMENTARY
from integrators.reference import solution as reference
from integrators.reference import taylor_series
from integrators.reference.solution import reference_solution
from integrators.scenes.catalogue.registry import scene

GROWTH = Scene({"y": 1}, field={"y": "y"}, start={"y": [1]})
PENDULUM = scene("pendulum")


@pytest.fixture(autouse=True)
def precise():
    with mpmath.workdps(50):
        yield


def quadrature(formula):
    """A scene whose solution y(t) is the integral of a formula of t from 0."""
    return Scene({"y": 1}, field={"y": formula}, start={"y": [0]})


def kepler(t, e):
    """Momenta and positions at a time since the perihelion, by Kepler's equation."""
    anomaly = mpmath.findroot(lambda x: x - e * mpmath.sin(x) - t, t + e * mpmath.sin(t))
    axis, distance = mpmath.sqrt(1 - e * e), 1 - e * mpmath.cos(anomaly)
    sine, cosine = mpmath.sin(anomaly), mpmath.cos(anomaly)
    return [-sine / distance, axis * cosine / distance, cosine - e, axis * sine]


def largest_difference(found, expected):
    return max(abs(x - y) for x, y in zip(found, expected, strict=True))


def assert_close(solution, expected, tolerance):
    """All digits agree, and the stated error is honest: not below the true one, and not useless."""
    difference = np.abs(solution.numbers() - np.array(expected))
    assert np.all(difference < tolerance)
    assert np.all(difference <= solution.error)
    assert np.all(solution.error < 20 * tolerance)


def test_kepler():
    times = [0, 1, Fraction(21, 2), 200, 1256]
    exact = [kepler(mpmath.mpf(Fraction(t).numerator) / Fraction(t).denominator, mpmath.mpf(3) / 5) for t in times]
    solution = reference_solution(scene("kepler"), times, full=True)
    assert_close(solution, np.array(exact).T, 2e-26)
    assert np.array_equal(solution.high, reference_solution(scene("kepler"), times))


CIRCLE = scene("kepler"), [0, 1, 1, 0], lambda t: [-mpmath.sin(t), mpmath.cos(t), mpmath.cos(t), mpmath.sin(t)]
SPIRAL = Scene({"x": 1, "y": 1}, field={"x": "-x/3 - y", "y": "x - y/3"})
DRIVEN = Scene({"y": 1}, field={"y": "cos(t) - 3*y"})


@pytest.mark.parametrize(
    ("system", "start", "exact"),
    [
        CIRCLE,
        (SPIRAL, [1, 0], lambda t: [mpmath.exp(-t / 3) * mpmath.cos(t), mpmath.exp(-t / 3) * mpmath.sin(t)]),
        (DRIVEN, [0, 0], lambda t: [(3 * mpmath.cos(t) + mpmath.sin(t) - 3 * mpmath.exp(-3 * t)) / 10]),
    ],
    ids=["a circle", "a spiral", "driven"],
)
@pytest.mark.parametrize("times", [[1], [1000], [Fraction(k, 7) for k in range(1, 150)]], ids=["1", "1000", "many"])
def test_stated_errors_are_not_below_the_true_ones(system, start, exact, times):
    solution = reference_solution(system, times, y0=start, full=True)
    with mpmath.workdps(250):
        expected = np.array([exact(mpmath.mpf(Fraction(t).numerator) / Fraction(t).denominator) for t in times]).T
        assert np.all(np.abs(solution.numbers()[: len(expected)] - expected) <= solution.error[: len(expected)])


@pytest.mark.parametrize(("power", "steps"), [(8, r"5\.0e\+07"), (12, r"4\.\de\+11")])
def test_work_that_would_take_minutes_is_refused(power, steps):
    decay = Scene({"y": 1}, field={"y": f"-10^{power}*y"}, start={"y": [1]})
    refusal = rf"t must end sooner, as .* that 1 would take about {steps} of them, and at most 3\.9e\+06 are allowed"
    with pytest.raises(IntegratorError, match=refusal):
        reference_solution(decay, 1)
    assert abs(reference_solution(decay, [10.0**-power])[0, 0] - np.exp(-1)) < 1e-16


def test_doubles_are_correctly_rounded():
    found = reference_solution(scene("kepler"), [1, 2, 3])
    assert found.tolist() == np.array([kepler(t, mpmath.mpf(3) / 5) for t in (1, 2, 3)]).T.astype(float).tolist()


def test_harmonic_oscillator():
    oscillator = Scene({"p": 1, "q": 1}, hamiltonian="(p^2 + q^2)/2", start={"p": [0], "q": [1]})
    times = np.linspace(0, 100, 7)
    expected = [[-mpmath.sin(float(t)) for t in times], [mpmath.cos(float(t)) for t in times]]
    assert_close(reference_solution(oscillator, times, full=True), expected, 1e-29)


@pytest.mark.parametrize(
    ("formula", "start", "exact"),
    [
        ("y", 1, mpmath.exp),
        ("y^2", 1, lambda t: 1 / (1 - t)),
        ("y^3", 1, lambda t: 1 / mpmath.sqrt(1 - 2 * t)),
        ("1/y", 1, lambda t: mpmath.sqrt(1 + 2 * t)),
        ("y*(1 - y)", "1/3", lambda t: 1 / (1 + 2 * mpmath.exp(-t))),
        ("exp(-y)", 0, lambda t: mpmath.log(1 + t)),
        ("cbrt(y)", 1, lambda t: (1 + 2 * t / 3) ** mpmath.mpf("1.5")),
        ("y^(3/2)", 1, lambda t: (1 - t / 2) ** -2),
        ("y^(-7/2)", 1, lambda t: (1 + 9 * t / 2) ** (mpmath.mpf(2) / 9)),
        ("sqrt(1 - y^2)", 0, mpmath.sin),
        ("y*log(y)", 2, lambda t: 2 ** mpmath.exp(t)),
        ("1", "1/7", lambda t: t + mpmath.mpf(1) / 7),
        ("0", "1/7", lambda t: mpmath.mpf(1) / 7),
    ],
)
def test_scalar_equations(formula, start, exact):
    times = ["1/10", "0.35", 0.45]
    solution = reference_solution(Scene({"y": 1}, field={"y": formula}, start={"y": [start]}), times, full=True)
    expected = [[exact(x) for x in (mpmath.mpf(1) / 10, mpmath.mpf("0.35"), mpmath.mpf(0.45))]]
    assert_close(solution, expected, 1e-30)


@pytest.mark.parametrize("name", ELEMENTARY)
def test_elementary_functions(name):
    inner = "1 + (2 + t)^2" if name == "acosh" else "sin(2*t)/2 + 1/3"
    solution = reference_solution(quadrature(f"{name}({inner})"), "3/2", full=True)

    def integrand(t):
        u = 1 + (2 + t) ** 2 if name == "acosh" else mpmath.sin(2 * t) / 2 + mpmath.mpf(1) / 3
        return getattr(mpmath, name)(u)

    assert_close(solution, [[mpmath.quad(integrand, [0, 0.5, 1, 1.5])], [mpmath.mpf("1.5")]], 1e-30)


@pytest.mark.parametrize(
    ("formula", "function"),
    [
        ("2^t", lambda t: 2**t),
        ("(1 + t)^t", lambda t: (1 + t) ** t),
        ("(1 + t)^sqrt(2)", lambda t: (1 + t) ** mpmath.sqrt(2)),
        ("(2 - t)^(1/3)*(1 + t^2)^(-5/4)", lambda t: mpmath.cbrt(2 - t) * (1 + t * t) ** mpmath.mpf("-1.25")),
        ("sqrt(2)*cos(t)^5/(3 + t)^7", lambda t: mpmath.sqrt(2) * mpmath.cos(t) ** 5 / (3 + t) ** 7),
        ("1/(1 + t^24)", lambda t: 1 / (1 + t**24)),
    ],
)
def test_powers(formula, function):
    solution = reference_solution(quadrature(formula), 1.5, full=True)
    expected = mpmath.quad(function, [0, 0.5, 0.75, 1, 1.25, 1.5], maxdegree=8)
    assert_close(solution, [[expected], [mpmath.mpf("1.5")]], 1e-28)


@pytest.mark.parametrize("seed", range(3))
def test_polynomial_fields_by_their_power_series(seed):
    polynomials = power_series_oracle.random_field(seed, dimension=3)
    names = ("x", "y", "z")

    def text(polynomial):
        terms = [
            "*".join([f"({c})", *(f"{v}^{n}" for v, n in zip(names, e, strict=True))]) for e, c in polynomial.items()
        ]
        return " + ".join(terms)

    start = [Fraction(1, 3), Fraction(-1, 2), Fraction(1, 5)]
    system = Scene({"u": list(names)}, field=dict(zip(names, map(text, polynomials), strict=True)), start={"u": start})
    series = taylor_oracle.taylor(polynomials, [mpmath.mpf(x.numerator) / x.denominator for x in start], 60)
    expected = taylor_oracle.at(series, mpmath.mpf(1) / 128)
    assert_close(reference_solution(system, "1/128", full=True), [[x] for x in expected], 1e-31)


def test_pendulum_by_another_integrator():
    with mpmath.workdps(22):
        solve = mpmath.odefun(lambda t, y: [-mpmath.sin(y[1]), y[0]], 0, [mpmath.mpf(0), mpmath.mpf("-1.5")])
        expected = solve(0.5)
    found = reference_solution(PENDULUM, 0.5, full=True).numbers()[:, 0]
    assert largest_difference(found, expected) < 1e-20


def test_numbers_in_formulas_count_with_all_their_digits(monkeypatch):
    def difference():
        system = Scene({"y": 1}, field={"y": "sqrt(2)*y"}, start={"y": [1]})
        return abs(reference_solution(system, 1, full=True).numbers()[0, 0] - mpmath.exp(mpmath.sqrt(2)))

    assert difference() < 1e-30
    monkeypatch.setattr(taylor_series, "WORKING_DIGITS", 20)
    assert difference() > 1e-24


def test_outer_solar_system_by_another_integrator():
    integrate = pytest.importorskip("scipy.integrate")
    system = scene("outer-solar-system")
    field = compiled_scene(system).field

    def right_hand_side(t, y):
        field(y, out := np.empty_like(y))
        return out

    found = reference_solution(system, [1000, 5000])
    other = integrate.solve_ivp(
        right_hand_side, (0, 5000), system.y0, "DOP853", t_eval=[1000, 5000], rtol=1e-13, atol=1e-22
    )
    assert np.abs(found / other.y - 1).max() < 1e-10
    positions = np.abs(found - other.y)[18:]
    assert positions.max() < 1e-12 * np.abs(found).max()


CONSERVATIVE = [
    ("outer-solar-system", 20_000),
    ("lennard-jones", 1),
    ("toda", 20),
    ("henon-heiles", 20),
    ("kepler", 50),
]


@pytest.mark.parametrize(("name", "end"), CONSERVATIVE)
def test_first_integrals_stay_and_time_can_be_reversed(name, end):
    system = scene(name)
    solution = reference_solution(system, [0, end / 2, end], full=True).numbers()
    energy = sympy.lambdify(system.symbols, system.hamiltonian, "mpmath", cse=True, dummify=True)
    energies = [energy(*y) for y in solution.T]
    assert all(abs(found / energies[0] - 1) < 1e-28 for found in energies)
    back = reference_solution(system, [end / 2, 0], y0=list(solution[:, -1]), t0=end, full=True).numbers()
    for found, expected in zip(back.T, solution.T[1::-1], strict=True):
        assert largest_difference(found, expected) < 1e-28 * max(abs(expected)) * end


def test_other_times_have_no_influence():
    alone = reference_solution(PENDULUM, 10, full=True)
    among = reference_solution(PENDULUM, [0, *np.linspace(0, 10, 101)], full=True)
    assert among.numbers()[:, -1].tolist() == alone.numbers()[:, 0].tolist()
    assert among.high[:, 0].tolist() == [0, -1.5]


def test_calls_of_compiled_code_have_no_influence(monkeypatch):
    whole = reference_solution(PENDULUM, [3, 10], full=True)
    monkeypatch.setattr(reference, "WORK", 0)  # one step in each
    assert reference_solution(PENDULUM, [3, 10], full=True).numbers().tolist() == whole.numbers().tolist()


def test_time_that_formulas_name():
    forced = Scene({"y": 1}, field={"y": "cos(t)*y"}, start={"y": [1]})
    later = mpmath.exp(mpmath.sin(3) - mpmath.sin(2))
    assert_close(reference_solution(forced, 3, t0=2, full=True), [[later], [3]], 1e-30)
    assert_close(reference_solution(forced, 3, y0=[1, 2], full=True), [[later], [3]], 1e-30)
    assert_close(reference_solution(forced, 2, full=True), [[mpmath.exp(mpmath.sin(2))], [2]], 1e-30)
    with pytest.raises(IntegratorError, match="t0 must be the variable t of y0, 2, but was 1"):
        reference_solution(forced, 3, t0=1, y0=[1, 2])


@pytest.mark.parametrize(
    ("start", "exact"),
    [
        (3, 3),
        (0.1, Fraction(0.1)),
        (np.float64(0.1), Fraction(0.1)),
        ("0.1", Fraction(1, 10)),
        (Decimal("0.1"), Fraction(1, 10)),
        (Fraction(1, 10), Fraction(1, 10)),
        (sympy.sqrt(2), None),
        ("sqrt(2)", None),
    ],
)
def test_starts_are_exact(start, exact):
    number = mpmath.sqrt(2) if exact is None else mpmath.mpf(exact.numerator) / exact.denominator
    found = reference_solution(GROWTH, [0, 1], y0=[start], full=True).numbers()[0]
    assert largest_difference(found, [number, number * mpmath.e]) < 2e-31 * number


def test_numbers_of_mpmath_keep_their_digits():
    start = 1 + mpmath.mpf(2) ** -90
    assert reference_solution(GROWTH, [0], y0=[start], full=True).numbers()[0, 0] == start


def test_fewer_digits_are_fewer():
    errors = []
    for digits in (5, 15, 25):
        found = reference_solution(PENDULUM, 10, digits=digits, full=True).numbers()[:, 0]
        errors.append(largest_difference(found, reference_solution(PENDULUM, 10, full=True).numbers()[:, 0]))
        assert errors[-1] < 10.0 ** (2 - digits)
    assert errors[0] > 1e5 * errors[1] > 1e10 * errors[2]


def test_chaos_is_seen():
    lorenz = scene("lorenz")
    solution = reference_solution(lorenz, [10, 30, 60], full=True)
    errors = solution.error.max(axis=0)
    assert errors[0] < 1e-27
    assert errors[2] > 1e-14
    with pytest.raises(IntegratorError, match=r"before 60, where x is only known within .* but reached to 60"):
        reference_solution(lorenz, [10, 30, 60])
    assert reference_solution(lorenz, [10, 30]).tolist() == solution.high[:, :2].tolist()


def test_variables_that_vanish_by_symmetry_are_no_error(monkeypatch):
    hexagon = scene("lennard-jones", particles=7, temperature=0)
    assert np.abs(reference_solution(hexagon, 20)[:2]).max() < 1e-28  # the atom in the middle
    monkeypatch.setattr(reference, "NOISE", 0)
    with pytest.raises(IntegratorError, match="is only known within"):
        reference_solution(hexagon, 20)


@pytest.mark.parametrize(
    ("formula", "start", "end"),
    [("y^2", 1, "1"), ("-1/y", "1/4", "0.03125"), ("tan(y)", 1, r"0\.1726"), ("sqrt(y)", 0, "0"), ("y^(1/3)", -1, "0")],
)
def test_solutions_that_end(formula, start, end):
    system = Scene({"y": 1}, field={"y": formula})
    with pytest.raises(IntegratorError, match=f"^t must end before {end}.*, beyond which .* could not be continued"):
        reference_solution(system, ["1/100", 2], y0=[start])


def test_solutions_near_their_end():
    found = reference_solution(Scene({"y": 1}, field={"y": "y^2"}), [1 - 2**-10, 1 - 2**-40], y0=[1])
    assert found.tolist() == [[2**10, 2**40]]


@pytest.mark.parametrize("start", ["pi/2", sympy.pi / 2, "acos(0)", None])
def test_starts_and_times_have_all_digits_of_formulas(start):
    scene = PENDULUM.with_start(p=[0], q=["pi/2"])
    found = reference_solution(scene, "exp(1)", y0=None if start is None else [0, start], full=True)
    with mpmath.workdps(60):
        expected = reference_solution(scene, mpmath.e + 0, y0=[0, mpmath.pi / 2], full=True)
    assert (found.high == expected.high).all()
    assert (found.low == expected.low).all()
    rounded = reference_solution(scene, "exp(1)", y0=[0, np.pi / 2], full=True)
    assert (found.low != rounded.low).any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"t": []}, "t must have at least one time, but had none"),
        ({"t": [1, 0.5]}, r"t must go in one direction from t0, but t\[2\] is 0.5 and comes after 1.0"),
        ({"t": [-1, 0.5]}, r"t must go in one direction from t0, but t\[1\] is -1.0 and comes after 0.0"),
        ({"t": [1], "t0": 2, "y0": [0, 0, 0]}, "y0 must have a number for each variable, 2, but had 3"),
        ({"t": [float("nan")]}, r"t\[1\] must be a finite number, but was nan"),
        ({"t": mpmath.inf}, r"numbers must be finite, but one was \+inf"),
        ({"t": "1e400"}, r"t\[1\] must be at most 10\^300 in size, but was 1e400"),
        ({"t": None}, r"t\[1\] must be a real number or a formula, but was None"),
        ({"t": 1, "y0": 5}, "y0 must be a sequence, but was 5"),
        ({"t": 1, "y0": ["a", 1]}, r"y0\[1\] must be a number, but has the unknown name 'a'"),
        ({"t": 1, "y0": [sympy.Symbol("a"), 1]}, r"y0\[1\] must be a number, but has the symbol 'a'"),
        ({"t": 1, "y0": [1j, 1]}, r"y0\[1\] must be a real number or a formula"),
        (
            {"t": 1, "y0": ["sqrt(2) + sqrt(3) - sqrt(5 + 2*sqrt(6))", 1]},
            "must be distinguishable from zero, but one was",
        ),
        ({"t": 1, "digits": 0}, "digits must be a whole number from 1 to 31, but was 0"),
        ({"t": 1, "digits": 32}, "digits must be a whole number from 1 to 31, but was 32"),
        ({"t": 1, "digits": 1.0}, "digits must be a whole number from 1 to 31, but was 1.0"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(IntegratorError, match=message):
        reference_solution(PENDULUM, **arguments)


def test_scenes_without_numbers_are_refused():
    with pytest.raises(IntegratorError, match=r"parameters.k must be a number .* but was a symbol"):
        reference_solution(Scene({"y": 1}, field={"y": "k*y"}, parameters={"k": "k"}, start={"y": [1]}), 1)
    with pytest.raises(IntegratorError, match="y0 must be given, as scene has no start, but was not"):
        reference_solution(Scene({"y": 1}, field={"y": "y"}), 1)
    with pytest.raises(IntegratorError, match=r"formula must have numbers in the range of doubles, but has 1\.0e"):
        reference_solution(Scene({"y": 1}, field={"y": "10^400*y"}, start={"y": [1]}), 1)


def test_scenes_with_too_many_terms_are_refused(monkeypatch):
    monkeypatch.setattr(taylor_series, "MAX_OPERATIONS", 100)
    with pytest.raises(IntegratorError, match="must take at most 100 operations for its Taylor series, but takes more"):
        reference_solution(scene("outer-solar-system"), 1)
