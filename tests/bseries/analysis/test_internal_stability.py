"""Internal stability functions against errors that are added to the stages, by the definition of each form."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy

import bseries as bs
from integrators import IntegratorError, RungeKutta, method

Z, R = sympy.symbols("z r")


def rational(x):
    return sympy.Rational(x) if isinstance(x, (int, Fraction)) else sympy.sympify(x)


def perturbed_end(made, stage):
    """The end of a step from y = 0 of y' = λy, to whose stage the error r is added: each form runs literally."""
    given = {
        name: [[rational(x) for x in row] if isinstance(row, tuple) else rational(row) for row in rows]
        for name, rows in made.form.coefficients.items()
    }
    error = [R if i == stage else sympy.Integer(0) for i in range(made.stages)]
    u = other = sympy.Integer(0)
    match made.form.kind:
        case "2N":
            for i, (a, b) in enumerate(zip(given["A"], given["B"], strict=True)):
                u += error[i]
                other = a * other + Z * u
                u += b * other
        case "2R":
            for i, b in enumerate(given["b"]):
                slope = Z * (u + error[i])
                u = other + given["a"][i] * slope if i < made.stages - 1 else u
                other += b * slope
            u = other
        case "3S*":
            for i, (g, b, d) in enumerate(zip(given["gamma"], given["beta"], given["delta"], strict=True)):
                u += error[i]
                other += d * u
                u = g[0] * u + g[1] * other + b * Z * u
        case "Shu-Osher":
            stages = []
            for i, (alpha, beta) in enumerate(zip(given["alpha"], given["beta"], strict=True)):
                rows = zip(alpha, beta, stages, strict=False)
                stages.append(sum(((a + b * Z) * y for a, b, y in rows), sympy.Integer(0)))
                if i < made.stages:
                    stages[i] += error[i]
            u = stages[-1]
    return sympy.expand(u / R)


def polynomial(function):
    return sympy.expand(sum(rational(x) * Z**k for k, x in enumerate(function.numerator)))


EXACT = [
    method("williamson3"),
    method("ssprk33"),
    method("ssprk43"),
    method("ssprk104"),
    RungeKutta.from_2r(["1/2", "3/4"], ["1/4", "1/3", "5/12"]),
    RungeKutta.from_2n([0, "-1/(2*a)"], ["1/2", "a"], parameters=["a"], name="symbols", warn=False),
    RungeKutta.from_shu_osher([[0, 0], ["1/2", 0], ["1/3", "1/3"]], [[0, 0], [1, 0], [0, 1]], name="rest", warn=False),
]


@pytest.mark.parametrize("made", EXACT, ids=lambda made: f"{made.form.kind}-{made.name}")
def test_functions_are_derivatives_by_the_error_of_a_stage(made):
    found = bs.stability.internal_stability_functions(made)
    assert [polynomial(Q) for Q in found] == [perturbed_end(made, j) for j in range(made.stages)]


def test_ssprk33_as_published_and_its_tableau_otherwise():
    found = bs.stability.internal_stability_functions("ssprk33")
    half, third, sixth = Fraction(1, 2), Fraction(1, 3), Fraction(1, 6)
    assert [Q.numerator for Q in found] == [(1, 1, half, sixth), (sixth, third, sixth), (2 * third, 2 * third)]
    assert all(Q.denominator == (1,) for Q in found)
    tableau = RungeKutta(method("ssprk33").A, method("ssprk33").b)
    assert tableau == method("ssprk33")
    assert bs.stability.internal_stability_functions(tableau) != found


@pytest.mark.parametrize("name", ["rk4", "heun3", "ralston4"])
def test_without_a_form_they_are_z_b_over_identity_minus_z_a(name):
    made = method(name)
    size = made.stages
    A = sympy.Matrix(size, size, lambda i, j: rational(made.A[i][j]))
    b = sympy.Matrix(1, size, [rational(x) for x in made.b])
    powers = sum((Z**k * A**k for k in range(size)), sympy.zeros(size))
    expected = [sympy.expand(x) for x in Z * b * powers]
    found = bs.stability.internal_stability_functions(made)
    assert [sympy.simplify(polynomial(Q) - x) for Q, x in zip(found, expected, strict=True)] == [0] * size


def test_decimals_keep_their_digits_and_2n_begins_with_the_stability_function():
    for name in ("niegemann124", "carpenter-kennedy54"):
        (first, *_) = bs.stability.internal_stability_functions(name)
        R = bs.stability_function(name)
        assert first.digits == R.digits == method(name).digits
        assert max(abs(x - y) for x, y in zip(first.numerator, R.numerator, strict=True)) < 1e-14


def test_other_methods_are_refused():
    with pytest.raises(IntegratorError, match="method must be explicit or have a form, but was <RungeKutta gauss2"):
        bs.stability.internal_stability_functions("gauss2")
    with pytest.raises(IntegratorError, match="method must be a RungeKutta"):
        bs.stability.internal_stability_functions("strang")
