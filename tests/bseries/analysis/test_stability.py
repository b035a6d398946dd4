"""Linear stability: against Padé's table, the literature, and the tableau evaluated in floating point."""

import copy
import json
import math
import pickle
from fractions import Fraction
from math import comb, factorial

import numpy as np
import pytest
import sympy

from bseries.analysis.report import tableau_properties
from bseries.analysis.stability.criteria import (
    dispersion_order,
    dissipation_order,
    e_polynomial,
    imaginary_stability_interval,
    is_a_stable,
    is_i_stable,
    is_l_stable,
    linear_order,
    real_stability_interval,
    stability_angle,
    stability_function,
)
from bseries.analysis.stability.rational_functions import StabilityFunction
from integrators import IntegratorError, PartitionedRungeKutta, RungeKutta, catalogue, method
from integrators.exact.expressions import parse_expression

TABLEAUX = ("explicit", "embedded pair", "diagonally implicit")
NUMERIC = [
    *(e.name for e in catalogue() if e.kind in TABLEAUX and not e.is_family and not e.parameters),
    *(f"{family}{s}" for family in ("gauss", "radau-ia", "radau-iia") for s in (1, 2, 3, 5)),
    *(f"lobatto-iii{letter}{s}" for letter in "abcde" for s in (2, 3, 5)),
]
A_STABLE = [
    *(f"{family}{s}" for family in ("gauss", "radau-ia", "radau-iia") for s in (1, 2, 3, 7, 20)),
    *(f"lobatto-iii{letter}{s}" for letter in "abcde" for s in (2, 3, 6, 12)),
    *("implicit-euler", "implicit-midpoint", "trapezoidal", "crouzeix3", "crouzeix4", "qin-zhang"),
]
A_STABLE_L = ["wso-dirk643", "kennedy-carpenter-esdirk32", "kennedy-carpenter-esdirk43"]
"""Stiffly accurate, so that they are L-stable, too."""


def pade(k, j):
    """The Padé approximant of exp with numerator of degree k and denominator of degree j (Hairer & Wanner II, IV.3)."""
    above = [Fraction(comb(k, i) * factorial(j + k - i), factorial(j + k)) for i in range(k + 1)]
    below = [Fraction((-1) ** i * comb(j, i) * factorial(j + k - i), factorial(j + k)) for i in range(j + 1)]
    return tuple(above), tuple(below)


def chebyshev(s):
    """The polynomial T_s(1 + z/s²), which touches ±1 inside its stability interval of length 2 s²."""
    z = sympy.Symbol("z")
    polynomial = sympy.Poly(sympy.chebyshevt(s, 1 + z / s**2), z)
    return StabilityFunction([*reversed(polynomial.all_coeffs())])


def direct(tableau, z):
    a, b = np.array(tableau.A, dtype=float), np.array(tableau.b, dtype=float)
    return 1 + z * b @ np.linalg.solve(np.eye(len(b)) - z * a, np.ones(len(b)))


# ---------------------------------------------------------------------------------------------- the function itself


@pytest.mark.parametrize("name", NUMERIC)
def test_against_the_definition_in_floating_point(name):
    tableau = method(name)
    R = stability_function(tableau)
    points = np.array([0.3 - 0.2j, -1.1 + 0.7j, 0.4j, -2.5, -7 + 5j, 1e-3])
    expected = [direct(tableau.to_float(), z) for z in points]
    np.testing.assert_allclose(R(points), expected, rtol=1e-8)
    assert [R(complex(z)) for z in points] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("s", [1, 2, 3, 5, 12, 20])
def test_pade_table(s):
    tables = {
        "gauss": (s, s),
        "radau-ia": (s - 1, s),
        "radau-iia": (s - 1, s),
        "lobatto-iiia": (s - 1, s - 1),
        "lobatto-iiib": (s - 1, s - 1),
        "lobatto-iiic": (s - 2, s),
    }
    for family, (k, j) in tables.items():
        if s == 1 and family.startswith("lobatto"):
            continue
        R = stability_function(method(f"{family}{s}"))
        assert (R.numerator, R.denominator) == pade(k, j), family
        assert linear_order(R) == k + j


def test_tableau_in_radicals_and_stage_algebra_agree():
    for name in ("gauss2", "radau-iia2", "radau-ia2", "gauss3"):
        algebra = method(name)
        radicals = RungeKutta(algebra.A, algebra.b, algebra.c)
        assert radicals.algebra is None
        assert stability_function(radicals) == stability_function(algebra)


def test_lowest_terms():
    # An unused implicit stage, and a method that is equivalent to Euler's, leave no trace.
    unused = RungeKutta([[0, 0], [0, "1/3"]], [1, 0])
    assert stability_function(unused).denominator == (1,)
    twice = RungeKutta([["1/2", 0], [0, "1/2"]], ["1/4", "3/4"])
    assert stability_function(twice) == stability_function(method("implicit-midpoint"))
    assert StabilityFunction([2, 1], [2, 1]).numerator == (1,)
    assert StabilityFunction([2, 1], [2]).numerator == (1, Fraction(1, 2))


def test_values():
    R = stability_function(method("implicit-midpoint"))
    assert R(Fraction(1)) == 3
    assert R(-2) == 0
    assert R.at_infinity == -1
    assert R(math.inf) == -1
    assert R(1e300) == R(-1e300) == -1
    assert type(R(1)) is Fraction
    assert R(sympy.Symbol("w")) == (1 + sympy.Symbol("w") / 2) / (1 - sympy.Symbol("w") / 2)
    assert R([0, -2]).tolist() == [1, 0]
    assert R(np.zeros((2, 3))).shape == (2, 3)
    assert stability_function(method("rk4"))(1e200) == math.inf
    assert stability_function(method("rk4")).at_infinity == math.inf
    assert StabilityFunction([])(0.5) == 0
    radau = stability_function(method("radau-iia3"))
    assert radau.at_infinity == 0
    assert radau(-1e200) == pytest.approx(-3e-200)


def test_poles_are_inverse_eigenvalues():
    R = stability_function(method("gauss5"))
    eigenvalues = np.linalg.eigvals(np.array(method("gauss5").to_float().A))
    assert len(R.poles) == 5
    assert all(min(abs(pole - 1 / a) for a in eigenvalues) < 1e-10 for pole in R.poles)
    assert sum(R.poles) == pytest.approx(sum(1 / eigenvalues))
    assert stability_function(method("qin-zhang")).poles == (4, 4)
    assert stability_function(method("rk4")).poles == ()
    gamma = 0.5 + math.sqrt(3) / 6
    assert stability_function(method("crouzeix3")).poles == pytest.approx([1 / gamma, 1 / gamma], rel=1e-15)
    assert len(stability_function(method("gauss20")).poles) == 20


def test_text():
    assert str(stability_function(method("rk4"))) == "1 + z + z^2/2 + z^3/6 + z^4/24"
    gauss = stability_function(method("gauss2"))
    assert str(gauss) == "(1 + z/2 + z^2/12)/(1 - z/2 + z^2/12)"
    assert repr(gauss) == f"StabilityFunction({gauss})"
    assert gauss.to_latex() == r"\frac{1 + \frac{1}{2} z + \frac{1}{12} z^{2}}{1 - \frac{1}{2} z + \frac{1}{12} z^{2}}"
    assert gauss._repr_latex_() == f"${gauss.to_latex()}$"
    assert str(StabilityFunction([1, 0, Fraction(-2, 3)])) == "1 - 2*z^2/3"
    assert str(StabilityFunction([])) == "0"
    assert str(stability_function(method("tsit5"))).startswith("1 + z + 0.5*z^2 + 0.16666666")
    assert str(stability_function(method("heun2").to_float())) == "1 + z + 0.5*z^2"
    assert stability_function(method("tsit5")).digits == method("tsit5").digits


@pytest.mark.parametrize("name", ["rk4", "gauss3", "crouzeix3", "sdirk2", "sdirk2-general"])
def test_text_is_read_back(name):
    R = stability_function(method(name))
    names = ["z", *R.parameters]
    z = sympy.Symbol("z")
    assert sympy.simplify(parse_expression(str(R), names=names) - R(z)) == 0


def test_functions_are_values():
    for name in ("rk4", "gauss3", "crouzeix3", "sdirk2", "tsit5"):
        R = stability_function(method(name))
        assert pickle.loads(pickle.dumps(R)) == copy.deepcopy(R) == R
        assert hash(R) == hash(stability_function(method(name)))
    assert stability_function(method("gauss2")) != stability_function(method("gauss3"))
    with pytest.raises(AttributeError, match="immutable"):
        stability_function(method("rk4")).p = ()


def test_symbols():
    R = stability_function(method("sdirk2"))
    gamma = sympy.Symbol("gamma")
    assert R.parameters == ("gamma",)
    assert R.denominator == (1, -2 * gamma, gamma**2)
    assert sympy.expand(R.numerator[2] - (gamma**2 - 2 * gamma + sympy.Rational(1, 2))) == 0
    # E(y) = (4γ − 1)(2γ − 1)² y⁴/4: A-stable exactly for γ ≥ 1/4 (Hairer & Wanner II, Table IV.6.3).
    *zeros, last = e_polynomial(R)
    assert zeros == [0] * 4
    assert sympy.expand(last - (4 * gamma - 1) * (2 * gamma - 1) ** 2 / 4) == 0
    assert (is_a_stable(R), is_l_stable(R), is_i_stable(R)) == (None, None, None)
    assert (real_stability_interval(R), imaginary_stability_interval(R), stability_angle(R)) == (None, None, None)
    assert (linear_order(R), dispersion_order(R), dissipation_order(R)) == (2, 2, 3)
    explicit = method("explicit3")
    assert str(stability_function(explicit)) == "1 + z + z^2/2 + z^3/6"
    assert (is_a_stable(explicit), stability_angle(explicit)) == (False, 0.0)
    assert linear_order(method("explicit2")) == 2
    mixed = RungeKutta([["sqrt(3)*gamma"]], [1], parameters=["gamma"])
    assert stability_function(mixed).denominator == (1, -sympy.sqrt(3) * gamma)


# -------------------------------------------------------------------------------------------------- A- and L-stability


@pytest.mark.parametrize("name", A_STABLE + A_STABLE_L)
def test_a_stable_methods(name):
    R = stability_function(method(name))
    assert is_a_stable(R) is is_i_stable(R) is True
    is_damped = name == "implicit-euler" or name.startswith(("radau", "lobatto-iiic")) or name in A_STABLE_L
    assert is_l_stable(R) is is_damped
    assert (stability_angle(R), real_stability_interval(R), imaginary_stability_interval(R)) == (90, math.inf, math.inf)
    assert (dissipation_order(R) is None) is (R.at_infinity in (1, -1))


@pytest.mark.parametrize("name", [e.name for e in catalogue() if e.kind in ("explicit", "embedded pair")])
def test_explicit_methods_are_not(name):
    tableau = method(name)
    assert (is_a_stable(tableau), is_l_stable(tableau), is_i_stable(tableau)) == (False, False, False)


@pytest.mark.parametrize(
    ("gamma", "a_stable", "l_stable"),
    [
        ("1/4", True, False),
        ("24999/100000", False, False),
        ("1 - sqrt(2)/2", True, True),
        ("1 + sqrt(2)/2", True, True),
        ("1 - sqrt(2)/2 + 1/10^12", True, False),
        ("1/2 + sqrt(3)/6", True, False),
        ("1/2 - sqrt(3)/6", False, False),
        ("-1", False, False),
        ("1", True, False),
    ],
)
def test_sdirk_with_two_stages(gamma, a_stable, l_stable):
    tableau = method("sdirk2", gamma=gamma)
    assert is_a_stable(tableau) is a_stable
    assert is_l_stable(tableau) is l_stable


@pytest.mark.parametrize("seed", range(40))
def test_random_methods_by_sampling(seed):
    """Collocation at random nodes, and random diagonally implicit methods: |R| on the axis, poles as eigenvalues."""
    numbers = np.random.default_rng(seed)
    size = int(numbers.integers(1, 5))
    nodes = sorted({Fraction(int(c), 12) for c in numbers.integers(3, 16, size=size)})
    size = len(nodes)
    if seed % 2:
        x = sympy.Symbol("x")
        basis = [
            sympy.Poly(sympy.prod([(x - d) / sympy.Rational(str(c - d)) for d in nodes if d != c]), x) for c in nodes
        ]
        integrals = [cardinal.integrate() for cardinal in basis]
        tableau = RungeKutta([[f.eval(c) for f in integrals] for c in nodes], [f.eval(1) for f in integrals])
    else:
        rows = [[nodes[i] if i == j else Fraction(i - j, 7) * (j < i) for j in range(size)] for i in range(size)]
        tableau = RungeKutta(rows, [Fraction(1, size)] * size)
    R = stability_function(tableau)
    axis = np.abs(R(1j * np.geomspace(1e-2, 1e6, 40001))).max()
    eigenvalues = np.linalg.eigvals(np.array(tableau.to_float().A))
    assert is_i_stable(R) is bool(axis < 1 + 1e-9)
    assert is_a_stable(R) is bool(axis < 1 + 1e-9 and eigenvalues.real.min() > 0)
    assert is_l_stable(R) is bool(is_a_stable(R) and abs(R(1e12)) < 1e-9)


def test_ehle():
    """Padé approximants are A-stable exactly for k ≤ j ≤ k + 2 (Ehle's conjecture: Wanner, Hairer, Nørsett 1978)."""
    for k in range(5):
        for j in range(8):
            R = StabilityFunction(*pade(k, j))
            assert is_a_stable(R) is (k <= j <= k + 2), (k, j)
            assert is_l_stable(R) is (k < j <= k + 2), (k, j)


def test_poles_count_too():
    # |R| = 1 on the imaginary axis, but the poles lie on the wrong side; on the axis itself; and both sides.
    reflected = StabilityFunction([1, "-1/2"], [1, "1/2"])
    assert (is_i_stable(reflected), is_a_stable(reflected)) == (True, False)
    assert is_i_stable(StabilityFunction([1], [1, 0, 1])) is False
    both = StabilityFunction([1, 0, -4], [1, 0, "-4"])
    assert both.denominator == (1,)
    saddle = StabilityFunction([1], [1, 0, -1])
    assert (is_i_stable(saddle), is_a_stable(saddle)) == (True, False)
    assert stability_angle(saddle) == 0


@pytest.mark.parametrize("name", ["gauss2", "gauss3", "lobatto-iiie3"])
@pytest.mark.parametrize("sign", [1, -1])
def test_perturbed_methods_of_marginal_stability(name, sign):
    """R(∞) = ±1, and a change of one weight moves it off the unit circle in one of the two directions."""
    tableau = method(name)
    change = Fraction(sign, 10**9)
    perturbed = RungeKutta(tableau.A, [tableau.b[0] + change, tableau.b[1] - change, *tableau.b[2:]], warn=False)
    limit = stability_function(perturbed).at_infinity
    assert 0 < abs(abs(float(limit)) - 1) < 1e-6
    if abs(float(limit)) > 1:
        assert is_a_stable(perturbed) is False
        assert is_i_stable(perturbed) is False
    assert dissipation_order(perturbed) is not None


@pytest.mark.parametrize("name", ["gauss", "radau-iia", "lobatto-iiia", "lobatto-iiic"])
@pytest.mark.parametrize("s", [2, 3, 6])
def test_floats_count_what_they_cannot_show_as_zero(name, s):
    tableau = method(f"{name}{s}").to_float()
    R, exact = stability_function(tableau), stability_function(method(f"{name}{s}"))
    assert is_a_stable(R) is True
    for ask in (is_l_stable, linear_order, dispersion_order, dissipation_order):
        assert ask(R) == ask(exact)
    assert {type(a) for a in R.numerator} == {float}
    assert R.numerator == pytest.approx(exact.numerator)
    weights = [tableau.b[0] + 1e-3, tableau.b[1] - 1e-3, *tableau.b[2:]]
    off = [is_a_stable(RungeKutta(tableau.A, w, warn=False)) for w in (weights, [2 * b for b in tableau.b])]
    assert False in off


def test_large_inexact_methods_are_refused():
    with pytest.raises(IntegratorError, match="at most 10 stages if implicit and not exact, but had 12"):
        stability_function(method("gauss12").to_float())
    facts = tableau_properties(method("gauss12").to_float())
    assert facts["a_stable"] is None
    assert "at most 10 stages" in facts["undecided"]["a_stable"]
    assert facts["algebraically_stable"] is True


def test_fields_of_high_degree_are_left_undecided():
    root = "sqrt(2) + sqrt(3) + sqrt(5) + sqrt(7) + sqrt(11)"
    tableau = RungeKutta([[root]], [1])
    R = stability_function(tableau)
    assert R(0.5) == pytest.approx(direct(tableau.to_float(), 0.5))
    assert (is_a_stable(R), real_stability_interval(R)) == (None, None)
    assert tableau_properties(tableau)["undecided"]["a_stable"] == "the tableau has roots of too high a degree"


# ---------------------------------------------------------------------------------------------- intervals and sectors


@pytest.mark.parametrize(
    ("name", "real", "imaginary"),
    [
        # nodepy's test suite and Hairer & Wanner II, §IV.2
        ("explicit-euler", 2, 0),
        ("explicit-midpoint", 2, 0),
        ("kutta3", 2.51274532661833, math.sqrt(3)),
        ("rk4", 2.78529356340528, math.sqrt(8)),
        ("rk38", 2.78529356340528, math.sqrt(8)),
        ("implicit-euler", math.inf, math.inf),
    ],
)
def test_known_intervals(name, real, imaginary):
    assert real_stability_interval(method(name)) == pytest.approx(real, rel=1e-13)
    assert imaginary_stability_interval(method(name)) == pytest.approx(imaginary, rel=1e-15)


@pytest.mark.parametrize("s", [1, 2, 3, 4, 7, 10])
def test_chebyshev_polynomials_touch_one_and_stay(s):
    R = chebyshev(s)
    assert real_stability_interval(R) == 2 * s**2
    above = StabilityFunction([*R.numerator[:1], R.numerator[1] * (1 + Fraction(1, 10**9)), *R.numerator[2:]])
    assert s == 1 or real_stability_interval(above) < 2 * s**2 - 1


@pytest.mark.few(8)
@pytest.mark.parametrize(
    "name", [n for n in NUMERIC if n not in A_STABLE + A_STABLE_L and not n.startswith(("gauss", "rad", "lob"))]
)
def test_intervals_by_sampling(name):
    R = stability_function(method(name))
    grid = np.linspace(0, 20, 400001)[1:]
    for found, values in (
        (real_stability_interval(R), np.abs(R(-grid))),
        (imaginary_stability_interval(R), np.abs(R(1j * grid))),
    ):
        if found == 0:
            assert values[grid < 1].max() > 1
            continue
        outside = np.argmax(values > 1 + 1e-11)
        assert grid[outside] == pytest.approx(found, rel=2e-2)
        assert np.all(values[grid < found * (1 - 1e-12)] <= 1 + 1e-12)
        assert values[np.searchsorted(grid, found * 1.01)] > 1


@pytest.mark.parametrize(("k", "j"), [(0, 3), (0, 4), (1, 4), (2, 5), (0, 5)])
def test_angles_by_sampling(k, j):
    R = StabilityFunction(*pade(k, j))
    angle = stability_angle(R)
    rays = np.geomspace(1e-3, 1e4, 20001)
    for degrees, holds in ((angle - 0.01, True), (angle + 0.01, False)):
        ray = -rays * np.exp(1j * math.radians(degrees))
        assert bool(np.all(np.abs(R(ray)) <= 1 + 1e-13)) is holds
    assert all(abs(math.pi - abs(np.angle(pole))) > math.radians(angle) for pole in R.poles)


def test_angles():
    assert stability_angle(method("rk4")) == 0
    assert stability_angle(StabilityFunction([1, "2/3"], [1, "-1/3"])) == 0  # |R(∞)| = 2
    assert stability_angle(StabilityFunction(*pade(0, 3))) == pytest.approx(88.23, abs=0.005)
    assert stability_angle(method("sdirk2", gamma="24/100")) == 0


# ------------------------------------------------------------------------------------------------------------- orders


@pytest.mark.parametrize(
    ("name", "linear", "dispersion", "dissipation"),
    [
        ("explicit-euler", 1, 2, 1),
        ("heun2", 2, 2, 3),
        ("kutta3", 3, 4, 3),
        ("rk4", 4, 4, 5),
        ("dormand-prince54", 5, 6, 5),
        ("tsit5", 5, 6, 5),
        ("dop853", 8, 8, 9),
        ("gauss2", 4, 4, None),
        ("radau-iia2", 3, 4, 3),
        ("implicit-euler", 1, 2, 1),
    ],
)
def test_orders(name, linear, dispersion, dissipation):
    R = stability_function(method(name))
    assert (linear_order(R), dispersion_order(R), dissipation_order(R)) == (linear, dispersion, dissipation)


@pytest.mark.parametrize("name", ["heun2", "kutta3", "rk4", "radau-iia2", "lobatto-iiic3", "gauss3"])
def test_phase_and_amplification_errors_by_series(name):
    """A second way: the series of log R(iy) = log |R| + i arg R."""
    y = sympy.Symbol("y", real=True)
    terms = 9
    z = sympy.Symbol("z")
    R = stability_function(method(name))
    series = sympy.series(sympy.log(R(z)), z, 0, terms).removeO()
    assert linear_order(R) == next(k for k in range(1, terms) if sympy.simplify((series - z).coeff(z, k))) - 1
    error = sympy.expand((series - z).subs(z, sympy.I * y))
    found = [sympy.simplify(error.coeff(y, k)) for k in range(terms)]
    phase = next(k for k in range(1, terms, 2) if found[k])
    damping = next((k for k in range(2, terms, 2) if found[k]), None)
    assert (dispersion_order(R), dissipation_order(R)) == (phase - 1, damping and damping - 1)


@pytest.mark.parametrize(("c4", "dispersion"), [("1/24", 4), ("1/30", 6), ("1/20", 4)])
def test_phase_fitting(c4, dispersion):
    """A free coefficient raises the dispersion order beyond the order (van der Houwen & Sommeijer 1987)."""
    R = StabilityFunction([1, 1, "1/2", "1/6", c4])
    assert dispersion_order(R) == dispersion
    errors = [y - np.angle(R(1j * y)) for y in (0.1, 0.05)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(dispersion + 1, abs=0.05)


def test_inconsistent_methods():
    wrong = RungeKutta([[0]], ["1/2"], warn=False)
    assert (linear_order(wrong), dispersion_order(wrong)) == (0, 0)
    idle = RungeKutta([[0]], [0], warn=False)
    assert (linear_order(idle), is_a_stable(idle), dissipation_order(idle)) == (0, True, None)


# ------------------------------------------------------------------------------------------------------- all together


def test_properties_are_json():
    for name in ("rk4", "gauss3", "sdirk2", "crouzeix3", "tsit5", "ssprk104"):
        facts = tableau_properties(method(name))
        assert json.loads(json.dumps(facts, allow_nan=False)) == facts
        assert {key for key, value in facts.items() if value is None} == set(facts["undecided"])
    assert tableau_properties(method("gauss2")) == {
        "stability_function": "(1 + z/2 + z^2/12)/(1 - z/2 + z^2/12)",
        "stability_at_infinity": "1",
        "linear_order": 4,
        "dispersion_order": 4,
        "dissipation_order": "inf",
        "i_stable": True,
        "a_stable": True,
        "l_stable": False,
        "stability_angle": "90.0",
        "real_stability_interval": "inf",
        "imaginary_stability_interval": "inf",
        "linear_ssp_coefficient": None,
        "algebraically_stable": True,
        "ssp_coefficient": "0",
        "undecided": {"linear_ssp_coefficient": "the stability function is no polynomial"},
    }
    assert tableau_properties(method("sdirk2"))["undecided"]["a_stable"] == "depends on gamma"


def test_roots_and_symbols_together():
    mixed = RungeKutta([["sqrt(2)*x", "sqrt(x)"], ["1/x", "1/2"]], ["1/2", "sqrt(3)*x"], parameters=["x"], warn=False)
    facts = tableau_properties(mixed)
    assert facts["linear_order"] == 0
    assert facts["undecided"]["dissipation_order"] == "formulas with roots and symbols would take long"


def test_numbers_beyond_the_range_of_floats():
    far = RungeKutta([[0, 0], [1, 0]], [Fraction(10**400), Fraction(1, 10**400)], warn=False)
    assert (real_stability_interval(far), stability_function(far)(0.5)) == (0, math.inf)
    for tableau in (
        RungeKutta([[1e300]], [1e300], warn=False),
        RungeKutta([[0, 0], [1e300, 0]], [1e9, 1.0], warn=False),
    ):
        assert tableau_properties(tableau)["a_stable"] is not tableau.is_explicit


def test_properties_of_large_methods_are_not_asked_for():
    facts = tableau_properties(method("gauss50"))
    assert facts.keys() == tableau_properties(method("rk4")).keys()
    assert facts["a_stable"] is None
    assert "more than 30 stages" in facts["undecided"]["a_stable"]


@pytest.mark.parametrize(
    "ask", [stability_function, is_a_stable, linear_order, dissipation_order, stability_angle, tableau_properties]
)
@pytest.mark.parametrize("bad", [None, 3])
def test_bad_methods(ask, bad):
    with pytest.raises(IntegratorError, match="method must be a RungeKutta, but was"):
        ask(bad)


def test_partitioned_methods_are_refused():
    with pytest.raises(
        IntegratorError, match=r"must be a RungeKutta, but was .*a partitioned method needs y' = λy split"
    ):
        stability_function(method("stormer-verlet"))
    assert isinstance(method("stormer-verlet"), PartitionedRungeKutta)


def test_bad_functions():
    with pytest.raises(IntegratorError, match="denominator must not vanish at z = 0, but was"):
        StabilityFunction([1], [0, 1])
    with pytest.raises(IntegratorError, match="denominator must not vanish"):
        StabilityFunction([1], [])
    with pytest.raises(IntegratorError, match="numerator must be a sequence, but was 1"):
        StabilityFunction(1)
    with pytest.raises(IntegratorError, match=r"numerator\[1\] must be a real number or a formula"):
        StabilityFunction([1, None])
    with pytest.raises(IntegratorError, match="must not mix floats and symbols"):
        StabilityFunction([1, 0.5, sympy.Symbol("a")])
    R = stability_function(method("implicit-euler"))
    for pole in (1, 1.0, 1 + 0j):
        with pytest.raises(IntegratorError, match=r"z must not be a pole, but was \(?1"):
            R(pole)
    for bad in ("1", None, ["a"]):
        with pytest.raises(IntegratorError, match="z must be a number or an array of numbers, but was"):
            R(bad)
    with pytest.raises(IntegratorError, match="z must be exact while gamma have no values"):
        stability_function(method("sdirk2"))(0.5)
    with pytest.raises(IntegratorError, match="coefficients must be numbers before poles are found"):
        _ = stability_function(method("sdirk2")).poles
