"""Algebraic stability and SSP coefficients: against the literature, eigenvalues, and a bisection in floating point."""

import math
from fractions import Fraction

import numpy as np
import pytest
import sympy

from bseries.analysis.stability.criteria import (
    is_algebraically_stable,
    linear_order,
    linear_ssp_coefficient,
    ssp_coefficient,
    stability_function,
)
from bseries.analysis.stability.rational_functions import StabilityFunction
from integrators import IntegratorError, RungeKutta, catalogue, method

TABLEAUX = ("explicit", "embedded pair", "diagonally implicit")
NUMERIC = [
    *(e.name for e in catalogue() if e.kind in TABLEAUX and not e.is_family and not e.parameters),
    *(f"{family}{s}" for family in ("gauss", "radau-ia", "radau-iia") for s in (1, 2, 3, 6)),
    *(f"lobatto-iii{letter}{s}" for letter in "abcde" for s in (2, 3, 4)),
]


def arrays(tableau):
    tableau = tableau.to_float()
    return np.array(tableau.A), np.array(tableau.b)


def ssp_two(stages):
    """The optimal explicit method of order 2, with coefficient s − 1."""
    step = Fraction(1, stages - 1)
    rows = [[step if j < i else 0 for j in range(stages)] for i in range(stages)]
    return RungeKutta(rows, [Fraction(1, stages)] * stages)


SSP43 = RungeKutta([[0] * 4, ["1/2", 0, 0, 0], ["1/2", "1/2", 0, 0], ["1/6", "1/6", "1/6", 0]], ["1/6"] * 3 + ["1/2"])
BUTCHER65 = RungeKutta(
    [
        [0] * 6,
        ["1/4", 0, 0, 0, 0, 0],
        ["1/8", "1/8", 0, 0, 0, 0],
        [0, 0, "1/2", 0, 0, 0],
        ["3/16", "-3/8", "3/8", "9/16", 0, 0],
        ["-3/7", "8/7", "6/7", "-12/7", "8/7", 0],
    ],
    ["7/90", 0, "32/90", "12/90", "32/90", "7/90"],
)


# -------------------------------------------------------------------------------------------------- algebraic stability


@pytest.mark.parametrize("s", [1, 2, 3, 6, 15])
def test_families(s):
    """Hairer & Wanner II, Theorem IV.12.9, and IIID and IIIE as symplectic methods with positive weights."""
    stable = ["gauss", "radau-ia", "radau-iia"] + ["lobatto-iiic", "lobatto-iiid", "lobatto-iiie"] * (s > 1)
    assert [is_algebraically_stable(method(f"{family}{s}")) for family in stable] == [True] * len(stable)
    if s > 1:
        assert is_algebraically_stable(method(f"lobatto-iiia{s}")) is False
        assert is_algebraically_stable(method(f"lobatto-iiib{s}")) is False


@pytest.mark.parametrize("name", NUMERIC)
def test_algebraic_stability_by_eigenvalues(name):
    a, b = arrays(method(name))
    matrix = np.diag(b) @ a
    gap = matrix + matrix.T - np.outer(b, b)
    expected = bool(np.linalg.eigvalsh(gap).min() > -1e-12 and b.min() > -1e-12)
    assert is_algebraically_stable(method(name)) is expected


@pytest.mark.parametrize(
    ("gamma", "expected"),
    [("1/4", True), ("1/4 - 1/10^15", False), ("1/2 + sqrt(3)/6", True), ("1/2 - sqrt(3)/6", False), ("1", True)],
)
def test_sdirk_is_algebraically_stable_from_one_quarter(gamma, expected):
    assert is_algebraically_stable(method("sdirk2", gamma=gamma)) is expected


def test_positive_weights_are_needed():
    # M vanishes for two midpoint steps of length 2 and −1, but one goes backwards.
    tableau = RungeKutta([[1, 0], [2, "-1/2"]], [2, -1])
    assert tableau.is_symplectic
    assert is_algebraically_stable(tableau) is False


@pytest.mark.parametrize("name", ["gauss2", "gauss3", "radau-iia2", "lobatto-iiic3"])
def test_perturbations_destroy_algebraic_stability(name):
    tableau = method(name)
    found = []
    for sign in (1, -1):
        rows = [list(row) for row in tableau.A]
        rows[0][1] += Fraction(sign, 10**12)
        found.append(is_algebraically_stable(RungeKutta(rows, tableau.b, warn=False)))
    assert False in found


@pytest.mark.parametrize("name", ["gauss2", "gauss5", "gauss12", "radau-iia3", "lobatto-iiic4", "lobatto-iiia3"])
def test_floats(name):
    exact = method(name)
    tableau = exact.to_float()
    assert is_algebraically_stable(tableau) is is_algebraically_stable(exact)
    rows = [list(row) for row in tableau.A]
    rows[0][0] -= 1e-6
    assert is_algebraically_stable(RungeKutta(rows, tableau.b, warn=False)) is False


def test_decimals():
    digits = [[str(sympy.N(value, 20)) for value in row] for row in (*method("gauss2").A, method("gauss2").b)]
    tableau = RungeKutta(digits[:2], digits[2], digits=19)
    assert is_algebraically_stable(tableau) is True
    assert is_algebraically_stable(RungeKutta(digits[:2], digits[2])) is False


def test_symbols():
    assert is_algebraically_stable(method("sdirk2")) is None
    assert is_algebraically_stable(method("explicit3")) is False
    assert ssp_coefficient(method("sdirk2")) is None
    assert linear_ssp_coefficient(method("explicit3")) is None


# ------------------------------------------------------------------------------------------------------------------ SSP


@pytest.mark.parametrize(
    ("tableau", "expected"),
    [
        # Kraaijevanger 1991; Gottlieb, Ketcheson, Shu 2011; nodepy's test suite
        (method("explicit-euler"), 1),
        (method("heun2"), 1),
        (method("ssprk33"), 1),
        (method("ssprk104"), 6),
        (ssp_two(4), 3),
        (ssp_two(7), 6),
        (SSP43, 2),
        (method("rk4"), 0),
        (method("explicit-midpoint"), 0),
        (method("dormand-prince54"), 0),
        (method("implicit-euler"), math.inf),
        (method("radau-iia1"), math.inf),
        (method("implicit-midpoint"), 2),
        (method("gauss1"), 2),
        (method("trapezoidal"), 2),
        (method("lobatto-iiia2"), 2),
        (method("qin-zhang"), 4),
        (method("gauss2"), 0),
        (method("radau-iia2"), 0),
        (method("gauss20"), 0),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_known_ssp_coefficients(tableau, expected):
    found = ssp_coefficient(tableau)
    assert found == expected
    assert type(found) is (float if expected == math.inf else Fraction)


def test_an_irrational_coefficient():
    """The optimal singly diagonally implicit method of order 3: C = 1 + √3 (Ketcheson, Macdonald, Gottlieb 2009)."""
    tableau = RungeKutta([["1/2 - sqrt(3)/6", 0], ["sqrt(3)/3", "1/2 - sqrt(3)/6"]], ["1/2", "1/2"])
    assert linear_order(tableau) == 3
    found = ssp_coefficient(tableau)
    assert type(found) is float
    assert found == pytest.approx(1 + math.sqrt(3), rel=1e-15)


def feasible(tableau, r):
    a, b = arrays(tableau)
    size = len(b) + 1
    k = np.zeros((size, size))
    k[:-1, :-1], k[-1, :-1] = a, b
    try:
        inverse = np.linalg.inv(np.eye(size) + r * k)
    except np.linalg.LinAlgError:
        return False
    return (k @ inverse).min() > -1e-12 and (r * k @ inverse).sum(axis=1).max() < 1 + 1e-12


def bisected(tableau):
    """The coefficient by bisection in floating point."""
    low, high = 0.0, 50.0
    if feasible(tableau, high):
        return math.inf
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if feasible(tableau, middle) else (low, middle)
    return low


@pytest.mark.few(12)
@pytest.mark.parametrize("name", [n for n in NUMERIC if "lobatto" not in n or n[-1] in "23"])
def test_ssp_coefficients_by_bisection(name):
    assert ssp_coefficient(method(name)) == pytest.approx(bisected(method(name)), abs=1e-4)


@pytest.mark.parametrize("seed", range(25))
def test_random_nonnegative_tableaux(seed):
    numbers = np.random.default_rng(seed)
    size = int(numbers.integers(1, 5))
    rows = numbers.integers(0, 4, size=(size, size)).tolist()
    if seed % 2:
        rows = [[value if j < i else 0 for j, value in enumerate(row)] for i, row in enumerate(rows)]
    tableau = RungeKutta(
        [[Fraction(v, 5) for v in row] for row in rows],
        [Fraction(int(v), 5) for v in numbers.integers(1, 4, size=size)],
        warn=False,
    )
    found = ssp_coefficient(tableau)
    assert found == pytest.approx(bisected(tableau), rel=1e-6, abs=1e-4)
    # Exact results are feasible, and nothing beyond them is.
    if 0 < found < 50:
        assert feasible(tableau, float(found) * (1 - 1e-9))
        assert not feasible(tableau, float(found) * (1 + 1e-5))


def test_inexact_ssp_coefficients():
    for name, expected in (("ssprk33", 1), ("ssprk104", 6), ("rk4", 0), ("implicit-midpoint", 2)):
        found = ssp_coefficient(method(name).to_float())
        assert type(found) is float
        assert found == pytest.approx(expected, rel=1e-12)
    assert ssp_coefficient(method("implicit-euler").to_float()) == math.inf
    assert ssp_coefficient(method("tsit5")) == 0


@pytest.mark.parametrize(
    ("tableau", "expected"),
    [
        (BUTCHER65, Fraction(16, 9)),
        (method("rk4"), 1),
        (method("kutta3"), 1),
        (method("heun2"), 1),
        (method("explicit-euler"), 1),
        (method("ssprk104"), 6),
        (ssp_two(5), 4),
        (StabilityFunction([1, 1, "3/8", "1/16", "1/256"]), 4),  # four Euler steps of length 1/4
        (StabilityFunction([1, 2, "-1"]), 0),
        (StabilityFunction([1]), math.inf),
    ],
    ids=str,
)
def test_threshold_factors(tableau, expected):
    assert linear_ssp_coefficient(tableau) == expected


def test_threshold_factor_of_butchers_method_needs_its_order():
    assert linear_order(BUTCHER65) == 5


@pytest.mark.parametrize("name", ["rk4", "ssprk33", "verner65", "dormand-prince54", "merson4", "nystrom5"])
def test_threshold_factors_are_no_smaller_than_ssp_coefficients(name):
    tableau = method(name)
    factor = linear_ssp_coefficient(tableau)
    assert factor >= ssp_coefficient(tableau)
    # R(z) = Σ γ_k (1 + z/r)^k with γ_k = R^(k)(−r) r^k / k!: all positive below the factor, and not above.
    z = sympy.Symbol("z")
    for change, holds in ((Fraction(999, 1000), True), (Fraction(1001, 1000), False)):
        r = sympy.Rational((factor * change).numerator, (factor * change).denominator)
        powers = sympy.Poly(sympy.expand(stability_function(tableau)(r * (z - 1))), z)
        assert all(a >= 0 for a in powers.all_coeffs()) is holds


def test_threshold_factors_of_implicit_methods_are_not_decided():
    assert linear_ssp_coefficient(method("gauss2")) is None


@pytest.mark.parametrize("ask", [is_algebraically_stable, ssp_coefficient])
@pytest.mark.parametrize("bad", [None, 3, StabilityFunction([1])])
def test_bad_methods(ask, bad):
    with pytest.raises(IntegratorError, match="method must be a RungeKutta, but was"):
        ask(bad)
    with pytest.raises(IntegratorError, match="a partitioned method needs y' = λy split first"):
        ask(method("symplectic-euler-p"))
